"""Presets: programs that stand in for the published ones read what those read, as those do, and write what those write.

They refuse what the real readers would misread; weights and networks are not here.
"""

import shlex
import sys

import cv2
import numpy as np
import pytest

from formats.diligent_layout import write_diligent
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.external import PRESETS, External
from solve.given_normals import solve_external

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
def scene(asked):
    return asked()


@pytest.fixture
def programs(scene, tmp_path):
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
        np.save(folder / "lights.npy", scene[1].directions)
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
def test_each_program_reads_its_folder_and_its_normals_come_back(name, error_deg, programs, scene, tmp_path):
    frames, lights, camera, mask, normals = scene
    estimate = solve_external(external(programs, name), frames, lights, camera, mask, tmp_path / "run")
    known = mask & np.isfinite(estimate.normals[..., 0])
    assert known.sum() > 0.95 * mask.sum()
    assert angular_error_deg(estimate.normals, normals)[known].max() < error_deg
    assert estimate.settings["axes"] == "(x, y, z)"
    assert shlex.split(estimate.settings["command"])[0] == f"{name}:{programs / name}"
    # What is kept in the summary starts it again.
    assert External.parse(f"Learned={estimate.settings['command']}", 60) == external(programs, name)


def test_without_any_light_its_normals_stay_and_the_lights_are_found_with_them(programs, scene, tmp_path):
    frames, lights, camera, mask, normals = scene
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


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Learned=sdm:{0}", ["expected PRESET:FOLDER", "lino-unips, sdm-unips, geo-unips, uni-ms-ps"]),
        ("Learned=sdm-unips:{0}", ["has no sdm_unips/main.py", "https://github.com/satoshi-ikehata"]),
        ("Learned=sdm-unips:'{1}/lacks weights'", ["has no weights checkpoint", "checkpoint/normal/*.pytmodel"]),
        ("Learned=lino-unips:'{1}/lacks python'", ["lacks python/.venv/bin/python", "second word"]),
        ("Learned=lino-unips:'{1}/lacks python' {0}/nothing", ["found no ", "nothing"]),
        ("Learned=lino-unips:" + 300 * "y", ["has no hubconf.py"]),
        ("Learned=lino-unips:~nobody_of_this_name/x", ["has no hubconf.py"]),
        ("Learned=run it", ["{data} and {out} missing", "PRESET:FOLDER"]),
    ],
)
def test_what_is_missing_is_said_before_anything_runs(text, words, programs, tmp_path):
    (programs / "lacks weights/sdm_unips").mkdir(parents=True)
    (programs / "lacks weights/sdm_unips/main.py").touch()
    (programs / "lacks python").mkdir()
    (programs / "lacks python/hubconf.py").touch()
    with pytest.raises(SceneError) as error:
        External.parse(text.format(tmp_path, programs), 60)
    for word in words:
        assert word in str(error.value)


def test_the_python_may_be_named_and_new_weights_are_noticed(programs):
    assert external(programs, "sdm-unips", f" {sys.executable}").words[0] == sys.executable
    assert [path.name for path in external(programs, "sdm-unips").files] == ["main.py", "nml.pytmodel"]
