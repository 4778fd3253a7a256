"""Where a ball's outline may stand: circles of edges that are there in frame after frame.

A silhouette stands still while shadows and highlights move, so each pixel is asked in how many frames
it lies on an edge, and in which orientation. A ring of that evidence is a candidate.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

SMALLEST_PX, LARGEST_SHARE = 6.0, 0.42
"""Radii searched: from 6 coarse pixels to 0.42 of the image's shorter side."""
ENOUGH = 0.16
"""Mean evidence on the ring from which a circle is looked at: 1 is an edge all round in all frames."""
MOST = 400
"""Circles handed on, the strongest first."""
THREADS = 2


@dataclass(frozen=True)
class Circle:
    """A circle in coarse pixels and the share of its outline that edges support."""

    u: float
    v: float
    radius: float
    score: float


def static_edges(images: NDArray[np.float32]) -> NDArray[np.complex64]:
    """Return (h, w) complex: magnitude = share of frames with an edge here, phase = twice its angle.

    The angle is doubled so that edges from dark to bright and from bright to dark add up: a ball is
    brighter than the table on its lit side and darker on the other.

    Notes
    -----
    A frame's vote is s = g^2 / (g^2 + k^2), g the gradient, k four times the gradient that noise makes in
    the neighbourhood, at least a few percent of the local brightness per pixel. So a strong shadow in one
    of F frames weighs 1/F, however strong it is, and a faint outline that is always there weighs 1.
    """
    votes = np.zeros((2, *images.shape[1:]), np.float32)
    for image in images:
        smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
        du = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=1 / 8)
        dv = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=1 / 8)
        square = du * du + dv * dv
        noise = _local_median(np.sqrt(square))
        level = cv2.blur(np.maximum(smooth, 0), (9, 9))
        limit = np.maximum(np.maximum(4 * noise, 0.03 * level), 2e-4) ** 2
        # s exp(2 i angle) = s (du + i dv)^2 / |g|^2, and s / |g|^2 = 1 / (g^2 + k^2): no angle is ever computed.
        share = 1 / (square + limit)
        votes[0] += (du * du - dv * dv) * share
        votes[1] += 2 * du * dv * share
    return np.asarray((votes[0] + 1j * votes[1]) / len(images), np.complex64)


def _local_median(values: NDArray[np.float32], tile: int = 24) -> NDArray[np.float32]:
    """Return the median of each tile, interpolated to the image's size."""
    height, width = values.shape
    rows, columns = max(1, height // tile), max(1, width // tile)
    blocks = values[: rows * (height // rows), : columns * (width // columns)]
    blocks = blocks.reshape(rows, height // rows, columns, width // columns).swapaxes(1, 2).reshape(rows, columns, -1)
    medians = np.median(blocks, -1).astype(np.float32)
    return np.asarray(cv2.resize(medians, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def without_albedo(images: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the stack (F, h, w) over its mean: print, wood and tiles vanish, what has another normal stays."""
    mean = np.maximum(images.mean(0), 0)
    return images / (mean + max(1e-3, 0.02 * float(np.quantile(mean, 0.9))))


def find_circles(images: NDArray[np.float32], edges: NDArray[np.complex64]) -> list[Circle]:
    """Return circles of standing edges in the stack (F, h, w), the best supported first; `edges`: its `static_edges`.

    Each octave of radii is searched in images shrunk until its rings are 20 to 40 px: the cost of all
    octaves together is 4/3 of the first.
    """
    largest = LARGEST_SHARE * min(images.shape[1:])
    circles = []
    scale = 1.0
    low, step = SMALLEST_PX, 1.0
    while low * scale < largest:
        high = min(40.0, largest / scale)
        for circle in _circles_of_octave(edges, np.arange(low, high + step, step)):
            circles.append(
                Circle(
                    (circle.u + 0.5) * scale - 0.5, (circle.v + 0.5) * scale - 0.5, circle.radius * scale, circle.score
                )
            )
        scale *= 2
        low, step = 20.0, 0.5
        if low * scale < largest:
            images = np.stack([cv2.resize(i, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in images])
            edges = static_edges(images)
    return _strongest(circles, MOST)


def _circles_of_octave(edges: NDArray[np.complex64], radii: NDArray[np.float64]) -> list[Circle]:
    """Correlate the edges with rings of outward orientation, one radius after another."""
    height, width = edges.shape
    pad = int(radii[-1]) + 4
    shape = (int(fft.next_fast_len(height + pad) or 0), int(fft.next_fast_len(width + pad) or 0))
    spectrum = _transform(edges, shape)
    scores = np.zeros((len(radii), height, width), np.float32)
    v = (np.arange(shape[0]) + shape[0] // 2) % shape[0] - shape[0] // 2
    u = (np.arange(shape[1]) + shape[1] // 2) % shape[1] - shape[1] // 2
    far = np.hypot(v[:, None], u[None]).astype(np.float32)
    outward = ((u[None] + 1j * v[:, None]) ** 2 / np.maximum(far, 1) ** 2).astype(np.complex64)

    def correlate(i: int) -> None:
        radius, blur = radii[i], 0.5 + 0.025 * radii[i]
        ring = np.zeros(shape, np.complex64)
        near = np.abs(far - radius) < 4 * blur
        weight = np.exp(-0.5 * ((far[near] - radius) / blur) ** 2)
        ring[near] = outward[near] * (weight / weight.sum())
        product = spectrum * np.conj(_transform(ring, shape))
        agree = np.real(np.asarray(fft.ifft2(product, overwrite_x=True)))[:height, :width]
        # A ball cut by the border has less outline; under half of it is no evidence.
        seen = 1 - _beyond(height, radius)[:, None] - _beyond(width, radius)[None]
        np.divide(agree, seen, out=scores[i], where=seen > 0.5)

    with ThreadPoolExecutor(THREADS) as threads:
        list(threads.map(correlate, range(len(radii))))
    found = []
    # Nested rings share a centre: the weaker of them must not be lost, an outline may be fainter than what it mirrors.
    for i in range(len(radii)):
        peak = scores[i] > ENOUGH
        for other in (i - 1, i + 1):
            if 0 <= other < len(radii):
                peak &= scores[i] >= scores[other]
        if peak.any():
            peak &= scores[i] >= cv2.dilate(scores[i], np.ones((5, 5), np.uint8))
        for row, column in zip(*np.nonzero(peak), strict=True):
            found.append(Circle(float(column), float(row), float(radii[i]), float(scores[i, row, column])))
    return found


def _transform(image: NDArray[np.complex64], shape: tuple[int, int]) -> NDArray[np.complex64]:
    return np.asarray(fft.fft2(image, shape), np.complex64)


def _beyond(side: int, radius: float) -> NDArray[np.float32]:
    """Return (side,), the share of a circle about each pixel that lies outside the two borders across one axis."""
    place = np.arange(side)
    shares = [np.arccos(np.clip(distance / radius, -1, 1)) / np.pi for distance in (place, side - 1 - place)]
    return np.asarray(shares[0] + shares[1], np.float32)


def _strongest(circles: list[Circle], most: int) -> list[Circle]:
    """Keep the best of circles that are the same one."""
    kept: list[Circle] = []
    table = np.empty((most, 3))
    for circle in sorted(circles, key=lambda c: -c.score):
        k = table[: len(kept)]
        apart = np.hypot(circle.u - k[:, 0], circle.v - k[:, 1]) + np.abs(circle.radius - k[:, 2])
        if np.any(apart < np.maximum(2.0, 0.06 * k[:, 2])):
            continue
        table[len(kept)] = circle.u, circle.v, circle.radius
        kept.append(circle)
        if len(kept) == most:
            break
    return kept
