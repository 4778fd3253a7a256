"""Rigid motions, and the scan's place in front of the camera."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """A rigid motion x -> R x + t, millimetres. Named `target_from_source`."""

    matrix: Array
    """(4, 4) float64, [[R, t], [0, 1]]."""

    def __repr__(self) -> str:
        x, y, z = self.translation
        return f"pose, turned by {self.angle_deg():.2f} degrees, moved by ({x:.2f}, {y:.2f}, {z:.2f}) mm"

    @classmethod
    def from_rotation_translation(cls, rotation: ArrayLike, translation: ArrayLike) -> "Pose":
        matrix = np.eye(4)
        matrix[:3, :3] = rotation
        matrix[:3, 3] = translation
        return cls(matrix)

    @property
    def rotation(self) -> Array:
        return self.matrix[:3, :3]

    @property
    def translation(self) -> Array:
        return self.matrix[:3, 3]

    def inverse(self) -> "Pose":
        return Pose.from_rotation_translation(self.rotation.T, -self.rotation.T @ self.translation)

    def __matmul__(self, other: "Pose") -> "Pose":
        return Pose(self.matrix @ other.matrix)

    def apply(self, points: ArrayLike) -> Array:
        """Move points (..., 3)."""
        return np.asarray(points, np.float64) @ self.rotation.T + self.translation

    def rotate(self, vectors: ArrayLike) -> Array:
        """Turn directions (..., 3); no translation."""
        return np.asarray(vectors, np.float64) @ self.rotation.T

    def angle_deg(self) -> float:
        """Return the angle of the rotation, 0 to 180 degrees."""
        from scipy.spatial.transform import Rotation

        return float(np.degrees(Rotation.from_matrix(self.rotation).magnitude()))


def rotation_from_vector(vector: ArrayLike) -> Array:
    """Return the (3, 3) rotation by |vector| radians about vector."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.asarray(vector, np.float64)).as_matrix()
