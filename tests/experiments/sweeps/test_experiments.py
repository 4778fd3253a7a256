"""The nine experiments: what is varied, how often, and under which name a cell is kept."""

import csv
import shutil
import subprocess
import sys
from dataclasses import fields, replace

import pytest

from benchmarks.benchmark_findings import benchmark_statistics
from experiments import recipe
from experiments.recipe import Recipe
from experiments.stagings import FITTED, NOISE, ONE_FACTOR, TOLD_WRONGLY, benchmark, experiments_of
from scene import current
from scene.errors import SceneError


def differing(recipes):
    """Return the names of the fields in which recipes differ."""
    return {f.name for f in fields(Recipe) if len({getattr(recipe, f.name) for recipe in recipes}) > 1}


def test_each_experiment_varies_one_factor_over_eight_levels():
    assert len(ONE_FACTOR) == 9
    for one in ONE_FACTOR.values():
        cells = list(one.cells())
        assert len(set(one.levels)) == len(one.levels) >= 8
        assert len(one.shapes) > 1
        has_chance = any(cell.recipe.noise or cell.recipe.images for cell in cells)
        assert one.seeds >= 5 if has_chance else one.seeds == 1
        for shape in one.shapes:
            recipes = [cell.recipe for cell in cells if cell.recipe.shape == shape and cell.recipe.seed == 0]
            assert differing(recipes) == {one.vary}


def test_the_benchmark_s_staging_is_its_text_and_its_lsq_column():
    staged, theirs = benchmark(), benchmark_statistics()
    assert list(staged) == list(ONE_FACTOR)
    with FITTED.open(newline="") as file:
        fitted = list(csv.DictReader(file))
    (noise,) = (float(row["level"]) for row in fitted if row["experiment"] == NOISE)
    for name, one in staged.items():
        recipes = [cell.recipe for cell in one.cells() if cell.recipe.seed == 0]
        assert differing(recipes) == {one.vary}
        assert {recipe.depth for recipe in recipes} == {32}, "light goes on from surface to surface everywhere"
        assert one.base.distribution == "beckmann" or one.base.material == "diffuse"
        assert one.base.noise == noise
        assert (one.label, one.vary) == (ONE_FACTOR[name].label, ONE_FACTOR[name].vary)
        assert one.shapes == ONE_FACTOR[name].shapes[:1]
        rows = [row for row in fitted if row["experiment"] == name]
        if not rows:
            assert name in ("material", "roughness"), "the text has their levels"
            assert one.levels == ONE_FACTOR[name].levels
            continue
        assert list(one.levels) == sorted(set(one.levels))
        assert {(float(row["lsq_min_deg"]), float(row["lsq_max_deg"])) for row in rows} == {
            (theirs[name, "ls"]["min"], theirs[name, "ls"]["max"])
        }
        reached = [float(row["ls_deg"]) for row in rows if row["ls_deg"]]
        assert reached == sorted(reached, reverse=name == "images")
        assert max(reached) < theirs[name, "ls"]["max"] + 0.1
    assert staged["ring"].base.count == 24
    assert len(staged["ring"].levels) == 9


def test_names_tell_cells_apart():
    cells = [cell for one in ONE_FACTOR.values() for cell in one.cells()]
    keys = [cell.key for cell in cells]
    assert len(set(keys)) == len(keys)
    cell = cells[0]
    others = {
        "shape": "knot", "relief": 2.0, "material": "specular", "reflectance": 0.4, "roughness": 0.3,
        "specularity": 0.5, "lights": "ring", "count": 9, "polar_deg": 50.0, "depth": 4, "ambient": 0.3, "noise": 0.2,
        "images": 5, "directions_off_deg": 1.0, "intensities_off": 0.1, "side": 99, "seed": 10003,
        "distribution": "beckmann",
    }  # fmt: skip
    assert set(others) == {f.name for f in fields(Recipe)}
    changed = [replace(cell, recipe=replace(cell.recipe, **{name: value})).key for name, value in others.items()]
    assert len({cell.key, *changed, replace(cell, methods=("ls",)).key}) == len(others) + 2
    assert replace(cell).key == cell.key


def test_names_change_with_the_code_that_makes_the_rows(tmp_path, monkeypatch):
    for room in current.ROOMS:
        shutil.copytree(current.ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(current, "ROOT", tmp_path)

    def hash_with(name):
        path = tmp_path / name
        path.write_text(path.read_text() + "#")
        return current.code_fingerprint.__wrapped__(recipe.ROOM)

    before = hash_with("rgbn/cli.py")
    assert hash_with("rgbn/cli.py") == hash_with("studio/studio_command.py") == before
    seen = {before}
    for name in ("solve/pixelwise/ls.py", "twin/engines/many.py", "scene/frames.py", "experiments/shapes.py"):
        changed = hash_with(name)
        assert changed not in seen
        seen.add(changed)


def test_what_is_asked_for():
    assert [one.name for one in experiments_of("all")] == [*ONE_FACTOR, *TOLD_WRONGLY]
    assert [one.name for one in experiments_of("all", "benchmark")] == [*ONE_FACTOR]
    assert [one.name for one in experiments_of("ring, noise,ring")] == ["ring", "noise"]
    with pytest.raises(SceneError, match="rings is unknown; there are ambient"):
        experiments_of("rings")


def test_other_shapes_are_taken_where_they_can_be():
    own = experiments_of("ring,shadow")
    ring, shadow = experiments_of("ring,shadow", shape="ridges, cone")
    assert (ring.shapes, shadow.shapes) == (("ridges", "cone"),) * 2
    assert replace(ring, shapes=own[0].shapes) == own[0]
    assert {cell.recipe.shape for cell in experiments_of("noise", "benchmark", "gyroid,bear")[0].cells()} == {
        "gyroid", "bear"
    }  # fmt: skip
    with pytest.raises(SceneError, match=r"shadow cannot be run on bear. It takes cone.*varies their relief"):
        experiments_of("ring,shadow", shape="bear")
    with pytest.raises(SceneError, match=r"ring cannot be run on pare. It takes pear, blob"):
        experiments_of("ring", shape="pare")


def test_cells_are_named_without_heavy_libraries():
    """A rerun with nothing changed has no more to do than this."""
    code = (
        "import sys; from experiments.sweeps.sweep import experiments_of, cell_path; from pathlib import Path; "
        "print(len([cell_path(Path(), c) for one in experiments_of('all') for c in one.cells()])); "
        "print(' '.join({m.split('.')[0] for m in sys.modules}))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    count, modules = run.stdout.splitlines()
    assert int(count) > 400
    assert not {"mitsuba", "drjit", "open3d", "numba", "scipy", "cv2", "pyarrow", "dask"} & set(modules.split())
