"""A triangle mesh: the scan, an object of the twin, a surface that was found."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, and what is known at their corners.

    Parameters
    ----------
    vertices : (V, 3) float64
        Millimetres; of `formats.meshes.scan_files.read_mesh_file` in the file's unit.
    faces : (T, 3) int64
        Vertex indices, counter-clockwise seen from outside.
    normals : (V, 3) float64 or None
        Interpolated over a face; None: every face is flat. Length 1, or shorter where they are means of others.
    texcoords : (V, 2) float64 or None
        (s, t), t down: the first row of a picture lies at t = 0. A vertex that has several is there several times.
    colours : (V, 3) float64 or None
        Linear reflectance.
    repairs : tuple of str
        What was mended on loading, for the report.
    """

    vertices: Array
    faces: NDArray[np.int64]
    normals: Array | None = None
    texcoords: Array | None = None
    colours: Array | None = None
    repairs: tuple[str, ...] = ()

    def moved(self, matrix: Array) -> "Mesh":
        """Return the mesh after an affine map (4, 4); one that mirrors turns the faces over, so that out stays out."""
        linear = matrix[:3, :3]
        normals, faces = self.normals, self.faces
        if np.linalg.det(linear) < 0:
            faces = faces[:, ::-1]
        if normals is not None and not np.array_equal(linear, np.eye(3)):
            length = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = normals @ np.linalg.inv(linear)
            now = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = normals * (length / np.where(now > 0, now, 1))
        vertices = self.vertices @ linear.T + matrix[:3, 3]
        return replace(self, vertices=vertices, faces=faces, normals=normals)

    @cached_property
    def face_normals(self) -> NDArray[np.float64]:
        """(T, 3) unit; zero for a face without area."""
        cross = self._cross
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return cross / np.where(length > 0, length, 1)

    @cached_property
    def vertex_normals(self) -> NDArray[np.float64]:
        """(V, 3) unit, the faces' normals weighted by area."""
        corners, count = np.ascontiguousarray(self.faces.T), len(self.vertices)
        # One axis at a time: ten times faster than np.add.at on rows.
        axes = np.ascontiguousarray(self._cross.T)
        sums = [sum(np.bincount(corner, axis, count) for corner in corners) for axis in axes]
        total = np.stack(sums, 1).astype(self.vertices.dtype)
        length = np.sqrt(np.einsum("vi,vi->v", total, total))[:, None]
        return total / np.where(length > 0, length, 1)

    @cached_property
    def center_mm(self) -> NDArray[np.float64]:
        """(3,) middle of the bounding box."""
        return (self.vertices.min(0) + self.vertices.max(0)) / 2

    @cached_property
    def radius_mm(self) -> float:
        """Radius of the sphere about `center_mm` that holds every vertex."""
        return float(np.linalg.norm(self.vertices - self.center_mm, axis=1).max())

    @cached_property
    def is_closed(self) -> bool:
        """Every edge has two faces."""
        edges = np.sort(self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())

    @cached_property
    def _cross(self) -> NDArray[np.float64]:
        a, b, c = (self.vertices.take(self.faces[:, corner], 0) for corner in range(3))
        (x, y, z), (u, v, w) = (b - a).T, (c - a).T
        # Three times as fast as np.cross.
        return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], 1)


def first_of_same(rows: NDArray) -> NDArray[np.int64]:
    """Return for each row (N, k) of 8-byte numbers the lowest index of an equal row (N,): equal bit for bit.

    On meshes of a million faces `numpy.unique(axis=0)` takes ten times as long.
    """
    import pandas

    columns = [pandas.Series(column) for column in np.ascontiguousarray(rows).view(np.uint64).T]
    return pandas.Series(np.arange(len(rows))).groupby(columns, sort=False).transform("first").to_numpy(np.int64)
