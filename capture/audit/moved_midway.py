"""Did the camera move between two frames, and stay? The frames before against the frames after, at every place.

A frame among many that moved is told by all the others (`capture.audit.movement`); where half of them moved, none is
odd.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.audit.static_edges import correlations, edge_tiles, peak, sharpness

FEWEST_BESIDE = 2
"""Frames before and after: one alone is `capture.audit.movement`'s."""
GAIN = 0.17
"""By how much more of the tiles' votes a movement must have than standing still: sound captures stay under 0.12."""
LEAST_PX = 1.0
"""Below, the drift of the shading with a flash that is carried around looks the same."""


@dataclass(frozen=True)
class Step:
    """From frame `first` on the picture lies `shift_px` (u, v) elsewhere, and is turned about its middle."""

    first: int
    shift_px: NDArray[np.float64]
    turn_deg: float


def tiles_of_either_half(units: NDArray[np.complex64], tile: int, most: int) -> list[tuple[int, int]]:
    """Return (row, column) of tiles with edges that stand in the first half of the frames, or in the second."""
    half = len(units) // 2
    return edge_tiles((sharpness(units[:half]) + sharpness(units[half:])) / 2, half, tile, most)


def step_votes(units: NDArray[np.complex64], reach_px: int) -> NDArray[np.float32]:
    """Return a tile's votes (K, h, w): before each frame, the frames after against those before.

    Parameters
    ----------
    units : (F, h, w) complex64
        Directions of the gradients, see `static_edges.orientation`.
    reach_px : int
        Farthest shift looked for.
    """
    count = len(units)
    places = np.arange(FEWEST_BESIDE, count - FEWEST_BESIDE + 1)
    if not len(places):
        return np.zeros((0, 2 * reach_px + 1, 2 * reach_px + 1), np.float32)
    sums = np.cumsum(units, 0)
    before = sums[places - 1] / places[:, None, None]
    after = (sums[-1] - sums[places - 1]) / (count - places)[:, None, None]
    return correlations(after * np.abs(after) ** 2, before, (reach_px, reach_px))


def find_step(votes: list[NDArray[np.float32]], middles: NDArray[np.float64]) -> Step | None:
    """Return the movement that stays, if there is one.

    Parameters
    ----------
    votes : list of (K, h, w)
        The tiles', see `step_votes`.
    middles : (T, 2) float64
        (u, v) of the tiles, from the picture's middle.

    Notes
    -----
    The tiles vote for a shift and a turn in common [Ballard1981].
    """
    planes = np.stack(votes)
    if not planes.shape[1]:
        return None
    reach = planes.shape[2] // 2
    still = planes[:, :, reach, reach].mean(0)
    farthest = max(float(np.linalg.norm(middles, axis=1).max()), 1.0)
    best = (GAIN, -1, 0.0, np.zeros((1, 1)))
    for turn in np.arange(-reach // 2, reach // 2 + 1) / farthest:
        total = _turned(planes, middles, turn)
        gains = total.max((1, 2)) - still
        k = int(np.argmax(gains))
        if gains[k] > best[0]:
            best = (float(gains[k]), k, float(turn), total[k])
    _, k, turn, plane = best
    if k < 0:
        return None
    row, column, down, right = peak(plane)
    shift = np.array([column + right - reach, row + down - reach])
    moved = shift + turn * middles[:, ::-1] * [-1, 1]
    if np.sqrt(np.mean(np.sum(moved**2, 1))) < LEAST_PX:
        return None
    return Step(k + FEWEST_BESIDE, shift, float(np.degrees(turn)))


def _turned(planes: NDArray, middles: NDArray, turn: float) -> NDArray:
    """Return the mean over tiles of planes (T, K, h, w), each moved by what a turn (radians) moves its tile."""
    total = np.zeros(planes.shape[1:])
    height, width = planes.shape[2:]
    for plane, (u, v) in zip(planes, middles, strict=True):
        # A turn moves the tile by (-turn v, turn u): its vote for the shift lies so far from its peak.
        right, down = round(-turn * v), round(turn * u)
        rows = slice(max(down, 0), min(height + down, height)), slice(max(-down, 0), min(height - down, height))
        columns = slice(max(right, 0), min(width + right, width)), slice(max(-right, 0), min(width - right, width))
        total[:, rows[1], columns[1]] += plane[:, rows[0], columns[0]]
    return total / len(planes)
