"""RAW files: the locked linear decode, against known mosaics and against LibRaw itself."""

import numpy as np
import pytest
import rawpy
import tifffile

from capture.photographs.raw import read_raw
from scene.errors import CaptureError
from scene.frames import PEDESTAL, WHITE, Frames, decode

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
def test_every_bayer_pattern_gives_its_own_colours_back(tmp_path, write_dng, mosaic, pattern):
    scene = ramps()
    found = read_raw(write_dng(tmp_path / "a.dng", mosaic(scene, pattern), pattern=pattern))
    assert found.is_mosaic
    inner = np.s_[2:-2, 2:-2]
    assert np.abs(decode(found.codes)[inner] - scene[inner]).max() < 0.5 * DN + 1.5 * CODE


def test_bands_have_no_seams(tmp_path, write_dng, mosaic, monkeypatch):
    rng = np.random.default_rng(0)
    path = write_dng(tmp_path / "a.dng", mosaic(rng.uniform(0, 1, (70, 40, 3))))
    whole = read_raw(path).codes
    monkeypatch.setattr("capture.photographs.raw.BAND_ROWS", 16)
    assert np.array_equal(read_raw(path).codes, whole)


def test_each_site_has_its_own_black_level(tmp_path, write_dng):
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


def test_a_highlight_changes_no_other_pixel(tmp_path, write_dng, mosaic):
    scene = ramps()
    plain = read_raw(write_dng(tmp_path / "a.dng", mosaic(scene))).codes
    for level in (0.9, 1.5):
        shot = scene.copy()
        shot[30:33, 40:43] = level
        bright = read_raw(write_dng(tmp_path / "b.dng", mosaic(shot))).codes
        rows, columns = np.nonzero((bright != plain).any(-1))
        assert 29 <= rows.min() <= rows.max() <= 33
        assert 39 <= columns.min() <= columns.max() <= 43


def test_noise_below_black_is_kept(tmp_path, write_dng):
    rng = np.random.default_rng(3)
    dark = np.round(512 + rng.normal(scale=6, size=(200, 200))).astype(np.uint16)
    linear = decode(read_raw(write_dng(tmp_path / "a.dng", dark)).codes)
    truth = (dark.mean() - 512) * DN
    assert linear.min() < -6 * DN
    assert abs(linear.mean() - truth) < 0.1 * DN


def test_the_session_has_one_white_level(tmp_path, write_dng, mosaic):
    """A file with a lower white level holds the same DN for the same light, and clips earlier."""
    scene = ramps() * 0.5
    path = write_dng(tmp_path / "a.dng", mosaic(scene), white=15000)
    found = read_raw(path, sensor_range=16383 - 512)
    inner = np.s_[2:-2, 2:-2]
    assert np.abs(decode(found.codes)[inner] - scene[inner]).max() < 0.5 * DN + 1.5 * CODE
    assert found.white == pytest.approx((15000 - 512) * DN)


def test_superpixels(tmp_path, write_dng):
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


def test_another_mosaic_than_bayer(tmp_path, write_dng):
    """X-Trans: its own samples come back, noise below black too."""
    rng = np.random.default_rng(4)
    grid = rng.integers(480, 9000, (66, 84), dtype=np.uint16)
    found = read_raw(write_dng(tmp_path / "x.dng", grid, pattern=XTRANS, period=(6, 6)))
    channel = np.tile(np.array(["RGB".index(letter) for letter in XTRANS]).reshape(6, 6), (11, 14))
    own = np.take_along_axis(decode(found.codes), channel[..., None], 2)[..., 0]
    assert np.abs(own - (grid.astype(float) - 512) * DN).max() < DN
    assert found.is_mosaic


def test_a_raw_file_with_all_colours_at_every_pixel(tmp_path):
    rng = np.random.default_rng(5)
    image = rng.integers(600, 16383, (40, 60, 3), dtype=np.uint16)
    tags = [
        (50706, 1, 4, b"\x01\x04\x00\x00", True),
        (50708, 2, 0, "Test One", True),
        (50714, 3, 3, (512, 512, 512), True),
        (50717, 4, 3, (16383,) * 3, True),
        (50721, 10, 9, tuple(v for x in np.eye(3).ravel() for v in (int(x * 10000), 10000)), True),
        (50728, 5, 3, (62, 100, 1, 1, 71, 100), True),
        (50778, 3, 1, 21, True),
    ]
    tifffile.imwrite(tmp_path / "l.dng", image, photometric=34892, extratags=tags, metadata=None)
    found = read_raw(tmp_path / "l.dng")
    assert not found.is_mosaic
    assert np.abs(decode(found.codes) - (image.astype(float) - 512) * DN).max() < CODE


@pytest.mark.parametrize("how", ["cut", "noise", "empty", "absent"])
def test_a_broken_file_is_named(tmp_path, write_dng, mosaic, how):
    path = tmp_path / "flash_007.dng"
    data = write_dng(path, mosaic(ramps())).read_bytes()
    if how == "absent":
        path.unlink()
    else:
        rng = np.random.default_rng(6)
        path.write_bytes({"cut": data[: len(data) // 2], "noise": rng.bytes(4000), "empty": b""}[how])
    with pytest.raises(CaptureError, match=r"flash_007\.dng"):
        read_raw(path)
