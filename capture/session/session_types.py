"""What a session folder says, as values: which file is what, and what is known of them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from capture.session.manifest import SessionCameraTable
from scene.camera import Camera

Encoding = Literal["linear", "srgb"] | float
"""How 8 and 16-bit values are coded. A number is a gamma: linear = value ** gamma."""


@dataclass(frozen=True)
class SphereSpec:
    """One `[[spheres]]` entry, resolved. `frames`: the ball's own photographs, one for each frame of the session."""

    kind: Literal["chrome", "white"]
    diameter_mm: float | None = None
    center_px: tuple[float, float] | None = None
    radius_px: float | None = None
    mask: Path | None = None
    frames: tuple[Path, ...] = ()
    reflectance: float | None = None


@dataclass(frozen=True)
class CaptureSession:
    """What a session folder says; every path absolute and there.

    Parameters
    ----------
    flash : tuple of Path
        One light per frame, those under `frames.skip` left out.
    names : tuple of str
        The flash frames' names, unique.
    kept : tuple of int
        Place of each flash frame among all that `frames.flash` matches: a lights file counts those of the
        skipped frames too.
    chart : Path or None
        Photograph of a ColorChecker; it may be one of the flash frames.
    encoding_stated : bool
        False: nothing was said of the encoding, and linear is assumed.
    half : bool
        2 x 2 superpixels.
    camera : Camera, SessionCameraTable or None
        All that is stated of it; a part, which EXIF and the picture's middle complete, or the board in `board_shots`.
    no_spheres : bool
        `spheres = []`: no ball is in the picture, and none is looked for.
    lights_file : Path or None
        Known lights instead of balls. DiLiGenT: light_directions.txt, its intensities beside it.
    mask, scan, normals : Path or None
        The object's mask, its laser scan, its ground truth that is already registered.
    box : (left, top, right, bottom) or None
        About the object, pixels as `[[spheres]]` counts them.
    picks : Path or None
        Points of the scan whose pixels are known: a start for its registration.
    scan_ball_diameter_mm : float or None
        Of a calibration ball that was scanned beside the object.
    tolerance_deg : float or None
        The error of normals that is allowed.
    series : (str, float or str) or None
        The factor that changes in a series, and its value here.
    photographed : int
        How many files `frames.flash` matches, those of skipped frames included.
    """

    name: str
    folder: Path
    flash: tuple[Path, ...]
    names: tuple[str, ...]
    kept: tuple[int, ...]
    ambient: tuple[Path, ...] = ()
    dark: tuple[Path, ...] = ()
    flat: tuple[Path, ...] = ()
    chart: Path | None = None
    encoding: Encoding = "linear"
    encoding_stated: bool = True
    half: bool = False
    skip: tuple[str, ...] = ()
    camera: Camera | SessionCameraTable | None = None
    board_shots: tuple[Path, ...] = ()
    spheres: tuple[SphereSpec, ...] = ()
    no_spheres: bool = False
    lights_file: Path | None = None
    mask: Path | None = None
    box: tuple[float, ...] | None = None
    scan: Path | None = None
    scan_unit: str = "mm"
    scan_ball_diameter_mm: float | None = None
    normals: Path | None = None
    picks: Path | None = None
    tolerance_deg: float | None = None
    series: tuple[str, float | str] | None = None
    layout: Literal["toml", "diligent"] = "toml"
    photographed: int = 0
