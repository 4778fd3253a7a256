"""What a calibration is, what is noted on the way to it, and what each flag of a light costs.

A flag stands beside its light in lights.json; whoever reads only the end of a run sees warnings.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.detect import Rejected
from formats.light_files.light_programs import OTHER_CAMERA
from scene.camera import Camera
from scene.frames import Frames
from scene.light_text import BY_COLUMN, EITHER
from scene.lights import Lights
from scene.reading import listed
from scene.spheres import Sphere

Array = NDArray[np.float64]
SAME = "same light as "
ADVICE: Mapping[str, str] = {
    "taken in the file's order: its names": "If the photographs are in another order, every normal is wrong. Compare "
    "the two lists; a light file that names the photographs (.lp, or filenames.txt beside light_directions.txt) is "
    "matched by name.",
    "taken in the file's order, which counts": "If the file leaves the skipped frames out, or lists others, every "
    "normal is wrong. Name the photographs in the file (.lp, or filenames.txt beside light_directions.txt).",
    BY_COLUMN: "It can be nothing else. Write a line for each light, and this is not said.",
    EITHER: "If each column is a light, every normal is wrong. Write unit vectors, which tell.",
    "its positions in mm are not used": "Taken as distant, flashes a metre away are 6 degrees off at 100 mm from the "
    "object's middle. Add [camera], and imageWidth to the file.",
    "the object is taken to stand": "If it stands elsewhere, directions and fall-off are wrong: by 3 degrees for a "
    "flash 300 mm aside and an object 100 mm nearer. Add a variable `reference`, the object's place in mm, to the "
    "file, or calibrate with balls.",
    "taken as shining alike to all sides": "A lamp that shines less to the side is taken for a weaker one all over the "
    "object, which bends normals: 5 % bends them by 2 degrees. Put a white ball beside the object, or use distant "
    "lamps.",
    OTHER_CAMERA: "Lights are in the frame of the camera that measured them. Where it was moved, or its lens changed, "
    "all are wrong: measure them with this one (rgbn rig), or mend [camera].",
    SAME: "They count as one light, seen twice. Was the flash not moved, or a photograph copied? Leave one of them out "
    "with frames.skip.",
    "glare beside the highlight": "The directions there are less sure, as their sigmas say. Clean the ball, or shoot "
    "with less exposure.",
    "left out": "So many speak of a ball at fault: moved, scratched, of a wrong diameter_mm, or another lamp mirrored "
    "in it. Look at its outline and highlights in the report.",
}
"""Words of a flag, and what it costs and what to do."""
A_FEW_ARE_USUAL, MANY = ("glare beside the highlight", "left out"), 0.25
"""Flags that a few frames may have, and the share of the frames from which they are a warning."""
ANOTHER_BRIGHTER = "shows something brighter than the flash: its highlight is that on which the balls agree"
SAID_ELSEWHERE = (
    ANOTHER_BRIGHTER,
    "small and dark: another reflection?",
    "no highlight seen: direction from the white ball's shading",
    "has no intensities",
)
"""Words of flags that are no warning: what notices them warns itself, or nothing is lost."""


class CrossValidation(NamedTuple):
    """How far apart two balls, each alone, place the lights: root mean square along one axis, over frames and pairs.

    A `ratio` of 1: the doubt is as stated; 2: the true one is twice as large. Errors that all balls share, such as
    that of a wrong focal length, do not show in it.
    """

    difference_deg: float
    stated_deg: float  # what the two balls' own sigmas allow
    ratio: float
    balls: int


@dataclass(frozen=True)
class Calibration:
    """What the balls say.

    Parameters
    ----------
    spheres : list of Sphere
    lights : Lights
    highlights_px : (S, F, 2) float64
        Where each ball mirrors each flash; NaN for white balls and where none was seen or believed.
    rejected : tuple of Rejected
        Circles that are no ball, or not one asked for, with the reason.
    evidence : tuple of str
        Why this model, and how well it fits.
    warnings : tuple of str
        What is suspicious but usable.
    position_covariance_mm2 : (F, 3, 3) float64 or None
        Of each light's position; None for distant lights.
    camera : Camera or None
        The camera that spheres and positions belong to: adjusted within its sigmas, if it had any.
    cross_validation : CrossValidation or None
        Whether the directions' sigma is as large as chrome balls, each alone, differ; None for fewer than two.
    white_ball_deg : float or None
        How far the first white ball's shading and the chrome balls' lights agree, median; None without both.
    """

    spheres: list[Sphere]
    lights: Lights
    highlights_px: Array
    rejected: tuple[Rejected, ...] = ()
    evidence: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    position_covariance_mm2: Array | None = None
    camera: Camera | None = None
    cross_validation: CrossValidation | None = None
    white_ball_deg: float | None = None


def leave_out(names: Sequence[str]) -> str:
    """Return what session.toml says to leave frames out, to be pasted into a message."""
    return f"frames.skip = {json.dumps(list(names))}"


@dataclass(frozen=True)
class Notes:
    """What the stages have to say, collected: evidence, warnings, per frame what is suspicious about its light.

    measured: Numbers of a `Calibration`, by their names.
    """

    evidence: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    flags: list[list[str]] = field(default_factory=list)
    measured: dict[str, float] = field(default_factory=dict)


def unknown_lights(frames: Frames, found: str, *, is_registered: bool) -> Calibration:
    """Return a calibration that knows no light; `found` is what the search for balls says.

    Where a scan is registered, `align` finds pose and lights together: nothing is lost, and nothing said.
    """
    shown = np.full((0, len(frames), 2), np.nan)
    if is_registered:
        waiting = "no ball, no light file: the lights are found with the scan's pose, by `align`"
        return Calibration([], Lights.unknown(frames.names), shown, (), (waiting,))
    found = found.removeprefix("spheres: ").replace(" (asked for: any)", "")
    said = (
        f"no probe tells the lights, which are unknown: {found} Without them only ldr, "
        "entropy and tv can run; they are taken where --method names none. Their relief may be inverted, or too high "
        "or too flat by any factor: read their own doubts. A ball or two in the next capture tell the lights."
    )
    evidence = "no ball, no light file: the lights are unknown"
    return Calibration([], Lights.unknown(frames.names), shown, (), (evidence,), (said,))


def flag_warnings(names: Sequence[str], flags: Sequence[Sequence[str]]) -> list[str]:
    """Return one sentence for each kind of flag that lowers trust, in the table's order; `flags` are each frame's."""
    every = [(name, flag) for name, own in zip(names, flags, strict=True) for flag in own]
    said = []
    for words, advice in ADVICE.items():
        here = [(name, flag) for name, flag in every if words in flag]
        frames = list(dict.fromkeys(name for name, _ in here))
        if not here or (words in A_FEW_ARE_USUAL and len(frames) < MANY * len(names)):
            continue
        texts = listed(dict.fromkeys(flag for _, flag in here), 2)
        told = (
            f"lights, all {len(names)}: {texts}"
            if len(frames) == len(names)
            else f"lights of {listed(frames)}: {texts}"
        )
        if words == SAME:
            told = f"{listed(f'{flag.removeprefix(SAME)} and {name}' for name, flag in here)} have the same light"
        said.append(f"{told}. {advice}")
    own = [f"{name} ({flag})" for name, flag in every if not any(words in flag for words in (*ADVICE, *SAID_ELSEWHERE))]
    if own:
        said.append(f"the light file itself doubts its lights: {listed(own)}. Calibrate them again, or look at them.")
    return said
