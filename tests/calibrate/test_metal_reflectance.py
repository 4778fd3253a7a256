"""How a metal's reflectance rises towards its outline."""

import numpy as np
import pytest

from calibrate.silhouette.metal_reflectance import INDEX, LAWS, fresnel, schlick


@pytest.mark.parametrize("law", LAWS)
def test_none_facing_the_camera_all_at_the_outline(law):
    assert law(np.array([1.0, 0.0])) == pytest.approx([0, 1], abs=1e-12)
    assert np.all(np.diff(law(np.linspace(0.15, 0, 50))) > 0)


def test_the_law_of_metals_is_fresnels():
    """As Mitsuba computes it."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    cosine = np.linspace(0, 1, 100)
    there = np.array(mi.fresnel_conductor(mi.Float(cosine), mi.Complex2f(INDEX.real, INDEX.imag)))
    assert fresnel(cosine) == pytest.approx((there - there[-1]) / (1 - there[-1]), abs=1e-5)


def test_the_law_of_renderers_is_above_it():
    """So which of the two is true decides by how much an outline moves."""
    cosine = np.linspace(0.1, 0.9, 50)
    assert np.all(schlick(cosine) > fresnel(cosine))
