"""The nine experiments: what is varied, how often, under which name a cell is kept; the catalogue made of them."""

import csv
import json
import re
import shutil
import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest

from benchmarks.benchmark_findings import benchmark_statistics
from experiments import recipe
from experiments.catalogue import (
    DECIMALS,
    HAND_HELD,
    NEAR_MM,
    benchmark_names,
    catalogue,
    chosen,
    first_names,
    wanted,
)
from experiments.recipe import Recipe
from experiments.scenes import DISTANCES, POWER_SPREAD, dataset_scene
from experiments.solids import FIELDS
from experiments.stagings import FITTED, NOISE, OBJECTS, ONE_FACTOR, TOLD_WRONGLY, benchmark, experiments_of
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
        quick = list(one.cells(quick=True))
        assert {cell.recipe.side for cell in quick} == {96}, "a quick look is small, and has both ends"
        assert (len(quick), quick[0].value) == (4, one.levels[0])
        assert quick[-1].value == one.levels[-1] or isinstance(one.levels[-1], str)
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


KNOWN = catalogue()


def test_every_level_of_every_experiment_is_there_once():
    assert len(KNOWN) >= 93
    for one in ONE_FACTOR.values():
        members = [each for each in KNOWN.values() if each.family == one.name]
        found = [(each.recipe.shape, getattr(each.recipe, one.vary)) for each in members]
        whole = {(shape, value) for shape in one.shapes for value in one.levels}
        assert len(found) == len(set(found))
        assert whole <= set(found)
        # Beyond them three solids, each once, where the shape is not what the experiment is about.
        assert len(found) - len(whole) == (3 if one.shapes == OBJECTS else 0)


def test_the_benchmarks_list_has_93_distinct_stacks():
    """By all that makes a stack but its names; every level of the nine experiments on their first shape is of it."""
    names = benchmark_names()
    stacks = {replace(KNOWN[name], name="", family="", text="") for name in names}
    assert len(names) == len(set(names)) == len(stacks) == 93
    for one in ONE_FACTOR.values():
        for cell in one.cells(methods=()):
            if cell.recipe.shape == one.shapes[0] and not cell.recipe.seed:
                assert cell.recipe in {KNOWN[name].recipe for name in names}
    assert {KNOWN[name].family for name in names} == set(ONE_FACTOR)
    assert {KNOWN[name].recipe.shape for name in names} == {"pear", "cone", "waves", *FIELDS}
    assert len(FIELDS) >= 20
    assert not any(KNOWN[name].near_mm or KNOWN[name].sensor or KNOWN[name].group for name in names)


def test_no_stack_has_two_names_unless_said():
    first = first_names()
    assert list(first) == list(KNOWN)
    own = set(first.values())
    assert len({replace(KNOWN[name], name="", family="", text="") for name in own}) == len(own)
    assert all(replace(KNOWN[name], name=of, family="", text="") == replace(KNOWN[of], family="", text="")
               for name, of in first.items())  # fmt: skip
    assert first["pear-roughness-0.10"] == first["pear-specularity-1.00"] == "pear-material-specular"
    # Asked for by either name it is made once.
    asked = wanted(["pear-roughness-0.10", "pear-specularity-1.00"], KNOWN, names_of_list := benchmark_names(), first)
    assert asked == {"pear-material-specular"}
    assert wanted(["benchmark"], KNOWN, names_of_list, first) == set(names_of_list)


def test_names_say_the_level_exactly():
    for name, each in KNOWN.items():
        assert re.fullmatch(r"[a-z]+(-[a-z0-9.]+)+", name)
        if each.family in DECIMALS:
            word = name.split("-", 2)[2]
            assert float(word) == getattr(each.recipe, ONE_FACTOR[each.family].vary)
    assert KNOWN["pear-roughness-0.30"].recipe.roughness == 0.3
    assert KNOWN["knot-ring-05"].recipe.polar_deg == 5.0
    assert KNOWN["pear-images-03"].recipe.images == 3
    assert KNOWN["pear-ambient-0.10"].sized(64).name == "pear-ambient-0.10-64px"
    assert KNOWN["pear-ambient-0.10"].sized(256) is KNOWN["pear-ambient-0.10"]


def test_patterns_choose_and_an_unknown_name_is_told():
    assert len(chosen(["pear-near-*", "knot-camera-canon"], list(KNOWN))) == len(NEAR_MM) + 1
    with pytest.raises(SceneError, match=r"pear-roughnes-0.30: there is none.*Did you mean pear-roughness-0.30"):
        chosen(["pear-roughnes-0.30"], list(KNOWN))


@pytest.mark.parametrize("distance", NEAR_MM)
def test_near_lights_stand_at_their_distance(distance):
    lights = dataset_scene(KNOWN[f"blob-near-{distance:04d}"]).lights
    away = lights.positions_mm - lights.reference_point_mm
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), distance)
    np.testing.assert_allclose(away / distance, lights.directions, atol=1e-12)


@pytest.mark.parametrize("count", HAND_HELD)
def test_flashes_by_hand_are_uneven_and_fall_off(count):
    lights = dataset_scene(KNOWN[f"knot-hand-{count:02d}"]).lights
    assert len(lights) == count
    away = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1) / 1000
    assert away.min() >= DISTANCES[0]
    assert away.max() <= DISTANCES[1]
    assert np.ptp(away) > 0.3
    power = lights.intensities[:, 0] * away**2
    # Without the fall-off what is left is the flash's own scatter, a few of its standard deviations.
    assert 0.3 * POWER_SPREAD < np.std(power / power.mean()) < 2 * POWER_SPREAD
    np.testing.assert_allclose(lights.intensities.mean(0), 1)


def test_a_group_has_three_objects_apart_and_of_their_materials():
    scene = dataset_scene(KNOWN["group-mixed"])
    boxes = []
    for one in scene.objects:
        points = one.placed.vertices
        boxes.append((points.min(0), points.max(0)))
        seen = scene.camera.project(points)
        assert seen.min() > 0
        assert seen.max() < scene.camera.width - 1
    assert len(boxes) == 3
    kinds = [type(scene.materials[one.material]).__name__ for one in scene.objects]
    assert kinds == ["Diffuse", "RoughPlastic", "Conductor"]


@pytest.mark.full
def test_the_list_at_the_command_line(tmp_path, rgbn_process):
    def lines(*words, verb="list"):
        done = rgbn_process("dataset", verb, "--shelf", tmp_path, *words)
        assert done.returncode == 0, done.stderr
        return done.stdout

    found = json.loads(lines("--json"))
    assert [one["name"] for one in found] == list(KNOWN)
    assert {one["state"] for one in found} == {""}
    text = lines("pear-roughness-*")
    assert "pear-roughness-0.30" in text
    assert text.strip().endswith("9 datasets and 2 other names; 9 of the benchmark's list; 0 on the shelf")
    assert sum(one["benchmark"] and not one["same_as"] for one in found) == 93
    lines("pear-roughness-0.30", "--side", "16", verb="make")
    text = lines("pear-roughness-*")
    assert text.strip().endswith("10 datasets and 2 other names; 9 of the benchmark's list; 1 on the shelf")
    assert {one["name"] for one in json.loads(lines("--json", "benchmark"))} >= set(benchmark_names())
