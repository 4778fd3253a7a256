"""Raw, best sign, oracle relief, oracle linear: what each forgives, and what none does."""

import numpy as np
import pytest

from compare.report.facts import family
from compare.statistics.statistics import MIRROR, four_ways
from fixtures.lit_surfaces import dome
from scene.normals import unit

RELIEF = np.array([[1, 0, 0], [0, 1, 0], [0.4, -0.3, 1.7]])
LINEAR = np.array([[1, 0.5, 0.2], [-0.3, 0.8, 0.1], [0.1, -0.2, 1.2]])


@pytest.fixture
def truth():
    normals, mask = dome(40, radius=0.5, rim=0.22)
    return np.where(mask[..., None], normals, np.nan)


def ways(normals, truth, mask=None):
    found = four_ways(normals, truth, np.ones(truth.shape[:2], bool) if mask is None else mask)
    return np.array([*found.values()][:4])


def test_each_way_forgives_its_own_ambiguity_and_no_more(truth):
    np.testing.assert_allclose(ways(truth, truth), 0, atol=1e-6)
    raw, sign, _, _ = ways(truth * MIRROR, truth)
    assert raw > 60
    assert sign < 1e-6
    mirrored_relief = unit(truth @ RELIEF) * MIRROR
    raw, sign, relief, _ = ways(mirrored_relief, truth)
    assert raw > sign > 5
    assert relief < 0.01
    raw, sign, relief, linear = ways(unit(truth @ LINEAR), truth)
    assert relief > 3
    assert linear < 0.01


def test_they_fall_in_their_order_on_whatever_is_given(truth):
    rng = np.random.default_rng(20_030)
    for _ in range(2):
        errors = ways(unit(truth @ rng.normal(size=(3, 3)) + rng.normal(0, 0.3, truth.shape)), truth)
        assert (np.diff(errors) <= 1e-9).all()


def test_an_angle_is_not_folded_and_a_few_wrong_pixels_do_not_steer(truth):
    assert ways(-truth, truth)[0] == pytest.approx(180)
    spoilt = truth.copy()
    spoilt[18:22, 18:22] = [0.0, 0.6, -0.8]
    np.testing.assert_allclose(ways(spoilt, truth), ways(spoilt, truth)[0], rtol=0.05)
    clean = np.ones(truth.shape[:2], bool)
    clean[18:22, 18:22] = False
    np.testing.assert_allclose(ways(spoilt, truth, clean), 0, atol=1e-6)


def test_the_method_that_took_the_other_sign_is_named_and_nothing_is_nothing(truth):
    mask = np.ones(truth.shape[:2], bool)
    assert four_ways(truth * MIRROR, truth, mask)["mirrored"]
    assert not four_ways(truth, truth, mask)["mirrored"]
    assert np.isnan(ways(truth, truth, ~mask)).all()


def test_families():
    assert [family(name) for name in ("tv", "ls", "Learned")] == ["uncalibrated", "calibrated", "external"]
