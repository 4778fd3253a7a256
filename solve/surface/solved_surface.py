"""The surface that a method found, out of an output folder: of its depth, or else of what its normals integrate to."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.store import Store
from solve.problem import UNKNOWN_MM
from solve.surface.integration import IntegratedSurface, integrate, surface_at


class SolvedSurface(NamedTuple):
    """A method's surface, on every n-th pixel of the picture.

    scale: What tells its size and place, in words.
    """

    method: str
    surface: IntegratedSurface
    normals: NDArray
    albedo: NDArray
    camera: Camera
    step: int
    scale: str


def solved_surface(store: Store, methods: Sequence[str], most_pixels: int) -> SolvedSurface:
    """Return the surface of the first method that found its depth, else of the first.

    Normals, albedo and depth are always one method's: a depth map is that which its method's normals were found under.

    Parameters
    ----------
    store : Store
        An output folder after `solve`.
    methods : sequence of str
    most_pixels : int
        Of the object; where it has more, every second is taken, or every third, and so on.

    Raises
    ------
    SceneError
        No pixel has a normal.
    """
    method = next((name for name in methods if store.path("depth", f"{name}.npy").exists()), methods[0])
    camera, lights = store.load_camera(), store.load_lights()
    step = max(1, int(np.ceil(np.sqrt(np.count_nonzero(store.load_mask()) / most_pixels))))
    every, camera = (slice(None, None, step),) * 2, camera.every(step)
    normals, albedo = store.load_normals(method)[every], store.read_array("albedo", f"{method}.npy")[every]
    z_mm = float(lights.reference_point_mm[2])
    scale = f"the surface's middle was put at the lights' reference point, z = {z_mm:.0f} mm"
    if camera.is_orthographic:
        scale = "nothing tells its size: a pixel was taken for a millimetre"
    elif z_mm >= 0:
        z_mm = UNKNOWN_MM
        scale = f"nothing tells the distance: it was put at z = {z_mm:.0f} mm, and its size is as arbitrary"
    if store.path("depth", f"{method}.npy").exists():
        depth = store.read_array("depth", f"{method}.npy")[every].astype(np.float64)
        surface, scale = surface_at(depth, normals, camera), "the distance was found by the shading"
    else:
        surface = integrate(normals, camera, z_mm=z_mm)
    return SolvedSurface(method, surface, normals, albedo, camera, step, scale)
