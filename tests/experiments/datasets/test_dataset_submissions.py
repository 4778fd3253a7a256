"""A submission is told all that is wrong with it at once; a right one is scored as the test does it by hand."""

import json
import shutil

import cv2
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from experiments.catalogue import catalogue
from experiments.datasets.make import make
from experiments.datasets.publish import publish
from experiments.datasets.run_methods import ABSENT, run
from experiments.datasets.shelf import add, entries, select
from experiments.datasets.site import write_site
from experiments.datasets.submissions import check_submission, dataset_folders, read_submissions
from lab.options import Solving
from lab.plan import STEPS
from lab.run import open_job
from scene.errors import SceneError

TOML = """method = "MyNet"
authors = "A. Author"
settings = "published weights"
hardware = "one core"
seconds = 1.5
code = "https://example.org/code"
"""


def truth_of(folder):
    return loadmat(folder / "Normal_gt.mat")["Normal_gt"]


@pytest.fixture
def shelf(dented, tmp_path):
    """Two datasets with normals of their own: the dented ball, and the same without its right half."""
    place = tmp_path / "shelf"
    add(place, dented, name="dented")
    half = tmp_path / "half"
    shutil.copytree(dented, half)
    normals = truth_of(half)
    normals[:, 34:] = 0
    savemat(half / "Normal_gt.mat", {"Normal_gt": normals})
    cv2.imwrite(str(half / "mask.png"), np.any(normals != 0, -1).astype(np.uint8) * 255)
    add(place, half, name="half")
    return place


@pytest.fixture
def submit(tmp_path):
    """Return what writes a submission of some maps."""

    def write(maps, toml=TOML, name="theirs"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "submission.toml").write_text(toml)
        for file, normals in maps.items():
            np.save(folder / f"{file}.npy", normals)
        return folder

    return write


def slanted(normals, degrees=10.0):
    """Return normals turned about the x axis."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return normals @ np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])


def test_a_submission_is_scored_as_by_hand(shelf, submit, tmp_path):
    normals = slanted(truth_of(shelf / "dented"))
    normals[:, :20] = np.nan
    folder = submit({"dented": normals})
    (found,) = read_submissions(folder.parent, shelf)
    assert not found.faults
    assert any(note.startswith("gaps") for note in found.notes)
    assert any(note.startswith("1 of 2 datasets have no map here: half") for note in found.notes)
    rows = run(shelf, [], solving=Solving("ls"), submissions=[found], out=tmp_path / "out")
    by_place = {(row["dataset"], row["method"]): row for row in rows}
    assert by_place["half", "MyNet"]["status"] == ABSENT
    row, truth = by_place["dented", "MyNet"], truth_of(shelf / "dented")
    mask = np.any(truth != 0, -1)
    answered = mask & np.isfinite(normals[..., 0])
    cosine = np.sum(normals * truth, -1)[answered]
    error = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    gaps = 1 - answered.sum() / mask.sum()
    assert row["mean_deg"] == pytest.approx(error.mean(), abs=1e-3)
    assert row["unanswered"] == pytest.approx(gaps)
    assert row["filled_deg"] == pytest.approx((1 - gaps) * error.mean() + gaps * 90, abs=1e-3)
    assert row["seconds"] == 1.5
    codes = cv2.imread(str(row["map"]), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(codes != 65535, answered)
    np.testing.assert_allclose(codes[answered] / 100, error, atol=0.011)
    # What a method of ours answers and what is submitted of it have the same error.
    work = tmp_path / "out" / "work" / "half" / "normals" / "ls.npy"
    again = submit({"half": np.load(work)}, TOML.replace("MyNet", "Again"), "again")
    rows = run(shelf, ["half"], solving=Solving("ls"), submissions=read_submissions(again, shelf), out=tmp_path / "out")
    assert rows[0]["mean_deg"] == pytest.approx(rows[1]["mean_deg"], abs=1e-4)


@pytest.mark.parametrize(
    ("turn", "words", "cure"),
    [
        ([1, -1, 1], "y points down", "Change the sign of the second of the components."),
        ([1, 1, -1], "z points away from the viewer", "Change the sign of the third of the components."),
        ([1, -1, -1], "OpenCV's frame", "second and third"),
    ],
)
@pytest.mark.parametrize("with_truth", [True, False])
def test_flipped_axes_are_told_by_the_truth_or_by_least_squares(shelf, submit, turn, words, cure, with_truth, tmp_path):
    maps = {name: slanted(truth_of(shelf / name), 4.0) * turn for name in ("dented", "half")}
    place = shelf
    if not with_truth:
        place = tmp_path / "public"
        publish(shelf, select(entries(shelf), ["dented", "half"]), place)
    found = check_submission(submit(maps), dataset_folders(place))
    assert len(found.faults) == 1
    assert found.faults[0].startswith("2 of 2 maps: dented.npy, half.npy: ")
    assert words in found.faults[0]
    assert cure in found.faults[0]
    with pytest.raises(SceneError, match=r"not scored, 2 of 2 maps"):
        read_submissions(found.folder, place)


def test_one_map_that_lies_otherwise_is_a_note_and_inverted_relief_an_error_of_the_method(shelf, submit):
    normals = {name: truth_of(shelf / name) for name in ("dented", "half")}
    found = check_submission(submit({**normals, "dented": normals["dented"][::-1]}), dataset_folders(shelf))
    assert found.faults
    assert "mirrored top to bottom" in found.faults[0]
    inverted = {name: one * [-1, -1, 1] for name, one in normals.items()}
    found = check_submission(submit(inverted, name="inverted"), dataset_folders(shelf))
    assert not found.faults
    assert any("Scored as given" in note for note in found.notes)


def test_what_is_right_raises_no_alarm_however_large_its_errors(shelf, submit):
    generator = np.random.default_rng(10011)
    maps = {}
    for name in ("dented", "half"):
        normals = truth_of(shelf / name) + 0.6 * generator.standard_normal((40, 52, 3))
        maps[name] = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    found = check_submission(submit(maps), dataset_folders(shelf))
    assert found.faults == found.notes == []


def test_all_that_is_wrong_is_told_at_once(shelf, submit, run_rgbn):
    normals = truth_of(shelf / "dented")
    toml = 'method = "mynet"\nauthors = ""\nweights = 3\nseconds = "fast"\nhardware = "h"\n'
    folder = submit({"dented": normals[:-1], "half": 3 * normals, "dentde": normals}, toml)
    (folder / "notes.txt").write_text("x")
    cv2.imwrite(str(folder / "half.png"), np.zeros((40, 52, 3), np.uint16))
    code, _, said = run_rgbn("dataset", "check", folder, "--shelf", shelf)
    assert code == 2
    for words in (
        "9 faults.",
        "method: found 'mynet'; expected a name that begins with a capital",
        "authors: found ''; expected their names",
        "weights: unknown key",
        "seconds: found 'fast'",
        "settings: missing",
        "dented.npy: found an array of 39 x 52 x 3, expected 40 x 52 x 3",
        "half.npy: 100.0% of the vectors are not of length 1 (median length 3)",
        "half.png: half.npy is of the same dataset",
        "dentde.npy: there is no dataset dentde. Did you mean dented?",
        "note: notes.txt: no normal map",
    ):
        assert words in said
    assert "Traceback" not in said


def test_pictures_of_sixteen_bits_are_read_and_eight_bits_noted(shelf, submit, run_rgbn):
    folder = submit({})
    for name, depth in (("dented", 65535), ("half", 255)):
        codes = np.round((truth_of(shelf / name) + 1) / 2 * depth)[..., ::-1]
        cv2.imwrite(str(folder / f"{name}.png"), codes.astype(np.uint16 if depth > 255 else np.uint8))
    code, said, notes = run_rgbn("dataset", "check", folder, "--shelf", shelf, "--json")
    assert code == 0
    assert json.loads(said)["maps"] == ["dented", "half"]
    assert "half.png: 8 bits, expected 16" in notes
    assert "dented.png" not in notes


def test_a_folder_without_a_submission_is_told(shelf, tmp_path):
    with pytest.raises(SceneError, match=r"found no submission, expected a folder with submission\.toml"):
        read_submissions(tmp_path / "shelf", shelf)


def test_a_published_folder_holds_no_truth_in_any_file(shelf, tmp_path):
    """Byte for byte the same whatever the truth is: nothing of it can be in there."""
    public = tmp_path / "public"
    (folder,) = publish(shelf, select(entries(shelf), ["dented"]), public)
    assert (shelf / "dented" / "Normal_gt.mat").is_file(), "it stays with who scores"
    other = tmp_path / "other"
    shutil.copytree(shelf / "dented", other)
    savemat(other / "Normal_gt.mat", {"Normal_gt": slanted(truth_of(other), 3.0)})
    (other / "truth").mkdir()
    np.save(other / "truth" / "truth_albedo.npy", np.ones((40, 52, 3)))
    (other / "preview.png").write_bytes(b"its normals as a picture")
    (other / "session.toml").write_text('[frames]\nflash = "0*.png"\n[object]\nscan = "scan.ply"\n')
    (other / "recipe.json").write_text('{"recipe": {"shape": "pear"}}')
    second = tmp_path / "second"
    add(second, other, name="dented", text="another text, which may say what it is")
    (again,) = publish(second, select(entries(second), ["dented"]), tmp_path / "public2")
    files = {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    assert files == {path.relative_to(again) for path in again.rglob("*") if path.is_file()}
    assert all((folder / name).read_bytes() == (again / name).read_bytes() for name in files)
    photographs = {f"{number:03d}.png" for number in range(1, 13)}
    tables = {"filenames.txt", "light_directions.txt", "light_intensities.txt", "mask.png"}
    written = {"README.md", "preview.png", "croissant.json", "SHA256SUMS"}
    assert {str(name) for name in files} == photographs | tables | written
    # Nor has the record beside it.
    assert not any("Normal" in path.read_text() for path in public.rglob(".rgbn/*") if path.is_file())


@pytest.mark.render
def test_a_catalogues_dataset_without_its_truth_is_solved_but_not_judged(tmp_path, run_rgbn):
    """Its own copy: lights, camera and mask are there, the recipe is not; `run` says what to do instead."""
    shelf, public, name = tmp_path / "shelf", tmp_path / "public", "pear-images-04-32px"
    make(shelf, [catalogue()["pear-images-04"].sized(32)], processes=1)
    code, said, notes = run_rgbn("dataset", "publish", name, "--to", public, "--shelf", shelf)
    assert (code, said.strip()) == (0, str(public / name))
    assert f"note: {name}: of the catalogue, whose truth anybody who has rgbn can make" in notes
    there = {path.name for path in (public / name).iterdir()}
    assert there >= {"session.toml", "lights.json", "001.png"}
    assert not there & {"recipe.json", "truth", "Normal_gt.mat", "Normal_gt.png", "lights.lp"}
    text = "".join(path.read_text() for path in (public / name).glob("*.[tjmc]*") if path.suffix != ".png")
    assert "normals =" not in text
    code, _, said = run_rgbn("dataset", "run", "--shelf", public, "--out", tmp_path / "out")
    assert code == 2
    assert "has no true normals" in said
    with open_job(public / name, out=tmp_path / "solved", solving=Solving("ls")) as job:
        job.run(STEPS, "solve")
    folder = tmp_path / "answer"
    folder.mkdir()
    (folder / "submission.toml").write_text(TOML)
    np.save(folder / f"{name}.npy", job.store.load_normals("ls"))
    rows = run(shelf, [], solving=Solving("ls"), submissions=read_submissions(folder, shelf), out=tmp_path / "scored")
    assert rows[0]["mean_deg"] == pytest.approx(rows[1]["mean_deg"], abs=1e-4)


def test_the_site_of_a_dataset_whose_truth_is_kept_back_betrays_nothing(shelf, submit, tmp_path):
    publish(shelf, select(entries(shelf), ["dented"]), tmp_path / "public")
    assert [one.kept_back != "" for one in entries(shelf) if one.state] == [True, False]
    given = read_submissions(submit({"dented": truth_of(shelf / "dented")}), shelf)
    rows = run(shelf, [], solving=Solving("ls"), submissions=given, out=tmp_path / "out")
    assert next(row for row in rows if row["method"] == "MyNet")["mean_deg"] < 0.01
    site = write_site(shelf, tmp_path / "out", rows, given).parent
    kept, shown = ((site / f"{name}.html").read_text() for name in ("dented", "half"))
    assert "Kept back" in kept
    assert "Kept back" not in shown
    assert "error map of ls" in shown
    assert kept.count("<img") == 1
    assert "../../public/dented/001.png" in kept
    assert "Normal_gt" not in kept + (site / "dented.croissant.json").read_text() + (site / "dented.sha256").read_text()
    assert "Normal_gt.mat" in shown
