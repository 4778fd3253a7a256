"""A cell: its photographs keep the laws that their recipe names; its rows are errors against the truth."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from experiments.photographs import photograph
from experiments.recipe import Cell, Recipe
from experiments.shapes import SHAPES
from experiments.solids import FIELDS, slope, solid
from experiments.stagings import SOLVERS
from experiments.sweeps.cell import run_cell
from scene.normals import angular_error_deg
from tests.twin.twin_scenes import NEEDS_LLVM
from twin.description.object_mesh import smooth

pytestmark = [pytest.mark.render, NEEDS_LLVM]
CELL = Cell("ambient", 0, 0.0, Recipe(side=48, count=16), tuple(SOLVERS))


def test_every_method_and_profile_has_a_row_and_the_same_again():
    rows = run_cell(CELL)["rows"]
    names = [(row["solver"], row["profile"]) for row in rows]
    assert names == [(method, profile) for method in SOLVERS for profile in ("default", "seed")]
    assert [row["status"] for row in rows] == ["ok"] * 14
    for row in rows:
        assert row["min_deg"] <= row["median_deg"] <= row["max_deg"]
        assert 0 <= row["unanswered"] < 0.05
    assert rows[0]["solver"] == "ls"
    assert rows[0]["median_deg"] < 0.1, "the pear is matte"
    assert rows[0]["albedo_error_percent"] < 2
    assert run_cell(CELL)["rows"] == rows


@pytest.mark.full
def test_threads_that_were_there_before_change_no_byte_of_the_photographs(set_threads):
    """Dr.Jit's threads add up a pixel's samples in the order in which they come: with two of them no run is another."""
    import drjit

    from experiments.photographs import _render

    # Steep: nearly every pixel takes many samples.
    recipe = Recipe(shape="waves", relief=7.0, side=64, count=24)
    cell, images = Cell("shadow", 7, 7.0, recipe, ("ls",), ("default",)), []
    for threads in (4, 1, 3):
        set_threads(threads)
        _render.cache_clear()
        run_cell(cell)
        images.append(_render(recipe.scene)[0].tobytes())
        assert _render.cache_info().misses == 1
        assert drjit.thread_count() == threads, "it is set back"
    assert images[0] == images[1] == images[2]


def test_who_fails_says_why_and_the_others_go_on():
    few = replace(CELL, recipe=replace(CELL.recipe, images=3, seed=10004), profiles=("default",))
    rows = {row["solver"]: row for row in run_cell(few)["rows"]}
    assert "no answer: uncalibrated methods: found 3 frames" in rows["ldr"]["status"]
    assert rows["ls"]["status"] == "ok"
    assert "mean_deg" not in rows["ldr"]


def test_a_fault_of_ours_is_not_the_methods_answer(monkeypatch):
    from experiments.sweeps import cell

    def divide(*_, **__):
        raise ZeroDivisionError("by the test")

    monkeypatch.setattr(cell, "solve", divide)
    (row,) = run_cell(replace(CELL, methods=("ls",), profiles=("default",)))["rows"]
    assert row["status"] == "failed: ZeroDivisionError: by the test"


def test_a_scene_that_cannot_be_rendered_fails_in_every_row():
    wrong = replace(CELL, recipe=replace(CELL.recipe, material="cheese"))
    rows = run_cell(wrong)["rows"]
    assert len(rows) == 14
    assert {row["status"] for row in rows} == {"failed: no photographs: KeyError: 'cheese'"}


PLAIN = Recipe(side=64, count=8)


def lambert(photographs):
    """What each pixel is in full light, (F, P), and where it surely is in it: no limb near, no grazing light."""
    p = photographs
    cosine = np.einsum("pk,fk->fp", p.normals[p.mask], p.lights.directions)
    inner = p.mask & np.roll(p.mask, 1, 0) & np.roll(p.mask, -1, 0) & np.roll(p.mask, 1, 1) & np.roll(p.mask, -1, 1)
    return cosine * p.albedo[p.mask][:, 1], (cosine > 0.3) & inner[p.mask]


# The pear last: the tests after it take its rendering, which is kept.
@pytest.mark.parametrize("shape", [{"shape": "blob"}, {"shape": "waves", "relief": 0.5}, {"shape": "pear"}])
def test_a_matte_surface_is_albedo_times_cosine(shape):
    p = photograph(replace(PLAIN, **shape))
    expected, sure = lambert(p)
    error = np.abs(p.frames.read()[:, p.mask][..., 1] - expected)[sure]
    assert sure.mean() > 0.4
    assert np.quantile(error, 0.95) < 0.01
    # A mirrored light is nowhere near.
    wrong = np.einsum("pk,fk->fp", p.normals[p.mask], p.lights.directions * [1, -1, 1]) * p.albedo[p.mask][:, 1]
    assert np.median(np.abs(p.frames.read()[:, p.mask][..., 1] - wrong)[sure]) > 0.01


def test_the_frames_taken_keep_their_lights():
    some = photograph(replace(PLAIN, images=4, seed=10001))
    assert len(some.frames) == len(some.lights) == 4
    assert some.frames.names == some.lights.names
    expected, sure = lambert(some)
    assert np.quantile(np.abs(some.frames.read()[:, some.mask][..., 1] - expected)[sure], 0.95) < 0.01
    others = {photograph(replace(PLAIN, images=4, seed=seed)).lights.names for seed in range(10001, 10007)}
    assert len(others) > 3


def test_ambient_light_adds_albedo_and_the_exposure_holds_it():
    dark, lit = photograph(PLAIN), photograph(replace(PLAIN, ambient=1.0))
    # Exposure: albedo is in the frames' own unit. 0.5 + 0.5 would be clipped.
    factor = lit.albedo[lit.mask][0, 1] / 0.5
    assert 0.8 < factor < 0.99
    added = (lit.frames.read() / factor - dark.frames.read())[:, lit.mask][..., 1]
    # The pear all but sees the whole surrounding; what its neck hides is lost.
    assert np.median(added) == pytest.approx(0.5, rel=0.02)
    assert added.max() < 0.53


def test_photons_scatter_as_poisson_has_it():
    clean, level = photograph(PLAIN), 0.05
    noisy = [
        photograph(replace(PLAIN, noise=level, seed=seed)).frames.read()[:, clean.mask] for seed in range(10001, 10013)
    ]
    value, scatter = clean.frames.read()[:, clean.mask], np.var(noisy, axis=0, ddof=1)
    for low, high in ((0.1, 0.2), (0.4, 0.5)):
        here = (value > low) & (value < high)
        assert scatter[here].mean() == pytest.approx(level**2 * value[here].mean(), rel=0.05)
    assert np.abs(np.mean(noisy) - value.mean()) < 1e-3
    again = photograph(replace(PLAIN, noise=level, seed=10001)).frames.read()[:, clean.mask]
    assert np.array_equal(again, noisy[0])


def test_told_lights_are_as_far_off_as_the_recipe_says():
    one = replace(PLAIN, shape="cone", count=100, side=16, seed=10001)
    plain, off = photograph(one), photograph(replace(one, directions_off_deg=6.0, intensities_off=0.2))
    assert np.array_equal(off.frames.read(), plain.frames.read()), "the light itself is the same"
    angle = angular_error_deg(off.lights.directions, plain.lights.directions)
    assert np.sqrt(np.mean(angle**2)) == pytest.approx(6.0, rel=0.1)
    assert np.std(np.log(off.lights.intensities[:, 0])) == pytest.approx(0.2, rel=0.1)
    # Strengths of one draw lie on one line; other draws do not.
    twice = angular_error_deg(
        photograph(replace(one, directions_off_deg=12.0)).lights.directions, plain.lights.directions
    )
    assert np.allclose(twice, 2 * angle)
    other = photograph(replace(one, directions_off_deg=6.0, seed=10002)).lights.directions
    assert np.median(angular_error_deg(other, off.lights.directions)) > 1


def test_a_hollow_is_brighter_than_its_direct_light():
    hollow = replace(PLAIN, shape="cone", relief=1.0, polar_deg=15.0, reflectance=0.8)
    plain, deep = photograph(hollow), photograph(replace(hollow, depth=8))
    factor = deep.albedo[deep.mask][0, 1] / plain.albedo[plain.mask][0, 1]
    ratio = deep.frames.read()[:, deep.mask].mean() / plain.frames.read()[:, plain.mask].mean() / factor
    # A cone as deep as wide: each point sees (1 - 1/sqrt(2)) of white wall, so at least 0.29 * 0.8 comes back.
    assert 1.2 < ratio < 1 / (1 - 0.8 * (1 - 1 / np.sqrt(2))) + 0.15


@pytest.mark.full
def test_what_comes_out_of_a_medium_is_photographed_with_noise():
    """Its rendering, a difference, lies below zero here and there: no photon is counted for that."""
    wax = replace(PLAIN, side=48, material="specular_subsurface", depth=4, noise=0.04)
    noisy, clean = photograph(wax), photograph(replace(wax, noise=0.0))
    codes = noisy.frames.read()[:, noisy.mask]
    assert codes.min() >= -1e-4
    assert codes.mean() == pytest.approx(clean.frames.read()[:, clean.mask].mean(), rel=0.01)


COSTLY = {
    "dodecahedron", "bear", "gyroid", "sponge", "octahedron", "twist", "jack", "tangle", "cushion", "clover",
}  # fmt: skip
"""Solids whose formulas take long. The derivatives of all are short tests."""


def some(names):
    return [pytest.param(one, marks=[pytest.mark.full] if one in COSTLY else []) for one in names]


@pytest.mark.parametrize("name", some(SHAPES))
def test_shapes_stay_within_their_radius_and_face_out(name):
    mesh = SHAPES[name](0.7)
    corners = mesh.vertices[mesh.faces]
    assert np.abs(mesh.vertices[:, :2]).max() <= 1 + 1e-9
    volume = np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    if name in ("pear", "blob", "knot", *FIELDS):
        assert volume > 0.1
        assert trimesh.Trimesh(mesh.vertices, mesh.faces).is_watertight, "closed: every edge has two faces"


def test_waves_are_the_formula():
    mesh = SHAPES["waves"](2.0)
    x, y = 2 * np.pi * mesh.vertices[:, 0], 2 * np.pi * mesh.vertices[:, 1]
    np.testing.assert_allclose(2 * np.pi * mesh.vertices[:, 2], 2 * np.sin(x) * np.sin(y), atol=1e-9)
    slope = np.stack([-2 * np.cos(x) * np.sin(y), -2 * np.sin(x) * np.cos(y), 1 + 0 * x], -1)
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    normals = mesh.normals / np.linalg.norm(mesh.normals, axis=1, keepdims=True)
    inner = np.abs(mesh.vertices[:, :2]).max(1) < 0.99
    assert np.abs(normals - slope)[inner].max() < 0.01


@pytest.mark.parametrize("name", some(FIELDS))
def test_a_solid_has_its_formula_s_normals_and_no_seam(name):
    """Exact normals and those that a scan of the same corners would give differ little, and in sense nowhere."""
    mesh = solid(name)
    scanned = smooth(mesh).normals
    error = angular_error_deg(scanned, mesh.normals)
    assert np.median(error) < 1.6
    assert np.quantile(error, 0.95) < 7
    assert np.ptp(mesh.texcoords[mesh.faces], axis=1).max() < 0.03


def test_a_slope_is_the_derivative_to_rounding():
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    x, y, z = points.T
    # Of the torus, by hand: f = (p . p + a)^2 - 4 R^2 (x^2 + y^2).
    around = (points**2).sum(1) + 0.7**2 - 0.35**2
    by_hand = 4 * around[:, None] * points - 8 * 0.7**2 * np.stack([x, y, 0 * z], -1)
    np.testing.assert_allclose(slope(FIELDS["torus"], points), by_hand, rtol=0, atol=1e-13)
    for field in FIELDS.values():
        step = 1e-6 * np.eye(3)[:, :, None]
        numeric = np.stack([(field(*(points.T + one)) - field(*(points.T - one))) / 2e-6 for one in step], -1)
        np.testing.assert_allclose(slope(field, points), numeric, rtol=1e-4, atol=1e-4 * np.abs(numeric).max())
