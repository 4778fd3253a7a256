"""The whole decode: what lands in the store, and what does not when a photograph is at fault."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from capture.photographs.decode import decode
from capture.session.session import load_session
from scene.errors import CaptureError, SessionError
from scene.frames import PEDESTAL, WHITE
from scene.store import Store
from tests.capture.conftest import mosaic_of, write_dng

CODE = 1 / (WHITE - PEDESTAL)
DN = 1 / (16383 - 512)


@pytest.fixture
def raw_session(tmp_path, scene_pictures):
    """Six flash frames and two ambient frames as Bayer DNG; returns the folder and the linear truth."""

    def write(*, exposures=(1.0,) * 6, table=""):
        ambient = 0.05 + 0.02 * scene_pictures(1, shape=(96, 128), seed=9)[0]
        light = scene_pictures(6, shape=(96, 128)) + ambient
        folder, how = tmp_path / "session", {"iso": 100, "aperture": 8}
        folder.mkdir()
        for i, (picture, exposure) in enumerate(zip(light, exposures, strict=True)):
            write_dng(folder / f"flash_{i}.dng", mosaic_of(picture * exposure), exposure_s=exposure / 100, **how)
        rng = np.random.default_rng(0)
        for i in range(2):
            noisy = ambient + rng.normal(scale=0.002, size=ambient.shape)
            write_dng(folder / f"ambient_{i}.dng", mosaic_of(noisy), exposure_s=0.01, **how)
        (folder / "session.toml").write_text(f'[frames]\nflash = "flash_*.dng"\nambient = "ambient_*.dng"\n{table}')
        return folder, light, ambient

    return write


def files_of(folder):
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


INNER = np.s_[..., 2:-2, 2:-2, :]


def bilinear(linear):
    """What any linear decode sees of a scene: bilinear interpolation of its mosaic, by convolution."""
    from scipy.ndimage import convolve

    v, u = np.mgrid[: linear.shape[0], : linear.shape[1]]
    channel = np.array([0, 1, 1, 2])[(v % 2) * 2 + u % 2]
    values = (mosaic_of(linear) - 512.0) * DN
    cross = np.array([[0, 1, 0], [1, 4, 1], [0, 1, 0]]) / 4
    square = np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]]) / 4
    planes = (np.where(channel == i, values, 0) for i in range(3))
    return np.stack([convolve(*one) for one in zip(planes, (square, cross, square), strict=True)], -1)


def test_frames_are_the_scene(raw_session, tmp_path):
    folder, light, ambient = raw_session()
    steps = []
    frames, report = decode(
        load_session(folder), Store(tmp_path / "out"), progress=lambda done, total: steps.append((done, total))
    )
    assert files_of(tmp_path / "out") == ["ambient.npy", "codes.npy", "frames.json"]
    assert frames.names == tuple(f"flash_{i}" for i in range(6))
    assert isinstance(frames.codes, np.memmap)
    assert frames.is_mosaic
    for i in range(6):
        found = frames.frame(i, subtract_ambient=False)
        assert np.abs(found - bilinear(light[i]))[INNER].max() < 2 * CODE
    assert np.abs(frames.frame(0) - bilinear(light[0] - ambient))[INNER].std() < 0.002
    assert steps == [(i + 1, 8) for i in range(8)]
    assert report.warnings == ()
    assert np.allclose([row["brightness"] for row in report.frames_table], light.mean((1, 2, 3)), rtol=0.01)
    assert [row["exposure_s"] for row in report.frames_table] == [0.01] * 6


def test_exposures_are_brought_together(raw_session, tmp_path):
    """Frames shot at a third and at double time agree to 0.2 % in the mean, and it is said."""
    folder, light, _ = raw_session(exposures=(1, 1 / 3, 1, 2, 1, 1))
    frames, report = decode(load_session(folder), Store(tmp_path / "out"))
    assert np.allclose(frames.gain, [1, 3, 1, 0.5, 1, 1], rtol=2e-4)
    means = frames.read(subtract_ambient=False).mean((1, 2, 3))
    assert np.allclose(means[[0, 1, 2, 4, 5]], light.mean((1, 2, 3))[[0, 1, 2, 4, 5]], rtol=0.002)
    (warning,) = [text for text in report.warnings if "exposure time" in text]
    assert "flash_1 (exposure time 0.003333 s), flash_3 (exposure time 0.02 s)" in warning


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_any_executor_gives_the_same_bytes(raw_session, tmp_path, pool):
    folder, *_ = raw_session()
    session = load_session(folder)
    decode(session, Store(tmp_path / "one"))
    context = {} if pool is ThreadPoolExecutor else {"mp_context": multiprocessing.get_context("spawn")}
    with pool(2, **context) as executor:
        decode(session, Store(tmp_path / "two"), executor=executor)
    for name in ("codes.npy", "ambient.npy", "frames.json"):
        assert (tmp_path / "one/frames" / name).read_bytes() == (tmp_path / "two/frames" / name).read_bytes()


@pytest.mark.parametrize("again", [False, True], ids=["first", "again"])
@pytest.mark.parametrize("how", ["corrupt", "other size", "gone", "misfire", "interrupt"])
def test_a_bad_frame_leaves_nothing(raw_session, tmp_path, how, again):
    """After a first good run, too, no header may stand beside codes that are not its own."""
    folder, *_ = raw_session()
    session, store = load_session(folder), Store(tmp_path / "out")
    if again:
        decode(session, store)
    victim = folder / "flash_3.dng"
    if how == "corrupt":
        victim.write_bytes(victim.read_bytes()[:9000])
    elif how == "other size":
        write_dng(victim, np.full((64, 128), 900, np.uint16))
    elif how == "gone":
        victim.unlink()
    elif how == "misfire":
        victim.write_bytes((folder / "ambient_0.dng").read_bytes())

    def progress(done, _):
        if how == "interrupt" and done == 4:
            raise KeyboardInterrupt("after flash_3")

    words = {"other size": "flash_3.*128 x 64 px, flash_0.dng is 128 x 96", "misfire": "flash_3: the flash did not"}
    with pytest.raises((CaptureError, KeyboardInterrupt), match=words.get(how, "flash_3")):
        decode(session, store, progress=progress)
    assert "frames.json" not in files_of(tmp_path / "out")
    assert again or files_of(tmp_path / "out") == []


def test_a_camera_of_another_size_is_refused_at_the_first_photograph(raw_session, tmp_path):
    table = "[camera]\nwidth = 130\nheight = 96\nfx = 100\nfy = 100\ncx = 64\ncy = 48\n"
    folder, *_ = raw_session(table=table)
    steps = []
    with pytest.raises(SessionError, match=r"camera\.width.*130 x 96.*128 x 96"):
        decode(load_session(folder), Store(tmp_path / "out"), progress=lambda *step: steps.append(step))
    assert steps == []
    assert files_of(tmp_path / "out") == []


def test_the_diligent_ball_keeps_its_values(shared, tmp_path):
    """Not divided by the lights' intensities, and within half a code of the file."""
    import cv2

    session = load_session(shared("real/diligent/ballPNG"))
    few = replace(session, flash=session.flash[:6], names=session.names[:6], kept=session.kept[:6])
    frames, report = decode(few, Store(tmp_path / "out"))
    expected = cv2.imread(str(session.flash[4]), cv2.IMREAD_UNCHANGED)[..., ::-1] / 65535
    assert np.abs(frames.frame(4) - expected).max() <= 0.51 * CODE
    assert report.warnings == ()


@pytest.mark.parametrize(("shape", "half"), [((1, 1), False), ((1, 64), False), ((64, 1), True), ((3, 5), True)])
def test_a_picture_of_no_width_is_told(tmp_path, picture_session, shape, half):
    """The audit's pyramid ended in an assertion of OpenCV."""
    folder = picture_session(np.full((4, *shape, 3), 0.3), table=f"linear = true\nhalf = {str(half).lower()}")
    with pytest.raises(CaptureError, match="no photograph"):
        decode(load_session(folder), Store(tmp_path / "out"))
