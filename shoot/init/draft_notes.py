"""What is missing in a draft as it is now, and what is assumed in its place."""

from collections.abc import Iterator

from scene.spheres import KINDS
from shoot.init.draft import Draft


def notes_of(draft: Draft) -> tuple[str, ...]:
    """Return what a person is to know of a draft, a sentence each: what is missing, and what was found to be noted."""
    return (*_missing(draft), *draft.notes)


def _missing(draft: Draft) -> Iterator[str]:
    """Yield what a person may still tell, and what is done without it."""
    manifest, known, unit = draft.manifest, draft.manifest.object, draft.unit
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
    elif known.scan and unit == "unknown":
        yield "the scan's unit is not known: give it (--unit), or a ball's diameter."
    elif known.scan and draft.likely_unit not in (None, unit):
        yield (
            f"the scan is {draft.scan_told}, but the object looks {draft.object_mm:.0f} mm large in the picture, as "
            f"with unit {draft.likely_unit}. Check the unit, and the balls' diameters."
        )
