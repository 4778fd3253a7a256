"""`rgbn solve --mesh`: the surface of one method, in a file."""

from pathlib import Path

from lab.job import Job
from lab.progress import say
from scene.errors import SceneError


def check_name(path: Path) -> None:
    """Raise SceneError where a path is not the name of a PLY."""
    if path.suffix.lower() != ".ply":
        raise SceneError(f"--mesh {path}: meshes are written as PLY; give a name that ends in .ply.")


def write_surface(job: Job, path: Path) -> None:
    """Write a solved session's surface: of the first method that found its depth, else of the first, integrated.

    Raises
    ------
    SceneError
        No pixel has a normal, another's file stands there, or it cannot be written.
    """
    from solve.surface.solved_surface import solved_surface

    found = solved_surface(job.store, job.methods)
    mesh = found.mesh()
    mesh.write(path)
    say(f"mesh: {path}, {found.method}, {len(mesh.vertices)} vertices, {len(mesh.faces)} faces; {found.scale}")
