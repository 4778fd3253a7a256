"""A ball that moves alone among balls; none on captures in which nothing moved."""

import copy
from dataclasses import replace

import cv2
import numpy as np
import pytest

from capture.audit.frame_facts import facts_of
from capture.audit.movement import movement
from capture.audit.part_movement import part_step, part_warnings
from fixtures.ball_scene import World, flashes, render
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

CAMERA = Camera(480, 320, 870.0, 870.0, 239.5, 159.5)
COUNT, MOVED = 10, 6


@pytest.fixture(scope="module")
def world():
    world = World(
        CAMERA, [], flashes(COUNT, seed=3), np.full((COUNT, 3), 0.5), table_texture="noise", table_albedo=0.2,
        table_second=0.08,
    )  # fmt: skip
    for x, y in ((-190, -100), (190, 100), (-180, 100)):
        world.stand("chrome", x, y, 33.0)
    return world.put("dome", 0, 0, [60, 60, 45], albedo=0.5, texture="noise", second=0.15, grain_mm=12.0)


@pytest.fixture(scope="module")
def still(world):
    return render(world)


def later(still, world, *, balls=(), by_mm=(6.0, 3.0, 0.0)):
    """Return the frames in which parts stand elsewhere from frame MOVED on."""
    moved = copy.deepcopy(world)
    for i in balls:
        moved.balls[i].center = moved.balls[i].center + by_mm
    moved.lights, moved.powers = world.lights[MOVED:], world.powers[MOVED:]
    after = render(moved, seed=1)
    return replace(still, codes=np.concatenate([still.codes[:MOVED], after.codes]))


def name(ball):
    u, v = ball.center_px
    return f"the chrome ball at ({u:.0f}, {v:.0f}) px"


def test_where_nothing_moved_nothing_is_said(still, world):
    assert part_warnings(still, world.spheres()) == []


def test_a_ball_that_moved_alone_is_named_with_the_frame_and_where_it_went(still, world):
    """The picture as a whole stands still: only the ball can tell."""
    frames, parts = later(still, world, balls=[1]), world.spheres()
    assert movement(frames, [facts_of(codes) for codes in frames.codes]).step is None
    (text,) = part_warnings(frames, parts)
    assert text.startswith(f"flash_{MOVED:03d}: from here on {name(parts[1])} lies")
    assert f"it moved after flash_{MOVED - 1:03d}" in text
    here = np.array([ball.center_px for ball in world.spheres()])[1]
    there = CAMERA.project(world.balls[1].center + np.array([6.0, 3.0, 0]))
    # Up in the world is up in the picture: down is negative.
    assert (there - here)[1] < -2
    assert part_step(frames, parts[1].center_px, parts[1].radius_px).shift_px == pytest.approx(there - here, abs=0.5)
    assert part_step(frames, parts[0].center_px, parts[0].radius_px) is None


def test_each_ball_that_moved_is_named(still, world):
    parts = world.spheres()
    one, other = part_warnings(later(still, world, balls=[0, 2]), parts)
    assert f"{name(parts[0])} lies " in one
    assert f"{name(parts[2])} lies " in other


def test_where_all_parts_moved_the_picture_did(still, world):
    """That is said of the picture as a whole, and of its parts it would mislead."""
    parts = world.spheres()
    codes = still.codes.copy()
    codes[MOVED:] = np.roll(codes[MOVED:], (3, 5), (1, 2))
    frames = replace(still, codes=codes)
    assert part_step(frames, parts[0].center_px, parts[0].radius_px).shift_px == pytest.approx([5, 3], abs=0.5)
    assert part_warnings(frames, parts) == []
    assert len(part_warnings(frames, parts[:1])) == 1


def test_places_in_reduced_pictures_tell_it_too(still, world):
    """As a watch has them."""
    small = [replace(one, center_px=one.center_px / 4, radius_px=one.radius_px / 4) for one in world.spheres()]
    assert len(part_warnings(later(still, world, balls=[1]), small, 4)) == 1


def test_a_real_ball_stands_still_until_it_is_moved(shared):
    """Photographs of others: no alarm as it is; moved by 3 % of its size from one frame on, it is found."""
    folder = shared("real/uw_psm/png/chrome")
    files = sorted(path for path in folder.glob("*.png") if "mask" not in path.name)
    mask = cv2.imread(str(next(folder.glob("*mask*"))), cv2.IMREAD_GRAYSCALE) > 128
    images = np.stack([cv2.imread(str(path))[..., ::-1] for path in files]).astype(np.float32) / 255
    names = tuple(path.stem for path in files)
    rows, columns = np.nonzero(mask)
    ball = Sphere("chrome", np.array([columns.mean(), rows.mean()]), np.ptp(rows) / 2)
    assert part_warnings(Frames.from_linear(names, images), [ball]) == []
    shift = np.array([3, -2]) * max(1, round(np.ptp(rows) / 100))
    moved = images.copy()
    moved[7:] = [cv2.warpAffine(one, np.float32([[1, 0, shift[0]], [0, 1, shift[1]]]), one.shape[1::-1])
                 for one in images[7:]]  # fmt: skip
    step = part_step(Frames.from_linear(names, moved), ball.center_px, ball.radius_px)
    assert step.first == 7
    assert step.shift_px == pytest.approx(shift, abs=2.0)
