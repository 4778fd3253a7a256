"""What a normal map tells of its own axes: it faces the viewer, is a surface's slope, and points out at the rim."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FACING = 0.97
"""Share of the normals that point to the viewer, in the right axes."""
_STEEP = 0.3
"""z of a normal under which its slope says too little."""
_CLEARLY = 0.5
"""A misfit is clearly the least when the next is twice as large."""
_OUT = 0.35
"""Mean cosine, at the rim, between normals and the way out, from which the rim is one; in wrong axes it is negative."""


def own_misfits(normals: Array, mask: NDArray[np.bool_], axes: Array) -> tuple[float, float, float]:
    """Return how ill normals fit their own picture in some axes.

    Parameters
    ----------
    normals : (H, W, 3) float64
        NaN where there is none.
    mask : (H, W) bool
    axes : (3, 3) float64
        Camera frame from the map's.

    Returns
    -------
    behind : float
        Share that points away from the viewer.
    curl : float
        Median of |dp/dy - dq/dx| over slopes p = -x/z, q = -y/z, x right, y up, in pixels: 0 on every smooth surface.
    out : float
        Mean over the rim of the cosine between a normal's x, y and the way out of the mask: 1 on a round body, near 0
        on a relief that fills its mask.
    """
    turned = np.where(mask[..., None], normals @ axes.T, np.nan)
    known = np.isfinite(turned[..., 0])
    behind = float(np.mean(turned[..., 2][known] <= 0)) if known.any() else 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        z = np.where(turned[..., 2] > _STEEP, turned[..., 2], np.nan)
        p, q = -turned[..., 0] / z, -turned[..., 1] / z
    # Rows run down, y up.
    across, down = (q[1:-1, 2:] - q[1:-1, :-2]) / 2, -(p[2:, 1:-1] - p[:-2, 1:-1]) / 2
    curl = np.abs(down - across)
    curl = float(np.nanmedian(curl)) if np.isfinite(curl).any() else np.inf
    return behind, curl, _way_out(turned, mask)


def _way_out(turned: Array, mask: NDArray[np.bool_]) -> float:
    import cv2

    inside = np.pad(mask, 1).astype(np.uint8)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, 5)[1:-1, 1:-1]
    smooth = np.asarray(cv2.GaussianBlur(depth, (0, 0), 1.5), np.float64)
    gy, gx = np.gradient(smooth, axis=0), np.gradient(smooth, axis=1)
    known = np.isfinite(turned[..., 0]) & np.isfinite(turned[..., 2])
    border = np.zeros_like(mask)
    border[1:-1, 1:-1] = True
    # Where the picture ends the object does not.
    rim = mask & known & (depth <= 2.5) & border
    if rim.sum() < 20:
        return 0.0
    out, flat = np.stack([-gx[rim], gy[rim]], -1), turned[rim][:, :2]
    scale = np.linalg.norm(out, axis=1) * np.linalg.norm(flat, axis=1)
    cosine = np.sum(out * flat, 1) / np.maximum(scale, 1e-9)
    # A rim is steep; the edge of a relief is what it happens to be.
    return float(np.mean(cosine) * min(1.0, np.median(np.linalg.norm(flat, axis=1)) / 0.7))


def axes_by_themselves(
    normals: Array, mask: NDArray[np.bool_], all_axes: tuple[Array, ...], *, with_rim: bool
) -> tuple[int, bool]:
    """Return the axes in which a normal map makes sense by itself, and whether it tells them from all others.

    Parameters
    ----------
    normals : (H, W, 3) float64
    mask : (H, W) bool
    all_axes : tuple of (3, 3) float64
        The candidates; the first changes nothing.
    with_rim : bool
        Take it that normals point out of the mask at its rim: a hollow's do not. Else the rim only chooses where the
        first is ruled out.

    Returns
    -------
    best : int
        Which of them; 0 where nothing speaks against it.
    told : bool
    """
    found = [own_misfits(normals, mask, axes) for axes in all_axes]
    facing = [k for k, (behind, _, _) in enumerate(found) if behind < 1 - FACING]
    if not facing:
        return 0, False
    # The third axis as it stands, where that will do.
    toward = [axes[2] for axes in (all_axes[k] for k in facing)]
    third = next((row for row in toward if np.array_equal(row, [0, 0, 1])), toward[0])
    facing = [k for k in facing if np.array_equal(all_axes[k][2], third)]
    least = min(found[k][1] for k in facing)
    left = [k for k in facing if found[k][1] <= max(least / _CLEARLY, 1e-4)]
    if 0 in left and not with_rim:
        return 0, len(left) == 1
    most = max(found[k][2] for k in left)
    if most > _OUT:
        left = [k for k in left if found[k][2] > most - _OUT]
    return (0 if 0 in left else max(left, key=lambda k: found[k][2])), len(left) == 1
