"""A cell's rows: errors against the truth, failures said, albedo in its own unit."""

from dataclasses import replace

import pytest

from experiments.recipe import Cell, Recipe
from experiments.stagings import SOLVERS
from experiments.sweeps.cell import run_cell
from twin.engines.variant import SLOW, pick_variant

pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here"),
]
CELL = Cell("ambient", 0, 0.0, Recipe(side=64, count=16), tuple(SOLVERS))


@pytest.fixture(scope="module")
def found():
    return run_cell(CELL)


def test_every_method_and_profile_has_a_row(found):
    names = [(row["solver"], row["profile"]) for row in found["rows"]]
    assert names == [(method, profile) for method in SOLVERS for profile in ("default", "seed")]
    assert [row["status"] for row in found["rows"]] == ["ok"] * 14
    for row in found["rows"]:
        assert row["min_deg"] <= row["median_deg"] <= row["max_deg"]
        assert 0 <= row["unanswered"] < 0.05


def test_least_squares_finds_a_matte_pear(found):
    row = found["rows"][0]
    assert row["solver"] == "ls"
    assert row["median_deg"] < 0.1
    assert row["albedo_error_percent"] < 2


def test_the_same_cell_gives_the_same_rows(found):
    assert run_cell(CELL)["rows"] == found["rows"]


@pytest.mark.full
def test_threads_that_were_there_before_change_no_byte_of_the_photographs():
    """Dr.Jit's threads add up a pixel's samples in the order in which they come: with two of them no run is another."""
    import drjit

    from experiments.photographs import _render

    # Steep: nearly every pixel takes many samples.
    recipe = Recipe(shape="waves", relief=7.0, side=64, count=24)
    cell, before, images = Cell("shadow", 7, 7.0, recipe, ("ls",), ("default",)), drjit.thread_count(), []
    try:
        for threads in (4, 1, 3):
            drjit.set_thread_count(threads)
            _render.cache_clear()
            run_cell(cell)
            images.append(_render(recipe.scene).images.tobytes())
            assert _render.cache_info().misses == 1
            assert drjit.thread_count() == threads, "it is set back"
    finally:
        drjit.set_thread_count(before)
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
