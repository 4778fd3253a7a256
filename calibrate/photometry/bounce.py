"""What a table throws back at a ball that stands on it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RINGS, SPOKES, GROWTH = 18, 24, 1.33
"""Patches of the table around the ball's foot: rings that widen by `GROWTH`, from a tenth of the radius."""


@dataclass(frozen=True)
class Table:
    """An even, matte, white table under a ball, cut into T patches.

    Parameters
    ----------
    lit : (F, T) float64
        Each flash's irradiance on the patches, of that of a surface that faces it at the reference point.
    aside : (F, T) float64
        -log of the cosine between a near flash's rays to the patch and to the reference point; 0 for distant ones.
    seen : (B, T) float64
        What of a patch's light falls on each part of the ball.
    """

    lit: Array
    aside: Array
    seen: Array

    def bounce(self, beam: float = 0.0) -> Array:
        """Return (F, B), the light on the ball's parts where flashes fall off by cos^mu of the angle to their axis.

        Of that of a surface that faces the flash; times the table's albedo it is what the ball gets.
        """
        return (self.lit * np.exp(-beam * self.aside)) @ self.seen.T

    def by_beam(self, beam: float) -> Array:
        """Return the derivative (F, B) of `bounce` by mu."""
        return -(self.lit * self.aside * np.exp(-beam * self.aside)) @ self.seen.T


def table_under(
    normals: Array, center: Array, radius: float, up: Array, toward: Array, axis: Array | None = None
) -> Table:
    """Return the table on which a ball stands, under each flash.

    Parameters
    ----------
    normals : (B, 3) float
        Of the ball's surface.
    center : (3,) float
    radius : float
    up : (3,) float
        The table's unit normal; the ball touches it.
    toward : (F, 3) float
        Unit directions of distant lights, or positions where `axis` is given.
    axis : (F, 3) float or None
        From the reference point, where the flashes' intensity is 1, to each position.

    Notes
    -----
    The ball gets sum over the table's patches of E cos cos' dA / (pi d^2). E has the flash's own
    cosine and fall-off at the patch, and is zero in the ball's own shadow: that is why the side that faces the flash
    gets more, and why one constant for all frames is wrong by a third.
    """
    side = np.cross(up, [0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(up, side)
    edges = np.concatenate([[0.0], 0.1 * GROWTH ** np.arange(RINGS)]) * radius
    middle = 0.5 * (edges[1:] + edges[:-1])
    area = np.repeat(np.pi * (edges[1:] ** 2 - edges[:-1] ** 2) / SPOKES, SPOKES)
    turn = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    # All places are from the ball's centre: products of matrices then lose no digits.
    patches = (middle[:, None, None] * ring).reshape(-1, 3) - radius * up
    away = np.sum(patches**2, 1)
    if axis is None:
        square = np.ones((len(toward), 1))
        lit, along = np.broadcast_to(toward @ up[:, None], (len(toward), len(patches))), -toward @ patches.T
        aside = np.zeros((1, 1))
    else:
        place = toward - center
        product = place @ patches.T
        square = np.sum(place**2, 1)[:, None] - 2 * product + away
        fall = np.sum(axis**2, 1)[:, None]
        lit = (place @ up[:, None] + radius) / np.sqrt(square) * fall / square
        along = (away - product) / np.sqrt(square)
        cosine = (np.sum(place * axis, 1)[:, None] - axis @ patches.T) / np.sqrt(square * fall)
        aside = -np.log(np.maximum(cosine, 1e-9))
    # The ball hides the flash from patches whose ray passes its centre nearer than its radius.
    lit = np.where((along > 0) & (away - along**2 < radius**2), 0.0, np.maximum(lit, 0))

    # A part of the ball lies at radius * normal; the way from there to a patch, along either's normal.
    here = np.maximum(normals @ patches.T - radius, 0)
    there = radius * (normals @ up[:, None] + 1)
    distance = away + radius**2 - 2 * radius * normals @ patches.T
    return Table(lit, aside, here * there / (np.pi * distance**2) * area)
