"""The one scene description that feeds every engine: what stands where, of what, in which light, before which camera.

Everything is in the camera frame and in millimetres. `twin.description.scene_toml` makes one of a scene's document.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict

from scene.camera import Camera
from scene.lights import Lights
from scene.mesh import Mesh
from scene.spheres import WHITE_BALL_ALBEDO
from twin.camera.virtual_camera import Sensor
from twin.camera.virtual_photograph import Files
from twin.description.materials import Material, Texture, read_texture
from twin.description.value_kinds import Count, NotNegative, Number, Rgb, checked, file_of, key
from twin.engines.film import Film, film_for

Array = NDArray[np.float64]


def white_of(lights: Lights) -> Array:
    """Return (3,) the pixel value of a matte surface of reflectance 1 that faces a light of intensity 1."""
    return np.ones(3) if lights.white_value is None else lights.white_value / WHITE_BALL_ALBEDO


@dataclass(frozen=True, eq=False)
class TwinObject:
    """A mesh, where it stands, and of what it is.

    Parameters
    ----------
    mesh : Mesh
        In its own frame.
    material : str
        A key of the scene's materials.
    matrix : (4, 4) float64
        camera_from_object, affine.
    """

    name: str
    mesh: Mesh
    material: str
    matrix: Array = field(default_factory=lambda: np.eye(4))

    @cached_property
    def placed(self) -> Mesh:
        """The mesh in the camera frame."""
        return self.mesh.moved(self.matrix)


@checked
@dataclass(frozen=True)
class Environment:
    """Light that is the same in every frame."""

    map: Annotated[
        Texture | None,
        file_of(Texture, read_texture),
        key("Radiance all round, by latitude and longitude: EXR, HDR or .npy. The first row is up (y). The middle "
            "column lies toward the viewer (z), the quarter to its left toward x.", input="picture"),
    ] = None  # fmt: skip
    scale: Annotated[NotNegative, key("Factor on the map.")] = 1.0
    rotate_deg: Annotated[Number, key("Turn of the map about y, from z toward x.", "deg")] = 0.0
    ambient: Annotated[Rgb, key("Radiance from everywhere, added to the map's.")] = (0.0, 0.0, 0.0)

    @property
    def is_dark(self) -> bool:
        return self.map is None and not any(self.ambient)


Engine = Literal["auto", "many", "mitsuba"]


@checked
@dataclass(frozen=True)
class Sampling:
    """How the scene is rendered."""

    engine: Annotated[Engine, key("Engine. auto: the fastest that can render the scene.")] = "auto"
    samples: Annotated[Count | None, key("Paths per pixel. Absent: as many as `error` needs.", start=64)] = None
    max_depth: Annotated[
        int,
        Strict(),
        Field(ge=2, le=100),
        key("Greatest number of a path's segments. 2: direct light; 3: one interreflection."),
    ] = 3
    error: Annotated[
        float, Strict(), Field(ge=1e-4, lt=1),
        key("Relative root-mean-square error to aim at where `samples` is absent."),
    ] = 0.01  # fmt: skip


@dataclass(frozen=True, eq=False)
class TwinScene:
    """What is to be rendered, one frame for each light.

    Parameters
    ----------
    lights : Lights
        N, all distant or all near. Not necessarily of mean intensity 1: the intensities are what they are.
    radii_mm : (N,) float64
        Of near lights that are discs toward the reference point; 0 for points.
    sensor : Sensor or None
        Of the virtual camera that photographs the rendered frames. None: they are kept as they are.
    files : {"png", "dng", "exr"} or None
        What photographs are written as; None: DNG of a Bayer sensor, else PNG.

    Notes
    -----
    A pixel's value is the radiance that it sees. A light of intensity 1 gives the irradiance pi at the reference point,
    so a matte surface of reflectance r that faces it has the pixel value r, exactly:
    radiance = r / pi * pi * intensity * cos. Where `lights.white_value` is given, the value of the white ball (0.8)
    under intensity 1, irradiance = pi * intensity * white_value / 0.8, and pixel values are those of the session.
    A constant environment of radiance L gives a convex matte surface the pixel value r L, and shows itself in mirrors;
    behind the objects the picture is black.
    """

    camera: Camera
    objects: tuple[TwinObject, ...]
    materials: Mapping[str, Material]
    lights: Lights
    radii_mm: Array = field(default_factory=lambda: np.zeros(0))
    environment: Environment = Environment()
    sampling: Sampling = Sampling()
    name: str = "scene"
    sensor: Sensor | None = None
    files: Files | None = None

    def __post_init__(self) -> None:
        if not len(self.radii_mm):
            object.__setattr__(self, "radii_mm", np.zeros(len(self.lights)))

    @property
    def irradiance(self) -> Array:
        """(N, 3) of each light on a surface that faces it at the reference point."""
        return np.pi * self.lights.intensities * white_of(self.lights)

    @cached_property
    def points(self) -> Array:
        """(P, 3) every vertex, camera frame."""
        return np.concatenate([one.placed.vertices for one in self.objects])

    def film(self) -> Film:
        """Return the film that holds every object; the whole picture where one reaches behind the camera.

        Raises
        ------
        RenderError
            The camera sees nothing.
        """
        return film_for(self.camera, self.points)
