"""When a scan is said to be mirrored."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from align.pose.register import Fit, _refuse_mirrored
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.rays import RayCaster


@dataclass(frozen=True)
class _Seen:
    caster: RayCaster


@dataclass(frozen=True)
class _Evidence:
    seen: _Seen
    fit: Fit


@pytest.fixture
def ask(monkeypatch):
    """Return a question: a scan that fits so, its mirror image so, and that by so many deviations better."""
    seen = _Seen(RayCaster(Mesh(np.eye(3), np.array([[0, 1, 2]]))))

    def refuse(fit, mirrored, deviations=0.0):
        monkeypatch.setattr("align.pose.register.fit_of", lambda evidence: evidence.fit)
        monkeypatch.setattr("align.pose.register.compare_poses", lambda one, two: deviations)
        found = SimpleNamespace(evidence=_Evidence(seen, mirrored))
        return _refuse_mirrored(_Evidence(seen, fit), fit, lambda other: found)

    return refuse


def test_a_ball_is_not_called_mirrored(ask):
    """Real figures, DiLiGenT's ball: it rolled until its open side showed; its mirror image rolled less."""
    ask(Fit(0.957, 1.2, 1.3, 0.9), Fit(0.961, 1.2, 1.3, 0.2))


def test_normals_tell_the_mirror_image(ask):
    """Real figures, DiLiGenT's cat: a surface of its front, mirrored, has the cat's outline from behind."""
    with pytest.raises(AlignError, match="mirrored only"):
        ask(Fit(0.984, 90.0, 90.0, 0.3), Fit(0.997, 5.7, 14.0, 0.2))


def test_what_fits_neither_way_is_not_called_mirrored(ask):
    """Half of the scan of Blender's scene 2: neither it nor its mirror image fits; "one axis is reversed" was said."""
    ask(Fit(0.718, 28.8, 29.4, 0.80), Fit(0.749, 11.9, 14.8, 0.94))


def test_what_is_nearly_its_own_mirror_image_is_told_by_the_pixels(ask):
    """Real figures, Cycles' scene 302, a bronze, its scan mirrored: accepted in silence, true normals 3.5 deg off."""
    scan, mirrored = Fit(0.984, 5.67, 13.7, 0.19), Fit(0.984, 4.30, 13.7, 0.13)
    assert "mirror image fits better" in ask(scan, mirrored, 9.3)
    assert ask(scan, mirrored, 1.0) is None
    assert ask(mirrored, scan, -9.3) is None
