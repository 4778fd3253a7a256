"""Pictures that are no RAW: values, colour order, encodings, broken files."""

import cv2
import numpy as np
import pytest

from capture.photographs.images import read_image
from formats.picture_files import linear_from_srgb
from scene.errors import CaptureError
from scene.frames import PEDESTAL, WHITE, decode

CODE = 1 / (WHITE - PEDESTAL)


def rgb(shape=(12, 17), seed=0):
    """Three channels that cannot be confused: red above green above blue everywhere."""
    values = np.random.default_rng(seed).uniform(0, 0.2, (*shape, 3))
    return values + [0.7, 0.4, 0.1]


def write(path, values):
    """Write 0..1 RGB or gray with OpenCV (BGR)."""
    assert cv2.imwrite(str(path), values[..., ::-1] if values.ndim == 3 else values)
    return path


def test_a_real_tga_is_its_png(shared):
    tga = shared("real/uw_psm/tga_chrome/chrome.3.tga")
    png = shared("real/uw_psm/png/chrome/chrome.3.png")
    assert np.array_equal(read_image(tga, "linear").codes, read_image(png, "linear").codes)


def test_orientation_is_not_applied(tmp_path):
    from PIL import Image

    image = Image.fromarray((rgb((12, 17)) * 255).astype(np.uint8))
    exif = image.getexif()
    exif[274] = 6
    image.save(tmp_path / "a.jpg", exif=exif)
    assert read_image(tmp_path / "a.jpg", "linear").codes.shape == (12, 17, 3)


def test_srgb_is_undone():
    """Against the standard's own points: 0.5 encoded is 21.4 % of the light."""
    assert linear_from_srgb(np.array([0.0, 0.04045, 0.5, 1.0])) == pytest.approx(
        [0, 0.04045 / 12.92, 0.21404114, 1], abs=1e-7
    )


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_stated_gamma_is_undone(tmp_path, dtype):
    white = np.iinfo(dtype).max
    light = rgb()
    values = (light ** (1 / 1.8) * white).round().astype(dtype)
    linear = decode(read_image(write(tmp_path / "a.png", values), 1.8).codes)
    assert np.abs(linear - light).max() < 1.5 / white + CODE


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".tga", ".exr", ".pgm"])
@pytest.mark.parametrize("how", ["cut", "noise", "empty"])
def test_a_broken_file_is_named(tmp_path, write_exr, suffix, how):
    from PIL import Image

    path = tmp_path / f"flash_007{suffix}"
    values = (rgb((60, 80)) * 255).astype(np.uint8)
    if suffix == ".exr":
        write_exr(path, values.astype(np.float32))
    elif suffix == ".tga":
        Image.fromarray(values).save(path)
    else:
        write(path, values[..., 0] if suffix == ".pgm" else values)
    data = path.read_bytes()
    content = {"cut": data[: len(data) // 2], "noise": np.random.default_rng(1).bytes(900), "empty": b""}
    path.write_bytes(content[how])
    with pytest.raises(CaptureError, match="flash_007"):
        read_image(path, "linear")


def test_values_that_are_no_numbers(tmp_path, write_exr):
    values = np.ones((4, 4, 3), np.float32)
    values[1, 1, 1] = np.nan
    write_exr(tmp_path / "a.exr", values)
    with pytest.raises(CaptureError, match="no number"):
        read_image(tmp_path / "a.exr", "linear")
