"""A scene's document: the keys of its file, each declared once, and the scene that they say.

`description_file` reads and writes it, the studio edits it, docs/reference/scene-toml.md is written from it.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Union

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationInfo,
    WrapValidator,
    model_validator,
)
from scipy.spatial.transform import Rotation

from formats.toml_documents import TomlTable
from scene.camera import Camera
from scene.errors import RenderError
from scene.mesh import Mesh
from scene.reading import json_of, numbers, reading
from twin.camera.virtual_camera import Sensor
from twin.camera.virtual_photograph import Files
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.light_groups import LightGroup, expand
from twin.description.materials import KINDS
from twin.description.object_mesh import built_in, facets, read_mesh
from twin.description.value_kinds import (
    LEAST,
    Count,
    Factors,
    Number,
    Positive,
    Three,
    as_fault,
    file_of,
    key,
)

Array = NDArray[np.float64]
Size = Annotated[Count, Field(le=65535)]
"""No picture has more pixels in a row."""
MOST_PIXELS = 100_000_000
MOST_TABLES = 10_000
"""Objects, and groups of lights."""
MOST_TRIANGLES = 10_000_000
"""Of all objects: some 100 bytes each, in several copies. A built-in sphere has 65,000."""
Row = tuple[Number, Number, Number, Number]
Matrix = tuple[Row, Row, Row, Row]


class CameraTable(TomlTable):
    """The camera, as in session.toml."""

    width: Annotated[Size, key("Width of the picture.", "px")]
    height: Annotated[Size, key("Height of the picture.", "px")]
    fx: Annotated[Positive, key("Focal length. Of an orthographic camera: pixels per mm.", "px")]
    fy: Annotated[Positive | None, key("Focal length along columns. Absent: fx.", "px")] = None
    cx: Annotated[Number | None, key("Column of the principal point. Absent: the middle.", "px")] = None
    cy: Annotated[Number | None, key("Row of the principal point. Absent: the middle.", "px")] = None
    distortion: Annotated[
        tuple[Number, Number, Number, Number, Number], key("OpenCV's k1, k2, p1, p2, k3.")
    ] = (0.0, 0.0, 0.0, 0.0, 0.0)  # fmt: skip
    projection: Annotated[Literal["perspective", "orthographic"], key("Kind of projection.")] = "perspective"
    sensor: Annotated[
        Annotated[Sensor, WrapValidator(as_fault)] | None,
        key("Sensor that photographs the frames, with noise. Absent: frames without noise.", start={}),
    ] = None
    files: Annotated[
        Files | None,
        key("Format of the frames. PNG and EXR hold linear, white-balanced, interpolated colours; PNG cuts off noise "
            "below black. Absent: dng with a Bayer sensor, else png."),
    ] = None  # fmt: skip

    @model_validator(mode="after")
    def _a_picture_that_can_be_written(self) -> "CameraTable":
        if self.width * self.height > MOST_PIXELS:
            raise ValueError(f"expected {MOST_PIXELS} pixels at most, width times height")
        bayer = self.sensor is not None and self.sensor.cfa != "none"
        if self.files == "dng" and not bayer:
            raise ValueError('files = "dng" wants [camera.sensor] with a Bayer pattern for its cfa')
        if bayer and self.files in (None, "dng") and (self.width % 2 or self.height % 2):
            raise ValueError("a Bayer sensor's DNG has an even width and height")
        return self

    def camera(self) -> Camera:
        """Return it with what is absent filled in."""
        middle = (self.width - 1) / 2, (self.height - 1) / 2
        cx, cy = (given if given is not None else half for given, half in zip((self.cx, self.cy), middle, strict=True))
        size, focal = (self.width, self.height), (self.fx, self.fy or self.fx)
        return Camera(*size, *focal, cx, cy, self.distortion, self.projection, "scene description")


def _known(material: str, info: ValidationInfo[Any]) -> str:
    known = info.context and info.context.materials
    if known is not None and material not in known:
        raise ValueError(f"the materials here are {', '.join(known) or 'none'}")
    return material


def _affine(rows: Matrix) -> Matrix:
    if rows[3] != (0, 0, 0, 1) or abs(np.linalg.det(np.array(rows)[:3, :3])) < 1e-12:
        raise ValueError("expected rows [r r r t] of an affine map that can be undone, and the last row [0, 0, 0, 1]")
    return rows


def _pose(path: Path) -> Array:
    with reading(path, "not a pose.json that rgbn wrote", RenderError):
        data = json_of(path, error=RenderError)
        scale = float(data.get("mm_per_unit", 1.0))
        return numbers(data["camera_from_scan"], 4, 4) @ np.diag([scale, scale, scale, 1.0])


class ObjectTable(TomlTable):
    """A mesh's file or a built-in shape, its place and its material."""

    name: Annotated[str | None, key("Name of the object. Absent: object_0 and so on.")] = None
    mesh: Annotated[Mesh | None, file_of(Mesh, read_mesh), key("Mesh in mm: .ply, .obj, .stl, .off or .glb.")] = None
    shape: Annotated[
        Literal["sphere", "square", "disc", "cube", "cylinder", "cone"] | None,
        key("Shape instead of `mesh`, of radius or half side 1. `square` and `disc` face z. `cylinder` (z from -1 to "
            "1) and `cone` (base at z = 0, tip at z = 1) are open."),
    ] = None  # fmt: skip
    smooth: Annotated[
        bool, Strict(),
        key("true: normals are interpolated, of the .ply or means of the faces. false: every face is flat."),
    ] = True  # fmt: skip
    material: Annotated[str, AfterValidator(_known), key("A name under `[materials]`.")]
    scale: Annotated[Factors, key("One factor or three, along the object's own axes. It comes first.")] = (
        1.0,
        1.0,
        1.0,
    )
    rotate_deg: Annotated[Three, key("Second: turns about the fixed axes x, y, z.", "deg")] = (
        0.0,
        0.0,
        0.0,
    )
    translate_mm: Annotated[Three, key("Third: a shift.", "mm")] = (0.0, 0.0, 0.0)
    matrix: Annotated[
        Matrix | None, AfterValidator(lambda rows: rows and _affine(rows)), key("Fourth: a 4 x 4 matrix.")
    ] = None
    pose: Annotated[
        NDArray[np.float64] | None, file_of(np.ndarray, _pose), key("Last: the pose of a `pose.json` of rgbn.")
    ] = None

    @model_validator(mode="after")
    def _one_source(self) -> "ObjectTable":
        if (self.mesh is None) == (self.shape is None):
            raise ValueError('expected either mesh = "file" or shape = "sphere"')
        if min(map(abs, self.scale)) < LEAST:
            raise ValueError(f"expected a scale of {LEAST:g} or more, or of its negative")
        return self

    def own_mesh(self) -> Mesh:
        """Return the mesh in its own frame."""
        mesh = self.mesh or built_in(self.shape)  # type: ignore[arg-type]
        return mesh if self.smooth else facets(mesh)

    def rotation(self) -> Array:
        """Return the rotation (3, 3) of `rotate_deg`."""
        return Rotation.from_euler("xyz", self.rotate_deg, degrees=True).as_matrix()

    def camera_from_object(self) -> Array:
        """Return (4, 4), affine: scaled, turned, moved, then `matrix`, then `pose`."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation() * self.scale
        matrix[:3, 3] = self.translate_mm
        for outer in (self.matrix, self.pose):
            matrix = matrix if outer is None else np.array(outer, float) @ matrix
        return matrix


def _kind(value: Any) -> Any:
    if isinstance(value, tuple(KINDS.values())):
        return next(kind for kind, one in KINDS.items() if isinstance(value, one))
    return value.get("kind") if isinstance(value, dict) else None


def _without_kind(value: Any) -> Any:
    return {key: part for key, part in value.items() if key != "kind"} if isinstance(value, dict) else value


MaterialTable: Any = Annotated[
    Union[*(Annotated[one, BeforeValidator(_without_kind), Tag(kind)] for kind, one in KINDS.items())],  # type: ignore[misc]
    Discriminator(_kind),
]
LightsTable = Annotated[LightGroup, Field(discriminator="kind")]


def _some(tables: tuple) -> tuple:
    # Not by the field's length: that is told of too, where a table is at fault.
    if not 1 <= len(tables) <= MOST_TABLES:
        raise ValueError(f"expected 1 to {MOST_TABLES} of them")
    return tables


class SceneDocument(TomlTable):
    """What stands above all tables."""

    version: Annotated[Literal[1], key("Version of this format.")] = 1
    name: Annotated[str | None, key("Name of the scene. Absent: the file's name.")] = None
    reference_point_mm: Annotated[
        Three | None,
        key("Point where intensities hold and rings have their middle. Absent: the objects' middle.", "mm"),
    ] = None
    camera: Annotated[CameraTable, key("The camera.")]
    objects: Annotated[tuple[ObjectTable, ...], AfterValidator(_some), key("The objects.")]
    materials: Annotated[dict[str, MaterialTable], key("Their materials, by name.")]  # type: ignore[valid-type]
    environment: Annotated[Environment, key("The light that all frames share.")] = Environment()
    lights: Annotated[tuple[LightsTable, ...], AfterValidator(_some), key("The lights. Each makes one frame.")]
    sampling: Annotated[Sampling, key("Settings of the rendering.")] = Sampling()

    def scene(self) -> TwinScene:
        """Return the scene that is said here; whether it can be rendered, `description_check.check_scene` tells.

        Raises
        ------
        RenderError
            Too many triangles, or lights that do not go together.
        """
        objects = tuple(
            TwinObject(one.name or f"object_{index}", one.own_mesh(), one.material, one.camera_from_object())
            for index, one in enumerate(self.objects)
        )
        triangles = sum(len(one.mesh.faces) for one in objects)
        if triangles > MOST_TRIANGLES:
            raise RenderError(
                f"objects: {triangles} triangles in all; expected {MOST_TRIANGLES} at most, or coarser meshes."
            )
        lights, radii = expand(self.lights, self.reference(objects))
        return TwinScene(
            self.camera.camera(), objects, self.materials, lights, radii, self.environment, self.sampling,
            self.name or "scene", self.camera.sensor, self.camera.files,
        )  # fmt: skip

    def reference(self, objects: tuple[TwinObject, ...]) -> Array:
        """Return the reference point (3,): the one that is given, or the middle of all objects."""
        if self.reference_point_mm is not None:
            return np.array(self.reference_point_mm, float)
        points = np.concatenate([one.placed.vertices for one in objects])
        return (points.min(0) + points.max(0)) / 2
