"""Small RAW photographs, no two alike."""

from datetime import datetime

import numpy as np
import pytest

from twin.camera.virtual_camera import Sensor, write_dng


@pytest.fixture(scope="session")
def small_dng(tmp_path_factory):
    """Return a function that gives the content of a RAW photograph of 64 x 48 px by its number."""
    place = tmp_path_factory.mktemp("dng") / "one.dng"

    def content(number, level=6000):
        rng = np.random.default_rng([number, level])
        mosaic = (level + rng.integers(-300, 300, (48, 64))).astype(np.uint16)
        shot = {"exposure_s": 0.01, "iso": 100, "aperture": 8.0, "focal_mm": 50.0, "time": datetime(2026, 1, 1)}
        write_dng(place, mosaic, Sensor(), **shot)
        return place.read_bytes()

    return content
