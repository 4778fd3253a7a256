"""What a person at a prompt or in a notebook sees of a result: a line, a small table, a figure; what columns mean."""

import re

import numpy as np
import pytest

from compare.statistics.statistics import angular_statistics
from rgbn.result_tables import ball_table, error_table
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.spheres import Sphere


def near_lights(count=12, distance_mm=(1180.0, 1420.0)):
    angle, away = 2 * np.pi * np.arange(count) / count, np.linspace(*distance_mm, count)
    directions = np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), np.full(count, 0.8)], -1)
    at = np.array([10.0, 20, -900])
    names = tuple(f"flash_{index:02d}" for index in range(count))
    sigma = np.full(count, 0.22)
    flags = (("dim",), *((),) * (count - 1))
    return Lights(
        names, directions, np.ones((count, 3)), at + away[:, None] * directions, at, sigma, sigma / 10, flags=flags
    )


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


def lights_at(positions_mm, reference_mm, **more):
    """Near lights at positions, directions and intensities as they are at a reference point."""
    toward = np.subtract(positions_mm, reference_mm)
    directions = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    names = tuple(f"flash_{i}" for i in range(len(toward)))
    intensities = 1 + np.arange(3 * len(toward)).reshape(-1, 3) / 10
    return Lights(names, directions, intensities, np.asarray(positions_mm, float), np.asarray(reference_mm), **more)


def test_a_row_says_where_its_light_is():
    """One light to the right, one above, one behind the camera; seen from a point that is not the origin."""
    at = np.array([5.0, -7.0, -900.0])
    offsets = np.array([[300.0, 0, 0], [0, 200.0, 0], [0, 0, 1000.0], [-3.0, -3.0, 3 * np.sqrt(2)]])
    sigma = np.array([0.2, np.nan, 0.3, 0.4])
    lights = lights_at(at + offsets, at, direction_sigma_deg=sigma, flags=((), ("dim", "blurred"), (), ()))
    rows = lights.rows()
    assert [row["azimuth_deg"] for row in rows][:2] == pytest.approx([0, 90])
    assert rows[3]["azimuth_deg"] == pytest.approx(225)
    assert [row["elevation_deg"] for row in rows] == pytest.approx([0, 0, 90, 45])
    assert [row["distance_mm"] for row in rows] == pytest.approx([300, 200, 1000, 6])
    for row, light, intensity in zip(rows, at + offsets, lights.intensities, strict=True):
        assert [row[f"{axis}_mm"] for axis in "xyz"] == pytest.approx(light)
        toward = np.array([row[f"direction_{axis}"] for axis in "xyz"])
        assert at + row["distance_mm"] * toward == pytest.approx(light)
        assert [row[f"intensity_{channel}"] for channel in "rgb"] == pytest.approx(intensity)
        angle, rise = np.radians([row["azimuth_deg"], row["elevation_deg"]])
        polar = [np.cos(rise) * np.cos(angle), np.cos(rise) * np.sin(angle), np.sin(rise)]
        assert toward == pytest.approx(polar, abs=1e-12)
    assert [row["direction_sigma_deg"] for row in rows] == [0.2, None, 0.3, 0.4]
    assert [row["flags"] for row in rows] == ["", "dim; blurred", "", ""]
