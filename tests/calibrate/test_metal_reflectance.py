"""How a metal's reflectance rises towards its outline."""

import numpy as np
import pytest

from calibrate.silhouette.metal_reflectance import LAWS, fresnel, index_of, law_of, schlick


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


def test_all_balls_of_a_session_are_of_one_metal():
    assert law_of([0.5, -0.1, 0.0]) is fresnel
    assert law_of([0.05, -0.9]) is fresnel, "a metal's, unless the other explains more beyond doubt"
    assert law_of([-0.5, -0.6]) is schlick
    assert law_of([]) is fresnel
