"""The audit of what is known beside the pixels: settings that differ."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capture.audit.camera_settings import exposure_gains, mixed_settings
from capture.camera.exif import Exif
from capture.session.session_types import CaptureSession


def numbered(count):
    files = tuple(Path(f"flash_{i:03d}.png") for i in range(count))
    return CaptureSession("numbered", Path(), files, tuple(file.stem for file in files), tuple(range(count)))


def test_mixed_settings_are_named():
    session = numbered(4)
    usual = Exif(exposure_s=0.01, iso=100, aperture=8.0, focal_mm=50, camera="A")
    assert mixed_settings(session, [usual] * 4, []) == []
    odd = Exif(exposure_s=0.01, iso=200, aperture=5.6, focal_mm=55, camera="B")
    found = mixed_settings(session, [usual, usual, odd, usual], [])
    assert not any("not tell" in text for text in found)
    for part in ("flash_002 (ISO 200)", "flash_002 (aperture f/5.6)", "flash_002 (focal length 55 mm)", "(camera B)"):
        assert any(text.startswith("flash_002") and part in text for text in found)
    (silent,) = mixed_settings(session, [usual, usual, Exif(), usual], [])
    assert silent.startswith("flash_002: no exposure in EXIF")
    assert mixed_settings(session, [Exif()] * 4, []) == []


USUAL = Exif(exposure_s=0.01, iso=100.0, aperture=8.0)
SETTINGS = ("exposure_s", "iso", "aperture")


@pytest.mark.parametrize("unknown", [(), ("aperture",), ("iso",), ("aperture", "iso"), ("exposure_s",)])
def test_what_no_frame_tells_is_the_same_in_all(unknown):
    """A lens without contacts has one aperture; what is known of the others still tells how unlike they are."""
    odd = {"exposure_s": (0.02, 2), "iso": (400.0, 4), "aperture": (4.0, 4)}
    frames = [USUAL, USUAL, *(replace(USUAL, **{name: value}) for name, (value, _) in odd.items()), USUAL]
    frames = [replace(frame, **dict.fromkeys(unknown)) for frame in frames]
    wanted = [1, 1, *(1 if name in unknown else 1 / times for name, (_, times) in odd.items()), 1]
    gain, ambient = exposure_gains(frames, [replace(frames[0], iso=50.0), Exif()])
    np.testing.assert_allclose(gain / gain[0], wanted)
    assert "iso" in unknown or ambient == [2 * gain[0], 1]
    told = mixed_settings(numbered(6), frames, [])
    assert len(told) == 3 - len(unknown)
    for text in told:
        assert "They were scaled to the others' exposure" in text
        words = {"exposure_s": "the shutter", "iso": "the sensitivity", "aperture": "the aperture"}
        said = [words[name] for name in SETTINGS if name in unknown]
        assert (f"since EXIF does not tell: {' and '.join(said)}." in text) == bool(unknown)


def test_what_some_frames_do_not_tell_is_taken_from_the_others():
    frames = [USUAL, replace(USUAL, iso=None), replace(USUAL, iso=None, exposure_s=0.02), USUAL, Exif()]
    gain, _ = exposure_gains(frames)
    np.testing.assert_allclose(gain, [1, 1, 0.5, 1, 1])
    told = mixed_settings(numbered(5), frames, [])
    assert "flash_001, flash_002: EXIF does not tell the sensitivity, which 2 others have; taken as ISO 100." in told
    assert any(text.startswith("flash_002 (exposure time 0.02 s)") for text in told)
    assert any(text.startswith("flash_004: no exposure in EXIF, unlike the other 4 frames") for text in told)
    assert len(told) == 3
