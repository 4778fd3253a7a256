"""Where a ball's outline may be: circles of edges that are there in frame after frame.

A silhouette does not move while shadows and highlights do, so each pixel is asked in how many frames it lies on an
edge, and in which orientation. A ring of that evidence is a candidate.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from calibrate.detection.coarse import Coarse
from calibrate.silhouette.outline import (
    SINGULAR,
    across,
    moved,
    outline_with_normals,
    sampled,
)
from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]
Picture = NDArray[np.float32]
EDGE_NOISES, EDGE_SHARE, EDGE_LEAST = 4.0, 0.03, 2e-4
"""Gradient that counts half as an edge: in the neighbourhood's noise, in its brightness per pixel, at least."""
NOISE_TILE_PX = 24  # neighbourhood in which the gradient's median is its noise
ALBEDO_FLOOR = 0.02  # of the mean's 0.9 quantile, added to what the frames are divided by
SMALLEST_PX, LARGEST_SHARE = 6.0, 0.5  # radii searched: from 6 coarse pixels to half of the image's shorter side
RING_PX = 20.0, 40.0  # radii of an octave: each is searched in images that are shrunk until its rings are so large
ENOUGH = 0.16  # mean evidence on the ring from which a circle is looked at: 1 is an edge all round in all frames
SEEN = 0.5  # share of a ring that must lie in the picture
MOST = 400  # circles handed on, the strongest first
SAME_PX, SAME_SHARE = 2.0, 0.06  # px, and radii, within which two circles are the same one
THREADS = 2
WINDOWS, LEAST_WINDOW_PX = (0.045, 0.04, 0.03, 0.0, 0.0), 1.5
"""Radii, and pixels, to both sides in which a circle's edge is looked for, turn by turn. Narrow: a mirror's outline and
the rim of the table that it mirrors lie a tenth of the radius apart."""
OUTLINE_POINTS = 120  # at which a circle is looked at
EDGE, FULL_EDGE = 0.1, 0.3  # evidence from which on a point lies on an edge, and wholly does
LOST = 0.25  # radii by which a circle may move in a turn
LEAST_SCORE = 0.5  # a circle that less of its outline supports is not looked into


def rank(sphere: Sphere) -> float:
    """A long outline is more evidence than a short one of the same share."""
    return sphere.score**2 * sphere.radius_px**0.25


def distinct(spheres: list[Sphere], least_px: float = 1.0, share: float = 0.0) -> list[Sphere]:
    """Return the circles that differ by more than some pixels, or radii; the best supported first."""
    kept, table = list[Sphere](), np.empty((len(spheres), 3))
    for one in sorted(spheres, key=rank, reverse=True):
        u, v, radius = table[: len(kept)].T
        apart = np.hypot(one.center_px[0] - u, one.center_px[1] - v) + np.abs(one.radius_px - radius)
        if (apart > np.maximum(least_px, share * radius)).all():
            table[len(kept)] = *one.center_px, one.radius_px
            kept.append(one)
    return kept


def overlap(a: Sphere, b: Sphere) -> bool:
    """Whether two circles cover each other more than two balls that touch would, or one holds the other's centre."""
    apart = float(np.hypot(*(a.center_px - b.center_px)))
    return apart < max(0.85 * (a.radius_px + b.radius_px), a.radius_px, b.radius_px)


def static_circles(coarse: Coarse) -> list[Sphere]:
    """Return the circles of static edges, in the photographs and in the same without their albedo, coarse pixels."""
    # Over its mean a stack has no albedo: print, wood and tiles vanish, what has another normal stays.
    mean = np.maximum(coarse.images.mean(0), 0)
    even = coarse.images / (mean + max(1e-3, ALBEDO_FLOOR * float(np.quantile(mean, 0.9))))
    found = []
    for images in (coarse.images, even):
        votes = static_edges(images)
        edges = np.stack([votes.real, votes.imag], -1)
        found += [refine_on_edges(edges, coarse.camera, start) for start in _circles(images, votes)]
    return [sphere for sphere in found if sphere.score >= LEAST_SCORE]


def static_edges(images: Picture) -> NDArray[np.complex64]:
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
        du, dv = gradient(smooth)
        square = du * du + dv * dv
        level = cv2.blur(np.maximum(smooth, 0), (9, 9))
        noise = _local_median(np.sqrt(square))
        limit = np.maximum(np.maximum(EDGE_NOISES * noise, EDGE_SHARE * level), EDGE_LEAST) ** 2
        # s exp(2 i angle) = s (du + i dv)^2 / |g|^2, and s / |g|^2 = 1 / (g^2 + k^2): no angle is ever computed.
        share = 1 / (square + limit)
        votes[0] += (du * du - dv * dv) * share
        votes[1] += 2 * du * dv * share
    return np.asarray((votes[0] + 1j * votes[1]) / len(images), np.complex64)


def gradient(image: Picture) -> tuple[Picture, Picture]:
    """Return the slopes (h, w) of an image along u and v, per pixel, by Sobel's kernels."""
    du, dv = (cv2.Sobel(image, cv2.CV_32F, *order, scale=1 / 8) for order in ((1, 0), (0, 1)))
    return np.asarray(du, np.float32), np.asarray(dv, np.float32)


def _local_median(values: Picture) -> Picture:
    """Return the median of each tile, interpolated to the image's size."""
    height, width = values.shape
    rows, columns = max(1, height // NOISE_TILE_PX), max(1, width // NOISE_TILE_PX)
    blocks = values[: rows * (height // rows), : columns * (width // columns)]
    blocks = blocks.reshape(rows, height // rows, columns, width // columns)
    medians = np.median(blocks.swapaxes(1, 2).reshape(rows, columns, -1), -1).astype(np.float32)
    return np.asarray(cv2.resize(medians, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def _circles(images: Picture, edges: NDArray[np.complex64]) -> list[Sphere]:
    """Return circles of static edges in the stack (F, h, w), the best supported first; `edges`: its `static_edges`.

    Each octave of radii is searched in images of half the size: the cost of all octaves is 4/3 of the first's.
    """
    largest = LARGEST_SHARE * min(images.shape[1:])
    circles, scale = list[Sphere](), 1.0
    low, step = SMALLEST_PX, 1.0
    while low * scale < largest:
        high = min(RING_PX[1], largest / scale)
        for u, v, radius, score in _circles_of_octave(edges, np.arange(low, high + step, step)):
            center = (np.array([u, v]) + 0.5) * scale - 0.5
            circles.append(Sphere("chrome", center, radius * scale, score=score))
        scale *= 2
        low, step = RING_PX[0], 0.5
        if low * scale < largest:
            images = np.stack([cv2.resize(i, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in images])
            edges = static_edges(images)
    return distinct(circles, SAME_PX, SAME_SHARE)[:MOST]


def _circles_of_octave(edges: NDArray[np.complex64], radii: Array) -> list[tuple[float, ...]]:
    """Correlate the edges with rings of outward orientation, one radius after another."""
    height, width = edges.shape
    pad = int(radii[-1]) + 4
    shape = (int(fft.next_fast_len(height + pad) or 0), int(fft.next_fast_len(width + pad) or 0))
    spectrum = np.asarray(fft.fft2(edges, shape), np.complex64)
    scores = np.zeros((len(radii), height, width), np.float32)
    v, u = ((np.arange(n) + n // 2) % n - n // 2 for n in shape)
    far = np.hypot(v[:, None], u[None]).astype(np.float32)
    outward = ((u[None] + 1j * v[:, None]) ** 2 / np.maximum(far, 1) ** 2).astype(np.complex64)

    def correlate(i: int) -> None:
        radius, blur = radii[i], 0.5 + 0.025 * radii[i]
        ring = np.zeros(shape, np.complex64)
        near = np.abs(far - radius) < 4 * blur
        weight = np.exp(-0.5 * ((far[near] - radius) / blur) ** 2)
        ring[near] = outward[near] * (weight / weight.sum())
        product = spectrum * np.conj(np.asarray(fft.fft2(ring, shape), np.complex64))
        agree = np.real(np.asarray(fft.ifft2(product, overwrite_x=True)))[:height, :width]
        # A ball cut by the border has less outline; under half of it is no evidence.
        seen = 1 - _beyond(height, radius)[:, None] - _beyond(width, radius)[None]
        np.divide(agree, seen, out=scores[i], where=seen > SEEN)

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
            found.append((float(column), float(row), float(radii[i]), float(scores[i, row, column])))
    return found


def _beyond(side: int, radius: float) -> Picture:
    """Return (side,), the share of a circle about each pixel that lies outside the two borders across one axis."""
    place = np.arange(side)
    shares = [np.arccos(np.clip(distance / radius, -1, 1)) / np.pi for distance in (place, side - 1 - place)]
    return np.asarray(shares[0] + shares[1], np.float32)


def refine_on_edges(edges: Picture, camera: Camera, sphere: Sphere) -> Sphere:
    """Return the ball moved to the nearest circle of static edges, with its score.

    `edges` (h, w, 2) is `static_edges` of the coarse stack, real and imaginary part: one map in place
    of all frames, so that dozens of candidates are cheap.
    """
    outline, normals = outline_with_normals(camera, sphere, OUTLINE_POINTS)
    # Within a few pixels the outline moves with its centre, and grows with its radius.
    shape = (outline - sphere.center_px) / sphere.radius_px
    jacobian = np.column_stack([normals, np.sum(shape * normals, 1)])
    for window in np.maximum(LEAST_WINDOW_PX, np.array(WINDOWS) * sphere.radius_px):
        points = sphere.center_px + sphere.radius_px * shape
        offsets = np.arange(-window - 0.5, window + 0.75, 0.5)
        evidence = _along_outline(edges, points, normals, offsets)
        # The nearest edge, not the strongest: the rim of what a mirror shows outshines its own outline.
        here = evidence[:, 1:-1]
        peak = (here >= evidence[:, :-2]) & (here > evidence[:, 2:]) & (here > EDGE)
        best = np.where(peak, np.abs(offsets[1:-1]), np.inf).argmin(1)
        weight = np.where(peak.any(1), np.clip(here[np.arange(len(best)), best], 0, 0.4), 0)
        shift = _robust_shift(jacobian, offsets[1:-1][best], weight)
        if shift is None or np.abs(shift).max() > LOST * sphere.radius_px:
            return replace(sphere, score=0.0)
        sphere = moved(sphere, shift)
    points = sphere.center_px + sphere.radius_px * shape
    evidence = _along_outline(edges, points, normals, np.arange(-1.0, 1.1, 0.5)).max(1)
    inside = np.all((points > 1) & (points < [camera.width - 2, camera.height - 2]), axis=1)
    return replace(sphere, score=float(np.mean(np.clip(evidence / FULL_EDGE, 0, 1) * inside)))


def _along_outline(edges: Picture, points: Array, normals: Array, offsets: Array) -> Picture:
    """Return (N, M): how strongly static edges run along the outline, shifted by each offset."""
    evidence = sampled(edges, across(points, normals, offsets))
    # The real part of evidence times (n_u - i n_v)^2: edges across the outline count against it.
    along = (normals[:, 0] ** 2 - normals[:, 1] ** 2)[:, None] * evidence[..., 0]
    return np.asarray(along + (2 * normals[:, 0] * normals[:, 1])[:, None] * evidence[..., 1], np.float32)


def _robust_shift(jacobian: Array, offset: Array, weight: Array) -> Array | None:
    """Return the (3,) shift that best explains the offsets, by a fit with Cauchy's weights in two steps."""
    shift = None
    for scale in (4.0, 1.5):  # px
        residual = offset if shift is None else offset - jacobian @ shift
        w = weight / (1 + (residual / scale) ** 2)
        normal = jacobian.T @ (w[:, None] * jacobian)
        if np.trace(normal) <= 0 or np.linalg.cond(normal) > SINGULAR:
            return None
        shift = np.asarray(np.linalg.solve(normal, jacobian.T @ (w * offset)), np.float64)
    return shift
