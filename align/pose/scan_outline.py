"""The scan's silhouette and its outline: where the scan ends in the image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import image_flow
from align.pose.scan_view import View
from scene.camera import Camera
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

ROWS = 256
"""Of pixels that are cast at a time."""
STROKES = 1500
"""An outline to be drawn is searched on a raster of at most so many cells across the scan; its points are exact."""


@dataclass(frozen=True)
class Outline:
    """Points of the scan's outline, as seen at one pose, and its silhouette."""

    points: Array
    """(K, 3): on the scan, camera frame, mm."""
    pixels: Array
    """(K, 2): their image; exact to a thousandth of the raster's step."""
    outward: Array
    """(K, 2). Unit, image axes (u, v), away from the scan."""
    raster: NDArray[np.bool_]
    """(h, w): the scan's silhouette on every `step`-th pixel."""
    corner: NDArray[np.int64]
    """(2,): pixel (u, v) of raster[0, 0]."""
    step: int

    def overlap(self, mask: NDArray[np.bool_]) -> float:
        """Return intersection over union with a mask, on the raster."""
        window = self._window(mask)
        # What of the mask the raster does not reach counts as missed.
        area = max(np.count_nonzero(mask) / self.step**2, window.sum())
        both = (window & self.raster).sum()
        return float(both / (area + self.raster.sum() - both))

    def beyond(self, mask: NDArray[np.bool_]) -> float:
        """Return the silhouette's area outside a mask, in areas of the mask."""
        return float((self.raster & ~self._window(mask)).sum() * self.step**2 / max(np.count_nonzero(mask), 1))

    def _window(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the mask on the raster; False outside the picture."""
        (u, v), (height, width) = self.corner, self.raster.shape
        rows, columns = v + self.step * np.arange(height), u + self.step * np.arange(width)
        inside = np.ix_((rows >= 0) & (rows < mask.shape[0]), (columns >= 0) & (columns < mask.shape[1]))
        window = np.zeros(self.raster.shape, bool)
        window[inside] = mask[rows[inside[0]], columns[inside[1]]]
        return window


def outline_jacobian(camera: Camera, points: NDArray, outward: NDArray, pivot: NDArray) -> Array:
    """Return d(pixel . outward)/d(twist) (K, 6) of outline points (K, 3), camera frame, for `nudge` about `pivot`.

    A point of the outline may slide along the surface: across the outline that moves nothing, to first order.
    """
    if not len(points):
        return np.zeros((0, 6))
    return np.einsum("kp,kpt->kt", outward, image_flow(camera, points, pivot))


def find_outline(view: View, *, cells: int) -> Outline:
    """Return the scan's outline at a pose, searched on a raster of about `cells` cells across the scan."""
    import cv2

    camera = view.camera
    corner, size = _frame(view)
    step = max(1, int(np.ceil(size.max() / cells)))
    u = corner[0] + step * np.arange(int(size[0]) // step + 1)
    v = corner[1] + step * np.arange(int(size[1]) // step + 1)
    pixels = np.stack(np.meshgrid(u, v), -1).astype(np.float64)
    raster = view.hits(pixels.reshape(-1, 2)).hit.reshape(pixels.shape[:2])

    across = raster[:, 1:] != raster[:, :-1]
    down = raster[1:] != raster[:-1]
    ends = [np.concatenate([pixels[:, :-1][across], pixels[:-1][down]])]
    ends.append(np.concatenate([pixels[:, 1:][across], pixels[1:][down]]))
    first_is_inside = np.concatenate([raster[:, :-1][across], raster[:-1][down]])[:, None]
    inside = np.where(first_is_inside, ends[0], ends[1])
    outside = np.where(first_is_inside, ends[1], ends[0])
    for _ in range(int(np.ceil(np.log2(step))) + 8):
        middle = (inside + outside) / 2
        hit = view.hits(middle).hit[:, None]
        inside, outside = np.where(hit, middle, inside), np.where(hit, outside, middle)
    points = view.surface(*camera.rays(inside))[0]

    soft = cv2.GaussianBlur(raster.astype(np.float32), (0, 0), 1.5)
    gradient = np.stack([cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)], -1)
    at = ((inside - corner) / step).astype(np.float32)
    slope = cv2.remap(gradient, at[:, 0], at[:, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    slope = slope.reshape(-1, 2).astype(np.float64)
    length = np.linalg.norm(slope, axis=1, keepdims=True)
    good = (length[:, 0] > 1e-3) & np.isfinite(points[:, 0])
    good &= (inside > 1).all(1) & (inside[:, 0] < camera.width - 2) & (inside[:, 1] < camera.height - 2)
    return Outline(points[good], inside[good], -slope[good] / length[good], raster, corner, step)


def silhouette(view: View) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that see the scan."""
    (left, top), size = _frame(view)
    right, bottom = left + int(size[0]), top + int(size[1])
    out = np.zeros((view.camera.height, view.camera.width), bool)
    u = np.arange(max(left, 0), min(right + 1, out.shape[1]))
    for row in range(max(top, 0), min(bottom + 1, out.shape[0]), ROWS):
        v = np.arange(row, min(row + ROWS, bottom + 1, out.shape[0]))
        pixels = np.stack(np.meshgrid(u, v), -1).astype(np.float64)
        out[v[0] : v[-1] + 1, u[0] : u[-1] + 1] = view.hits(pixels.reshape(-1, 2)).hit.reshape(pixels.shape[:2])
    return out


def outline_strokes(mesh: Mesh, pose: Pose, camera: Camera) -> NDArray[np.float64]:
    """Return the scan's outline in the picture as short strokes along it, (K, 2 ends, 2), pixels, distortion honoured.

    `pose` is camera_from_scan.
    """
    found = find_outline(View(RayCaster(mesh), camera, pose), cells=STROKES)
    along = np.stack([-found.outward[:, 1], found.outward[:, 0]], -1)
    # A little longer than their distance, so that they join.
    return found.pixels[:, None] + 0.6 * found.step * np.array([-1.0, 1.0])[:, None] * along[:, None]


def _frame(view: View) -> tuple[NDArray[np.int64], Array]:
    """Return the corner (u, v) and the size of the box of pixels that holds the scan, cut to the image."""
    camera, vertices = view.camera, view.caster.mesh.vertices
    # A subset of a dense scan bounds it well enough with the margin of a twentieth.
    seen = camera.project(view.pose.apply(vertices[:: max(1, len(vertices) // 20000)]))
    limit = np.array([camera.width, camera.height])
    low, high = np.nanmin(seen, 0), np.nanmax(seen, 0)
    margin = 3 + 0.05 * (high - low).max()
    low = np.clip(np.floor(low - margin), -2, limit)
    high = np.clip(np.ceil(high + margin), low + 1, limit + 1)
    return low.astype(np.int64), high - low


def signed_distance(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (H, W) float32, pixels from the mask's border, positive outside."""
    import cv2

    padded = np.pad(mask, 1).astype(np.uint8)
    outside = cv2.distanceTransform(1 - padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    inside = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    # The border runs midway between the last pixel inside and the first outside.
    distance = outside - np.float32(0.5)
    np.subtract(np.float32(0.5), inside, out=distance, where=mask)
    return distance


def sample(image: NDArray[np.float32], pixels: NDArray) -> Array:
    """Return `image` (H, W) at pixels (..., 2), bilinear, the border's value outside; (L, H, W) at (u, v, layer)."""
    from scipy.ndimage import map_coordinates

    return map_coordinates(image, np.moveaxis(pixels, -1, 0)[::-1], np.float64, order=1, mode="nearest")
