"""Programs that find normals: a stand-in that writes least squares in every bad way, and those of the presets.

These read what the published ones read, as those do, and write what those write. They refuse what the real readers
would misread; weights and networks are not here.
"""

import shlex
import sys
import time

import cv2
import numpy as np
import pytest

from fixtures.lit_surfaces import ball_seen, even_cap, lights_along, matte
from formats.diligent_layout import write_diligent
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.external import PRESETS, External
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


def reddish(strength=1.0, texture=0.0):
    """Return (frames, lights, camera, mask, normals) of a reddish ball off the middle, uneven if wished."""
    camera = Camera(110, 90, 1.0, 1.0, 62.0, 40.0, projection="orthographic")
    _, normals, mask = ball_seen(camera, (0, 0, -100), 32.0, rim=0.45)
    normals = np.where(mask[..., None], normals, 0)
    lights = lights_along(even_cap(9, 26), strength).normalised()
    v, u = np.mgrid[:90, :110]
    albedo = [0.4, 0.25, 0.15] * (1 + texture * np.sin(np.stack([u / 5, v / 7, (u + v) / 6], -1)))
    return Frames.from_linear(lights.names, matte(lights, normals, normals, albedo)), lights, camera, mask, normals


@pytest.fixture
def scene():
    """An albedo of a varying colour, under lights of unlike strength."""
    return reddish(np.random.default_rng(10071).uniform(0.6, 1.4, (9, 3)), texture=0.25)


@pytest.fixture
def plain():
    """Lights of one strength: programs of others that know no lights are given it."""
    return reddish()


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
        ("inverted", "(-x, -y, z)"),
    ],
)
def test_normals_come_back_in_the_camera_frame_whatever_the_programs_axes(manner, axes, run, scene, tmp_path):
    frames, lights, _, mask, normals = scene
    estimate = run(manner)
    assert estimate.settings["axes"] == axes
    # A map that is convex for concave is put right, and told.
    told = ["convex for concave" in text for text in estimate.warnings]
    assert told == ([True] if manner == "inverted" else [])
    assert angular_error_deg(estimate.normals, normals)[mask].max() < 0.05
    assert np.isnan(estimate.normals[~mask]).all()
    assert estimate.method == "StandIn"
    assert (estimate.samples[mask] >= 6).all()
    expected = matte(lights, normals, normals, np.nan_to_num(estimate.albedo))
    np.testing.assert_allclose(expected[0][mask], frames.frame(0)[mask], rtol=0.01)
    assert not (tmp_path / "external" / "StandIn" / "object.data").exists()


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
        ("lino=run {data} {out}", ["capital"]),
        ("=run {data} {out}", ["NAME=COMMAND"]),
        ("LINO=run {data}", ["{out} missing"]),
        ("LINO=run '{data} {out}", ["cannot be read"]),
        ("LINO=no_such_program {data} {out}", ["cannot be started"]),
        ("Learned=sdm:HERE", ["expected PRESET:FOLDER", "lino-unips, sdm-unips, geo-unips, uni-ms-ps"]),
        ("Learned=sdm-unips:HERE", ["has no sdm_unips/main.py", "https://github.com/satoshi-ikehata"]),
        ("Learned=sdm-unips:'HERE/lacks weights'", ["has no weights checkpoint", "checkpoint/normal/*.pytmodel"]),
        ("Learned=lino-unips:'HERE/lacks python'", ["lacks python/.venv/bin/python", "second word"]),
        ("Learned=lino-unips:'HERE/lacks python' HERE/nothing", ["found no ", "nothing"]),
        ("Learned=lino-unips:" + 300 * "y", ["has no hubconf.py"]),
        ("Learned=lino-unips:~nobody_of_this_name/x", ["has no hubconf.py"]),
        ("Learned=run it", ["{data} and {out} missing", "PRESET:FOLDER"]),
    ],
)
def test_what_is_wrong_with_a_command_or_missing_is_said(text, words, scene, tmp_path):
    for name in ("lacks weights/sdm_unips/main.py", "lacks python/hubconf.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()
    with pytest.raises(SceneError) as error:
        external = External.parse(text.replace("HERE", str(tmp_path)), 5)
        assert words == ["cannot be started"], "all else is said before anything runs"
        solve_external(external, *scene[:4], tmp_path / "x")
    assert all(word in str(error.value) for word in words), error.value


def test_a_word_may_be_longer_than_a_files_name():
    program = f"print('{300 * 'x'}')"
    found = External.parse(f'LINO={sys.executable} -c "{program}" {{data}} {{out}}', 5)
    assert found.words == (sys.executable, "-c", program, "{data}", "{out}")
    assert [str(path) for path in found.files] == [sys.executable]


READ = """
import sys
from pathlib import Path
import cv2, numpy as np

def normals_of(images, mask, folder):
    # Least squares, in the axes that all three programs write: x right, y up, z toward the viewer.
    lights = np.load(Path(folder) / "lights.npy")
    assert len(images) == len(lights), "every photograph, each once"
    gray = np.stack([image.astype(float).mean(-1) for image in images])
    found = np.einsum("if,fhw->hwi", np.linalg.pinv(lights), gray)
    found /= np.maximum(np.linalg.norm(found, axis=-1, keepdims=True), 1e-9)
    return found * mask[..., None]

def checked(images, mask):
    for image in images:
        assert image.dtype == np.uint16 and image.shape == (*mask.shape[:2], 3), (image.dtype, image.shape)
    assert mask.dtype == np.uint8 and set(np.unique(mask)) == {0, 255}
    rows, columns = np.nonzero(mask if mask.ndim == 2 else mask[..., 0])
    # A margin of 8 pixels: without it SDM-UniPS and LINO-UniPS shrink the whole frame.
    assert rows.min() > 8 and columns.min() > 8
    assert rows.max() + 8 <= mask.shape[0] and columns.max() + 8 <= mask.shape[1]
"""

SDM = (
    READ
    + """
import argparse, glob, os
parser = argparse.ArgumentParser()
for name, default in (("session_name", "sdm_unips"), ("target", "normal_and_brdf"), ("checkpoint", "checkpoint"),
                      ("test_ext", ".data"), ("test_dir", "DefaultTest"), ("test_prefix", "L*")):
    parser.add_argument("--" + name, default=default)
parser.add_argument("--max_image_num", type=int, default=10)
parser.add_argument("--scalable", action="store_true")
args = parser.parse_args()
assert "".join(glob.glob(f"{args.checkpoint}/normal/*.pytmodel")), "weights"
assert args.target == "normal"
(folder,) = glob.glob(f"{args.test_dir}/*{args.test_ext}")
name = folder.split("/")[-1]
# Its pattern ends in one character that is none of . t x.
paths = sorted(path for path in glob.glob(f"{folder}/{args.test_prefix}[!.txt]") if os.path.isfile(path))
assert len(paths) <= args.max_image_num, "a random choice of them would be taken"
assert not os.path.exists(f"{folder}/Normal_gt.png") and not os.path.exists(f"{folder}/normal.tif")
how = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH
mask = cv2.imread(f"{folder}/mask.png", how)
images = [cv2.cvtColor(cv2.imread(path, how), cv2.COLOR_BGR2RGB) for path in paths]
checked(images, mask)
inside = mask > 0
normals = normals_of(images, inside, Path(__file__).parents[1])
out = Path(args.session_name) / "results" / name
out.mkdir(parents=True)
coded = 0.5 * (1 + normals) * inside[..., None]
cv2.imwrite(str(out / "normal.png"), 255 * coded[:, :, ::-1].astype(np.float32))
cv2.imwrite(str(out / "tiled.png"), (images[0] // 257).astype(np.uint8))
"""
)

# Made of SDM-UniPS: the same folder and reader, other options and another place of the weights.
GEO = (
    SDM.replace('("target", "normal_and_brdf"), ', "")
    .replace('assert args.target == "normal"\n', "")
    .replace("/normal/*.pytmodel", "/*.pytmodel")
    .replace('"--max_image_num"', '"--max_image_res", type=int, default=512)\nparser.add_argument("--max_image_num"')
)

UNI = (
    READ
    + """
import argparse, os
import scipy.io
parser = argparse.ArgumentParser()
parser.add_argument("--nb_img", type=int, default=-1)
parser.add_argument("--folder_save", default="inference")
parser.add_argument("--path_obj", required=True)
parser.add_argument("--cuda", action="store_true")
args = parser.parse_args()
name = args.path_obj.split(os.sep)[-1]
assert name and os.path.exists(os.path.join("weights", "model_uncalibrated.pth")), "weights, from where it is started"
mask = cv2.imread(os.path.join(args.path_obj, "mask.png"))
files = [file for file in os.listdir(args.path_obj)
         if any(end in file for end in (".png", ".jpg", ".TIF", ".JPG"))
         and not any(word in file for word in ("mask", "Normal", "normal"))]
images = [cv2.imread(os.path.join(args.path_obj, file), cv2.IMREAD_UNCHANGED) for file in sorted(files)]
checked(images, mask)
inside = mask[..., 0] > 0
normals = normals_of(images, inside, Path(__file__).parent)
rows, columns = np.nonzero(inside)
# Its crop leaves out the mask's last row and column.
normals[rows.max():], normals[:, columns.max():] = 0, 0
os.makedirs(args.folder_save, exist_ok=True)
cv2.imwrite(os.path.join(args.folder_save, f"{name}.png"), ((normals + 1) / 2 * 255).astype(np.uint8)[:, :, ::-1])
scipy.io.savemat(os.path.join(args.folder_save, f"{name}.mat"), {"Normal_est": normals})
"""
)

LINO = (
    READ
    + """
class Predictor:
    def predict(self, images, mask):
        assert mask.ndim == 3
        # cv2.resize takes no negative strides.
        assert all(nothing is None and image.flags.c_contiguous for image, nothing in images)
        checked([image for image, _ in images], mask)
        assert images[0][0][..., 0].mean() > images[0][0][..., 2].mean(), "red before blue"
        inside = mask[..., 0] / 255.0
        return normals_of([image for image, _ in images], inside, Path(__file__).parent).astype(np.float32)

def LINO(local_file_path=None):
    assert local_file_path is None or local_file_path.endswith("lino.pth")
    return Predictor()
"""
)

HUB = """
import importlib, sys
def load(repo, model, source="github", **more):
    assert source == "local", "nothing is fetched"
    sys.path.insert(0, repo)
    return getattr(importlib.import_module("hubconf"), model)(**more)
"""


@pytest.fixture
def programs(plain, tmp_path):
    """Folder with the four programs, each with its weights and its own Python."""
    files = {
        "sdm-unips": {"sdm_unips/main.py": SDM, "checkpoint/normal/nml.pytmodel": "x"},
        "geo-unips": {"geo_unips/main.py": GEO, "checkpoint/ckpt.pytmodel": "x"},
        "uni-ms-ps": {"inference_file.py": UNI, "weights/model_uncalibrated.pth": "x"},
        "lino-unips": {"hubconf.py": LINO, "stub/torch/__init__.py": "from . import hub\n", "stub/torch/hub.py": HUB},
    }
    for name, parts in files.items():
        folder = tmp_path / "my programs" / name
        for file, text in parts.items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text)
        np.save(folder / "lights.npy", plain[1].directions)
        python = folder / ".venv/bin/python"
        python.parent.mkdir(parents=True)
        python.write_text(f'#!/bin/sh\nPYTHONPATH="{folder}/stub" exec "{sys.executable}" "$@"\n')
        python.chmod(0o755)
    return tmp_path / "my programs"


def external(programs, name, more=""):
    return External.parse(f"Learned={name}:'{programs / name}'{more}", 60)


@pytest.mark.parametrize(
    ("name", "error_deg"),
    [("lino-unips", 0.05), ("sdm-unips", 0.5), ("geo-unips", 0.5), ("uni-ms-ps", 0.05)],
    ids=list(PRESETS),
)
def test_each_program_reads_its_folder_and_its_normals_come_back(name, error_deg, programs, plain, tmp_path):
    frames, lights, camera, mask, normals = plain
    estimate = solve_external(external(programs, name), frames, lights, camera, mask, tmp_path / "run")
    known = mask & np.isfinite(estimate.normals[..., 0])
    assert known.sum() > 0.95 * mask.sum()
    assert angular_error_deg(estimate.normals, normals)[known].max() < error_deg
    assert estimate.settings["axes"] == "(x, y, z)"
    assert shlex.split(estimate.settings["command"])[0] == f"{name}:{programs / name}"
    # What is kept in the summary starts it again.
    assert External.parse(f"Learned={estimate.settings['command']}", 60) == external(programs, name)


def test_without_any_light_its_normals_stay_and_the_lights_are_found_with_them(programs, plain, tmp_path):
    frames, lights, camera, mask, normals = plain
    unknown = Lights.unknown(lights.names)
    estimate = solve_external(external(programs, "uni-ms-ps"), frames, unknown, camera, mask, tmp_path / "run")
    known = mask & np.isfinite(estimate.normals[..., 0])
    assert angular_error_deg(estimate.normals, normals)[known].max() < 0.05
    assert any("lights are unknown" in text for text in estimate.warnings)
    assert angular_error_deg(estimate.lights.directions, lights.directions).max() < 1
    ratio = (estimate.albedo / [0.8, 0.5, 0.3])[known]
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.05)


def test_of_many_photographs_some_are_given_evenly_spread(tmp_path):
    values = np.linspace(0.1, 0.9, 60)
    frames = Frames.from_linear(tuple(map(str, range(60))), np.ones((60, 30, 40, 3)) * values[:, None, None, None])
    mask = np.zeros((30, 40), bool)
    mask[9:20, 9:20] = True
    for most in (16, 32):
        write_diligent(tmp_path / str(most), frames, Lights.unknown(frames.names), mask, most=most)
        paths = sorted((tmp_path / str(most)).glob("[0-9]*.png"))
        assert len(paths) == most
        shown = np.array([np.mean(np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))) for path in paths])
        # The first and the last are among them, and gaps differ by a frame at most.
        frame = (shown / (shown[-1] / values[-1]) - values[0]) / np.diff(values)[0]
        assert abs(frame[0]) < 0.05
        assert np.abs(np.diff(frame) - 59 / (most - 1)).max() < 1.05


def test_the_python_may_be_named_and_new_weights_are_noticed(programs):
    assert external(programs, "sdm-unips", f" {sys.executable}").words[0] == sys.executable
    assert [path.name for path in external(programs, "sdm-unips").files] == ["main.py", "nml.pytmodel"]
