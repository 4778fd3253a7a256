"""Uncalibrated methods on a matte object: whatever the start and the lights that are told, the same normals."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, as_samples, dome, even_cap, gloss, lights_along, matte
from scene.camera import Camera
from scene.method_names import UNCALIBRATED
from scene.normals import angular_error_deg, unit
from solve.problem import Problem
from solve.solve import solve
from solve.uncalibrated import entropy, ldr, tv
from solve.uncalibrated.front_end import FrontEnd, family

METHODS = {"ldr": ldr, "entropy": entropy, "tv": tv}
SIZE = 72


def ellipsoid(size=SIZE):
    """Normals (H, W, 3) and mask of an ellipsoid that stands free."""
    v, u = np.mgrid[:size, :size]
    x, y = 2.3 * (u - size / 2) / size, -2.3 * (v - size / 2) / size
    height = np.sqrt(np.maximum(1 - x**2 - 1.3 * y**2, 1e-9))
    mask = x**2 + 1.3 * y**2 < 0.93
    return unit(np.stack([x, 1.3 * y, height], -1)), mask


def photographs(normals, mask, directions, albedo=0.5, strength=1.0):
    return (albedo * np.maximum(normals[mask] @ directions.T, 0) * strength).astype(np.float32)


@pytest.fixture(scope="module")
def scene():
    normals, mask = ellipsoid()
    directions = even_cap(40, 50)
    return photographs(normals, mask, directions), normals[mask], directions, mask


def run(name, gray, mask, **changes):
    """The method's result; `changes` are settings."""
    module = METHODS[name]
    samples = as_samples(gray, np.full((gray.shape[1], 3), np.nan))  # under lights that nobody knows
    return module.fit_whole(Problem(None, None, None, mask, slice(0, len(mask))), samples, FrontEnd(**changes))


def error(b, normals):
    return angular_error_deg(unit(b), normals)


def started_elsewhere(monkeypatch, module, mu, nu, depth):
    """Make a method begin from another member of the family."""

    def other(*arguments, **settings):
        found = family(*arguments, **settings)
        b, lights = found.relief(mu, nu, depth)
        return replace(found, b=b, lights=lights)

    monkeypatch.setattr(module, "family", other)


@pytest.mark.parametrize("name", METHODS)
def test_a_plain_object_comes_out_convex_from_a_concave_start_and_a_seed_says_what_it_has(name, scene, monkeypatch):
    gray, normals, directions, mask = scene
    started_elsewhere(monkeypatch, METHODS[name], 0, 0, -1)
    assert error(run(name, gray, mask).b, normals).mean() < 0.5
    raw = run(name, gray, mask, sign="arbitrary")
    monkeypatch.undo()
    other = run(name, gray, mask, sign="arbitrary")
    means = sorted(error(each.b, normals).mean() for each in (raw, other))
    assert means[0] < 0.5
    assert means[1] > 40
    mirrored = max((raw, other), key=lambda each: error(each.b, normals).mean())
    assert error(mirrored.b, normals * [-1, -1, 1]).mean() < 0.5
    assert angular_error_deg(unit(mirrored.lights), directions * [-1, -1, 1]).max() < 1


@pytest.mark.parametrize("start", [(0.5, -0.8, 0.4), (-1.5, 0.3, 3.0), (0.1, 0.9, -1.7)])
@pytest.mark.parametrize("name", ["ldr", "tv"])
def test_the_start_does_not_matter(name, start, scene, monkeypatch):
    _, _, directions, mask = scene
    rng = np.random.default_rng(20_010)
    gray = photographs(ellipsoid()[0], mask, directions, strength=np.ones(40))
    gray = (gray + rng.normal(0, 0.01, gray.shape)).astype(np.float32)
    plain = run(name, gray, mask)
    started_elsewhere(monkeypatch, METHODS[name], *start)
    assert error(run(name, gray, mask).b, unit(plain.b)).max() < 1e-3


def test_ldr_and_entropy_need_no_equal_intensities_and_tv_says_that_it_does(scene):
    _, normals, directions, mask = scene
    strength = np.random.default_rng(20_011).uniform(0.4, 1.6, len(directions))
    gray = photographs(ellipsoid()[0], mask, directions, strength=strength)
    for name in ("ldr", "entropy"):
        found = run(name, gray, mask)
        assert error(found.b, normals).mean() < 0.5
        np.testing.assert_allclose(np.linalg.norm(found.lights, axis=1), strength / strength.mean(), rtol=0.02)
    assert any("one intensity" in doubt for doubt in run("tv", gray, mask).cautions)


def test_gloss_and_cast_shadow_are_cleaned_away(scene):
    gray, normals, directions, mask = scene
    spoilt = gray + 0.6 * gloss(normals, directions, 150).T
    spoilt[: len(gray) // 4, ::6] = 0
    spoilt = spoilt.astype(np.float32)
    for name in METHODS:
        good, plain = (error(run(name, spoilt, mask, robust=each).b, normals).mean() for each in (True, False))
        assert good < 1.5
        assert plain > 2 * good


def test_each_says_when_it_should_not_be_believed(scene):
    gray, _, directions, mask = scene
    v, u = np.mgrid[:SIZE, :SIZE]
    smooth = photographs(ellipsoid()[0], mask, directions, (0.4 + 0.2 * np.sin(u / 3) * np.cos(v / 4))[mask][:, None])
    assert any("texture" in doubt for doubt in run("ldr", smooth, mask).cautions)
    assert any("flat" in doubt for doubt in run("entropy", smooth, mask).cautions)

    flat = np.tile(directions @ [0.1, 0.2, 0.97], (len(gray), 1)).astype(np.float32)
    flat += np.random.default_rng(20_015).normal(0, 0.004, flat.shape).astype(np.float32)
    for name in METHODS:
        assert re.search("third singular value|integrability", " ".join(run(name, flat, mask).cautions))

    all_of_it = np.zeros((SIZE, SIZE), bool)
    all_of_it[24:48, 24:48] = True
    crop = gray[all_of_it[mask]]
    edge = run("tv", crop, np.ones((24, 24), bool))
    assert any("outline is not in the picture" in doubt for doubt in edge.cautions)
    inner = run("tv", crop, all_of_it)
    assert any("no limb" in doubt or "uncertain" in doubt for doubt in inner.cautions)


@pytest.mark.parametrize("method", UNCALIBRATED)
def test_through_the_common_door_of_the_lights_told_only_the_strength_is_read(method):
    """Normals, albedo and lights, whatever the directions that are given."""
    (normals, mask), color, rng = dome(64, radius=0.44, rim=0.26), [0.5, 0.3, 0.2], np.random.default_rng(20_020)
    truth = lights_along(even_cap(30, 53), rng.uniform(0.5, 1.5, (30, 3))).normalised()
    told = replace(truth, directions=unit(rng.normal(size=(30, 3)) + [0, 0, 1]))
    frames = as_floats(truth, matte(truth, normals, normals, color))
    found = solve(method, frames, told, Camera(64, 64, 100.0, 100.0, 32, 32), mask)
    assert angular_error_deg(found.normals, normals)[mask].mean() < 0.5
    np.testing.assert_allclose(np.median(found.albedo[mask], 0), color, rtol=0.02)
    assert angular_error_deg(found.lights.directions, truth.directions).max() < 1
    np.testing.assert_allclose(found.lights.intensities, truth.intensities, rtol=0.03)
    assert np.nanmedian(found.sigma_deg) < 0.5
    assert not found.warnings
