"""The experiments, a line each, in two stagings: one factor at a time, and as the benchmark's text has them."""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.recipe import Cell, Recipe
from scene.errors import SceneError

if TYPE_CHECKING:
    from lab.options import Staging

SOLVERS = {
    "ls": "Lsq", "rpca": "RPCS", "iterative": "Iter Lsq", "hsh": "HSH", "ldr": "LDR", "entropy": "Entropy", "tv": "TV"
}  # fmt: skip
"""The benchmark's seven, with its labels."""
CALIBRATED = ("ls", "rpca", "iterative", "hsh")
CAMERA_NOISE = 0.005
"""Of 40 000 electrons at pixel value 1. Without any, three lights or a ring about the lens do as well as a dome."""
OBJECTS = ("pear", "blob", "knot")
RELIEFS = ("cone", "bowl", "waves", "ridges")
"""Shapes that the experiments about shape can vary: they have a relief."""
QUICK_SIDE = 96
QUICK_LEVELS = 4
MATERIALS = (
    "diffuse", "specular", "diffuse_subsurface", "specular_subsurface", "specular_texture_subsurface",
    "diffuse_texture", "specular_texture", "diffuse_texture_subsurface",
)  # fmt: skip
"""In the benchmark's order; the last one it counts, but does not name."""
FITTED = Path(__file__).parent / "benchmark_levels.csv"
"""Levels of the staging "benchmark": those at which plain `ls` goes in even steps over the range of the Lsq column."""
NOISE = "renderings' noise"
"""The line there that is no experiment's."""


@dataclass(frozen=True)
class Experiment:
    """One factor, from easy to hard."""

    name: str  # on the command line
    label: str  # in the benchmark's table, or the documentation's
    vary: str  # the field of `base` that the levels are of
    levels: tuple[Any, ...]
    axis: str  # what the chart's axis says
    base: Recipe  # what all levels have in common
    shapes: tuple[str, ...] = OBJECTS
    seeds: int = 1  # how often each level is drawn, where chance enters
    quick: tuple[int, ...] = ()  # levels of the first look; empty: evenly spread

    def cells(self, *, methods: tuple[str, ...] = tuple(SOLVERS), quick: bool = False) -> Iterator[Cell]:
        """Yield a sweep's cells, those that share a rendering one after the other.

        quick: a first look, with four levels, one shape, one draw, small pictures.
        """
        levels = [(level, value, replace(self.base, **{self.vary: value})) for level, value in enumerate(self.levels)]
        if quick:
            last = len(levels) - 1
            chosen = self.quick or tuple(round(i * last / (QUICK_LEVELS - 1)) for i in range(QUICK_LEVELS))
            levels = [levels[level] for level in chosen]
        side = QUICK_SIDE if quick else Recipe.side
        for shape in self.shapes[:1] if quick else self.shapes:
            for level, value, recipe in levels:
                for seed in range(1 if quick else self.seeds):
                    yield Cell(self.name, level, value, replace(recipe, shape=shape, seed=seed, side=side), methods)


ONE_FACTOR: dict[str, Experiment] = {
    one.name: one
    for one in (
        Experiment(
            "ambient", "Ambient", "ambient", (0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0),
            "ambient light left in, share of the flash", Recipe(),
        ),
        Experiment(
            "interreflection", "Interreflection", "relief", (0.2, 0.4, 0.6, 0.8, 1.0, 1.4, 1.8, 2.4),
            "height of the hollow over its radius",
            Recipe(reflectance=0.8, polar_deg=15.0, count=24, depth=32), ("cone", "bowl"),
        ),
        Experiment("material", "Material", "material", MATERIALS, "material", Recipe(), quick=(0, 1, 3, 6)),
        Experiment(
            "images", "Number of Images", "images", (3, 4, 5, 6, 8, 10, 13, 17, 24), "number of images",
            Recipe(noise=CAMERA_NOISE), seeds=5,
        ),
        Experiment(
            "noise", "Noise", "noise", (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.45),
            "Poisson noise at pixel value 1, share of it", Recipe(), seeds=5,
        ),
        Experiment(
            "ring", "Ring Position", "polar_deg", tuple(5.0 + 10.0 * i for i in range(9)),
            "ring of 24 lights, degrees from the camera's axis",
            Recipe(lights="ring", count=24, noise=CAMERA_NOISE), seeds=5,
        ),
        Experiment(
            # A mirror of roughness 0 shows no distant light at all.
            "roughness", "Roughness", "roughness", (0.01, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0),
            "roughness (alpha of the facets)", Recipe(material="specular"),
        ),
        Experiment(
            "shadow", "Shadow", "relief", (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0),
            "k of S = k sin x sin y", Recipe(), ("waves", "ridges"),
        ),
        Experiment(
            "specularity", "Specularity", "specularity", (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0),
            "specularity of rough plastic", Recipe(material="specular"),
        ),
    )
}  # fmt: skip
"""The nine in the order of the benchmark's table, by the name on the command line: all but one factor is easy."""


TOLD_WRONGLY: dict[str, Experiment] = {
    one.name: one
    for one in (
        Experiment(
            "directions", "Light Directions", "directions_off_deg", (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
            "error of the light directions told, degrees rms", Recipe(noise=CAMERA_NOISE), OBJECTS[:1], 5,
        ),
        Experiment(
            "intensities", "Light Intensities", "intensities_off", (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.3),
            "error of the light intensities told, share", Recipe(noise=CAMERA_NOISE), OBJECTS[:1], 5,
        ),
    )
}  # fmt: skip
"""Beyond the benchmark's: easy photographs, and lights that a calibration got wrong."""


def benchmark_bases(noise: float) -> dict[str, Experiment]:
    """Return the staging "benchmark" but for its levels: one shape each, the text's pear, cones and sinusoidal surface.

    noise: of the renderings, as `Recipe.noise`. Path-traced everywhere, with Beckmann's facets: what Mitsuba does where
    nothing else is said. Where the text says nothing, as in `ONE_FACTOR`.
    """
    pear = Recipe(depth=32, distribution="beckmann", noise=noise)
    glossy = replace(pear, material="specular")
    bases = {
        "interreflection": replace(ONE_FACTOR["interreflection"].base, noise=noise),
        "ring": replace(pear, lights="ring", count=24),
        "roughness": glossy,
        "specularity": glossy,
    }
    return {
        name: replace(
            one, base=bases.get(name, pear), shapes=one.shapes[:1], seeds=one.seeds if name == "images" else 1
        )
        for name, one in ONE_FACTOR.items()
    }


def benchmark() -> dict[str, Experiment]:
    """Return the staging "benchmark", its levels and noise fixed from the benchmark's Lsq column alone."""
    with FITTED.open(newline="") as file:
        fitted = [(row["experiment"], float(row["level"])) for row in csv.DictReader(file)]
    (noise,) = (value for name, value in fitted if name == NOISE)
    found = {}
    for name, one in benchmark_bases(noise).items():
        levels = tuple(int(value) if name == "images" else value for of, value in fitted if of == name)
        found[name] = replace(one, levels=levels or one.levels)
    return found


def experiments(staging: "Staging") -> dict[str, Experiment]:
    """Return a staging's experiments by name."""
    return benchmark() if staging == "benchmark" else ONE_FACTOR | TOLD_WRONGLY


def experiments_of(text: str, staging: "Staging" = "one-factor", shape: str = "") -> tuple[Experiment, ...]:
    """Return the sweeps that a command line names: some, with commas, or all.

    shape: of `experiments.shapes.SHAPES`, with commas, in place of an experiment's own; empty: its own. SceneError: an
    unknown name, or a shape without a relief where an experiment varies that.
    """
    there: Mapping[str, Experiment] = experiments(staging)
    names = list(there) if text == "all" else [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in names if name not in there]
    if unknown or not names:
        raise SceneError(
            f"sweep {text}: {', '.join(unknown) or 'nothing'} is unknown; there are {', '.join(there)}, and all."
        )
    found = tuple(there[name] for name in dict.fromkeys(names))
    return tuple(_shaped(one, shape) for one in found) if shape else found


def _shaped(one: Experiment, shape: str) -> Experiment:
    # Cells are named without what makes meshes.
    from experiments.shapes import SHAPES

    shapes = tuple(dict.fromkeys(name.strip() for name in shape.split(",")))
    can = RELIEFS if one.vary == "relief" else tuple(SHAPES)
    if unknown := [name for name in shapes if name not in can]:
        raise SceneError(
            f"--shape {shape}: {one.name} cannot be run on {', '.join(unknown)}. It takes {', '.join(can)}."
            + " It varies their relief: leave it out for other shapes." * (one.vary == "relief")
        )
    return replace(one, shapes=shapes)
