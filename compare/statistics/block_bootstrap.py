"""Uncertainty of an error map's statistics: square blocks of pixels drawn with replacement.

Neighbouring pixels err together. A block keeps such neighbours together, so that the spread over draws of blocks is
that of the statistic, not of so many independent pixels [Kunsch1989].
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KEYS = ("mean_deg", "median_deg", "q1_deg", "q3_deg")
"""The statistics of a draw, in this order."""
GRIDS = 4
"""Grids of blocks, each begun elsewhere: what lies at a block's edge differs from one to the next."""
BINS = 256
LENGTHS_A_SIDE = 3.0
LEAST_BLOCKS, MOST_BLOCKS = 36, 400
LAG_SHARE = 0.05
"""Autocorrelation below which a map's memory is taken to have ended."""
NOISE_PX = 3
"""A pixel's own noise, interpolation of colours and blur do not reach so far."""
MOST_OF_THE_MEAN = 0.2


@dataclass(frozen=True)
class Draws:
    """Blocks drawn with replacement, the same for all maps of one grid of pixels.

    `labels`: of each grid, (H, W), the block of each pixel, -1 where it does not count. `weights`: of each grid,
    (draws, blocks), how often each block was drawn.
    """

    labels: tuple[NDArray[np.intp], ...]
    weights: tuple[NDArray[np.float32], ...]

    @property
    def count(self) -> int:
        """How many draws there are."""
        return sum(len(weights) for weights in self.weights)

    def sums(self, known: NDArray[np.bool_], sums_of: Callable[[NDArray[np.bool_], NDArray, int], NDArray]) -> Array:
        """Return (draws, C), sums over the pixels of each draw.

        `sums_of`: which of the P known pixels count (P,), the blocks of those, the number of blocks -> (blocks, C).
        A draw that none of a sparse map's pixels is in is the map itself.
        """
        found = []
        for labels, weights in zip(self.labels, self.weights, strict=True):
            label, blocks = labels[known], weights.shape[1]
            counted = label >= 0
            label = label[counted]
            filled = weights @ np.bincount(label, minlength=blocks) > 0
            found.append(np.where(filled[:, None], weights, np.float32(1)) @ sums_of(counted, label, blocks))
        return np.concatenate(found)


def draw_blocks(known: NDArray[np.bool_], length_px: float, count: int, rng: np.random.Generator) -> Draws:
    """Draw blocks of the pixels (H, W) that count, `count` times over all grids.

    A block is `LENGTHS_A_SIDE` lengths wide (`Memory.length_px`: how far neighbours err together), but such that there
    are between `LEAST_BLOCKS` and `MOST_BLOCKS` of them.
    """
    pixels = np.count_nonzero(known)
    least, most = np.sqrt(pixels / MOST_BLOCKS), np.sqrt(pixels / LEAST_BLOCKS)
    side = max(1, round(float(np.clip(LENGTHS_A_SIDE * length_px, least, most))))
    rows, columns = np.indices(known.shape)
    labels, weights = [], []
    for grid in range(GRIDS):
        down, right = (grid // 2) * side // 2, (grid % 2) * side // 2
        cell = ((rows + down) // side) * (known.shape[1] // side + 2) + (columns + right) // side
        label = np.full(known.shape, -1, np.intp)
        _, label[known] = np.unique(cell[known], return_inverse=True)
        blocks = int(label.max()) + 1
        drawn = rng.multinomial(blocks, np.full(blocks, 1 / blocks), -(-count // GRIDS))
        labels.append(label)
        weights.append(drawn.astype(np.float32))
    return Draws(tuple(labels), tuple(weights))


def drawn_statistics(error_deg: NDArray, draws: Draws) -> Array:
    """Return (draws, 4), `KEYS` of an error map (H, W) over each draw; pixels that are NaN do not count.

    Quantiles are read off a histogram whose bins hold as many pixels each, linear within a bin.
    """
    known = np.isfinite(error_deg)
    values = error_deg[known].astype(np.float64)
    edges = np.unique(np.quantile(values, np.linspace(0, 1, min(BINS, max(2, values.size)) + 1)))
    if edges.size < 2:
        edges = np.array([values[0], values[0] + 1e-9])
    width = edges.size - 1
    bins = np.clip(np.searchsorted(edges, values, "right") - 1, 0, width - 1)

    def sums_of(counted: NDArray[np.bool_], label: NDArray, blocks: int) -> NDArray:
        table = np.bincount(label * width + bins[counted], minlength=blocks * width).reshape(blocks, width)
        return np.column_stack([table, np.bincount(label, values[counted], blocks)])

    sums = draws.sums(known, sums_of)
    below, rows = np.cumsum(sums[:, :-1], axis=1), np.arange(len(sums))
    found = [sums[:, -1] / below[:, -1]]
    for share in (0.5, 0.25, 0.75):
        wanted = share * below[:, -1]
        at = np.minimum((below < wanted[:, None]).sum(1), width - 1)
        before = np.where(at > 0, below[rows, at - 1], 0.0)
        within = (wanted - before) / np.maximum(below[rows, at] - before, 1e-12)
        found.append(edges[at] + within * (edges[at + 1] - edges[at]))
    return np.stack(found, 1)


def drawn_correlation(a: NDArray, b: NDArray, draws: Draws) -> Array:
    """Return (draws,), Pearson's correlation of two maps (H, W) over each draw; NaN where either is unknown."""
    known = np.isfinite(a) & np.isfinite(b)
    x, y = (each[known].astype(np.float64) for each in (a, b))
    x, y = x - x.mean(), y - y.mean()
    products = (np.ones_like(x), x, y, x * x, y * y, x * y)

    def sums_of(counted: NDArray[np.bool_], label: NDArray, blocks: int) -> NDArray:
        return np.stack([np.bincount(label, one[counted], blocks) for one in products], 1)

    n, sx, sy, sxx, syy, sxy = draws.sums(known, sums_of).T
    variance = np.maximum((sxx - sx**2 / n) * (syy - sy**2 / n), 1e-300)
    return np.clip((sxy - sx * sy / n) / np.sqrt(variance), -1, 1)


@dataclass(frozen=True)
class Memory:
    """How far a map's pixels err together; `pixels` of them count.

    `rho` (L,): autocorrelation at 0, 1, 2 ... px, the mean of rows and columns, until it has fallen to `LAG_SHARE`.
    """

    rho: Array
    pixels: int

    @property
    def length_px(self) -> float:
        """The integral of the autocorrelation along a line; 1 where neighbours are independent."""
        return float(2 * self.rho.sum() - 1)

    @property
    def patches(self) -> float:
        """How many independent patches the map has: pixels over length squared."""
        return self.pixels / self.length_px**2

    def inflation(self, draws: Draws) -> float:
        """Return what a standard deviation over draws is to be multiplied by: neighbours in other blocks err alike too.

        In blocks of side b, the variance of a mean counts (1 - k / b) of rho(k), along rows and along columns.
        """
        # A block at the object's rim is smaller than it is wide.
        side = np.sqrt(np.mean([self.pixels / weights.shape[1] for weights in draws.weights]))
        share = np.clip(1 - np.arange(len(self.rho)) / max(side, 1.0), 0, 1)
        return float(self.length_px / (2 * (share * self.rho).sum() - 1))


def memory_of(error_deg: NDArray) -> Memory:
    """Return how far a map (H, W) errs together; pixels that are NaN do not count.

    Over P pixels the mean itself has the variance m = length^2 / P of one pixel's, and with it taken off covariances
    come out low: rho = rho_found (1 - m) + m, a few times over.
    """
    known = np.isfinite(error_deg)
    pixels = int(np.count_nonzero(known))
    if pixels < 4:
        return Memory(np.ones(1), pixels)
    rows, columns = (np.flatnonzero(known.any(axis)) for axis in (1, 0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    known = known[box]
    centred = np.where(known, error_deg[box] - np.mean(error_deg[box][known], dtype=np.float64), 0.0)
    variance = float((centred[known] ** 2).mean())
    if variance <= 0:
        return Memory(np.ones(1), pixels)
    lags = max(2, min(known.shape) // 2)
    rho = np.mean([_covariances(centred, known, axis, lags) for axis in (0, 1)], 0) / variance
    rho[0], share = 1.0, 0.0
    # To the first that is below 0.
    rho = rho[: np.argmax(rho < 0) + 1 if (rho < 0).any() else None]
    for _ in range(4):
        raised = rho * (1 - share) + share
        ended = np.flatnonzero(raised < LAG_SHARE)
        memory = Memory(raised[: ended[0] if ended.size else None], pixels)
        share = min(memory.length_px**2 / pixels, MOST_OF_THE_MEAN)
    return memory


def structured_share(error_deg: NDArray) -> float:
    """Return a map's autocorrelation at `NOISE_PX`: the share of its variance that is no pixel's own noise."""
    rho = memory_of(error_deg).rho
    return float(rho[NOISE_PX]) if len(rho) > NOISE_PX else 0.0


def _covariances(centred: Array, known: NDArray[np.bool_], axis: int, lags: int) -> Array:
    """Return (lags,), the mean product of known pixels 0, 1, 2 ... px apart along an axis; 0 where there are none."""

    def products(image: NDArray) -> Array:
        spectrum = np.fft.rfft(image, 2 * image.shape[axis], axis)
        return np.fft.irfft((np.abs(spectrum) ** 2).sum(1 - axis))[:lags]

    return products(centred) / np.maximum(np.round(products(known)), 1)
