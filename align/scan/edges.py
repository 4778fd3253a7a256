"""Which faces of a mesh share which edges: neighbours, borders, pieces."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from align.scan.same_rows import group_numbers, renumber

Integers = NDArray[np.int64]
Faces = NDArray[np.int64]


@dataclass(frozen=True)
class Edges:
    """The edges of T faces. A half-edge h is edge h // T of face h % T: from its corner h // T to the next.

    Parameters
    ----------
    count : int
        T.
    one, two : (P,) int64
        Faces that share an edge of exactly two.
    against : (P,) bool
        Whether the two run along it in the same direction: one of them is turned over.
    border : (B,) int64
        Half-edges whose edge has no other face.
    crowded : (C,) int64
        One half-edge of each edge with three and more faces.
    """

    count: int
    one: Integers
    two: Integers
    against: NDArray[np.bool_]
    border: Integers
    crowded: Integers

    @property
    def total(self) -> int:
        """How many edges there are."""
        return len(self.one) + len(self.border) + len(self.crowded)

    def ends(self, faces: Faces, half_edges: Integers) -> Integers:
        """Return the two vertices (N, 2) of half-edges (N,)."""
        face, corner = half_edges % self.count, half_edges // self.count
        return np.stack([faces[face, corner], faces[face, (corner + 1) % 3]], -1)

    def border_ends(self, faces: Faces) -> Integers:
        """Return the two vertices (B, 2) of the border's half-edges."""
        return self.ends(faces, self.border)

    @cached_property
    def piece(self) -> NDArray[np.int32]:
        """(T,) the number of the connected piece that each face belongs to."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        graph = coo_matrix((np.ones(len(self.one), np.int8), (self.one, self.two)), (self.count, self.count))
        return connected_components(graph, directed=False)[1]

    def select(self, kept: NDArray[np.bool_]) -> "Edges":
        """Return the edges of the faces that are kept (T,): whole pieces, so that no edge loses one of its two."""
        new, pair = renumber(kept), kept[self.one]

        def half(edges: Integers) -> Integers:
            edges = edges[kept[edges % self.count]]
            return edges // self.count * int(kept.sum()) + new[edges % self.count]

        # A crowded edge may lie between a kept piece and a dropped one: it is said before, and not used after.
        return Edges(
            int(kept.sum()), new[self.one[pair]], new[self.two[pair]], self.against[pair], half(self.border),
            half(self.crowded),
        )  # fmt: skip


def edges_of(faces: Faces) -> Edges:
    """Return the edges of faces (T, 3)."""
    count = len(faces)
    start, end = faces.T.ravel(), faces[:, [1, 2, 0]].T.ravel()
    forward = start < end
    keys = np.where(forward, start, end) * (faces.max(initial=0) + 1) + np.where(forward, end, start)
    order, first = group_numbers(keys)
    total = np.diff(first, append=len(keys))
    pair = first[total == 2]
    one, two = order[pair], order[pair + 1]
    return Edges(
        count, one % count, two % count, forward[one] == forward[two], order[first[total == 1]], order[first[total > 2]]
    )
