"""A person's slips in session.toml and on the command line: each ends in one message that says where, what, and a cure.

What only the photographs tell is in test_slips_shown.py; docs/guide/repair.md lists all, with the test of each.
"""

import re
import shutil
from pathlib import Path

import pytest

from calibrate.known_lights.read_known import read_lights
from capture.session.session import load_session
from scene.errors import CalibrationError

FIXTURE = Path(__file__).parents[2] / "fixtures" / "bumpy"
TEXT = (FIXTURE / "session.toml").read_text()
CAMERA = "width = 640\nheight = 480\nfx = 900.0\nfy = 900.0\ncx = 330.7\ncy = 228.1"
BALL = '[[spheres]]\nkind = "white"\ndiameter_mm = 90.0'


@pytest.fixture
def session(tmp_path):
    """The fixture session, its files as links, so that one can be taken away."""
    folder = tmp_path / "penguin"
    for name in ("raw", "scan"):
        (folder / name).mkdir(parents=True)
        for path in (FIXTURE / name).iterdir():
            (folder / name / path.name).symlink_to(path)
    shutil.copy(FIXTURE / "session.toml", folder)
    return folder


@pytest.fixture
def refused(run_rgbn, monkeypatch, tmp_path):
    """Run the command line; it ends with exit code 2 and one message, which is returned in one line."""

    def run(*words):
        monkeypatch.chdir(tmp_path)
        code, out, err = run_rgbn(*words)
        message = err[err.index("rgbn: ") :]
        assert (code, out, message.count("rgbn: ")) == (2, "", 1), message
        assert "Traceback" not in err
        assert not list(tmp_path.glob("**/summary.json"))
        return " ".join(message.split())

    return run


def slip(name, old, new, *parts):
    """A text of session.toml that is replaced, and what the message must hold, in this order."""
    assert old in TEXT, old
    return pytest.param(TEXT.replace(old, new), parts, id=name)


SLIPS = [
    # Photographs.
    slip("case", "raw/flash_*", "RAW/FLASH_*", "frames.flash", "Upper and lower case", "raw/flash_000.dng is there"),
    slip("folder", "raw/flash_*", "raws/flash_*", "raws does not exist", 'write "raw/flash_*.dng"'),
    slip(
        "no folder", "raw/flash_*", "flash_*", "matches no file", 'raw/flash_000.dng is there: write "raw/flash_*.dng'
    ),
    slip("another machine", "raw/flash_*", "/media/card/flash_*", "/media/card does not", 'write "raw/flash_*.dng"'),
    slip(
        "another name", "raw/flash_*", "raw/light_*", "raw holds 13 files", "ambient_000.dng first", "Correct the glob"
    ),
    slip("near folder", '"raw/flash_*.dng"', '"rw/*"', "rw does not exist", "Did you mean raw/*?"),
    slip("ambient too", "raw/flash_*", "raw/*", "frames.ambient: ambient_000.dng is also", 'as in "flash_*.dng"'),
    slip("skip of nothing", "ambient =", 'skip = ["flash_099"]\nambient =', "frames.skip", "flash_099", "Did you mean"),
    slip("skip by number", "ambient =", "skip = 7\nambient =", "frames.skip: found 7", "a list between [ and ]"),
    # Windows' paths, between all three kinds of quotation marks that TOML has for them.
    slip("tab", "raw/flash", "raw\\flash", "frames.flash", "/ between folders", '"raw/flash_*.dng"'),
    slip("escaped", "raw/flash", "raw\\\\flash", "frames.flash", "/ between folders", '"raw/flash_*.dng"'),
    slip("literal", '"scan/object.ply"', r"'scan\object.ply'", "object.scan", '"scan/object.ply"'),
    slip(
        "unescaped", "scan/object", "scan\\object", 'line 29 is not TOML: scan = "scan\\object.ply"', "Write / between"
    ),
    slip("drive", '"raw/', '"C:\\Users\\me\\raw\\', "line 5 is not TOML", "Write / between folders"),
    # TOML.
    slip("decimal comma", "= 90.0", "= 90,5", "line 26 is not TOML: diameter_mm = 90,5", "Write a point"),
    slip("curly marks", '"bumpy"', "“bumpy”", "line 2 is not TOML: name = “bumpy”", "plain quotation marks"),
    slip("no marks", '"raw/flash_*.dng"', "raw/flash_*.dng", "line 5 is not TOML", "between quotation marks"),
    slip("one mark", '"raw/flash_*.dng"', '"raw/flash_*.dng', "line 5 is not TOML", "A quotation mark is missing"),
    slip("unit", "= 90.0", "= 90 mm", "line 26 is not TOML: diameter_mm = 90 mm", "without its unit"),
    slip("unit in marks", "= 90.0", '= "90 mm"', "spheres[2].diameter_mm: found '90 mm'", "without quotation marks"),
    slip("colon", "fx = 900.0", "fx: 900.0", "line 11 is not TOML: fx: 900.0", "Write = between"),
    slip("True", "ambient =", "linear = True\nambient =", "line 6 is not TOML: linear = True", "small letters"),
    slip("key twice", "fx = 900.0", "fx = 900.0\nfx = 901.0", "line 12", "fx = 901.0 stands there a second time"),
    slip("balls in one table", "[[spheres]]", "[spheres]", "[spheres] stands there a second time", "two brackets"),
    slip("one ball", TEXT[TEXT.index("[[s") : TEXT.index(BALL) + 11], "[spheres]", "spheres: found", "[[spheres]]"),
    # Keys.
    slip("mistyped", "diameter_mm = 90", "diametr_mm = 90", "spheres[2].diametr_mm: unknown", "mean diameter_mm?"),
    slip("other table", "[camera]", '[camera]\nscan_unit = "mm"', "camera.scan_unit", "It belongs under [object]"),
    slip("balls", BALL, '[[balls]]\nkind = "white"', "balls: unknown key", "Write [[spheres]] above each ball"),
    slip("radius", "diameter_mm = 90.0", "radius_mm = 45.0", "spheres[2].radius_mm", "diameter_mm: twice the radius"),
    slip("cm in the key", "diameter_mm = 90.0", "diameter_cm = 9.0", "Did you mean diameter_mm? It is in millimetres"),
    slip("in m", "= 90.0", "= 0.09", "spheres[2].diameter_mm: found 0.09", "millimetres"),
    slip("mirror", '"white"', '"mirror"', "spheres[2].kind: found 'mirror'", "chrome: a mirror; white: a matte ball"),
    # The camera.
    slip("mm as fx", "fx = 900.0", "fx = 85.0", "camera.fx: found 85 px", "in pixels, or focal_mm and sensor_mm"),
    slip("sensor's two sides", CAMERA, "focal_mm = 50\nsensor_mm = [36, 24]", "camera.sensor_mm", "expected a number"),
    slip("cx outside", "cx = 330.7", "cx = 3307", "camera.cx, camera.cy: found 3307.0", "pixels", "width and height"),
    slip("preview's size", "640\nheight = 480", "160\nheight = 120", "160 x 120", "width and height those of another"),
    # The scan.
    slip(
        "scan's folder", "scan/object", "scans/object", "object.scan: there is no file", "Did you mean scan/object.ply?"
    ),
    slip("scan's name", "object.ply", "zebra.ply", "object.scan: there is no file", "object.ply is there"),
    slip("scan is a folder", "scan/object.ply", "scan", "It is a folder", "as scan/object.ply"),
    slip("inches", 'unit = "mm"', 'unit = "inches"', "object.scan_unit: found 'inches'", "'inch'"),
]


@pytest.mark.parametrize(("text", "parts"), SLIPS)
def test_a_slip_in_session_toml(session, refused, text, parts):
    (session / "session.toml").write_text(text)
    message = refused("check", session)
    assert message.startswith(f"rgbn: {session / 'session.toml'}: ")
    assert re.search(".*".join(map(re.escape, parts)), message), message


def test_what_editors_save(session, refused):
    """A byte-order mark and Windows' line ends are no fault; what has neither mark nor UTF-8 is told with the cure."""
    file, text = session / "session.toml", TEXT.replace('"bumpy"', '"Büste"')
    file.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert load_session(session).name == "Büste"
    file.write_bytes(text.encode("latin-1"))
    assert 'line 2 is not UTF-8: name = "Büste" (read as Latin-1). Save the file as UTF-8' in refused("check", session)
    for line_end in ("\n", "\r\n", "\r"):
        file.write_bytes(text.replace("\n", line_end).encode("utf-16"))
        assert load_session(session).name == "Büste"
    file.write_bytes(text.replace("ü", "u").encode("utf-16-le"))
    assert "it holds zero bytes, as a text in UTF-16 without its mark does. Save the file as UTF-8" in refused(
        "check", session
    )


def test_another_folder_is_given(session, refused):
    """Mistyped, too deep, too high, a photograph, the file that an editor called otherwise, and none at all."""
    above = session.parent
    assert f"there is no such session. Did you mean {session}?" in refused("process", above / "pengiun")
    assert f"light_directions.txt, ...). Did you mean {session}?" in refused("process", above)
    assert f"Did you mean {session}?" in refused("process", session / "raw")
    assert "is no session.toml. Give the folder" in refused("process", FIXTURE / "raw" / "flash_000.dng")
    for name in ("session.toml.txt", "Session.toml"):
        (session / "session.toml").rename(session / name)
        assert f"Rename {name} to session.toml." in refused("process", session)
        (session / name).rename(session / "session.toml")
    (session / "session.toml").unlink()
    assert refused("process", session).endswith(f"run: rgbn init {session}")


def test_a_relative_path_from_another_folder(session, monkeypatch):
    monkeypatch.chdir(session / "scan")
    for path in (Path(".."), Path("../session.toml"), Path("../../penguin")):
        assert load_session(path).flash[0] == session / "raw" / "flash_000.dng"


def test_a_light_file(session):
    """Lights of too few or too many frames, numbers parted by commas, decimal commas, no direction."""
    names = [f"flash_{i:03d}" for i in range(12)]

    def told(rows):
        (session / "lights.lp").write_text("\n".join([str(len(rows)), *rows]))
        with pytest.raises(CalibrationError) as error:
            read_lights(session / "lights.lp", tuple(names))
        assert str(error.value).startswith(str(session / "lights.lp"))
        return str(error.value)

    sound = [f"{name}.dng 0.{i} 0.2 0.9" for i, name in enumerate(names)]
    few = told(sound[:11])
    assert "no light for the frame 'flash_011': 11 lights for 12 flash frames" in few
    assert "frames.skip" in few
    assert "14 lights for 12 flash frames" in told([f"lamp_{row}" for row in (*sound, *sound[:2])])
    assert "light 1 is 'flash_000.dng 0.1,0.2,0.9', not: name x y z, with blanks" in told(
        [f"{name}.dng 0.1,0.2,0.9" for name in names]
    )
    assert "'0,1'). Expected the number of lights, then a line each: name x y z, with a point" in told(
        [f"{name}.dng 0,1 0,2 0,9" for name in names]
    )
    assert "light 3 has no direction" in told([*sound[:2], "flash_002.dng 0 0 0", *sound[3:]])


def test_the_tests_that_the_guide_names_are_there():
    tests = Path(__file__).parents[1]
    rows = re.findall(r"^\|.*\| ([^|]*) \|$", (tests.parent / "docs" / "guide" / "repair.md").read_text(), re.MULTILINE)
    named = {name for cell in rows for name in re.findall(r"`(\w+(?:/\w+)*/test_\w+)`", cell)}
    assert len(named) > 15
    assert [name for name in named if not (tests / f"{name}.py").is_file()] == []
