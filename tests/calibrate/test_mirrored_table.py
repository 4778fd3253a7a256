"""A chrome ball's outline by the table that it mirrors: the law, its truth, and where it must not be believed."""

from dataclasses import replace

import numpy as np
import pytest

from calibrate.detection.coarse import shrink
from calibrate.detection.detect import _mirrors
from calibrate.detection.evidence import bright_points, changes
from calibrate.detection.mirror_outline import by_mirrored_table
from calibrate.silhouette.ball_silhouette import fit_outline
from calibrate.silhouette.explained_profiles import _unpolarised
from calibrate.silhouette.mirrored_surroundings import STANDS_SIGMA, TablePlane
from calibrate.silhouette.mirrored_table import Beside, fit_mirrored_table
from fixtures.ball_scene import World, flashes, photograph
from scene.camera import Camera
from scene.spheres import Sphere
from tests.calibrate.conftest import missed
from twin.camera.virtual_camera import Sensor

CAMERA = Camera(640, 480, 900.0, 900.0, 312.0, 245.0)


def table_world(seed: int, *, texture: str = "noise", tilt: tuple[float, float] = (0.05, 0.12)) -> World:
    """Return a chrome ball of 60 px, off centre, on a textured table that is not square to the camera."""
    rng = np.random.default_rng(seed)
    lights = flashes(8, near_mm=700, far_mm=1000, center=np.array([0.0, 0.0, -800.0]), seed=seed)
    world = World(CAMERA, [], lights, np.full((8, 3), 0.9) * rng.uniform(0.8, 1.2, (8, 1)))
    world.table_point = np.array([0.0, 0.0, -850.0])
    world.table_normal = np.array([*tilt, 1.0]) / np.linalg.norm([*tilt, 1.0])
    world.table_texture, world.table_albedo, world.table_second = texture, 0.3, 0.12
    world.powers *= 0.5
    return world.stand("chrome", -60.0 + rng.uniform(-20, 20), 30.0, 53.0)


def seen(world: World, seed: int):
    return photograph(world, Sensor(full_well_e=40000.0, blur_px=0.6), np.random.default_rng([seed, 1]))


def metal_of_the_fixture(cosine: np.ndarray, facing: float, _: float) -> np.ndarray:
    """Return g of a metal whose index is n (1 + i)."""
    n = (1 + facing + np.sqrt((1 + facing) ** 2 - 2 * (1 - facing) ** 2)) / (2 * (1 - facing))
    return (_unpolarised(cosine, complex(n, n)) - facing) / (1 - facing)


def fitted(frames, true: Sphere, off=(0.5, -0.4, -0.6), **beside):
    """Return what is fitted from a start so far off, by the fixture's metal, and what it then misses (3,), px."""
    start = replace(true, center_px=true.center_px + off[:2], radius_px=true.radius_px + off[2])
    beside = Beside(**({"laws": [metal_of_the_fixture]} | beside))
    found = fit_mirrored_table(frames, CAMERA, start, blur_px=1.0, beside=beside)
    return found, missed(found.sphere, true)


@pytest.mark.parametrize(("texture", "bound_px"), [("noise", 0.015), ("wood", 0.03)])
def test_outline_plane_and_reflectance_of_a_ball_on_a_textured_table(texture: str, bound_px: float) -> None:
    world = table_world(20000, texture=texture)
    found, off = fitted(seen(world, 20000), world.spheres()[0])
    assert np.abs(off).max() < bound_px
    assert found.explained > 0.999
    assert found.mirror == pytest.approx(0.56, abs=0.005)
    n = world.table_normal
    # Where profiles and what they mirror were read 0.4 degrees apart, wood's slope came out 0.015 off.
    assert found.plane.values == pytest.approx([n[0] / n[2], n[1] / n[2], 1.0], abs=0.005)
    assert found.plane.height == pytest.approx(0, abs=0.005)


@pytest.mark.parametrize(("facing", "refraction"), [(0.45, 2.47), (0.56, 3.38), (0.7, 5.58)])
def test_the_photographs_tell_the_metal(facing: float, refraction: float) -> None:
    """Taken for chromium, of n = 3, their radii are 0.08 px too small, 0.04 and 0.09 px too large."""
    world = table_world(20000)
    world.balls[0].albedo = facing
    found, off = fitted(seen(world, 20000), world.spheres()[0], laws=Beside().laws)
    assert np.abs(off).max() < 0.015
    assert found.mirror == pytest.approx(facing, abs=0.01)
    assert found.refraction == pytest.approx(refraction, rel=0.1)


@pytest.mark.parametrize(("foot", "height_off"), [(0.03, 0.01), (0.1, 0.02), (0.3, 0.02)])
def test_a_ball_on_a_foot_is_told_from_one_that_stands_on_the_table(foot: float, height_off: float) -> None:
    world = table_world(20000)
    world.table_point = world.table_point - foot * 53.0 * world.table_normal
    found, off = fitted(seen(world, 20000), world.spheres()[0])
    assert np.abs(off).max() < 0.03
    assert found.plane.height == pytest.approx(foot, abs=height_off)


@pytest.mark.full
@pytest.mark.parametrize("blur_px", [0.3, 1.0, 1.5])
def test_a_blur_moves_no_outline(blur_px: float) -> None:
    """Where a profile's parts took their shares at different places, 1.5 px of it made the radius 0.04 px too small."""
    world = table_world(20000)
    true, rng = world.spheres()[0], np.random.default_rng(20000)
    frames = photograph(world, Sensor(full_well_e=4e8, blur_px=blur_px), rng)
    assert abs(fitted(frames, true, (0, 0, -0.3))[1][2]) < 0.02


def test_of_many_circles_the_one_that_mirrors_the_table_is_found() -> None:
    """On a strong texture edges agree on many circles: the right one was the ninth, and was not tried."""
    world = table_world(20001, texture="wood")
    true, frames = world.spheres()[0], seen(world, 20001)
    r = true.radius_px
    ways = [(0.2 * r * np.cos(a), 0.2 * r * np.sin(a)) for a in np.deg2rad(np.arange(0, 360, 45))]
    wrong = [replace(true, center_px=true.center_px + way, radius_px=0.9 * r, score=0.4) for way in ways]
    right = replace(true, center_px=true.center_px + [0.8, -0.6], radius_px=r + 0.9, score=0.3)
    found = by_mirrored_table(frames, CAMERA, [*wrong, right], blur_px=1.0)
    assert np.abs(missed(found.sphere, true)).max() < 0.1


@pytest.mark.full
def test_the_circle_that_mirrors_the_table_is_found_beside_one_of_twice_its_size() -> None:
    """Edges are sought from half of a mirror's first circle on: none was the ball's where that was larger by more."""
    world = table_world(20001, texture="wood")
    true, frames = world.spheres()[0], seen(world, 20001)
    coarse = shrink(frames, CAMERA)
    near = replace(coarse.from_full(true), radius_px=coarse.from_full(true).radius_px + 0.6)
    change = changes(coarse)
    points = bright_points(change, near)
    large = replace(near, radius_px=2.3 * near.radius_px, score=1.0)
    track = (near.center_px + near.radius_px * points.track - large.center_px) / large.radius_px
    suspects = _mirrors(frames, CAMERA, coarse, change, [(large, points._replace(track=track)), (near, points)], [])
    (found,) = (one.table.sphere for one in suspects if one.table)
    assert np.abs(missed(found, true)).max() < 0.1


def test_of_two_balls_that_show_different_tables_the_wrong_one_is_fitted_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A first ball showed a plane 50 degrees off and lay 0.2 px off: what the second one showed did not mend it."""
    world = table_world(20001)
    world.balls.clear()
    world.stand("chrome", -60.0, 30.0, 53.0).stand("chrome", 70.0, -40.0, 40.0)
    frames = seen(world, 20001)
    coarse = shrink(frames, CAMERA)
    change = changes(coarse)
    circles = [coarse.from_full(ball) for ball in world.spheres()]
    tilted, fits = np.array([1.0, 0.8, 1.0]), []

    def fitted_wrongly_at_first(*args, **known):
        table = by_mirrored_table(*args, **known)
        fits.append(table)
        wrong = table.plane._replace(values=tilted)
        return table._replace(plane=wrong, explained=0.987) if len(fits) == 1 else table

    monkeypatch.setattr("calibrate.detection.detect.by_mirrored_table", fitted_wrongly_at_first)
    pointed = [(circle, bright_points(change, circle)) for circle in circles]
    suspects = _mirrors(frames, CAMERA, coarse, change, pointed, [])
    slopes = world.table_normal[:2] / world.table_normal[2]
    planes = [one.table.plane.values for one in suspects if one.table]
    assert len(planes) == 2
    np.testing.assert_allclose(np.array(planes)[:, :2], [slopes, slopes], atol=0.02)
    assert TablePlane(tilted, 0.1 * np.ones(3)).contradicts(TablePlane(planes[0], 0.1 * np.ones(3)))
    assert not TablePlane(tilted, 0.5 * np.ones(3)).contradicts(TablePlane(planes[0], 0.1 * np.ones(3)))


def test_what_other_balls_show_of_the_table_counts_beside_thousands_of_samples() -> None:
    """Domes beside the ball are no table: they drew the plane to ten sigmas off the known one, the radius 4.6 px."""
    world = table_world(20001)
    world.balls.clear()
    world.stand("chrome", -60.0, 30.0, 30.0).stand("object", -10.0, 52.0, 24.0).stand("object", -112.0, 10.0, 20.0)
    n = world.table_normal
    known = TablePlane(np.array([n[0] / n[2], n[1] / n[2], 1.0]), np.array([0.1, 0.1, STANDS_SIGMA]))
    found, off = fitted(seen(world, 20001), world.spheres()[0], (0.5, 0.5, -1.0), plane=known, laws=Beside().laws)
    assert (np.abs(found.plane.values - known.values) < 2 * known.sigma).all()
    assert np.abs(off).max() < np.hypot(0.1, 2 * found.left_px)


@pytest.mark.parametrize("seed", [20007, *(pytest.param(seed, marks=pytest.mark.full) for seed in (20008, 20009))])
def test_the_far_rim_counts_on_a_table_seen_aslant(seed: int) -> None:
    """The table mirrored there soon leaves the picture: where that rim did not count, the ball lay 0.15 px too low."""
    world = table_world(seed, tilt=(0.1, 1.5))
    world.balls.clear()
    true = world.stand("chrome", -60.0, 30.0, 30.0).spheres()[0]
    _, off = fitted(seen(world, seed), true)
    assert (np.abs(off) < [0.07, 0.07, 0.02]).all()


@pytest.mark.full
@pytest.mark.parametrize("seed", [20001, 20002])
def test_a_ball_that_hides_the_table_is_not_taken_for_it(seed: int) -> None:
    """Looked up as if it lay flat, a white ball that touched the chrome one drew its outline by 0.06 to 0.3 px."""
    world = table_world(seed, tilt=(0.05, 0.6))
    world.balls.clear()
    world.stand("chrome", -60.0, 30.0, 45.0).stand("white", 18.0, 58.4, 40.0)
    true, other = world.spheres()
    assert np.linalg.norm(true.center_mm(CAMERA) - other.center_mm(CAMERA)) == pytest.approx(45.0 + 40.0, abs=1.0)
    told, untold = (fitted(seen(world, seed), true, (0, 0, -0.6), others=others)[1] for others in ([other], []))
    assert np.abs(told).max() < 0.02 < 0.5 * np.abs(untold).max()


@pytest.mark.full
@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (-1.0, 2.0, 1.5)])
def test_on_a_table_seen_aslant_the_fit_goes_to_its_end(off: tuple[float, float, float]) -> None:
    """Outline and tilt make up for each other there: a fit that stops on its way ends half a pixel off."""
    world = table_world(20007, tilt=(0.1, 1.2))
    found, left = fitted(seen(world, 20007), world.spheres()[0], off)
    assert np.abs(left).max() < 0.04
    assert found.explained > 0.999
    assert found.plane.values == pytest.approx([0.1, 1.2, 1.0], abs=0.06)


@pytest.mark.full
def test_an_outline_is_found_from_three_hundredths_of_its_radius_away_and_its_sigma_holds() -> None:
    chi = []
    for seed in (20001, 20002, 20003):
        world = table_world(seed)
        true, frames = world.spheres()[0], seen(world, seed)
        start = replace(true, center_px=true.center_px + [1.0, -1.2], radius_px=0.97 * true.radius_px)
        fit = fit_outline(frames, CAMERA, start, search_px=2.0)
        assert fit.by_table
        off = missed(fit.sphere, true)
        assert np.abs(off).max() < 0.06
        chi.append(off @ np.linalg.solve(fit.covariance, off))
    assert max(chi) < 20


def test_a_mirror_is_found_by_the_edge_of_the_table_that_it_shows() -> None:
    """On a textured cloth (Mitsuba 2124) its own outline was no static edge, and the dark disc was taken."""
    world = table_world(20003)
    true = world.spheres()[0]
    disc = replace(true, radius_px=0.68 * true.radius_px)
    found = by_mirrored_table(seen(world, 20003), CAMERA, [disc], blur_px=1.0)
    assert found is not None
    assert np.abs(missed(found.sphere, true)).max() < 0.3
