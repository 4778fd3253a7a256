"""Albedo that was measured as if the object were flat, corrected by its true shape."""

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from twin.visibility import Sight


def albedo_at_the_surface(
    albedo: NDArray[np.float32],
    measured_at_depth_mm: float,
    mesh: Mesh,
    camera: Camera,
    lights: Lights,
    rows: slice,
    columns: slice,
) -> NDArray[np.float32]:
    """Return the albedo of the surface where it is, from one that was fitted on the plane z = `measured_at_depth_mm`.

    A near light is brighter where the surface stands out of that plane, which a solver that knows no depth takes for
    albedo: 12 % for 60 mm at a metre.

    albedo (H, W, 3).
    mesh: In the camera frame.
    rows, columns: The box of the picture that holds the mesh; elsewhere the albedo stays.

    With a = v(plane) . n, b = v(surface) . n over the lights that light the pixel, least squares on I = true b found
    fitted = true sum(a b) / sum(a^2); so true = fitted sum(a^2) / sum(a b).
    """
    out = np.array(albedo, np.float32)
    for band, face, weights, points in Sight(mesh, camera).rows(rows, columns):
        seen = face >= 0
        if not seen.any():
            continue
        normals = np.einsum("pc,pcx->px", weights[seen], mesh.vertex_normals[mesh.faces[face[seen]]])
        flat = camera.points_at_depth(camera.grid(band)[:, columns][seen], measured_at_depth_mm)
        a, b = (np.einsum("npx,px->np", lights.toward(where), normals) for where in (flat, points[seen]))
        strength = lights.intensities.mean(1)[:, None] ** 2 * ((a > 0) & (b > 0))
        both, square = np.sum(strength * a * b, 0), np.sum(strength * a * a, 0)
        # A pixel that no light lights has no albedo to be corrected.
        factor = np.divide(square, both, out=np.ones_like(both), where=both > 0)
        out[band, columns][seen] *= factor[:, None].astype(np.float32)
    return out
