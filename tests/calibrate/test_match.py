"""Which diameter belongs to which ball, where fewer balls are found than were asked for."""

import numpy as np
import pytest

from calibrate.detection.balls import _match
from calibrate.silhouette.ball_silhouette import OutlineFit
from scene.spheres import Sphere, SphereRequest


def _found(kind, radius):
    return OutlineFit(Sphere(kind, np.zeros(2), radius), np.eye(3), 0.1)


def _told(found, asked, given=()):
    warnings = []
    requests = [SphereRequest(kind, diameter) for kind, diameter in asked]
    return [diameter for _, diameter in _match(found, requests, list(given), (), warnings)], " ".join(warnings)


ASKED = [("chrome", 60.0), ("chrome", 40.0), ("chrome", 20.0), ("white", 50.0)]


@pytest.mark.parametrize(
    ("radii", "diameters"), [((30, 10.4), (60, 20)), ((20.5, 10), (40, 20)), ((31, 20), (60, 40)), ((19.5,), (40,))]
)
def test_the_missing_ball_is_told_by_the_others_scale(radii, diameters):
    """Half a millimetre a pixel by the white ball, or by each other."""
    found = [_found("chrome", r) for r in radii] + [_found("white", 25.0)]
    given, said = _told(found, ASKED)
    assert [ball.mm for ball in given] == pytest.approx([*diameters, 50.0])
    assert not any(ball.sigma for ball in given)
    assert "told apart by their size" in said


def test_what_the_scale_leaves_open_is_the_diameters_doubt():
    (ball,), said = _told([_found("chrome", 30.0)], ASKED[:3])
    assert ball.mm == pytest.approx(np.cbrt(60 * 40 * 20))
    assert ball.sigma == pytest.approx(np.std(np.log([60, 40, 20])))
    assert "which of 60, 40, 20 mm each is cannot be told" in said
    # Both 60 and 55 mm are as the white ball's scale has it.
    (ball, white), said = _told([_found("chrome", 28.7), _found("white", 25.0)], [*ASKED, ("chrome", 55.0)])
    assert white == (50.0, 0.0)
    assert 56 < ball.mm < 59
    assert 0.03 < ball.sigma < 0.07
    assert "cannot be told" in said


def test_a_ball_whose_place_is_given_tells_the_scale():
    given = [Sphere("white", np.zeros(2), 25.0, diameter_mm=50.0)]
    (ball,), _ = _told([_found("chrome", 20.0)], ASKED[:3], given)
    assert ball == (40.0, 0.0)


def test_two_balls_of_almost_one_size_may_be_exchanged():
    """One of 43 mm that stands nearer looks larger than one of 45."""
    given, said = _told([_found("chrome", 22.0), _found("chrome", 21.5)], [("chrome", 43.0), ("chrome", 45.0)])
    assert all(43 < ball.mm < 45 and ball.sigma > 0.02 for ball in given)
    assert "cannot be told" in said


def test_a_diameter_goes_to_the_ball_of_its_size_and_the_other_has_none():
    found = [_found("chrome", 40.0), _found("chrome", 20.0), _found("white", 25.0)]
    given, _ = _told(found, [("chrome", None), ("chrome", 80.0), ASKED[3]])
    assert given == [(80.0, 0.0), (None, 0.0), (50.0, 0.0)]
