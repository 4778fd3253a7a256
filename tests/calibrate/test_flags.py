"""Flags of lights: many frames are one sentence."""

import numpy as np
import pytest

from calibrate.calibrate import calibrate
from calibrate.flags import flag_warnings
from calibrate.known_lights.read_known import read_lights
from formats.light_files import light_mat
from scene.camera import Camera
from scene.frames import Frames

NAMES = tuple(f"flash_{i:03d}" for i in range(12))
ORDER = "taken in the file's order: its names are not the frames'"


def test_many_frames_are_one_sentence_with_what_to_do():
    (all_of_them,) = flag_warnings(NAMES, [(ORDER,)] * 12)
    assert all_of_them.startswith(f"lights, all 12: {ORDER}. If the photographs are in another order")
    (some,) = flag_warnings(NAMES, [(ORDER,)] * 7 + [()] * 5)
    assert "flash_000, flash_001, flash_002, flash_003, flash_004 and 2 more" in some


def test_a_kind_that_a_few_frames_may_have_is_a_warning_from_a_quarter_on():
    flag = "glare beside the highlight on chrome ball 2: the middle of its core is taken"
    assert not flag_warnings(NAMES, [(flag,)] * 2 + [()] * 10)
    assert flag_warnings(NAMES, [(flag,)] * 3 + [()] * 9)


def test_flags_that_a_file_brings_are_told_as_its_own():
    (told,) = flag_warnings(NAMES, [("dim",)] + [()] * 11)
    assert "flash_000 (dim)" in told


def _lit(count=3):
    """A matte bump under three lights, and the directions."""
    v, u = np.mgrid[:40, :40] / 20 - 1
    normals = np.stack([u, -v, np.sqrt(np.maximum(1 - u**2 - v**2, 0.05))], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    toward = np.array([[0.6, 0.0, 0.8], [0.0, -0.6, 0.8], [-0.36, 0.48, 0.8]])[:count]
    images = 0.6 * np.maximum(np.einsum("hwi,fi->fhw", normals, toward), 0)
    frames = Frames.from_linear(NAMES[:count], np.repeat(images[..., None], 3, -1))
    return frames, Camera.orthographic(40, 40), toward


def _lp(path, toward):
    path.write_text("3\n" + "".join(f"other_{i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(toward)))


def _rows(path, toward):
    np.savetxt(path, toward)


def _mat(path, toward):
    import scipy.io

    # Along the optical axis of OpenCV's frame, lamps beside the camera.
    scipy.io.savemat(
        path, {"S": 700 * toward * [1, -1, -1] + [0, 0, light_mat.USUAL_DEPTH_MM], "mu": np.full((3, 1), 1.5)}
    )


@pytest.mark.parametrize(
    ("name", "write", "words"),
    [
        ("lights.lp", _lp, ["file's order"]),
        ("light_directions.txt", _rows, ["file's order"]),
        ("light.mat", _mat, ["file's order", "700 mm away", "mu up to 1.5"]),
    ],
)
def test_what_a_light_file_leaves_open_is_a_warning_of_calibration(name, write, words, tmp_path):
    frames, camera, toward = _lit()
    write(tmp_path / name, toward)
    known = read_lights(tmp_path / name, frames.names)
    found = calibrate(frames, camera, [], known_lights=known)
    for word in words:
        assert sum(word in warning for warning in found.warnings) == 1, found.warnings
