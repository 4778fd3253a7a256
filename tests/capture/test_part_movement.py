"""Parts that move alone: a ball among balls, the object; none on captures in which nothing moved."""

import copy
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from capture.audit.frame_facts import facts_of
from capture.audit.movement import movement
from capture.audit.part_movement import Part, part_step, part_warnings, parts_of
from fixtures.ball_scene import World, flashes, render
from lab.watch.judge import FramesSoFar, Told
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit

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


def lights_of(world):
    """What is known of a world's lights, told for its object."""
    middle = world.clutter[0].center
    toward = world.lights - middle
    far = np.linalg.norm(toward, axis=1, keepdims=True)
    names = tuple(f"flash_{i:03d}" for i in range(len(far)))
    return Lights(names, toward / far, world.powers * (1000 / far) ** 2, world.lights, middle).normalised()


@pytest.fixture(scope="module")
def lights(world):
    return lights_of(world)


@pytest.fixture(scope="module")
def object_mask(world):
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    return np.hypot(*(np.stack([u, v], -1) - CAMERA.project(world.clutter[0].center)).T).T < 52


def later(still, world, *, balls=(), lump=False, by_mm=(6.0, 3.0, 0.0)):
    """Return the frames in which parts stand elsewhere from frame MOVED on."""
    moved = copy.deepcopy(world)
    for i in balls:
        moved.balls[i].center = moved.balls[i].center + by_mm
    if lump:
        moved.clutter[0].center = moved.clutter[0].center + by_mm
    moved.lights, moved.powers = world.lights[MOVED:], world.powers[MOVED:]
    after = render(moved, seed=1)
    return replace(still, codes=np.concatenate([still.codes[:MOVED], after.codes]))


def test_where_nothing_moved_nothing_is_said(still, world, object_mask, lights):
    assert part_warnings(still, parts_of(world.spheres(), CAMERA, object_mask), lights) == []


def test_a_ball_that_moved_alone_is_named_with_the_frame_and_where_it_went(still, world, object_mask):
    """The picture as a whole stands still: only the ball can tell."""
    frames, parts = later(still, world, balls=[1]), parts_of(world.spheres(), CAMERA, object_mask)
    assert movement(frames, [facts_of(codes) for codes in frames.codes]).step is None
    (text,) = part_warnings(frames, parts)
    assert text.startswith(f"flash_{MOVED:03d}: from here on {parts[1].name} lies")
    assert f"it moved after flash_{MOVED - 1:03d}" in text
    here = np.array([ball.center_px for ball in world.spheres()])[1]
    there = CAMERA.project(world.balls[1].center + np.array([6.0, 3.0, 0]))
    # Up in the world is up in the picture: down is negative.
    assert (there - here)[1] < -2
    assert part_step(frames, parts[1]).shift_px == pytest.approx(there - here, abs=0.5)
    assert part_step(frames, parts[0]) is None


def test_the_object_that_moved_alone_is_named_and_parts_that_moved_together_are_one_warning(
    still, world, object_mask, lights
):
    parts = parts_of(world.spheres(), CAMERA, object_mask)
    (text,) = part_warnings(later(still, world, lump=True), parts, lights)
    assert "from here on the object lies" in text
    (text,) = part_warnings(later(still, world, balls=[0, 2]), parts)
    assert f"{parts[0].name}, {parts[2].name} lie " in text
    assert "they moved after" in text


def test_where_all_parts_moved_the_picture_did(still, world, object_mask, lights):
    """That is said of the picture as a whole, and of its parts it would mislead."""
    parts = parts_of(world.spheres(), CAMERA, object_mask)
    codes = still.codes.copy()
    codes[MOVED:] = np.roll(codes[MOVED:], (3, 5), (1, 2))
    frames = replace(still, codes=codes)
    assert part_step(frames, parts[0]).shift_px == pytest.approx([5, 3], abs=0.5)
    assert part_warnings(frames, parts, lights) == []
    assert len(part_warnings(frames, parts[:1])) == 1


def test_each_ball_is_told_of_once(still, world, object_mask):
    told, names = Told(), [str(name) for name in still.names]
    texts = [f"flash_006: from here on the chrome ball at ({u}, 50) px lies 3.{u} px off" for u in (10, 200, 10)]
    assert told.new(texts, names) == texts[:2]


def test_a_large_part_takes_no_longer_than_a_small_one():
    """The mask was once dilated in full size: twelve seconds."""
    v, u = np.mgrid[:1300, :1300]
    frames = Frames(tuple("abcdefgh"), np.full((8, 1300, 1300, 3), 3000, np.uint16), np.ones(8))
    start = time.process_time()
    assert part_step(frames, Part("a", np.hypot(u - 650, v - 650) < 600)) is None
    assert time.process_time() - start < 3


def test_a_watch_says_so_of_masks_that_are_reduced(still, world, object_mask):
    class Taken:
        def __init__(self, codes):
            self.facts = facts_of(codes)

    frames = later(still, world, balls=[1])
    parts = parts_of(world.spheres(), CAMERA, object_mask)
    small = [replace(part, mask=part.mask[::4, ::4], step=4) for part in parts]
    shots = [Taken(codes) for codes in frames.codes]
    said = FramesSoFar.late_warnings(frames, shots, small)
    assert [text for text in said if "lies" in text] == part_warnings(frames, small)
    assert len(part_warnings(frames, small)) == 1


@pytest.mark.parametrize("name", ["chrome", "buddha", "rock"])
def test_real_objects_stand_still_until_they_are_moved(shared, name):
    """Photographs of others: no alarm as they are; moved by 3 % of their size from one frame on, they are found."""
    folder = shared(f"real/uw_psm/png/{name}")
    files = sorted(path for path in folder.glob("*.png") if "mask" not in path.name)
    mask = cv2.imread(str(next(folder.glob("*mask*"))), cv2.IMREAD_GRAYSCALE) > 128
    images = np.stack([cv2.imread(str(path))[..., ::-1] for path in files]).astype(np.float32) / 255
    names = tuple(path.stem for path in files)
    # The files are sorted as text: 0, 1, 10, 11, 2.
    order = [int(path.stem.split(".")[1]) for path in files]
    toward = unit(np.loadtxt(shared("real/uw_psm/lights.txt"), skiprows=1)[order])
    lights, part = Lights(names, toward, np.ones((len(names), 3))), Part(name, mask, is_mirror=name == "chrome")
    assert part_warnings(Frames.from_linear(names, images), [part], lights) == []
    shift = np.array([3, -2]) * max(1, round(np.ptp(np.nonzero(mask)[0]) / 100))
    moved = images.copy()
    moved[7:] = [cv2.warpAffine(one, np.float32([[1, 0, shift[0]], [0, 1, shift[1]]]), one.shape[1::-1])
                 for one in images[7:]]  # fmt: skip
    step = part_step(Frames.from_linear(names, moved), part, lights)
    assert step.first == 7
    assert step.shift_px == pytest.approx(shift, abs=2.0)


def smooth(seed):
    """An egg of one colour on a plain table, and its lights: on it nothing is sharp."""
    world = World(CAMERA, [], flashes(12, seed=seed), np.full((12, 3), 0.5))
    world.put("ellipsoid", 0, 0, [75, 62, 50], turn_deg=30, albedo=0.5)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    middle, turn = world.clutter[0].center, np.deg2rad(30)
    right, down = np.moveaxis(np.stack([u, v], -1) - CAMERA.project(middle), -1, 0)
    along, across = right * np.cos(turn) - down * np.sin(turn), right * np.sin(turn) + down * np.cos(turn)
    px = -CAMERA.fx / middle[2]
    mask = (along / (75 * px)) ** 2 + (across / (62 * px)) ** 2 < 0.9
    return world, lights_of(world), Part("the object", mask, camera=CAMERA)


@pytest.mark.parametrize("seed", [3, 4, 9])
def test_a_part_without_edges_tells_by_its_shading(seed):
    """The shadows of a flash that is carried around looked like edges that moved: false alarms, all three."""
    world, lights, part = smooth(seed)
    still = render(world)
    assert part_step(still, part, lights) is None
    frames = later(still, world, lump=True, by_mm=(7.0, 4.0, 0.0))
    step = part_step(frames, part, lights)
    truth = CAMERA.project(world.clutter[0].center + [7.0, 4.0, 0.0]) - CAMERA.project(world.clutter[0].center)
    assert abs(step.first - MOVED) <= 1
    assert step.shift_px == pytest.approx(truth, abs=1.3)
    (text,) = part_warnings(frames, [part], lights)
    assert f"{frames.names[step.first]}: from here on the object lies" in text


def test_a_white_ball_tells_by_its_shading(still, world):
    """It stands where near lights come from elsewhere than at the object."""
    white = copy.deepcopy(world)
    white.balls, lights = [], lights_of(world)
    white.stand("white", -180, 100, 33.0)
    frames, part = render(white), parts_of(white.spheres(), CAMERA, None)
    assert part_warnings(frames, part, lights) == []
    (text,) = part_warnings(later(frames, white, balls=[0], by_mm=(4.0, 0.0, 0.0)), part, lights)
    assert f"flash_{MOVED:03d}: from here on the white ball" in text


def test_lights_of_some_frames_count_for_these(still, world, object_mask, lights):
    """A light that no ball shows is not known: its frame is left out, and the others keep their numbers."""
    frames, part = later(still, world, lump=True), Part("the object", object_mask, camera=CAMERA)
    whole = part_step(frames, part, lights)
    less = part_step(frames, part, lights.only([i for i in range(COUNT) if i != 3]))
    assert less.first == whole.first == MOVED
    assert less.shift_px == pytest.approx(whole.shift_px, abs=0.7)
    for nothing in (None, Lights.unknown(lights.names), lights.only(slice(7))):
        assert part_step(frames, part, nothing) is None


def test_a_part_in_the_dark_tells_nothing(object_mask):
    frames = Frames(tuple("abcdefgh"), np.full((8, 320, 480, 3), 2048, np.uint16), np.ones(8))
    toward = unit(np.random.default_rng(1).normal(size=(8, 3)) + [0, 0, 3])
    assert part_step(frames, Part("a", object_mask), Lights(frames.names, toward, np.ones((8, 3)))) is None
