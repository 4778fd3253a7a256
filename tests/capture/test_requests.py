"""What calibration and alignment are given: balls asked for, balls shot apart, masks."""

from dataclasses import replace

import numpy as np
import pytest

from capture.photographs.decode import decode
from capture.session.requests import object_box, read_mask, sphere_requests
from capture.session.session import load_session
from capture.session.session_types import SphereSpec
from scene.errors import SessionError
from scene.files import write_png
from scene.store import Store
from tests.capture.conftest import linear_png


@pytest.fixture
def apart(picture_session, scene_pictures, tmp_path):
    """Four flash frames, of which one is skipped, and a ball photographed apart under the same lights."""

    def make(more="", *, size=(60, 80), table=""):
        balls = scene_pictures(4, shape=size, seed=7)
        folder = picture_session(
            scene_pictures(4, shape=(60, 80)),
            more=f'[[spheres]]\nkind = "chrome"\nframes = "ball_*.png"\n{more}',
            table=f'linear = true\nskip = ["flash_001"]\n{table}',
        )
        for i, ball in enumerate(balls):
            linear_png(folder / f"ball_{i}.png", ball)
        session, store = load_session(folder), Store(tmp_path / "out")
        decode(session, store)
        return session, store, balls

    return make


def test_a_ball_shot_apart_has_frames_of_its_own(apart):
    session, store, balls = apart('[[spheres]]\nkind = "white"\ndiameter_mm = 70\nframes = "ball_*.png"')
    (chrome, white), warnings = sphere_requests(session, store)
    assert warnings == ()
    assert (chrome.kind, white.kind, white.diameter_mm) == ("chrome", "white", 70)
    assert chrome.frames is white.frames, "decoded once"
    assert chrome.frames is not None
    for found, i in zip(chrome.frames.read(), (0, 2, 3), strict=True):
        assert np.abs(found - balls[i]).max() < 2e-5, "in order, the skipped frame's ball left out"
    assert store.load_frames().names == ("flash_000", "flash_002", "flash_003"), "the session's own are untouched"


def test_what_is_suspicious_about_a_ball_is_said(apart):
    session, store, _ = apart()
    ball = session.spheres[0]
    session = replace(session, spheres=(SphereSpec("white"), ball, ball))
    ball.frames[2].write_bytes(ball.frames[0].read_bytes())
    _, warnings = sphere_requests(session, store)
    (same,) = [text for text in warnings if "the same photograph" in text]
    assert same.startswith("spheres[1]: flash_000 and flash_003 ")


BALL = '[[spheres]]\nkind = "white"\n'


@pytest.mark.parametrize(
    ("more", "size", "told"),
    [
        ("", (48, 64), r"spheres\[0\]\.frames.*64 x 48.*80 x 60"),
        (f"{BALL}center_px = [400, 20]\nradius_px = 10", (60, 80), r"spheres\[1\]\.center_px"),
        # Its outline was looked for in gigabytes, for minutes.
        (f"{BALL}center_px = [40, 20]\nradius_px = 81", (60, 80), "radius_px: found 81, larger than .* 80 x 60"),
    ],
)
def test_balls_and_hints_that_no_picture_has(apart, more, size, told):
    session, store, _ = apart(more, size=size)
    with pytest.raises(SessionError, match=told):
        sphere_requests(session, store)


@pytest.mark.parametrize(
    ("half", "center", "radius", "box"),
    [(False, (40.5, 20.5), 10, (10, 8, 71, 55)), (True, (20, 10), 5, (4.75, 3.75, 35.25, 27.25))],
)
def test_hints_count_the_photographs_pixels_and_follow_superpixels(apart, half, center, radius, box):
    more = f"{BALL}center_px = [40.5, 20.5]\nradius_px = 10\n[object]\nbox = [10, 8, 71, 55]"
    session, store, _ = apart(more, table=f"half = {str(half).lower()}")
    hint = sphere_requests(session, store)[0][1]
    assert hint.center_px == center
    assert hint.radius_px == radius
    assert object_box(session, 40 if half else 80) == box


def test_masks(tmp_path):
    truth = np.zeros((8, 10), bool)
    truth[2:6, 3:9] = True
    path = tmp_path / "mask.png"
    for white in (1, 255):
        write_png(path, truth.astype(np.uint8) * white)
        assert np.array_equal(read_mask(path, 8, 10), truth)
    write_png(path, np.repeat(truth[..., None] * np.uint8(200), 3, -1))
    assert np.array_equal(read_mask(path, 8, 10), truth)
    write_png(path, np.full((8, 10), 255, np.uint8))
    assert read_mask(path, 8, 10).all()
    write_png(path, np.kron(truth, np.ones((2, 2), bool)))
    assert np.array_equal(read_mask(path, 8, 10), truth), "a full-size mask of superpixels"

    for shape, part in (((8, 11), "11 x 8 px, the frames 10 x 8"), ((8, 10), "empty")):
        write_png(path, np.zeros(shape, np.uint8))
        with pytest.raises(SessionError, match=part):
            read_mask(path, 8, 10)
    path.write_bytes(b"no")
    with pytest.raises(SessionError, match="mask cannot be read"):
        read_mask(path, 8, 10)
