"""Every wrong convention is told by its name; what is only hard to explain raises no alarm."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from experiments.datasets.check import check_dataset
from solve.plausible_axes import AXES, axes_words

REAL = Path(__file__).resolve().parents[4] / "shared" / "real" / "diligent"
LIGHTS, POWER, NORMALS = "light_directions.txt", "light_intensities.txt", "Normal_gt.mat"
NAMED = {
    "(-x, y, z)": "x points left",
    "(x, -y, z)": "y points down",
    "(x, y, -z)": "z points away from the viewer",
    "(x, -y, -z)": "y points down and z away from the viewer (OpenCV's frame)",
    "(y, x, z)": "x and y are swapped",
}
SOME_AXES = [axes for number, axes in enumerate(AXES) if axes_words(axes) in NAMED or number == 14]


def change(folder, name, how):
    """Put a file's array through a function."""
    path = folder / name
    if name == NORMALS:
        savemat(path, {"Normal_gt": how(loadmat(path)["Normal_gt"])})
    elif name.endswith(".txt"):
        np.savetxt(path, how(np.loadtxt(path)), fmt="%.8f")
    else:
        cv2.imwrite(str(path), how(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)))


def photographs(folder):
    return (folder / "filenames.txt").read_text().split()


def only_fault(folder):
    faults = check_dataset(folder).faults
    assert len(faults) == 1, faults
    return faults[0]


@pytest.mark.parametrize(("gloss", "ambient"), [(0.0, 0.0), (0.5, 0.0), (0.0, 0.3)])
def test_right_conventions_raise_no_alarm(tmp_path, write_dented, gloss, ambient):
    verdict = check_dataset(write_dented(tmp_path / "right", gloss=gloss, ambient=ambient))
    assert verdict.faults == verdict.notes == ()
    assert verdict.facts["agreement"] > (0.85 if gloss or ambient else 0.999)


@pytest.mark.full
@pytest.mark.parametrize("name", ["ball", "cat"])
def test_diligent_itself_passes(name):
    if not REAL.is_dir():
        pytest.skip("DiLiGenT's photographs are not here")
    verdict = check_dataset(REAL / f"{name}PNG")
    assert verdict.faults == verdict.notes == ()
    assert verdict.facts["agreement"] > 0.95


@pytest.mark.parametrize("name", [LIGHTS, NORMALS])
@pytest.mark.parametrize("mended", SOME_AXES, ids=axes_words)
def test_wrong_axes_are_told_and_what_it_says_to_do_mends_them(dented, name, mended):
    change(dented, name, lambda rows: rows @ mended)
    fault = only_fault(dented)
    assert fault.startswith(f"{name}: {NAMED.get(axes_words(mended), 'the axes are permuted')}")
    assert f"For x, y, z write {axes_words(mended)}." in fault
    change(dented, name, lambda rows: rows @ mended.T)
    assert check_dataset(dented).faults == ()


def test_the_rim_of_a_hollow_does_not_mislead(tmp_path, write_dented):
    folder = write_dented(tmp_path / "hollow", hollow=True)
    verdict = check_dataset(folder)
    assert verdict.faults == ()
    assert any("right for a hollow" in note for note in verdict.notes)
    change(folder, LIGHTS, lambda rows: rows * [-1, 1, 1])
    assert only_fault(folder).startswith("light_directions.txt: x points left")


@pytest.mark.parametrize("signs", [(1, -1, 1), (1, -1, -1)])
def test_lights_and_normals_in_one_wrong_frame_are_both_told(dented, signs):
    """The photographs agree with them: the normals' own slopes tell."""
    change(dented, LIGHTS, lambda rows: rows * signs)
    change(dented, NORMALS, lambda normals: normals * signs)
    faults = check_dataset(dented).faults
    words = "y points down"
    assert sorted(fault.split(":")[0] for fault in faults) == [NORMALS, LIGHTS]
    assert all(words in fault for fault in faults)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        (lambda map_: map_[:, ::-1], "mirrored left to right"),
        (lambda map_: map_[::-1], "mirrored top to bottom"),
        (lambda map_: map_[::-1, ::-1], "turned by 180 degrees"),
        (lambda map_: map_.transpose(1, 0, 2).reshape(map_.shape), "transposed"),
    ],
)
def test_how_the_map_lies_is_told(dented, how, words):
    change(dented, NORMALS, how)
    fault = only_fault(dented)
    assert fault.startswith(f"{NORMALS}: the map is")
    assert words in fault


def test_photographs_upside_down_are_told(dented):
    for name in (*photographs(dented), "mask.png"):
        change(dented, name, lambda picture: picture[::-1])
    assert "the photographs are mirrored top to bottom" in only_fault(dented)


@pytest.mark.full
def test_intensities_are_held_against_the_photographs(dented):
    change(dented, POWER, lambda rows: 1 / rows)
    assert "inverse" in only_fault(dented)
    change(dented, POWER, lambda rows: 1 / rows)
    change(dented, POWER, lambda rows: rows * np.where(np.arange(12) == 4, 2, 1)[:, None])
    assert "row 5 by 0.5" in only_fault(dented)
    change(dented, POWER, lambda rows: rows / np.where(np.arange(12) == 4, 2, 1)[:, None])
    # One factor for all, and one a channel, change nothing.
    change(dented, POWER, lambda rows: rows * [3, 4, 5])
    assert check_dataset(dented).faults == ()
    rows = np.loadtxt(dented / POWER)
    for name, row in zip(photographs(dented), rows, strict=True):
        change(dented, name, lambda picture, row=row: np.round(picture / row[::-1] * 2).astype(np.uint16))
    assert "divided by these" in only_fault(dented)


def test_photographs_of_other_lights_are_told(dented):
    change(dented, LIGHTS, lambda rows: rows[[1, 0, *range(2, 12)]])
    assert "001.png that of row 2, 002.png that of row 1." in only_fault(dented)
    change(dented, LIGHTS, lambda rows: rows[[1, 0, *range(2, 12)]][::-1])
    faults = check_dataset(dented).faults
    assert any(fault.startswith("filenames.txt") and "001.png that of row 12" in fault for fault in faults)


def test_normals_of_another_object_are_refused(dented):
    generator = np.random.default_rng(10002)

    def shuffled(map_):
        known = np.any(map_ != 0, -1)
        map_[known] = generator.permutation(map_[known])
        return map_

    change(dented, NORMALS, shuffled)
    assert "explain the photographs" in only_fault(dented)


def test_all_faults_of_files_are_told_at_once(dented):
    change(dented, LIGHTS, lambda rows: 2 * rows)
    change(dented, POWER, lambda rows: rows[:-1])
    change(dented, "003.png", lambda picture: picture[:-1])
    change(dented, "004.png", lambda picture: 0 * picture)
    change(dented, NORMALS, lambda map_: 0.5 * map_)
    (dented / "mask.png").rename(dented / "000.png")
    cv2.imwrite(str(dented / "mask.png"), 255 - cv2.imread(str(dented / "000.png"), cv2.IMREAD_UNCHANGED))
    faults = "\n".join(check_dataset(dented).faults)
    for words in (
        "light_directions.txt: row 1, 2, 3, 4, 5 and 7 more have the length 2 (the first), expected 1",
        "light_intensities.txt: found 11 rows, expected 12",
        "003.png: 52 x 39 px, expected 52 x 40 px",
        "Normal_gt.mat: 100.0% of the vectors are not of length 1 (median length 0.5)",
        "mask.png seems inverted",
    ):
        assert words in faults, faults


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("filenames.txt", "filenames.txt: missing; the folder has 12 numbered PNGs"),
        (LIGHTS, "light_directions.txt: missing"),
        ("mask.png", "mask.png: missing"),
        (NORMALS, "Normal_gt.mat: missing, and so are normal.txt"),
        ("007.png", "filenames.txt: 007.png is not in the folder"),
    ],
)
def test_a_missing_file_is_told(dented, name, words):
    (dented / name).unlink()
    assert words in only_fault(dented)


def test_eight_bits_and_spare_photographs_are_notes(dented):
    for name in photographs(dented):
        change(dented, name, lambda picture: (picture // 256).astype(np.uint8))
    names = photographs(dented)
    (dented / "filenames.txt").write_text("\n".join(names[:-1]))
    for name in (LIGHTS, POWER):
        change(dented, name, lambda rows: rows[:-1])
    verdict = check_dataset(dented)
    assert verdict.faults == ()
    assert any("012.png is in the folder but not on the list" in note for note in verdict.notes)
    assert any("8 bits" in note for note in verdict.notes)
