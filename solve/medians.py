"""Medians of rows with gaps."""

import numpy as np
from numpy.typing import NDArray


def row_medians(values: NDArray, where: NDArray[np.bool_]) -> NDArray:
    """Return the lower median of each row (N, M) over the entries of `where`; 0 where there are none.

    By one sort of all rows: numpy's own median with gaps calls Python for each.
    """
    ordered = np.sort(np.where(where, values, np.inf), axis=1)
    count = where.sum(1)
    middle = np.take_along_axis(ordered, np.maximum(count - 1, 0)[:, None] // 2, 1)[:, 0]
    return np.where(count > 0, middle, 0)
