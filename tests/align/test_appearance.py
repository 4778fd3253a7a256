"""The law of how an object looks: its slopes, what it leaves free, and what it finds again."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose.appearance import (
    NODES,
    Appearance,
    Lit,
    albedo_of,
    free_normals,
    freed_of_appearance,
)
from scene.normals import angular_error_deg, unit

COUNT, PIXELS = 9, 400


@pytest.fixture(scope="module")
def scene():
    """Nine lights all around, 400 pixels of a ball, each sample that is lit."""
    generator = np.random.default_rng(0)
    normals = unit(generator.standard_normal((PIXELS, 3)) + [0, 0, 1.5])
    normals = normals * np.sign(normals[:, 2:])
    directions = unit(generator.standard_normal((COUNT, 3)) + [0, 0, 2.0])
    vectors = directions[:, None] * generator.uniform(0.8, 1.2, (COUNT, PIXELS, 1))
    lit = Lit.of(vectors, np.broadcast_to([0.0, 0.0, 1.0], (PIXELS, 3)))
    return normals, lit, np.einsum("npk,pk->np", vectors, normals) > 0.1


def truth(metal):
    """Return a look that is partly metal, in surroundings that differ from frame to frame."""
    generator = np.random.default_rng(1)
    lobe = (1 - NODES) ** 12 * metal
    return Appearance(np.concatenate([[1 - metal], lobe]), 0.1 * generator.uniform(0, 1, (COUNT, 4)))


@pytest.mark.parametrize("metal", [0.0, 0.5, 1.0])
def test_a_law_is_found_again_and_explains_all(scene, metal):
    normals, lit, used = scene
    albedo = np.random.default_rng(2).uniform(0.3, 1.0, PIXELS)
    values = np.where(used, albedo * truth(metal).predict(lit, normals), 0)
    found = Appearance.of(values, used, normals, lit)
    assert (found.material >= 0).all()
    shown = found.predict(lit, normals)
    own, _ = albedo_of(values, used, shown, found.loss)
    assert np.abs((values - own * shown)[used]).mean() < 0.01 * values[used].mean()


@pytest.mark.parametrize("metal", [0.0, 1.0])
@pytest.mark.parametrize("turn_deg", [0.0, 40.0])
def test_the_law_neither_grows_nor_vanishes(scene, metal, turn_deg):
    """Drawn to no surroundings with its factor free, it shrank to nothing: albedos had to make up for it."""
    normals, lit, used = scene
    angle = np.radians(turn_deg)
    turned = normals @ np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    values = np.where(used, truth(metal).predict(lit, turned), 0)
    values = values / np.sqrt((values**2).mean(0))
    found = Appearance.of(values, used, normals, lit)
    own, _ = albedo_of(values, used, found.predict(lit, normals), found.loss)
    assert 0.2 < np.median(own) < 5
    assert found.material.max() > 0.1


def test_a_matte_look_is_lambert_s_law(scene):
    normals, lit, _ = scene
    np.testing.assert_allclose(Appearance.matte().predict(lit, normals), np.einsum("npk,pk->np", lit.vectors, normals))
    np.testing.assert_array_equal(Appearance.matte().slopes(lit, normals), lit.vectors)
    assert not Appearance.matte().sent_back(normals).any()


def test_the_slope_by_the_normal_is_the_difference(scene):
    normals, lit, _ = scene
    look, step = truth(0.7), 1e-6
    for axis in np.eye(3):
        moved = (look.predict(lit, normals + step * axis) - look.predict(lit, normals - step * axis)) / (2 * step)
        # But where a step crosses a node.
        off = np.abs(look.slopes(lit, normals) @ axis - moved) > 1e-5
        assert off.mean() < 0.01


def test_what_material_surroundings_and_albedo_can_make_is_taken_away(scene):
    """A projection: their own changes vanish, and what is left is left as it is."""
    normals, lit, used = scene
    generator = np.random.default_rng(3)
    look, other_look = truth(0.3), replace(truth(0.8), around=generator.standard_normal((COUNT, 4)))
    shown, albedo = look.predict(lit, normals), generator.uniform(0.3, 1.0, PIXELS)
    weight = used * generator.uniform(0.2, 1.0, used.shape)
    theirs = albedo * other_look.predict(lit, normals) + generator.standard_normal(PIXELS) * shown
    other = generator.standard_normal(used.shape)

    def freed(changes):
        return freed_of_appearance(changes[..., None], weight, albedo, shown, lit, normals)[..., 0]

    size = np.abs(theirs[used]).mean()
    # Albedos are free before: what they alone can make is no change.
    without = theirs - shown * (weight * shown * theirs).sum(0) / (weight * shown * shown).sum(0)
    assert np.abs(freed(without)[used]).mean() < 5e-3 * size
    mean = (weight * shown * other).sum(0) / (weight * shown * shown).sum(0)
    once = freed(other - shown * mean)
    assert np.abs(freed(once) - once)[used].mean() < 5e-3 * np.abs(once[used]).mean()
    assert np.abs(once[used]).mean() > 0.5 * np.abs(other[used]).mean()


@pytest.mark.parametrize("metal", [0.0, 1.0])
def test_normals_that_were_turned_are_turned_back(scene, metal):
    normals, lit, used = scene
    look = truth(metal)
    values = np.where(used, look.predict(lit, normals), 0)
    turned = unit(normals + 0.15 * unit(np.cross(normals, [0.2, 0.9, 0.1])))
    seen = used.sum(0) > 5
    found = free_normals(values[:, seen], used[:, seen], turned[seen], lit.only(seen), look)
    assert np.median(angular_error_deg(turned[seen], normals[seen])) > 7
    assert np.median(angular_error_deg(found, normals[seen])) < 1
