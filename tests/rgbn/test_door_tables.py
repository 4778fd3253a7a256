"""The tables that Python, CSV files and the terminal share: their columns' meaning."""

import numpy as np
import pytest

from scene.lights import Lights

NAN = np.nan


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
    sigma = np.array([0.2, NAN, 0.3, 0.4])
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
