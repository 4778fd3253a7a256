"""`rgbn twin SCENE.toml`: what it writes is a session that `rgbn process` goes all the way with; and `rgbn export`."""

import json

import numpy as np
import pytest
import rawpy

from capture.session.session import load_session
from scene.camera import Camera
from scene.normals import angular_error_deg
from scene.store import Store

SCENE = """
name = "plum"
[camera]
width = 96
height = 80
fx = 180.0
distortion = [-0.1, 0, 0, 0, 0]
[camera.sensor]
iso = 200
neutral = [0.6, 1.0, 0.7]
[[objects]]
shape = "sphere"
scale = [50, 40, 45]
translate_mm = [4, -3, -300]
material = "m"
[materials.m]
kind = "diffuse"
reflectance = [0.7, 0.5, 0.6]
[[lights]]
kind = "ring"
count = 8
polar_deg = 35
distance_mm = 700
[sampling]
engine = "mitsuba"
samples = 16
max_depth = 2
"""

pytestmark = pytest.mark.render


@pytest.fixture
def plum(tmp_path):
    (tmp_path / "plum.toml").write_text(SCENE)
    return tmp_path


def as_written(folder):
    """When each file was written; the log has a line of each run."""
    files = (path for path in folder.rglob("*") if ".rgbn" not in path.parts and path.name != "rgbn.log")
    return {path: path.stat().st_mtime_ns for path in files}


@pytest.mark.full
def test_a_scene_is_rendered_photographed_and_processed(plum, rgbn_process):
    run = rgbn_process("twin", plum / "plum.toml", "--out", plum / "twin", "--layers")
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == str(plum / "twin" / "session.toml")
    assert "engine mitsuba, 16 samples" in run.stderr
    assert "it was asked for" in run.stderr
    session = load_session(plum / "twin")
    assert session.name == "plum"
    assert [path.suffix for path in session.flash] == [".dng"] * 8
    assert isinstance(session.camera, Camera)
    assert session.camera.distortion[0] == -0.1
    with rawpy.imread(str(session.flash[0])) as raw:
        assert raw.raw_image.shape == (80, 96)
    facts = json.loads((plum / "twin" / "rendering.json").read_text())
    assert (facts["engine"], facts["samples_per_pixel"], facts["max_depth"]) == ("mitsuba", 16, 2)
    for name in ("normals", "albedo", "cast", "direct", "indirect"):
        assert (plum / "twin" / f"truth_{name}.npy").is_file()

    before = as_written(plum / "twin")
    again = rgbn_process("twin", plum / "plum.toml", "--out", plum / "twin", "--layers")
    assert again.returncode == 0
    assert "rendered already" in again.stderr
    assert before == as_written(plum / "twin")

    run = rgbn_process("process", plum / "twin", "--out", plum / "out", "--method", "near")
    assert run.returncode == 0, run.stderr
    assert (plum / "out" / "report.html").is_file()
    truth = np.load(plum / "twin" / "truth_normals.npy")
    found = Store(plum / "out").load_normals("near")
    error = angular_error_deg(found, truth)
    assert np.isfinite(error).sum() > 1500
    assert np.nanmedian(error) < 2


@pytest.mark.parametrize(
    ("out", "words", "message"),
    [
        (".", [], "rgbn did not make it"),
        ("mine", [], "rgbn did not make it"),
        ("twin", ["--photograph"], "[camera.sensor]"),
        ("twin", ["--error", "2"], "expected between 0 and 1"),
        ("twin", ["--engine", "fast"], "many"),
    ],
)
def test_what_cannot_be_asked_for_is_refused_and_nothing_is_written(plum, run_rgbn, out, words, message):
    """Nor is anything of anybody else's written over."""
    (plum / "mine").mkdir()
    (plum / "mine" / "session.toml").write_text('[frames]\nflash = "*.png"\n')
    code, _, said = run_rgbn("twin", plum / "plum.toml", "--out", plum / out, *words)
    assert (code, "Traceback" in said) == (2, False)
    assert message in said
    assert sorted(path.name for path in plum.rglob("*")) == ["mine", "plum.toml", "session.toml"]


def test_a_scene_description_goes_out_whole(plum, run_rgbn):
    np.save(plum / "a.npy", np.full((2, 2, 3), 0.5))
    (plum / "plum.toml").write_text(SCENE.replace("[0.7, 0.5, 0.6]", '{ file = "a.npy" }'))
    code, out, said = run_rgbn("export", plum / "plum.toml", "--out", plum / "out", "--format", "mitsuba")
    assert code == 0, said
    folder = plum / "out" / "export"
    assert out.strip() == str(folder / "scene.xml")
    assert "8 lights, one at a time" in said
    assert "-D light=ring_000" in said
    found = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    lights = [f"lights/ring_00{i}.xml" for i in range(8)]
    assert found == [*lights, "meshes/00.ply", "scene.xml", "textures/00.exr"]


def test_what_cannot_be_exported_is_refused(plum, run_rgbn):
    (plum / "bad.toml").write_text(SCENE.replace("fx", "focal"))
    for source, form, message in (
        ("bad.toml", "mitsuba", "camera.focal: unknown key"),
        ("no.toml", "mitsuba", "not found"),
        ("bad.toml", "dome", ""),
    ):
        code, _, said = run_rgbn("export", plum / source, "--out", plum / "out", "--format", form)
        assert (code, message in said, "Traceback" in said) == (2, True, False), said
        assert not (plum / "out" / "export").exists()


def test_a_scene_that_fills_the_picture_leaves_a_border_unmarked():
    from experiments.scene_twin import _marked

    marked = _marked(np.ones((240, 320), bool))
    assert 0.9 < marked.mean() < 0.98
    assert not marked[0].any()
    assert not marked[:, -1].any()
    part = np.zeros((240, 320), bool)
    part[:, :200] = True
    assert np.array_equal(_marked(part), part)
