"""The commented session.toml of a draft."""

from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

from capture.survey.folder_files import pattern_of
from formats.toml_text import toml_value
from scene.current import fingerprint
from shoot.init.draft import Draft, DraftBall

COLUMN = 44
"""Where comments begin."""
HEADLINE = "# Written by rgbn init on {day}. Correct what is wrong; rgbn only reads it."
PURPOSE = {
    "flash": "one light each",
    "ambient": "flash off, subtracted",
    "dark": "lens covered",
    "flat": "white surface, divided by",
}
SIGNED = "# As rgbn init wrote it: "
"""What stands before the fingerprint of all that is above: a file in which nothing was changed is written anew."""
SQUARE_MM = 20.0
"""Nobody was asked for it: the size of its squares does not change the camera."""


def session_text(draft: Draft) -> str:
    """Return the text of session.toml."""
    lines = [HEADLINE.format(day=date.today().isoformat()), *_key("name", draft.name), "", "[frames]", *_frames(draft)]
    lines += _camera(draft)
    for ball in draft.balls:
        lines += ["", *_ball(ball, draft.folder)]
    if draft.lights:
        lines += ["", "[lights]", *_key("file", _name(draft.lights, draft.folder))]
    about = [*_object(draft)]
    return "\n".join([*lines, *(["", "[object]", *about] if about else []), ""])


def signed(text: str) -> str:
    """Return the text of a session.toml with the line by which `is_unedited` knows it."""
    return f"{text}\n{SIGNED}{fingerprint(text)[:12]}\n"


def is_unedited(text: str) -> bool:
    """Whether nobody changed what `signed` returned."""
    above, mark, _ = text.rpartition(f"\n{SIGNED}")
    return bool(mark) and text == signed(above)


def _frames(draft: Draft) -> Iterator[str]:
    for role, purpose in PURPOSE.items():
        if files := draft.photographs.get(role):
            size = f", {draft.width} x {draft.height} px" if role == "flash" else ""
            yield from _key(role, pattern_of(files, draft.folder), f"{len(files)}, {purpose}{size}")
    if draft.linear is not None:
        told = "values are proportional to light" if draft.linear else "sRGB-encoded, as cameras write 8 bits"
        yield from _key("linear", draft.linear, told)


def _camera(draft: Draft) -> Iterator[str]:
    yield ""
    if draft.board is not None:
        board, key = draft.board, "chessboard" if draft.board.dictionary is None else "charuco"
        yield f"[camera]  # {draft.camera_told}"
        yield from _key(key, pattern_of(draft.photographs["board"], draft.folder))
        marker = {} if board.marker_share is None else {"marker_mm": round(SQUARE_MM * board.marker_share, 2)}
        name = {} if board.dictionary is None else {"dictionary": board.dictionary}
        table = {"squares": list(board.squares), "square_mm": SQUARE_MM, **marker, **name}
        text = ", ".join(f"{key} = {toml_value(value)}" for key, value in table.items())
        yield f"board = {{ {text} }}  # their size does not change the camera"
        return
    lens = {key: value for key, value in vars(draft.lens).items() if value is not None and key != "distortion"}
    if not lens:
        yield f"# [camera]: {draft.camera_told}"
        return
    yield f"[camera]  # {draft.camera_told}"
    for key, value in lens.items():
        yield from _key(key, value)


def _ball(ball: DraftBall, folder: Path) -> Iterator[str]:
    (u, v), radius = ball.center_px, ball.radius_px
    found = f"found at ({u:.0f}, {v:.0f}) px, radius {radius:.0f} px" if radius and not ball.by_hand else ""
    yield f"[[spheres]]{f'  # {found}' if found else ''}"
    yield from _key("kind", ball.kind)
    if ball.diameter_mm is None:
        yield "# diameter_mm = 76.0  not known: without it there are directions, but no positions"
    else:
        yield from _key("diameter_mm", ball.diameter_mm)
    if ball.by_hand:
        yield from _key("center_px", [round(u, 1), round(v, 1)], "placed by hand")
        yield from _key("radius_px", round(radius, 1))
    if ball.files:
        yield from _key("frames", pattern_of(list(ball.files), folder), "its own photographs, in the same order")


def _object(draft: Draft) -> Iterator[str]:
    folder = draft.folder
    if draft.mask:
        yield from _key("mask", _name(draft.mask, folder))
    if draft.scan:
        yield from _key("scan", _name(draft.scan, folder), draft.scan_told)
        yield from _key("scan_unit", draft.unit, draft.unit_told)
    if draft.normals:
        yield from _key("normals", _name(draft.normals, folder), "registered ground truth")


def _key(key: str, value: Any, comment: str = "") -> Iterator[str]:
    line = f"{key} = {toml_value(value)}"
    yield f"{line:{COLUMN}}# {comment}" if comment and "\n" not in line else line


def _name(path: Path, folder: Path) -> str:
    found = pattern_of([path], folder)
    # A single file's name is no glob: its brackets stand for themselves.
    return str(found).replace("[[]", "[").replace("[*]", "*").replace("[?]", "?")
