"""Pixels beside each other, and two labels upon them: the least sum of their own costs and of the border between."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Labels = NDArray[np.intp]

TURN = 2 * float(np.log(2))
"""What each pair that a border parts costs, as deviance: between triangles a border turns left or right."""
FARTHEST = 4.0
"""Pairs farther apart than so many times the pixels' spacing are not beside each other."""
FINE = 1_000
"""Whole numbers to a unit of deviance, of the cut."""


class Neighbours:
    """Pixels (P,) in the picture, joined by Delaunay's triangles."""

    def __init__(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> None:
        from scipy.spatial import Delaunay

        points = np.stack([columns, rows], -1).astype(np.float64)
        corners = Delaunay(points).simplices
        pairs = np.unique(np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), 1), axis=0)
        length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
        self._count = len(points)
        self._pairs = pairs[length < FARTHEST * np.median(length)]

    def cut(self, rather_first: Array) -> Labels:
        """Return labels 0 and 1 (P,) of little description; `rather_first` (P,): deviance of 1 less that of 0.

        Those of the least sum of own costs and turns, of which regions go that do not pay for the place where their
        border begins.
        """
        return self._without_islands(self.least(rather_first), rather_first)

    def least(self, rather_first: Array) -> Labels:
        """Return the labels of the least sum of own costs and turns: exact for two labels, by a cut [Greig1989]."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import breadth_first_order, maximum_flow

        count, pairs = self._count, self._pairs
        # A pixel whose own cost exceeds all its pairs' follows it anyway: what is more need not flow.
        most = (1 + int(self._degree.max())) * TURN
        own = np.rint(FINE * np.clip(rather_first, -most, most)).astype(np.int32)
        source, sink, every = count, count + 1, np.arange(count)
        start = np.concatenate([np.full(count, source), every, pairs[:, 0], pairs[:, 1]])
        end = np.concatenate([every, np.full(count, sink), pairs[:, 1], pairs[:, 0]])
        turn = np.full(2 * len(pairs), round(FINE * TURN), np.int32)
        room = np.concatenate([np.maximum(own, 0), np.maximum(-own, 0), turn])
        graph = csr_array((room, (start, end)), shape=(count + 2, count + 2))
        left = graph - maximum_flow(graph, source, sink).flow
        left.data = np.maximum(left.data, 0)
        left.eliminate_zeros()
        labels = np.ones(count + 2, np.intp)
        labels[breadth_first_order(left, source, return_predecessors=False)] = 0
        return labels[:count]

    def parted(self, labels: Labels) -> int:
        """Return how many pairs lie on either side of a border."""
        return int(np.count_nonzero(labels[self._pairs[:, 0]] != labels[self._pairs[:, 1]]))

    def islands(self, labels: Labels) -> tuple[int, NDArray[np.int32]]:
        """Return how many regions there are, and which each pixel lies in (P,)."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import connected_components

        same = self._pairs[labels[self._pairs[:, 0]] == labels[self._pairs[:, 1]]]
        graph = csr_array((np.ones(len(same)), (same[:, 0], same[:, 1])), shape=(self._count, self._count))
        count, which = connected_components(graph, directed=False)
        return int(count), which

    def description(self, labels: Labels) -> float:
        """Return the border's length as deviance: each turn, and where each stretch of it begins."""
        regions = self.islands(labels)[0] - self._pieces
        return TURN * self.parted(labels) + self._beginning * regions

    def _without_islands(self, labels: Labels, rather_first: Array) -> Labels:
        """Return labels of which no region would better have the other one, the beginning of its border saved."""
        labels = labels.copy()
        while True:
            count, which = self.islands(labels)
            gain = np.bincount(which, np.where(labels == 0, rather_first, -rather_first), count)
            first, second = which[self._pairs].T
            border = first != second
            parted = np.bincount(first[border], minlength=count) + np.bincount(second[border], minlength=count)
            worth = np.where(parted > 0, gain - TURN * parted - self._beginning, np.inf)
            if worth.min() >= 0:
                return labels
            least = which == np.argmin(worth)
            labels[least] = 1 - labels[least]

    @cached_property
    def _degree(self) -> NDArray[np.intp]:
        return np.bincount(self._pairs.ravel(), minlength=self._count)

    @cached_property
    def _pieces(self) -> int:
        """How many regions there are where all labels are the same."""
        return self.islands(np.zeros(self._count, np.intp))[0]

    @property
    def _beginning(self) -> float:
        return 2 * float(np.log(len(self._pairs)))
