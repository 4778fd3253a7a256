"""How the registered scan would look: its outline, and its shading under one light."""

import numpy as np
from numpy.typing import NDArray

from align.pose.scan_outline import find_outline
from align.pose.scan_view import View
from align.pose.shading import find_shadows
from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster

CELLS = 1500
"""The outline is searched on a raster of at most so many cells across the scan; its points are exact all the same."""


def outline(mesh: Mesh, pose: Pose, camera: Camera) -> NDArray[np.float64]:
    """Return the scan's outline in the picture as short strokes along it, (K, 2 ends, 2), pixels, distortion honoured.

    `pose` is camera_from_scan.
    """
    found = find_outline(View(RayCaster(mesh), camera, pose), cells=CELLS)
    along = np.stack([-found.outward[:, 1], found.outward[:, 0]], -1)
    # A little longer than their distance, so that they join.
    return found.pixels[:, None] + 0.6 * found.step * np.array([-1.0, 1.0])[:, None] * along[:, None]


def shading(mesh: Mesh, pose: Pose, camera: Camera, lights: Lights, index: int, pixels: NDArray) -> NDArray[np.float32]:
    """Return what a white matte scan would show at pixels (..., 2) under light `index`, (...), NaN off the scan.

    max(0, vector . normal), the light's fall-off in the vector, 0 in cast shadows; the light's intensity is not in it.
    """
    one = Lights(
        lights.names[index : index + 1],
        lights.directions[index : index + 1],
        lights.intensities[index : index + 1],
        None if lights.positions_mm is None else lights.positions_mm[index : index + 1],
        lights.reference_point_mm,
    )
    view = View(RayCaster(mesh), camera, pose)
    flat = np.asarray(pixels, np.float64).reshape(-1, 2)
    out = np.full(len(flat), np.nan, np.float32)
    step = 1 << 19
    for first in range(0, len(flat), step):
        part = slice(first, first + step)
        points, normals = view.surface(flat[part])
        seen = np.isfinite(points[:, 0])
        points, normals = points[seen], normals[seen]
        cosine = np.maximum(np.einsum("pk,pk->p", one.toward(points)[0], normals), 0)
        values = out[part]
        values[seen] = np.where(find_shadows(view, one, points, normals)[0], 0, cosine)
    return out.reshape(np.shape(pixels)[:-1])
