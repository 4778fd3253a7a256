"""The catalogue's names are stable and speak; near, hand-held and grouped scenes are what their recipes say."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from experiments.catalogue import (
    DECIMALS,
    FAMILIES,
    HAND_HELD,
    NEAR_MM,
    benchmark_names,
    catalogue,
    chosen,
    first_names,
    wanted,
)
from experiments.scenes import DISTANCES, POWER_SPREAD, dataset_scene
from experiments.solids import FIELDS
from experiments.stagings import OBJECTS, ONE_FACTOR
from scene.errors import SceneError

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
    assert {each.family for each in KNOWN.values()} == set(FAMILIES) - {"added"}


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
