"""A program that finds normals: a stand-in that reads what it is given and writes least squares, in every bad way."""

import shlex
import sys
import time

import numpy as np
import pytest

from fixtures.lit_surfaces import matte
from scene.errors import SceneError
from scene.normals import angular_error_deg
from solve.external import External
from solve.given_normals import solve_external

STAND_IN = """
import subprocess, sys, time
from pathlib import Path
data, out, manner = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
print("loading weights", file=sys.stderr, flush=True)
# Before what takes seconds to load on a busy machine.
if manner == "slow":
    late = f"import time, pathlib; time.sleep(3); pathlib.Path({str(out / 'late')!r}).touch()"
    subprocess.Popen([sys.executable, "-c", late])
    time.sleep(60)
import cv2, numpy as np, scipy.io
assert {path.name for path in data.iterdir()} >= {"filenames.txt", "mask.png"}
assert not any("gt" in path.name or "truth" in path.name for path in data.iterdir())
names = (data / "filenames.txt").read_text().split()
lights = np.loadtxt(data / "light_directions.txt")
strength = np.loadtxt(data / "light_intensities.txt")
images = np.stack([cv2.imread(str(data / name), -1)[..., ::-1] for name in names]) / 65535
mask = cv2.imread(str(data / "mask.png"), 0) > 127
gray = (images / strength[:, None, None]).mean(-1)
normals = np.einsum("if,fhw->hwi", np.linalg.pinv(lights), gray)
normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
normals[~mask] = 0
if manner == "crash":
    raise RuntimeError("CUDA out of memory")
if manner == "nothing":
    sys.exit(0)
normals = {
    "nan": normals * np.nan,
    "size": normals[:-1],
    "elsewhere": np.roll(normals, 20, axis=(0, 1)),
    "random": np.random.default_rng(0).standard_normal(normals.shape),
    "opencv": normals * [1, -1, -1],
    "inverted": normals * [-1, -1, 1],
    "swapped": normals[..., [2, 0, 1]] * [-1, 1, 1],
    "lengths": 3 * normals,
}.get(manner, normals)
if manner == "mat":
    scipy.io.savemat(out / "result.mat", {"Normal_est": normals, "seconds": 3.0})
elif manner == "png":
    cv2.imwrite(str(out / "normal.png"), np.round((normals[..., ::-1] + 1) / 2 * 65535).astype(np.uint16))
    cv2.imwrite(str(out / "albedo.png"), images[0])
else:
    np.save(out / "normals.npy", normals)
"""


@pytest.fixture
def scene(asked):
    """An albedo of a varying colour, under lights of unlike strength."""
    return asked(np.random.default_rng(10071).uniform(0.6, 1.4, (9, 3)), texture=0.25)


@pytest.fixture
def run(scene, tmp_path):
    script = tmp_path / "stand in.py"
    script.write_text(STAND_IN)

    def start(manner, timeout_s=30.0):
        command = f"{shlex.quote(sys.executable)} {shlex.quote(str(script))} {{data}} {{out}} {shlex.quote(manner)}"
        external = External.parse(f"StandIn={command}", timeout_s)
        return solve_external(external, *scene[:4], tmp_path / "external" / "StandIn")

    return start


@pytest.mark.parametrize(
    ("manner", "axes"),
    [
        ("plain", "(x, y, z)"),
        ("lengths", "(x, y, z)"),
        ("mat", "(x, y, z)"),
        ("png", "(x, y, z)"),
        ("opencv", "(x, -y, -z)"),
        ("swapped", "(y, z, -x)"),
    ],
)
def test_normals_come_back_in_the_camera_frame_whatever_the_programs_axes(manner, axes, run, scene, tmp_path):
    frames, lights, _, mask, normals = scene
    estimate = run(manner)
    assert estimate.settings["axes"] == axes
    assert not estimate.warnings
    assert angular_error_deg(estimate.normals, normals)[mask].max() < 0.05
    assert np.isnan(estimate.normals[~mask]).all()
    assert estimate.method == "StandIn"
    assert (estimate.samples[mask] >= 6).all()
    expected = matte(lights, normals, normals, np.nan_to_num(estimate.albedo))
    np.testing.assert_allclose(expected[0][mask], frames.frame(0)[mask], rtol=0.01)
    assert not (tmp_path / "external" / "StandIn" / "object.data").exists()


def test_a_map_that_is_convex_for_concave_is_put_right_and_told(run, scene):
    *_, mask, normals = scene
    estimate = run("inverted")
    assert estimate.settings["axes"] == "(-x, -y, z)"
    assert angular_error_deg(estimate.normals, normals)[mask].max() < 0.05
    assert [text for text in estimate.warnings if "convex for concave" in text] == list(estimate.warnings)


@pytest.mark.parametrize(
    ("manner", "words"),
    [
        ("crash", ["exit code 1", "CUDA out of memory", "stderr.txt"]),
        ("nan", ["no pixel", "data"]),
        ("size", ["found an array", "expected"]),
        ("nothing", ["left nothing", "normals.npy"]),
        ("random", ["do not explain"]),
        ("elsewhere", ["do not explain", "of another object"]),
    ],
)
def test_each_failure_is_one_message(manner, words, run):
    with pytest.raises(SceneError) as error:
        run(manner)
    for word in words:
        assert word in str(error.value)


def test_a_program_that_takes_too_long_is_ended_with_all_that_it_started(run, tmp_path):
    start = time.monotonic()
    with pytest.raises(SceneError, match=r"stopped after 2 s(.|\n)*loading weights"):
        run("slow", timeout_s=2)
    assert time.monotonic() - start < 20
    time.sleep(3.5)
    assert not (tmp_path / "external" / "StandIn" / "out" / "late").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lino=run {data} {out}", "capital"),
        ("=run {data} {out}", "NAME=COMMAND"),
        ("LINO=run {data}", "{out} missing"),
        ("LINO=run '{data} {out}", "cannot be read"),
        ("LINO=no_such_program {data} {out}", "cannot be started"),
    ],
)
def test_what_is_wrong_with_a_command_is_said(text, words, scene, tmp_path):
    with pytest.raises(SceneError, match=words):
        solve_external(External.parse(text, 5), *scene[:4], tmp_path / "x")


def test_a_word_may_be_longer_than_a_files_name():
    program = f"print('{300 * 'x'}')"
    found = External.parse(f'LINO={sys.executable} -c "{program}" {{data}} {{out}}', 5)
    assert found.words == (sys.executable, "-c", program, "{data}", "{out}")
    assert [str(path) for path in found.files] == [sys.executable]
