"""What a material is fitted to: pixels of the photographs whose surface, light and view the scan tells."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.frames import Frames
from scene.normals import unit
from twin.visibility import Sight

Array = NDArray[np.float64]
Image = NDArray[np.float32]

MOST, FEWEST = 20_000, 100
"""Pixels."""
LEAST_LIGHTS = 3
"""They fix the albedo's channels and leave something to be judged."""
OUTLINE_PX = 3
"""So near the mask's border no pixel is taken: it may show what lies behind, and its normal is least known."""
GRAZING = 0.25
"""Cosine between normal and view below which a pixel is left out."""
DIM = 0.15
"""Cosine between normal and light below which a sample is left out: the border of the attached shadow is the worst
known, and light from elsewhere weighs most."""
PIXEL_PX2, MOSAIC_PX2, LENS_PX2 = 1 / 12, 0.4, 0.25
"""Variance, along one axis, of where a value's light comes from: the pixel's own square, interpolation between the
colours of a mosaic (mean over them), and a good lens."""
CREASED = 0.02
"""Spread beyond which a pixel is left out: 8 degrees within one."""
BESIDE_PX = np.array([[0.0, 0.0], [1.5, 0.0], [-0.75, 1.3], [-0.75, -1.3]])
"""A shadow must cover, or leave, all of these: so near its border nobody knows on which side a pixel lies."""


class MaterialSamples(NamedTuple):
    """P pixels under F lights, as kernels read them.

    rows, columns (P,).
    points, normals, views (P, 3): Camera frame, mm; unit; unit, toward the camera.
    toward (P, F, 3): Unit, toward each light.
    irradiance (P, F, 3 channels): Intensity times fall-off, on what faces the light.
    values (P, F, 3): Linear; the ambient frame, if there is one, is subtracted.
    usable (P, F): Not clipped, in no shadow nor near one's border, not too dim.
    spread (P,): Square of the angle (radians) over which a pixel smears the normal: added to that of the roughness.
    pixel_share: P over the number of pixels that might have been taken.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    points: Image
    normals: Image
    views: Image
    toward: Image
    irradiance: Image
    values: Image
    usable: NDArray[np.bool_]
    spread: Image
    pixel_share: float

    def blocks(self, pixels: float) -> NDArray[np.intp]:
        """Return (P,) the number of the square of the picture that each lies in, of about so many of the pixels."""
        rows, columns = self.rows - self.rows.min(), self.columns - self.columns.min()
        side = max(1.0, np.sqrt(pixels / self.pixel_share))
        return (rows // side).astype(int) * (int(columns.max() // side) + 1) + (columns // side).astype(int)

    def only(self, which: Any) -> "MaterialSamples":
        """Return some of the pixels, without gaps in memory: the kernels are compiled once, and for that."""
        *arrays, share = self
        return self._make([*(np.ascontiguousarray(array[which]) for array in arrays), share])


def samples_of_scan(
    sight: Sight,
    frames: Frames,
    mask: NDArray[np.bool_],
    most: int = MOST,
) -> MaterialSamples:
    """Return samples of a registered scan, without those in its cast shadows.

    sight: The scan under the calibrated lights; where its normals are given and NaN, no pixel is taken.
    mask (H, W): The object.
    most: Pixels.
    Raises RenderError: Fewer than `FEWEST` pixels are left.
    """
    rows, columns = inner_pixels(mask, sight.normals)
    if len(rows) < FEWEST:
        raise RenderError(
            f"material: {len(rows)} pixels lie {OUTLINE_PX} px within the object's outline and have a normal; expected "
            f"{FEWEST} or more. Check the mask, and that the pose fits these frames."
        )
    taken = np.sort(np.random.default_rng(0).permutation(len(rows))[:most])
    samples = samples_at(sight, frames, rows[taken], columns[taken])
    if len(samples.rows) < FEWEST:
        raise RenderError(
            f"material: {len(samples.rows)} pixels have a normal and are lit by three flashes without being clipped; "
            f"expected {FEWEST} or more. Check the lights, the exposure and the pose."
        )
    return samples._replace(pixel_share=len(taken) / len(rows))


def samples_at(
    sight: Sight, frames: Frames, rows: NDArray[np.intp], columns: NDArray[np.intp], *, lenient: bool = False
) -> MaterialSamples:
    """Return the samples of those of the pixels (P,) that can be used; see `samples_of_scan`.

    lenient: All that see the scan and are lit by one light: their albedo is better known so than by their neighbours'.
    """
    camera, lights, mesh, normals = sight.camera, sight.lights, sight.mesh, sight.normals
    pixels = np.stack([columns, rows], -1).astype(np.float64)
    looks = [sight.at(pixels + offset) for offset in BESIDE_PX]
    points: Any = looks[0][2]
    if normals is None:
        # The plane through what is found beside.
        smooth = mesh.vertex_normals
        around = [unit(np.einsum("pc,pcx->px", weights, smooth[mesh.faces[face]])) for face, weights, _ in looks]
        found: Any = around[0]
        slopes: Any = np.einsum("xk,kpi->pxi", np.linalg.pinv(BESIDE_PX[1:]), np.stack(around[1:]) - around[0])
    else:
        found, slopes = normals[rows, columns].astype(np.float64), _slopes(normals, rows, columns)
    views = -camera.rays(pixels)[1]
    facing = np.sum(found * views, 1)
    if lenient:
        looks, slopes = looks[:1], np.nan_to_num(slopes)
        keep = (looks[0][0] >= 0) & (facing > 0)
    else:
        step = np.linalg.norm(looks[1][2] - points, axis=1)
        keep = np.logical_and.reduce([look[0] >= 0 for look in looks]) & (facing > GRAZING)
        keep &= np.isfinite(slopes).all((1, 2))
        # A step of 1.5 pixels that goes much farther than the surface's slant explains has crossed an edge.
        scale = 1.0 if camera.is_orthographic else -points[:, 2]
        keep &= step < 3 * 1.5 * scale / camera.fx / np.maximum(facing, GRAZING)
    rows, columns = rows[keep], columns[keep]
    found, views, points, slopes = (a[keep] for a in (found, views, points, slopes))
    shape = (len(rows), len(lights))
    behind = np.zeros(shape, bool)
    for look in looks:
        flat = mesh.face_normals[look[0][keep]]
        behind |= np.logical_or(*sight.shadows(look[2][keep], flat, flat))
    toward, irradiance = np.empty((*shape, 3), np.float32), np.empty((*shape, 3), np.float32)
    values, clipped = np.empty((*shape, 3), np.float32), np.empty(shape, bool)
    vectors = lights.toward(points)
    for index in range(len(lights)):
        length = np.linalg.norm(vectors[index], axis=1, keepdims=True)
        toward[:, index] = vectors[index] / length
        irradiance[:, index] = length * lights.intensities[index]
        values[:, index], clipped[:, index] = frames.read_pixels(index, rows, columns)
    cosine = np.einsum("pi,pfi->pf", found.astype(np.float32), toward)
    usable = ~behind & ~clipped & (cosine > (0 if lenient else DIM)) & (irradiance > 0).all(-1)
    smear = PIXEL_PX2 + LENS_PX2 + (MOSAIC_PX2 if frames.is_mosaic else 0)
    spread = smear * np.sum(slopes**2, (1, 2))
    at, normal, view = (a.astype(np.float32) for a in (points, found, views))
    samples = MaterialSamples(
        rows, columns, at, normal, view, toward, irradiance, values, usable, spread.astype(np.float32), 1.0
    )  # fmt: skip
    if lenient:
        return samples._replace(spread=np.minimum(samples.spread, CREASED)).only(usable.any(1))
    return samples.only((usable.sum(1) >= LEAST_LIGHTS) & (spread < CREASED))


def inner_pixels(mask: NDArray[np.bool_], normals: Image | None) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows and columns (P,) of the pixels within the outline whose normal is known."""
    import cv2

    inner = np.pad(mask, OUTLINE_PX).astype(np.uint8)
    inner = cv2.erode(inner, np.ones((2 * OUTLINE_PX + 1,) * 2, np.uint8))[
        OUTLINE_PX:-OUTLINE_PX, OUTLINE_PX:-OUTLINE_PX
    ].astype(bool)
    if normals is not None:
        inner &= np.isfinite(normals).all(-1)
    return np.nonzero(inner)  # type: ignore[return-value]


def _slopes(normals: Image, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
    """Return (P, 2, 3), half the difference of the neighbours on either side."""
    low, right = np.array(normals.shape[:2]) - 1
    across = normals[rows, np.minimum(columns + 1, right)] - normals[rows, np.maximum(columns - 1, 0)]
    down = normals[np.minimum(rows + 1, low), columns] - normals[np.maximum(rows - 1, 0), columns]
    return np.stack([across, down], 1).astype(np.float64) / 2
