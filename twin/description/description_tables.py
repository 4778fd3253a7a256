"""The keys of a scene description's file: names, kinds, defaults. docs/scenes.md says the same for users."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, PositiveInt, model_validator

Three = Annotated[list[float], Field(min_length=3, max_length=3)]
Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]
# No picture has more pixels in a row, no capture as many lights.
Size = Annotated[PositiveInt, Field(le=65535)]
Many = Annotated[PositiveInt, Field(le=10_000)]
Few = Annotated[PositiveInt, Field(le=100)]


def _three(value: Any) -> Any:
    """Take one number for all three channels, or axes."""
    return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


Rgb = Annotated[list[NotNegative], Field(min_length=3, max_length=3), BeforeValidator(_three)]
Factors = Annotated[list[float], Field(min_length=3, max_length=3), BeforeValidator(_three)]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]


class Table(BaseModel):
    """A TOML table: unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class TextureTable(Table):
    """A picture: a file, and how its values are coded."""

    file: str
    encoding: Literal["linear", "srgb"] | None = None
    wrap: Literal["repeat", "clamp"] = "repeat"


def _reflectance(value: Any) -> Any:
    """Sort the four forms before pydantic sees them, or it tells a fault for each form that it is not."""
    if isinstance(value, dict):
        return TextureTable.model_validate(value)
    value = _three(value)
    is_rgb = isinstance(value, list) and len(value) == 3 and all(type(part) in (int, float) for part in value)
    if value == "vertex" or is_rgb:
        return value
    raise ValueError('expected a number, [r, g, b], "vertex" or { file = "...", encoding = "srgb" }')


def _specularity(value: Any) -> Any:
    if isinstance(value, dict):
        return TextureTable.model_validate(value)
    if type(value) in (int, float):
        return value
    raise ValueError('expected a number or { file = "...", encoding = "linear" }')


Reflectance = Annotated[Any, BeforeValidator(_reflectance)]
Specularity = Annotated[Any, BeforeValidator(_specularity)]
Roughness = Annotated[float, Field(gt=0, le=1)]


class SensorTable(Table):
    """[camera.sensor]: how the frames are photographed; see `twin.camera.virtual_camera.Sensor`."""

    full_well_e: PositiveFloat = 40000.0
    read_noise_e: NotNegative = 4.0
    adc_noise_dn: NotNegative = 0.0
    iso: PositiveFloat = 100.0
    black_level: Annotated[int, Field(ge=0)] = 512
    white_level: Annotated[int, Field(le=65535)] = 16383
    blur_px: NotNegative = 0.5
    vignetting: Three = [0.0, 0.0, 0.0]
    cfa: Literal["RGGB", "BGGR", "GRBG", "GBRG", "none"] = "RGGB"
    neutral: Three = [0.58, 1.0, 0.69]
    pixel_um: PositiveFloat = 5.0


class CameraTable(Table):
    """[camera]: as in session.toml, the projection, and what is written."""

    width: Size
    height: Size
    fx: PositiveFloat
    fy: PositiveFloat | None = None
    cx: float | None = None
    cy: float | None = None
    distortion: list[float] = Field(default=[0.0] * 5, min_length=5, max_length=5)
    projection: Literal["perspective", "orthographic"] = "perspective"
    sensor: SensorTable | None = None
    files: Literal["png", "dng", "exr"] | None = None

    @model_validator(mode="after")
    def _a_mosaic_for_a_dng(self) -> "CameraTable":
        bayer = self.sensor is not None and self.sensor.cfa != "none"
        if self.files == "dng" and not bayer:
            raise ValueError('files = "dng" wants [camera.sensor] with a Bayer pattern for its cfa')
        if bayer and self.files in (None, "dng") and (self.width % 2 or self.height % 2):
            raise ValueError("a Bayer sensor's DNG has an even width and height")
        return self


class ObjectTable(Table):
    """[[objects]]: a mesh's file or a built-in shape, its place and its material."""

    name: str | None = None
    mesh: str | None = None
    shape: Literal["sphere", "square", "disc", "cube", "cylinder", "cone"] | None = None
    smooth: bool = True
    material: str
    scale: Factors = [1.0, 1.0, 1.0]
    rotate_deg: Three = [0.0, 0.0, 0.0]
    translate_mm: Three = [0.0, 0.0, 0.0]
    matrix: Annotated[list[Row], Field(min_length=4, max_length=4)] | None = None
    pose: str | None = None

    @model_validator(mode="after")
    def _one_source(self) -> "ObjectTable":
        if (self.mesh is None) == (self.shape is None):
            raise ValueError('expected either mesh = "file" or shape = "sphere"')
        if 0 in self.scale:
            raise ValueError("expected a scale that is not 0")
        return self


class SubsurfaceTable(Table):
    """materials.NAME.subsurface: the medium below the surface."""

    mean_free_path_mm: PositiveFloat
    albedo: Annotated[list[Share], Field(min_length=3, max_length=3), BeforeValidator(_three)] = [0.9, 0.9, 0.9]
    share: Share = 0.5


class DiffuseTable(Table):
    """A matte material."""

    kind: Literal["diffuse"]
    reflectance: Reflectance
    subsurface: SubsurfaceTable | None = None


class RoughPlasticTable(Table):
    """A matte body under a clear rough coat."""

    kind: Literal["rough_plastic"]
    reflectance: Reflectance
    roughness: Roughness = 0.1
    specularity: Specularity = 1.0
    index: Annotated[float, Field(gt=1)] = 1.49
    subsurface: SubsurfaceTable | None = None
    covered: Share = 1.0


class ConductorTable(Table):
    """A metal."""

    kind: Literal["conductor"]
    metal: str
    roughness: Share = 0.1


class PrincipledTable(Table):
    """Disney's material."""

    kind: Literal["principled"]
    reflectance: Reflectance
    roughness: Roughness = 0.25
    metallic: Share = 0.0
    specularity: Share = 0.5


class MeasuredTable(Table):
    """A measured reflectance."""

    kind: Literal["measured"]
    file: str


class EnvironmentTable(Table):
    """[environment]: light that is the same in every frame."""

    map: str | None = None
    scale: NotNegative = 1.0
    rotate_deg: float = 0.0
    ambient: Rgb = [0.0, 0.0, 0.0]


class LightTable(Table):
    """[[lights]]: one light."""

    kind: Literal["distant", "point", "area"]
    name: str | None = None
    intensity: Rgb = [1.0, 1.0, 1.0]
    direction: Three | None = None
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    position_mm: Three | None = None
    radius_mm: PositiveFloat | None = None

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
    intensity: Rgb = [1.0, 1.0, 1.0]
    distance_mm: PositiveFloat | None = None
    radius_mm: PositiveFloat | None = None

    @model_validator(mode="after")
    def _an_area_is_near(self) -> "GroupTable":
        if self.radius_mm is not None and self.distance_mm is None:
            raise ValueError("radius_mm wants distance_mm: a distant light has no size")
        return self


class RingTable(GroupTable):
    """Lights in a ring about the camera's axis."""

    kind: Literal["ring"]
    count: Many
    polar_deg: Annotated[float, Field(gt=0, lt=180)]
    start_deg: float = 0.0


class GridTable(GroupTable):
    """Rings of lights over the hemisphere of the camera's side."""

    kind: Literal["hemisphere"]
    rings: Few
    around: Few
    max_polar_deg: Annotated[float, Field(gt=0, le=90)] = 70.0


class SessionLightsTable(Table):
    """The lights that a session was calibrated to."""

    kind: Literal["session"]
    file: str


class SamplingTable(Table):
    """[sampling]: how to render."""

    engine: Literal["auto", "direct", "many", "mitsuba"] = "auto"
    samples: PositiveInt | None = None
    max_depth: Annotated[int, Field(ge=2)] = 3
    error: Annotated[float, Field(gt=0, lt=1)] = 0.01


MaterialTable = Annotated[
    DiffuseTable | RoughPlasticTable | ConductorTable | PrincipledTable | MeasuredTable, Field(discriminator="kind")
]
LightsTable = Annotated[LightTable | RingTable | GridTable | SessionLightsTable, Field(discriminator="kind")]


class DescriptionTable(Table):
    """The whole file."""

    version: Literal[1] = 1
    name: str | None = None
    camera: CameraTable
    objects: list[ObjectTable] = Field(min_length=1)
    materials: dict[str, MaterialTable]
    environment: EnvironmentTable = EnvironmentTable()
    lights: list[LightsTable] = Field(min_length=1)
    reference_point_mm: Three | None = None
    sampling: SamplingTable = SamplingTable()
