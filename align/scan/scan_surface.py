"""A scan's surface while it is mended: areas, and which of its faces share which edges."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scene.same_rows import Integers, group_numbers

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Edges:
    """The edges of T faces. A half-edge h is edge h // T of face h % T: from its corner h // T to the next."""

    one: Integers
    two: Integers
    """one, two: (P,): faces that share an edge of exactly two."""
    against: NDArray[np.bool_]
    """(P,): whether the two run along it in the same direction: one of them is turned over."""
    border: Integers
    """(B,). Half-edges whose edge has no other face."""
    crowded: Integers
    """(C,): one half-edge of each edge with three and more faces."""

    @property
    def total(self) -> int:
        """How many edges there are."""
        return len(self.one) + len(self.border) + len(self.crowded)


@dataclass(frozen=True)
class Surface:
    """Vertices (V, 3) in the file's unit, faces (T, 3), and what follows from them, computed once when asked for."""

    vertices: Array
    faces: Integers

    @cached_property
    def cross(self) -> Array:
        """(T, 3) (b - a) x (c - a): along the normal, twice the area long."""
        a = self.vertices[self.faces[:, 0]]
        return np.cross(self.vertices[self.faces[:, 1]] - a, self.vertices[self.faces[:, 2]] - a)

    @cached_property
    def area(self) -> Array:
        """(T,) twice the faces' areas."""
        return np.sqrt(np.einsum("tk,tk->t", self.cross, self.cross))

    @cached_property
    def middle(self) -> Array:
        """(T, 3) the faces' middles."""
        total = self.vertices[self.faces[:, 0]]
        total += self.vertices[self.faces[:, 1]]
        total += self.vertices[self.faces[:, 2]]
        total /= 3
        return total

    @cached_property
    def edges(self) -> Edges:
        count, faces = len(self.faces), self.faces
        start, end = faces.T.ravel(), faces[:, [1, 2, 0]].T.ravel()
        forward = start < end
        keys = np.where(forward, start, end) * (faces.max(initial=0) + 1) + np.where(forward, end, start)
        order, first = group_numbers(keys)
        total = np.diff(first, append=len(keys))
        one, two = order[first[total == 2]], order[first[total == 2] + 1]
        against = forward[one] == forward[two]
        return Edges(one % count, two % count, against, order[first[total == 1]], order[first[total > 2]])

    def ends(self, half_edges: Integers) -> Integers:
        """Return the two vertices (N, 2) of half-edges (N,)."""
        face, corner = half_edges % len(self.faces), half_edges // len(self.faces)
        return np.stack([self.faces[face, corner], self.faces[face, (corner + 1) % 3]], -1)

    @cached_property
    def piece(self) -> NDArray[np.int32]:
        """(T,) the number of the connected piece that each face belongs to."""
        return connected(self.edges.one, self.edges.two, len(self.faces))

    def with_faces(self, kept: NDArray[np.bool_]) -> "Surface":
        """Return the surface of the faces `kept` (T,), all vertices with it."""
        return self if kept.all() else Surface(self.vertices, self.faces[kept])

    def without_unused(self) -> "Surface":
        """Return the surface without the vertices that no face uses."""
        used = np.zeros(len(self.vertices), bool)
        used[self.faces] = True
        return self if used.all() else Surface(self.vertices[used], renumber(used)[self.faces])


def connected(one: Integers, two: Integers, count: int) -> NDArray[np.int32]:
    """Return the connected component (count,) of each of `count` nodes under the links one - two."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(one), np.int8), (one, two)), (count, count))
    return connected_components(graph, directed=False)[1]


def renumber(kept: NDArray[np.bool_]) -> Integers:
    """Return the new index (N,) of each old one when only `kept` (N,) stay."""
    return np.cumsum(kept) - 1
