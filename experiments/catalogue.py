"""The catalogue: the nine sweeps and the named datasets, each a line."""

import fnmatch
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from experiments.recipe import Cell, Dataset, Recipe
from scene.errors import SceneError
from twin.camera.virtual_camera import Sensor

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
    """One factor, from easy to hard."""

    name: str  # on the command line
    label: str  # in the benchmark's table, or the documentation's
    vary: str  # the field of `base` that the levels are of
    levels: tuple[Any, ...]
    axis: str  # what the chart's axis says
    base: Recipe  # what all levels have in common
    shapes: tuple[str, ...] = OBJECTS
    seeds: int = 1  # how often each level is drawn, where chance enters

    def cells(self, *, methods: tuple[str, ...] = tuple(SOLVERS), quick: bool = False) -> Iterator[Cell]:
        """Yield a sweep's cells, those that share a rendering one after the other.

        quick: a first look, with four levels, one shape, one draw, small pictures.
        """
        levels = [(level, value, replace(self.base, **{self.vary: value})) for level, value in enumerate(self.levels)]
        if quick:
            levels = [levels[round(i * (len(levels) - 1) / 3)] for i in range(4)]
        side = QUICK_SIDE if quick else Recipe.side
        for shape in self.shapes[:1] if quick else self.shapes:
            for level, value, recipe in levels:
                for seed in range(1 if quick else self.seeds):
                    yield Cell(self.name, level, value, replace(recipe, shape=shape, seed=seed, side=side), methods)


EXPERIMENTS: dict[str, Experiment] = {
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
        Experiment(
            "material", "Material", "material",
            (
                "diffuse", "specular", "diffuse_subsurface", "specular_subsurface", "specular_texture_subsurface",
                "diffuse_texture", "specular_texture", "diffuse_texture_subsurface",
            ),
            "material", Recipe(),
        ),
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
            "roughness (alpha of GGX)", Recipe(material="specular"),
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
"""The nine sweeps in the order of the benchmark's table, by the name on the command line."""

FAMILIES = {
    "ambient": "light from everywhere that nobody subtracted, as a share of the flash",
    "interreflection": "a white hollow's depth over its radius",
    "material": "the benchmark's eight materials",
    "images": "how many of 32 frames are taken, with a camera's noise",
    "noise": "photon noise at pixel value 1",
    "ring": "a ring of 24 lights, degrees from the camera's axis, with a camera's noise",
    "roughness": "alpha of rough plastic",
    "shadow": "height of waves and ridges",
    "specularity": "factor on the coat's reflectance",
    "near": "32 lights so many mm from the middle of an object 200 mm wide",
    "hand": "so many flashes by hand: places at random, 700 to 1300 mm away, uneven in power",
    "camera": "noise and colour filter as measured on photographs; 4x, 16x: underexposed so much",
    "group": "three objects of different materials that light and shade each other; lights distant, or 700 mm away",
    "added": "datasets of others, on this shelf",
}
"""The datasets' families: by name, what is varied."""
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


def experiments_of(text: str) -> tuple[Experiment, ...]:
    """Return the sweeps that a command line names: some, with commas, or all; raise SceneError for an unknown one."""
    names = list(EXPERIMENTS) if text == "all" else [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in names if name not in EXPERIMENTS]
    if unknown or not names:
        raise SceneError(
            f"sweep {text}: {', '.join(unknown) or 'nothing'} is unknown; there are {', '.join(EXPERIMENTS)}, and all."
        )
    return tuple(EXPERIMENTS[name] for name in dict.fromkeys(names))


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


def _of_sweeps() -> Iterator[Dataset]:
    for one in EXPERIMENTS.values():
        for cell in one.cells(methods=()):
            if cell.recipe.seed:
                continue
            recipe, value = cell.recipe, cell.value
            word = value.replace("_", "-") if isinstance(value, str) else _level(value, DECIMALS[one.name])
            axis = "material" if isinstance(value, str) else one.axis
            yield Dataset(f"{recipe.shape}-{one.name}-{word}", one.name, f"{recipe.shape}; {axis}: {word}", recipe)


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
