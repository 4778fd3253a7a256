"""Picks by hand: the pose comes back, wrong picks are named, bad tables are refused."""

import numpy as np
import pytest

from align.pose.motion import nudge
from align.pose.picks import misses_px, pose_of, read_picks
from fixtures.mesh_scene import random_rotation
from scene.camera import Camera
from scene.errors import AlignError
from scene.pose import Pose, rotation_from_vector

PERSPECTIVE = Camera(1200, 800, 1700.0, 1690.0, 640.0, 380.0, (-0.25, 0.08, 0.002, -0.001, 0.0))
ORTHOGRAPHIC = Camera(1200, 800, 4.0, 4.0, 610.0, 395.0, projection="orthographic")


def random_pose(mesh, camera, generator) -> Pose:
    rotation = random_rotation(generator)
    depth = -1.5 * mesh.radius_mm if camera.is_orthographic else generator.uniform(-560, -460)
    target = np.array([*generator.uniform(-10, 10, 2), depth])
    return Pose.from_rotation_translation(rotation, target - rotation @ mesh.center_mm)


def visible(mesh, pose, camera, count, generator):
    """Points of the scan that face the camera, spread over it."""
    points, normals = pose.apply(mesh.vertices), pose.rotate(mesh.vertex_normals)
    toward = np.array([0.0, 0.0, 1.0]) if camera.is_orthographic else -points / np.linalg.norm(points, axis=1)[:, None]
    front = np.flatnonzero(np.sum(normals * toward, 1) > 0.3)
    chosen = [int(generator.choice(front))]
    while len(chosen) < count:
        away = np.linalg.norm(mesh.vertices[front][:, None] - mesh.vertices[chosen], axis=-1).min(1)
        chosen.append(int(front[np.argmax(away * generator.uniform(0.7, 1, len(front)))]))
    return mesh.vertices[chosen]


def write(path, pixels, points):
    rows = ["u,v,x,y,z", *(",".join(f"{value:.9g}" for value in row) for row in np.hstack([pixels, points]))]
    path.write_text("\n".join(rows) + "\n")
    return path


def apart_px(mesh, camera, a, b):
    return np.linalg.norm(camera.project(a.apply(mesh.vertices)) - camera.project(b.apply(mesh.vertices)), axis=1).max()


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["distorted", "orthographic"])
@pytest.mark.parametrize("seed", range(6))
def test_exact_picks_give_the_pose(bumpy, tmp_path, camera, seed):
    generator = np.random.default_rng(seed)
    pose = random_pose(bumpy, camera, generator)
    points = visible(bumpy, pose, camera, 5, generator)
    pixels = camera.project(pose.apply(points))
    # The scan's file is in inch, and the picks with it.
    found = read_picks(write(tmp_path / "picks.csv", pixels, points / 25.4), camera, bumpy, unit="inch")
    assert apart_px(bumpy, camera, pose, found.pose) < 1e-3
    assert np.linalg.det(found.pose.rotation) == pytest.approx(1)
    assert found.residual_px < 1e-4
    assert not found.warnings
    halved = read_picks(write(tmp_path / "half.csv", pixels, points), camera.halved(), bumpy, half=True)
    assert apart_px(bumpy, camera, pose, halved.pose) < 1e-2


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["distorted", "orthographic"])
def test_picks_on_a_shallow_relief_come_to_their_pixels(camera):
    generator, worst = np.random.default_rng(0), []
    for _ in range(20):
        turned = Pose.from_rotation_translation(rotation_from_vector(generator.normal(0, 0.3, 3)), [0, 0, -500])
        points = generator.uniform(-60, 60, (6, 3)) * [1, 1, 0.1]
        pixels = camera.project(turned.apply(points)) + generator.normal(0, 1.5, (6, 2))
        found = pose_of(camera, points, pixels, 90.0, np.zeros(3))
        worst.append(misses_px(found, camera, points, pixels).max())
    # The noise is that of hand and eye: 7 px are the most that one row may be off.
    assert max(worst) < 7


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["distorted", "orthographic"])
@pytest.mark.parametrize("seed", range(8))
def test_one_wrong_pick_of_six_is_named_and_the_pose_comes_from_the_others(bumpy, tmp_path, camera, seed):
    generator = np.random.default_rng(seed)
    pose = random_pose(bumpy, camera, generator)
    points = visible(bumpy, pose, camera, 6, generator)
    pixels = camera.project(pose.apply(points)) + generator.standard_normal((6, 2))
    wrong = int(generator.integers(6))
    # The neighbour's pixel, as when two rows are mixed up.
    pixels[wrong] = pixels[wrong - 1] + [3, -2]
    found = read_picks(write(tmp_path / "picks.csv", pixels, points), camera, bumpy)
    (warning,) = found.warnings
    assert f"row {wrong + 2} was left out" in warning
    assert found.residual_px < 2.5
    # The others' noise of 1 px, drawn out over the part of the scan that has no pick.
    assert apart_px(bumpy, camera, pose, found.pose) < 15


def test_the_pose_of_noisy_picks_is_the_least_squares_one(bumpy, tmp_path):
    """No small motion brings the points nearer to their pixels."""
    generator = np.random.default_rng(3)
    pose = random_pose(bumpy, PERSPECTIVE, generator)
    points = visible(bumpy, pose, PERSPECTIVE, 9, generator)
    pixels = PERSPECTIVE.project(pose.apply(points)) + generator.standard_normal((9, 2))
    found = read_picks(write(tmp_path / "picks.csv", pixels, points), PERSPECTIVE, bumpy)

    def cost(at):
        return np.sum((PERSPECTIVE.project(at.apply(points)) - pixels) ** 2)

    assert found.residual_px == pytest.approx(np.sqrt(cost(found.pose) / 9))
    steps = np.concatenate([np.eye(6), -np.eye(6)]) * [1e-3, 1e-3, 1e-3, 0.05, 0.05, 0.5]
    assert min(cost(nudge(found.pose, step, found.pose.apply(bumpy.center_mm))) for step in steps) > cost(found.pose)


SPOILT = {
    "row 4 has its pixel at 1300": lambda pixels, points: (np.vstack([pixels[:2], [[1300, 20]], pixels[3:]]), points),
    "6 of 6 further than": lambda pixels, points: (pixels, points / 1000),
    "contradict each other": lambda pixels, points: (np.roll(pixels, 1, axis=0), points),
    "pixels lie on one line": lambda pixels, points: (pixels * [1, 0] + [0, 400], points),
}


@pytest.mark.parametrize("words", SPOILT)
def test_picks_that_cannot_be_are_refused(bumpy, tmp_path, words):
    generator = np.random.default_rng(1)
    pose = random_pose(bumpy, PERSPECTIVE, generator)
    points = visible(bumpy, pose, PERSPECTIVE, 6, generator)
    spoilt = SPOILT[words](PERSPECTIVE.project(pose.apply(points)), points)
    with pytest.raises(AlignError, match=rf"picks\.csv.*{words}"):
        read_picks(write(tmp_path / "picks.csv", *spoilt), PERSPECTIVE, bumpy)


def test_points_on_one_line_and_orthographic_points_in_one_plane_are_refused(bumpy, tmp_path):
    generator = np.random.default_rng(2)
    pixels = generator.uniform(300, 500, (5, 2))
    near = bumpy.vertices[np.argsort(np.linalg.norm(bumpy.vertices - bumpy.vertices[0], axis=1))[:5]]
    for camera, points, words in (
        (PERSPECTIVE, near[:1] + np.arange(5)[:, None] * [0.2, 0.01, 0.0], "points lie on one line"),
        (ORTHOGRAPHIC, near, "one plane"),
    ):
        with pytest.raises(AlignError, match=words):
            read_picks(write(tmp_path / "picks.csv", pixels, points), camera, bumpy)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("u,v,x,y,z\n1,2,3,4,5\n", "1 picks are too few"),
        ("column,row,x,y,z\n", "column, row, x, y, z; expected the columns u, v"),
        ("", "names nothing"),
        ("u,v,x,y,z\n1,2,3,4,5\n1,2,three,4,5\n", "row 3 holds"),
        ("u,v,x,y,z\n1,2,3,4\n", "row 2 holds"),
    ],
)
def test_a_table_that_is_none_is_refused(bumpy, tmp_path, text, words):
    (tmp_path / "picks.csv").write_text(text)
    with pytest.raises(AlignError, match=words):
        read_picks(tmp_path / "picks.csv", PERSPECTIVE, bumpy)
    with pytest.raises(AlignError, match="cannot be read"):
        read_picks(tmp_path / "none.csv", PERSPECTIVE, bumpy)
