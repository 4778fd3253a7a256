"""Edges that stay while the light moves: of albedo, silhouettes, the table; and how far frames' edges lie apart.

Shadows, shading and highlights move with the light; what points the same way in most frames is static.
"""

import numpy as np
from numpy.typing import NDArray

COHERENT = 0.75
"""Length of the mean of the frames' gradient directions, on a static edge at least; 1 where all agree."""


def orientation(picture: NDArray, offset: float) -> NDArray[np.complex64]:
    """Return the gradient's direction (h, w), complex, length from 0 where there is no edge to 1."""
    import cv2

    logarithm = np.log(np.maximum(np.asarray(picture, np.float32), 0) + np.float32(offset))
    # The band keeps edges, which are sharp, and drops shading, which is not.
    band = cv2.GaussianBlur(logarithm, (0, 0), 1.0) - cv2.GaussianBlur(logarithm, (0, 0), 3.0)
    gradient = cv2.Sobel(band, cv2.CV_32F, 1, 0) + 1j * cv2.Sobel(band, cv2.CV_32F, 0, 1)
    length = np.abs(gradient)
    strong = int(0.9 * length.size)
    return gradient / (length + np.partition(length, strong, axis=None)[strong] + np.float32(1e-6))


def sharpness(units: NDArray[np.complex64]) -> NDArray[np.float64]:
    """Return (h, w): up to 1 on an edge that the frames agree on, 0 where they do not."""
    mean = np.abs(units.mean(axis=0)).astype(np.float64)
    agreed = mean > COHERENT * np.maximum(np.abs(units).mean(axis=0), 1e-6)
    # Cubed: a strong edge that some frames lack is one that comes and goes with the light.
    return np.where(agreed, mean**3, 0)


def edge_share(count: int) -> float:
    """Return the share of pixels that must lie on static edges, among so many frames: well above chance.

    Directions at random agree by the length r of their mean with probability exp(-F r^2) (Rayleigh's walk).
    """
    return 0.005 + 3 * float(np.exp(-count * COHERENT**2))


def edge_tiles(edges: NDArray[np.float64], count: int, tile: int, most: int) -> list[tuple[int, int]]:
    """Return (row, column) of the tiles with the most static edges, overlapping by half.

    `edges` (h, w) is the `sharpness` of `count` frames.
    """
    import cv2

    half = max(tile // 2, 1)

    def by_tile(image: NDArray) -> NDArray:
        sums = cv2.integral(image)
        return (sums[tile:, tile:] - sums[:-tile, tile:] - sums[tile:, :-tile] + sums[:-tile, :-tile])[::half, ::half]

    energy = by_tile(edges)
    if not energy.size:
        return []
    share = by_tile((edges > 0).astype(np.float64)) / tile**2
    energy = np.where(share > edge_share(count), energy, 0)
    order = np.argsort(-energy, axis=None)[:most]
    rows, columns = np.unravel_index(order, energy.shape)
    enough = energy.ravel()[order] > 0.05 * float(energy.max())
    return [(int(y) * half, int(x) * half) for y, x in zip(rows[enough], columns[enough], strict=True)]


def correlations(units: NDArray, references: NDArray, reach: tuple[int, int]) -> NDArray[np.float32]:
    """Return each tile of directions (K, h, w) against its reference (K, h, w), at most 1.

    Shifts reach from -`reach` to `reach`, rows and columns. References are means over frames: where these agree counts.
    """
    from scipy import fft

    taper = np.outer(np.hanning(units.shape[1]), np.hanning(units.shape[2])).astype(np.float32)
    reference = np.asarray(fft.fft2(references * np.abs(references) ** 2 * taper))
    spectrum = np.asarray(fft.fft2(units * taper))
    correlation = np.real(np.asarray(fft.ifft2(spectrum * np.conj(reference))))
    correlation = np.roll(correlation, reach, (1, 2))[:, : 2 * reach[0] + 1, : 2 * reach[1] + 1]
    highest = np.maximum(correlation.max(axis=(1, 2), keepdims=True), 1e-9)
    # Each tile has one vote, however strong its edges; squared, so that it votes for its best place.
    return np.maximum(correlation / highest, 0) ** 2


def peak(plane: NDArray) -> NDArray[np.float64]:
    """Return (column, row) of a plane's top, to a part of a pixel."""
    row, column = (int(k) for k in np.unravel_index(np.argmax(plane), plane.shape))
    return np.array([column + _vertex(plane[row], column), row + _vertex(plane[:, column], row)])


def _vertex(values: NDArray, i: int) -> float:
    """Return where, relative to i, the parabola through three neighbours has its top."""
    if not 0 < i < len(values) - 1:
        return 0.0
    left, middle, right = values[i - 1 : i + 2]
    bend = left - 2 * middle + right
    return float(0.5 * (left - right) / bend) if bend < 0 else 0.0
