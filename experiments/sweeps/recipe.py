"""What a cell of a sweep is made from: plain numbers and words, so that its name can be told without rendering."""

from dataclasses import dataclass, replace

from scene.current import code_fingerprint, fingerprint, sources

RUNNER = "experiments.sweeps.cell"
"""The module that makes a cell's rows: they depend on its code, and on what that imports."""


@dataclass(frozen=True)
class Recipe:
    """One stack of photographs with known truth.

    Parameters
    ----------
    shape : str
        A key of `shapes.SHAPES`.
    relief : float
        Of the shapes that have one: height over radius of the hollows, k of the waves.
    material : str
        One of the benchmark's eight, see `twin.description.materials.seed_materials`.
    reflectance : float
        Of the matte part, where it has no texture.
    roughness, specularity : float
        Of the coat of the materials that have one: alpha of GGX; factor on its reflectance.
    lights : {"cap", "ring"}
        Distant flashes of one intensity, spread evenly over a cap about the camera's axis, or on a ring.
    count : int
        How many.
    polar_deg : float
        The cap's half angle, or the ring's, from the camera's axis.
    depth : int
        2: light straight from the flash; 3: light that met one surface more; and so on.
    ambient : float
        Radiance from everywhere that nobody subtracted; a flash gives a white surface the radiance 1.
    noise : float
        Of the photons: standard deviation at pixel value 1, as a share of it. 0: none.
    images : int
        How many of the frames are taken, at random; 0: all.
    side : int
        Of the picture, pixels.
    seed : int
        Of what is left to chance: the photons, and which frames are taken.
    """

    shape: str = "pear"
    relief: float = 1.0
    material: str = "diffuse"
    reflectance: float = 0.5
    roughness: float = 0.1
    specularity: float = 1.0
    lights: str = "cap"
    count: int = 32
    polar_deg: float = 60.0
    depth: int = 2
    ambient: float = 0.0
    noise: float = 0.0
    images: int = 0
    side: int = 256
    seed: int = 0

    @property
    def scene(self) -> "Recipe":
        """The recipe of what has to be rendered; many cells may share it."""
        return replace(self, ambient=0.0, noise=0.0, images=0, seed=0)


@dataclass(frozen=True)
class Cell:
    """One stack and the methods that are run on it, as part of an experiment.

    Parameters
    ----------
    experiment : str
    level : int
        From 0, the easiest, or the first.
    value : float or str
        The level in the experiment's own unit.
    recipe : Recipe
    methods, profiles : tuple of str
        Every method with every profile.
    """

    experiment: str
    level: int
    value: float | str
    recipe: Recipe
    methods: tuple[str, ...]
    profiles: tuple[str, ...] = ("default", "seed")

    @property
    def key(self) -> str:
        """The cell's name: a hash of all that goes into it, and of the code that makes it."""
        return fingerprint(self, code=code_fingerprint(RUNNER))[:24]


def code_times() -> tuple[int, ...]:
    """Return when each of these sources was last written, nanoseconds.

    A process reads a source when it first needs it: while these times stand still, all read what the key tells.
    """
    return tuple(path.stat().st_mtime_ns for path in sources(RUNNER))
