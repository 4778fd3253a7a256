"""Pictures of the preview: one at once, of rays to what is seen and to the light; and what the renderer makes of it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scene.normals import unit
from studio.display_mesh import display_mesh
from twin.description.description import TwinScene
from twin.ground_truth import ground_truth

Picture = NDArray[np.float32]
SLICES = 4
"""In which a refined picture is rendered: between them another may be drawn."""
GLOSS_AT_NORMAL = 0.04
"""Share of the light that a smooth clear surface gives back straight; a metal gives back all."""


def fitted(scene: TwinScene, width: int, height: int, light: int) -> TwinScene:
    """Return the scene under one light, before a camera of at most width x height pixels that sees the same."""
    camera = scene.camera
    scale = min(1.0, width / camera.width, height / camera.height)
    across, down = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    small = camera.scaled(across, down, across / camera.width, down / camera.height)
    return replace(scene, camera=small, lights=scene.lights.only([light]), radii_mm=scene.radii_mm[[light]])


def first_picture(scene: TwinScene, light: int, *, width: int, height: int) -> Picture:
    """Return what of one light comes by one surface, (h, w, 3) linear, at most `width` x `height`.

    Matte bodies as they are, highlights about so [Walter2007]; a disc is taken for a point, a large mesh is a coarse
    one, the environment is left out. Raises RenderError: the camera sees nothing.
    """
    small = fitted(scene, width, height, light)
    small = replace(small, objects=tuple(replace(one, mesh=display_mesh(one.mesh)) for one in small.objects))
    truth, lights = ground_truth(small), small.lights
    v, u = np.nonzero(truth.mask & ~(truth.attached | truth.cast).any(-1))
    origins, rays = small.camera.rays(np.stack([u, v], -1))
    depth = ((truth.z_mm[v, u] - origins[..., 2]) / rays[..., 2])[:, None]
    normals, offsets = truth.normals[v, u], lights.toward(origins + depth * rays)[0]
    toward = unit(offsets)
    half = unit(toward - rays)
    cosine, along = np.sum(normals * toward, 1), np.clip(np.sum(normals * half, 1), 0, 1)
    alpha = np.nan_to_num(np.maximum(truth.roughness[v, u], 0.05))[:, None] ** 2
    spread = alpha / (4 * (along[:, None] ** 2 * (alpha - 1) + 1) ** 2)
    metal = np.all(truth.albedo[v, u] == 0, 1, keepdims=True)
    gloss = np.nan_to_num(truth.specularity[v, u])[:, None] * np.where(metal, 1.0, GLOSS_AT_NORMAL)
    matte = np.nan_to_num(truth.albedo[v, u], nan=0.5) * cosine[:, None]
    picture = np.zeros((*truth.mask.shape, 3), np.float32)
    strength = lights.intensities[0] * np.linalg.norm(offsets, axis=1, keepdims=True)
    picture[v, u] = strength * (matte + gloss * spread * small.white)
    return picture


def refining(scene: TwinScene, light: int, *, width: int, height: int, samples: int = 16) -> Iterator[Picture | None]:
    """Render everything under one light in slices: interreflection, environment, mirrors, discs, wax.

    samples: Paths a pixel, where any are needed. Yields None after each slice, and the picture in the end. What stock
    Mitsuba must render is one slice. Raises RenderError: the scene is at fault, all faults told.
    """
    from twin.description.description_check import check_scene
    from twin.engines.engine_choice import choose_engine
    from twin.engines.light_layers import Piece, PieceRenderer, standing_light

    check_scene(scene)
    lit = fitted(scene, width, height, light)
    film, (engine, _) = lit.film(), choose_engine(lit)
    renderer, rows = PieceRenderer(lit, film, engine), film.size[0]
    step = rows if engine == "mitsuba" else -(-rows // SLICES)
    bands = []
    for row in range(0, rows, step):
        yield None
        piece = Piece(slice(0, 1), slice(row, min(row + step, rows)))
        bands.append(renderer.render(piece, samples).frames()[0])
    frame, standing = np.concatenate(bands), standing_light(lit, film)
    yield film.whole(np.asarray(frame if standing is None else frame + standing, np.float32))
