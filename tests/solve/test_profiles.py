"""Profiles: the seed's plain readings fail where they are said to fail."""

import numpy as np
import pytest

from scene.errors import SceneError
from solve.methods import METHODS, method_of
from solve.samples import Geometry, Samples

COUNT = 16


def cap():
    """Sixteen lights around a cap, all in front of a normal of (0, 0, 1)."""
    azimuth, z = np.arange(COUNT) * 2.4, np.linspace(0.6, 0.95, COUNT)
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)


def fitted(name, gray, valid=None, profile="default"):
    valid = np.ones(gray.shape, bool) if valid is None else valid
    samples = Samples(gray.astype(np.float32), valid, np.zeros((len(gray), 3)), Geometry.distant(cap()))
    method = method_of(name)
    b, used = method.fit(samples, 1.0, method.settings(profile))
    return b / np.linalg.norm(b, axis=1, keepdims=True), used


def away_deg(normals):
    return np.degrees(np.arccos(np.clip(normals[:, 2], -1, 1)))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_has_the_seeds_profile_with_the_same_names(method):
    found = method_of(method)
    assert found.name == method
    assert type(found.settings("seed")) is type(found.settings("default"))
    with pytest.raises(SceneError, match=r"no profile 'x'; there are default, .*seed"):
        found.settings("x")


def test_the_seeds_least_squares_keeps_what_is_clipped():
    samples = 1.5 * cap()[:, 2][None]
    clipped = samples > 1
    samples = np.minimum(samples, 1.0)
    assert away_deg(fitted("ls", samples, ~clipped)[0])[0] < 1e-3
    normals, used = fitted("ls", samples, ~clipped, "seed")
    assert used.all()
    assert away_deg(normals)[0] > 1
