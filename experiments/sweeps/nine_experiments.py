"""The nine experiments, each a line: what is varied, over which levels, on which shapes."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from experiments.sweeps.recipe import Cell, Recipe
from scene.errors import SceneError

SOLVERS = {
    "ls": "Lsq", "rpca": "RPCS", "iterative": "Iter Lsq", "hsh": "HSH", "ldr": "LDR", "entropy": "Entropy", "tv": "TV"
}  # fmt: skip
"""The benchmark's seven, with its labels."""
CALIBRATED = ("ls", "rpca", "iterative", "hsh")
CAMERA_NOISE = 0.005
"""Of 40 000 electrons at pixel value 1. Without any, three lights or a ring about the lens do as well as a dome."""
OBJECTS = ("pear", "blob", "knot")
QUICK_SIDE = 96


@dataclass(frozen=True)
class Experiment:
    """One factor, from easy to hard.

    Parameters
    ----------
    name : str
        On the command line.
    label : str
        In the benchmark's table.
    vary : str
        The field of `Recipe` that the levels are of.
    levels : tuple
        What it is set to.
    axis : str
        What the chart's axis says.
    shapes : tuple of str
    fixed : dict
        Other fields that are not the recipe's defaults.
    seeds : int
        How often each level is drawn, where chance enters.
    """

    name: str
    label: str
    vary: str
    levels: tuple[Any, ...]
    axis: str
    shapes: tuple[str, ...] = OBJECTS
    fixed: dict[str, Any] = field(default_factory=dict)
    seeds: int = 1

    def cells(self, *, methods: tuple[str, ...] = tuple(SOLVERS), quick: bool = False) -> Iterator[Cell]:
        """Yield the cells, those that share a rendering one after the other.

        Parameters
        ----------
        methods : tuple of str
        quick : bool
            A first look: four levels, one shape, one draw, small pictures.
        """
        levels = list(enumerate(self.levels))
        if quick:
            last = len(levels) - 1
            levels = [levels[round(i * last / 3)] for i in range(4)]
        side = QUICK_SIDE if quick else Recipe.side
        for shape in self.shapes[:1] if quick else self.shapes:
            for level, value in levels:
                for seed in range(1 if quick else self.seeds):
                    recipe = replace(Recipe(shape=shape, seed=seed, side=side), **self.fixed, **{self.vary: value})
                    yield Cell(self.name, level, value, recipe, methods)


EXPERIMENTS = {
    one.name: one
    for one in (
        Experiment(
            "ambient", "Ambient", "ambient", (0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0),
            "ambient light left in, share of the flash",
        ),
        Experiment(
            "interreflection", "Interreflection", "relief", (0.2, 0.4, 0.6, 0.8, 1.0, 1.4, 1.8, 2.4),
            "height of the hollow over its radius", ("cone", "bowl"),
            {"reflectance": 0.8, "polar_deg": 15.0, "count": 24, "depth": 32},
        ),
        Experiment(
            "material", "Material", "material",
            (
                "diffuse", "specular", "diffuse_subsurface", "specular_subsurface", "specular_texture_subsurface",
                "diffuse_texture", "specular_texture", "diffuse_texture_subsurface",
            ),
            "material",
        ),
        Experiment(
            "images", "Number of Images", "images", (3, 4, 5, 6, 8, 10, 13, 17, 24), "number of images",
            fixed={"noise": CAMERA_NOISE}, seeds=5,
        ),
        Experiment(
            "noise", "Noise", "noise", (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.45),
            "Poisson noise at pixel value 1, share of it", seeds=5,
        ),
        Experiment(
            "ring", "Ring Position", "polar_deg", tuple(5.0 + 10.0 * i for i in range(9)),
            "ring of 24 lights, degrees from the camera's axis",
            fixed={"lights": "ring", "count": 24, "noise": CAMERA_NOISE}, seeds=5,
        ),
        Experiment(
            # A mirror of roughness 0 shows no distant light at all.
            "roughness", "Roughness", "roughness", (0.01, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0),
            "roughness (alpha of GGX)", fixed={"material": "specular"},
        ),
        Experiment(
            "shadow", "Shadow", "relief", (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0),
            "k of S = k sin x sin y", ("waves", "ridges"),
        ),
        Experiment(
            "specularity", "Specularity", "specularity", (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0),
            "specularity of rough plastic", fixed={"material": "specular"},
        ),
    )
}  # fmt: skip
"""In the order of the benchmark's table, by the name on the command line."""


def experiments_of(text: str) -> tuple[Experiment, ...]:
    """Return the experiments that a command line names: some, with commas, or all.

    Raises
    ------
    SceneError
        There is no such experiment.
    """
    names = list(EXPERIMENTS) if text == "all" else [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in names if name not in EXPERIMENTS]
    if unknown or not names:
        raise SceneError(
            f"sweep {text}: {', '.join(unknown) or 'nothing'} is unknown; there are {', '.join(EXPERIMENTS)}, and all."
        )
    return tuple(EXPERIMENTS[name] for name in dict.fromkeys(names))
