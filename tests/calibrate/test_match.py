"""Which diameter belongs to which ball, where fewer balls are found than were asked for."""

import numpy as np
import pytest

from calibrate.detection.balls import _match
from calibrate.detection.detect import Found
from calibrate.silhouette.ball_silhouette import OutlineFit
from scene.spheres import Sphere, SphereRequest


def _found(kind, radius):
    return Found(OutlineFit(Sphere(kind, np.zeros(2), radius), np.eye(3), 0.1))


def _diameters(found, asked):
    warnings = []
    requests = [SphereRequest(kind, diameter) for kind, diameter in asked]
    return [diameter for _, diameter in _match(found, requests, (), warnings)], " ".join(warnings)


ASKED = [("chrome", 60.0), ("chrome", 40.0), ("chrome", 20.0), ("white", 50.0)]


@pytest.mark.parametrize(
    ("radii", "diameters"), [((30, 10.4), (60, 20)), ((20.5, 10), (40, 20)), ((31, 20), (60, 40)), ((19.5,), (40,))]
)
def test_the_missing_ball_is_told_by_the_others_scale(radii, diameters):
    """Half a millimetre a pixel by the white ball, or by each other."""
    found = [_found("chrome", r) for r in radii] + [_found("white", 25.0)]
    given, said = _diameters(found, ASKED)
    assert sorted(given) == sorted([*diameters, 50.0])
    assert "told apart by their size" in said


def test_what_the_scale_leaves_open_gets_no_diameter():
    given, said = _diameters([_found("chrome", 30.0)], ASKED[:3])
    assert given == [None]
    assert "cannot be told apart" in said
    # Both 60 and 55 mm are as the white ball's scale has it.
    given, said = _diameters([_found("chrome", 29.0), _found("white", 25.0)], [*ASKED, ("chrome", 55.0)])
    assert sorted(given, key=str) == [50.0, None]
    assert "cannot be told apart" in said
