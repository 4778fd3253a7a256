"""Flags of lights: each kind has a warning or a reason why not, and many frames are one sentence."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

from calibrate.calibrate import calibrate
from calibrate.flags import KINDS, flag_warnings, kind_of
from calibrate.known_lights.read_known import read_lights
from formats.light_files import light_dome, light_mat
from scene.camera import Camera
from scene.frames import Frames

ROOT = Path(__file__).parents[2]
NAMES = tuple(f"flash_{i:03d}" for i in range(12))
ORDER = "taken in the file's order: its names are not the frames'"


def _texts(node):
    """Yield the strings of an expression, 7 in the place of each value."""
    if isinstance(node, ast.JoinedStr):
        yield "".join(str(part.value) if isinstance(part, ast.Constant) else "7" for part in node.values)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    else:
        for part in ast.iter_child_nodes(node):
            yield from _texts(part)


def _written_flags():
    """Return every flag that the sources write: flags[f].append(...), flag = ..., flag += ..., told = ... of flags."""
    found = {light_dome.NO_SCALE}
    for room in ("calibrate", "formats", "align"):
        for path in (ROOT / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".append"):
                    if "flags[" in ast.unparse(node.func):
                        found |= set(_texts(node.args[0]))
                elif isinstance(node, ast.Assign | ast.AugAssign):
                    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                    places = [part for target in targets for part in getattr(target, "elts", [target])]
                    at = [k for k, place in enumerate(places) if getattr(place, "id", "") in ("flag", "flags")]
                    value = node.value
                    if at and isinstance(value, ast.Tuple) and len(places) == len(value.elts) > 1:
                        value = value.elts[at[0]]
                    if at:
                        found |= set(_texts(value))
    return {text for text in found if len(text) > 3}


def test_every_flag_that_the_sources_write_is_in_the_table_once():
    written = _written_flags()
    # The scan of the sources finds what it should: one of each way to write a flag.
    assert {ORDER, light_dome.NO_SCALE, "same light as 7", "no highlight seen: direction from the white ball's shading",
            "taken as shining alike to all sides: mu up to 7 is not used"} <= written  # fmt: skip
    for flag in written | {"7 has no intensities", "moved by the scan's shading"}:
        assert sum(bool(re.fullmatch(kind.pattern, flag)) for kind in KINDS) == 1, flag
    for kind in KINDS:
        assert bool(kind.warning) != bool(kind.reason), kind.pattern


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
    assert kind_of("dim") is None
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


def test_a_file_that_names_its_photographs_is_not_warned_of(tmp_path):
    frames, camera, toward = _lit()
    rows = zip(frames.names, toward, strict=True)
    (tmp_path / "l.lp").write_text("3\n" + "".join(f"{name}.png {x} {y} {z}\n" for name, (x, y, z) in rows))
    found = calibrate(frames, camera, [], known_lights=read_lights(tmp_path / "l.lp", frames.names))
    assert not any("order" in warning for warning in found.warnings)
