"""Did the camera or its focus stand still? A frame's static edges against the others', those before against after."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts
from capture.audit.static_edges import correlations, edge_share, edge_tiles, orientation, peak, sharpness
from scene.frames import Frames, gray

MOVED_PX = 0.8
"""Below this, moving shading and true movement cannot be told apart (still captures vote up to 0.6)."""
FEWEST_FRAMES = 5
FEWEST_TILES = 8
MOST_TILES = 32
TILE_PX = 96
REACH_PX = 20
REACH = (REACH_PX, REACH_PX)
PARTS, FAINT, MOST = 8, 0.1, 0.75
"""Parts across the picture that a jolt is asked of; of the edges of the part with most, those that a part must have;
and the share of the parts that must have moved."""
FEWEST_BESIDE = 2
"""Frames before and after a step: one alone is a frame that moved."""
GAIN = 0.17
"""By how much more of the tiles' votes a step must have than standing still: sound captures stay under 0.12."""
LEAST_PX = 1.0
"""Of a step: below, the drift of the shading with a flash that is carried around looks the same."""


@dataclass(frozen=True)
class CameraStep:
    """From frame `first` on the picture lies `shift_px` (u, v) elsewhere, turned about its middle and grown."""

    first: int
    shift_px: NDArray[np.float64]
    turn_deg: float
    growth: float = 0.0


@dataclass(frozen=True)
class Movement:
    """Shift of each frame against the others.

    Parameters
    ----------
    shift_px : (F, 2) float64
        (u, v), full-size pixels; NaN where too few tiles could tell.
    moved : (F,) bool
    step : CameraStep or None
        All frames from one on lie elsewhere; full-size pixels. Where half of the frames moved none is odd among the
        others: their own shifts then tell nothing.
    """

    shift_px: NDArray[np.float64]
    moved: NDArray[np.bool_]
    step: CameraStep | None = None


def movement(frames: Frames, facts: list[FrameFacts]) -> Movement:
    """Return how far each frame lies from the rest.

    First on the reduced pictures, which find a jolt of any size, then on tiles of full size, which find a pixel.
    Fewer than five frames cannot outvote a moved one: all NaN.

    Notes
    -----
    Orientation correlation [Fitch2002]: u = g / (|g| + e) for the gradient g of the band-passed logarithm; a tile's
    shift is the peak of its correlation with the mean of the other frames' u, and the frame's is the median of tiles.
    """
    count = len(frames)
    unknown = np.full((count, 2), np.nan)
    still = Movement(unknown, np.zeros(count, bool))
    if count < FEWEST_FRAMES:
        return still
    small = [np.asarray(fact.small) for fact in facts]
    scale = frames.height / small[0].shape[0]
    floor = np.array([0.02 * np.quantile(picture, 0.99) + 1e-6 for picture in small])
    units = _orientations(small, floor)
    jolt, jolted = _jolts(small, floor)
    middle = np.array([small[0].shape[1], small[0].shape[0]]) / 2
    corners = tiles_of_either_half(units[~jolted])
    if len(corners) >= FEWEST_TILES:
        votes = [step_votes(units[~jolted, y : y + TILE_PX, x : x + TILE_PX]) for y, x in corners]
        found = find_step(votes, np.array(corners)[:, ::-1] + TILE_PX / 2 - middle)
        if found is not None:
            return replace(still, step=_among(found, ~jolted, scale))
    corners = edge_tiles(sharpness(units[~jolted]), int(np.sum(~jolted)), TILE_PX, MOST_TILES)
    if len(corners) < FEWEST_TILES:
        return Movement(np.where(jolted[:, None], jolt * scale, unknown), jolted)
    planes = [_correlations(units[:, y : y + TILE_PX, x : x + TILE_PX], ~jolted, REACH) for y, x in corners]
    shift, moved = _vote(planes, ~jolted)
    shift, moved = np.where(jolted[:, None], jolt, shift) * scale, moved | jolted
    steady = ~moved
    tile, wanted = round(TILE_PX / scale), 3 * MOST_TILES
    corners = edge_tiles(sharpness(units[steady]), int(steady.sum()), tile, wanted) if scale > 1.5 else []
    if len(corners) < FEWEST_TILES:
        return Movement(shift, moved)
    largest = [frames.width - TILE_PX, frames.height - TILE_PX]
    places = np.rint(np.array(corners)[:, ::-1] * scale).astype(int).clip(0, largest)

    def units_at(place: NDArray[np.int_]) -> NDArray[np.complex64]:
        columns, rows = (slice(int(start), int(start) + TILE_PX) for start in place)
        pixels = gray(frames.read(rows, columns=columns, subtract_ambient=False))
        return _orientations(pixels / frames.gain.astype(np.float32)[:, None, None], floor)

    def clearness(place: NDArray[np.int_]) -> float:
        units, half = units_at(place)[steady], int(steady.sum()) // 2
        return float(sharpness(units[:half]).sum() + sharpness(units[half:]).sum())

    # What looked sharp when reduced may be a soft limb, whose edge shifts with the light. The tiles are read again
    # rather than kept: all frames' would be half a gigabyte.
    places = places[np.argsort([-clearness(place) for place in places], kind="stable")[:MOST_TILES]]
    planes, votes = [], []
    for place in places:
        units = units_at(place)
        planes.append(_correlations(units, steady, REACH))
        votes.append(step_votes(units[steady]))
    found = find_step(votes, places + TILE_PX / 2 - middle * scale)
    if found is not None:
        return replace(still, step=_among(found, steady, 1.0))
    fine, fine_moved = _vote(planes, steady)
    return Movement(np.where(moved[:, None], shift, fine), moved | fine_moved)


def _orientations(pictures, floor: NDArray) -> NDArray[np.complex64]:
    return np.stack([orientation(picture, offset) for picture, offset in zip(pictures, floor, strict=True)])


def _among(found: CameraStep, looked_at: NDArray[np.bool_], scale: float) -> CameraStep:
    """Return a step among some of the frames as one among all, in full-size pixels."""
    return replace(found, first=int(np.flatnonzero(looked_at)[found.first]), shift_px=found.shift_px * scale)


def _jolts(small: list[NDArray], floor: NDArray) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return shifts (F, 2) too large for a tile, in reduced pixels, and which frames have one.

    The whole picture is one tile; a jolt is a peak far from zero that stands well above all near zero, and that most
    parts of the picture prefer: a half that turns dark looks like a jump of its edge, but nothing else jumps with it.
    """
    import cv2

    pictures = [cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for picture in small]
    units = _orientations(pictures, floor)
    shift, jolted = np.zeros((len(units), 2)), np.zeros(len(units), bool)
    if np.mean(sharpness(units) > 0) < edge_share(len(units)):
        return shift, jolted
    reach = (units.shape[1] // 2 - 1, units.shape[2] // 2 - 1)
    near = REACH_PX // 2
    others = (units.sum(0) - units) / max(len(units) - 1, 1)
    for i, plane in enumerate(_correlations(units, np.ones(len(units), bool), reach)):
        row, column, _, _ = peak(plane)
        shift[i] = 2 * (column - reach[1]), 2 * (row - reach[0])
        middle = plane[max(reach[0] - near, 0) : reach[0] + near + 1, max(reach[1] - near, 0) : reach[1] + near + 1]
        # The planes are squared: half is a factor of 1.4.
        jolted[i] = np.abs(shift[i]).max() > 0.8 * REACH_PX and middle.max() < 0.5
        jolted[i] &= _preferring(units[i], others[i], row - reach[0], column - reach[1]) > MOST
    # Where most frames "jump", nothing stands still that could tell.
    return shift, jolted & (jolted.mean() < 0.4)


def _preferring(unit: NDArray, others: NDArray, down: int, right: int) -> float:
    """Return the share of the picture's parts, of those with edges, whose edges (h, w) lie there, not where others' do.

    down, right: how far off they may lie, px.
    """
    height, width = unit.shape
    here = tuple(slice(max(-by, 0), size - max(by, 0)) for by, size in ((down, height), (right, width)))
    there = tuple(slice(max(by, 0), size - max(-by, 0)) for by, size in ((down, height), (right, width)))
    gains = np.zeros(others.shape)
    gains[here] = np.real(np.conj(others[here]) * np.abs(others[here]) ** 2 * (unit[there] - unit[here]))
    edges = np.abs(others) ** 3
    side = -(-max(height, width) // PARTS)
    v, u = np.indices(gains.shape) // side
    part = (v * PARTS + u).ravel()
    gain, known = (np.bincount(part, values.ravel()) for values in (gains, edges))
    counts = (known > FAINT * known.max()) & (gain != 0)
    return float(np.mean(gain[counts] > 0)) if counts.any() else 0.0


def _correlations(units: NDArray[np.complex64], steady: NDArray[np.bool_], reach: tuple[int, int]) -> NDArray:
    """Return each frame's tile (F, h, w) against the mean of the other steady frames'."""
    # A frame is not held against itself: its own edges would pull the peak to zero.
    others = units[steady].sum(axis=0) - units * steady[:, None, None]
    others /= np.maximum(steady.sum() - steady, 1)[:, None, None]
    return correlations(units, others, reach)


def _vote(tiles, steady: NDArray[np.bool_]) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return shifts (F, 2), and which frames moved; the reference is made of the `steady` frames.

    A tile with a single edge cannot tell how far it slid along it: its correlation is a ridge. The ridges of tiles
    with different edges cross at the true shift.
    """
    planes = np.stack(tiles)
    shift, preferring = np.zeros((len(steady), 2)), np.zeros(len(steady))
    for i, plane in enumerate(planes.sum(axis=0)):
        row, column, down, right = peak(plane)
        shift[i] = column + right - REACH_PX, row + down - REACH_PX
        preferring[i] = np.mean(planes[:, i, row, column] > planes[:, i, REACH_PX, REACH_PX])
    length = np.linalg.norm(shift, axis=1)
    # A session whose shading stirs every frame's vote needs more than one that is quiet.
    limit = np.clip(4 * np.median(length[steady]), MOVED_PX, 3.0)
    return shift, (length > limit) & (preferring > 0.6)


def tiles_of_either_half(units: NDArray[np.complex64], tile: int = TILE_PX) -> list[tuple[int, int]]:
    """Return (row, column) of tiles with edges that stand in the first half of the frames, or in the second."""
    half = len(units) // 2
    return edge_tiles((sharpness(units[:half]) + sharpness(units[half:])) / 2, half, tile, MOST_TILES)


def step_votes(units: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Return a tile's (F, h, w) votes (K, rows, columns): before each frame, the frames after against those before."""
    count = len(units)
    places = np.arange(FEWEST_BESIDE, count - FEWEST_BESIDE + 1)
    if not len(places):
        return np.zeros((0, 2 * REACH_PX + 1, 2 * REACH_PX + 1), np.float32)
    sums = units.copy()
    for before, after in pairwise(sums):
        after += before
    before = sums[places - 1] / places[:, None, None].astype(np.float32)
    after = (sums[-1] - sums[places - 1]) / (count - places)[:, None, None].astype(np.float32)
    return correlations(after * np.abs(after) ** 2, before, REACH)


def find_step(votes, middles: NDArray[np.float64], gain: float = GAIN) -> CameraStep | None:
    """Return the movement that stays, if there is one: tiles vote for a shift, and a turn or growth [Ballard1981].

    `votes` are the tiles', see `step_votes`; `middles` (T, 2) their (u, v) from the picture's middle; `gain` the least
    that counts, see `GAIN`.
    """
    planes = np.stack(votes)
    if not planes.shape[1]:
        return None
    still = planes[:, :, REACH_PX, REACH_PX].mean(0)
    farthest = max(float(np.linalg.norm(middles, axis=1).max()), 1.0)
    rates = np.arange(-REACH_PX // 2, REACH_PX // 2 + 1) / farthest
    best = (gain, -1, 0j, np.zeros((1, 1)))
    # A camera turns, or a focus moves: not both.
    for rate in (*(1j * rates), *rates[rates != 0]):
        total = _taken_back(planes, middles, rate)
        gains = total.max((1, 2)) - still
        k = int(np.argmax(gains))
        if gains[k] > best[0]:
            best = (float(gains[k]), k, complex(rate), total[k])
    _, k, rate, plane = best
    if k < 0:
        return None
    row, column, down, right = peak(plane)
    shift = np.array([column + right - REACH_PX, row + down - REACH_PX])
    moved = shift @ [1, 1j] + rate * (middles @ [1, 1j])
    if np.sqrt(np.mean(np.abs(moved) ** 2)) < LEAST_PX:
        return None
    return CameraStep(k + FEWEST_BESIDE, shift, float(np.degrees(rate.imag)), rate.real)


def _taken_back(planes: NDArray, middles: NDArray, rate: complex) -> NDArray:
    """Return the mean over tiles of planes (T, K, h, w), each moved by what a growth and a turn move its tile.

    `rate`: the growth, and the turn (radians) as its imaginary part.
    """
    total = np.zeros(planes.shape[1:])
    height, width = planes.shape[2:]
    for plane, (u, v) in zip(planes, middles, strict=True):
        # The tile's vote for the shift lies so far from its peak.
        moved = rate * complex(u, v)
        right, down = round(moved.real), round(moved.imag)
        rows = slice(max(down, 0), min(height + down, height)), slice(max(-down, 0), min(height - down, height))
        columns = slice(max(right, 0), min(width + right, width)), slice(max(-right, 0), min(width - right, width))
        total[:, rows[1], columns[1]] += plane[:, rows[0], columns[0]]
    return total / len(planes)
