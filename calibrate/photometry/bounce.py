"""What a table throws back at a ball that stands on it."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RINGS, SPOKES, GROWTH = 18, 24, 1.33
"""Patches of the table around the ball's foot: rings that widen by `GROWTH`, from a tenth of the radius."""


def table_bounce(
    normals: Array, center: Array, radius: float, up: Array, toward: Array, axis: Array | None, beam: float = 0.0
) -> Array:
    """Return the light that an even, matte, white table sends to each normal of a ball, under each flash.

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
    beam : float
        mu: near flashes fall off by cos^mu of the angle to their axis.

    Returns
    -------
    irradiance : (F, B) float64
        Of that of a surface that faces the flash; times the table's albedo it is what the ball gets.

    Notes
    -----
    sum over the table's patches of E cos cos' dA / (pi d^2). E has the flash's own
    cosine and fall-off at the patch, and is zero in the ball's own shadow: that is why the side that faces the flash
    gets more, and why one constant for all frames is wrong by a third.
    """
    side = np.cross(up, [0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(up, side)
    edges = np.concatenate([[0.0], 0.1 * GROWTH ** np.arange(RINGS)]) * radius
    middle = 0.5 * (edges[1:] + edges[:-1])
    area = np.pi * (edges[1:] ** 2 - edges[:-1] ** 2) / SPOKES
    turn = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    patches = (center - radius * up) + (middle[:, None, None] * ring).reshape(-1, 3)
    area = np.repeat(area, SPOKES)

    ray = (
        np.broadcast_to(toward[:, None], (len(toward), len(patches), 3)) if axis is None else toward[:, None] - patches
    )
    square = np.sum(ray**2, -1)
    lit = np.maximum(ray @ up, 0) / np.sqrt(square)
    if axis is not None:
        fall = np.sum(axis**2, -1, keepdims=True)
        lit = lit * fall / square
        if beam:
            lit = lit * (np.maximum(np.einsum("fti,fi->ft", ray, axis), 0) / np.sqrt(square * fall)) ** beam
    offset = center - patches
    along = np.einsum("fti,ti->ft", ray, offset) / np.sqrt(square)
    # The ball hides the flash from patches whose ray passes its centre nearer than its radius.
    lit = np.where((along > 0) & (np.sum(offset**2, -1) - along**2 < radius**2), 0.0, lit)

    way = patches - (center + radius * normals[:, None])
    distance = np.sum(way**2, -1)
    here = np.maximum(np.einsum("bti,bi->bt", way, normals), 0)
    there = np.maximum(-way @ up, 0)
    kernel = here * there / (np.pi * distance**2) * area
    return lit @ kernel.T
