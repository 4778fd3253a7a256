"""The outline's edges: found, and expected from the scan."""

import numpy as np
import pytest

from align.pose.appearance import Appearance
from align.pose.motion import nudge
from align.pose.outline_edges import SECTORS, EdgePictures
from align.pose.scan_view import View
from scene.rays import RayCaster


@pytest.fixture(scope="module")
def pictures(world):
    return EdgePictures.of(world.photographs)


def offsets(world, pictures, pose):
    view = View(RayCaster(world.mesh), world.camera, pose)
    outline = view.outline(cells=200)
    located = pictures.locate(outline.pixels, outline.outward, reach_px=4.0)
    return outline, located, pictures.expect(view, world.lights, Appearance.matte(), outline, located)


def test_an_object_darkens_toward_its_outline_and_the_scan_says_how_much(world, pictures):
    _, located, expected = offsets(world, pictures, world.pose)
    known = np.isfinite(located)
    assert known.mean() > 0.7
    left = (located - expected)[known]
    # The steepest place lies well inside the outline; what is expected of it does not.
    assert np.median(located[known]) < -0.1
    assert abs(np.median(left)) < 0.5 * abs(np.median(located[known]))
    assert np.median(np.abs(left - np.median(left))) < np.median(np.abs(located[known] - np.median(located[known])))


def test_an_edge_lies_outside_where_the_scan_is_too_far_in(world, pictures):
    right = nudge(world.pose, [0, 0, 0, 1.0, 0, 0], world.pose.apply(world.mesh.center_mm))
    outline, located, expected = offsets(world, pictures, right)
    shift = world.camera.project(right.apply(world.mesh.center_mm)) - world.camera.project(
        world.pose.apply(world.mesh.center_mm)
    )
    for side in (-1, 1):
        here = side * outline.outward[:, 0] > 0.9
        assert np.nanmedian((located - expected)[here]) == pytest.approx(-side * shift[0], abs=0.3)


def test_each_sector_is_lit_from_its_own_side(world, pictures):
    for sector, members in enumerate(pictures.members):
        angle = 2 * np.pi * sector / len(pictures.members)
        # Image v runs down, the camera's y up.
        toward = world.lights.directions[:, 0] * np.cos(angle) - world.lights.directions[:, 1] * np.sin(angle)
        assert toward[members].min() >= toward[~members].max()


def test_a_border_that_one_direction_shows_alone_is_no_outline():
    """A shadow's border, three pixels inside an outline that is fainter, was taken for it."""
    shown = np.where(np.arange(60) < 30, 0.6, 0.4)
    shadowed = np.where(np.arange(60) < 27, 1.5, shown)
    rows = np.stack([shadowed, *[shown] * (SECTORS - 1)]).astype(np.float32)
    stack = np.repeat(rows[:, None], 40, axis=1)
    pixels, outward = np.array([[29.5, 20.0]]), np.array([[1.0, 0.0]])

    def located(pictures):
        members = np.ones((SECTORS, 4), bool)
        return EdgePictures(pictures, np.zeros(2, np.int64), members).locate(pixels, outward, reach_px=5.0)[0]

    assert located(np.repeat(stack[1:2], SECTORS, axis=0)) == pytest.approx(0, abs=0.1)
    assert np.isnan(located(stack))
    # What all directions show stands still, whatever it is.
    assert located(np.repeat(stack[:1], SECTORS, axis=0)) == pytest.approx(-3, abs=0.1)
