"""A registered scan with its measured albedo under the session's lights, as a scene description.

What is physical of it: the shape with its cast shadows, near or distant lights, the measured albedo, light that goes
from one part of the object to another. What is not: gloss (`twin.material.material_light.material_scene` adds it), the
table and whatever else stands around.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.description_check import unsound_lights
from twin.description.materials import Diffuse
from twin.engines.film import film_for
from twin.material.measured_albedo import albedo_at_the_surface, textured_surface


def scan_scene(
    mesh: Mesh,
    pose: Pose,
    camera: Camera,
    lights: Lights,
    albedo: NDArray[np.float32],
    *,
    albedo_depth_mm: float | None = None,
    white_value: NDArray[np.float64] | None = None,
    sampling: Sampling,
) -> tuple[TwinScene, tuple[str, ...]]:
    """Return the scene of a session's matte object alone, and what is suspicious about it.

    The albedo's white value becomes the lights', so that pixel values are those that the albedo was measured in.

    Parameters
    ----------
    mesh : Mesh
        The scan, millimetres, in its own frame.
    pose : Pose
        camera_from_scan.
    camera : Camera
        Perspective or orthographic.
    lights : Lights
        Near lights are rendered as points at `positions_mm`, others as distant.
    albedo : (H, W, 3) float32
        Pixel value under a light of intensity 1 along the normal, NaN where unknown: what a solver measured.
    albedo_depth_mm : float or None
        The z at which near lights were evaluated when the albedo was measured, if not at the surface itself: a solver
        that knows no shape takes the reference point's.
    white_value : (3,) float64 or None
        Pixel value of the white ball under a light of intensity 1; `lights.white_value` if not given. The ball is
        taken to reflect 80 %: that alone decides how strong the interreflections are, never the direct light.

    Raises
    ------
    RenderError
        The mesh is empty or not finite, the camera does not see it, a light lies inside it, the albedo has another
        size than the camera's, or a light or the albedo holds nothing that can be rendered.

    Notes
    -----
    With reflectance rho = albedo / white * 0.8 and irradiance E = pi * intensity * white / 0.8, a Lambertian surface
    has the radiance rho / pi * E * cos = albedo * intensity * cos: the direct light's pixel values are the session's
    own, whatever the ball's true reflectance.
    """
    _check(mesh, camera, lights, albedo)
    placed = Mesh(pose.apply(mesh.vertices), mesh.faces)
    film = film_for(camera, placed.vertices)
    _check_lights_are_outside(placed, lights)
    white = lights.white_value if white_value is None else white_value
    if albedo_depth_mm is not None and lights.positions_mm is not None:
        albedo = albedo_at_the_surface(albedo, albedo_depth_mm, placed, camera, lights, film.rows, film.columns)
    textured, texture, white, warnings = textured_surface(placed, camera, albedo, white, film.rows, film.columns)
    scene = TwinScene(
        camera,
        (TwinObject("object", textured, "measured_albedo"),),
        {"measured_albedo": Diffuse(texture)},
        replace(lights, white_value=white),
        sampling=sampling,
    )
    return scene, warnings


def _check(mesh: Mesh, camera: Camera, lights: Lights, albedo: NDArray) -> None:
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise RenderError(
            f"the scan has {len(mesh.faces)} faces, and {np.count_nonzero(~np.isfinite(mesh.vertices))} of its "
            "coordinates are not finite; nothing can be rendered. Load or export it again."
        )
    if albedo.shape != (camera.height, camera.width, 3):
        raise RenderError(
            f"the albedo is {' x '.join(map(str, albedo.shape))}, the camera {camera.height} x {camera.width} x 3. "
            "Solve again with this camera's frames."
        )
    for told in unsound_lights(lights):
        raise RenderError(f"light {told} Calibrate again, or leave the frame out with frames.skip.")


def _check_lights_are_outside(mesh: Mesh, lights: Lights) -> None:
    if lights.positions_mm is None:
        return
    within = RayCaster(mesh).inside(lights.positions_mm)
    for name, position, is_inside in zip(lights.names, lights.positions_mm, within, strict=True):
        if is_inside:
            raise RenderError(
                f"light {name} at {np.round(position, 1)} mm lies inside the object ({mesh.radius_mm:.0f} mm about "
                f"{np.round(mesh.center_mm, 1)}), and lights nothing. Check the balls' diameter_mm and scan_unit."
            )
