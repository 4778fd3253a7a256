"""Pictures that are no RAW: values, colour order, encodings, broken files."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.photographs.images import linear_of_values, read_image
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


@pytest.mark.parametrize("suffix", [".png", ".tif", ".ppm"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_integer_files(tmp_path, suffix, dtype):
    white = np.iinfo(dtype).max
    values = (rgb() * white).round().astype(dtype)
    linear = decode(read_image(write(tmp_path / f"a{suffix}", values), "linear").codes)
    assert np.abs(linear - values / white).max() < CODE


def test_gray_fills_three_channels(tmp_path):
    values = (rgb()[..., 0] * 65535).astype(np.uint16)
    codes = read_image(write(tmp_path / "a.png", values), "linear").codes
    assert codes.shape == (12, 17, 3)
    assert np.array_equal(codes[..., 0], codes[..., 2])


def test_alpha_is_dropped(tmp_path):
    values = (rgb() * 255).round().astype(np.uint8)
    bgra = np.dstack([values[..., ::-1], np.full((12, 17), 7, np.uint8)])
    cv2.imwrite(str(tmp_path / "a.png"), bgra)
    linear = decode(read_image(tmp_path / "a.png", "linear").codes)
    assert np.abs(linear - values / 255).max() < CODE


def test_tga(tmp_path):
    from PIL import Image

    values = (rgb() * 255).round().astype(np.uint8)
    for rle in (None, "tga_rle"):
        Image.fromarray(values).save(tmp_path / "a.tga", compression=rle)
        assert np.abs(decode(read_image(tmp_path / "a.tga", "linear").codes) - values / 255).max() < CODE


def test_a_real_tga_is_its_png(shared):
    tga = shared("real/uw_psm/tga_chrome/chrome.3.tga")
    png = shared("real/uw_psm/png/chrome/chrome.3.png")
    assert np.array_equal(read_image(tga, "linear").codes, read_image(png, "linear").codes)


def test_twelve_bits_in_a_pgm(tmp_path):
    values = (rgb()[..., 0] * 4095).round().astype(">u2")
    (tmp_path / "a.pgm").write_bytes(b"P5\n# by a camera\n17 12\n4095\n" + values.tobytes())
    linear = decode(read_image(tmp_path / "a.pgm", "linear").codes)[..., 0]
    assert np.abs(linear - values / 4095).max() < CODE


def test_jpeg_keeps_its_colours_apart(tmp_path):
    values = np.broadcast_to((np.array([0.8, 0.45, 0.15]) * 255).round().astype(np.uint8), (16, 16, 3))
    linear = decode(read_image(write(tmp_path / "a.jpg", values), "linear").codes)
    assert np.abs(linear - values / 255).max() < 3 / 255


def test_orientation_is_not_applied(tmp_path):
    from PIL import Image

    image = Image.fromarray((rgb((12, 17)) * 255).astype(np.uint8))
    exif = image.getexif()
    exif[274] = 6
    image.save(tmp_path / "a.jpg", exif=exif)
    assert read_image(tmp_path / "a.jpg", "linear").codes.shape == (12, 17, 3)


@pytest.mark.parametrize("channels", [3, 1])
def test_exr(tmp_path, write_exr, channels):
    values = (rgb() * [30.0, 1.0, 0.001]).astype(np.float32)
    write_exr(tmp_path / "a.exr", values[..., :channels])
    codes = read_image(tmp_path / "a.exr", "linear").codes
    assert codes.dtype == np.float16
    expected = values if channels == 3 else np.repeat(values[..., :1], 3, -1)
    assert np.allclose(codes, expected, rtol=6e-4, atol=1e-6)


def test_srgb_is_undone():
    """Against the standard's own points: 0.5 encoded is 21.4 % of the light."""
    assert linear_of_values(np.array([0.0, 0.04045, 0.5, 1.0]), "srgb") == pytest.approx(
        [0, 0.04045 / 12.92, 0.21404114, 1], abs=1e-7
    )


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_stated_gamma_is_undone(tmp_path, dtype):
    white = np.iinfo(dtype).max
    light = rgb()
    values = (light ** (1 / 1.8) * white).round().astype(dtype)
    linear = decode(read_image(write(tmp_path / "a.png", values), 1.8).codes)
    assert np.abs(linear - light).max() < 1.5 / white + CODE


def test_half(tmp_path):
    values = (rgb((13, 17)) * 60000).astype(np.uint16)
    values[0, 0] = 65535
    linear = decode(read_image(write(tmp_path / "a.png", values), "linear", half=True).codes)
    assert linear.shape == (6, 8, 3)
    expected = (values[:12, :16] / 65535).reshape(6, 2, 8, 2, 3).mean((1, 3))
    assert np.abs(linear - expected)[1:, 1:].max() < 2 * CODE
    assert linear[0, 0].min() >= 0.98, "a clipped pixel must not hide in the mean"


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


def test_exr_on_one_core(tmp_path, write_exr):
    """Mitsuba's reader deadlocks with one thread: a machine of one core must read all the same."""
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("a process cannot be bound to one core here")
    write_exr(tmp_path / "a.exr", rgb())
    program = (
        "import os, sys; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
        "from pathlib import Path; from capture.photographs.images import read_image\n"
        "print(read_image(Path(sys.argv[1]), 'linear').codes.shape)"
    )
    words = [sys.executable, "-c", program, str(tmp_path / "a.exr")]
    root = Path(__file__).parents[2]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, cwd=root, check=True)
    assert done.stdout == "(12, 17, 3)\n"
