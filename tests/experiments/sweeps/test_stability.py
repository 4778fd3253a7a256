"""Where methods break and how: kinds of error that the test makes itself, thresholds that it knows."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compare.statistics.ambiguity import MIRROR as FLIP
from compare.statistics.ambiguity import error_kinds
from experiments.sweeps import perturbation
from experiments.sweeps.atlas import atlas
from experiments.sweeps.perturbation import (
    BREAKS_DEG,
    PERTURBATIONS,
    STEPS,
    breaking_point,
    perturbation_cells,
    perturbed,
)
from experiments.sweeps.stability import candour, kind_of, stability, strips, tolerances
from experiments.sweeps.sweep_statistics import speed_points
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit


def surface(seed=10001, count=3000):
    generator = np.random.default_rng(seed)
    return unit(np.concatenate([generator.normal(0, 0.6, (count, 2)), np.ones((count, 1))], 1))


RELIEF = np.linalg.inv([[1, 0, 0], [0, 1, 0], [0.4, -0.3, 0.5]])
TURN = Rotation.from_euler("xy", [17, 13], degrees=True).as_matrix().T


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("flip_deg", lambda n: n * FLIP),
        ("relief_deg", lambda n: unit(n @ RELIEF)),
        ("relief_deg", lambda n: unit(n @ RELIEF) * FLIP),
        ("turn_deg", lambda n: n @ TURN),
    ],
)
def test_what_was_done_to_the_normals_is_undone(name, spoil):
    truth = surface()
    found = spoil(truth)
    # A tenth is no part of it, and a few are unknown.
    found[::10] = surface(10002)[::10]
    found[5:20] = np.nan
    kinds = error_kinds(found, truth)
    assert np.nanmedian(angular_error_deg(found, truth)) > 12
    assert kinds[name] < 0.3
    assert kinds["relief_deg"] <= kinds["flip_deg"]
    # A flip is half a turn about the line of sight.
    for other in {"flip_deg", "turn_deg"} - {name, "turn_deg" if name == "flip_deg" else name}:
        assert kinds[other] > 8


def test_the_lean_has_a_sign():
    truth = surface()
    flat, steep = (error_kinds(unit(truth * [f, f, 1]), truth) for f in (0.5, 2.0))
    assert flat["tilt_deg"] < -8
    assert steep["tilt_deg"] > 8
    assert np.isnan(error_kinds(np.full((4, 3), np.nan), truth[:4])["tilt_deg"])


def row(level=0, solver="ls", *, experiment="ambient", median=1.0, doubts="", seed=0, **more):
    """A row as a cell has it; by default good."""
    kinds = {"flip_deg": median, "relief_deg": median, "turn_deg": median, "tilt_deg": 0.0, "tilt_spread_deg": 1.0}
    key = {"experiment": experiment, "level": level, "value": float(level), "label": f"v{level}", "shape": "pear"}
    key |= {"seed": seed, "solver": solver, "profile": "default"}
    return {**key, "status": "ok", "median_deg": median, "unanswered": 0.0, "doubts": doubts, **kinds, **more}


def test_a_broken_result_has_the_kind_that_explains_it():
    assert kind_of(row(median=40.0, flip_deg=3.0, relief_deg=3.0)) == "flipped"
    assert kind_of(row(solver="tv", median=40.0, relief_deg=3.0)) == "relief"
    assert kind_of(row(median=40.0, relief_deg=3.0, tilt_deg=-30.0)) == "too flat"
    assert kind_of(row(median=40.0, tilt_deg=30.0)) == "too steep"
    assert kind_of(row(median=40.0, turn_deg=2.0)) == "turned"
    assert kind_of(row(median=40.0)) == "scattered"
    assert kind_of(row(median=1.0, unanswered=0.6)) == "no answer"
    assert kind_of({"status": "no answer: too few", "solver": "tv"}) == "no answer"


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ([1, 2, 3, 4], "holds"),
        ([1, 2, 11, 40], "from v2"),
        ([40, 11, 2, 1], "up to v1"),
        ([40, 1, 1, 12], "up to v0, from v3"),
        ([1, 12, 14, 1], "v1 to v2"),
        ([11, 12, 13, 14], "everywhere"),
    ],
)
def test_where_it_breaks_is_told_in_words(errors, words):
    (strip,) = strips([row(level, median=float(error)) for level, error in enumerate(errors)])
    assert strip.breaks == words


def test_half_of_the_draws_break_a_level_and_who_refuses_is_one_of_them():
    refused = {**row(seed=2), "status": "no answer: too few"}
    (level,) = strips([row(median=1.0), row(median=50.0, seed=1, doubts="noise"), refused, row(seed=3)])[0].levels
    assert (level.cells, level.broken_cells, level.is_broken, level.foretold) == (4, 2, True, True)
    (level,) = strips([row(), row(median=50.0, seed=1), row(seed=2)])[0].levels
    assert (level.broken_cells, level.is_broken, level.foretold) == (1, False, False)
    (level,) = strips([refused, {**refused, "seed": 3}])[0].levels
    assert (level.median_deg, level.how) == (None, "no answer")


def test_a_fault_of_ours_is_neither_a_broken_method_nor_one_that_doubted_itself():
    failed = {**row(seed=2), "status": "failed: ZeroDivisionError"}
    (level,) = strips([row(median=50.0), failed, {**failed, "seed": 3}, row(seed=4), row(seed=5)])[0].levels
    assert (level.cells, level.broken_cells, level.is_broken, level.foretold) == (3, 1, False, False)
    (one,) = candour([row(median=50.0), failed, row(seed=4)])
    assert (one["broken"], one["broken_doubted"], one["whole"], one["failed"]) == (1, 0, 1, 1)


def test_doubts_are_counted_where_they_are_right_and_where_not():
    rows = [row(median=20.0, doubts="x"), row(1, median=20.0), row(2, doubts="x"), row(3), row(4)]
    (one,) = candour(rows)
    assert (one["broken"], one["broken_doubted"], one["whole"], one["whole_doubted"]) == (2, 1, 3, 1)


def stack(lights=24, side=24):
    """Matte photographs of a cap by the formula, for what only wants frames, lights and truth."""
    generator = np.random.default_rng(10003)
    across = np.linspace(-0.7, 0.7, side)
    x, y = np.meshgrid(across, -across)
    normals = unit(np.stack([x, y, np.sqrt(1 - x**2 - y**2)], -1)).astype(np.float32)
    toward = unit(np.concatenate([generator.normal(0, 0.4, (lights, 2)), np.ones((lights, 1))], 1))
    images = 0.5 * np.maximum(np.einsum("hwk,fk->fhw", normals, toward), 0)[..., None] * np.ones(3)
    names = tuple(f"f{i}" for i in range(lights))
    albedo = np.full((side, side, 3), 0.5, np.float32)
    given = Lights(names, toward, np.ones((lights, 3)))
    frames = Frames.from_linear(names, images)
    return SimpleNamespace(
        frames=frames, lights=given, mask=np.ones((side, side), bool), normals=normals, albedo=albedo, camera=None
    )


def test_perturbations_are_as_strong_as_they_say():
    made = stack(lights=400, side=4)
    off = angular_error_deg(perturbed(made, "light directions off", 6.0, 10001)[1].directions, made.lights.directions)
    assert np.sqrt(np.mean(off**2)) == pytest.approx(6.0, rel=0.1)
    spread = np.std(np.log(perturbed(made, "intensities off", 20.0, 10001)[1].intensities[:, 0]))
    assert spread == pytest.approx(0.2, rel=0.1)
    added = 1.25 * perturbed(made, "ambient left in", 25.0, 10001)[0].read() - made.frames.read()
    assert np.allclose(added, 0.25 * 0.5, atol=1e-4)
    # Strengths of one draw lie on one line, so that a bisection can walk on it; other draws do not.
    twice = angular_error_deg(
        perturbed(made, "light directions off", 12.0, 10001)[1].directions, made.lights.directions
    )
    assert np.allclose(twice, 2 * off)
    other = perturbed(made, "light directions off", 6.0, 10002)[1].directions
    assert np.median(angular_error_deg(other, made.lights.directions) / off) != pytest.approx(1, rel=1e-3)


@dataclass
class Broken:
    """An estimate whose every normal is off by the error asked for."""

    normals: np.ndarray


@pytest.mark.parametrize(("threshold", "expected"), [(7.3, 7.3), (-1.0, 0.0), (1e9, None)])
def test_bisection_finds_the_strength_that_breaks(monkeypatch, threshold, expected):
    made = stack()
    (cell,) = [c for c in perturbation_cells(("ls",), quick=True) if c.experiment == "light directions off"]
    one = PERTURBATIONS[cell.experiment]

    def off(lights):
        return np.median(angular_error_deg(lights.directions, made.lights.directions))

    of_one_degree = off(perturbed(made, one.name, 1.0, cell.recipe.seed)[1])

    def solve(method, frames, lights, camera, mask, **_):
        is_off = off(lights) >= threshold * of_one_degree
        return Broken(made.normals * FLIP if is_off else made.normals)

    monkeypatch.setattr(perturbation, "solve", solve)
    strength, estimate = breaking_point(made, cell, "ls", "default", None)
    assert strength == (expected and pytest.approx(expected, rel=(one.most / one.least) ** (0.5**STEPS) - 1))
    is_broken = np.median(angular_error_deg(estimate.normals, made.normals)) > BREAKS_DEG
    assert is_broken == (expected is not None)


@pytest.mark.parametrize("fault", [SceneError("too few frames"), ZeroDivisionError()])
def test_a_refusal_breaks_a_method_and_a_fault_of_ours_does_not(monkeypatch, fault):
    (cell,) = [c for c in perturbation_cells(("ls",), quick=True) if c.experiment == "intensities off"]

    def solve(*_, **__):
        raise fault

    monkeypatch.setattr(perturbation, "solve", solve)
    if isinstance(fault, SceneError):
        assert breaking_point(stack(), cell, "ls", "default", None) == (0.0, None)
    else:
        with pytest.raises(ZeroDivisionError):
            breaking_point(stack(), cell, "ls", "default", None)


def test_a_real_method_breaks_by_wrong_lights_and_not_by_a_little():
    made = stack()
    (cell,) = [c for c in perturbation_cells(("ls",), quick=True) if c.experiment == "light directions off"]
    from scene.camera import Camera

    made.camera = Camera(24, 24, 1000.0, 1000.0, 11.5, 11.5)
    strength, estimate = breaking_point(made, cell, "ls", "default", None)
    assert 10 < strength < 64
    frames, lights = perturbed(made, cell.experiment, strength / 1.5, cell.recipe.seed)
    from solve.solve import solve

    found = solve("ls", frames, lights, made.camera, made.mask)
    assert np.nanmedian(angular_error_deg(found.normals, made.normals)) < BREAKS_DEG
    assert np.nanmedian(angular_error_deg(estimate.normals, made.normals)) > BREAKS_DEG


def borne(breaks_at, seed=0, **more):
    return {**row(experiment="intensities off", seed=seed, median=20.0, **more), "breaks_at": breaks_at}


def test_tolerances_are_medians_over_draws():
    (one,) = tolerances([borne(4.0), borne(9.0, 1, doubts="x"), borne(6.0, 2)])
    assert (one.breaks_at, one.low, one.high, one.draws, one.foretold) == (6.0, 6.0, 9.0, 3, False)
    (one,) = tolerances([borne(4.0), borne(None, 1), borne(None, 2)])
    assert (one.breaks_at, one.how, one.foretold) == (None, None, None)
    # As the table has it: a column that is empty there.
    told = {**row(experiment="light directions off", solver="tv"), "status": "not told", "breaks_at": None}
    (one,) = tolerances([told])
    assert (one.breaks_at, one.draws, one.failed) == (None, 0, 0)


def test_a_draw_that_failed_does_not_count_as_one_that_held():
    failed = {**row(experiment="intensities off"), "status": "failed: ZeroDivisionError", "breaks_at": None}
    (one,) = tolerances([borne(4.0), failed, failed])
    assert (one.breaks_at, one.draws, one.failed) == (4.0, 1, 2)
    silent = {**failed, "status": "no answer: no pixel has a normal", "breaks_at": 9.0, "unanswered": 1.0}
    (one,) = tolerances([borne(4.0), silent, failed])
    assert (one.high, one.draws, one.failed) == (9.0, 2, 1)
    (none,) = tolerances([failed])
    svg = atlas(strips([row(0)]), [none])
    assert "failed" in svg
    assert "over 128" not in svg


def test_the_atlas_shows_every_broken_level_and_who_had_said_so():
    rows = [row(0), row(1, median=7.0), row(2, median=30.0, tilt_deg=-20.0), row(3, median=50.0, doubts="hm")]
    made = strips(rows)
    svg = atlas(made, tolerances([borne(6.0)]))
    assert svg.count("<title>") == 4
    assert "median 30.0°, broken in 1 of 1 cells, too flat, not doubted by the method" in svg
    assert "median 50.0°, broken in 1 of 1 cells, scattered, doubted by the method itself" in svg
    assert ">from v2<" in svg
    assert ">6 %<" in svg
    found = stability(rows, [borne(6.0)])
    assert found["experiments"][0]["breaks"] == "from v2"
    assert found["perturbations"][0]["unit"] == "%"


def test_speed_is_a_million_pixels_of_one_frame():
    rows = [row(seed=i, pixels=4000, frames=8, median=2.0 + i) | {"unanswered": 0.5} for i in range(3)]
    times = [{**one, "seconds": 0.2 * (i + 1)} for i, one in enumerate(rows)]
    (point,) = speed_points(rows, times, ["ambient"])
    assert (point.seconds, point.median_deg) == (pytest.approx(0.4 / 0.008 / 8), 3.0)
    assert speed_points(rows, times, ["noise"]) == []
    assert speed_points([replace_status(one) for one in rows], times, ["ambient"]) == []


def replace_status(one):
    return {**one, "status": "failed: by the test"}


def test_cells_of_perturbations_have_names_of_their_own():
    cells = list(perturbation_cells(("ls", "tv")))
    assert len({cell.key for cell in cells}) == len(cells) == 3 * 5
    assert {cell.experiment for cell in cells} == set(PERTURBATIONS)
    assert len({replace(cell.recipe, seed=0) for cell in cells}) == 1
