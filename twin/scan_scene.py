"""A registered scan with its measured albedo under the session's lights, as a scene description.

What is physical of it: the shape with its cast shadows, near or distant lights, the measured albedo, light that goes
from one part of the object to another, the gloss of a material that was fitted, the room's light where the white ball
shows it. What is not: the table and whatever else stands around.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.lights import Lights
from scene.spheres import WHITE_BALL_ALBEDO
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.description_check import check_scene
from twin.description.materials import Diffuse, Material, Principled, RoughPlastic
from twin.material.fit_material import MaterialFit
from twin.material.measured_albedo import textured_surface
from twin.visibility import Sight

NAME = "measured_albedo"


def scan_scene(
    sight: Sight, albedo: NDArray[np.float32], sampling: Sampling, *, fit: MaterialFit | None = None
) -> tuple[TwinScene, tuple[str, ...]]:
    """Return the scene of a session's object alone, and what is suspicious about it.

    The albedo's white value becomes the lights', so that pixel values are those that the albedo was measured in. The
    white ball is taken to reflect 80 %: that alone decides how strong the interreflections are, never the direct light.

    Parameters
    ----------
    sight : Sight
        Near lights are rendered as points.
    albedo : (H, W, 3) float32
        Of the body: pixel value under a light of intensity 1 along the normal, NaN where unknown.
    fit : MaterialFit or None
        The material; None: matte.

    Raises
    ------
    RenderError
        The mesh is empty or not finite, the camera does not see it, a light lies inside it, the albedo has another
        size than the camera's, or a light or the albedo holds nothing that can be rendered.

    Notes
    -----
    With reflectance rho = albedo / white * 0.8 and irradiance E = pi * intensity * white / 0.8, a Lambertian surface
    has the radiance rho / pi * E * cos = albedo * intensity * cos: the direct light's pixel values are the session's
    own, whatever the ball's true reflectance. The room's light comes evenly from all sides: the radiance ambient / 0.8
    gives the white ball the pixel value that it shows in every frame.
    """
    camera, lights = sight.camera, sight.lights
    if albedo.shape != (camera.height, camera.width, 3):
        raise RenderError(
            f"the albedo is {' x '.join(map(str, albedo.shape))}, the camera {camera.height} x {camera.width} x 3. "
            "Solve again with this camera's frames."
        )
    one = TwinObject("object", sight.mesh, NAME)
    scene = TwinScene(camera, (one,), {NAME: Diffuse((0.5, 0.5, 0.5))}, lights, sampling=sampling, name="the scan")
    check_scene(scene)
    film = scene.film()
    textured, texture, white, warnings = textured_surface(sight, albedo, film.rows, film.columns)
    material: Material = Diffuse(texture)
    if fit is not None and fit.model == "metal":
        material = Principled(texture, fit.surface.roughness, metallic=1.0)
    elif fit is not None and fit.model != "matte":
        # Where the white value is unknown, the scene has taken one.
        specularity = min(float(np.mean(fit.strength)) / float(np.mean(white / WHITE_BALL_ALBEDO)), 1.0)
        material = RoughPlastic(texture, specularity=specularity, **fit.surface.numbers())
    return replace(
        scene,
        objects=(replace(one, mesh=textured),),
        materials={NAME: material},
        lights=replace(lights, white_value=white),
        environment=_room(lights, sampling.error),
        name="scene",
    ), warnings


def _room(lights: Lights, error: float) -> Environment:
    """Return the light that is left in every frame; darkness where it is less than the rendering's relative error."""
    share = lights.room_share
    if lights.ambient is None or share is None or share.mean() < error:
        return Environment()
    red, green, blue = map(float, lights.ambient / WHITE_BALL_ALBEDO)
    return Environment(ambient=(red, green, blue))
