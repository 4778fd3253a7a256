"""A matte ball's surface, cut into patches: what each showed in each frame, and what the flash alone would do there."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.photometry.matte_shading import FEWEST_PIXELS, Skin, tukey_weights

Array = NDArray[np.float64]
TERMINATOR = 0.1
"""Cosine to the flash within which a large one is half set behind the ball's horizon."""
GLOSS_WIDTHS = (0.15, 0.3, 0.5)
"""Tangents of the angle to the half vector at which a lobe is down to 1 / e."""


@dataclass(frozen=True)
class Patches:
    """One ball in F frames, B patches.

    Parameters
    ----------
    weight : (F, B) float64
        0 where nothing is known; the frame's sum is 1 where it can be read.
    values : (F, B, 3) float64
    shading : (F, B) float64
        max(0, n.l) with a near light's fall-off, of a flash of intensity 1.
    gloss : (W, F, B) float64
        The same times a lobe, for each of `GLOSS_WIDTHS`.
    normals, points : (B, 3) float64
        The patches' own.
    moved : (F, B, 3) float64
        The shading's derivative by the light's position, 1 / mm, or by its unit direction.
    aside : (F, B) float64
        -log of the cosine between a near flash's rays to the patch and to the reference point; 0 for distant ones.
    center : (3,) float64
    radius : float
    """

    weight: Array
    values: Array
    shading: Array
    gloss: Array
    normals: Array
    points: Array
    moved: Array
    aside: Array
    center: Array
    radius: float

    @property
    def readable(self) -> NDArray[np.bool_]:
        """(F,): whether a frame shows enough lit, unclipped skin."""
        return np.any(self.weight > 0, axis=1)

    def only(self, frames: NDArray[np.bool_]) -> "Patches":
        """Return the patches in some of the frames."""
        return replace(
            self,
            weight=self.weight[frames],
            values=self.values[frames],
            shading=self.shading[frames],
            gloss=self.gloss[:, frames],
            moved=self.moved[frames],
            aside=self.aside[frames],
        )


def cut(skin: Skin, directions: Array, positions: Array | None, reference: Array) -> Patches:
    """Average a ball's pixels over its patches, frame by frame; what its neighbours contradict is left out."""
    blocks = int(skin.block.max(initial=-1)) + 1
    count = len(skin.values)
    inside = np.maximum(np.bincount(skin.block, minlength=blocks), 1)[:, None]
    normals, points = (
        np.stack([np.bincount(skin.block, x[:, i], blocks) for i in range(3)], -1) / inside
        for x in (skin.normals, skin.points)
    )
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    weight, shading = np.zeros((count, blocks)), np.zeros((count, blocks))
    values, gloss = np.zeros((count, blocks, 3)), np.zeros((len(GLOSS_WIDTHS), count, blocks))
    bounce = (1 - skin.normals[:, 2]) / 2
    for f in range(count):
        light, toward = _light(skin.points, directions[f], None if positions is None else positions[f], reference)
        cosine = np.sum(skin.normals * light, 1)
        lit = (cosine > TERMINATOR) & ~skin.clipped[f]
        if lit.sum() < FEWEST_PIXELS or not np.isfinite(cosine).all():
            continue
        # The dark side tells ambient and bounce.
        use = lit | ((cosine < -TERMINATOR) & ~skin.clipped[f])
        falling = np.maximum(np.sum(skin.normals * toward, 1), 0)[use]
        pixels = skin.values[f][use].astype(np.float64)
        robust = tukey_weights(np.column_stack([falling, bounce[use], np.ones(len(falling))]), pixels.mean(1))
        block = skin.block[use]
        total = np.bincount(block, robust, blocks)
        some = np.maximum(total, 1e-12)

        def mean(x: Array, block: NDArray = block, robust: Array = robust, some: Array = some) -> Array:
            return np.bincount(block, robust * x, blocks) / some

        half = light[use] + skin.view[use]
        tilt = np.sum(half * skin.normals[use], 1) / np.linalg.norm(half, axis=1)
        square = 1 / np.maximum(tilt, 1e-3) ** 2 - 1
        weight[f] = total / total.sum()
        shading[f] = mean(falling)
        values[f] = np.stack([mean(pixels[:, c]) for c in range(3)], -1)
        gloss[:, f] = [mean(falling * np.exp(-square / width**2)) for width in GLOSS_WIDTHS]
    moved, aside = _moved(normals, points, directions, positions, reference)
    return Patches(weight, values, shading, gloss, normals, points, moved, aside, skin.center, skin.radius)


def _light(points: Array, direction: Array, position: Array | None, reference: Array) -> tuple[Array, Array]:
    """Return unit vectors (P, 3) to a light, and the same with its fall-off."""
    if position is None:
        same = np.broadcast_to(direction, points.shape)
        return same, same
    ray = position - points
    distance = np.linalg.norm(ray, axis=1, keepdims=True)
    return ray / distance, ray * np.sum((position - reference) ** 2) / distance**3


def _moved(
    normals: Array, points: Array, directions: Array, positions: Array | None, reference: Array
) -> tuple[Array, Array]:
    """Return `Patches.moved` and `Patches.aside`."""
    if positions is None:
        lit = (directions @ normals.T > TERMINATOR)[..., None]
        return np.where(lit, normals, 0.0), np.zeros((len(directions), len(normals)))
    ray = positions[:, None] - points
    distance = np.linalg.norm(ray, axis=-1, keepdims=True)
    axis = (positions - reference)[:, None]
    square = np.sum(axis**2, -1, keepdims=True)
    cosine = np.sum(ray * normals, -1, keepdims=True)
    moved = square * (normals / distance**3 - 3 * cosine * ray / distance**5) + 2 * axis * cosine / distance**3
    along = np.sum(ray * axis, -1) / (distance * np.sqrt(square))[..., 0]
    return np.where(cosine > TERMINATOR * distance, moved, 0.0), -np.log(np.maximum(along, 1e-3))
