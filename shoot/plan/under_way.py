"""A shoot under way: its object, noise and flashes so far, as the set-up of the flashes that follow."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lab.job import Job
from lab.run import STEPS
from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.robust import spread
from scene.spheres import Sphere
from shoot.plan.plan_options import PlanOptions
from shoot.plan.set_up import PIXELS, ObjectPixels, ShownObject, pixels_of
from solve.samples import GRAY
from twin.camera.grain import sensor_like

Array = NDArray[np.float64]
METHOD = "iterative"
"""Whose normals and albedo stand for the object."""
SHADOW, HIGHLIGHT = 0.5, 2.0
"""A sample under or over so many times its shading lies in a shadow, or in a highlight."""
FEWEST_PIXELS = 20
"""Without a scan, that have a normal."""


class UnderWay(NamedTuple):
    """What there is of a shoot; of one that is not begun the object and the balls.

    Parameters
    ----------
    pixels : ObjectPixels
    spheres : list of Sphere
    lights : Lights
        So far.
    shown : ShownObject or None
        What the flashes so far show of the pixels, as photographed.
    places : (P, 2) int64
        The pixels' (u, v) in the photographs; () where there are none yet.
    """

    pixels: ObjectPixels
    spheres: list[Sphere]
    lights: Lights = Lights.unknown(())
    shown: ShownObject | None = None
    places: Any = ()

    @property
    def has_known_balls(self) -> bool:
        """Whether the balls predict how well further flashes will be known: two mirrors, which tell ranges."""
        chrome = [sphere for sphere in self.spheres if sphere.kind == "chrome"]
        known = len(chrome) > 1 and all(sphere.diameter_mm for sphere in chrome)
        return known and self.lights.positions_mm is not None and not self.pixels.camera.is_orthographic

    def within(self, options: PlanOptions) -> PlanOptions:
        """Return options whose flashes, where they are at no distance, are at that of the flashes so far."""
        if options.flash_mm is not None or self.lights.positions_mm is None:
            return options
        away = self.lights.positions_mm - self.pixels.middle_mm
        return replace(options, flash_mm=float(np.median(np.linalg.norm(away, axis=1))))


def session_so_far(job: Job) -> UnderWay:
    """Solve what there is of a session, and return it.

    The object is the registered scan with its shadows; without one the normals found so far, without cast shadows.

    Raises SceneError: the steps up to `solve` fail, or the lights are unknown.
    """
    job.run(STEPS, "solve")
    store, method = job.store, METHOD if METHOD in job.methods else job.methods[0]
    lights = store.load_lights()
    if lights.is_unknown:
        raise SceneError(
            "plan: nothing tells the lights so far, so where the next flash helps is not known. Put chrome balls "
            "beside the object."
        )
    mesh = None
    if store.path("pose.json").exists():
        scan, pose = job.load_scan(), store.load_pose()
        mesh = Mesh(pose.apply(scan.vertices), scan.faces)
    found = store.load_frames(), store.load_camera(), lights, store.load_spheres(), store.load_estimate(method)
    return under_way(*found, mesh=mesh)


def under_way(
    frames: Frames,
    camera: Camera,
    lights: Lights,
    spheres: list[Sphere],
    estimate: Estimate,
    *,
    mesh: Mesh | None = None,
    count: int = PIXELS,
) -> UnderWay:
    """Return a shoot by its frames and what they were found to show; its pixels have the scatter of their samples.

    Parameters
    ----------
    frames, camera, lights, spheres, estimate
        So far; a normal map and albedo of the frames' size.
    mesh : Mesh, optional
        The object, registered; its cast shadows count. Default: the estimate's normals are the object.
    count : int
        Pixels at most.

    Raises
    ------
    SceneError
        No pixels to speak of have a normal.
    """
    known = np.asarray(np.isfinite(estimate.normals).all(-1) & (estimate.albedo > 0).any(-1))
    if known.sum() < FEWEST_PIXELS:
        raise SceneError(
            f"plan: {estimate.method} found no normal from {len(lights)} flashes: no part of the object is lit by "
            "three of them. Shoot some more first."
        )
    rows, columns = np.nonzero(known)
    some = np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(int)
    places = np.stack([columns[some], rows[some]], -1)
    points = camera.points_at_depth(places, float(lights.reference_point_mm[2]) or -1000.0)
    known_by = "object: registered scan" if mesh else f"object: normals by {estimate.method}, no cast shadows"
    said = f"{len(lights)} flashes so far; noise measured on the frames", known_by
    how: Any = {"sensor": sensor_like(frames), "white_value": 1.0, "is_mosaic": frames.is_mosaic, "said": said}
    if mesh is not None:
        pixels = pixels_of(camera, mesh, count, **how)
        places = np.rint(camera.project(pixels.points)).astype(np.int64).clip(0, [camera.width - 1, camera.height - 1])
    else:
        normals = np.asarray(estimate.normals[rows[some], columns[some]], np.float64)
        mesh = Mesh(points, np.zeros((0, 3), np.int64))
        pixels = ObjectPixels(camera, mesh, points, normals, normals, np.ones(len(some)), casts_shadows=False, **how)
    # Intensities are those at the object's middle from here on, each channel's mean 1: albedo takes the factor.
    at_middle = np.linalg.norm(lights.at(pixels.middle_mm[None])[:, 0], axis=-1).mean(0)
    lights = lights.seen_from(pixels.middle_mm)
    known_albedo = estimate.albedo @ (at_middle * GRAY).astype(np.float32)
    usual, (u, v) = float(np.median(known_albedo[known])), places.T
    albedo = np.where(known[v, u], known_albedo[v, u], usual).astype(np.float64)
    pixels = replace(pixels, albedo=albedo)
    found = [frames.read_pixels(i, v, u) for i in range(len(frames))]
    gray = [(linear / intensity) @ GRAY for (linear, _), intensity in zip(found, lights.intensities, strict=True)]
    samples, clipped = np.array(gray, np.float64), np.array([clipped for _, clipped in found])
    shown = pixels.under(lights)
    shade = np.einsum("fpi,pi->fp", shown.vectors, pixels.b)
    seen = shown.seen & ~clipped & (samples > SHADOW * shade) & (samples < HIGHLIGHT * shade)
    enough = seen & (seen.sum(0) > 3)
    if enough.any():
        # The scatter is the residuals' standard deviation, by their median, less the sensor's noise: interreflections,
        # a weak highlight, a surface that is not Lambertian. Three numbers were fitted to each pixel's samples.
        counts = np.broadcast_to(seen.sum(0), seen.shape)[enough]
        share = spread((samples - shade)[enough] / shade[enough] * np.sqrt(counts / (counts - 3)))
        sensor = np.median(shown.noise[enough] / shade[enough])
        pixels = replace(pixels, scatter=float(np.sqrt(max(share**2 - sensor**2, 0))))
    noise = np.hypot(shown.noise, pixels.scatter * np.maximum(shade, 0))
    return UnderWay(pixels, spheres, lights, shown._replace(noise=noise, seen=seen), places)
