"""Where an object stands, in the numbers that a person turns: the place of its middle, angles, factors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
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
    is_exact: False: the matrix shears as well, and these numbers are the nearest without.
    """

    middle_mm: Array
    rotate_deg: Array
    scale: Array
    is_exact: bool = True

    @property
    def rotation(self) -> Array:
        """(3, 3)."""
        return Rotation.from_euler("xyz", self.rotate_deg, degrees=True).as_matrix()


def own_middle(one: TwinObject) -> Array:
    """Return the middle (3,) of an object's bounding box in its own frame."""
    vertices = one.mesh.vertices
    return (vertices.min(0) + vertices.max(0)) / 2


def placement_of(one: TwinObject) -> Placement:
    """Return an object's placement.

    The matrix' linear part is R diag(s) if its columns are at right angles: s their lengths, R the rest. Else R is the
    rotation nearest to it (its polar part), and s the lengths.
    """
    linear = one.matrix[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    if np.linalg.det(linear) < 0:
        scale[0] = -scale[0]
    turned = linear / scale
    is_exact = bool(np.allclose(turned.T @ turned, np.eye(3), atol=1e-6))
    u, _, v = np.linalg.svd(turned)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    # Where y is +-90 degrees, x and z turn about one axis, and z is taken as 0.
    angles = Rotation.from_matrix(rotation).as_euler("xyz", degrees=True, suppress_warnings=True)
    return Placement(linear @ own_middle(one) + one.matrix[:3, 3], angles, scale, is_exact)


def matrix_of(one: TwinObject, placement: Placement) -> Array:
    """Return the matrix (4, 4) that gives an object a placement."""
    matrix = np.eye(4)
    matrix[:3, :3] = placement.rotation * placement.scale
    matrix[:3, 3] = placement.middle_mm - matrix[:3, :3] @ own_middle(one)
    return matrix


def quaternion(rotation: Array) -> Array:
    """Return (w, x, y, z), unit, w >= 0, of a rotation (3, 3): viser's."""
    return Rotation.from_matrix(rotation).as_quat(canonical=True, scalar_first=True)


def rotation_of(wxyz: Array) -> Array:
    """Return the rotation (3, 3) of a quaternion (w, x, y, z)."""
    return Rotation.from_quat(np.asarray(wxyz, float), scalar_first=True).as_matrix()
