"""Where an object stands, in the numbers that a person turns: the place of its middle, angles, size."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from twin.description.description import TwinObject

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Placement:
    """An object's matrix in numbers.

    middle_mm (3,): Of the object's bounding box in its own frame, where it is now: what gizmos turn it about.
    rotate_deg (3,): About x, then y, then z, the axes standing still.
    scale (3,): Factors along the object's own axes, before it is turned. The first is negative where the matrix
        mirrors.
    own_mm (3,): Extent of the mesh along its own axes.
    is_exact: False: the matrix shears as well, and these numbers are the nearest without.
    """

    middle_mm: Array
    rotate_deg: Array
    scale: Array
    own_mm: Array
    is_exact: bool = True

    @property
    def rotation(self) -> Array:
        """(3, 3)."""
        return Rotation.from_euler("xyz", self.rotate_deg, degrees=True).as_matrix()

    @property
    def size_mm(self) -> Array:
        """(3,) extent along the object's own axes, as it is."""
        return np.abs(self.scale) * self.own_mm

    def sized(self, size_mm: ArrayLike, *, in_proportion: bool) -> "Placement":
        """Return the placement of another extent (3,); a flat mesh stays flat.

        in_proportion: What was changed of the extent changes the rest too.
        """
        was, wanted = self.size_mm, np.asarray(size_mm, float)
        factors = np.divide(wanted, was, out=np.ones(3), where=was > 0)
        if in_proportion:
            factors = np.full(3, factors[np.argmax(np.abs(factors - 1))])
        return replace(self, scale=self.scale * factors)


def placement_of(one: TwinObject) -> Placement:
    """Return an object's placement.

    The matrix' linear part is R diag(s) if its columns are at right angles: s their lengths, R the rest. Else R is the
    rotation nearest to it (its polar part), and s the lengths.
    """
    linear = one.matrix[:3, :3]
    low, high = one.mesh.vertices.min(0), one.mesh.vertices.max(0)
    scale = np.linalg.norm(linear, axis=0)
    if np.linalg.det(linear) < 0:
        scale[0] = -scale[0]
    turned = linear / scale
    is_exact = bool(np.allclose(turned.T @ turned, np.eye(3), atol=1e-6))
    u, _, v = np.linalg.svd(turned)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    # Where y is +-90 degrees, x and z turn about one axis, and z is taken as 0.
    angles = Rotation.from_matrix(rotation).as_euler("xyz", degrees=True, suppress_warnings=True)
    return Placement(linear @ ((low + high) / 2) + one.matrix[:3, 3], angles, scale, high - low, is_exact)


def matrix_of(one: TwinObject, placement: Placement) -> Array:
    """Return the matrix (4, 4) that gives an object a placement."""
    matrix, vertices = np.eye(4), one.mesh.vertices
    matrix[:3, :3] = placement.rotation * placement.scale
    matrix[:3, 3] = placement.middle_mm - matrix[:3, :3] @ (vertices.min(0) + vertices.max(0)) / 2
    return matrix


def quaternion(rotation: Array) -> Array:
    """Return (w, x, y, z), unit, w >= 0, of a rotation (3, 3): viser's."""
    return Rotation.from_matrix(rotation).as_quat(canonical=True, scalar_first=True)


def rotation_of(wxyz: Array) -> Array:
    """Return the rotation (3, 3) of a quaternion (w, x, y, z)."""
    return Rotation.from_quat(np.asarray(wxyz, float), scalar_first=True).as_matrix()
