"""The camera by EXIF and what session.toml says in part, with what that is worth.

Lenses are not what is engraved on them, and focusing changes them.
"""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from capture.camera.exif import Exif
from capture.session.manifest import SessionCameraTable
from capture.session.resolve import LENSES
from draw.readable import share
from scene.camera import Camera
from scene.errors import SessionError

DIAGONAL_35MM = float(np.hypot(36, 24))
"""mm: what "35 mm equivalent" refers to [CIPA2005]. By width it would be 4 % off on 4:3."""
ENGRAVED_SIGMA = 0.02
"""Relative, of the focal length on a lens against its real one: some 5 % is what makers allow themselves."""
STEP_SIGMA_MM = 0.5 / np.sqrt(3)
"""Of a number rounded to whole millimetres."""
CENTER_SIGMA = 0.01
"""Principal point against the picture's middle, of its width: lenses and stabilised sensors sit beside it."""
UNIT = 4.0
"""Ratio of a length to EXIF's from which it is taken for one in another unit."""
USUAL_DISTANCE_MM = 1000.0
"""Sensor to object, where EXIF does not tell: the balls and the object fill the picture."""


def camera_from_lens(
    lens: SessionCameraTable, exif: Sequence[Exif], width: int, height: int, *, half: bool = False
) -> tuple[Camera, tuple[str, ...]]:
    """Return the camera of a lens that is known in part, or not at all: EXIF tells the rest.

    Parameters
    ----------
    lens : SessionCameraTable
    exif : sequence of Exif
        The flash frames'.
    width, height : int
        The decoded frames', which are 2 x 2 superpixels if `half`.

    Returns
    -------
    camera : Camera
        Of the full-size picture, or of the size that `lens` states; with `focal_sigma` and `center_sigma_px`.
        Orthographic where nothing tells the focal length.
    warnings : tuple of str

    Raises
    ------
    SessionError
        A focal length in millimetres without the sensor's size, or one that no lens has.
    """
    decoded = width, height
    if half:
        width, height = 2 * width, 2 * height
    width, height = lens.width or width, lens.height or height
    source = "EXIF" if lens.fx is None and lens.focal_mm is None else "session.toml"
    focal = _focal_of(lens, exif, width, height)
    if focal is None and lens != SessionCameraTable():
        raise SessionError(
            "camera: no focal length: neither [camera] in session.toml nor EXIF tells one. Add fx (pixels), or "
            "focal_mm with sensor_mm, the width of the sensor."
        )
    if focal is None:
        return Camera.orthographic(*decoded), (
            "camera: unknown (no [camera] in session.toml, no focal length in EXIF): taken as orthographic. Then no "
            "light has a position, and a ball away from the centre gives directions that are off by 5 to 15 degrees. "
            "Add [camera] with focal_mm and sensor_mm, or shots of a ChArUco board or a chessboard.",
        )
    fx, fy, sigma, what = focal
    if not LENSES[0] <= fx / width <= LENSES[1]:
        raise SessionError(
            f"camera: the focal length is {fx:g} px ({what}) for a picture of {width} px; lenses have 0.2 "
            "to 1000 times the picture. Correct it in [camera]; a focal length in millimetres is focal_mm."
        )
    known = lens.cx is not None and lens.cy is not None
    camera = Camera(
        *(width, height, fx, fy),
        (width - 1) / 2 if lens.cx is None else lens.cx,
        (height - 1) / 2 if lens.cy is None else lens.cy,
        tuple(lens.distortion or (0.0,) * 5),
        source=source,
        focal_sigma=sigma,
        center_sigma_px=0.0 if known else CENTER_SIGMA * width,
    )
    if known and not sigma:
        return camera, ()
    doubts = _doubts(lens, exif, width, height)
    middle = "" if known else f" The principal point is taken as the centre, +- {camera.center_sigma_px:.0f} px."
    by = "focal length from EXIF, " if source == "EXIF" else "focal length "
    return camera, (
        *doubts,
        f"camera: {by}{what}: {camera.fx:.1f} px, good to {share(sigma, 1)} %.{middle} Shots of a ChArUco "
        "board or a chessboard would measure all of it, and the distortion.",
    )


def _focal_of(
    lens: SessionCameraTable, exif: Sequence[Exif], width: int, height: int
) -> tuple[float, float, float, str] | None:
    """Return the focal length, px, along rows and columns; its relative sigma; what tells it. None: nothing does."""
    if lens.fx is not None:
        # A calibration gives the principal point too: without it this is a figure that somebody worked out.
        sigma = ENGRAVED_SIGMA if lens.cx is None else 0.0
        return lens.fx, lens.fy or lens.fx, sigma, "as session.toml says"
    engraved = sorted((e for e in exif if e.focal_mm), key=lambda e: e.focal_mm or 0)
    equivalent = sorted((e for e in exif if e.focal_35mm), key=lambda e: e.focal_35mm or 0)
    e = engraved[len(engraved) // 2] if engraved else Exif()
    focal_mm = lens.focal_mm or e.focal_mm
    sensor = _sensor_of(lens, exif, width, height) if focal_mm else None
    if focal_mm and sensor:
        (x, y), how = sensor
        stated_mm, convention, what = focal_mm, 0.0, f"{focal_mm:g} mm at {x:.1f} px/mm ({how})"
    elif lens.focal_mm is not None:
        camera = next((e.camera for e in exif if e.camera), None)
        known = f'; the sensor of "{lens.model or camera}" is not known here' if lens.model or camera else ""
        raise SessionError(
            f"camera.focal_mm: found {lens.focal_mm:g} without the size of the sensor{known}. Add sensor_mm, its width "
            "(36 for full frame, 23.5 or 22.3 for APS-C, 17.3 for four thirds), or pixel_um, or crop_factor."
        )
    elif lens.model and focal_mm:
        raise SessionError(f'camera.model: the sensor of "{lens.model}" is not known here. Give sensor_mm, its width.')
    elif not equivalent:
        return None
    else:
        e = equivalent[len(equivalent) // 2]
        stated_mm, x = e.focal_35mm or 0.0, float(np.hypot(width, height)) / DIAGONAL_35MM
        focal_mm, y = e.focal_mm or stated_mm, x
        # Not every maker measures by the diagonal: on 3:2 it makes no difference, on 4:3 the width gives 4 % less.
        convention = abs(36 * x / max(width, height) - 1) / 2
        what = f"{stated_mm:g} mm on 35 mm film, by the diagonal; rounded to whole millimetres"
    longer, breathing = _breathing(focal_mm, e.subject_mm)
    sigma = float(np.linalg.norm([ENGRAVED_SIGMA, STEP_SIGMA_MM / stated_mm, breathing, convention]))
    what += f", focused at {e.subject_mm:.0f} mm" if e.subject_mm else ""
    return stated_mm * x * longer, stated_mm * y * longer, sigma, what


def _doubts(lens: SessionCameraTable, exif: Sequence[Exif], width: int, height: int) -> list[str]:
    """Say where millimetres contradict the photographs' EXIF by more than an adapted lens or a crop: another unit."""
    doubts = []
    focal = next((e.focal_mm for e in exif if e.focal_mm), None)
    if lens.focal_mm and focal and not 1 / UNIT <= lens.focal_mm / focal <= UNIT:
        doubts.append(
            f"camera.focal_mm: found {lens.focal_mm:g}, but the photographs' EXIF says {focal:g} mm. Give millimetres, "
            "as engraved on the lens (1 cm = 10 mm); or leave focal_mm out."
        )
    known = _sensor_of(SessionCameraTable(model=lens.model), exif, width, height) if lens.sensor_mm else None
    sensor = max(width, height) / known[0][0] if known else None
    if lens.sensor_mm and sensor and not 1 / UNIT <= lens.sensor_mm / sensor <= UNIT:
        doubts.append(
            f"camera.sensor_mm: found {lens.sensor_mm:g}, but by the photographs' EXIF the sensor is {sensor:.3g} mm "
            "wide. Give millimetres (1 cm = 10 mm), 36 for full frame; or leave sensor_mm out."
        )
    return doubts


def _sensor_of(
    lens: SessionCameraTable, exif: Sequence[Exif], width: int, height: int
) -> tuple[tuple[float, float], str] | None:
    """Return the picture's pixels per mm, along rows and columns, and by what they are known."""
    longer, diagonal = max(width, height), float(np.hypot(width, height))
    if lens.pixel_um:
        per_mm, how = 1000 / lens.pixel_um, f"pixels of {lens.pixel_um:g} um"
    elif lens.sensor_mm:
        per_mm, how = longer / lens.sensor_mm, f"a sensor of {lens.sensor_mm:g} mm"
    elif lens.crop_factor:
        per_mm, how = diagonal * lens.crop_factor / DIAGONAL_35MM, f"crop factor {lens.crop_factor:g}"
    else:
        measured = [e for e in exif if e.pixels_per_mm]
        if measured and not lens.model:
            e = measured[len(measured) // 2]
            assert e.pixels_per_mm
            # A picture that was scaled after it was taken still states the resolution of the sensor. RAW files show a
            # few more pixels than EXIF's width, of the same pitch.
            scaled = width / e.width_px if e.width_px else 1.0
            scaled = 1.0 if 0.9 < scaled < 1.1 else scaled
            return (e.pixels_per_mm[0] * scaled, e.pixels_per_mm[1] * scaled), "focal-plane resolution"
        model = lens.model or next((e.camera for e in exif if e.camera), None)
        sensor_mm = _sensor_width_mm(model) if model else None
        if sensor_mm is None:
            return None
        per_mm, how = longer / sensor_mm, f"{model}: a sensor of {sensor_mm:g} mm"
    return (per_mm, per_mm), how


def _breathing(focal_mm: float, subject_mm: float | None) -> tuple[float, float]:
    """Return by what the focal length is multiplied for its focus, and the relative sigma of that.

    A thin lens at magnification m has its image at f (1 + m), and m = f / (distance - f): 5 % at a metre with 50 mm.
    Lenses that focus by moving inner groups get shorter instead, so half of it is added, and half of it is doubt.
    Where nothing tells the distance nothing is added, and all of it at a metre is doubt.
    """
    distance = subject_mm or USUAL_DISTANCE_MM
    magnification = min(focal_mm / max(distance - focal_mm, 1e-9), 1.0) if distance > focal_mm else 1.0
    return (1 + magnification / 2, magnification / 2) if subject_mm else (1.0, magnification)


def _sensor_width_mm(camera: str) -> float | None:
    """Return the longer side of a camera's sensor, mm; None for one that sensors.toml does not list.

    Parameters
    ----------
    camera : str
        Maker and model in any case, as EXIF has them: "NIKON CORPORATION NIKON D850".
    """
    text, tables = _words(camera), tomllib.loads(Path(__file__).with_name("sensors.toml").read_text())
    known = [widths for maker, widths in tables.items() if f" {maker} " in text]
    models = {_words(model): float(width) for widths in known for width, names in widths.items() for model in names}
    # "EOS R5 Mark II" names "EOS R5" too.
    return models.get(max((model for model in models if model in text), key=len, default=""))


def _words(text: str) -> str:
    """Return the words of a text, small, each between two blanks."""
    return f" {' '.join(re.findall(r'[a-z0-9]+', text.lower()))} "
