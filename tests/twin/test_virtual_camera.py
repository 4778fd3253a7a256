"""The virtual camera: its noise obeys the sensor's numbers, and LibRaw reads back what was written."""

from datetime import datetime

import numpy as np
import pytest
import rawpy
import tifffile

from scene.errors import RenderError, SceneError
from twin.camera.virtual_camera import CFA_PATTERNS, Sensor, expose, write_dng

SHOT = {"exposure_s": 1 / 125, "iso": 100, "aperture": 8.0, "focal_mm": 18.0}
MOMENT = datetime(2026, 11, 21, 10, 0, 4, 370000)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_libraw_reads_the_mosaic_back_bit_for_bit(tmp_path, cfa):
    sensor = Sensor(cfa=cfa, black_level=300, white_level=15000, neutral=(0.5, 1.0, 0.8))
    mosaic = np.random.default_rng(1).integers(0, 15001, (46, 64)).astype(np.uint16)
    write_dng(tmp_path / "a.dng", mosaic, sensor, time=MOMENT, **SHOT)
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        assert np.array_equal(raw.raw_image, mosaic)
        assert raw.black_level_per_channel == [300] * 4
        assert raw.white_level == 15000
        assert np.array_equal(np.where(raw.raw_colors == 3, 1, raw.raw_colors), sensor.channels(46, 64))
        assert np.allclose(raw.camera_whitebalance[:3], [2, 1, 1.25], rtol=1e-4)
        # Its colour matrix is sRGB's own: white-balanced raw is linear sRGB, so no conversion is left.
        assert np.allclose(raw.color_matrix[:, :3], np.eye(3), atol=1e-4)
    assert [path.name for path in tmp_path.iterdir()] == ["a.dng"]


def test_exif_says_how_it_was_shot(tmp_path):
    write_dng(tmp_path / "a.dng", np.full((8, 8), 600, np.uint16), Sensor(pixel_um=20), time=MOMENT, **SHOT)
    with tifffile.TiffFile(tmp_path / "a.dng") as file:
        tags = file.pages.first.tags["ExifTag"].value
    value = {name: tags[name][0] / tags[name][1] for name in ("ExposureTime", "FNumber", "FocalLength")}
    assert value == {"ExposureTime": 0.008, "FNumber": 8, "FocalLength": 18}
    assert tags["ISOSpeedRatings"] == 100
    assert f"{tags['DateTimeOriginal']}.{tags['SubsecTimeOriginal']}" == "2026:11:21 10:00:04.370000"
    assert tags["FocalPlaneXResolution"] == (500, 1)  # per centimetre
    assert tags["FocalPlaneResolutionUnit"] == 3


def test_a_mosaic_holds_each_colour_under_its_filter_and_clips_at_white():
    image = np.zeros((64, 64, 3), np.float32) + [0.2, 0.4, 0.6]
    image[:, 48:] = 3.0
    sensor = Sensor(blur_px=0, cfa="GRBG", neutral=(0.5, 1.0, 0.8))
    mosaic = expose(image, sensor, np.random.default_rng(2))
    linear = (mosaic - 512.0) / (16383 - 512)
    for (row, column), expected in {(0, 0): 0.4, (0, 1): 0.1, (1, 0): 0.48, (1, 1): 0.4}.items():
        assert linear[row::2, column:40:2].mean() == pytest.approx(expected, abs=1e-3)
    assert (mosaic[:, 48:] == 16383).all()
    assert mosaic.dtype == np.uint16


def test_noise_is_that_of_photons_and_read_out():
    """Variance = signal / gain + (read / gain)^2 + 1/12: the photon transfer curve gives the sensor's numbers back."""
    sensor = Sensor(full_well_e=20000, read_noise_e=12, blur_px=0, neutral=(1, 1, 1))
    levels = np.array([0.0, 0.01, 0.1, 0.5, 0.9])
    rng = np.random.default_rng(3)
    shots = [expose(np.full((300, 300, 3), level), sensor, rng) - 512.0 for level in levels]
    mean, variance = (np.array([stat(shot) for shot in shots]) for stat in (np.mean, np.var))
    assert np.allclose(mean, levels * (16383 - 512), rtol=2e-3, atol=0.2)
    expected = mean / sensor.electrons_per_dn + (12 / sensor.electrons_per_dn) ** 2 + 1 / 12
    assert np.allclose(variance, expected, rtol=0.02)


def test_an_image_that_cannot_be_photographed_is_named(tmp_path):
    image = np.full((4, 4, 3), 0.5)
    image[1, 2, 0] = np.nan
    with pytest.raises(RenderError, match="1 of 16 pixels are NaN"):
        expose(image, Sensor(), np.random.default_rng(8))
    with pytest.raises(RenderError, match="shape"):
        expose(image[..., 0], Sensor(), np.random.default_rng(8))
    with pytest.raises(RenderError, match="even"):
        write_dng(tmp_path / "a.dng", np.zeros((5, 4), np.uint16), Sensor(), time=MOMENT, **SHOT)
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="cannot be written"):
        write_dng(tmp_path / "file" / "a.dng", np.zeros((4, 4), np.uint16), Sensor(), time=MOMENT, **SHOT)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
