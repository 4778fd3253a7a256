"""The virtual lab: an object and balls on a table under flashes held by hand, as scenes and as pictures."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.photographs import (
    BRIGHTEST_SHARE,
    PATHS,
    Images,
    by_flash,
    by_flash_and_medium,
    by_surrounding,
    rendered,
)
from experiments.scenes import near_lights, patches, placed
from scene.camera import Camera
from scene.light_layouts import cap, ring
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, Material, RoughPlastic, Subsurface
from twin.description.object_mesh import built_in
from twin.ground_truth import ground_truth

Array = NDArray[np.float64]

CAMERA = Camera(320, 240, 480.0, 480.0, 161.3, 117.6)
CENTRE_MM = np.array([0.0, 0.0, -900.0])
TABLE_MM = -1015.0
SPHERE_MM = 100.0
CARD_MM = (110.0, 85.0)
"""Width of a half, and half of its height."""
FLASH_MM, FLASH_RADIUS_MM = 900.0, 25.0
CAP_DEG = 60.0
UPRIGHT = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""Turns a sphere's axis, z, upward, to y: patches meet at its poles."""
HAND_DEG, HAND_DISTANCE, HAND_INTENSITY = 3.0, 0.05, 0.03
"""Standard deviations of a hand: of each tangent angle, of the distance, of the flash's energy."""
BALLS = (
    ("chrome", 50.0, (-225.0, 150.0, -960.0)),
    ("chrome", 50.0, (225.0, -150.0, -955.0)),
    ("white", 45.0, (-222.0, -152.0, -965.0)),
)
"""kind, radius in mm, centre in mm."""
ERROR = 0.005
"""Relative root-mean-square error that the renderings aim at."""
WHITE_REFLECTANCE = (0.8, 0.8, 0.8)
AROUND: dict[str, Material] = {
    "white": Diffuse(WHITE_REFLECTANCE),
    "chrome": Conductor("Cr", 0.0),
    "table": Diffuse((0.2, 0.2, 0.2)),
}
"""Of balls and table."""
MEAN_FREE_PATH_MM = SPHERE_MM / 25
"""Of the wax: the sweeps', to the object's size."""
OBJECT_MATERIALS: dict[str, Material] = {
    "matte": Diffuse(WHITE_REFLECTANCE),
    "patches": Diffuse(patches()),
    "gloss-0.1": RoughPlastic(WHITE_REFLECTANCE, 0.1),
    "gloss-0.3": RoughPlastic(WHITE_REFLECTANCE, 0.3),
    "wax": Diffuse(WHITE_REFLECTANCE, Subsurface(MEAN_FREE_PATH_MM)),
}
"""By name. The benchmark's Fig. 4 shows five spheres and does not name their materials. Its section 6.3 combines three
properties, matte or glossy, plain or textured, solid or with light below the surface, and 6.7 varies the roughness:
each of these is here once beside the plain matte sphere."""
SAMPLES = 4
"""A pixel and flash, of light straight from the flash; without noise but at edges and in penumbras."""
MIRROR_SAMPLES = 256
"""A pixel and flash, on the chrome balls: a flash's image there has a radius of a third of a pixel, and `SAMPLES` would
find it at the wrong place, or not at all."""
WAX_PATHS = 36
"""A pixel and flash, of light that went through the wax: with the sweeps' 9 its grain is seen in the normals."""
BRIGHTEST = 0.75
"""The exposure: `BRIGHTEST_SHARE` of the object's samples are at most so bright."""


@dataclass(frozen=True)
class Setup:
    """What stands on the virtual lab's table, and how it is photographed."""

    shape: str = "sphere"  # or "cardboard"
    fold_deg: float = 180.0  # between the cardboard's two halves; 180: flat
    material: str = "matte"  # a key of `OBJECT_MATERIALS`
    ring_deg: float | None = None  # flashes on a ring, degrees from the camera's axis; None: over a cap of 60 degrees
    ambient: float = 0.0  # radiance of the room, not subtracted; a flash gives a white surface the radiance 1
    iso: float = 100.0  # at 100 white are 40 000 electrons, at 200 half of them
    frames: int = 16
    seed: int = 0  # of the hand that holds the flash, and of the sensor's noise


@dataclass(frozen=True)
class Experiment:
    """One factor, from easy to hard."""

    name: str
    label: str
    vary: str  # the field of `base` that the levels are of
    levels: tuple[float | int | str, ...]
    axis: str  # what the chart's axis says
    base: Setup
    log: bool = False  # the chart's axis is logarithmic

    def setups(self) -> list[Setup]:
        """Return the setup of each level."""
        return [replace(self.base, **{self.vary: level}) for level in self.levels]


VIRTUAL_EXPERIMENTS: tuple[Experiment, ...] = (
    Experiment(
        "ambient", "White sphere, more and more light of the room", "ambient", (0.0, 0.05, 0.15, 0.4),
        "ambient light left in, share of the flash", Setup(),
    ),
    Experiment(
        "cardboard", "White cardboard, folded", "fold_deg", (160.0, 120.0, 90.0, 60.0), "degrees between the halves",
        Setup("cardboard"),
    ),
    Experiment(
        "iso", "White sphere, higher and higher ISO", "iso", (100.0, 1600.0, 6400.0, 25600.0), "ISO", Setup(), log=True
    ),
    Experiment("images", "White sphere, fewer flashes", "frames", (16, 10, 7, 5), "flashes", Setup()),
    Experiment(
        "ring", "White sphere, flashes held on a ring", "ring_deg", (15.0, 35.0, 55.0, 75.0),
        "degrees of the ring from the camera's axis", Setup(),
    ),
    Experiment(
        "spheres", "Five spheres of different materials", "material", tuple(OBJECT_MATERIALS), "material", Setup()
    ),
)  # fmt: skip
"""The benchmark's experiments on real things, as virtual captures."""


def object_scene(setup: Setup) -> TwinScene:
    """Return the lab's object alone under the flashes as the setup has them, points, each at its place."""
    lights = _flashes(_nominal(setup), np.full(setup.frames, FLASH_MM), np.ones(setup.frames))
    # A convex body sends nothing to itself; between white halves light goes on until it no longer counts.
    sampling = Sampling(max_depth=2 if setup.shape == "sphere" else 12, error=ERROR)
    materials = {"object": OBJECT_MATERIALS[setup.material]}
    return TwinScene(CAMERA, _objects(setup), materials, lights, sampling=sampling, name=setup.shape)


def lab_scene(setup: Setup) -> TwinScene:
    """Return the table with object and balls under flashes held by hand: small discs, near their places, uneven."""
    generator = np.random.default_rng([setup.seed, 1])
    directions = _nominal(setup)
    aside = np.radians(HAND_DEG) * generator.standard_normal(directions.shape)
    directions = unit(directions + aside - np.sum(aside * directions, 1, keepdims=True) * directions)
    distances = FLASH_MM * (1 + HAND_DISTANCE * generator.standard_normal(setup.frames))
    energy = 1 + HAND_INTENSITY * generator.standard_normal(setup.frames)
    lights = _flashes(directions, distances, energy * (FLASH_MM / distances) ** 2)
    table = TwinObject("table", built_in("square"), "table", placed(3000.0, (0.0, 0.0, TABLE_MM)))
    balls = tuple(
        TwinObject(f"ball {number}", built_in("sphere"), kind, placed(radius, center))
        for number, (kind, radius, center) in enumerate(BALLS)
    )
    alone, radii = object_scene(setup), np.full(setup.frames, FLASH_RADIUS_MM)
    objects, materials = (*alone.objects, *balls, table), {**alone.materials, **AROUND}
    return replace(alone, objects=objects, materials=materials, lights=lights, radii_mm=radii)


def _nominal(setup: Setup) -> Array:
    """Return (F, 3), the flashes' directions as the setup has them."""
    if setup.ring_deg is None:
        return cap(setup.frames, CAP_DEG)
    return ring(setup.frames, setup.ring_deg, 0.25)


def _flashes(directions: Array, distances: Array, power: Array) -> Lights:
    return near_lights([f"flash_{i:03d}" for i in range(len(directions))], directions, distances, power, CENTRE_MM)


def _objects(setup: Setup) -> tuple[TwinObject, ...]:
    if setup.shape == "sphere":
        return (TwinObject("sphere", built_in("sphere"), "object", placed(SPHERE_MM, CENTRE_MM) @ UPRIGHT),)
    tilt = np.radians((180 - setup.fold_deg) / 2)
    wide, high = CARD_MM
    halves = []
    for name, side in (("left half", -1.0), ("right half", 1.0)):
        edge = np.array([side * wide * np.cos(tilt), 0.0, wide * np.sin(tilt)])
        up = np.array([0.0, high, 0.0])
        corners = np.array([-up, edge - up, edge + up, up])
        # The crease lies behind the middle, so that what is folded stays before the table.
        corners[:, 2] -= wide * np.sin(tilt) / 2
        faces = np.array([[0, 1, 2], [0, 2, 3]])[:, :: int(side)]
        halves.append(TwinObject(name, Mesh(corners, faces), "object", placed(1.0, CENTRE_MM)))
    return tuple(halves)


@lru_cache(maxsize=1)
def object_maps(setup: Setup) -> tuple[NDArray[np.bool_], Images]:
    """Return the lab object's mask (H, W) and true normals (H, W, 3), NaN elsewhere; its outermost pixels left out."""
    truth = ground_truth(object_scene(setup))
    mask = cv2.erode(truth.mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return mask, np.where(mask[..., None], truth.normals, np.float32(np.nan))


def photograph_lab(setup: Setup) -> Images:
    """Return the lab's pictures (F, H, W, 3), linear, noiseless, exposed for the object."""
    images = _lab_by_flash(replace(setup, ambient=0.0, iso=100.0))
    if setup.ambient:
        images = np.asarray(
            images + setup.ambient * _lab_by_room(setup.shape, setup.fold_deg, setup.material), np.float32
        )
    return _exposed(images, object_maps(setup)[0])


def _exposed(images: Images, mask: NDArray[np.bool_]) -> Images:
    """Return images (F, H, W, 3) as bright as a photographer would have the object under the mask."""
    return images * np.float32(BRIGHTEST / np.quantile(images[:, mask].max(-1), BRIGHTEST_SHARE))


@lru_cache(maxsize=1)
def _lab_by_flash(setup: Setup) -> Images:
    whole, alone = lab_scene(setup), object_scene(setup)
    scene = _solid(whole)
    images = rendered(_to_depth(scene, 2), "mitsuba", SAMPLES)
    for rows, columns, shown, mirrored in _mirrors(scene):
        images[:, rows, columns][:, shown] = mirrored[:, shown]
    if scene.sampling.max_depth > 2:
        # What the halves send to each other: the object alone, and no speck of a mirror's.
        images += rendered(replace(alone, lights=scene.lights), "many", PATHS, onward=True)
    if scene is not whole:
        # What the medium changes: the object alone, no ball shades it.
        lit = replace(alone, lights=scene.lights)
        images += by_flash_and_medium(lit, ground_truth(lit).mask, WAX_PATHS) - by_flash(_solid(lit))
    return images


def _mirrors(scene: TwinScene) -> Iterator[tuple[slice, slice, NDArray[np.bool_], Images]]:
    """Yield the box of each chrome ball, rows and columns, its pixels (h, w) there, and what they show (F, h, w, 3)."""
    from twin.engines.film import film_for
    from twin.engines.light_layers import render_layers

    black = dict.fromkeys(scene.materials, Diffuse((0.0, 0.0, 0.0)))
    flashes = replace(_to_depth(scene, 2), materials=black | {"chrome": scene.materials["chrome"]})
    # Points, which no path meets by chance: beside a mirror that would be a white speck, found one time in a million.
    lit = replace(_to_depth(scene, 3), radii_mm=np.zeros(len(scene.lights)))
    seen = ground_truth(scene).object
    for number, one in enumerate(scene.objects):
        if one.material == "chrome":
            film = film_for(CAMERA, one.placed.vertices)
            images = render_layers(flashes, film, "mitsuba", MIRROR_SAMPLES).frames()
            images += render_layers(lit, film, "mitsuba", 4 * SAMPLES).frames()
            yield film.rows, film.columns, seen[film.rows, film.columns] == number, images


def _solid(scene: TwinScene) -> TwinScene:
    """Return a scene whose object has no medium below its surface; the scene itself where it has none."""
    material = scene.materials["object"]
    if getattr(material, "subsurface", None) is None:
        return scene
    return replace(scene, materials={**scene.materials, "object": replace(material, subsurface=None)})


@lru_cache(maxsize=4)
def _lab_by_room(shape: str, fold_deg: float, material: str) -> Images:
    return _by_room(lab_scene(Setup(shape, fold_deg, material)))


def _by_room(scene: TwinScene) -> Images:
    """Return the picture (H, W, 3) in an even light of radiance 1, by light that met one surface."""
    return by_surrounding(_to_depth(scene, 2))


def _to_depth(scene: TwinScene, depth: int) -> TwinScene:
    return replace(scene, sampling=replace(scene.sampling, max_depth=depth))
