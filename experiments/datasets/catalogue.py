"""The named datasets: every level of the nine sweeps, and what no sweep varies, each as a short recipe."""

import fnmatch
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from experiments.sweeps.nine_experiments import EXPERIMENTS, OBJECTS
from experiments.sweeps.recipe import Recipe
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


@dataclass(frozen=True)
class Dataset:
    """One dataset's recipe.

    Parameters
    ----------
    name : str
    family : str
    text : str
        What it is, in a line.
    recipe : Recipe
        What the sweeps know of it: shape, material, lights, noise, size, seed.
    near_mm : float
        Distance of the lights from the object's middle; 0: they are distant.
    hand_held : bool
        Flashes at random places, their distances 0.7 to 1.3 of `near_mm`, their power 8 % about its mean.
    sensor : Sensor or None
        The camera that photographs the frames.
    group : str
        One of `GROUPS`: three objects of these materials instead of one; empty: one.
    """

    name: str
    family: str
    text: str
    recipe: Recipe
    near_mm: float = 0.0
    hand_held: bool = False
    sensor: Sensor | None = None
    group: Literal["", "matte", "plastic", "metal", "mixed"] = ""

    def sized(self, side: int) -> "Dataset":
        """Return the dataset with pictures of another size, and named after it."""
        if side == self.recipe.side:
            return self
        return replace(self, name=f"{self.name}-{side}px", recipe=replace(self.recipe, side=side))


def catalogue() -> dict[str, Dataset]:
    """Return every dataset by its name: the sweeps' in the benchmark's order, then the others."""
    return {one.name: one for one in (*_of_sweeps(), *_near(), *_hand_held(), *_cameras(), *_groups())}


def chosen(patterns: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return the names that fit any of some patterns, as a shell has them, in their order.

    Raises
    ------
    SceneError
        A pattern that fits none.
    """
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


def _near() -> Iterator[Dataset]:
    for shape in OBJECTS:
        for distance in NEAR_MM:
            text = f"{shape} (200 mm wide); 32 lights, mm from its middle: {distance}"
            yield Dataset(f"{shape}-near-{distance:04d}", "near", text, Recipe(shape=shape), near_mm=distance)


def _hand_held() -> Iterator[Dataset]:
    for shape in OBJECTS:
        for count in HAND_HELD:
            text = f"{shape}; flashes by hand, 700 to 1300 mm away, uneven in power: {count}"
            recipe = Recipe(shape=shape, count=count, polar_deg=65.0)
            yield Dataset(f"{shape}-hand-{count:02d}", "hand", text, recipe, near_mm=1000, hand_held=True)


def _cameras() -> Iterator[Dataset]:
    for shape in OBJECTS:
        for name, sensor in SENSORS.items():
            text = f"{shape}; noise as measured on photographs: {name}"
            yield Dataset(f"{shape}-camera-{name}", "camera", text, Recipe(shape=shape), sensor=sensor)


def _groups() -> Iterator[Dataset]:
    for group in GROUPS:
        for near in (0, 700):
            where = f", lights {near} mm away" if near else ""
            text = f"pear, blob and knot side by side, which light each other{where}; materials: {group}"
            name = f"group-{group}-near" if near else f"group-{group}"
            # The sweeps' shape is not used: `staging` sets up three.
            recipe = Recipe(depth=GROUP_DEPTH, count=24)
            yield Dataset(name, "group", text, recipe, near_mm=near, group=group)
