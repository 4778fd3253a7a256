"""The commented text of a draft's session.toml."""

import textwrap
from collections.abc import Iterator
from datetime import date
from typing import Any

from capture.session.manifest import Manifest, SphereTable
from formats.toml_text import toml_text
from scene.current import fingerprint
from scene.reading import shortened
from shoot.init.draft import Draft
from shoot.init.draft_notes import notes_of

HEADLINE = "# Written by {by} on {day}. Correct what is wrong; rgbn only reads it."
PURPOSE = {
    "flash": "one light each",
    "ambient": "flash off, subtracted",
    "dark": "lens covered",
    "flat": "white surface, divided by",
}
SIGNED = "# As rgbn wrote it: "
"""What stands before the fingerprint of all that is above: a file in which nothing was changed is written anew."""
WIDE = 112
"""Letters of a line of what is assumed."""
LONGEST = 1000
"""Letters of a sentence there: names of files are as long as they like."""


def session_text(draft: Draft, by: str = "rgbn init") -> str:
    """Return the text of session.toml, with what is assumed or missing above its tables."""
    head = [HEADLINE.format(by=by, day=date.today().isoformat())]
    for told in (f"camera: {draft.camera_told}", *notes_of(draft)):
        head += textwrap.wrap(shortened(told, LONGEST), WIDE, initial_indent="# - ", subsequent_indent="#   ")
    return "\n".join([*head, toml_text(_tables(draft.written), dict(_comments(draft)))])


def signed(text: str) -> str:
    """Return the text of a session.toml with the line by which `is_unedited` knows it."""
    return f"{text}\n{SIGNED}{fingerprint(text)[:12]}\n"


def is_unedited(text: str) -> bool:
    """Whether nobody changed what `signed` returned."""
    above, mark, _ = text.rpartition(f"\n{SIGNED}")
    return bool(mark) and text == signed(above)


def _tables(manifest: Manifest) -> dict[str, Any]:
    """Return the document as it is written: what was said, a glob alone without brackets."""

    def told(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: told(part) for key, part in value.items()}
        if isinstance(value, list) and len(value) == 1 and isinstance(value[0], str):
            return value[0]
        return [told(part) for part in value] if isinstance(value, list) else value

    tables = told(manifest.model_dump(exclude_unset=True, exclude_none=True))
    return {key: value for key, value in tables.items() if value != {}}


def _comments(draft: Draft) -> Iterator[tuple[str, str]]:
    """Yield what is said beside keys, by their paths."""
    for role, purpose in PURPOSE.items():
        if files := draft.photographs.get(role):
            size = f", {draft.width} x {draft.height} px" if role == "flash" else ""
            yield f"frames.{role}", f"{len(files)}, {purpose}{size}"
    linear = draft.manifest.frames.linear
    told = "values are proportional to light" if linear else "sRGB-encoded, as cameras write 8 bits"
    yield "frames.linear", told
    yield "camera.board.square_mm", "it does not change the camera"
    for number, ball in enumerate(draft.manifest.spheres):
        yield f"spheres[{number}]", _ball_told(draft, ball)
    yield "object.scan", draft.scan_told
    yield "object.normals", "registered ground truth"


def _ball_told(draft: Draft, ball: SphereTable) -> str:
    more = "" if ball.diameter_mm else "; diameter_mm = ... would give lights their positions"
    return f"{_place_told(draft, ball)}{more}"


def _place_told(draft: Draft, ball: SphereTable) -> str:
    if ball.frames:
        return "in its own photographs, in the flash frames' order"
    if ball.center_px is None or ball.radius_px is None:
        return "to be found"
    (u, v), how = ball.center_px, "found" if draft.is_found(ball) else "placed by hand"
    return f"{how} at ({u:.0f}, {v:.0f}) px, radius {ball.radius_px:.0f} px"


def rows_of(draft: Draft) -> Iterator[tuple[str, str]]:
    """Yield what was found, for a table: what, and how it is known."""
    for role, files in draft.photographs.items():
        shown = files[0].name if len(files) == 1 else f"{files[0].name} to {files[-1].name}"
        size = f", {draft.width} x {draft.height} px" if role == "flash" else ""
        yield role, f"{len(files)}: {shown}{size}"
    yield "camera", draft.camera_told
    for number, ball in enumerate(draft.manifest.spheres, 1):
        known = f"{ball.diameter_mm:.4g} mm" if ball.diameter_mm else "diameter not known"
        yield f"ball {number}", f"{ball.kind}, {known}; {_place_told(draft, ball)}"
    lights, known = draft.manifest.lights, draft.manifest.object
    if known.scan:
        yield "scan", f"{known.scan}, {draft.scan_told}"
    for label, name in (("mask", known.mask), ("lights", lights and lights.file), ("normals", known.normals)):
        if name:
            yield label, name
