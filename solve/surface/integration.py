"""Depth from normals, for any camera, without smearing depth over the edges of what stands in front."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label, median
from scipy.special import expit

from scene.camera import Camera
from scene.errors import SceneError
from solve.surface.grid_laplacian import solve_grid
from solve.surface.tangent_planes import GridEdges, edges_of, finer

Array = NDArray[np.float64]
TORN_PX = 2.0
"""Gap between neighbours from which on the surface is torn there."""

Opinions = list[tuple[NDArray, NDArray]]
"""Per axis, how much the first pixel and the next believe in their edge, (h, w) each, 0 to 1."""

_LARGE = 10_000
"""Pixels from which on a start is found on every second one."""
_ROUNDS, _FINER_ROUNDS = 60, 15
"""At most; on a grid that starts from a coarser one."""
_AT_REST_PX = 1e-3
"""Movement of the depth in a round (rms)."""
SHARPNESS = 4.0
"""How sharply a pixel decides for one of its two sides, for a gap in pixels; 0 would round off every edge of depth."""
_STEPS = 20
"""Of conjugate gradients in a round, at most: the next round goes on from there. The last one takes five times more."""
_PULL = 1e-11
"""Weight that holds a part without any connection where it was, beside 1 of an edge that is seen head-on."""


@dataclass(frozen=True)
class IntegratedSurface:
    """The depth of each pixel, and where the surface is torn.

    Parameters
    ----------
    z_mm : (H, W) float64
        Camera frame (negative if perspective); NaN where there is no normal.
    gap_right, gap_down : (H, W) float64
        How far the neighbour in the next column, the next row, lies off the tangent plane, in pixels of the picture:
        the lesser of the two sides' distances. Infinite where there is no such neighbour.
    """

    z_mm: Array
    gap_right: Array
    gap_down: Array

    def points_mm(self, camera: Camera) -> Array:
        """Return the points (H, W, 3), camera frame."""
        return camera.points_at_depth(camera.grid(), self.z_mm[..., None])

    def torn_share(self) -> float:
        """Return the share of the pixels that are torn off the next one to the right or below."""
        inside = np.isfinite(self.z_mm)
        right = np.isfinite(self.gap_right) & (self.gap_right > TORN_PX)
        down = np.isfinite(self.gap_down) & (self.gap_down > TORN_PX)
        return float(np.count_nonzero(right | down) / max(np.count_nonzero(inside), 1))


def integrate(
    normals: NDArray,
    camera: Camera,
    *,
    z_mm: float,
    start: Array | None = None,
    hint: tuple[Array, Array] | None = None,
) -> IntegratedSurface:
    """Integrate normals to depth.

    Parameters
    ----------
    normals : (H, W, 3) float
        Unit, camera frame; pixels without a finite one are left out.
    camera : Camera
        Perspective with its distortion, or orthographic.
    z_mm : float
        The median of the result: normals tell a perspective depth up to a factor, an orthographic one up to a shift.
        Parts that do not touch in the picture each have this median.
    start : (H, W) float64, optional
        A depth to begin from, mm, such as that of nearly the same normals. Default: least squares.
    hint : two (H, W) float64, optional
        What else is known of the depth, mm, and how much it weighs beside the equations of an edge: the variance of a
        neighbour's distance from the tangent plane over that of the hint, both in pixels squared. `z_mm` is then
        where a pixel without hint is taken to be at the beginning, no longer the median.

    Returns
    -------
    IntegratedSurface

    Raises
    ------
    SceneError
        No finite normal, or a perspective depth that is not in front of the camera.

    Notes
    -----
    A point is P = Z d with the pixel's undistorted ray d, d_z = -1. That the neighbour q lies in the tangent plane
    of p, n_p . (Z_q d_q - Z_p d_p) = 0, is linear in w = log Z, and exact on planes [Milano2025]:

        w_q - w_p = log(n_p . d_p) - log(n_p . d_q);

    orthographic, z_q - z_p = -(n_x dx + n_y dy) / n_z. Each pixel asks this of both neighbours in its row and both in
    its column; what is left, e, is the neighbour's distance from the tangent plane, in pixels. The two sides of an
    axis share a weight of 1: a+ = 1 / (1 + exp(-k (e-^2 - e+^2))), a- = 1 - a+, found in turn with the depth
    [Cao2022], which compares differences of depth where we compare e: on a smooth surface both sides then count
    alike, however steep it is. A pixel beside an edge of depth holds on to its own side; what no pixel holds is torn.

    Two neighbours' equations are merged by taking a_p n_p + a_q n_q for the normal: with like weights that is exact
    on a ball, whose chord is perpendicular to the sum of its ends' normals, where the mean of two slopes is not.

    Do not believe the depth across an edge whose two sides are not connected elsewhere, nor the low frequencies of
    normals with a smooth bias: a bias of 1 degree over 100 mm bends a flat plate by some millimetres.
    """
    inside = np.asarray(np.isfinite(normals).all(-1))
    if not inside.any():
        raise SceneError("integration: no pixel has a normal.")
    if not camera.is_orthographic and not z_mm < 0:
        raise SceneError(f"integration: the surface must stand in front of the camera, z < 0; found z = {z_mm:g} mm.")
    rounds = _ROUNDS
    if start is None and np.count_nonzero(inside) > _LARGE:
        some = (slice(None, None, 2), slice(None, None, 2))
        if inside[some].any():
            # Tears that creep from pixel to pixel creep twice as fast on every second one. Edges of that grid weigh the
            # same, and a pixel of it stands for four.
            known = None if hint is None else (hint[0][some], 4 * hint[1][some])
            coarse = integrate(normals[some], camera.every(2), z_mm=z_mm, hint=known)
            start = finer(coarse.z_mm, normals, camera)
        rounds = _FINER_ROUNDS
    (box,) = find_objects(inside.view(np.uint8))
    edges = edges_of(np.where(inside[..., None], normals, 0.0)[box], inside[box], camera, box)
    depth = np.zeros(edges.inside.shape) if hint is None else _unknown(np.full(edges.inside.shape, z_mm), camera)
    # Of an edge's two pixels, each counts a half.
    opinions: Opinions = [(0.5 * axis.pair, 0.5 * axis.pair) for axis in edges.axes]
    target, pull = None, _PULL * edges.inside
    if hint is not None:
        hint_mm, hint_weight = hint
        has = edges.inside & np.isfinite(hint_mm[box]) & (hint_weight[box] > 0)
        pull = pull + np.where(has, hint_weight[box], 0.0)
        target = np.where(has, _unknown(np.where(has, hint_mm[box], z_mm), camera), np.nan)
    if start is not None:
        known = edges.inside & np.isfinite(start[box])
        depth = np.where(known, _unknown(np.where(known, start[box], z_mm), camera), 0.0)
        depth = np.where(known, depth, np.median(depth[known]) if known.any() else 0.0) * edges.inside
        opinions = _opinions(edges, depth)
    for _ in range(rounds):
        before = depth
        depth = _solved(edges, opinions, before, target, pull, 1e-5)
        gap = (depth - before)[edges.inside]
        if np.sqrt(np.mean((gap - gap.mean()) ** 2)) < _AT_REST_PX:
            break
        opinions = _opinions(edges, depth)
    depth = _solved(edges, opinions, depth, target, pull, 1e-11)
    return _surface(edges, depth, inside, camera, box, z_mm if hint is None else None)


def surface_at(z_mm: Array, normals: NDArray, camera: Camera) -> IntegratedSurface:
    """Return a depth (H, W) that is already known as a surface, torn where its normals (H, W, 3) do not carry it."""
    inside = np.isfinite(z_mm) & np.isfinite(normals).all(-1)
    box = (slice(0, inside.shape[0]), slice(0, inside.shape[1]))
    edges = edges_of(np.where(inside[..., None], normals, 0.0), inside, camera, box)
    depth = np.where(inside, _unknown(np.where(inside, z_mm, -1.0), camera), 0.0)
    return _surface(edges, depth, inside, camera, box, None)


def _opinions(edges: GridEdges, depth: Array) -> Opinions:
    shares = []
    for axis in edges.axes:
        forth, back = edges.gaps(axis, depth)
        both = axis.pair & axis.last(axis.pair)
        # A pixel with one neighbour has no choice, and the weight that it would have on even ground.
        forward = np.where(both, expit(SHARPNESS * (axis.last(back) ** 2 - forth**2)), 0.5)
        shares.append((forward * axis.pair, axis.next(1 - forward) * axis.pair))
    return shares


def _solved(
    edges: GridEdges, opinions: Opinions, depth: Array, target: Array | None, pull: NDArray,
    tolerance: float,
) -> Array:  # fmt: skip
    # Solved for is the change from a level depth: the common part of a logarithm would cost digits.
    level = float(np.median(depth[edges.inside]))
    aim = depth if target is None else np.where(np.isfinite(target), target, depth)
    rhs = pull * (aim - level)
    right_down: list[Array] = []
    for axis, (first, second) in zip(edges.axes, opinions, strict=True):
        # Never quite 0: a torn edge has a step, too, and no weight to speak of.
        first, second = first + 1e-30, second + 1e-30
        right_down.append(axis.weight * (first + second))
        flow = right_down[-1] * axis.depth_step(first, second)
        rhs += axis.last(flow) - flow
    start = np.where(edges.inside, depth - level, 0.0)
    steps = _STEPS if tolerance > 1e-8 else 5 * _STEPS
    change = solve_grid(right_down[0], right_down[1], pull, rhs, start, tolerance=tolerance, iterations=steps)
    return np.where(edges.inside, level + change, 0.0)


def _unknown(z_mm: Array, camera: Camera) -> Array:
    """Return what is solved for: depth in pixels if orthographic, its logarithm times the focal length if not."""
    focal = np.sqrt(camera.fx * camera.fy)
    return -focal * z_mm if camera.is_orthographic else focal * np.log(-z_mm)


def _surface(
    edges: GridEdges, depth: Array, inside: NDArray[np.bool_], camera: Camera, box: tuple[slice, slice],
    z_mm: float | None,
) -> IntegratedSurface:  # fmt: skip
    found = depth / np.sqrt(camera.fx * camera.fy)
    found = -found if camera.is_orthographic else -np.exp(found)
    if z_mm is not None:
        parts = np.zeros(edges.inside.shape, np.int32)
        number = int(label(edges.inside, output=parts))  # type: ignore[arg-type]
        middle = np.full(number + 1, z_mm)
        middle[1:] = np.asarray(median(found, parts, np.arange(1, number + 1)))
        found = found - middle[parts] + z_mm if camera.is_orthographic else found * (z_mm / middle[parts])
    whole = np.full(inside.shape, np.nan)
    whole[box] = np.where(edges.inside, found, np.nan)
    gaps = []
    for axis in edges.axes:
        forth, back = edges.gaps(axis, depth)
        gaps.append(np.full(inside.shape, np.inf))
        gaps[-1][box] = np.where(axis.pair, np.minimum(forth, back), np.inf)
    return IntegratedSurface(whole, gaps[0], gaps[1])
