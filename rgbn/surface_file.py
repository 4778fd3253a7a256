"""`rgbn solve --mesh`: the surface of one method, in a file."""

from pathlib import Path

import numpy as np

from lab.job import Job
from lab.progress import say
from scene.errors import SceneError

UNKNOWN_MM = -1000.0
"""Where an object of unknown distance is put."""


def check_name(path: Path) -> None:
    """Raise SceneError where a path is not the name of a PLY."""
    if path.suffix.lower() != ".ply":
        raise SceneError(f"--mesh {path}: meshes are written as PLY; give a name that ends in .ply.")


def write_surface(job: Job, path: Path) -> None:
    """Write a solved session's surface: of the first method that found its depth, else of the first, integrated.

    Normals, albedo and depth are always one method's: a depth map is that which its method's normals were found
    under, and where there is none the surface is what those normals integrate to.

    Raises SceneError: no pixel has a normal, another's file stands there, or it cannot be written.
    """
    from solve.surface.integration import integrate, surface_at
    from solve.surface.surface_mesh import mesh_of

    store = job.store
    method = next((name for name in job.methods if store.path("depth", f"{name}.npy").exists()), job.methods[0])
    normals, camera, lights = store.load_normals(method), store.load_camera(), store.load_lights()
    albedo = store.read_array("albedo", f"{method}.npy")
    depth = store.path("depth", f"{method}.npy")
    if depth.exists():
        surface = surface_at(store.read_array("depth", f"{method}.npy").astype(np.float64), normals, camera)
        scale = "the distance was found by the shading"
    else:
        z_mm = float(lights.reference_point_mm[2])
        scale = f"the surface's middle was put at the lights' reference point, z = {z_mm:.0f} mm"
        if z_mm >= 0 and not camera.is_orthographic:
            z_mm = UNKNOWN_MM
            scale = f"nothing tells the distance: it was put at z = {z_mm:.0f} mm, and its size is as arbitrary"
        surface = integrate(normals, store.load_mask(), camera, z_mm=z_mm)
    mesh = mesh_of(surface, normals, albedo, camera)
    mesh.write(path)
    say(f"mesh: {path}, {method}, {len(mesh.vertices)} vertices, {len(mesh.faces)} faces; {scale}")
