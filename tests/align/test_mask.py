"""The object on its table, found from the stack; and the final mask."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh

from align.mask.object_mask import ObjectMask, find_object
from align.mask.scan_mask import scan_mask
from fixtures.mesh_scene import Tracer, random_scene
from fixtures.mesh_shapes import blob
from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames
from scene.mesh import Mesh
from scene.rays import RayCaster
from scene.spheres import Sphere


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()


@pytest.fixture(scope="module")
def on_table(bumpy, rotations, build):
    """A brighter object on a gray table with moving cast shadows, which are a fifth of the picture."""
    return build(bumpy, rotations[3], table=0.12)


def test_the_object_is_found_on_a_lit_table(on_table):
    found = find_object(on_table.frames, on_table.camera, [])
    assert overlap(found.mask, on_table.mask) > 0.95
    assert found.source == "found"
    assert found.warnings == ()
    # The table's shadows are no object: one frame's dark patch beside it stays out.
    assert (found.mask & ~on_table.mask).sum() < 0.02 * on_table.mask.sum()


@pytest.mark.full
def test_a_textured_table_as_bright_as_the_object():
    """Brightness tells nothing there: what is inclined otherwise changes otherwise from frame to frame."""
    scene = random_scene(blob(), 10003, width=360, height=240, flashes=12)
    # Albedo 0.42, with blotches of half of it, against the object's 0.5.
    scene = replace(scene, table_albedo=0.42)
    tracer = Tracer(scene)
    tracer.look()
    found = find_object(scene.photograph(), scene.camera, [])
    # A third of the object was missing.
    assert overlap(found.mask, tracer.cover > 0.5) > 0.95


@pytest.mark.full
def test_before_black_and_upside_down(bumpy, rotations, build):
    world = build(bumpy, rotations[2])
    found = find_object(world.frames, world.camera, [])
    assert overlap(found.mask, world.mask) > 0.95
    flipped = Frames(world.frames.names, world.frames.codes[:, ::-1].copy(), world.frames.gain)
    again = find_object(flipped, world.camera, [])
    assert overlap(again.mask[::-1], found.mask) > 0.99


def test_the_order_and_power_of_frames_do_not_matter(on_table):
    frames = on_table.frames
    found = find_object(frames, on_table.camera, []).mask
    other = replace(frames.only(slice(None, None, -1)), gain=frames.gain)
    assert overlap(find_object(other, on_table.camera, []).mask, found) > 0.999


def test_balls_are_no_object(on_table):
    """A white ball as bright as the object, painted into the corner and beside the object."""
    linear = on_table.frames.read()
    sphere = Sphere("white", np.array([22.0, 22.0]), 12.0, 24.0)
    linear[:, sphere.mask(on_table.camera)] = 0.5
    frames = Frames.from_linear(on_table.frames.names, linear)
    found = find_object(frames, on_table.camera, [sphere])
    assert not (found.mask & sphere.mask(on_table.camera)).any()
    assert overlap(found.mask, on_table.mask) > 0.95
    given = find_object(frames, on_table.camera, [sphere], mask_given=on_table.mask | sphere.mask(on_table.camera))
    assert overlap(given.mask, on_table.mask) > 0.99
    assert "calibration balls" in given.warnings[0]


@pytest.mark.full
def test_a_large_picture_is_searched_small_and_bordered_large(on_table):
    big = np.kron(on_table.frames.codes, np.ones((1, 9, 9, 1), np.uint16))
    frames = Frames(on_table.frames.names, big, on_table.frames.gain)
    camera = Camera(1440, 1080, 2700.0, 2700.0, 751.0, 517.0)
    found = find_object(frames, camera, [])
    assert found.mask.shape == (1080, 1440)
    assert overlap(found.mask, np.kron(on_table.mask, np.ones((9, 9), bool))) > 0.94


def test_of_two_things_the_one_in_the_box_is_the_object(on_table):
    """The same object stands twice on its table; the box decides, and its border is no border of the object."""
    codes, mask = on_table.frames.codes, on_table.mask
    frames = Frames(on_table.frames.names, np.concatenate([codes, codes[:, :, ::-1]], 2), on_table.frames.gain)
    height, width = mask.shape
    camera = replace(on_table.camera, width=2 * width)
    left, right = np.hstack([mask, mask & False]), np.hstack([mask & False, mask[:, ::-1]])
    (top, low), (first, last) = (np.flatnonzero(mask.any(axis))[[0, -1]] for axis in (1, 0))
    for thing, mirrored in ((left, False), (right, True)):
        sides = (2 * width - 1 - last, 2 * width - 1 - first) if mirrored else (first, last)
        box = (sides[0] - 6.0, top - 6.0, sides[1] + 6.0, low + 6.0)
        found = find_object(frames, camera, [], box=box)
        assert overlap(found.mask, thing) > 0.95
        assert found.warnings == ()
    cut = find_object(frames, camera, [], box=(0.0, 0.0, last - 8.0, height - 1.0))
    assert any("reaches the border of object.box" in text for text in cut.warnings)
    for box in ((5.0, 5.0, 4.0, 60.0), (-9.0, -9.0, 4000.0, 4000.0), (500.0, 500.0, 600.0, 600.0)):
        with pytest.raises(AlignError, match=r"object\.box: found"):
            find_object(frames, camera, [], box=box)


def test_nothing_to_find_is_refused():
    generator = np.random.default_rng(1)
    v, u = np.mgrid[-1:1:90j, -1:1:120j]
    table = np.stack([0.1 + 0.03 * np.cos(t) * u + 0.03 * np.sin(t) * v for t in range(6)])
    linear = table[..., None] * np.ones(3) + 0.001 * generator.standard_normal((6, 90, 120, 3))
    frames = Frames.from_linear(tuple("abcdef"), linear)
    with pytest.raises(AlignError, match="no object found"):
        find_object(frames, Camera.orthographic(120, 90), [])


def test_a_given_mask_is_checked(on_table):
    def give(mask):
        return find_object(on_table.frames, on_table.camera, [], mask_given=mask)

    assert (give(on_table.mask).mask == on_table.mask).all()
    for mask, words in (
        (on_table.mask[1:], "frames are"),
        (on_table.mask & False, "empty"),
        (on_table.mask | True, "white"),
    ):
        with pytest.raises(AlignError, match=words):
            give(mask)


def test_a_mask_too_thin_for_normals_is_refused(on_table):
    """Slopes need neighbours: lines, single pixels and a mask of every second pixel once ended as faults of rgbn's."""
    shape = on_table.mask.shape
    row, column = np.indices(shape)
    for thin in (
        row == 0,
        column == 40,
        row // 2 == 25,
        (row + column) % 2 == 0,
        (row - 10) ** 2 + (column - 9) ** 2 < 2,
    ):
        with pytest.raises(AlignError, match=f"{thin.sum()} pixels are the object's, and nowhere 3 x 3"):
            find_object(on_table.frames, on_table.camera, [], mask_given=thin)
    corner = (row < 3) & (column < 3)
    assert (find_object(on_table.frames, on_table.camera, [], mask_given=corner).mask == corner).all()


def test_the_final_mask_is_the_silhouette_and_what_was_not_scanned():
    silhouette = np.zeros((80, 100), bool)
    silhouette[20:60, 20:60] = True
    silhouette[35:42, 35:42] = False
    found = np.zeros_like(silhouette)
    # One pixel too wide all round, the hole filled, and a limb of ten pixels that the scan lacks.
    found[19:61, 19:61] = True
    found[30:50, 60:80] = True
    final = scan_mask(silhouette, ObjectMask(found, "found"))
    expected = silhouette.copy()
    expected[35:42, 35:42] = True
    expected[30:50, 60:80] = True
    assert (final.mask ^ expected).sum() < 40
    assert (final.mask & ~found).sum() == 0
    assert not final.mask[19, 19:61].any()
    assert any("not scanned" in warning for warning in final.warnings)
    hidden = scan_mask(silhouette, ObjectMask(found & (np.arange(100) < 40), "found"))
    assert any("outside the mask" in warning for warning in hidden.warnings)
    assert scan_mask(silhouette | expected, ObjectMask(silhouette | expected, "found")).warnings == ()


@pytest.mark.full
@pytest.mark.parametrize("name", ["buddha", "cat", "horse", "owl", "rock"])
def test_real_objects_before_black_cloth(shared, name):
    """Against the masks that came with the photographs."""
    folder = shared(f"real/uw_psm/png/{name}")
    stack = np.stack([cv2.imread(str(folder / f"{name}.{i}.png"))[..., ::-1] / 255.0 for i in range(12)])
    frames = Frames.from_linear(tuple(map(str, range(12))), stack)
    given = cv2.imread(str(folder / f"{name}.mask.png"), cv2.IMREAD_GRAYSCALE) > 127
    found = find_object(frames, Camera.orthographic(frames.width, frames.height), [])
    assert overlap(found.mask, given) > 0.94


OTHERS = ["blender_2", *(pytest.param(f"blender_{n}", marks=pytest.mark.full) for n in (0, 1, 3, 4))]


@pytest.mark.parametrize("name", OTHERS)
def test_a_table_in_the_objects_shadow_is_no_object(shared, name):
    """Sessions by others: the mask held a tenth to a third more than the object on four of the five."""
    folder = shared(f"sessions/{name}")
    true = json.loads((folder / "truth.json").read_text())
    room = cv2.imread(str(folder / "asked" / "ambient.png"), -1)[..., ::-1] / 65535
    paths = sorted((folder / "asked").glob("flash_*.png"))
    stack = np.stack([cv2.imread(str(path), -1)[..., ::-1] / 65535 - room for path in paths])
    camera = Camera(*(true[key] for key in ("width", "height", "fx", "fx", "cx", "cy")))
    balls = [Sphere(one["kind"], np.array(one["centre_px"]), one["radius_px"]) for one in true["spheres"]]
    found = find_object(Frames.from_linear(tuple(path.name for path in paths), stack), camera, balls)
    scan = trimesh.load_mesh(folder / "object.ply")
    scan.apply_transform(true["camera_from_scan"])
    pixels = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), -1).reshape(-1, 2)
    rays = RayCaster(Mesh(scan.vertices, scan.faces)).cast(*camera.rays(pixels))
    assert overlap(found.mask, rays.hit.reshape(camera.height, camera.width)) > 0.96
