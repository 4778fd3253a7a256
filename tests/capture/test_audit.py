"""The audit: each fault, put into a sound session by the test, is named; a sound session raises no alarm."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from capture.audit.encoding_check import noise_slope, speaks_for_gamma
from capture.audit.frame_facts import facts_of
from capture.audit.movement import movement
from capture.photographs.decode import decode
from capture.session.session import load_session
from scene.errors import CaptureError
from scene.frames import Frames
from scene.store import Store


@pytest.fixture
def warnings_of(picture_session, tmp_path):
    def audited(images, **more):
        _, report = decode(load_session(picture_session(images, **more)), Store(tmp_path / "out"))
        return report.warnings

    return audited


def test_misfires_are_refused_by_name(warnings_of, scene_pictures):
    images = scene_pictures()
    ambient = 0.1 * images.mean(0)
    images = images * 0.7 + ambient
    rng = np.random.default_rng(1)
    for i in (3, 7):
        images[i] = ambient + rng.normal(scale=0.002, size=ambient.shape)
    with pytest.raises(CaptureError) as caught:
        warnings_of(images, ambient=ambient)
    text = str(caught.value)
    assert "flash_003: the flash did not fire" in text
    assert "flash_007: the flash did not fire" in text
    assert "frames.skip" in text
    assert text.count("did not fire") == 2


def test_a_misfire_in_a_bright_room_without_an_ambient_frame(warnings_of, scene_pictures):
    images = scene_pictures() * 0.6
    room = 0.25 * images.mean(0)
    images += room
    images[5] = room
    (warning,) = [text for text in warnings_of(images) if "flash_005" in text]
    assert "darker than every other frame" in warning


@pytest.mark.parametrize("factor", [0.5, 0.75])
def test_another_exposure_without_exif_is_named_and_scaled(picture_session, scene_pictures, tmp_path, factor):
    """It moved a ball by 6 px and the lights by 16 degrees, and the balls were blamed."""
    images = scene_pictures() * 0.6
    ambient = 0.25 * images.mean(0)
    lit = images.copy()
    # The flash leaves a part of the scene in shadow.
    lit[:, :40] = 0
    lit += ambient
    lit[3] *= factor
    frames, report = decode(load_session(picture_session(lit, ambient=ambient)), Store(tmp_path / "out"))
    (warning,) = report.warnings
    assert warning.startswith("flash_003: in the flash's shadows")
    assert "another exposure" in warning
    assert frames.gain[3] == pytest.approx(1 / factor, rel=0.05)
    assert (np.delete(frames.gain, 3) == 1).all()


def test_a_flash_in_the_ambient_frame(warnings_of, scene_pictures):
    images = scene_pictures()
    with pytest.raises(CaptureError, match=r"frames\.ambient"):
        warnings_of(images, ambient=images.mean(0) * 1.05)
    with pytest.raises(CaptureError, match=r"frames\.ambient: is brighter.*Shoot the ambient frame again"):
        # From a place of its own: it lights what stands in the others' shadow.
        ambient = images.mean(0) * 0.5
        ambient[: len(ambient) // 8] = 1.4 * images.max(0)[: len(ambient) // 8]
        warnings_of(images, ambient=ambient)


def test_one_photograph_twice(warnings_of, scene_pictures):
    images = scene_pictures()
    images[9] = images[2]
    (warning,) = warnings_of(images)
    assert "flash_002 and flash_009 are the same photograph" in warning


def test_two_flashes_from_one_place(warnings_of, scene_pictures):
    """The noise and the power differ: another photograph, the same light."""
    images = scene_pictures()
    again = scene_pictures()[4] * 0.8
    images[10] = again + np.random.default_rng(5).normal(scale=0.003, size=again.shape)
    (warning,) = warnings_of(images)
    assert "flash_004, flash_010: lit from the same place" in warning


def test_overexposure_is_told_from_highlights(warnings_of, scene_pictures):
    images = scene_pictures()
    for i in range(12):
        images[i, 50:53, 20 + 5 * i : 23 + 5 * i] = 1.0
    assert warnings_of(images) == (), "a sound session raises no alarm; a chrome ball's highlights may clip"
    images[6, 150:190, 200:260] = 1.0
    (warning,) = warnings_of(images)
    assert warning.startswith("flash_006: overexposed")


@pytest.mark.parametrize("ceiling", [0.35, 0.6])
def test_a_ceiling_anywhere_below_white_is_told_and_what_it_cut_counts_as_clipped(
    picture_session, scene_pictures, tmp_path, ceiling
):
    """A converter cut at 0.4 of white: the white ball was called glossy, and normals were 1.8 degrees worse."""
    images = scene_pictures()
    images *= 1.2 * ceiling / np.quantile(images, 0.97)
    frames, report = decode(load_session(picture_session(np.minimum(images, ceiling))), Store(tmp_path / "out"))
    assert [text for text in report.warnings if f"pixels pile up at {ceiling:.2f}" in text]
    cut = (images > 1.02 * ceiling).any(-1)
    assert cut.mean() > 0.01
    assert frames.saturated()[cut].all()
    assert not frames.saturated()[(images < 0.9 * ceiling).all(-1)].any()


def shift(right, down):
    return np.array([[1, 0, right], [0, 1, down]], float)


def moved(image, matrix):
    size = (image.shape[1], image.shape[0])
    return cv2.warpAffine(image, matrix, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


ONE, HALF, PLACE = slice(8, 9), slice(6, None), r"right ([+-][\d.]+), down ([+-][\d.]+)"
TURN, ZOOM = (cv2.getRotationMatrix2D((160, 120), *change) for change in ((2.0, 1.0), (0.0, 1.02)))


@pytest.mark.parametrize(
    ("frames", "matrix", "said", "numbers", "off"),
    [
        (ONE, shift(1.5, 0.0), "flash_008: the picture lies", (1.5, 0.0), 0.5),
        (ONE, shift(-1.2, 2.0), "flash_008: the picture lies", (-1.2, 2.0), 0.5),
        (ONE, shift(0.0, -7.0), "flash_008: the picture lies", (0.0, -7.0), 0.6),
        # A jolt is measured on reduced pictures.
        (ONE, shift(60.0, 35.0), "flash_008: the picture lies", (60.0, 35.0), 1.2),
        (HALF, shift(2.0, 0.7), "flash_006: from here on .* after flash_005", (2.0, 0.7), 0.5),
        (HALF, shift(9.0, -4.0), "flash_006: from here on .* after flash_005", (9.0, -4.0), 0.5),
        (slice(5, None), TURN, r"flash_005: from here on .* turned by ([\d.]+) degrees", (2,), 0.4),
        # Nothing lies elsewhere in the middle of the picture.
        (slice(7, None), ZOOM, r"flash_007: from .* grown by \+([\d.]+)%.* the zoom moved after flash_006", (2,), 0.6),
    ],
)
def test_a_camera_that_moved_is_named_with_the_frame_and_how_far(
    warnings_of, scene_pictures, frames, matrix, said, numbers, off
):
    """In full-size pixels and with the right sign: the picture's content moves right and down."""
    images = scene_pictures()
    images[frames] = [moved(image, matrix) for image in images[frames]]
    (warning,) = warnings_of(images)
    assert re.match(said, warning)
    found = re.search(said if "(" in said else PLACE, warning)
    assert [float(number) for number in found.groups()] == pytest.approx(numbers, abs=off)


def test_movement_is_not_claimed_where_nothing_stands_still():
    """Smooth shading and noise only: no edge could tell."""
    rng = np.random.default_rng(0)
    v, u = np.mgrid[-1:1:300j, -1:1:400j]
    images = [0.3 + 0.1 * (np.cos(a) * u + np.sin(a) * v) for a in np.linspace(0, 5, 8)]
    images = np.repeat(np.array(images)[..., None], 3, -1) + rng.normal(scale=0.004, size=(8, 300, 400, 3))
    frames = Frames.from_linear(tuple("abcdefgh"), images)
    assert not movement(frames, [facts_of(codes) for codes in frames.codes]).moved.any()


@pytest.mark.parametrize("discs", [0.02, 0.08])
def test_a_half_that_turns_dark_is_no_jolt(discs):
    """The edge of a folded card seems to jump by the width of a half; discs on the table, whose shadows move, stand."""
    rng, v, u = np.random.default_rng(1), *np.mgrid[:240, :320]
    left, right = ((abs(v - 118) < 47) & (abs(u - middle) < 22) for middle in (140, 183))
    images = []
    for number, around in enumerate(np.linspace(0, 2 * np.pi, 16, endpoint=False)):
        image = 0.1 + 0.03 * (np.cos(number) * (u - 160) / 160 + np.sin(number) * (v - 120) / 120)
        for column, row in ((49, 43), (274, 193), (51, 193)):
            image[np.hypot(u - column - 18 * np.cos(around), v - row - 18 * np.sin(around)) < 22] = 0.005
            image[np.hypot(u - column, v - row) < 24] = discs
        image[left], image[right] = (0.07, 0.6) if number == 12 else (0.5, 0.4)
        images.append(image[..., None] + rng.normal(scale=0.002, size=(240, 320, 3)))
    frames = Frames.from_linear(tuple("abcdefghijklmnop"), np.array(images))
    assert not movement(frames, [facts_of(codes) for codes in frames.codes]).moved.any()


@pytest.mark.full
@pytest.mark.parametrize("name", ["sessions/bunny", "real/diligent/catPNG"])
def test_a_still_camera_of_a_real_session(shared, tmp_path, name):
    """No alarm as it is; a frame moved by 3 px is found, and no other."""
    session = load_session(shared(name))
    keep = range(0, len(session.flash), max(1, len(session.flash) // 12))
    session = replace(session, flash=tuple(session.flash[i] for i in keep), names=tuple(session.names[i] for i in keep))
    frames, report = decode(session, Store(tmp_path / "out"))
    assert report.warnings == ()
    codes = np.array(frames.codes)
    codes[3] = moved(codes[3], shift(2.4, -1.8))
    frames = replace(frames, codes=codes)
    found = movement(frames, [facts_of(picture) for picture in codes])
    assert np.flatnonzero(found.moved).tolist() == [3]
    assert np.allclose(found.shift_px[3], (2.4, -1.8), atol=0.7)


def srgb(linear):
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_noise_tells_gamma(warnings_of):
    """Sixteen bits, no metadata: only the noise can tell. Stated as sRGB, all is well."""
    rng = np.random.default_rng(2)
    v, u = np.mgrid[-1:1:200j, -1:1:300j]
    azimuth = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    ramp = np.exp(-2.5 + 1.5 * np.array([np.cos(a) * u + np.sin(a) * v for a in azimuth]))
    light = np.repeat(ramp[..., None], 3, -1)
    light = light + rng.normal(size=light.shape) * np.sqrt(1e-6 + 2e-5 * light)
    assert warnings_of(light) == ()
    (warning,) = warnings_of(srgb(light))
    assert "noise that falls with brightness" in warning
    assert "linear = false" in warning
    assert warnings_of(srgb(light), table="linear = false") == ()


@pytest.mark.parametrize("name", ["sessions/bunny", "real/diligent/ballPNG", "real/diligent/catPNG"])
def test_noise_tells_gamma_on_real_captures(shared, tmp_path, name):
    session = load_session(shared(name))
    session = replace(session, flash=session.flash[:4], names=session.names[:4], ambient=())
    frames, _ = decode(session, Store(tmp_path / "out"))
    linear = frames.read(subtract_ambient=False)
    linear /= np.quantile(linear, 0.9999)
    as_linear = noise_slope(Frames.from_linear(frames.names, linear))
    as_srgb = noise_slope(Frames.from_linear(frames.names, srgb(linear)))
    assert as_linear is not None
    assert as_srgb is not None
    assert not speaks_for_gamma(*as_linear)
    assert speaks_for_gamma(*as_srgb)


def test_eight_bits_of_unknown_encoding(tmp_path, scene_pictures):
    for i, image in enumerate(scene_pictures()):
        cv2.imwrite(str(tmp_path / f"flash_{i:03d}.png"), (image.clip(0, 1) * 255).round().astype(np.uint8)[..., ::-1])
    (tmp_path / "session.toml").write_text('[frames]\nflash = "*.png"\n')
    _, report = decode(load_session(tmp_path), Store(tmp_path / "out"))
    assert any("not stated" in text for text in report.warnings)
    (tmp_path / "session.toml").write_text('[frames]\nflash = "*.png"\nlinear = true\n')
    _, report = decode(load_session(tmp_path), Store(tmp_path / "out"))
    assert report.warnings == ()
