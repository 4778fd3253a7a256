"""A sensor as noisy as the session's."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from scene.frames import Frames
from scene.store import Store
from twin.camera.grain import sensor_like
from twin.camera.virtual_camera import Sensor, expose, write_dng


@pytest.mark.parametrize(("full_well_e", "read_noise_e"), [(45000, 5), (2000, 2), (20000, 30)])
@pytest.mark.parametrize("mosaic", [True, False])
def test_the_sensors_noise_is_found_again(tmp_path, full_well_e, read_noise_e, mosaic):
    from capture.photographs.decode import decode
    from capture.session.session_types import CaptureSession

    sensor = Sensor(full_well_e=full_well_e, read_noise_e=read_noise_e, blur_px=0.6, neutral=(1.0, 1.0, 1.0))
    rng = np.random.default_rng(10001)
    v, u = np.mgrid[:240, :320]
    image = np.repeat((0.02 + 0.6 * (u / 320) ** 2 * (1 + 0.2 * np.sin(v / 17)))[..., None], 3, -1)
    if mosaic:
        path = tmp_path / "a.dng"
        mosaic_ = expose(image, sensor, rng)
        write_dng(path, mosaic_, sensor, exposure_s=0.01, iso=100, aperture=8, focal_mm=50, time=datetime(2000, 1, 1))
        frames, _ = decode(CaptureSession("x", tmp_path, (path,), ("a",), (0,)), Store(tmp_path / "out"))
    else:
        plain = replace(sensor, cfa="none", black_level=0, white_level=65535)
        frames = Frames.from_linear(("a",), expose(image, plain, rng)[None] / np.float32(65535))
    found = sensor_like(frames)
    assert found.full_well_e == pytest.approx(full_well_e, rel=0.15)
    dark = np.sqrt((found.read_noise_e / found.full_well_e) ** 2 + 0.02 / found.full_well_e)
    assert dark == pytest.approx(np.sqrt((read_noise_e / full_well_e) ** 2 + 0.02 / full_well_e), rel=0.15)


def test_frames_without_noise_are_no_fault():
    ramp = np.linspace(0.05, 0.8, 160 * 180 * 3, dtype=np.float32).reshape(1, 160, 180, 3)
    assert sensor_like(Frames.from_linear(("a",), ramp)).full_well_e > 1e5
    # Nothing to measure: a usual sensor.
    dark = Frames.from_linear(("a",), np.zeros((1, 40, 50, 3), np.float32))
    assert sensor_like(dark).full_well_e == Sensor().full_well_e
