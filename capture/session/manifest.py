"""The document of a session: the keys of `session.toml`, with kinds, units, ranges, defaults, and what each is for.

`init` and the studio make it, `capture/session/resolve.py` resolves it against the folder, the reference in docs/ is
written from it.
"""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, AliasChoices, BeforeValidator, ConfigDict, Field, PositiveFloat, PositiveInt

from formats.toml_documents import TomlTable
from scene.length_units import Unit


def _between(low: float, high: float, why: str) -> AfterValidator:
    """Return the check of a number's physical range, ends included."""

    def check(value: float) -> float:
        if not low <= value <= high:
            raise ValueError(f"expected {low:g} to {high:g}: {why}")
        return value

    return AfterValidator(check)


def _key(what: str, example: Any, unit: str = "", default: Any = None, **how: Any) -> Any:
    """Return a key for people: what it is, an example as TOML has it, its unit, its default (...: it is required)."""
    return Field(default, description=what, examples=[example], json_schema_extra={"unit": unit}, **how)


Length = Annotated[PositiveFloat, _between(0.1, 10_000, "millimetres, from a bead to a building's dome")]
Pixels = Annotated[PositiveInt, _between(1, 100_000, "no camera has more pixels in a row")]
Scale = Annotated[PositiveFloat, _between(1, 1_000_000, "pixels, the focal length times those a millimetre")]
Term = Annotated[float, _between(-1000, 1000, "a term of OpenCV's distortion")]
Place = Annotated[float, _between(-1e6, 1e6, "pixels of the picture")]
Radius = Annotated[PositiveFloat, _between(0.5, 1e5, "pixels of the picture")]
Squares = Annotated[PositiveInt, _between(2, 200, "squares that a photograph can tell apart")]
Exponent = Annotated[PositiveFloat, _between(0.1, 10, "encodings have exponents about 2.2")]
Focal = Annotated[PositiveFloat, _between(1, 3000, "millimetres, as engraved on the lens")]
Sensor = Annotated[PositiveFloat, _between(1, 250, "millimetres, from a telephone's sensor to a scanning back")]
Pitch = Annotated[PositiveFloat, _between(0.3, 50, "micrometres from pixel to pixel")]
Crop = Annotated[PositiveFloat, _between(0.1, 30, "1 for 36 x 24 mm, 1.5 or 1.6 for APS-C")]
Reflectance = Annotated[PositiveFloat, _between(0.2, 1, "a matte white ball gives back 0.7 to 0.99")]
Angle = Annotated[float, Field(gt=0, lt=90)]
Names = Annotated[
    list[Annotated[str, Field(min_length=1, max_length=4096)]],
    Field(max_length=1000),
    BeforeValidator(lambda value: [value] if isinstance(value, str) else value),
]
Globs = Annotated[Names, Field(min_length=1)]
Two, Four, Five = (Field(min_length=n, max_length=n) for n in (2, 4, 5))


class ManifestTable(TomlTable):
    """A table of session.toml. Strict: `fx = "1666"` is a slip of the pen, not a number. TOML knows its kinds."""

    model_config = ConfigDict(strict=True)


class FramesTable(ManifestTable):
    """[frames]: the photographs, and how their values are coded."""

    flash: Globs = _key(
        "The flash photographs, one light each, in natural order: a glob or a list of globs.",
        "raw/flash_*.dng",
        default=...,
    )
    ambient: Globs | None = _key(
        "Photographs with the flash off, at the same exposure. They are subtracted.", "raw/ambient_*.dng"
    )
    dark: Globs | None = _key(
        "Photographs with the lens covered, at the same exposure, for the sensor's offset.", "raw/dark_*.dng"
    )
    flat: Globs | None = _key(
        "Photographs of an evenly lit white surface. The lens' fall-off is divided out.", "raw/flat_*.dng"
    )
    chart: str | None = _key(
        "Photograph of a ColorChecker of 24 patches under the flash, its own or one of `flash`. It makes colours sRGB.",
        "raw/chart.dng",
    )
    linear: bool | None = _key(
        "Whether values of 8 and 16 bits are proportional to light; false: they are sRGB. RAW and EXR files are "
        "linear. Absent: true, checked by the balls; JPEG files need the key.",
        False,
    )
    gamma: Exponent | None = _key("Instead of linear. Light is the value to the power of gamma.", 2.2)
    half: bool = _key(
        "Average 2 x 2 pixels, for a quarter of the memory and time. Camera and outputs are halved together.",
        True,
        default=False,
    )
    skip: Names = _key("Flash photographs to leave out, by name or stem.", ["flash_007"], default=[])


class BoardTable(ManifestTable):
    """camera.board: the ChArUco board or chessboard of the calibration shots."""

    squares: Annotated[list[Squares], Two] = _key(
        "Number of squares along and across the board, black and white together.", [11, 8], default=...
    )
    square_mm: Length = _key("Side of a square. It does not change the camera.", 15.0, "mm", default=20.0)
    marker_mm: Length | None = _key("Side of a marker; ChArUco only.", 11.0, "mm")
    dictionary: str | None = _key("OpenCV's name of the markers' dictionary; ChArUco only.", "DICT_4X4_100")


class SessionCameraTable(ManifestTable):
    """[camera]: the focal length in pixels or in millimetres, or photographs of a board."""

    width: Pixels | None = _key(
        "Width of the image that fx, fy, cx and cy refer to. Absent: the photographs'.", 6000, "px"
    )
    height: Pixels | None = _key("Height of that image.", 4000, "px")
    fx: Scale | None = _key("Focal length. Alone it counts as good to 2 %; with cx and cy as exact.", 8333.0, "px")
    fy: Scale | None = _key("Focal length along columns. Absent: fx.", 8333.0, "px")
    cx: Place | None = _key(
        "Column of the principal point; the upper left pixel's centre is 0. Absent: the middle, to 1 % of the width.",
        2999.5,
        "px",
    )
    cy: Place | None = _key("Row of the principal point.", 1999.5, "px")
    distortion: Annotated[list[Term], Five] | None = _key(
        "OpenCV's k1, k2, p1, p2, k3. Absent: no distortion.", [-0.1, 0.02, 0.0, 0.0, 0.0]
    )
    focal_mm: Focal | None = _key(
        "Focal length engraved on the lens. It needs sensor_mm, pixel_um, crop_factor or model. Absent: EXIF's.",
        50.0,
        "mm",
    )
    sensor_mm: Sensor | None = _key("Longer side of the sensor; 36 for full frame.", 36.0, "mm")
    pixel_um: Pitch | None = _key("Distance from pixel to pixel on the sensor.", 5.94, "um")
    crop_factor: Crop | None = _key("Diagonal of 36 x 24 mm divided by the sensor's.", 1.5)
    model: Annotated[str, Field(min_length=1, max_length=100)] | None = _key(
        "Maker and model of the camera, for its sensor's size. Absent: EXIF's.", "Nikon D850"
    )
    charuco: Globs | None = _key(
        "Photographs of a ChArUco board at the session's focus. It needs board.", "charuco/*.dng"
    )
    chessboard: Globs | None = _key(
        "Photographs of a plain chessboard at the session's focus. It needs board.", "board/*.dng"
    )
    board: BoardTable | None = _key(
        "The board. A ChArUco board also needs marker_mm and dictionary.",
        {"squares": [11, 8], "square_mm": 15, "marker_mm": 11, "dictionary": "DICT_4X4_100"},
    )


class SphereTable(ManifestTable):
    """[[spheres]]: one calibration ball."""

    kind: Literal["chrome", "white"] = _key(
        "A chrome ball gives directions and positions, a matte white ball intensities.", "chrome", default=...
    )
    diameter_mm: Length | None = _key("Diameter. Without it directions are known, but no positions.", 76.0, "mm")
    center_px: Annotated[list[Place], Two] | None = _key(
        "Rough column and row of the centre, where the ball is not found by itself.", [160, 650], "px"
    )
    radius_px: Radius | None = _key("Rough radius. It goes with center_px.", 67, "px")
    reflectance: Reflectance | None = _key(
        "Share of the light that a white ball reflects. It makes the albedo in results/ absolute.", 0.9
    )
    mask: str | None = _key("Picture of the frames' size, white where the ball is.", "chrome_mask.png")
    frames: Globs | None = _key(
        "The ball's own photographs, where it was shot apart, under the same lights in the same order.", "chrome/*.png"
    )


class LightsTable(ManifestTable):
    """[lights]: known lights instead of balls."""

    file: str = _key(
        "File of the lights: .lp, light_directions.txt, lights.json, .dome, .mat, .json of AliceVision, or rig.json of "
        "`rgbn rig` (also as key `rig`).",
        "lights.lp",
        default=...,
        validation_alias=AliasChoices("file", "rig"),
    )


class SessionObjectTable(ManifestTable):
    """[object]: what is known of the thing itself."""

    mask: str | None = _key("Picture of the frames' size, white where the object is. Absent: found.", "mask.png")
    box: Annotated[list[Place], Four] | None = _key(
        "Left, top, right and bottom of a box about the whole object, in which its outline is sought.",
        [2100, 900, 3900, 3200],
        "px",
    )
    scan: str | None = _key("The laser scan, a mesh as PLY, OBJ, STL, OFF or GLB.", "scan/object.ply")
    scan_unit: Unit = _key(
        "Unit of the scan. unknown: registering finds it. Absent: m for GLB, else mm.", "mm", default="mm"
    )
    scan_ball_diameter_mm: Length | None = _key(
        "Diameter of a ball that was scanned beside the object. It tells the unit.", 50.0, "mm"
    )
    normals: str | None = _key(
        "Ground-truth normals that are already registered: .mat, .txt, .npy or .png.", "Normal_gt.mat"
    )
    picks: str | None = _key(
        "File of points of the scan with their pixels, as a start for the registration.", "picks.csv"
    )
    tolerance_deg: Angle | None = _key(
        "Error of the normals that your purpose allows. The verdict is then pass or fail. The option --tolerance goes "
        "before it.",
        3.0,
        "deg",
    )


class SeriesTable(ManifestTable):
    """[series]: the place of this session in a series, in which one factor changes; see `rgbn series`."""

    factor: str = _key("Name of the factor that changes, the same in each session.", "iso", default=...)
    value: float | str = _key("Value of the factor in this session.", 400.0, default=...)


class Manifest(ManifestTable):
    """The whole `session.toml`."""

    version: Literal[1] = _key("Version of this format.", 1, default=1)
    name: str | None = _key("Name of the session. Absent: the folder's name.", "penguin")
    frames: FramesTable = _key(
        "The photographs, and how their values are coded.", {"flash": "raw/flash_*.dng"}, default=...
    )
    camera: SessionCameraTable | None = _key(
        "The camera. Absent: EXIF, or the balls.", {"focal_mm": 50.0, "sensor_mm": 36.0}
    )
    spheres: Annotated[list[SphereTable], Field(max_length=50)] = _key(
        "The calibration balls, in any order. Absent: balls are looked for. []: none is looked for.",
        [{"kind": "chrome", "diameter_mm": 76.0}],
        default=[],
    )
    lights: LightsTable | None = _key("Known lights instead of balls.", {"file": "lights.lp"})
    object: SessionObjectTable = _key(
        "What is known of the object.", {"scan": "scan/object.ply"}, default=SessionObjectTable()
    )
    series: SeriesTable | None = _key(
        "This session's place in a series: see `rgbn series`.", {"factor": "iso", "value": 400.0}
    )


TABLES: dict[str, type[ManifestTable]] = {
    "": Manifest,
    "frames": FramesTable,
    "camera": SessionCameraTable,
    "camera.board": BoardTable,
    "spheres": SphereTable,
    "lights": LightsTable,
    "object": SessionObjectTable,
    "series": SeriesTable,
}
