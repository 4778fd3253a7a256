"""The keys of `session.toml`: names, kinds, defaults; every fault told with its key path.

The models hold what is written; `capture/session/resolve.py` resolves it against the folder.
"""

import copy
import difflib
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    ValidationError,
)

from scene.reading import shortened


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _between(low: float, high: float, why: str) -> AfterValidator:
    """Return the check of a number's physical range, ends included."""

    def check(value: float) -> float:
        if not low <= value <= high:
            raise ValueError(f"expected {low:g} to {high:g}: {why}")
        return value

    return AfterValidator(check)


Length = Annotated[PositiveFloat, _between(0.1, 10_000, "millimetres, from a bead to a building's dome")]
Pixels = Annotated[PositiveInt, _between(1, 100_000, "no camera has more pixels in a row")]
Place = Annotated[float, _between(-1e6, 1e6, "pixels of the picture")]
Squares = Annotated[PositiveInt, _between(2, 200, "squares that a photograph can tell apart")]
Exponent = Annotated[PositiveFloat, _between(0.1, 10, "encodings have exponents about 2.2")]
Names = Annotated[
    list[Annotated[str, Field(min_length=1, max_length=4096)]], Field(max_length=1000), BeforeValidator(_as_list)
]
Globs = Annotated[Names, Field(min_length=1)]


class Table(BaseModel):
    """A TOML table: unknown keys are faults."""

    # Strict: `fx = "1666"` is a slip of the pen, not a number. TOML knows its kinds.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class FramesTable(Table):
    """[frames]: the photographs, and how their values are coded."""

    flash: Globs
    ambient: Globs | None = None
    dark: Globs | None = None
    flat: Globs | None = None
    linear: bool | None = None
    gamma: Exponent | None = None
    half: bool = False
    skip: Names = []


class BoardTable(Table):
    """camera.board: the ChArUco board."""

    squares: list[Squares] = Field(min_length=2, max_length=2)
    square_mm: Length
    marker_mm: Length
    dictionary: str


class CameraTable(Table):
    """[camera]: numbers, or a board's photographs."""

    width: Pixels | None = None
    height: Pixels | None = None
    fx: PositiveFloat | None = None
    fy: PositiveFloat | None = None
    cx: float | None = None
    cy: float | None = None
    distortion: list[float] | None = Field(default=None, min_length=5, max_length=5)
    charuco: Globs | None = None
    board: BoardTable | None = None


class SphereTable(Table):
    """[[spheres]]: one calibration ball."""

    kind: Literal["chrome", "white"]
    diameter_mm: Length | None = None
    center_px: list[Place] | None = Field(default=None, min_length=2, max_length=2)
    radius_px: Annotated[PositiveFloat, _between(0.5, 1e5, "pixels of the picture")] | None = None
    mask: str | None = None
    frames: Globs | None = None


class LightsTable(Table):
    """[lights]: known lights instead of balls."""

    file: str


class ObjectTable(Table):
    """[object]: what is known of the thing itself."""

    mask: str | None = None
    scan: str | None = None
    scan_unit: Literal["m", "cm", "mm", "inch", "unknown"] = "mm"
    scan_ball_diameter_mm: Length | None = None
    normals: str | None = None
    picks: str | None = None


class Manifest(Table):
    """The whole `session.toml`."""

    version: Literal[1] = 1
    name: str | None = None
    frames: FramesTable
    camera: CameraTable | None = None
    spheres: list[SphereTable] = Field(default=[], max_length=50)
    lights: LightsTable | None = None
    object: ObjectTable = ObjectTable()


TABLES: dict[str, type[Table]] = {
    "": Manifest,
    "frames": FramesTable,
    "camera": CameraTable,
    "camera.board": BoardTable,
    "spheres": SphereTable,
    "lights": LightsTable,
    "object": ObjectTable,
}


def parse(data: dict[str, Any]) -> tuple[Manifest | None, list[str]]:
    """Return what can be understood of a manifest, and a line of "key.path: what was found, what to do" a fault.

    The manifest is without the tables at fault, so that the files that the others name can be checked in the same run.
    """
    try:
        return Manifest.model_validate(data), []
    except ValidationError as error:
        faults = error.errors(include_url=False)
    try:
        manifest = Manifest.model_validate(_without(data, faults))
    except ValidationError:
        manifest = None
    return manifest, [_line(fault) for fault in faults]


def _without(data: dict[str, Any], faults: list) -> dict[str, Any]:
    """Drop unknown keys, keys of [frames] at fault, and whole other tables at fault: half a camera would mislead."""
    data = copy.deepcopy(data)
    for fault in faults:
        location = list(fault["loc"])
        holder: Any = data
        if fault["type"] == "extra_forbidden":
            for part in location[:-1]:
                holder = holder[part]
            holder.pop(location[-1], None)
        elif location[0] == "frames" and len(location) > 1 and isinstance(data.get("frames"), dict):
            data["frames"].pop(location[1], None)
    for fault in faults:
        if fault["type"] != "extra_forbidden" and fault["loc"][0] != "frames":
            data.pop(fault["loc"][0], None)
    return data


def _line(fault: Any) -> str:
    # pydantic's own wrappers (validators, unions) appear in the path as names that no file holds.
    location = [part for part in fault["loc"] if isinstance(part, int) or not part.startswith("function-")]
    path = _path(location)
    if fault["type"] == "extra_forbidden":
        return f"{path}: unknown key. {_suggestion(location)}"
    if fault["type"] == "missing":
        return f"{path}: missing. {_PURPOSE.get(path.split('[')[0], 'Add it.')}"
    found = fault["input"]
    shown = f"a table with {', '.join(found) or 'nothing'}" if isinstance(found, dict) else repr(found)
    shown = shortened(shown, 80)
    message = fault["msg"].removeprefix("Value error, ").replace("Input should be ", "expected ")
    return f"{path}: found {shown}; {message[0].lower()}{message[1:]}."


_PURPOSE = {
    "frames": 'Add a table [frames] with flash = "raw/flash_*.dng".',
    "frames.flash": 'Add flash = "raw/flash_*.dng" under [frames]: one light per frame.',
    "lights.file": 'Add file = "lights.lp", or drop [lights].',
    "spheres": 'Add kind = "chrome" or "white".',
}


def _path(location: list) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def _suggestion(location: list) -> str:
    """Say which key may have been meant: a like one in the same table, else the same one elsewhere."""
    own = ".".join(part for part in location[:-1] if isinstance(part, str))
    key = str(location[-1])
    known = list(TABLES[own].model_fields) if own in TABLES else []
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
    if close:
        return f"Did you mean {close[0]}?"
    for name, table in TABLES.items():
        if name not in ("", own, "camera.board") and key in table.model_fields:
            return f"It belongs under {'[[spheres]]' if name == 'spheres' else f'[{name}]'}."
    return f"Known here: {', '.join(known)}."
