"""What was scanned beside the object: a calibration ball, which gives the scale, and a table, told from a flat base."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.scan.scan_surface import border_of, pieces_of
from scene.rays import import_open3d
from scene.robust import Array, spread

ROUND = 0.01
"""A piece is a ball when its vertices keep to a sphere within this share of the radius, rms."""
BEYOND = 0.1
"""A table reaches beyond the rest by this share of the rest's width ..."""
SIDES = 0.75
"""... in this share of the directions ..."""
ALWAYS = 0.02
"""... and by this in all of them: the foot of a bracket ends with it."""
SHALLOW = 0.15
"""A rest lower than this share of its width may be a relief on its ground: that stays."""
PLANES = 6
"""The largest of a scan, so many at most, are looked at: a block has four sides larger than its table, and a top."""
BENEATH = 0.02
"""At most this share of the rest's area lies beneath a table: a plinth has sides, a table seen from above none."""


def find_balls(surface: Any) -> list[tuple[int, float]]:
    """Return the number and the radius of each piece that is a ball, at least half of it."""
    from trimesh.nsphere import fit_nsphere

    balls, piece, vertices = [], pieces_of(surface), np.asarray(surface.vertices)
    order = np.argsort(piece, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(piece[order])) + 1):
        if len(own) < 50:
            continue
        points = vertices[np.unique(surface.faces[own])]
        middle, radius, _ = fit_nsphere(points)
        misfit = np.abs(np.linalg.norm(points - middle, axis=1) - radius)
        # The foot on the table and a rim of noise are no part of the ball.
        near = misfit < max(4 * float(np.median(misfit)), 1e-3 * radius)
        middle, radius, _ = fit_nsphere(points[near])
        misfit = np.linalg.norm(points - middle, axis=1) - radius
        wide = np.ptp(points, axis=0).max() > 1.8 * radius
        if wide and near.mean() > 0.9 and np.sqrt((misfit**2).mean()) < ROUND * radius:
            balls.append((int(piece[own[0]]), float(radius)))
    return balls


def find_table(surface: Any) -> tuple[NDArray[np.bool_], str]:
    """Return which faces (T,) are table, and what to say of it ("" where there is nothing to say).

    A table is flat; everything else stands on one side of it; it reaches well beyond the rest's outline, most ways
    round; its own outline is open (nobody scans a table from below), and what stands on it is no shallow relief.
    So the base of a vase, the side of a brick, a plate, a plinth with sides and the ground of a relief stay.
    """
    vertices, faces, area = np.asarray(surface.vertices), np.asarray(surface.faces), surface.area_faces
    nothing, border = (np.zeros(len(faces), bool), ""), np.unique(border_of(surface))
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    # Small holes only: a table's outline goes around all that stands on it.
    if not len(border) or np.linalg.norm(np.ptp(vertices[border], axis=0)) < 0.1 * size:
        return nothing
    total = np.cumsum(area)
    # Corners, not middles: those scatter less than the vertices, which have to lie in the plane.
    picked = np.searchsorted(total, np.random.default_rng(0).random(4000) * total[-1] * (1 - 1e-9))
    for normal, offset, tolerance in _planes(vertices[faces[picked, 0]], size):
        height, face_height = vertices @ normal - offset, surface.triangles_center @ normal - offset
        low = np.abs(height) < tolerance
        flat = low[faces[:, 0]] & low[faces[:, 1]] & low[faces[:, 2]]
        above, beneath = face_height > 2 * tolerance, face_height < -2 * tolerance
        # The side of a tall block may be larger than the table, which goes on beyond it.
        if flat.any() and above.any() and area[beneath].sum() <= BENEATH * area[above].sum():
            break
    else:
        return nothing

    across = np.linalg.svd(normal[None])[2][1:]
    ours, rest = (_outline(surface.triangles_center[_some(part)] @ across.T) for part in (flat, above))
    width = float((rest + np.roll(rest, len(rest) // 2)).max())
    margin = (ours - rest) / width
    if np.mean(margin > BEYOND) < SIDES or not _is_open(vertices @ across.T, faces[flat], border):
        return nothing
    tall = float(np.quantile(face_height[_some(above)], 0.995))
    share = 100 * area[flat].sum() / area.sum()
    doubt = ""
    if tall < SHALLOW * width:
        doubt = "the rest is as shallow as a relief"
    elif margin.min() < ALWAYS:
        doubt = "not on every side"
    if doubt:
        return nothing[0], (
            f"a flat part ({share:.0f} % of the area) reaches beyond the rest, as a table does, but {doubt}: kept. "
            "Cut it off if it is a table"
        )
    return flat, f"dropped a table ({flat.sum()} faces, {share:.0f} % of the area)"


def _outline(points: NDArray) -> NDArray[np.float64]:
    """Return how far points (N, 2) reach in 64 directions, but for the outermost of them."""
    angles = np.arange(64) * np.pi / 32
    return np.quantile(points @ np.stack([np.cos(angles), np.sin(angles)]), 0.995, axis=0)


def _some(part: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the numbers of some 20000 of the faces in a part (T,): enough for its outline."""
    faces = np.flatnonzero(part)
    return faces[:: len(faces) // 20000 + 1]


def _planes(sample: Array, size: float) -> Iterator[tuple[Array, float, float]]:
    """Yield normal, offset and half thickness of the largest planes in points (N, 3); most others are on its front.

    Fitted to what lies on it, three times, each time within what its own scatter allows.
    """
    open3d = import_open3d()
    open3d.utility.random.seed(0)
    for _ in range(PLANES):
        cloud, tolerance = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(sample)), 0.005 * size
        normal, offset, near = np.zeros(3), 0.0, cloud.segment_plane(tolerance, 3, 1500)[1]
        for _ in range(3):
            if not len(sample[near]):
                return
            middle = sample[near].mean(0)
            normal = np.linalg.svd(sample[near] - middle, full_matrices=False)[2][2]
            normal *= np.sign((sample.mean(0) - middle) @ normal) or 1.0
            offset = float(middle @ normal)
            height = sample @ normal - offset
            tolerance = float(np.clip(5 * spread(height[near]), 5e-4 * size, 5e-3 * size))
            near = np.abs(height) < tolerance
        yield normal, offset, tolerance
        sample = sample[~near]
        if len(sample) < 3:
            return


def _is_open(places: NDArray, flat: NDArray, border: NDArray) -> bool:
    """Whether most corners of the hull of faces `flat` (K, 3), of vertices at `places` (V, 2), are of the `border`."""
    from scipy.spatial import ConvexHull

    used = np.unique(flat)
    return bool(np.isin(used[ConvexHull(places[used]).vertices], border).mean() >= 0.5)
