"""Uncertainty of an error map's statistics: square blocks of pixels drawn with replacement.

Neighbouring pixels err together. A block keeps such neighbours together, so that the spread over draws of blocks is
that of the statistic, not of so many independent pixels [Kunsch1989].
"""

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
    """Blocks drawn with replacement: the same for all maps of one grid of pixels.

    Parameters
    ----------
    labels : tuple of GRIDS arrays (H, W) int
        The block of each pixel, -1 where it does not count.
    weights : tuple of GRIDS arrays (draws, blocks) float32
        How often each block was drawn.
    side_px : int
    """

    labels: tuple[NDArray[np.intp], ...]
    weights: tuple[NDArray[np.float32], ...]
    side_px: int

    @property
    def count(self) -> int:
        """How many draws there are."""
        return sum(len(weights) for weights in self.weights)


def draw_blocks(known: NDArray[np.bool_], length_px: float, count: int, rng: np.random.Generator) -> Draws:
    """Draw blocks of the pixels that count.

    Parameters
    ----------
    known : (H, W) bool
    length_px : float
        How far neighbours err together, see `Memory.length_px`.
    count : int
        Draws in all, over the grids.
    rng : numpy Generator

    Notes
    -----
    A block is `LENGTHS_A_SIDE` lengths wide, but such that there are between `LEAST_BLOCKS` and `MOST_BLOCKS` of them.
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
    return Draws(tuple(labels), tuple(weights), side)


def drawn_statistics(error_deg: NDArray, draws: Draws) -> Array:
    """Return (draws, 4), `KEYS` of an error map (H, W) over each draw; pixels that are NaN do not count.

    Notes
    -----
    Quantiles are read off a histogram whose bins hold as many pixels each, linear within a bin. A draw that none of a
    sparse map's pixels is in is the map itself.
    """
    known = np.isfinite(error_deg)
    values = error_deg[known].astype(np.float64)
    edges = np.unique(np.quantile(values, np.linspace(0, 1, min(BINS, max(2, values.size)) + 1)))
    if edges.size < 2:
        edges = np.array([values[0], values[0] + 1e-9])
    bins = np.clip(np.searchsorted(edges, values, "right") - 1, 0, edges.size - 2)
    return np.concatenate([_of_grid(values, bins, edges, label[known], weights) for label, weights in _grids(draws)])


def _of_grid(values: Array, bins: NDArray, edges: Array, label: NDArray, weights: NDArray[np.float32]) -> Array:
    counted, blocks, width = label >= 0, weights.shape[1], edges.size - 1
    values, bins, label = values[counted], bins[counted], label[counted]
    weights = _none_empty(weights, np.bincount(label, minlength=blocks))
    table = np.bincount(label * width + bins, minlength=blocks * width).reshape(blocks, width)
    below = np.cumsum(weights @ table.astype(np.float32), axis=1, dtype=np.float64)
    pixels = below[:, -1]
    mean = weights @ np.bincount(label, values, blocks) / pixels
    found = [mean]
    for share in (0.5, 0.25, 0.75):
        wanted = share * pixels
        at = np.minimum((below < wanted[:, None]).sum(1), width - 1)
        rows = np.arange(len(below))
        before = np.where(at > 0, below[rows, at - 1], 0.0)
        within = (wanted - before) / np.maximum(below[rows, at] - before, 1e-12)
        found.append(edges[at] + within * (edges[at + 1] - edges[at]))
    return np.stack(found, 1)


def drawn_correlation(a: NDArray, b: NDArray, draws: Draws) -> Array:
    """Return (draws,), Pearson's correlation of two maps (H, W) over each draw; NaN where either is unknown."""
    known = np.isfinite(a) & np.isfinite(b)
    x, y = (each[known].astype(np.float64) for each in (a, b))
    x, y = x - x.mean(), y - y.mean()
    found = []
    for label, weights in _grids(draws):
        place = label[known]
        counted, blocks = place >= 0, weights.shape[1]
        products = (np.ones_like(x), x, y, x * x, y * y, x * y)
        sums = np.stack([np.bincount(place[counted], one[counted], blocks) for one in products], 1)
        weights = _none_empty(weights, sums[:, 0])
        n, sx, sy, sxx, syy, sxy = (weights @ sums).T
        variance = np.maximum((sxx - sx**2 / n) * (syy - sy**2 / n), 1e-300)
        found.append((sxy - sx * sy / n) / np.sqrt(variance))
    return np.clip(np.concatenate(found), -1, 1)


@dataclass(frozen=True)
class Memory:
    """How far a map's pixels err together.

    Parameters
    ----------
    rho : (L,) float64
        Autocorrelation at 0, 1, 2 ... px, the mean of rows and columns; it ends where it has fallen to `LAG_SHARE`.
    pixels : int
        That count.
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

        Notes
        -----
        In blocks of side b, the variance of a mean counts (1 - k / b) of rho(k), along rows and along columns.
        """
        # A block at the object's rim is smaller than it is wide.
        side = np.sqrt(np.mean([self.pixels / weights.shape[1] for weights in draws.weights]))
        share = np.clip(1 - np.arange(len(self.rho)) / max(side, 1.0), 0, 1)
        return float(self.length_px / (2 * (share * self.rho).sum() - 1))


def memory_of(error_deg: NDArray) -> Memory:
    """Return how far a map (H, W) errs together; pixels that are NaN do not count.

    Notes
    -----
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
    found = [1.0]
    for lag in range(1, max(2, min(known.shape) // 2)):
        found.append(float(np.mean([_covariance(centred, known, lag, axis) for axis in (0, 1)]) / variance))
        if found[-1] < 0:
            break
    rho, share = np.array(found), 0.0
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


def _covariance(centred: Array, known: NDArray[np.bool_], lag: int, axis: int) -> float:
    """Return the mean product of pixels a lag apart, 0 where there are none."""
    here, there = (slice(None, -lag), slice(lag, None)) if axis == 0 else (np.s_[:, :-lag], np.s_[:, lag:])
    pairs = int(np.count_nonzero(known[here] & known[there]))
    return float(np.vdot(centred[here], centred[there]) / pairs) if pairs else 0.0


def _none_empty(weights: NDArray[np.float32], pixels: NDArray) -> NDArray[np.float32]:
    """Return the draws (draws, blocks), those that hold none of the pixels (blocks,) replaced by all blocks once."""
    return np.where((weights @ pixels > 0)[:, None], weights, np.float32(1))


def _grids(draws: Draws):
    return zip(draws.labels, draws.weights, strict=True)
