"""When a scan is said to be mirrored."""

from types import SimpleNamespace

import numpy as np
import pytest

from align.pose.register import Fit, _refuse_mirrored
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.rays import RayCaster


@pytest.fixture
def ask(monkeypatch):
    """Return a question: a scan that fits so, its mirror image so."""
    caster = RayCaster(Mesh(np.eye(3), np.array([[0, 1, 2]])))

    def refuse(fit, mirrored):
        monkeypatch.setattr("align.pose.register.fit_of", lambda evidence: evidence)
        _refuse_mirrored(caster, fit, lambda other: SimpleNamespace(evidence=mirrored))

    return refuse


def test_a_ball_is_not_called_mirrored(ask):
    """Real figures, DiLiGenT's ball: it rolled until its open side showed; its mirror image rolled less."""
    ask(Fit(0.957, 1.2, 1.3, 0.86, 0.9), Fit(0.961, 1.2, 1.3, 0.98, 0.2))


def test_normals_tell_the_mirror_image(ask):
    """Real figures, DiLiGenT's cat: a surface of its front, mirrored, has the cat's outline from behind."""
    with pytest.raises(AlignError, match="mirrored only"):
        ask(Fit(0.984, 90.0, 90.0, 0.97, 0.3), Fit(0.997, 5.7, 14.0, 1.0, 0.2))


def test_what_fits_neither_way_is_not_called_mirrored(ask):
    """Half of the scan of Blender's scene 2: neither it nor its mirror image fits; "one axis is reversed" was said."""
    ask(Fit(0.718, 28.8, 29.4, 0.30, 0.80), Fit(0.749, 11.9, 14.8, 0.41, 0.94))
