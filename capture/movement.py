"""Did the camera stand still? Each frame's static edges against those of all the others.

Shadows, shading and highlights move with the light; edges of albedo, silhouettes and the table stay. A gradient that
points the same way in most frames is such an edge; many tiles vote on how far a frame's edges lie from there.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.facts import FrameFacts
from scene.frames import Frames

MOVED_PX = 0.8
"""Below this, moving shading and true movement cannot be told apart (still captures vote up to 0.6)."""
FEWEST_FRAMES = 5
FEWEST_TILES = 8
MOST_TILES = 32
TILE_PX = 96
REACH_PX = 20
REACH = (REACH_PX, REACH_PX)
COHERENT = 0.75
"""Length of the mean of the frames' gradient directions, on a static edge at least; 1 where all agree."""


@dataclass(frozen=True)
class Movement:
    """Shift of each frame against the others.

    Parameters
    ----------
    shift_px : (F, 2) float64
        (u, v), full-size pixels; NaN where too few tiles could tell.
    moved : (F,) bool
    """

    shift_px: NDArray[np.float64]
    moved: NDArray[np.bool_]


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
    units = np.stack([_orientation(picture, offset) for picture, offset in zip(small, floor, strict=True)])
    jolt, jolted = _jolts(small, floor)
    corners = _tiles(units[~jolted], TILE_PX, MOST_TILES)
    if len(corners) < FEWEST_TILES:
        return Movement(np.where(jolted[:, None], jolt * step, unknown), jolted)
    shift, moved = _vote(
        [_correlations(units[:, y : y + TILE_PX, x : x + TILE_PX], ~jolted, REACH) for y, x in corners], ~jolted
    )
    shift, moved = np.where(jolted[:, None], jolt, shift) * step, moved | jolted
    corners = _tiles(units[~moved], round(TILE_PX / step), 3 * MOST_TILES) if step > 1.5 else []
    if len(corners) < FEWEST_TILES:
        return Movement(shift, moved)
    candidates = []
    for y, x in corners:
        top = int(np.clip(round(y * step), 0, frames.height - TILE_PX))
        left = int(np.clip(round(x * step), 0, frames.width - TILE_PX))
        rows, columns = slice(top, top + TILE_PX), slice(left, left + TILE_PX)
        pixels = frames.read(rows, columns=columns, subtract_ambient=False).mean(axis=-1)
        pixels /= frames.gain.astype(np.float32)[:, None, None]
        units = np.stack([_orientation(p, offset) for p, offset in zip(pixels, floor, strict=True)])
        candidates.append((_sharpness(units[~moved]).sum(), _correlations(units, ~moved, REACH)))
    # What looked sharp when reduced may be a soft limb, whose edge shifts with the light.
    candidates.sort(key=lambda candidate: -candidate[0])
    fine, fine_moved = _vote([planes for _, planes in candidates[:MOST_TILES]], ~moved)
    return Movement(np.where(moved[:, None], shift, fine), moved | fine_moved)


def _sharpness(units: NDArray[np.complex64]) -> NDArray[np.float64]:
    """Return (h, w): up to 1 on an edge that the frames agree on, 0 where they do not."""
    mean = np.abs(units.mean(axis=0)).astype(np.float64)
    agreed = mean > COHERENT * np.maximum(np.abs(units).mean(axis=0), 1e-6)
    # Cubed: a strong edge that some frames lack is one that comes and goes with the light.
    return np.where(agreed, mean**3, 0)


def _edge_share(count: int) -> float:
    """Return the share of pixels that must lie on static edges, among so many frames: well above chance.

    Directions at random agree by the length r of their mean with probability exp(-F r^2) (Rayleigh's walk).
    """
    return 0.005 + 3 * float(np.exp(-count * COHERENT**2))


def _jolts(small: list[NDArray], floor: NDArray) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return shifts (F, 2) too large for a tile, in reduced pixels, and which frames have one.

    The whole picture is one tile; a jolt is a peak far from zero that stands well above all near zero.
    """
    import cv2

    pictures = [cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for picture in small]
    units = np.stack([_orientation(picture, offset) for picture, offset in zip(pictures, floor, strict=True)])
    if np.mean(_sharpness(units) > 0) < _edge_share(len(units)):
        return np.zeros((len(units), 2)), np.zeros(len(units), bool)
    height, width = units.shape[1:]
    reach = (height // 2 - 1, width // 2 - 1)
    planes = _correlations(units, np.ones(len(units), bool), reach)
    shift = np.zeros((len(units), 2))
    jolted = np.zeros(len(units), bool)
    near = REACH_PX // 2
    for i, plane in enumerate(planes):
        row, column = (int(k) for k in np.unravel_index(np.argmax(plane), plane.shape))
        shift[i] = 2 * (column - reach[1]), 2 * (row - reach[0])
        middle = plane[max(reach[0] - near, 0) : reach[0] + near + 1, max(reach[1] - near, 0) : reach[1] + near + 1]
        # The planes are squared: half is a factor of 1.4.
        jolted[i] = np.abs(shift[i]).max() > 0.8 * REACH_PX and middle.max() < 0.5
    # Where most frames "jump", nothing stands still that could tell.
    return shift, jolted & (jolted.mean() < 0.4)


def _orientation(picture: NDArray, offset: float) -> NDArray[np.complex64]:
    """Return the gradient's direction (h, w), complex, length from 0 where there is no edge to 1."""
    import cv2

    logarithm = np.log(np.maximum(picture, 0) + offset).astype(np.float32)
    # The band keeps edges, which are sharp, and drops shading, which is not.
    band = cv2.GaussianBlur(logarithm, (0, 0), 1.0) - cv2.GaussianBlur(logarithm, (0, 0), 3.0)
    gradient = cv2.Sobel(band, cv2.CV_32F, 1, 0) + 1j * cv2.Sobel(band, cv2.CV_32F, 0, 1)
    length = np.abs(gradient)
    return (gradient / (length + np.quantile(length, 0.9) + 1e-6)).astype(np.complex64)


def _tiles(units: NDArray[np.complex64], tile: int, most: int) -> list[tuple[int, int]]:
    """Return (row, column) of the tiles with the most static edges, overlapping by half."""
    import cv2

    sharpness = _sharpness(units)
    half = max(tile // 2, 1)

    def by_tile(image: NDArray) -> NDArray:
        sums = cv2.integral(image)
        return (sums[tile:, tile:] - sums[:-tile, tile:] - sums[tile:, :-tile] + sums[:-tile, :-tile])[::half, ::half]

    energy = by_tile(sharpness)
    if not energy.size:
        return []
    share = by_tile((sharpness > 0).astype(np.float64)) / tile**2
    energy = np.where(share > _edge_share(len(units)), energy, 0)
    order = np.argsort(-energy, axis=None)[:most]
    rows, columns = np.unravel_index(order, energy.shape)
    enough = energy.ravel()[order] > 0.05 * float(energy.max())
    return [(int(y) * half, int(x) * half) for y, x in zip(rows[enough], columns[enough], strict=True)]


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
        row, column = (int(k) for k in np.unravel_index(np.argmax(plane), plane.shape))
        shift[i] = column + _vertex(plane[row], column), row + _vertex(plane[:, column], row)
        preferring[i] = np.mean(planes[:, i, row, column] > planes[:, i, REACH_PX, REACH_PX])
    shift -= REACH_PX
    length = np.linalg.norm(shift, axis=1)
    # A session whose shading stirs every frame's vote needs more than one that is quiet.
    limit = np.clip(4 * np.median(length[steady]), MOVED_PX, 3.0)
    return shift, (length > limit) & (preferring > 0.6)


def _correlations(
    units: NDArray[np.complex64], steady: NDArray[np.bool_], reach: tuple[int, int]
) -> NDArray[np.float32]:
    """Return each frame's tile (F, h, w) against the mean of the other steady frames', at most 1.

    Shifts reach from -`reach` to `reach`, rows and columns.
    """
    from scipy import fft

    # A frame is not held against itself: its own edges would pull the peak to zero.
    others = units[steady].sum(axis=0) - units * steady[:, None, None]
    others /= np.maximum(steady.sum() - steady, 1)[:, None, None]
    taper = np.outer(np.hanning(units.shape[1]), np.hanning(units.shape[2])).astype(np.float32)
    reference = np.asarray(fft.fft2(others * np.abs(others) ** 2 * taper))
    spectrum = np.asarray(fft.fft2(units * taper))
    correlation = np.real(np.asarray(fft.ifft2(spectrum * np.conj(reference))))
    correlation = np.roll(correlation, reach, (1, 2))[:, : 2 * reach[0] + 1, : 2 * reach[1] + 1]
    highest = np.maximum(correlation.max(axis=(1, 2), keepdims=True), 1e-9)
    # Each tile has one vote, however strong its edges; squared, so that it votes for its best place.
    return np.maximum(correlation / highest, 0) ** 2


def _vertex(values: NDArray, i: int) -> float:
    """Return where, relative to i, the parabola through three neighbours has its top."""
    if not 0 < i < len(values) - 1:
        return 0.0
    left, middle, right = values[i - 1 : i + 2]
    bend = left - 2 * middle + right
    return float(0.5 * (left - right) / bend) if bend < 0 else 0.0
