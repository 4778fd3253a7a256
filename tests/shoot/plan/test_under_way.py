"""What there is of a shoot: its samples as the lights and normals shade them, what is seen of it, how it scatters."""

import numpy as np
import pytest

from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.spheres import Sphere
from shoot.plan.plan_options import AS_USUAL, PlanOptions
from shoot.plan.set_up import places_in_reach
from shoot.plan.shoot_plan import next_flash
from shoot.plan.under_way import FEWEST_PIXELS, under_way

CAMERA = Camera(64, 48, 120.0, 120.0, 31.5, 23.5)
DEPTH_MM = -1000.0
ALBEDO = (0.5, 0.4, 0.6)


@pytest.fixture
def shoot():
    """Return a function that photographs a wavy surface: its frames, lights and estimate."""

    def made(scatter=0.0, spoil=None):
        rng = np.random.default_rng(3)
        reference = np.array([150.0, -90.0, DEPTH_MM])
        positions = reference + 900 * unit(rng.normal(0, 1, (12, 3)) * [1, 1, 0.2] + [0, 0, 1.2])
        names = tuple(f"flash_{i:02d}" for i in range(12))
        lights = Lights(
            names, unit(positions - reference), rng.uniform(0.6, 1.4, (12, 3)), positions, reference,
            np.full(12, 0.2), np.full(12, 0.01),
        )  # fmt: skip
        v, u = np.mgrid[:48, :64]
        normals = unit(np.stack([0.3 * np.sin(u / 5), 0.3 * np.cos(v / 4), np.ones(u.shape)], -1))
        points = CAMERA.points_at_depth(np.stack([u, v], -1).reshape(-1, 2), DEPTH_MM)
        shade = np.einsum("fpci,pi->fpc", lights.at(points), normals.reshape(-1, 3)) * ALBEDO
        shade *= 1 + scatter * rng.standard_normal((*shade.shape[:2], 1))
        images = shade.reshape(12, 48, 64, 3)
        if spoil is not None:
            spoil(images)
        albedo = np.broadcast_to(np.float32(ALBEDO), (48, 64, 3))
        estimate = Estimate("iterative", normals.astype(np.float32), albedo, np.full((48, 64), 12, np.uint16), 0.0, {})
        return Frames.from_linear(names, images.astype(np.float32)), lights, estimate

    return made


def test_what_the_flashes_show_is_the_shading_of_the_object(shoot):
    """Lights whose reference point lies 17 cm beside the object, and three channels of their own brightness."""
    frames, lights, estimate = shoot()
    found = under_way(frames, CAMERA, lights, [], estimate, count=300)
    assert len(found.pixels.points) == 300
    assert found.shown.seen.mean() > 0.85
    assert found.pixels.scatter < 0.002
    middle = found.pixels.middle_mm
    assert found.within(AS_USUAL).flash_mm == pytest.approx(
        np.median(np.linalg.norm(lights.positions_mm - middle, axis=1))
    )
    assert found.within(PlanOptions(flash_mm=5.0)).flash_mm == 5


def test_the_scatter_is_that_of_the_samples_and_tells_of_flashes_to_come(shoot):
    frames, lights, estimate = shoot(scatter=0.03)
    found = under_way(frames, CAMERA, lights, [], estimate, count=3000)
    # Normals were not fitted to these samples: no freedom is lost, and 12 samples less 3 count for it.
    assert found.pixels.scatter == pytest.approx(0.03 * np.sqrt(12 / 9), rel=0.1)
    again = found.pixels.under(found.lights)
    shade = np.einsum("fpi,pi->fp", again.vectors, found.pixels.b)
    assert (again.noise >= 0.99 * found.pixels.scatter * shade).all()


def test_shadows_highlights_and_what_is_clipped_are_not_seen(shoot):
    def spoil(images):
        images[0, :, :20] *= 0.1
        images[1, :, 20:40] *= 3
        images[2, :, 40:] = 1.5

    frames, lights, estimate = shoot(spoil=spoil)
    found = under_way(frames, CAMERA, lights, [], estimate, count=3072)
    u = found.places[:, 0]
    for flash, spoilt in enumerate((u < 20, (u >= 20) & (u < 40), u >= 40)):
        assert not found.shown.seen[flash, spoilt].any()
        assert found.shown.seen[flash, ~spoilt].mean() > 0.8


def test_a_registered_scan_is_the_object_and_takes_its_albedo_from_the_estimate(shoot):
    frames, lights, estimate = shoot()
    corners = CAMERA.points_at_depth([[10, 10], [50, 10], [50, 40], [10, 40]], DEPTH_MM)
    scan = Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]]))
    found = under_way(frames, CAMERA, lights, [], estimate, mesh=scan, count=200)
    assert found.pixels.casts_shadows
    assert found.pixels.normals == pytest.approx(np.broadcast_to([0.0, 0, 1], found.pixels.normals.shape))
    assert CAMERA.project(found.pixels.points) == pytest.approx(found.places, abs=0.51)
    assert np.ptp(found.pixels.albedo) == pytest.approx(0, abs=1e-6)


def balls(count, diameter_mm=60.0):
    places = np.array([[8.0, 6.0], [56.0, 42.0], [8.0, 42.0]])[:count]
    return [Sphere("chrome", place, 120 * 30 / 1000, diameter_mm) for place in places]


def test_the_next_flash_is_told_as_the_lights_so_far_are(shoot):
    """From their reference point, which lies 17 cm beside the object: the dome shows both."""
    frames, lights, estimate = shoot()
    found = under_way(frames, CAMERA, lights, balls(3), estimate)
    told, _ = next_flash(found, CAMERA, lights)
    zenith, azimuth = np.radians([told["zenith_deg"], told["azimuth_deg"]])
    toward = [np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)]
    place = lights.reference_point_mm + told["distance_mm"] * np.array(toward)
    candidates = places_in_reach(found.within(AS_USUAL), found.pixels.middle_mm, found.pixels.size_mm)
    assert np.linalg.norm(candidates - place, axis=1).min() < 5


def test_without_normals_nothing_is_known(shoot):
    frames, lights, estimate = shoot()
    estimate.normals[:] = np.nan
    estimate.normals[0, : FEWEST_PIXELS - 1] = [0, 0, 1]
    with pytest.raises(SceneError, match="found no normal from"):
        under_way(frames, CAMERA, lights, [], estimate)
