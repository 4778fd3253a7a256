"""What is made: whole or not at all, the same bytes twice, and a truth by which anyone can explain the photographs."""

import hashlib
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.io import loadmat

from experiments.catalogue import catalogue
from experiments.datasets.make import make, make_one, mark_of
from experiments.datasets.shelf import contents
from formats.meshes.scan_files import read_scan
from scene.errors import SceneError
from scene.output_folder import open_record
from tests.twin.twin_scenes import NEEDS_LLVM

pytestmark = [pytest.mark.render, NEEDS_LLVM]
SIDE = 40


def small(name):
    one = catalogue()[name].sized(SIDE)
    return replace(one, recipe=replace(one.recipe, count=12, seed=10001))


def read(folder):
    """What a program of others reads."""
    names = (folder / "filenames.txt").read_text().split()
    photographs = np.stack([cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED)[..., ::-1] for name in names])
    assert photographs.dtype == np.uint16
    directions, intensities = (np.loadtxt(folder / f"light_{what}.txt") for what in ("directions", "intensities"))
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) == 255
    return photographs / 65535, directions, intensities, mask, loadmat(folder / "Normal_gt.mat")["Normal_gt"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return what makes a dataset, once, and gives its folder."""
    shelf = tmp_path_factory.mktemp("shelf")
    return lambda name: make(shelf, [small(name)], processes=1)[0]


def test_the_true_maps_explain_near_lights(made):
    """Albedo, depth, shadows, positions and camera give the photographs, light by light, pixel by pixel."""
    folder = made("knot-hand-16")
    values, _, _, mask, normals = read(folder)
    from scene.store import Store
    from twin.ground_truth import lights_of

    truth = {name: np.load(folder / "truth" / f"truth_{name}.npy") for name in ("albedo", "z_mm", "attached", "cast")}
    lights = Store(folder).load_lights()
    from capture.session.session import load_session

    camera = load_session(folder).camera
    v, u = np.nonzero(mask)
    points = camera.points_at_depth(np.stack([u, v], -1), truth["z_mm"][mask][:, None].astype(float))
    shade = np.einsum("npci,pi->npc", lights.at(points), normals[mask]) * truth["albedo"][mask]
    dark = np.stack([lights_of(truth[name], len(lights))[:, mask] for name in ("attached", "cast")]).any(0)
    expected = np.where(dark[..., None], 0, shade)
    error = np.abs(values[:, mask] - expected).max(-1)
    assert 0.05 < dark.mean() < 0.6
    # Pixels on a limb or a shadow's edge are mixtures.
    assert np.quantile(error, 0.7) < 0.01
    assert np.median(error[~dark]) < 0.005


@pytest.mark.parametrize("name", ["knot-hand-16", pytest.param("blob-ambient-0.00", marks=pytest.mark.full)])
def test_what_is_made_has_the_layout(made, name):
    _, photograph, mask, normals = contents(made(name))
    assert photograph.shape == normals.shape == (*mask.shape, 3)


@pytest.mark.full
def test_every_file_has_its_checksum_and_made_twice_it_is_the_same(made, tmp_path):
    folder = made("blob-ambient-0.00")
    sums = dict(line.split("  ")[::-1] for line in (folder / "SHA256SUMS").read_text().splitlines())
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()} - {"SHA256SUMS"}
    assert set(sums) == files
    assert all(hashlib.sha256((folder / name).read_bytes()).hexdigest() == value for name, value in sums.items())
    # The surface as a scan has it: at the places that the camera sees.
    points, height = read_scan(folder / "truth" / "blob.ply")[0], np.load(folder / "truth" / "truth_z_mm.npy")
    assert points[:, 2].max() == pytest.approx(np.nanmax(height), abs=0.5)
    # By the command's own process, on one core, with another.
    again, _ = make(tmp_path, [small("blob-ambient-0.00"), small("knot-hand-16")], processes=1)
    assert (again / "SHA256SUMS").read_bytes() == (folder / "SHA256SUMS").read_bytes()


@pytest.mark.full
def test_what_is_there_is_left_and_what_is_not_current_is_made_anew(made, monkeypatch):
    one, folder = small("blob-ambient-0.00"), made("blob-ambient-0.00")
    shelf = folder.parent
    sums = (folder / "SHA256SUMS").read_text()
    assert mark_of(one) != mark_of(replace(one, recipe=replace(one.recipe, seed=10002)))
    before = (folder / "recipe.json").stat().st_mtime_ns
    assert make(shelf, [one]) == [folder]
    assert (folder / "recipe.json").stat().st_mtime_ns == before
    monkeypatch.setattr("experiments.datasets.make.mark_of", lambda _: "of another version")
    (folder / "mine.txt").write_text("mine")
    assert make(shelf, [one]) == [folder]
    assert (folder / "recipe.json").stat().st_mtime_ns > before
    assert (folder / "mine.txt").read_text() == "mine"
    (folder / "mine.txt").unlink()
    assert (folder / "SHA256SUMS").read_text() == sums
    # A file that somebody has changed is neither kept for ours nor written over.
    recipe = (folder / "recipe.json").read_text()
    (folder / "recipe.json").write_text("changed")
    with pytest.raises(SceneError, match=r"recipe.json: was changed after rgbn wrote it"):
        make(shelf, [one])
    assert (folder / "recipe.json").read_text() == "changed"
    (folder / "recipe.json").write_text(recipe)


def test_a_folder_that_is_not_ours_is_left(tmp_path):
    one = small("blob-ambient-0.00")
    with open_record(tmp_path):
        pass
    (tmp_path / one.name).mkdir()
    (tmp_path / one.name / "mine.txt").write_text("")
    with pytest.raises(SceneError, match="is not a dataset that rgbn made"):
        make(tmp_path, [one])
    assert (tmp_path / one.name / "mine.txt").exists()


def test_a_fault_of_ours_is_no_fault_of_the_input(tmp_path, monkeypatch):
    def photograph(dataset):
        raise fault

    monkeypatch.setattr("experiments.datasets.make.photograph_dataset", photograph)
    fault = SceneError("no renderer here")
    assert make_one(tmp_path, small("blob-ambient-0.00")) == "no renderer here"
    fault = TypeError("a slip")
    with pytest.raises(TypeError, match="a slip"):
        make_one(tmp_path, small("blob-ambient-0.00"))
