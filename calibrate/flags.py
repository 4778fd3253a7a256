"""What each flag of a light costs, and what to do: the one table of all flags that calibration writes.

A flag stands beside its light in lights.json. Whoever reads only the end of a run sees warnings: each kind of flag has
one sentence there for all its frames, or a reason here why it has none.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from scene.light_text import BY_COLUMN, EITHER
from scene.reading import listed


class Kind(NamedTuple):
    """One kind of flag.

    Parameters
    ----------
    pattern : str
        Regular expression of the whole flag.
    warning : str
        What follows the flag's words: what it costs, what to do. Empty: no warning of its own, for a
    reason : str
        that is stated here.
    least : float
        Share of the frames from which it is a warning.
    """

    pattern: str
    warning: str = ""
    reason: str = ""
    least: float = 0.0


KINDS = (
    Kind(
        r"taken in the file's order: its names are not the frames'",
        "If the photographs are in another order, every normal is wrong. Compare the two lists; a light file that "
        "names the photographs (.lp, or filenames.txt beside light_directions.txt) is matched by name.",
    ),
    Kind(
        r"taken in the file's order, which counts the skipped frames",
        "If the file leaves the skipped frames out, or lists others, every normal is wrong. Name the photographs in "
        "the file (.lp, or filenames.txt beside light_directions.txt).",
    ),
    Kind(
        rf".* {BY_COLUMN}",
        "It can be nothing else. Write a line for each light, and this is not said.",
    ),
    Kind(
        rf".* {EITHER}",
        "If each column is a light, every normal is wrong. Write unit vectors, which tell.",
    ),
    Kind(
        r"its positions in mm are not used: they need .*",
        "Taken as distant, flashes a metre away are 6 degrees off at 100 mm from the object's middle. Add [camera], "
        "and imageWidth to the file.",
    ),
    Kind(
        r"the object is taken to stand .* mm away: .* does not tell",
        "If it stands elsewhere, directions and fall-off are wrong: by 3 degrees for a flash 300 mm aside and an "
        "object 100 mm nearer. Add a variable `reference`, the object's place in mm, to the file, or calibrate with "
        "balls.",
    ),
    Kind(
        r"taken as shining alike to all sides: mu .* is not used",
        "A lamp that shines less to the side is taken for a weaker one all over the object, which bends normals: 5 % "
        "bends them by 2 degrees. Put a white ball beside the object, or use distant lamps.",
    ),
    Kind(
        r"same light as .*",
        "They count as one light, seen twice. Was the flash not moved, or a photograph copied? Leave one of them out "
        "with frames.skip.",
    ),
    Kind(
        r"glare beside the highlight on chrome ball .*",
        "The directions there are less sure, as their sigmas say. Clean the ball, or shoot with less exposure.",
        least=0.25,
    ),
    Kind(
        r"highlight on chrome ball .* (disagrees and is|degrees beside the white ball's shading and) left out",
        "So many speak of a ball at fault: moved, scratched, of a wrong diameter_mm, or another lamp mirrored in it. "
        "Look at its outline and highlights in the report.",
        least=0.25,
    ),
    Kind(
        r"a brighter point on chrome ball .* is not the flash",
        reason="the other balls see the flash elsewhere, and agree: nothing is lost",
    ),
    Kind(
        r"the brightest point on chrome ball .* is small and dark: another reflection\?",
        reason="calibrate.lights.from_chrome warns of it where no other ball shows the flash",
    ),
    Kind(
        r"no highlight seen: direction from the white ball's shading",
        reason="calibrate.lights.from_chrome warns of it, with the frames' names",
    ),
    Kind(
        r".* has no intensities",
        reason="calibrate.known_lights.with_known reads them elsewhere, and warns of what it reads them from",
    ),
    Kind(
        r"moved by the scan's shading",
        reason="asked for with --refine-lights, which says by how much",
    ),
)


def kind_of(flag: str) -> Kind | None:
    """Return the kind of a flag; None for one that a light file brought with it."""
    return next((kind for kind in KINDS if re.fullmatch(kind.pattern, flag)), None)


def flag_warnings(names: Sequence[str], flags: Sequence[Sequence[str]]) -> list[str]:
    """Return one sentence for each kind of flag that lowers trust, in the table's order; `flags` are each frame's."""
    every = [(name, flag) for name, own in zip(names, flags, strict=True) for flag in own]
    said = []
    for kind in KINDS:
        here = [(name, flag) for name, flag in every if kind_of(flag) is kind]
        frames = list(dict.fromkeys(name for name, _ in here))
        if kind.warning and here and len(frames) >= kind.least * len(names):
            said.append(f"{_told(here, frames, len(names))}. {kind.warning}")
    own = [f"{name} ({flag})" for name, flag in every if kind_of(flag) is None]
    if own:
        said.append(f"the light file itself doubts its lights: {listed(own)}. Calibrate them again, or look at them.")
    return said


def _told(here: list[tuple[str, str]], frames: list[str], count: int) -> str:
    """Return which lights have a flag, and the flag."""
    same = [(flag.removeprefix("same light as "), name) for name, flag in here if flag.startswith("same light as ")]
    if same:
        return f"{listed(f'{one} and {other}' for one, other in same)} have the same light"
    words = listed(dict.fromkeys(flag for _, flag in here), 2)
    return f"lights, all {count}: {words}" if len(frames) == count else f"lights of {listed(frames)}: {words}"
