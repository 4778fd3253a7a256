"""What photographs with known truth are made from: plain numbers and words, whose names need no rendering."""

from dataclasses import dataclass, replace
from typing import Literal

from scene.current import code_fingerprint, fingerprint, sources
from twin.camera.virtual_camera import Sensor
from twin.description.materials import Distribution

ROOM = "experiments"
"""A cell's rows depend on its code, and on that of the rooms below it."""


@dataclass(frozen=True)
class Recipe:
    """One stack of photographs of one object, with known truth. Lights are distant, of one intensity."""

    shape: str = "pear"  # a key of `shapes.SHAPES`
    relief: float = 1.0  # of shapes that have one: height over radius of the hollows, k of the waves
    material: str = "diffuse"  # one of the benchmark's eight, see `twin.description.materials.seed_materials`
    reflectance: float = 0.5  # of the matte part, where it has no texture
    roughness: float = 0.1  # of the materials with a coat: alpha of its facets
    distribution: Distribution = "ggx"  # of those facets' slopes
    specularity: float = 1.0  # factor on the coat's reflectance
    lights: str = "cap"  # "cap": spread evenly over a cap about the camera's axis; "ring": on a ring about it
    count: int = 32  # lights
    polar_deg: float = 60.0  # the cap's half angle, or the ring's, from the camera's axis
    depth: int = 2  # 2: light straight from the flash; 3: light that met one surface more; and so on
    ambient: float = 0.0  # radiance from everywhere, not subtracted; a flash gives a white surface the radiance 1
    noise: float = 0.0  # of the photons: standard deviation at pixel value 1, as a share of it; 0: none
    images: int = 0  # how many of the frames are taken, at random; 0: all
    directions_off_deg: float = 0.0  # error of the light directions that methods are told, root mean square
    intensities_off: float = 0.0  # of their intensities: standard deviation of the logarithm
    side: int = 256  # of the picture, pixels
    seed: int = 0  # of what is left to chance: the photons, which frames are taken, how the told lights are off

    @property
    def scene(self) -> "Recipe":
        """The recipe of what has to be rendered; many cells may share it."""
        return replace(self, ambient=0.0, noise=0.0, images=0, seed=0, directions_off_deg=0.0, intensities_off=0.0)


@dataclass(frozen=True)
class Cell:
    """One stack and the methods that are run on it, every one with every profile, as part of an experiment."""

    experiment: str
    level: int  # from 0, the easiest, or the first
    value: float | str  # the level in the experiment's own unit
    recipe: Recipe
    methods: tuple[str, ...]
    profiles: tuple[str, ...] = ("default", "seed")

    @property
    def key(self) -> str:
        """The cell's name: a hash of all that goes into it, and of the code that makes it."""
        return fingerprint(self, code=code_fingerprint(ROOM))[:24]


@dataclass(frozen=True)
class Dataset:
    """A named stack that is kept as a folder: a sweep's, or one with what no sweep varies."""

    name: str
    family: str
    text: str  # what it is, in a line
    recipe: Recipe
    near_mm: float = 0.0  # distance of the lights from the object's middle; 0: they are distant
    hand_held: bool = False  # flashes at random places, their distances and power uneven, see `scenes`
    sensor: Sensor | None = None  # the camera that photographs the frames
    group: Literal["", "matte", "plastic", "metal", "mixed"] = ""  # three objects of these materials instead of one

    def sized(self, side: int) -> "Dataset":
        """Return the dataset with pictures of another size, and named after it."""
        if side == self.recipe.side:
            return self
        return replace(self, name=f"{self.name}-{side}px", recipe=replace(self.recipe, side=side))


def code_times() -> tuple[int, ...]:
    """Return when each of these sources was last written, nanoseconds.

    A process reads a source when it first needs it: while these times stand still, all read what the key tells.
    """
    return tuple(path.stat().st_mtime_ns for path in sources(ROOM))
