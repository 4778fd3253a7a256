"""What pixels see of the scan at a pose, where it ends in the image, and how both change as the scan moves."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import cross_matrices, image_flow
from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.rays import Hits, RayCaster

Array = NDArray[np.float64]

BESIDE = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""A pixel and its four neighbours."""
STRAIGHT = 0.2
"""Cosine between neighbours' normals under which a fold lies between them, and the slope tells nothing."""

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
    """(h, w): the scan's silhouette on every `step`-th pixel of every `step`-th row."""
    step: int

    def overlap(self, mask: NDArray[np.bool_]) -> float:
        """Return intersection over union with a mask, on the raster."""
        thinned = mask[:: self.step, :: self.step]
        return float((thinned & self.raster).sum() / max((thinned | self.raster).sum(), 1))

    def beyond(self, mask: NDArray[np.bool_]) -> float:
        """Return the silhouette's area outside a mask, in areas of the mask."""
        missed = self.raster & ~mask[:: self.step, :: self.step]
        return float(missed.sum() * self.step**2 / max(np.count_nonzero(mask), 1))


@dataclass(frozen=True)
class View:
    """A scan at a pose (camera_from_scan) before a camera."""

    caster: RayCaster
    camera: Camera
    pose: Pose

    @property
    def pivot(self) -> Array:
        """(3,) the scan's middle, camera frame, mm: what `nudge` turns about."""
        return self.pose.apply(self.caster.mesh.center_mm)

    def hits(self, pixels: NDArray) -> Hits:
        """Return what pixels (P, 2) see of the scan."""
        return self._cast(*self.camera.rays(pixels))

    def normals(self, hits: Hits) -> Array:
        """Return the unit normals (P, 3), camera frame, interpolated over the faces that were hit; NaN elsewhere."""
        return unit(self.pose.rotate(hits.interpolate(self.caster.mesh, self.caster.normals)))

    def surface(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Return points and unit normals (P, 3), camera frame, that rays meet; NaN where the scan is missed.

        Through a hole in the scan its inside is seen: there, normals are NaN, too.
        """
        hits = self._cast(origins, directions)
        points, normals = origins + directions * np.where(hits.hit, hits.distance, np.nan)[:, None], self.normals(hits)
        normals[~hits.front] = np.nan
        return points, normals

    def _cast(self, origins: Array, directions: Array) -> Hits:
        back = self.pose.inverse()
        return self.caster.cast(back.apply(origins), back.rotate(directions), lines=self.camera.is_orthographic)

    def normal_slopes(self, rays: tuple[Array, Array], points: Array, normals: Array) -> Array:
        """Return d(normal)/d(twist) (P, 3, 6) at fixed pixels, for `nudge` about the scan's middle; 0 if unknown.

        `rays`: their `probe_rays`; points and normals (P, 3): what they see. A turn w turns the normal by w x n. The
        surface's point moves in the image, too, and the pixel sees the one that was beside it: minus the normal's slope
        in the image times that flow. Central differences over neighbouring rays give the slope; one-sided ones would
        take a scan's ripples for a slope.
        """
        beside = self.surface(*(part[1:].reshape(-1, 3) for part in rays))[1].reshape(4, len(points), 3)
        flow = image_flow(self.camera, points, self.pivot)
        out = np.zeros((len(points), 3, 6))
        out[:, :, :3] = -cross_matrices(normals)
        for axis in range(2):
            ahead, behind = beside[2 * axis], beside[2 * axis + 1]
            smooth = np.einsum("pk,pk->p", ahead, behind) > STRAIGHT
            out -= np.where(smooth[:, None], (ahead - behind) / 2, np.nan)[:, :, None] * flow[:, axis, None, :]
        out[~np.isfinite(out).all((1, 2))] = 0
        return out

    def outline(self, *, cells: int) -> Outline:
        """Return the scan's outline, searched on a raster of about `cells` cells across the scan."""
        import cv2

        camera = self.camera
        step = max(1, int(np.ceil(self.box()[1].max() / cells)))
        raster = replace(self, camera=camera.every(step)).silhouette()
        across, down = np.argwhere(raster[:, 1:] != raster[:, :-1]), np.argwhere(raster[1:] != raster[:-1])
        first, second = np.concatenate([across, down]), np.concatenate([across + [0, 1], down + [1, 0]])
        first_is_inside = raster[tuple(first.T)][:, None]
        inside, outside = (step * np.where(is_first, first, second)[:, ::-1].astype(np.float64)
                           for is_first in (first_is_inside, ~first_is_inside))  # fmt: skip
        for _ in range(int(np.ceil(np.log2(step))) + 8):
            middle = (inside + outside) / 2
            hit = self.hits(middle).hit[:, None]
            inside, outside = np.where(hit, middle, inside), np.where(hit, outside, middle)
        points = self.surface(*camera.rays(inside))[0]

        rows, columns = box_of(raster, margin=5)
        soft = cv2.GaussianBlur(raster[rows, columns].astype(np.float32), (0, 0), 1.5)
        gradient = np.stack([cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)], -1)
        at = (inside / step - [columns.start, rows.start]).astype(np.float32)
        slope = cv2.remap(gradient, at[:, 0], at[:, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        slope = slope.reshape(-1, 2).astype(np.float64)
        length = np.linalg.norm(slope, axis=1, keepdims=True)
        good = (length[:, 0] > 1e-3) & np.isfinite(points[:, 0])
        good &= (inside > 1).all(1) & (inside[:, 0] < camera.width - 2) & (inside[:, 1] < camera.height - 2)
        return Outline(points[good], inside[good], -slope[good] / length[good], raster, step)

    def silhouette(self) -> NDArray[np.bool_]:
        """Return the pixels (H, W) that see the scan."""
        (left, top), size = self.box()
        right, bottom = left + int(size[0]), top + int(size[1])
        out = np.zeros((self.camera.height, self.camera.width), bool)
        u = np.arange(max(left, 0), min(right + 1, out.shape[1]))
        for row in range(max(top, 0), min(bottom + 1, out.shape[0]), ROWS):
            v = np.arange(row, min(row + ROWS, bottom + 1, out.shape[0]))
            pixels = np.stack(np.meshgrid(u, v), -1).astype(np.float64)
            out[v[0] : v[-1] + 1, u[0] : u[-1] + 1] = self.hits(pixels.reshape(-1, 2)).hit.reshape(pixels.shape[:2])
        return out

    def box(self) -> tuple[NDArray[np.int64], Array]:
        """Return the corner (u, v) and the size of the box of pixels that holds the scan, cut to the image."""
        camera, vertices = self.camera, self.caster.mesh.vertices
        # A subset of a dense scan bounds it well enough with the margin of a twentieth.
        seen = camera.project(self.pose.apply(vertices[:: max(1, len(vertices) // 20000)]))
        limit = np.array([camera.width, camera.height])
        low, high = np.nanmin(seen, 0), np.nanmax(seen, 0)
        margin = 3 + 0.05 * (high - low).max()
        low = np.clip(np.floor(low - margin), -2, limit)
        high = np.clip(np.ceil(high + margin), low + 1, limit + 1)
        return low.astype(np.int64), high - low


def probe_rays(camera: Camera, pixels: NDArray) -> tuple[Array, Array]:
    """Return origins and directions (5, P, 3) of the rays of pixels (P, 2) and of their four neighbours."""
    return camera.rays(np.asarray(pixels, np.float64) + BESIDE[:, None])


def outline_strokes(mesh: Mesh, pose: Pose, camera: Camera) -> NDArray[np.float64]:
    """Return the scan's outline in the picture as short strokes along it, (K, 2 ends, 2), pixels, distortion honoured.

    `pose` is camera_from_scan.
    """
    found = View(RayCaster(mesh), camera, pose).outline(cells=STROKES)
    along = np.stack([-found.outward[:, 1], found.outward[:, 0]], -1)
    # A little longer than their distance, so that they join.
    return found.pixels[:, None] + 0.6 * found.step * np.array([-1.0, 1.0])[:, None] * along[:, None]


def box_of(mask: NDArray[np.bool_], *, margin: int = 0) -> tuple[slice, slice]:
    """Return the rows and columns that hold a mask's pixels, and a margin about them; all of an empty one."""
    if not mask.any():
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    ends = (np.flatnonzero(mask.any(axis))[[0, -1]] + [-margin, margin + 1] for axis in (1, 0))
    rows, columns = (slice(*np.clip(two, 0, size).tolist()) for two, size in zip(ends, mask.shape, strict=True))
    return rows, columns


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
