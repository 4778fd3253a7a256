"""A session under way: its camera, balls, noise and flashes so far, as the set-up of the flashes that follow."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lab.job import Job
from lab.plan import STEPS
from lab.shoot.flash_samples import PIXELS, ObjectPixels, pixels_of
from lab.shoot.set_up import SetUp
from scene.errors import SceneError
from scene.lights import Lights
from scene.mesh import Mesh
from scene.spheres import Sphere
from solve.samples import GRAY

METHOD = "iterative"
"""Whose normals and albedo stand for the object."""


class UnderWay(NamedTuple):
    """What there is of a session."""

    pixels: ObjectPixels
    lights: Lights
    spheres: list[Sphere]


def session_so_far(job: Job, gloss: str) -> UnderWay:
    """Solve what there is of a session, and return it.

    The object is the registered scan with its shadows; without one the normals found so far, without cast shadows.

    Raises
    ------
    SceneError
        The steps up to `solve` fail, or the lights are unknown.
    """
    from twin.camera.grain import sensor_like

    job.run(STEPS, "solve")
    store, method = job.store, METHOD if METHOD in job.methods else job.methods[0]
    lights, camera, frames = store.load_lights(), store.load_camera(), store.load_frames()
    if lights.is_unknown:
        raise SceneError(
            "plan: nothing tells the lights so far, so where the next flash helps is not known. Put chrome balls "
            "beside the object."
        )
    estimate = store.load_estimate(method)
    gray = estimate.albedo @ GRAY
    known = np.isfinite(estimate.normals).all(-1) & (gray > 0)
    if not known.any():
        raise SceneError(f"plan: {method} found no normal from {len(lights)} flashes. Shoot some more first.")
    said = (
        f"{len(lights)} flashes so far; noise measured on the frames",
        f"object: {'registered scan' if store.path('pose.json').exists() else f'normals by {method}, no cast shadows'}",
    )
    bare = SetUp(
        camera, Mesh(np.zeros((1, 3)), np.zeros((0, 3), np.int64)), sensor_like(frames), gloss,
        albedo=float(np.median(gray[known])), white_value=1.0, is_mosaic=frames.is_mosaic, said=said,
    )  # fmt: skip
    if store.path("pose.json").exists():
        scan, pose = job.load_scan(), store.load_pose()
        return UnderWay(
            pixels_of(replace(bare, mesh=Mesh(pose.apply(scan.vertices), scan.faces))), lights, store.load_spheres()
        )
    rows, columns = np.nonzero(known)
    some = np.linspace(0, len(rows) - 1, min(PIXELS, len(rows))).astype(int)
    rows, columns = rows[some], columns[some]
    depth = float(lights.reference_point_mm[2]) or -1000.0
    points = camera.points_at_depth(np.stack([columns, rows], -1), depth)
    normals = np.asarray(estimate.normals[rows, columns], np.float64)
    set_up = replace(bare, mesh=Mesh(points, np.zeros((0, 3), np.int64)))
    albedo = np.asarray(gray[rows, columns], np.float64)
    return UnderWay(ObjectPixels(set_up, points, normals, normals, albedo, False), lights, store.load_spheres())
