"""What is missing in a draft as it is now, and what is assumed in its place."""

from collections.abc import Iterator

from capture.survey.board_layout import FEWEST_SHOTS
from scene.spheres import KINDS
from shoot.init.draft import Draft


def notes_of(draft: Draft) -> tuple[str, ...]:
    """Return what a person is to know of a draft, a sentence each: what is missing, and what was found to be noted."""
    return (*_missing(draft), *draft.notes)


def _missing(draft: Draft) -> Iterator[str]:
    """Yield what a person may still tell, and what is done without it."""
    if not draft.lights and not draft.normals and not draft.balls:
        yield (
            "there is no ball and no light file: there are no lights, and only ldr, entropy and tv can solve. Mark the "
            "balls in the picture, in rgbn studio; or add [[spheres]] with center_px and radius_px."
        )
    for kind in KINDS:
        own = [ball for ball in draft.balls if ball.kind == kind]
        if draft.balls and not draft.lights and not own:
            yield f"no {kind} ball" + ("; so lights have no positions." if kind == "chrome" else ".")
        if any(ball.diameter_mm is None for ball in own):
            balls = f"{kind} ball{'s' * (len(own) > 1)}"
            yield f"the diameter of the {balls} is not known: lights get directions, but no positions."
    yield from _doubted(draft)
    if draft.board is None and (boards := draft.photographs.get("board")):
        yield (
            f"{len(boards)} photographs of a board are not used: {FEWEST_SHOTS} must show the same ChArUco board or "
            "chessboard."
        )
    if draft.lights:
        yield f"lights are read from {draft.lights.name}; balls are not needed."
    if "ambient" not in draft.photographs:
        yield "there is no ambient frame (flash off, same exposure): the room must have been dark."
    if draft.linear is False:
        yield f"{draft.photographs['flash'][0].suffix} values are taken as sRGB-encoded, as cameras write them."
    if draft.scan is None and draft.normals is None:
        yield "there is no scan: no ground truth, no twin."
    elif draft.scan and draft.unit == "unknown":
        yield "the scan's unit is not known: give it, or a ball's diameter."
    elif draft.scan and draft.likely_unit not in (None, draft.unit):
        yield (
            f"the scan is {draft.scan_told} with unit {draft.unit}, but the object looks {draft.object_mm:.0f} mm "
            f"large in the picture, as with unit {draft.likely_unit}. Check the unit, and the balls' diameters."
        )


def _doubted(draft: Draft) -> list[str]:
    """Name a diameter that puts a ball where no lab has it: in centimetres or inches."""
    from calibrate.calibrate import LAB_M

    for ball in draft.balls:
        away_m = draft.assumed_camera.fx * ball.mm_per_px / 1000 if ball.mm_per_px else None
        if away_m is not None and not LAB_M[0] < away_m < LAB_M[1]:
            return [
                f"a {ball.kind} ball of {ball.diameter_mm:g} mm would stand {away_m:.2g} m from the camera; expected "
                f"{LAB_M[0]:g} to {LAB_M[1]:g} m. Is the diameter in millimetres (1 cm = 10 mm, 1 inch = 25.4 mm)?"
            ]
    return []
