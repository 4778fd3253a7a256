"""What the tables say, in units that a person can check."""

from dataclasses import replace
from io import StringIO
from types import SimpleNamespace

import numpy as np
from rich.console import Console

from rgbn.step_tables import TABLES, camera_text
from scene.camera import Camera
from scene.lights import Lights
from scene.spheres import Sphere
from scene.store import Store

CAMERA = Camera(640, 480, 900.0, 900.0, 330.7, 228.1, source="EXIF", focal_sigma=0.01)


def shown(tables, columns=80):
    console = Console(file=StringIO(), width=columns)
    for table in tables:
        console.print(table)
    return console.file.getvalue()


def session(**more):
    return SimpleNamespace(**{"scan": SimpleNamespace(name="pear.ply"), "scan_unit": "mm", "normals": None, **more})


def test_a_camera_is_told_by_its_field_of_view_and_source():
    """640 px at 900 px: 2 atan(320 / 900)."""
    text = camera_text(CAMERA)
    across, down = (np.degrees(2 * np.arctan(size / 1800)) for size in (640, 480))
    assert f"{across:.1f} x {down:.1f} deg" in text
    assert "900.0 px ± 1.0 %" in text
    assert text.endswith("from EXIF")
    assert camera_text(replace(CAMERA, source="assumed")).endswith("taken as most cameras have it")
    assert "not known" in camera_text(Camera.orthographic(640, 480))


def test_without_scan_or_twin_the_tables_say_so():
    job = SimpleNamespace(session=session(scan=None))
    assert "the session names no scan" in " ".join(shown(TABLES["align"][0](job, {"align": None})).split())
    assert "given normals" in shown(
        TABLES["align"][0](SimpleNamespace(session=session(normals="n.mat")), {"align": {}})
    )
    assert "no scan is registered" in shown(TABLES["twin"][0](job, {"twin": None}))
    surface = {"method": "ls", "scale": "nothing tells the distance"}
    text = shown(TABLES["compare"][0](job, {"compare": {}, "results": {"surface": surface}}))
    assert "no ground truth" in text
    assert "by ls; nothing tells the distance" in text


def test_lights_and_balls_are_where_a_tape_measure_finds_them(tmp_path):
    """A light 300 mm right of and 400 mm nearer than the object is 500 mm from it; a ball's distance is no depth."""
    at = np.array([0.0, 0.0, -900.0])
    offsets = np.array([[300.0, 0.0, 400.0], [0.0, -600.0, 0.0], [0.0, 0.0, 700.0]])
    lights = Lights(
        ("right", "below", "camera"),
        offsets / np.linalg.norm(offsets, axis=1, keepdims=True),
        np.array([[1.2, 1.2, 1.2], [0.5, 0.8, 1.1], [1.0, 1.0, 1.0]]),
        at + offsets,
        at,
        direction_sigma_deg=np.array([0.2, np.nan, 0.4]),
        flags=((), ("no highlight seen",), ()),
    )
    store = Store(tmp_path)
    store.save_lights_json(lights)
    store.save_camera(CAMERA)
    ball = Sphere("chrome", np.array([600.0, 40.0]), 45.0, 100.0, 0.02)
    store.save_spheres([ball], CAMERA)
    job = SimpleNamespace(store=store, done={"align": {}})
    text = shown(TABLES["calibrate"][0](job, {}), 100)
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line.split()}
    assert rows["right"] == ["53.1", "0.0", "500", "1.200", "0.20"]
    assert rows["below"] == ["0.0", "270.0", "600", "0.800", "–", "no", "highlight", "seen"]
    assert rows["camera"][0] == "90.0"
    assert "3 near lights, seen from the object" in text
    assert "at worst (camera)" in " ".join(text.split())
    away = np.linalg.norm(ball.center_mm(CAMERA))
    assert rows["chrome"] == ["(600.0,", "40.0)", "45.00", "100", f"{away:.0f}", "0.020"]
    assert away > 1.02 * -ball.center_mm(CAMERA)[2]
    job.done = {}
    assert "amid the balls" in shown(TABLES["calibrate"][0](job, {}))
