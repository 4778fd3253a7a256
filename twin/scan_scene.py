"""A registered scan with its measured albedo under the session's lights, as a scene description."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import RenderError
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from twin.depth import albedo_at_the_surface
from twin.description import WHITE_BALL_ALBEDO, Sampling, TwinObject, TwinScene
from twin.film import film_for
from twin.materials import Diffuse, Texture
from twin.object_mesh import ObjectMesh
from twin.surface import textured_surface
from twin.visibility import inside


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
    mesh, pose, camera, lights, albedo, albedo_depth_mm, white_value
        See `twin.render.render`.
    sampling : Sampling

    Raises
    ------
    RenderError
        As `twin.render.render`.
    """
    _check(mesh, camera, lights, albedo)
    placed = Mesh(pose.apply(mesh.vertices), mesh.faces)
    film = film_for(camera, placed.vertices)
    _check_lights_are_outside(placed, lights)
    white = lights.white_value if white_value is None else white_value
    if albedo_depth_mm is not None and lights.positions_mm is not None:
        albedo = albedo_at_the_surface(albedo, albedo_depth_mm, placed, camera, lights, film.rows, film.columns)
    surface = textured_surface(placed, camera, albedo, white, film.rows, film.columns)
    textured = ObjectMesh(surface.vertices, surface.faces, surface.normals, surface.texcoords)
    scene = TwinScene(
        camera,
        (TwinObject("object", textured, "measured_albedo"),),
        {"measured_albedo": Diffuse(Texture(surface.texture, "clamp"))},
        replace(lights, white_value=WHITE_BALL_ALBEDO / surface.scale),
        sampling=sampling,
    )
    return scene, surface.warnings


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
    arrays = [lights.directions, lights.intensities, *([] if lights.positions_mm is None else [lights.positions_mm])]
    for name, row in zip(lights.names, np.concatenate(arrays, 1), strict=True):
        if not np.isfinite(row).all() or (row[3:6] < 0).any():
            raise RenderError(
                f"light {name}: direction {row[:3]}, intensity {row[3:6]}, position {row[6:]}; expected finite numbers "
                "and no negative intensity. Calibrate again, or leave the frame out with frames.skip."
            )


def _check_lights_are_outside(mesh: Mesh, lights: Lights) -> None:
    if lights.positions_mm is None:
        return
    for name, position in zip(lights.names, lights.positions_mm, strict=True):
        if inside(mesh, position[None])[0]:
            raise RenderError(
                f"light {name} at {np.round(position, 1)} mm lies inside the object ({mesh.radius_mm:.0f} mm about "
                f"{np.round(mesh.center_mm, 1)}), and lights nothing. Check the balls' diameter_mm and scan_unit."
            )
