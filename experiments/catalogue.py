"""The catalogue: the named datasets, each a line; the benchmark's list; which names stand for one stack."""

import fnmatch
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache

from experiments.recipe import Cell, Dataset, Recipe
from experiments.solids import FIELDS
from experiments.stagings import OBJECTS, ONE_FACTOR, Experiment
from scene.errors import SceneError
from twin.camera.virtual_camera import Sensor

DECIMALS = {
    "ambient": 2, "interreflection": 1, "images": 0, "noise": 3, "ring": 0, "roughness": 2, "shadow": 2,
    "specularity": 2,
}  # fmt: skip
"""Of the levels in names: fixed, so that a name stays when levels are added."""
NEAR_MM = (250, 400, 700, 1500)
HAND_HELD = (8, 16, 32, 60)
GROUPS = ("matte", "plastic", "metal", "mixed")
GROUP_DEPTH = 4
SENSORS = {
    # Measured by `twin.camera.grain.sensor_like`: on three photographs of DiLiGenT's cat, whose colours are
    # interpolated already, and on the four planes of one RAW of a Canon EOS 550D, whose ISO nobody wrote down.
    "diligent": Sensor(full_well_e=18400, read_noise_e=13.2, cfa="none", neutral=(1.0, 1.0, 1.0)),
    "canon": Sensor(full_well_e=5470, read_noise_e=5.1),
    "canon-4x": Sensor(full_well_e=5470, read_noise_e=5.1, iso=400),
    "canon-16x": Sensor(full_well_e=5470, read_noise_e=5.1, iso=1600),
}
"""Behind the lens of the camera datasets; 4x and 16x: a quarter and a sixteenth of the light, amplified."""
BENCHMARK = "benchmark"
"""Stands, where names are asked for, for the whole list."""


def catalogue() -> dict[str, Dataset]:
    """Return every dataset by its name: the sweeps' in the benchmark's order, then the others."""
    return {one.name: one for one in (*_of_sweeps(), *_beyond_sweeps())}


def chosen(patterns: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return the names that fit any of some shell patterns, in their order; raise SceneError for one that fits none."""
    unknown = [pattern for pattern in patterns if not fnmatch.filter(names, pattern)]
    if unknown:
        import difflib

        near = difflib.get_close_matches(unknown[0], names, 3, 0.4)
        hint = f" Did you mean {', '.join(near)}?" if near else ""
        raise SceneError(
            f"dataset {unknown[0]}: there is none of that name.{hint} `rgbn dataset list` has the names; patterns such "
            "as 'pear-*' stand in quotes."
        )
    return [name for name in names if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)]


@cache
def first_names() -> dict[str, str]:
    """Return, by each name of the catalogue, the first name of the same stack: of the same recipe, camera and lights.

    The stack is made and listed under that one; the others are its aliases.
    """
    first: dict[Dataset, str] = {}
    known = catalogue().values()
    return {one.name: first.setdefault(replace(one, name="", family="", text=""), one.name) for one in known}


@cache
def benchmark_names() -> tuple[str, ...]:
    """Return the names of the benchmark's list, 93 distinct stacks, in the catalogue's order.

    The benchmark's authors made 93 synthetic datasets and let the list grow by others' [Berkiten2016]. Which ones they
    were is not published but for the nine experiments, each on one object. The rule here: every level of the nine
    experiments on their first shape (pear, cone, waves), 72 stacks since 3 of the 75 levels repeat one; and the seven
    experiments that are not about shape on three further objects each, see `_on_solids`: 21.
    """
    found = {
        one.name
        for one in catalogue().values()
        if one.family in ONE_FACTOR and one.recipe.shape in (ONE_FACTOR[one.family].shapes[0], *FIELDS)
    }
    stacks = {first_names()[name] for name in found}
    return tuple(name for name in catalogue() if name in stacks)


def wanted(patterns: Sequence[str], names: Iterable[str], of_list: Iterable[str], first: Mapping[str, str]) -> set[str]:
    """Return the stacks, by their first names, that patterns or the word `benchmark` choose among names.

    of_list: those of `names` that are of the benchmark's list. SceneError: a pattern fits none.
    """
    others = [pattern for pattern in patterns if pattern != BENCHMARK]
    found = set(chosen(others, list(names))) if others else set()
    found |= set(of_list) if BENCHMARK in patterns else set()
    return {first.get(name, name) for name in found}


def _of_sweeps() -> Iterator[Dataset]:
    solids = iter(FIELDS)
    for one in ONE_FACTOR.values():
        first_draws = [cell for cell in one.cells(methods=()) if not cell.recipe.seed]
        for cell in (*first_draws, *_on_solids(one, first_draws, solids)):
            recipe, value = cell.recipe, cell.value
            word = value.replace("_", "-") if isinstance(value, str) else _level(value, DECIMALS[one.name])
            axis = "material" if isinstance(value, str) else one.axis
            yield Dataset(f"{recipe.shape}-{one.name}-{word}", one.name, f"{recipe.shape}; {axis}: {word}", recipe)


def _on_solids(one: Experiment, cells: Sequence[Cell], solids: Iterator[str]) -> Iterator[Cell]:
    """Yield an experiment's levels at a third, at two thirds and at the end, each on a solid of its own.

    None where the shape is what the experiment is about. In the order of the experiments every solid is taken once.
    """
    if one.shapes == OBJECTS:
        for third in (1, 2, 3):
            cell = cells[round(third * (len(one.levels) - 1) / 3)]
            yield replace(cell, recipe=replace(cell.recipe, shape=next(solids)))


def _level(value: float, decimals: int) -> str:
    word = f"{value:.{decimals}f}" if decimals else f"{value:02.0f}"
    if abs(float(word) - value) > 1e-9:
        raise ValueError(f"{value} has more than {decimals} decimals: two levels might have one name")
    return word


def _beyond_sweeps() -> Iterator[Dataset]:
    for shape in OBJECTS:
        for distance in NEAR_MM:
            text = f"{shape} (200 mm wide); 32 lights, mm from its middle: {distance}"
            yield Dataset(f"{shape}-near-{distance:04d}", "near", text, Recipe(shape), near_mm=distance)
    for shape in OBJECTS:
        for count in HAND_HELD:
            text = f"{shape}; flashes by hand, 700 to 1300 mm away, uneven in power: {count}"
            recipe = Recipe(shape, count=count, polar_deg=65.0)
            yield Dataset(f"{shape}-hand-{count:02d}", "hand", text, recipe, near_mm=1000, hand_held=True)
    for shape in OBJECTS:
        for name, sensor in SENSORS.items():
            text = f"{shape}; noise as measured on photographs: {name}"
            yield Dataset(f"{shape}-camera-{name}", "camera", text, Recipe(shape), sensor=sensor)
    for group in GROUPS:
        for near in (0, 700):
            where = f", lights {near} mm away" if near else ""
            text = f"pear, blob and knot side by side, which light each other{where}; materials: {group}"
            name = f"group-{group}-near" if near else f"group-{group}"
            # The recipe's shape is not used: `scenes.dataset_scene` sets up three.
            yield Dataset(name, "group", text, Recipe(depth=GROUP_DEPTH, count=24), near_mm=near, group=group)
