"""Near lights and depth in turn, on balls whose normals and depth the test made; how far lights are, by the object."""

import numpy as np
import pytest

from benchmarks.unknown_lights import photographed
from fixtures.lit_surfaces import as_floats, ball_seen, flashes_at, matte, spiral
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.problem import Problem
from solve.samples import Geometry, Samples
from solve.solve import solve
from solve.whole.depth_evidence import depth_evidence
from solve.whole.near import find_positions

SIZE = 64
CAMERAS = {
    "perspective": Camera(SIZE, SIZE, 150.0, 150.0, 29.0, 33.5, (-0.06, 0.02, 0.0, 0.0, 0.0)),
    "orthographic": Camera(SIZE, SIZE, 0.4, 0.4, 29.0, 33.5, projection="orthographic"),
}


PERSPECTIVE, MIDDLE = CAMERAS["perspective"], (15.0, -10.0, -560.0)


def ball(camera=PERSPECTIVE, z_mm=-560.0):
    return ball_seen(camera, (15.0, -10.0, z_mm), 80.0, rim=0.4)


def lights_at(distance_mm=600.0, reference=MIDDLE, count=14):
    toward = spiral(np.cos(np.radians(np.linspace(14, 50, count))))
    positions = reference + toward * (distance_mm * np.linspace(0.8, 1.2, count)[:, None])
    intensities = np.linspace(0.7, 1.3, count)[:, None] * [0.9, 1.0, 1.1]
    return flashes_at(positions, np.asarray(reference, float), intensities).normalised()


def photographs(points, normals, mask, lights, *, noise=0.0):
    v, u = np.mgrid[:SIZE, :SIZE]
    albedo = 0.3 + 0.1 * np.sin(np.stack([u / 5, v / 7, (u + v) / 6], -1))
    images = np.where(mask[..., None], matte(lights, points, normals, albedo), 0)
    images += noise * np.random.default_rng(1).standard_normal(images.shape)
    return as_floats(lights, images)


@pytest.mark.parametrize("projection", CAMERAS)
def test_depth_and_normals_are_found_from_a_reference_that_is_centimetres_off(projection):
    camera = CAMERAS[projection]
    points, normals, mask = ball(camera)
    lights = lights_at()
    frames = photographs(points, normals, mask, lights, noise=0.001)
    near, plain = (solve(method, frames, lights, camera, mask) for method in ("near", "iterative"))
    error = {one.method: np.median(angular_error_deg(one.normals, normals)[mask]) for one in (near, plain)}
    assert error["iterative"] > 1.0
    assert error["near"] < 0.2
    gap = (near.z_mm - points[..., 2])[mask]
    assert abs(np.median(gap)) < 1.0
    assert np.percentile(np.abs(gap), 90) < 2.0
    assert np.isnan(near.z_mm[~mask]).all()
    assert not near.warnings
    assert plain.z_mm is None


def test_two_parts_at_different_depths_find_their_places():
    """Half of the ball stands 40 mm nearer to the camera: normals alone cannot tell."""
    points, normals, mask = ball()
    front = ball(z_mm=-520.0)
    left = np.arange(SIZE) < 34
    points = np.where(left[None, :, None], front[0], points)
    normals = np.where(left[None, :, None], front[1], normals)
    mask = np.where(left, front[2], mask)
    mask[:, 34] = False
    lights = lights_at()
    found = solve("near", photographs(points, normals, mask, lights, noise=0.001), lights, PERSPECTIVE, mask)
    gap = found.z_mm - points[..., 2]
    assert abs(np.nanmedian(gap[:, :34])) < 1.5
    assert abs(np.nanmedian(gap[:, 35:])) < 1.5


def test_lights_without_positions_get_them_from_the_object():
    (points, normals, mask), lights = ball(), lights_at()
    frames, far = photographs(points, normals, mask, lights), directions_only(lights)
    near, plain = (solve(method, frames, far, PERSPECTIVE, mask) for method in ("near", "iterative"))
    assert any("without positions" in text for text in near.warnings)
    error, before = (np.nanmedian(angular_error_deg(found.normals, normals)[mask]) for found in (near, plain))
    assert error < 0.5 * before


def test_the_evidence_is_the_derivative_of_the_fit():
    """Against refitting beside the place: the sum of squares is lowest at slope / information."""
    rng = np.random.default_rng(3)
    lights = lights_at(500.0, [0.0, 0.0, -500.0])
    geometry = Geometry.of(lights)
    true = np.array([[20.0, -30.0, -480.0]])
    b = np.array([[0.1, -0.2, 0.5]])

    def vectors(point):
        return lights.toward(point)[:, 0]

    gray = (vectors(true) @ b[0])[None].astype(np.float32)
    used = np.ones(gray.shape, bool)

    def fitted(t):
        place = true * np.exp(t)
        return place, np.linalg.lstsq(vectors(place), gray[0].astype(float), rcond=None)

    for t in (0.002, -0.002, rng.uniform(-0.002, 0.002)):
        place, (found, squares, *_) = fitted(t)
        slope, information, left, count = depth_evidence(Samples(gray, used, place, geometry), found[None], place)
        assert count[0] == gray.shape[1]
        np.testing.assert_allclose(left, squares, rtol=1e-3)
        np.testing.assert_allclose(slope / information, -t, rtol=0.02)


def directions_only(lights: Lights) -> Lights:
    return Lights(lights.names, lights.directions, lights.intensities).normalised()


@pytest.mark.full
@pytest.mark.parametrize(("shape", "seed"), [("blob", 20_400), ("potato", 20_401)])
def test_distances_and_normals(shape, seed):
    """Flashes 0.5 to 0.9 m away."""
    frames, lights, camera, mask, normals, *_ = photographed(shape, seed, 1.5)
    given = directions_only(lights)
    placed = find_positions(Problem.of(frames, given, camera, mask))
    found = placed.lights
    assert "without positions" in placed.cautions[0]
    # Of perspective pictures without a scale, everything is told up to one: the object is put at 1000.
    scale = -lights.reference_point_mm[2] / 1000
    far = np.linalg.norm(found.positions_mm - found.reference_point_mm, axis=1) * scale
    ratio = far / np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
    assert np.mean(ratio) == pytest.approx(1, abs=0.15)
    # Not one distance for all: theirs differ by a sixth.
    assert np.std(ratio) < 0.06
    estimate = solve("near", frames, given, camera, mask)
    assert any("without positions" in doubt for doubt in estimate.warnings)
    assert estimate.lights is not None
    assert estimate.lights.positions_mm is not None
    error = np.nanmedian(angular_error_deg(estimate.normals, normals)[mask])
    distant = solve("iterative", frames, given, camera, mask)
    assert error < 0.3 * np.nanmedian(angular_error_deg(distant.normals, normals)[mask])


@pytest.mark.full
def test_distant_lights_stay_distant():
    frames, lights, camera, mask, *_ = photographed("blob", 20_402, 40.0)
    problem = Problem.of(frames, directions_only(lights), camera, mask)
    assert find_positions(problem) is problem
