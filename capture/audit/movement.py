"""Did the camera stand still? Each frame's static edges against those of all the others, tile by tile."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts
from capture.audit.moved_midway import Step, find_step, step_votes, tiles_of_either_half
from capture.audit.static_edges import correlations, edge_share, edge_tiles, orientation, peak, sharpness
from scene.frames import Frames

MOVED_PX = 0.8
"""Below this, moving shading and true movement cannot be told apart (still captures vote up to 0.6)."""
FEWEST_FRAMES = 5
FEWEST_TILES = 8
MOST_TILES = 32
TILE_PX = 96
REACH_PX = 20
REACH = (REACH_PX, REACH_PX)


@dataclass(frozen=True)
class Movement:
    """Shift of each frame against the others.

    Parameters
    ----------
    shift_px : (F, 2) float64
        (u, v), full-size pixels; NaN where too few tiles could tell.
    moved : (F,) bool
    step : Step or None
        All frames from one on lie elsewhere; full-size pixels. The frames' own shifts then tell nothing.
    """

    shift_px: NDArray[np.float64]
    moved: NDArray[np.bool_]
    step: Step | None = None


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
    if count < FEWEST_FRAMES:
        return Movement(unknown, np.zeros(count, bool))
    small = [np.asarray(fact.small) for fact in facts]
    step = frames.height / small[0].shape[0]
    floor = np.array([0.02 * np.quantile(picture, 0.99) + 1e-6 for picture in small])
    units = np.stack([orientation(picture, offset) for picture, offset in zip(small, floor, strict=True)])
    jolt, jolted = _jolts(small, floor)
    middle = np.array([small[0].shape[1], small[0].shape[0]]) / 2
    corners = tiles_of_either_half(units[~jolted], TILE_PX, MOST_TILES)
    if len(corners) >= FEWEST_TILES:
        votes = [step_votes(units[~jolted, y : y + TILE_PX, x : x + TILE_PX], REACH_PX) for y, x in corners]
        found = find_step(votes, np.array(corners)[:, ::-1] + TILE_PX / 2 - middle)
        if found is not None:
            return Movement(unknown, np.zeros(count, bool), _among(found, ~jolted, step))
    corners = edge_tiles(sharpness(units[~jolted]), int(np.sum(~jolted)), TILE_PX, MOST_TILES)
    if len(corners) < FEWEST_TILES:
        return Movement(np.where(jolted[:, None], jolt * step, unknown), jolted)
    shift, moved = _vote(
        [_correlations(units[:, y : y + TILE_PX, x : x + TILE_PX], ~jolted, REACH) for y, x in corners], ~jolted
    )
    shift, moved = np.where(jolted[:, None], jolt, shift) * step, moved | jolted
    steady = ~moved
    tile = round(TILE_PX / step)
    corners = edge_tiles(sharpness(units[steady]), int(steady.sum()), tile, 3 * MOST_TILES) if step > 1.5 else []
    if len(corners) < FEWEST_TILES:
        return Movement(shift, moved)
    candidates = []
    for y, x in corners:
        top = int(np.clip(round(y * step), 0, frames.height - TILE_PX))
        left = int(np.clip(round(x * step), 0, frames.width - TILE_PX))
        rows, columns = slice(top, top + TILE_PX), slice(left, left + TILE_PX)
        pixels = frames.read(rows, columns=columns, subtract_ambient=False).mean(axis=-1)
        pixels /= frames.gain.astype(np.float32)[:, None, None]
        units = np.stack([orientation(p, offset) for p, offset in zip(pixels, floor, strict=True)])
        half = int(steady.sum()) // 2
        clear = sharpness(units[steady][:half]).sum() + sharpness(units[steady][half:]).sum()
        planes, votes = _correlations(units, steady, REACH), step_votes(units[steady], REACH_PX)
        candidates.append((clear, planes, votes, np.array([left, top]) + TILE_PX / 2 - middle * step))
    # What looked sharp when reduced may be a soft limb, whose edge shifts with the light.
    candidates.sort(key=lambda candidate: -candidate[0])
    _, planes, votes, middles = zip(*candidates[:MOST_TILES], strict=True)
    found = find_step(list(votes), np.array(middles))
    if found is not None:
        return Movement(unknown, np.zeros(count, bool), _among(found, steady, 1.0))
    fine, fine_moved = _vote(list(planes), steady)
    return Movement(np.where(moved[:, None], shift, fine), moved | fine_moved)


def _among(found: Step, looked_at: NDArray[np.bool_], scale: float) -> Step:
    """Return a step among some of the frames as one among all, in full-size pixels."""
    return replace(found, first=int(np.flatnonzero(looked_at)[found.first]), shift_px=found.shift_px * scale)


def _jolts(small: list[NDArray], floor: NDArray) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return shifts (F, 2) too large for a tile, in reduced pixels, and which frames have one.

    The whole picture is one tile; a jolt is a peak far from zero that stands well above all near zero.
    """
    import cv2

    pictures = [cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for picture in small]
    units = np.stack([orientation(picture, offset) for picture, offset in zip(pictures, floor, strict=True)])
    if np.mean(sharpness(units) > 0) < edge_share(len(units)):
        return np.zeros((len(units), 2)), np.zeros(len(units), bool)
    height, width = units.shape[1:]
    reach = (height // 2 - 1, width // 2 - 1)
    planes = _correlations(units, np.ones(len(units), bool), reach)
    shift = np.zeros((len(units), 2))
    jolted = np.zeros(len(units), bool)
    near = REACH_PX // 2
    for i, plane in enumerate(planes):
        row, column, _, _ = peak(plane)
        shift[i] = 2 * (column - reach[1]), 2 * (row - reach[0])
        middle = plane[max(reach[0] - near, 0) : reach[0] + near + 1, max(reach[1] - near, 0) : reach[1] + near + 1]
        # The planes are squared: half is a factor of 1.4.
        jolted[i] = np.abs(shift[i]).max() > 0.8 * REACH_PX and middle.max() < 0.5
    # Where most frames "jump", nothing stands still that could tell.
    return shift, jolted & (jolted.mean() < 0.4)


def _vote(tiles: list[NDArray[np.float32]], steady: NDArray[np.bool_]) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return shifts (F, 2), and which frames moved; the reference is made of the `steady` frames.

    A tile with a single edge cannot tell how far it slid along it: its correlation is a ridge. The ridges of tiles
    with different edges cross at the true shift.
    """
    planes = np.stack(tiles)
    total = planes.sum(axis=0)
    shift = np.zeros((len(steady), 2))
    preferring = np.zeros(len(steady))
    for i, plane in enumerate(total):
        row, column, down, right = peak(plane)
        shift[i] = column + right, row + down
        preferring[i] = np.mean(planes[:, i, row, column] > planes[:, i, REACH_PX, REACH_PX])
    shift -= REACH_PX
    length = np.linalg.norm(shift, axis=1)
    # A session whose shading stirs every frame's vote needs more than one that is quiet.
    limit = np.clip(4 * np.median(length[steady]), MOVED_PX, 3.0)
    return shift, (length > limit) & (preferring > 0.6)


def _correlations(units: NDArray[np.complex64], steady: NDArray[np.bool_], reach: tuple[int, int]) -> NDArray:
    """Return each frame's tile (F, h, w) against the mean of the other steady frames'."""
    # A frame is not held against itself: its own edges would pull the peak to zero.
    others = units[steady].sum(axis=0) - units * steady[:, None, None]
    others /= np.maximum(steady.sum() - steady, 1)[:, None, None]
    return correlations(units, others, reach)
