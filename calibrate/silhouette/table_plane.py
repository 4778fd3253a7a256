"""The table's plane as chrome balls show it: each its own, and what the other balls of a session say of it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SLOPE_SIGMA, HEIGHT_SIGMA = 0.1, 0.05
"""How far the plane under one ball differs from that under the next, by slopes and in radii: tables are not flat, and
balls may stand on rings."""

SAME_PLANE = 4.0  # sigmas up to which two planes are one


class TablePlane(NamedTuple):
    """Slopes n_x / n_z and n_y / n_z of a table's normal, its distance from a ball's centre in radii; their sigmas."""

    values: Array  # (3,)
    sigma: Array  # (3,)

    @property
    def steepness(self) -> float:
        """Tangent of the angle between the table's normal and the view."""
        return float(np.hypot(*self.values[:2]))

    def agrees(self, other: "TablePlane") -> bool:
        """Whether the slopes are those of another ball's table."""
        off, sigma = self.values[:2] - other.values[:2], np.hypot(self.sigma[:2], other.sigma[:2])
        return bool((np.abs(off) < SAME_PLANE * sigma).all())


ANY_PLANE = TablePlane(np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, 0.3]))
"""What is known before the table is seen: a small ball shows little of it."""


def shared_plane(planes: Sequence[TablePlane]) -> TablePlane | None:
    """Return what other balls' planes say of one ball's, each as sure as it is; None of none.

    Where it stands on the table, the distance is one radius.
    """
    if not planes:
        return None
    slopes = np.stack([plane.values[:2] for plane in planes])
    weight = 1 / (np.stack([plane.sigma[:2] for plane in planes]) ** 2 + SLOPE_SIGMA**2)
    mean, total = (weight * slopes).sum(0) / weight.sum(0), weight.sum(0)
    return TablePlane(np.append(mean, 1.0), np.append(1 / np.sqrt(total), HEIGHT_SIGMA))
