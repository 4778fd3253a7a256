"""Did the camera or its focus stand still? A frame's static edges against the others', those before against after."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts
from capture.audit.static_edges import correlations, edge_share, edge_tiles, orientation, peak, sharpness
from scene.frames import Frames, gray

FEWEST_FRAMES = 5
FEWEST_TILES, MOST_TILES = 8, 32
TILE_PX = 96
REACH_PX, FARTHEST_PX = 20, 10
"""Of a shift; of what a turn or a growth moves the farthest tile by."""
PARTS, FAINT, MOST = 8, 0.1, 0.75
"""Parts across the picture that a jolt is asked of; of the edges of the part with most, those that a part must have;
and the share of the parts that must have moved."""
FEWEST_BESIDE = 2
"""Frames before and after a step: one alone is a frame that moved."""
GAIN = 0.17
"""By how much more of the tiles' votes a movement must have than standing still: steps in sound captures stay under
0.12, frames under 0.17; a frame that lies 3 px off has 0.3 to 0.9."""
LEAST_PX = 1.0
"""Of a movement: below, the drift of the shading with a flash that is carried around looks the same."""


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
        (u, v), full-size pixels; 0 where too few tiles could tell.
    moved : (F,) bool
    step : CameraStep or None
        All frames from one on lie elsewhere; full-size pixels.
    """

    shift_px: NDArray[np.float64]
    moved: NDArray[np.bool_]
    step: CameraStep | None = None

    def and_by(self, found: "Movement", scale: float) -> "Movement":
        """Return it with what was found on pictures whose pixels are `scale` wide."""
        shift = np.where(self.moved[:, None], self.shift_px, found.shift_px * scale)
        step = found.step and replace(found.step, shift_px=found.step.shift_px * scale)
        return Movement(shift, self.moved | found.moved, step)


def movement(frames: Frames, facts: list[FrameFacts]) -> Movement:
    """Return how far each frame lies from the rest.

    First on the reduced pictures, which find a jolt of any size, then on tiles of full size, which find a pixel.
    Fewer than five frames cannot outvote a moved one.

    Notes
    -----
    Orientation correlation [Fitch2002]: u = g / (|g| + e) for the gradient g of the band-passed logarithm; a tile votes
    by the correlation of the mean u of the frames that may have moved, one or all from one on, with the others'.
    """
    count = len(frames)
    found = Movement(np.zeros((count, 2)), np.zeros(count, bool))
    if count < FEWEST_FRAMES:
        return found
    small = [np.asarray(fact.small) for fact in facts]
    scale = frames.height / small[0].shape[0]
    floor = np.array([0.02 * np.quantile(picture, 0.99) + 1e-6 for picture in small])
    units = _orientations(small, floor)
    middle = np.array(units.shape[:0:-1]) / 2

    def units_at(place: NDArray[np.int_]) -> NDArray[np.complex64]:
        columns, rows = (slice(int(start), int(start) + TILE_PX) for start in place)
        pixels = gray(frames.read(rows, columns=columns, subtract_ambient=False))
        return _orientations(pixels / frames.gain.astype(np.float32)[:, None, None], floor)

    found = found.and_by(_jolts(small, floor), scale)
    places = static_tiles(units, TILE_PX, MOST_TILES)
    planes = [votes(units[:, v : v + TILE_PX, u : u + TILE_PX]) for u, v in places]
    found = found.and_by(_by_tiles(planes, places, middle, count), scale)
    if found.step is not None or scale <= 1.5:
        return found
    places = np.rint(static_tiles(units, round(TILE_PX / scale), 3 * MOST_TILES) * scale).astype(int)
    places = places.clip(0, [frames.width - TILE_PX, frames.height - TILE_PX])
    # What looked sharp when reduced may be a soft limb, whose edge shifts with the light. The tiles are read again
    # rather than kept: all frames' would be half a gigabyte.
    clear = [-_of_either_half(units_at(place)).sum() for place in places]
    places = places[np.argsort(clear, kind="stable")[:MOST_TILES]]
    return found.and_by(_by_tiles([votes(units_at(place)) for place in places], places, middle * scale, count), 1.0)


def _orientations(pictures, floor: NDArray) -> NDArray[np.complex64]:
    return np.stack([orientation(picture, offset) for picture, offset in zip(pictures, floor, strict=True)])


def _jolts(small: list[NDArray], floor: NDArray) -> Movement:
    """Return shifts too large for a tile, in reduced pixels.

    The whole picture is one tile; a jolt is a peak far from zero that stands well above all near zero, and that most
    parts of the picture prefer: a half that turns dark looks like a jump of its edge, but nothing else jumps with it.
    """
    import cv2

    pictures = [cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for picture in small]
    units = _orientations(pictures, floor)
    shift, jolted = np.zeros((len(units), 2)), np.zeros(len(units), bool)
    if np.mean(sharpness(units) > 0) < edge_share(len(units)):
        return Movement(shift, jolted)
    reach = (units.shape[1] // 2 - 1, units.shape[2] // 2 - 1)
    near = tuple(slice(max(side - REACH_PX // 2, 0), side + REACH_PX // 2 + 1) for side in reach)
    others = (units.sum(0) - units) / (len(units) - 1)
    for i, plane in enumerate(correlations(units, others, reach)):
        right, down = np.rint(peak(plane)).astype(int) - reach[::-1]
        shift[i] = 2 * right, 2 * down
        moved = np.roll(units[i], (-down, -right), (0, 1)) - units[i]
        gain = np.real(np.conj(others[i]) * np.abs(others[i]) ** 2 * moved)
        sides = (PARTS, PARTS)
        gain, edges = (cv2.resize(one, sides, interpolation=cv2.INTER_AREA) for one in (gain, abs(others[i]) ** 3))
        # The planes are squared: half is a factor of 1.4.
        jolted[i] = np.abs(shift[i]).max() > 0.8 * REACH_PX and plane[near].max() < 0.5
        jolted[i] &= np.mean(gain[edges > FAINT * edges.max()] > 0) > MOST
    # Where most frames "jump", nothing stands still that could tell.
    return Movement(shift, jolted & (jolted.mean() < 0.4))


def _by_tiles(tiles: list[NDArray], places: NDArray[np.int_], middle: NDArray[np.float64], count: int) -> Movement:
    """Return what tiles' votes say of `count` frames; a step must have more than any single frame."""
    still = Movement(np.zeros((count, 2)), np.zeros(count, bool))
    if len(places) < FEWEST_TILES:
        return still
    planes = np.stack(tiles)
    frames = planes[:, :count].mean(0)
    gains = frames.max((1, 2)) - frames[:, REACH_PX, REACH_PX]
    step = find_step(planes[:, count:], places + TILE_PX / 2 - middle, max(GAIN, gains.max()))
    if step is not None:
        return replace(still, step=step)
    shift = np.array([peak(plane) for plane in frames]) - REACH_PX
    # A frame that moved draws the others' mean along a little.
    return Movement(shift, (gains > max(GAIN, gains.max() / 3)) & (np.linalg.norm(shift, axis=1) > LEAST_PX))


def _of_either_half(units: NDArray[np.complex64]) -> NDArray[np.float64]:
    """Return (h, w): the sharpness of edges that stand in the first half of the frames, or in the second."""
    half = len(units) // 2
    return (sharpness(units[:half]) + sharpness(units[half:])) / 2


def static_tiles(units: NDArray[np.complex64], tile: int, most: int) -> NDArray[np.int_]:
    """Return (u, v) (T, 2) of the corners of the tiles with the most such edges."""
    corners = edge_tiles(_of_either_half(units), len(units) // 2, tile, most)
    return np.array(corners, int).reshape(-1, 2)[:, ::-1]


def votes(units: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Return a tile's (F, h, w) votes (K, rows, columns): each frame against the others, then steps.

    Of each place where a step may be, the frames after it stand against those before.
    A tile with a single edge cannot tell how far it slid along it: its correlation is a ridge. The ridges of tiles
    with different edges cross at the true shift.
    """
    count, places = len(units), slice(FEWEST_BESIDE, len(units) - FEWEST_BESIDE + 1)
    sums = np.concatenate([units, np.cumsum(units[::-1], 0)[::-1][places]])
    number = np.concatenate([np.ones(count), np.arange(count, 0, -1)[places]]).astype(np.float32)[:, None, None]
    there, here = sums / number, (units.sum(0) - sums) / (count - number)
    return correlations(there * np.abs(there) ** 2, here, (REACH_PX, REACH_PX))


def find_step(planes: NDArray, middles: NDArray[np.float64], gain: float) -> CameraStep | None:
    """Return the movement that stays, if there is one: tiles vote for a shift, and a turn or growth [Ballard1981].

    `planes` (T, K, h, w) are the tiles' votes on steps; `middles` (T, 2) their (u, v) from the picture's middle; `gain`
    the least that counts, see `GAIN`.
    """
    still = planes[:, :, REACH_PX, REACH_PX].mean(0)
    planes = np.pad(planes, [(0, 0)] * 2 + [(FARTHEST_PX, FARTHEST_PX)] * 2)
    farthest = max(float(np.linalg.norm(middles, axis=1).max()), 1.0)
    rates = np.arange(-FARTHEST_PX, FARTHEST_PX + 1) / farthest
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
    shift = peak(plane) - REACH_PX
    moved = shift @ [1, 1j] + rate * (middles @ [1, 1j])
    if np.sqrt(np.mean(np.abs(moved) ** 2)) < LEAST_PX:
        return None
    return CameraStep(k + FEWEST_BESIDE, shift, float(np.degrees(rate.imag)), rate.real)


def _taken_back(planes: NDArray, middles: NDArray, rate: complex) -> NDArray:
    """Return the mean over tiles of planes (T, K, h, w), each moved by what a growth and a turn move its tile.

    `planes` have a margin of `FARTHEST_PX`; `rate`: the growth, and the turn (radians) as its imaginary part.
    """
    height, width = (side - 2 * FARTHEST_PX for side in planes.shape[2:])
    total = np.zeros((planes.shape[1], height, width))
    for plane, (u, v) in zip(planes, middles, strict=True):
        # The tile's vote for the shift lies so far from its peak.
        moved = rate * complex(u, v)
        down, right = FARTHEST_PX + round(moved.imag), FARTHEST_PX + round(moved.real)
        total += plane[:, down : down + height, right : right + width]
    return total / len(planes)
