"""What is done to every photograph alike: dark frame, flat field; and what is clipped stays clipped."""

import numpy as np
import pytest

from capture.photographs.decode import decode
from capture.session.session import load_session
from scene.errors import CaptureError
from scene.files import write_png
from scene.store import Store
from tests.capture.conftest import linear_png, mosaic_of, write_dng
from tests.capture.test_decode import files_of

DN = 1 / (16383 - 512)


def test_dark_and_flat(picture_session, scene_pictures, tmp_path):
    """A sensor with an offset that grows to one side, behind a lens that darkens its corners."""
    truth = scene_pictures(5, shape=(60, 80))
    v, u = np.mgrid[-1:1:60j, -1:1:80j]
    vignette = (1 / (1 + 0.5 * (u * u + v * v)))[..., None] * [1.0, 0.9, 0.8]
    offset = 0.01 + 0.005 * u[..., None] + np.zeros(3)
    shot = truth * vignette + offset
    shot[3, 40:44, 10:14] = 1.0
    folder = picture_session(shot, table='linear = true\ndark = "dark.png"\nflat = "flat.png"')
    for name, image in (("dark", offset), ("flat", 0.7 * vignette + offset)):
        linear_png(folder / f"{name}.png", image)
    frames, _ = decode(load_session(folder), Store(tmp_path / "out"))
    # Even light would come out as bright as the flat field's darkest place, so that nothing is lifted above white.
    scale = vignette.mean((0, 1))
    scale = scale * np.quantile((vignette / scale)[::4, ::4], 0.001)
    clean = np.ones((60, 80), bool)
    clean[40:44, 10:14] = False
    for i in range(5):
        assert np.abs(frames.frame(i) - truth[i] * scale)[clean].max() < 5e-4
    assert frames.saturated(frames=[3])[0, 40:44, 10:14].all(), "what was clipped stays clipped"
    assert frames.saturated().sum() == 16
    assert files_of(tmp_path / "out") == ["codes.npy", "frames.json"]


@pytest.mark.parametrize("white", [15200, 16383])
def test_a_flat_field_hides_no_clipped_sample(tmp_path, scene_pictures, white):
    """The header says 16383; wherever the sensor ends, what it clipped is flagged, and nothing else is."""
    v, u = np.mgrid[-1:1:96j, -1:1:128j]
    vignette = (1 / (1 + 0.6 * (u * u + v * v)))[..., None] * np.ones(3)
    truth = scene_pictures(6, shape=(96, 128)) * 3.5
    ceiling = (white - 512) * DN
    for i, picture in enumerate(truth):
        write_dng(tmp_path / f"flash_{i}.dng", mosaic_of(np.minimum(picture * vignette, ceiling)))
    write_dng(tmp_path / "flat.dng", mosaic_of(0.7 * vignette))
    (tmp_path / "session.toml").write_text('[frames]\nflash = "flash_*.dng"\nhalf = true\nflat = "flat.dng"\n')
    frames, report = decode(load_session(tmp_path), Store(tmp_path / "out"))
    assert any("the sensor clips there" in text for text in report.warnings) == (white == 15200)
    # A superpixel is the mean of four places; those near the limit may go either way.
    seen = (truth * vignette).reshape(6, 48, 2, 64, 2, 3)
    clipped = (seen.min((2, 4)) >= ceiling).any(-1)
    good = (seen.max((2, 4)) < 0.95 * ceiling).all(-1)
    assert clipped.mean() > 0.05
    assert good.mean() > 0.4
    assert frames.saturated()[clipped].all()
    lifted = (truth.reshape(6, 48, 2, 64, 2, 3).mean((2, 4)) > 1).any(-1)
    assert (good & lifted).sum() > 20, "as bright as clipped ones, in a dark corner"
    assert frames.saturated()[good].mean() < 0.001


def test_a_flat_frame_that_cannot_do(picture_session, scene_pictures, tmp_path):
    folder = picture_session(scene_pictures(5, shape=(60, 80)), table='linear = true\nflat = "flat.png"')
    for level, part in ((0.001, "too dark"), (1.0, "overexposed")):
        write_png(folder / "flat.png", np.full((60, 80, 3), int(level * 65535), np.uint16))
        with pytest.raises(CaptureError, match=part):
            decode(load_session(folder), Store(tmp_path / "out"))
    assert files_of(tmp_path / "out") == []
