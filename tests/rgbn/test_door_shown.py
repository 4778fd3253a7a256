"""What a person at a prompt or in a notebook sees of a result: lines, tables, figures, in units that can be checked."""

import re
from dataclasses import replace
from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from compare.statistics.statistics import angular_statistics
from fixtures.lit_surfaces import flashes_at, spiral
from rgbn.result_tables import ball_table, error_table
from rgbn.step_tables import TABLES, camera_text
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.spheres import Sphere
from scene.store import Store

AT = np.array([5.0, -7.0, -900.0])


def near_lights(count=12):
    toward = spiral(np.full(count, 0.8), turn=2 * np.pi / count)
    sigmas = {"direction_sigma_deg": np.full(count, 0.22), "intensity_sigma": np.full(count, 0.022)}
    places = AT + np.linspace(1180.0, 1420.0, count)[:, None] * toward
    return flashes_at(places, AT, flags=(("dim",), *((),) * (count - 1)), **sigmas)


def marks(drawing):
    """Return where discs with words are drawn (N, 2)."""
    return np.array(re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"[^>]*><title>', drawing), float)


def test_lights_in_one_line_one_table_and_one_figure_each():
    lights = near_lights()
    assert repr(lights) == ("12 near lights, 1,180 to 1,420 mm away, direction sigma 0.22 degrees (median), 1 flagged")
    frame = lights.to_dataframe()
    assert np.array_equal(frame[["direction_x", "direction_y", "direction_z"]].to_numpy(), lights.directions)
    assert np.array_equal(frame[["x_mm", "y_mm", "z_mm"]].to_numpy(), lights.positions_mm)
    html = lights._repr_html_()
    assert html.count("<tr>") == 12
    assert "dim" in html
    u, v = marks(lights.plot()).T
    zenith, turn = np.radians(np.hypot(u - 180, 180 - v) / 150 * 90), np.arctan2(180 - v, u - 180)
    drawn = np.stack([np.sin(zenith) * np.cos(turn), np.sin(zenith) * np.sin(turn), np.cos(zenith)], -1)
    np.testing.assert_allclose(drawn, lights.directions, atol=0.002)
    assert len(np.unique(marks(lights.plot("sigmas"))[:, 1])) == 1
    assert len(marks(lights.plot("intensities"))) == 3 * 12
    with pytest.raises(SceneError, match="directions, intensities, sigmas"):
        lights.plot("colours")


def test_balls_are_drawn_where_they_are():
    balls = [Sphere("chrome", np.array([30.0, 20]), 9.0, 40.0), Sphere("white", np.array([60.0, 50]), 7.0)]
    camera = Camera(100, 80, 200.0, 200.0, 49.5, 39.5)
    frames = Frames.from_linear(("a",), np.full((1, 80, 100, 3), 0.5))
    found = ball_table(balls, camera, frames)
    assert repr(found) == "2 balls: 1 chrome, 1 white"
    assert list(found) == balls
    table = found.to_dataframe()
    assert table["z_mm"][0] == pytest.approx(-200 * 20 / 9)
    assert np.isnan(table["z_mm"][1])
    paths = re.findall(r'<path d="M([^"]*)"[^>]*><title>', found.plot())
    for path, ball in zip(paths, balls, strict=True):
        # In pixels, from the first one's corner on.
        points = np.array([pair.split() for pair in path.split("L")], float) - 0.5
        np.testing.assert_allclose(points[:-1], ball.outline(camera), atol=0.051)
    assert repr(ball_table([], camera, frames)) == "no balls"


def test_errors_are_those_of_the_summary():
    errors = [np.array([1.0, 2, 9]), np.array([3.0, 4, 5])]
    real, twin = map(angular_statistics, errors)
    histogram = {"real": [1, 1, 1], "twin": [0, 2, 1]}
    compared = {
        "methods": {"ls": {"real": real, "twin": twin, "histogram": histogram}, "tv": {"real": None, "twin": None}},
        "histogram_edges_deg": [0.0, 2.0, 5.0],
    }
    table = error_table(compared)
    assert repr(table) == "median angular error, degrees: ls 2.00 (real), ls 4.00 (twin)"
    assert table.to_dataframe()["median_deg"].tolist() == [2, 4]
    assert "real beyond" in table.plot()
    empty = error_table({"methods": {}})
    assert repr(empty).endswith("none is known")
    with pytest.raises(SceneError, match="nothing to draw"):
        empty.plot()


def test_a_row_says_where_its_light_is():
    """One light to the right, one above, one behind the camera; seen from a point that is not the origin."""
    offsets = np.array([[300.0, 0, 0], [0, 200.0, 0], [0, 0, 1000.0], [-3.0, -3.0, 3 * np.sqrt(2)]])
    sigma, intensities = np.array([0.2, np.nan, 0.3, 0.4]), 1 + np.arange(12).reshape(4, 3) / 10
    flags = ((), ("dim", "blurred"), (), ())
    rows = flashes_at(AT + offsets, AT, intensities, direction_sigma_deg=sigma, flags=flags).rows()
    assert [row["azimuth_deg"] for row in rows][:2] == pytest.approx([0, 90])
    assert rows[3]["azimuth_deg"] == pytest.approx(225)
    assert [row["elevation_deg"] for row in rows] == pytest.approx([0, 0, 90, 45])
    assert [row["distance_mm"] for row in rows] == pytest.approx([300, 200, 1000, 6])
    for row, offset, intensity in zip(rows, offsets, intensities, strict=True):
        assert [row[f"{axis}_mm"] for axis in "xyz"] == pytest.approx(AT + offset)
        toward = np.array([row[f"direction_{axis}"] for axis in "xyz"])
        assert row["distance_mm"] * toward == pytest.approx(offset)
        assert [row[f"intensity_{channel}"] for channel in "rgb"] == pytest.approx(intensity)
        angle, rise = np.radians([row["azimuth_deg"], row["elevation_deg"]])
        polar = [np.cos(rise) * np.cos(angle), np.cos(rise) * np.sin(angle), np.sin(rise)]
        assert toward == pytest.approx(polar, abs=1e-12)
    assert [row["direction_sigma_deg"] for row in rows] == [0.2, None, 0.3, 0.4]
    assert [row["flags"] for row in rows] == ["", "dim; blurred", "", ""]


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
    offsets = np.array([[300.0, 0.0, 400.0], [0.0, -600.0, 0.0], [0.0, 0.0, 700.0]])
    intensities = np.array([[1.2, 1.2, 1.2], [0.5, 0.8, 1.1], [1.0, 1.0, 1.0]])
    more = {"direction_sigma_deg": np.array([0.2, np.nan, 0.4]), "flags": ((), ("no highlight seen",), ())}
    lights = replace(flashes_at(AT + offsets, AT, intensities, **more), names=("right", "below", "camera"))
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
