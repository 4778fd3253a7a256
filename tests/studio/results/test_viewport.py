"""The pixel under a click is the pixel that is drawn there: on both sides, at every zoom, wherever one looks."""

from dataclasses import replace

import numpy as np
import pytest

from studio.results.pixel import numbers_at
from studio.results.result_maps import Source
from studio.results.side_by_side import Choice, box_of, map_picture, viewport_of
from studio.results.viewport import Viewport

LEFT, RIGHT = Source("ls"), Source("ls", "twin")
RED = (255, 128, 128)
"""A normal to the right, as a picture has it."""
ODD = [(31, 12), (9, 4), (49, 29), (10, 27)]


@pytest.mark.parametrize("zoom", [1, 2, 8, 32])
@pytest.mark.parametrize("centre", [None, (31, 12), (9, 4), (49, 29), (10, 27), (0, 36)])
def test_a_click_on_an_odd_pixel_is_that_pixel(flat, zoom, centre):
    """Every point of the picture that is coloured oddly is clicked as an odd pixel, and no other point is."""
    results = flat(ODD)
    choice = Choice("normals", LEFT, RIGHT, zoom, centre)
    viewport, seen = viewport_of(results, choice), []
    high, wide = viewport.high, viewport.wide
    generator = np.random.default_rng(10_064)
    for source in (LEFT, RIGHT):
        part = (map_picture(results, choice, source) == RED).all(-1)
        assert part.shape == (high, wide)
        anywhere = generator.uniform(0, part.shape, (300, 2)).astype(int)
        # The points at the odd pixels' edges, where a shift by half a point would show.
        edge = part ^ (part & np.roll(part, 1, 0) & np.roll(part, -1, 0) & np.roll(part, 1, 1) & np.roll(part, -1, 1))
        seen.append(set())
        for y, x in [*anywhere, *np.argwhere(edge)[::7], *(np.argwhere(edge)[::7] + [1, 1])]:
            if x < wide and y < high:
                pixel = viewport.pixel((x + 0.5) / wide, (y + 0.5) / high)
                assert (pixel in ODD) == part[y, x], (x, y, pixel)
                seen[-1] |= {pixel} & set(ODD)
    assert seen[0] == seen[1]
    if centre is None and zoom == 1:
        assert seen[0] == set(ODD), "zoom 1 shows all of the object"
    if centre in ODD:
        assert centre in seen[0]


def test_a_click_beside_the_pictures_is_no_pixel(flat):
    results = flat(ODD)
    viewport = viewport_of(results, Choice("normals", LEFT, RIGHT))
    for across, down in ((-0.01, 0.5), (1.01, 0.5), (0.2, -0.1), (0.2, 1.1), (1.0, 0.5), (0.5, 1.0)):
        assert viewport.pixel(across, down) is None


def test_the_numbers_are_those_of_the_odd_pixel_alone(flat):
    results = flat([(31, 12)])
    for u, v in ((31, 12), (12, 31), (30, 12), (31, 13)):
        (_, real, twin) = numbers_at(results, u, v)
        expected = (1, 0, 0) if (u, v) == (31, 12) else (0, 0, 1)
        assert tuple(real.normal) == tuple(twin.normal) == expected


def test_the_cursor_stands_around_its_pixel_on_both_sides(flat):
    """The strokes' middle is the pixel's middle, and the pixel itself stays to be seen."""
    results = flat([(31, 12)])
    choice = Choice("normals", LEFT, RIGHT, zoom=8, centre=(30, 13))
    for source in (LEFT, RIGHT):
        plain = map_picture(results, choice, source)
        marked = map_picture(results, replace(choice, cursor=(31, 12)), source)
        rows, columns = np.nonzero((plain != marked).any(-1))
        odd_rows, odd_columns = np.nonzero((plain == RED).all(-1))
        assert (rows.min() + rows.max()) / 2 == pytest.approx((odd_rows.min() + odd_rows.max()) / 2, abs=2)
        assert (columns.min() + columns.max()) / 2 == pytest.approx((odd_columns.min() + odd_columns.max()) / 2, abs=2)
        assert (marked[odd_rows, odd_columns] == RED).all(-1).mean() > 0.9


def test_zoom_is_about_the_cursor_and_the_edge_ends_a_move(flat):
    results = flat(ODD)
    choice = Choice("normals", LEFT, RIGHT, cursor=(31, 12)).zoomed(8)
    assert viewport_of(results, choice).centre == pytest.approx((31, 12))
    assert choice.zoomed(1).centre is None
    right = choice
    for _ in range(40):
        right = right.moved(results, 0.5, 0.0)
    viewport = viewport_of(results, right)
    assert viewport.left + viewport.width == pytest.approx(results.size[0])
    assert viewport_of(results, right.moved(results, -0.5, 0)).left == pytest.approx(viewport.left - viewport.width / 2)
    down = viewport_of(results, choice.moved(results, 0.0, 0.5))
    assert down.top > viewport_of(results, choice).top
    whole = Viewport.of(box_of(results), 1, (26, 18), results.size)
    assert (whole.width, whole.height) == (box_of(results).width, box_of(results).height)
