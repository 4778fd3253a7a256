"""One photograph: RAW files against known mosaics and LibRaw itself; other pictures' encodings; broken files."""

import itertools

import cv2
import numpy as np
import pytest
import rawpy
from PIL import Image

from capture.photographs.images import read_image
from capture.photographs.raw import read_raw
from formats.picture_files import linear_from_srgb, write_exr
from scene.errors import CaptureError
from scene.frames import PEDESTAL, WHITE, Frames, decode
from tests.capture.conftest import mosaic_of, write_dng

CODE = 1 / (WHITE - PEDESTAL)
DN = 1 / (16383 - 512)

LOCKED = {
    "demosaic_algorithm": rawpy.DemosaicAlgorithm.LINEAR,
    "user_wb": [1, 1, 1, 1],
    "output_color": rawpy.ColorSpace.raw,
    "gamma": (1, 1),
    "no_auto_bright": True,
    "adjust_maximum_thr": 0,
    "output_bps": 16,
    "user_flip": 0,
}


def ramps(height=64, width=96):
    """Three planes of different slopes: bilinear interpolation gives planes back exactly."""
    v, u = np.mgrid[:height, :width] / np.array([height, width])[:, None, None]
    return np.stack([0.1 + 0.5 * u, 0.6 - 0.3 * v, 0.2 + 0.2 * u + 0.3 * v], -1)


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_every_bayer_pattern_gives_its_own_colours_back(tmp_path, pattern):
    scene = ramps()
    found = read_raw(write_dng(tmp_path / "a.dng", mosaic_of(scene, pattern), pattern=pattern))
    assert found.is_mosaic
    inner = np.s_[2:-2, 2:-2]
    assert np.abs(decode(found.codes)[inner] - scene[inner]).max() < 0.5 * DN + 1.5 * CODE


def test_all_colours_at_every_pixel_above_a_black_level(tmp_path):
    image = np.random.default_rng(5).integers(600, 16383, (40, 60, 3), dtype=np.uint16)
    level = (50714, 3, 3, (512, 512, 512), True)
    found = read_raw(write_dng(tmp_path / "l.dng", image, black=None, white=16383, more=[level]))
    assert not found.is_mosaic
    assert np.abs(decode(found.codes) - (image.astype(float) - 512) * DN).max() < CODE


def test_bands_have_no_seams(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    path = write_dng(tmp_path / "a.dng", mosaic_of(rng.uniform(0, 1, (70, 40, 3))))
    whole = read_raw(path).codes
    monkeypatch.setattr("capture.photographs.raw.BAND_ROWS", 16)
    assert np.array_equal(read_raw(path).codes, whole)


def test_each_site_has_its_own_black_level(tmp_path):
    black = np.array([[500, 510], [520, 530]])
    grid = np.tile(black, (20, 30)) + 4000
    found = read_raw(write_dng(tmp_path / "a.dng", grid.astype(np.uint16), black=black.ravel()))
    linear = decode(found.codes)
    assert np.ptp(linear) <= CODE * 1.01
    assert linear.mean() == pytest.approx(4000 / found.sensor_range, abs=CODE)


def test_a_real_camera_file_agrees_with_libraw(shared):
    path = shared("real/raw_dng/colorchart.dng")
    found = decode(read_raw(path).codes)
    with rawpy.imread(str(path)) as raw:
        black, white = raw.black_level_per_channel[0], raw.white_level
        dark = raw.raw_image_visible < black
        expected = raw.postprocess(**LOCKED, user_sat=int(white - black)) / 65535
    # LibRaw cuts what is below black before it interpolates: compare where no neighbour is.
    near_dark = np.zeros_like(dark)
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            near_dark |= np.roll(dark, (row, column), (0, 1))
    judged = ~near_dark
    judged[[0, -1]] = judged[:, [0, -1]] = False
    assert judged.mean() > 0.5
    assert np.abs(found - expected)[judged].max() < 1.5 / 65535 + 1.5 * CODE


@pytest.mark.parametrize("floats", [{}, {"black": None, "white": 1}], ids=["whole numbers", "floats"])
@pytest.mark.parametrize("half", [False, True])
def test_a_highlight_changes_no_other_pixel(tmp_path, floats, half):
    def read(scene):
        values = mosaic_of(scene, white=None).astype("f4") if floats else mosaic_of(scene)
        return read_raw(write_dng(tmp_path / "a.dng", values, **floats), half=half).codes

    scene = ramps() - 0.15
    plain, step = read(scene), 2 if half else 1
    assert decode(plain).min() < 0, "noise below black is kept"
    for level in (0.9, 1.5, 300.0):
        shot = scene.copy()
        shot[30:33, 40:43] = level
        rows, columns = np.nonzero((read(shot) != plain).any(-1))
        assert 29 // step <= rows.min() <= rows.max() <= 33 // step
        assert 39 // step <= columns.min() <= columns.max() <= 43 // step


def test_noise_below_black_is_kept(tmp_path):
    rng = np.random.default_rng(3)
    dark = np.round(512 + rng.normal(scale=6, size=(200, 200))).astype(np.uint16)
    linear = decode(read_raw(write_dng(tmp_path / "a.dng", dark)).codes)
    truth = (dark.mean() - 512) * DN
    assert linear.min() < -6 * DN
    assert abs(linear.mean() - truth) < 0.1 * DN


@pytest.mark.parametrize("floats", [False, True])
def test_the_session_has_one_white_level(tmp_path, floats):
    """A file with a lower white level holds the same values for the same light, and clips earlier."""
    scene, inner = ramps() * 0.5, np.s_[2:-2, 2:-2]
    if floats:
        write_dng(tmp_path / "a.dng", mosaic_of(scene, white=None).astype("f4"), black=None, white=2)
    else:
        write_dng(tmp_path / "a.dng", mosaic_of(scene), white=15000)
    first, lower = (1, 2) if floats else (16383 - 512, 15000 - 512)
    alone, found = read_raw(tmp_path / "a.dng"), read_raw(tmp_path / "a.dng", sensor_range=first)
    assert alone.sensor_range == pytest.approx(lower)
    for one, scale in ((alone, first / lower), (found, 1)):
        assert np.abs(decode(one.codes)[inner] - scene[inner] * scale).max() < 0.5 * DN + 1.5 * CODE
    assert found.white == pytest.approx(min(lower / first, 1))


def test_superpixels(tmp_path):
    grid = np.zeros((40, 60), np.uint16)
    grid[0::2, 0::2], grid[0::2, 1::2], grid[1::2, 0::2], grid[1::2, 1::2] = 3000, 5000, 5200, 7000
    grid[0, 1] = 16383
    found = read_raw(write_dng(tmp_path / "a.dng", grid), half=True)
    linear = decode(found.codes)
    assert linear.shape == (20, 30, 3)
    assert not found.is_mosaic
    assert np.allclose(linear[1:], (np.array([3000, 5100, 7000]) - 512) * DN, atol=CODE)
    frames = Frames(("a",), found.codes[None], np.ones(1))
    expected = np.zeros((1, 20, 30), bool)
    expected[0, 0, 0] = True
    assert np.array_equal(frames.saturated(), expected), "one clipped green must not hide in the mean"


XTRANS = "GGRGGB GGBGGR BRGRBG GGBGGR GGRGGB RBGBRG".replace(" ", "")


def test_another_mosaic_than_bayer(tmp_path):
    """X-Trans: its own samples come back, noise below black too."""
    rng = np.random.default_rng(4)
    grid = rng.integers(480, 9000, (66, 84), dtype=np.uint16)
    found = read_raw(write_dng(tmp_path / "x.dng", grid, pattern=XTRANS, period=(6, 6)))
    channel = np.tile(np.array(["RGB".index(letter) for letter in XTRANS]).reshape(6, 6), (11, 14))
    own = np.take_along_axis(decode(found.codes), channel[..., None], 2)[..., 0]
    assert np.abs(own - (grid.astype(float) - 512) * DN).max() < DN
    assert found.is_mosaic


def test_a_real_tga_is_its_png(shared):
    tga = shared("real/uw_psm/tga_chrome/chrome.3.tga")
    png = shared("real/uw_psm/png/chrome/chrome.3.png")
    assert np.array_equal(read_image(tga, "linear").codes, read_image(png, "linear").codes)


def test_srgb_is_undone():
    """Against the standard's own points: 0.5 encoded is 21.4 % of the light."""
    assert linear_from_srgb(np.array([0.0, 0.04045, 0.5, 1.0])) == pytest.approx(
        [0, 0.04045 / 12.92, 0.21404114, 1], abs=1e-7
    )


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_stated_gamma_is_undone(tmp_path, dtype):
    white, light = np.iinfo(dtype).max, ramps()
    values = (light ** (1 / 1.8) * white).round().astype(dtype)
    assert cv2.imwrite(str(tmp_path / "a.png"), values[..., ::-1])
    linear = decode(read_image(tmp_path / "a.png", 1.8).codes)
    assert np.abs(linear - light).max() < 1.5 / white + CODE


KINDS, HOW = (".png", ".jpg", ".tif", ".tga", ".exr", ".pgm", ".dng"), ("cut", "noise", "empty", "absent")


@pytest.mark.parametrize(("suffix", "how"), [*itertools.product(KINDS, HOW), (".exr", "no number")])
def test_a_broken_file_is_named(tmp_path, suffix, how):
    path, values = tmp_path / f"flash_007{suffix}", ramps()
    if suffix == ".exr":
        write_exr(path, np.where(values > 0.5, np.nan, values) if how == "no number" else values)
    elif suffix == ".dng":
        write_dng(path, mosaic_of(values))
    else:
        Image.fromarray((255 * values[..., 0] if suffix == ".pgm" else 255 * values).astype(np.uint8)).save(path)
    data = path.read_bytes()
    content = {"cut": data[: len(data) // 2], "noise": np.random.default_rng(6).bytes(4000), "empty": b""}
    path.write_bytes(content.get(how, data))
    if how == "absent":
        path.unlink()
    with pytest.raises(CaptureError, match="flash_007.*no number" if how == "no number" else "flash_007"):
        read_raw(path) if suffix == ".dng" else read_image(path, "linear")
