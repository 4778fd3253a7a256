"""How a metal's reflectance rises towards its outline."""

import numpy as np
import pytest

from calibrate.silhouette.explained_profiles import LAWS, fresnel, index_of


@pytest.mark.parametrize("facing", [0.5, 0.67, 0.9])
@pytest.mark.parametrize("law", LAWS)
def test_none_facing_the_camera_all_at_the_outline(law, facing):
    assert law(np.array([1.0, 0.0]), facing) == pytest.approx([0, 1], abs=1e-12)
    assert np.all(np.diff(law(np.linspace(0.05, 0, 50), facing)) > 0)


@pytest.mark.parametrize("facing", [0.45, 0.67, 0.9])
def test_the_law_of_metals_is_fresnels(facing):
    """As Mitsuba computes it, of a metal that reflects so much."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    cosine, index = np.linspace(0, 1, 100), index_of(facing)
    there = np.array(mi.fresnel_conductor(mi.Float(cosine), mi.Complex2f(index.real, index.imag)))
    assert there[-1] == pytest.approx(facing, abs=1e-5)
    assert fresnel(cosine, facing) == pytest.approx((there - there[-1]) / (1 - there[-1]), abs=1e-4)
