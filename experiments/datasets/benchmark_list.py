"""The benchmark's list: 93 distinct stacks of the catalogue; and which names stand for one and the same stack.

The benchmark's authors made 93 synthetic datasets and let the list grow by others' [Berkiten2016]. Which ones they were
is not published but for the nine experiments, each on one object. The rule here: every level of the nine experiments on
their first shape (pear, cone, waves), 72 stacks since 3 of the 75 levels repeat one; and the seven experiments that are
not about shape once more on a second object, at the levels at a third, at two thirds and at the end: 21.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache

from experiments.catalogue import catalogue, chosen
from experiments.recipe import Dataset
from experiments.stagings import OBJECTS, ONE_FACTOR

BENCHMARK = "benchmark"
"""Stands, where names are asked for, for the whole list."""


@cache
def first_names() -> dict[str, str]:
    """Return, by each name of the catalogue, the first name of the same stack: of the same recipe, camera and lights.

    The stack is made and listed under that one; the others are its aliases.
    """
    first: dict[Dataset, str] = {}
    known = catalogue().values()
    return {one.name: first.setdefault(replace(one, name="", family="", text=""), one.name) for one in known}


def first_name(name: str) -> str:
    """Return the name under which a dataset's stack is listed, of whatever size; unknown names stay as they are."""
    base = re.sub(r"-\d+px$", "", name)
    return first_names().get(base, base) + name[len(base) :]


@cache
def benchmark_names() -> tuple[str, ...]:
    """Return the list's names, in the catalogue's order."""
    found, known = set(), catalogue().values()
    for one in ONE_FACTOR.values():
        mine = {shape: [each.name for each in known if each.family == one.name and each.recipe.shape == shape]
                for shape in one.shapes}  # fmt: skip
        found.update(mine[one.shapes[0]])
        if one.shapes == OBJECTS:
            again = mine[one.shapes[1]]
            found.update(again[round(part * (len(again) - 1) / 3)] for part in (1, 2, 3))
    stacks = {first_names()[name] for name in found}
    return tuple(one.name for one in known if one.name in stacks)


def wanted(patterns: Sequence[str], names: Iterable[str], of_list: Iterable[str], first: Mapping[str, str]) -> set[str]:
    """Return the stacks, by their first names, that patterns or the word `benchmark` choose among names.

    of_list: those of `names` that are of the benchmark's list. SceneError: a pattern fits none.
    """
    others = [pattern for pattern in patterns if pattern != BENCHMARK]
    found = set(chosen(others, list(names))) if others else set()
    found |= set(of_list) if BENCHMARK in patterns else set()
    return {first.get(name, name) for name in found}
