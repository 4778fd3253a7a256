"""One law: bad input ends with exit code 2, one message that names the key, no traceback, no half-written file.

Ctrl-C ends with 130. What only the photographs tell has tests in its room.
"""

import os
import re
import shutil
import signal
import time

import numpy as np
import pytest

from calibrate.known_lights.read_known import read_lights
from scene.errors import CalibrationError
from scene.files import write_png
from scene.output_folder import open_record
from tests.conftest import FIXTURE, started

TEXT = (FIXTURE / "session.toml").read_text()
BALL = '[[spheres]]\nkind = "white"\ndiameter_mm = 90.0'


@pytest.fixture
def session(tmp_path):
    """The fixture session, its files as links, so that one can be spoilt."""
    folder = tmp_path / "penguin"
    for name in ("raw", "scan"):
        (folder / name).mkdir(parents=True)
        for path in (FIXTURE / name).iterdir():
            (folder / name / path.name).symlink_to(path)
    shutil.copy(FIXTURE / "session.toml", folder)
    return folder


def half_written(folder):
    return [path for path in folder.rglob("*") if path.is_file() and (".tmp" in path.name or path.parent.name == "tmp")]


@pytest.fixture
def refused(run_rgbn, monkeypatch, tmp_path):
    """Run the command line; it ends as the law says, with `parts` in this order. Return the message in one line."""

    def run(*words, parts=()):
        monkeypatch.chdir(tmp_path)
        code, out, err = run_rgbn(*words)
        assert (code, out) == (2, ""), err
        message = " ".join(err[err.index("rgbn: ") :].split())
        assert message.count("rgbn: ") == 1 + message.count("`rgbn: "), message
        assert "Traceback" not in err
        assert re.search(".*".join(map(re.escape, parts)), message), message
        assert not half_written(tmp_path)
        assert not list(tmp_path.glob("**/summary.json"))
        return message

    return run


# What is replaced in session.toml by what, and what the message names, in this order.
SLIPS = [
    ("raw/flash_*", "RAW/FLASH_*", "frames.flash", "raw/flash_000.dng is there"),
    ("raw/flash_*", "raws/flash_*", "frames.flash", 'write "raw/flash_*.dng"'),
    ("raw/flash_*", "flash_*", "frames.flash", "raw/flash_000.dng is there"),
    ("raw/flash_*", "/media/card/flash_*", "frames.flash", 'write "raw/flash_*.dng"'),
    ("raw/flash_*", "raw/light_*", "frames.flash", "ambient_000.dng first"),
    ("raw/flash_*", "raw/*", "frames.ambient", "ambient_000.dng"),
    ("ambient =", 'skip = ["flash_099"]\nambient =', "frames.skip", "flash_099"),
    ("ambient =", "skip = 7\nambient =", "frames.skip", "7"),
    # Windows' paths, between all three kinds of quotation marks that TOML has for them.
    ("raw/flash", "raw\\flash", "frames.flash", "/ between folders"),
    ("raw/flash", "raw\\\\flash", "frames.flash", "/ between folders"),
    ('"scan/object.ply"', r"'scan\object.ply'", "object.scan", '"scan/object.ply"'),
    ("scan/object", "scan\\object", "line 29", "/ between"),
    ('"raw/', '"C:\\Users\\me\\raw\\', "line 5", "/ between folders"),
    # TOML.
    ("= 90.0", "= 90,5", "line 26", "a point"),
    ('"bumpy"', "“bumpy”", "line 2", "quotation marks"),
    ('"raw/flash_*.dng"', "raw/flash_*.dng", "line 5", "quotation marks"),
    ('"raw/flash_*.dng"', '"raw/flash_*.dng', "line 5", "quotation mark"),
    ("= 90.0", "= 90 mm", "line 26", "without its unit"),
    ("= 90.0", '= "90 mm"', "spheres[2].diameter_mm", "90 mm"),
    ("fx = 900.0", "fx: 900.0", "line 11", "="),
    ("ambient =", "linear = True\nambient =", "line 6", "small letters"),
    ("fx = 900.0", "fx = 900.0\nfx = 901.0", "line 12", "a second time"),
    ("[[spheres]]", "[spheres]", "[spheres]", "two brackets"),
    # Keys.
    ("diameter_mm = 90", "diametr_mm = 90", "spheres[2].diametr_mm", "diameter_mm?"),
    ("[camera]", '[camera]\nscan_unit = "mm"', "camera.scan_unit", "[object]"),
    (BALL, '[[balls]]\nkind = "white"', "balls", "[[spheres]]"),
    ("diameter_mm = 90.0", "radius_mm = 45.0", "spheres[2].radius_mm", "diameter_mm"),
    ("diameter_mm = 90.0", "diameter_cm = 9.0", "spheres[2].diameter_cm", "diameter_mm"),
    ("= 90.0", "= 0.09", "spheres[2].diameter_mm", "0.09", "millimetres"),
    ('"white"', '"mirror"', "spheres[2].kind", "mirror", "chrome"),
    # Camera and scan.
    ("fx = 900.0", "fx = 85.0", "camera.fx", "85 px"),
    ("cx = 330.7", "cx = 3307", "camera.cx", "3307"),
    ("640\nheight = 480", "160\nheight = 120", "160 x 120"),
    ("scan/object", "scans/object", "object.scan", "scan/object.ply"),
    ("scan/object.ply", "scan/", "object.scan", "folder", "as scan/object.ply."),
    ('unit = "mm"', 'unit = "inches"', "object.scan_unit", "inches", "inch"),
]


@pytest.mark.parametrize(("old", "new", "parts"), [(old, new, parts) for old, new, *parts in SLIPS])
def test_a_slip_in_session_toml(session, refused, old, new, parts):
    assert old in TEXT
    (session / "session.toml").write_text(TEXT.replace(old, new))
    refused("check", session, parts=(f"{session / 'session.toml'}: ", *parts))


def test_another_folder_is_given(session, refused):
    """Mistyped, too deep, too high, a photograph, the file that an editor called otherwise, and none at all."""
    above, meant = session.parent, f"Did you mean {session}?"
    for place in (above / "pengiun", above, session / "raw"):
        refused("process", place, parts=(meant,))
    refused("process", FIXTURE / "raw" / "flash_000.dng", parts=("is no session.toml",))
    (session / "session.toml").rename(session / "session.toml.txt")
    refused("process", session, parts=("Rename session.toml.txt to session.toml.",))
    (session / "session.toml.txt").unlink()
    refused("process", session, parts=(f"rgbn init {session}",))


@pytest.mark.parametrize("place", ["", "raw", "scan", "../file"])
def test_output_goes_neither_over_the_session_nor_into_a_file(session, refused, place):
    (session.parent / "file").write_text("")
    before = {path: path.stat().st_size for path in session.rglob("*") if path.is_file()}
    refused("check", session, "--out", session / place, parts=("--out",))
    assert {path: path.stat().st_size for path in session.rglob("*") if path.is_file()} == before


def test_two_runs_in_one_folder(session, refused):
    with open_record(session.parent / "out"):
        refused("check", session, "--out", session.parent / "out", parts=("another run",))


@pytest.mark.parametrize("size", [None, (240, 320)], ids=["torn", "of another size"])
def test_a_photograph_that_cannot_do(session, refused, size):
    from fixtures.bad_input.samples import write_dng

    victim = session / "raw" / "flash_003.dng"
    data = victim.read_bytes()
    victim.unlink()
    victim.write_bytes(data[: len(data) // 3])
    if size:
        write_dng(victim)
    refused("check", session, "--out", session.parent / "out", parts=("flash_003",))
    assert not (session.parent / "out" / "frames" / "frames.json").exists()


def picture_session(folder, more="", count=6):
    """A session of 16-bit linear PNG made by the test."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    images = rng.uniform(0.2, 0.6, (120, 160, 3)) * rng.uniform(0.7, 1.0, (count, 1, 1, 1))
    for index, image in enumerate(images):
        write_png(folder / f"flash_{index:03d}.png", (image * 65535).astype(np.uint16))
    (folder / "session.toml").write_text(f'[frames]\nflash = "flash_*.png"\nlinear = true\n{more}')
    return folder


LIGHTS = '[lights]\nfile = "lights.lp"\n'


@pytest.mark.parametrize(
    ("verb", "more", "lights", "parts"),
    [
        ("calibrate", '[[spheres]]\nkind = "chrome"\n', [], ("no ball found", "1 chrome")),
        ("check", '[object]\nscan = "s.ply"\n', [], ("s.ply", "[camera]")),
        ("solve", LIGHTS, [(0.1, 0, 1), (0.5, 0.5, 0.7)], ("at least 3",)),
        ("solve", LIGHTS, [(0.0, 0, 1), (0.6, 0, 0.8), (-0.6, 0, 0.8)], ("one plane",)),
    ],
)
def test_what_a_session_lacks(refused, tmp_path, verb, more, lights, parts):
    session = picture_session(tmp_path / "s", more, len(lights) or 4)
    (session / "s.ply").write_bytes((FIXTURE / "scan" / "object.ply").read_bytes())
    rows = "".join(f"flash_{i:03d}.png {x} {y} {z}\n" for i, (x, y, z) in enumerate(lights))
    (session / "lights.lp").write_text(f"{len(lights)}\n{rows}")
    refused(verb, session, "--out", tmp_path / "out", parts=parts)


def test_jpeg_of_unknown_coding(refused, tmp_path):
    """Taken as linear without a word they bent normals by 10 degrees."""
    import cv2

    session = picture_session(tmp_path / "s")
    for index in range(4):
        cv2.imwrite(str(session / f"flash_{index}.jpg"), np.full((40, 60, 3), 90 + index, np.uint8))
    (session / "session.toml").write_text('[frames]\nflash = "*.jpg"\n')
    refused("check", session, "--out", tmp_path / "out", parts=("frames.linear", "JPEG"))


@pytest.mark.full
def test_scans_that_cannot_do(run_rgbn, session):
    head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n"
    index, faces = "property list uchar int vertex_indices\nend_header\n", "3 0 1 2\n3 0 1 3\n3 0 1 4\n"
    for text in (
        head.format(0) + "element face 0\n" + index,
        head.format(5) + "end_header\n" + points,
        head.format(5) + "element face 3\n" + index + points + faces,
    ):
        (session / "scan" / "object.ply").unlink()
        (session / "scan" / "object.ply").write_text(text)
        code, _, said = run_rgbn("align", session, "--out", session.parent / "out")
        assert (code, "object.ply" in said) == (2, True), said
        assert not (session.parent / "out" / "pose.json").exists()


def test_a_light_file(tmp_path):
    """Lights of too few frames, numbers parted by commas, decimal commas, no direction."""
    names = [f"flash_{i:03d}" for i in range(12)]
    sound = [f"{name}.dng 0.{i} 0.2 0.9" for i, name in enumerate(names)]
    for rows, part in (
        (sound[:11], "flash_011"),
        ([f"{name}.dng 0.1,0.2,0.9" for name in names], "with blanks"),
        ([f"{name}.dng 0,1 0,2 0,9" for name in names], "with a point"),
        ([*sound[:2], "flash_002.dng 0 0 0", *sound[3:]], "light 3 has no direction"),
    ):
        (tmp_path / "lights.lp").write_text("\n".join([str(len(rows)), *rows]))
        with pytest.raises(CalibrationError, match=part) as error:
            read_lights(tmp_path / "lights.lp", tuple(names))
        assert str(error.value).startswith(str(tmp_path / "lights.lp"))


def processing(session, out, said):
    """Return a process that goes the whole way, when it has said something."""
    process = started("process", session, "--out", out)
    assert any(said in line for line in process.stderr), f"{said!r} was never said"
    return process


@pytest.mark.parametrize("moment", ["check ...", pytest.param("align ...", marks=pytest.mark.full)])
def test_ctrl_c(session, moment):
    process = processing(session, session.parent / "out", moment)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=60)
    assert process.returncode == 130, message
    assert "stopped" in message
    assert "Traceback" not in message
    assert not half_written(session.parent)


@pytest.mark.full
@pytest.mark.slow
def test_a_killed_run_leaves_no_half_file_and_the_next_goes_on(run_rgbn, session):
    out = session.parent / "out"
    process = processing(session, out, "calibrate ...")
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    decoded = (out / "frames" / "codes.npy").stat().st_mtime_ns
    (out / ".rgbn" / "tmp").mkdir(exist_ok=True)
    (out / ".rgbn" / "tmp" / ".99.1.tmp.lights.json").write_text("left by a killed run")
    code, _, message = run_rgbn("calibrate", session, "--out", out)
    assert code == 0, message
    assert "check ..." not in message, "what was done is done"
    assert (out / "frames" / "codes.npy").stat().st_mtime_ns == decoded
    assert not half_written(out)
