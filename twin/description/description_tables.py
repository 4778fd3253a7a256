"""The keys of a scene description's file: names, kinds, defaults. docs/reference/scene-toml.md is its manual."""

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

from twin.camera.virtual_camera import Sensor
from twin.description.checked_values import LEAST, Count, Factors, Number, Positive, Rgb, Table, Three, as_fault, named
from twin.description.description import Environment, Sampling
from twin.description.materials import KINDS
from twin.description.object_mesh import ObjectMesh

# No picture has more pixels in a row, no capture as many lights.
Size = Annotated[Count, Field(le=65535)]
Many = Annotated[Count, Field(le=10_000)]
Few = Annotated[Count, Field(le=100)]
MOST_PIXELS = 100_000_000
Row = tuple[Number, Number, Number, Number]
Matrix = tuple[Row, Row, Row, Row]


class TextureTable(Table):
    """A picture: a file, and how its values are coded."""

    file: str
    encoding: Literal["linear", "srgb"] | None = None
    wrap: Literal["repeat", "clamp"] = "repeat"


class CameraTable(Table):
    """[camera]: as in session.toml, the projection, and what is written."""

    width: Size
    height: Size
    fx: Positive
    fy: Positive | None = None
    cx: Number | None = None
    cy: Number | None = None
    distortion: tuple[Number, Number, Number, Number, Number] = (0.0, 0.0, 0.0, 0.0, 0.0)
    projection: Literal["perspective", "orthographic"] = "perspective"
    sensor: Annotated[Sensor, WrapValidator(as_fault)] | None = None
    files: Literal["png", "dng", "exr"] | None = None

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


def _known(material: str, info: ValidationInfo[Any]) -> str:
    if material not in info.context.materials:
        raise ValueError(f"the materials here are {', '.join(info.context.materials) or 'none'}")
    return material


def _affine(rows: Matrix) -> Matrix:
    if rows[3] != (0, 0, 0, 1) or abs(np.linalg.det(np.array(rows)[:3, :3])) < 1e-12:
        raise ValueError("expected rows [r r r t] of an affine map that can be undone, and the last row [0, 0, 0, 1]")
    return rows


class ObjectTable(Table):
    """[[objects]]: a mesh's file or a built-in shape, its place and its material."""

    name: str | None = None
    mesh: Annotated[ObjectMesh | None, named("mesh")] = None
    shape: Literal["sphere", "square", "disc", "cube", "cylinder", "cone"] | None = None
    smooth: Annotated[bool, Strict()] = True
    material: Annotated[str, AfterValidator(_known)]
    scale: Factors = (1.0, 1.0, 1.0)
    rotate_deg: Three = (0.0, 0.0, 0.0)
    translate_mm: Three = (0.0, 0.0, 0.0)
    matrix: Annotated[Matrix, AfterValidator(_affine)] | None = None
    pose: Annotated[NDArray[np.float64] | None, named("pose")] = None

    @model_validator(mode="after")
    def _one_source(self) -> "ObjectTable":
        if (self.mesh is None) == (self.shape is None):
            raise ValueError('expected either mesh = "file" or shape = "sphere"')
        if min(map(abs, self.scale)) < LEAST:
            raise ValueError(f"expected a scale of {LEAST:g} or more, or of its negative")
        return self


class LightTable(Table):
    """[[lights]]: one light."""

    kind: Literal["distant", "point", "area"]
    name: str | None = None
    intensity: Rgb = (1.0, 1.0, 1.0)
    direction: Three | None = None
    azimuth_deg: Number | None = None
    elevation_deg: Number | None = None
    position_mm: Three | None = None
    radius_mm: Positive | None = None

    @model_validator(mode="after")
    def _what_its_kind_needs(self) -> "LightTable":
        given = {key for key in _LIGHT_KEYS if getattr(self, key) is not None}
        allowed: dict[str, tuple[set[str], ...]] = {
            "distant": ({"direction"}, {"azimuth_deg", "elevation_deg"}),
            "point": ({"position_mm"},),
            "area": ({"position_mm", "radius_mm"},),
        }
        if given not in allowed[self.kind]:
            wanted = ", or ".join(" and ".join(sorted(keys)) for keys in allowed[self.kind])
            found = ", ".join(sorted(given)) or "nothing"
            raise ValueError(f'kind = "{self.kind}" wants {wanted}, and nothing else of where it is; found {found}')
        if self.direction is not None and not any(self.direction):
            raise ValueError("expected a direction that is not 0, 0, 0")
        return self


_LIGHT_KEYS = ("direction", "azimuth_deg", "elevation_deg", "position_mm", "radius_mm")


class GroupTable(Table):
    """What rings and grids share: without a distance they are distant, with a radius areas."""

    name: str | None = None
    intensity: Rgb = (1.0, 1.0, 1.0)
    distance_mm: Positive | None = None
    radius_mm: Positive | None = None

    @model_validator(mode="after")
    def _an_area_is_near(self) -> "GroupTable":
        if self.radius_mm is not None and self.distance_mm is None:
            raise ValueError("radius_mm wants distance_mm: a distant light has no size")
        return self


class RingTable(GroupTable):
    """Lights in a ring about the camera's axis."""

    kind: Literal["ring"]
    count: Many
    polar_deg: Annotated[Number, Field(gt=0, lt=180)]
    start_deg: Number = 0.0


class GridTable(GroupTable):
    """Rings of lights over the hemisphere of the camera's side."""

    kind: Literal["hemisphere"]
    rings: Few
    around: Few
    max_polar_deg: Annotated[Number, Field(gt=0, le=90)] = 70.0


class SessionLightsTable(Table):
    """The lights that a session was calibrated to."""

    kind: Literal["session"]
    file: str


def _kind(value: Any) -> Any:
    return value.get("kind") if isinstance(value, dict) else None


def _without_kind(value: Any) -> Any:
    return {key: part for key, part in value.items() if key != "kind"}


MaterialTable: Any = Annotated[
    Union[*(Annotated[one, BeforeValidator(_without_kind), Tag(kind)] for kind, one in KINDS.items())],  # type: ignore[misc]
    Discriminator(_kind),
]
LightsTable = Annotated[LightTable | RingTable | GridTable | SessionLightsTable, Field(discriminator="kind")]


class DescriptionTable(Table):
    """The whole file."""

    version: Literal[1] = 1
    name: str | None = None
    camera: CameraTable
    objects: list[ObjectTable] = Field(min_length=1, max_length=10_000)
    materials: dict[str, MaterialTable]  # type: ignore[valid-type]
    environment: Environment = Environment()
    lights: list[LightsTable] = Field(min_length=1, max_length=10_000)
    reference_point_mm: Three | None = None
    sampling: Sampling = Sampling()
