"""A matte ball's surface, cut into patches: what each showed in each frame, and what the flash alone would do there.

And the light that a table under the ball reflects onto it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.directions import two_across
from calibrate.photometry.matte_shading import FEWEST_PIXELS, Surface, tukey_weights

Array = NDArray[np.float64]
TERMINATOR = 0.1  # cosine to the flash within which a large one is half set behind the ball's horizon
RINGS, SPOKES, FIRST_RING, GROWTH = 18, 24, 0.1, 1.33
"""Patches of the table around the ball's foot: rings that widen by `GROWTH`, from a tenth of the radius."""


class Meter(NamedTuple):
    """The lights as a white ball is to read their intensities."""

    directions: Array  # (F, 3) unit, of distant lights
    positions: Array | None  # (F, 3) mm, of near lights
    reference: Array  # (3,) where the intensities hold, mm
    covariance: Array | None = None  # (F, 3, 3) of each position, mm^2, or of each direction; None: exact

    def with_sigmas(self, sigma_deg: Array, range_sigma: Array) -> "Meter":
        """Return the same with the covariance that a direction's and a relative range's sigmas (F,) make."""
        along = self.directions[:, :, None] * self.directions[:, None, :]
        across = np.deg2rad(np.nan_to_num(sigma_deg))[:, None, None] ** 2 * (np.eye(3) - along)
        if self.positions is None:
            return self._replace(covariance=across)
        distance = np.linalg.norm(self.positions - self.reference, axis=1)[:, None, None]
        along = np.nan_to_num(range_sigma)[:, None, None] ** 2 * along
        return self._replace(covariance=distance**2 * (across + along))


@dataclass(frozen=True)
class Patches:
    """One ball in F frames, B patches, under directions or positions `toward`."""

    weight: Array  # (F, B) 0 where nothing is known; the frame's sum is 1 where it can be read
    values: Array  # (F, B, 3)
    shading: Array  # (F, B) max(0, n.l) with a near light's fall-off, of a flash of intensity 1
    moved: Array  # (F, B, 3) the shading's derivative by the light's position, 1 / mm, or by its unit direction
    toward: Array  # (F, 3) unit directions of distant lights, or positions
    axis: Array | None  # (F, 3) from the reference point, where the intensity is 1, to near lights' positions
    normals: Array  # (B, 3)
    center: Array  # (3,)
    radius: float

    @property
    def readable(self) -> NDArray[np.bool_]:
        """(F,): whether a frame shows enough lit, unclipped surface."""
        return np.any(self.weight > 0, axis=1)

    def only(self, frames: NDArray[np.bool_]) -> "Patches":
        """Return the patches in some of the frames."""
        names = ("weight", "values", "shading", "moved", "toward")
        some = {name: getattr(self, name)[frames] for name in names}
        axis = None if self.axis is None else self.axis[frames]
        return replace(self, axis=axis, **some)


def cut(surface: Surface, meter: Meter) -> Patches:
    """Average a ball's pixels over its patches, frame by frame; what its neighbours contradict is left out."""
    blocks = int(surface.block.max(initial=-1)) + 1
    count = len(surface.values)
    inside = np.maximum(np.bincount(surface.block, minlength=blocks), 1)[:, None]
    normals, points = (
        np.stack([np.bincount(surface.block, x[:, i], blocks) for i in range(3)], -1) / inside
        for x in (surface.normals, surface.points)
    )
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    weight, shading = np.zeros((count, blocks)), np.zeros((count, blocks))
    values = np.zeros((count, blocks, 3))
    bounce = (1 - surface.normals[:, 2]) / 2
    for f in range(count):
        light, toward = _light(surface.points, meter, f)
        cosine = np.sum(surface.normals * light, 1)
        lit = (cosine > TERMINATOR) & ~surface.clipped[f]
        if lit.sum() < FEWEST_PIXELS or not np.isfinite(cosine).all():
            continue
        # The dark side shows ambient light and bounce.
        use = lit | ((cosine < -TERMINATOR) & ~surface.clipped[f])
        falling = np.maximum(np.sum(surface.normals * toward, 1), 0)[use]
        pixels = surface.values[f][use].astype(np.float64)
        robust = tukey_weights(np.column_stack([falling, bounce[use], np.ones(len(falling))]), pixels.mean(1))
        block = surface.block[use]
        total = np.bincount(block, robust, blocks)
        some = np.maximum(total, 1e-12)

        def mean(x: Array, block: NDArray = block, robust: Array = robust, some: Array = some) -> Array:
            return np.bincount(block, robust * x, blocks) / some

        weight[f] = total / total.sum()
        shading[f] = mean(falling)
        values[f] = np.stack([mean(pixels[:, c]) for c in range(3)], -1)
    moved = _moved(normals, points, meter)
    toward, axis = meter.directions, None
    if meter.positions is not None:
        toward, axis = meter.positions, meter.positions - meter.reference
    return Patches(weight, values, shading, moved, toward, axis, normals, surface.center, surface.radius)


def _light(points: Array, meter: Meter, f: int) -> tuple[Array, Array]:
    """Return unit vectors (P, 3) to a light, and the same with its fall-off."""
    if meter.positions is None:
        same = np.broadcast_to(meter.directions[f], points.shape)
        return same, same
    ray = meter.positions[f] - points
    distance = np.linalg.norm(ray, axis=1, keepdims=True)
    return ray / distance, ray * np.sum((meter.positions[f] - meter.reference) ** 2) / distance**3


def _moved(normals: Array, points: Array, meter: Meter) -> Array:
    """Return `Patches.moved`."""
    if meter.positions is None:
        lit = (meter.directions @ normals.T > TERMINATOR)[..., None]
        return np.where(lit, normals, 0.0)
    ray = meter.positions[:, None] - points
    distance = np.linalg.norm(ray, axis=-1, keepdims=True)
    axis = (meter.positions - meter.reference)[:, None]
    square = np.sum(axis**2, -1, keepdims=True)
    cosine = np.sum(ray * normals, -1, keepdims=True)
    moved = square * (normals / distance**3 - 3 * cosine * ray / distance**5) + 2 * axis * cosine / distance**3
    return np.where(cosine > TERMINATOR * distance, moved, 0.0)


def bounce_of_table(ball: Patches, up: Array) -> Array:
    """Return (F, B), the light of each flash that comes to the ball's parts from an even, matte, white table under it.

    The table's unit normal is `up` (3,), and it has no end. Of that of a surface that faces the flash at the reference
    point.

    Notes
    -----
    The ball gets sum over the table's patches of E cos cos' dA / (pi d^2). E has the flash's own
    cosine and fall-off at the patch, and is zero in the ball's own shadow: that is why the side that faces the flash
    gets more, and why one constant for all frames is wrong by a third.
    """
    normals, radius = ball.normals, ball.radius
    side, other = two_across(up)
    edges = np.concatenate([[0.0], FIRST_RING * GROWTH ** np.arange(RINGS)]) * radius
    middle = 0.5 * (edges[1:] + edges[:-1])
    area = np.repeat(np.pi * (edges[1:] ** 2 - edges[:-1] ** 2) / SPOKES, SPOKES)
    turn = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    # All places are from the ball's centre: products of matrices then lose no digits.
    patches = (middle[:, None, None] * ring).reshape(-1, 3) - radius * up
    away = np.sum(patches**2, 1)
    if ball.axis is None:
        count = len(ball.toward)
        lit, along = np.broadcast_to(ball.toward @ up[:, None], (count, len(patches))), -ball.toward @ patches.T
    else:
        place, axis = ball.toward - ball.center, ball.axis
        product = place @ patches.T
        square = np.sum(place**2, 1)[:, None] - 2 * product + away
        fall = np.sum(axis**2, 1)[:, None]
        lit = (place @ up[:, None] + radius) / np.sqrt(square) * fall / square
        along = (away - product) / np.sqrt(square)
    # The ball hides the flash from patches whose ray passes its centre nearer than its radius.
    lit = np.where((along > 0) & (away - along**2 < radius**2), 0.0, np.maximum(lit, 0))
    # A part of the ball lies at radius * normal; the way from there to a patch, along either's normal.
    here = np.maximum(normals @ patches.T - radius, 0)
    there = radius * (normals @ up[:, None] + 1)
    distance = away + radius**2 - 2 * radius * normals @ patches.T
    return lit @ (here * there / (np.pi * distance**2) * area).T
