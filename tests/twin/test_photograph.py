"""Photographs by the virtual camera in every format, each stated number measured again; the twin's folder."""

import tomllib
from dataclasses import replace
from datetime import datetime

import cv2
import numpy as np
import pytest
import rawpy
import tifffile

from capture.photographs.images import read_image
from capture.photographs.raw import read_raw
from scene.camera import Camera
from scene.errors import RenderError, SceneError
from scene.frames import Frames, decode
from scene.lights import Lights
from scene.store import Store
from twin.camera.grain import sensor_like
from twin.camera.virtual_camera import Sensor, expose, write_dng
from twin.camera.virtual_photograph import developed, write_photograph
from twin.twin_session import Shooting, write_session

SILENT = {"full_well_e": 1e13, "read_noise_e": 0.0, "blur_px": 0.0}
SHOT = {"exposure_s": 1 / 125, "iso": 100, "aperture": 8.0, "focal_mm": 18.0,
        "time": datetime(2026, 11, 21, 10, 0, 4, 370000)}  # fmt: skip
PLAIN = {"cfa": "none", "neutral": (1, 1, 1)}


def rng(seed):
    return np.random.default_rng(10_100 + seed)


def written(path, image, sensor, seed=0):
    write_photograph(path, image, sensor, rng(seed), focal_mm=50.0, time=SHOT["time"])
    return path


def linear_of(path):
    return decode(read_image(path, encoding="linear").codes)


@pytest.mark.parametrize("iso", [100, 400, 3200])
def test_noise_follows_the_iso_in_a_dng_that_libraw_reads(tmp_path, iso):
    """Photon transfer: variance = mean / gain + (read / gain)^2 + adc^2 + 1/12; gain: electrons per DN."""
    sensor = Sensor(30000, 5.0, 1.5, iso, 600, 15600, blur_px=0, neutral=(1, 1, 1))
    gain, levels, counts = 30000 * 100 / iso / 15000, np.array([0.0, 0.05, 0.3, 0.8]), []
    for number, level in enumerate(levels):
        with rawpy.imread(str(written(tmp_path / "a.dng", np.full((240, 240, 3), level), sensor, number))) as raw:
            counts.append(raw.raw_image.astype(float) - raw.black_level_per_channel[0])
    means, variances = np.mean(counts, (1, 2)), np.var(counts, (1, 2))
    assert np.allclose(means, levels * 15000, rtol=4e-3, atol=0.3)
    assert np.polyfit(means, variances, 1)[0] == pytest.approx(1 / gain, rel=0.03)
    assert variances[0] == pytest.approx((5 / gain) ** 2 + 1.5**2 + 1 / 12, rel=0.03)


def test_vignetting_is_the_stated_polynomial_about_the_pictures_middle():
    sensor = Sensor(**SILENT, **PLAIN, vignetting=(-0.4, 0.1, -0.05))
    linear = developed(expose(np.full((60, 90, 3), 0.8), sensor, rng(1)), sensor)
    v, u = np.mgrid[:60, :90]
    square = ((u - 44.5) ** 2 + (v - 29.5) ** 2) / (45**2 + 30**2)
    expected = 0.8 * (1 - 0.4 * square + 0.1 * square**2 - 0.05 * square**3)
    assert np.abs(linear - expected[..., None]).max() < 2e-4


def test_light_is_blurred_before_it_is_shaded_and_clipped_after():
    """A spot of three times white: what the lens spreads is not cut off first, and white stays white."""
    image = np.zeros((41, 41, 3))
    image[20, 20] = 3.0
    sensor = Sensor(1e9, 0.0, blur_px=1.2, **PLAIN, white_level=65535, black_level=0)
    spot = expose(image, sensor, rng(2))[..., 1] / 65535
    assert spot.sum() == pytest.approx(3.0, rel=5e-3)
    for away in np.mgrid[:41, :41] - 20:
        assert (spot * away**2).sum() / spot.sum() == pytest.approx(1.2**2, rel=0.05)
    assert expose(100 * image, sensor, rng(2))[20, 20, 1] == 65535


@pytest.mark.parametrize("cfa", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_a_mosaic_is_written_bit_for_bit_and_developed_as_the_reader_of_raw_files_does(tmp_path, cfa):
    """A slope with a colour of its own: a shift by a pixel or two swapped colours would show."""
    sensor = Sensor(cfa=cfa, black_level=300, white_level=15000, neutral=(0.5, 1.0, 0.8))
    mosaic = np.random.default_rng(1).integers(0, 15001, (46, 64)).astype(np.uint16)
    write_dng(tmp_path / "raw.dng", mosaic, sensor, **SHOT)
    with rawpy.imread(str(tmp_path / "raw.dng")) as raw:
        assert np.array_equal(raw.raw_image, mosaic)
        assert (raw.black_level_per_channel, raw.white_level) == ([300] * 4, 15000)
        assert np.array_equal(np.where(raw.raw_colors == 3, 1, raw.raw_colors), sensor.channels(46, 64))
        assert np.allclose(raw.camera_whitebalance[:3], [2, 1, 1.25], rtol=1e-4)
        # Its colour matrix is sRGB's own: white-balanced raw is linear sRGB, so no conversion is left.
        assert np.allclose(raw.color_matrix[:, :3], np.eye(3), atol=1e-4)
    v, u = np.mgrid[:48, :64] / 64
    image = np.stack([0.2 + 0.3 * u, 0.5 - 0.2 * v, 0.3 + 0.2 * (u - v)], -1)
    sensor, inside = Sensor(**SILENT, cfa=cfa, neutral=(0.5, 1.0, 0.8)), np.s_[2:-2, 2:-2]
    mine = developed(expose(image, sensor, rng(4)), sensor)
    assert np.abs(mine - image)[inside].max() < 5e-4
    read = decode(read_raw(written(tmp_path / "a.dng", image, sensor, 4)).codes) / np.array(sensor.neutral)
    assert np.abs(mine - read)[inside].max() < 2e-4
    for name, tolerance in (("a.png", 2e-5), ("a.exr", 1e-3)):
        assert np.abs(linear_of(written(tmp_path / name, image, sensor, 4)) - mine).max() < tolerance


def test_exif_says_how_it_was_shot(tmp_path):
    write_dng(tmp_path / "a.dng", np.full((8, 8), 600, np.uint16), Sensor(pixel_um=20), **SHOT)
    assert [path.name for path in tmp_path.iterdir()] == ["a.dng"]
    with tifffile.TiffFile(tmp_path / "a.dng") as file:
        tags = file.pages.first.tags["ExifTag"].value
    value = {name: tags[name][0] / tags[name][1] for name in ("ExposureTime", "FNumber", "FocalLength")}
    assert value == {"ExposureTime": 0.008, "FNumber": 8, "FocalLength": 18}
    assert tags["ISOSpeedRatings"] == 100
    assert f"{tags['DateTimeOriginal']}.{tags['SubsecTimeOriginal']}" == "2026:11:21 10:00:04.370000"
    # Per centimetre.
    assert (tags["FocalPlaneXResolution"], tags["FocalPlaneResolutionUnit"]) == ((500, 1), 3)


def test_without_a_sensor_a_picture_is_what_was_rendered_and_noise_below_black_is_kept_in_an_exr(tmp_path):
    image = rng(5).random((20, 30, 3)).astype(np.float32)
    assert np.abs(linear_of(written(tmp_path / "a.png", image, None)) - image).max() < 2e-5
    assert np.abs(linear_of(written(tmp_path / "a.exr", image, None)) - image).max() < 5e-4
    sensor = Sensor(1000, 5.0, blur_px=0, **PLAIN)
    exr, png = (linear_of(written(tmp_path / f"b.{k}", np.zeros((80, 80, 3)), sensor, 6)) for k in ("exr", "png"))
    assert abs(exr.mean()) < 4 * 0.005 / np.sqrt(exr.size)
    assert exr.std() == pytest.approx(0.005, rel=0.03)
    assert png.min() > -1e-6
    assert png.mean() == pytest.approx(0.005 / np.sqrt(2 * np.pi), rel=0.05)


def test_what_cannot_be_photographed_is_named(tmp_path):
    image = np.full((4, 4, 3), 0.5)
    for sensor in (None, Sensor(cfa="none")):
        with pytest.raises(RenderError, match="file of a Bayer sensor"):
            written(tmp_path / "a.dng", image, sensor)
    with pytest.raises(RenderError, match="shape"):
        expose(image[..., 0], Sensor(), rng(8))
    image[1, 2, 0] = np.nan
    with pytest.raises(RenderError, match="1 of 16 pixels are NaN"):
        expose(image, Sensor(), rng(8))
    with pytest.raises(RenderError, match="even"):
        write_dng(tmp_path / "a.dng", np.zeros((5, 4), np.uint16), Sensor(), **SHOT)
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="cannot be written"):
        write_dng(tmp_path / "file" / "a.dng", np.zeros((4, 4), np.uint16), Sensor(), **SHOT)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


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


NAMES = ("b_10", "a_2", "c [x]")
CAMERA = Camera(48, 32, 20.5, 20.25, 5.75, 3.5, (0.01, 0.0, 0.0, 0.0, 0.0))
LIGHTS = Lights(NAMES, np.eye(3), np.ones((3, 3)), np.eye(3) * 500, np.array([0, 0, -300.0]))
LINEAR = np.random.default_rng(1).uniform(0, 1, (3, 32, 48, 3))
MASK = np.arange(1536).reshape(32, 48) > 700
TRUTH = np.where(MASK[..., None], [0, 0, 1.0], np.nan).astype(np.float32)


def png(path):
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]


def test_the_folder_holds_what_its_manifest_says(tmp_path):
    linear, told = np.concatenate([LINEAR[:2], LINEAR[2:] * 1.1 - 0.02]), []
    path = write_session(
        Store(tmp_path), Frames.from_linear(NAMES, linear), CAMERA, LIGHTS, MASK, TRUTH, ambient=LINEAR[0] / 4,
        progress=lambda done, total: told.append((done, total)),
    )  # fmt: skip
    session = tomllib.loads(path.read_text())
    # Not the names' order: the lights'. Brackets are a glob's, so they are escaped.
    assert session["frames"]["flash"] == ["flash/b_10.png", "flash/a_2.png", "flash/c [[]x].png"]
    # Else who opens the session is asked for the ambient frame that a rendering could not take.
    assert (session["frames"]["linear"], session["frames"]["ambient"]) == (True, "ambient/ambient.png")
    assert session["camera"] == {
        "width": 48, "height": 32, "fx": 20.5, "fy": 20.25, "cx": 5.75, "cy": 3.5,
        "distortion": [0.01, 0.0, 0.0, 0.0, 0.0],
    }  # fmt: skip
    for name, image in (*((f"flash/{name}", one) for name, one in zip(NAMES, linear, strict=True)),
                        ("ambient/ambient", LINEAR[0] / 4)):  # fmt: skip
        found = png(tmp_path / f"{name}.png")
        assert found.dtype == np.uint16
        # Brighter than white is white, and below black is black.
        assert np.allclose(found / 65535, np.clip(image, 0, 1), atol=2e-5)
    lights = Store(tmp_path).load_lights()
    assert lights.names == NAMES
    assert np.allclose(lights.positions_mm, LIGHTS.positions_mm)
    assert np.array_equal(Store(tmp_path).load_mask(), MASK)
    assert np.array_equal(np.load(tmp_path / session["object"]["normals"]), TRUTH, equal_nan=True)
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_the_virtual_camera_photographs_it_and_each_frame_has_its_own_noise(tmp_path):
    frames = Frames.from_linear(NAMES, np.broadcast_to(LINEAR[:1], LINEAR.shape))
    for folder in ("one", "again"):
        shooting = Shooting(Sensor(blur_px=0))
        write_session(Store(tmp_path / folder), frames, CAMERA, LIGHTS, MASK, TRUTH, shooting=shooting)
    session = tomllib.loads((tmp_path / "one" / "session.toml").read_text())
    assert session["frames"]["flash"][0] == "flash/b_10.dng"
    assert "linear" not in session["frames"]
    mosaics = []
    for name in NAMES:
        with rawpy.imread(str(tmp_path / "one" / "flash" / f"{name}.dng")) as raw:
            mosaics.append(raw.raw_image.astype(float))
    assert np.abs((mosaics[0][::2, 1::2] - 512) / (16383 - 512) - LINEAR[0, ::2, 1::2, 1]).max() < 0.04
    assert not np.array_equal(mosaics[0], mosaics[1])
    first, again = (tmp_path / folder / "flash" / "a_2.dng" for folder in ("one", "again"))
    assert first.read_bytes() == again.read_bytes()


def test_an_orthographic_twin_has_no_camera_table_and_what_does_not_fit_together_is_named(tmp_path):
    frames, flat = Frames.from_linear(NAMES, LINEAR), Camera.orthographic(48, 32)
    with pytest.raises(RenderError, match="one light a frame"):
        write_session(Store(tmp_path), frames, CAMERA, replace(LIGHTS, names=("a", "b", "c")), MASK, TRUTH)
    with pytest.raises(RenderError, match="must agree"):
        write_session(Store(tmp_path), frames, CAMERA, LIGHTS, MASK[:4], TRUTH)
    assert not list(tmp_path.iterdir())
    assert "camera" not in tomllib.loads(write_session(Store(tmp_path), frames, flat, LIGHTS, MASK, TRUTH).read_text())
