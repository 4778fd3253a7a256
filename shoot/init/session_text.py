"""A draft in words: the commented text of its session.toml, what was found, what is missing and assumed."""

import textwrap
from collections.abc import Iterator
from datetime import date
from typing import Any

from capture.session.manifest import TABLES, Manifest, SphereTable
from formats.toml_documents import toml_text
from scene.current import fingerprint
from scene.reading import shortened
from scene.spheres import KINDS
from shoot.init.draft import Draft

HEADLINE = "# Written by rgbn init on {day}. Correct what is wrong; rgbn only reads it."
SIGNED = "# As rgbn wrote it: "
"""What stands before the fingerprint of all that is above: a file in which nothing was changed is written anew."""
WIDE = 112
"""Letters of a line of what is assumed."""
BESIDE = ("frames", "spheres", "object.scan_unit")
"""Keys beside which stands what was found; beside others, what they are for."""
LONGEST = 1000
"""Letters of a sentence there: names of files are as long as they like."""


def session_text(draft: Draft) -> str:
    """Return the text of session.toml, with what is assumed or missing above its tables."""
    head = [HEADLINE.format(day=date.today().isoformat())]
    for told in (f"camera: {draft.camera[1]}", *notes_of(draft)):
        head += textwrap.wrap(shortened(told, LONGEST), WIDE, initial_indent="# - ", subsequent_indent="#   ")
    tables, facts = _tables(draft.written), dict(facts_of(draft))
    comments = {path: text for path, text in facts.items() if path.startswith(BESIDE)}
    return "\n".join([*head, toml_text(tables, {**dict(_purposes(tables)), **comments})])


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


def _purposes(tables: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the first sentence of each key's description."""
    for table, keys in tables.items():
        for key in keys if isinstance(keys, dict) else ():
            yield f"{table}.{key}", (TABLES[table].model_fields[key].description or "").split(". ")[0].rstrip(".")


def facts_of(draft: Draft) -> Iterator[tuple[str, str]]:
    """Yield what was found and how it is known, each with the key of session.toml that says it."""
    manifest = draft.manifest
    for role, files in draft.photographs.items():
        shown = files[0].name if len(files) == 1 else f"{files[0].name} to {files[-1].name}"
        size = f", {draft.width} x {draft.height} px" if role == "flash" else ""
        yield f"camera.{role}" if role == "board" else f"frames.{role}", f"{len(files)}: {shown}{size}"
    yield "camera", draft.camera[1]
    for number, ball in enumerate(manifest.spheres):
        known = f"{ball.diameter_mm:.4g} mm" if ball.diameter_mm else "diameter_mm not known"
        yield f"spheres[{number}]", f"{ball.kind}, {known}; {_place_told(ball)}"
    for table, key in (("lights", "file"), ("object", "mask"), ("object", "scan"), ("object", "normals")):
        if name := getattr(getattr(manifest, table), key, None):
            yield f"{table}.{key}", name
    if manifest.object.scan:
        yield "object.scan_unit", draft.scan_told


def _place_told(ball: SphereTable) -> str:
    if ball.center_px is None:
        return "in its own photographs, in the flash frames' order"
    return "found at ({:.0f}, {:.0f}) px, radius {:.0f} px".format(*ball.center_px, ball.radius_px)


def notes_of(draft: Draft) -> tuple[str, ...]:
    """Return what a person is to know of a draft, a sentence each: what is missing, and what was found to be noted."""
    return (*_missing(draft), *draft.notes)


def _missing(draft: Draft) -> Iterator[str]:
    """Yield what a person may still tell, and what is done without it."""
    manifest, known = draft.manifest, draft.manifest.object
    balls = manifest.spheres
    if not manifest.lights and not known.normals and not balls:
        yield (
            "there is no ball and no light file: there are no lights, and only ldr, entropy and tv can solve. Mark the "
            "balls in the picture, in rgbn studio; or add [[spheres]] with center_px and radius_px."
        )
    for kind in KINDS:
        own = [ball for ball in balls if ball.kind == kind]
        if balls and not manifest.lights and not own:
            yield f"no {kind} ball" + ("; so lights have no positions." if kind == "chrome" else ".")
        if any(ball.diameter_mm is None for ball in own):
            told = f"{kind} ball{'s' * (len(own) > 1)}"
            yield f"the diameter of the {told} is not known: lights get directions, but no positions."
    if manifest.lights:
        yield f"lights are read from {manifest.lights.file}; balls are not needed."
    if not manifest.frames.ambient:
        yield "there is no ambient frame (flash off, same exposure): the room must have been dark."
    if manifest.frames.linear is False:
        suffix = draft.photographs["flash"][0].suffix
        yield f"{suffix} values are taken as sRGB-encoded, as cameras write them; else say --linear."
    if not known.scan and not known.normals:
        yield "there is no scan: no ground truth, no twin."
