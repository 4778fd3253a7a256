"""A virtual capture: the lab rendered, photographed by the virtual camera, a session's folder that `process` takes.

Its lights are found on the balls, as a real session's are; the true ones are written nowhere that a step reads.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import datetime, timedelta
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from experiments.counterparts.compared_side import VIRTUAL
from experiments.counterparts.four_experiments import Setup
from experiments.counterparts.scenes import BALLS, lab_scene, object_scene
from scene.camera import Camera
from scene.files import write_json, write_npy, write_text
from scene.spheres import Sphere
from scene.store import Store
from twin.camera.virtual_camera import Sensor
from twin.description.description import TwinScene
from twin.engines.engine_choice import Engine

Images = NDArray[np.float32]

SAMPLES = 4
"""A pixel and flash, of light straight from the flash; without noise but at edges and in penumbras."""
PATHS = 64
BRIGHTEST, BRIGHTEST_SHARE = 0.75, 0.995
"""The exposure: so many of the object's samples are at most so bright."""
DARK_SHARE = 0.3
"""Of the median frame's light on and about the white ball: below, it stands in the object's shadow."""
_FIRST_SHOT = datetime(2000, 1, 1, 12, 0)


def write_capture(folder: Store, setup: Setup, name: str, balls: Sequence[Sphere] = ()) -> None:
    """Photograph a setup, and write it as a session's folder.

    Parameters
    ----------
    folder : Store
        Gets session.toml (last), raw/flash_NNN.dng, mask.png, truth.npy and virtual.json, which says that no camera
        was there.
    setup : Setup
    name : str
        The session's; begins with `virtual`.
    balls : sequence of Sphere
        Where another session found them: camera and balls stand still. Without, each session finds its own.
    """
    from twin.camera.virtual_photograph import write_photograph

    scene = lab_scene(setup)
    mask, truth = object_maps(setup)
    images = photographed(setup)
    if setup.ambient:
        images = np.asarray(images + setup.ambient * room(setup), np.float32)
    images = exposed(images, mask)
    sensor, camera = Sensor(iso=setup.iso), scene.camera
    for index, light in enumerate(scene.lights.names):
        write_photograph(
            folder.path("raw", f"{light}.dng"),
            images[index],
            sensor,
            np.random.default_rng([setup.seed, 2, index]),
            focal_mm=camera.fx * sensor.pixel_um / 1000,
            time=_FIRST_SHOT + timedelta(seconds=2 * index),
        )
    folder.save_mask(mask)
    write_npy(folder.path("truth.npy"), truth)
    write_json(folder.path(VIRTUAL), {"virtual": True, "setup": asdict(setup), "samples": SAMPLES})
    write_text(folder.path("session.toml"), _manifest(camera, name, balls, _in_shadow(scene, images)))


def object_maps(setup: Setup) -> tuple[NDArray[np.bool_], Images]:
    """Return the object's mask (H, W) and true normals (H, W, 3), NaN elsewhere; its outermost pixels left out."""
    import cv2

    from twin.ground_truth import ground_truth

    truth = ground_truth(object_scene(setup))
    mask = cv2.erode(truth.mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return mask, np.where(mask[..., None], truth.normals, np.float32(np.nan))


def exposed(images: Images, mask: NDArray[np.bool_]) -> Images:
    """Return images (F, H, W, 3) as bright as a photographer would have the object under the mask."""
    return images * np.float32(BRIGHTEST / np.quantile(images[:, mask].max(-1), BRIGHTEST_SHARE))


def photographed(setup: Setup) -> Images:
    """Return the lab's pictures (F, H, W, 3) by flash alone; linear, noiseless."""
    return _by_flash(_of_the_flash(setup))


def room(setup: Setup) -> Images:
    """Return the lab's picture (H, W, 3) in an even light of radiance 1 from all around."""
    return _by_room(setup.shape, setup.fold_deg)


def _of_the_flash(setup: Setup) -> Setup:
    """Return what the flash's light depends on: the same for all ISO and all ambient."""
    return replace(setup, ambient=0.0, iso=100.0)


@lru_cache(maxsize=1)
def _by_flash(setup: Setup) -> Images:
    from twin.ground_truth import ground_truth

    scene = lab_scene(setup)
    images = _to_depth(scene, 2)
    # A mirror shows the table in the light. On the table itself one surface more would be a caustic, found one time in
    # a million, and then as a white speck.
    shown = np.isin(ground_truth(scene).object, _mirrors(scene))
    images[:, shown] = _to_depth(scene, 3)[:, shown]
    if scene.sampling.max_depth > 2:
        # What the halves send to each other: the object alone, and no speck of a mirror's.
        alone = replace(object_scene(setup), lights=scene.lights)
        images += whole(alone, "many", PATHS, onward=True)
    return images


def _mirrors(scene: TwinScene) -> list[int]:
    return [number for number, one in enumerate(scene.objects) if one.material == "chrome"]


def _to_depth(scene: TwinScene, depth: int) -> Images:
    return whole(replace(scene, sampling=replace(scene.sampling, max_depth=depth)), "mitsuba", SAMPLES)


@lru_cache(maxsize=4)
def _by_room(shape: str, fold_deg: float) -> Images:
    return standing(lab_scene(Setup(shape, fold_deg)))


def standing(scene: TwinScene) -> Images:
    """Return the picture (H, W, 3) of a scene in an even light of radiance 1, by light that met one surface."""
    from twin.description.description import Environment
    from twin.engines.engine_choice import Choice
    from twin.engines.layers import standing_light

    film = scene.film()
    lit = replace(
        scene, environment=Environment(ambient=(1.0, 1.0, 1.0)), sampling=replace(scene.sampling, max_depth=2)
    )
    light = standing_light(lit, film, Choice("mitsuba", 0.01, SAMPLES, "the recipe's"), apart=True)
    assert light is not None
    image = np.zeros((scene.camera.height, scene.camera.width, 3), np.float32)
    image[film.rows, film.columns] = light
    return image


def whole(scene: TwinScene, engine: Engine, samples: int, *, onward: bool = False) -> Images:
    """Return a scene's pictures (F, H, W, 3), or only the light that met more than one surface."""
    from twin.engines.engine_choice import Choice
    from twin.engines.layers import render_layers

    film = scene.film()
    layers = render_layers(scene, film, Choice(engine, 0.005, samples, "the recipe's"))
    shown = layers.onward if onward else layers.frames()
    images = np.zeros((len(scene.lights), scene.camera.height, scene.camera.width, 3), np.float32)
    if shown is not None:
        images[:, film.rows, film.columns] = shown
    return images


def _in_shadow(scene: TwinScene, images: Images) -> list[str]:
    """Return the frames in which the white ball is dark: the object stands in its light, as a look at them tells."""
    center, radius = next((center, radius) for kind, radius, center in BALLS if kind == "white")
    u, v = scene.camera.project(np.array([center]))[0]
    reach = int(scene.camera.fx * radius / -center[2])
    ball = images[:, int(v) - reach : int(v) + reach, int(u) - reach : int(u) + reach]
    brightness = ball.mean((1, 2, 3))
    dark = brightness < DARK_SHARE * np.median(brightness)
    return [name for name, left_out in zip(scene.lights.names, dark, strict=True) if left_out]


def _manifest(camera: Camera, name: str, balls: Sequence[Sphere], skip: Sequence[str]) -> str:
    lines = [
        "# A virtual capture: rendered by rgbn, photographed by its virtual camera.",
        "version = 1",
        f'name = "{name}"',
        "",
        "[frames]",
        'flash = "raw/flash_*.dng"',
        *([f"skip = {json.dumps([f'{one}.dng' for one in skip])}"] if skip else []),
        "",
        "[camera]",
        f"width = {camera.width}",
        f"height = {camera.height}",
        *(f"{key} = {getattr(camera, key)}" for key in ("fx", "fy", "cx", "cy")),
    ]
    for number, (kind, radius, _) in enumerate(BALLS):
        lines += ["", "[[spheres]]", f'kind = "{kind}"', f"diameter_mm = {2 * radius}"]
        if balls:
            u, v = balls[number].center_px
            lines += [f"center_px = [{u:.3f}, {v:.3f}]", f"radius_px = {balls[number].radius_px:.3f}"]
    return "\n".join([*lines, "", "[object]", 'mask = "mask.png"', 'normals = "truth.npy"', ""])
