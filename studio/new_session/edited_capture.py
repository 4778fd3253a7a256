"""A capture as it was found and as a person has put it right: what is to be written."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from capture.session.globs import natural_key
from capture.session.session_types import Lens
from capture.survey.board_layout import FEWEST_SHOTS, find_board
from capture.survey.folder_files import FEWEST
from scene.errors import SceneError, SessionError
from scene.length_units import Unit
from scene.spheres import KINDS, Kind
from shoot.init.draft import Draft, DraftBall
from shoot.init.prepare import with_camera
from shoot.init.scan_unit import read_scan
from studio.new_session.found_capture import ROLES, FoundCapture
from studio.photograph.outlines import Outline, Outlines

UNUSED = "not used"


@dataclass(frozen=True, eq=False)
class EditedCapture:
    """What is written of a capture, but for the balls' outlines.

    draft: As edited; its balls are those that were shot apart.
    diameters_mm: Of a kind's balls, None where not known; an outline may have its own.
    unit: The scan's as a person said it; None: as the object's size in the picture tells.
    """

    found: FoundCapture
    draft: Draft
    diameters_mm: dict[Kind, float | None] = field(default_factory=dict)
    unit: Unit | None = None

    @classmethod
    def of(cls, found: FoundCapture) -> "EditedCapture":
        """Return a capture as it was found."""
        apart = tuple(ball for ball in found.draft.balls if ball.files)
        return cls(found, replace(found.draft, balls=apart))

    def with_draft(self, **changes: Any) -> "EditedCapture":
        """Return the capture with other parts of its draft."""
        return replace(self, draft=replace(self.draft, **changes))

    def role_of(self, path: Path) -> str:
        """Return what a photograph is used for."""
        return next((role for role, paths in self.draft.photographs.items() if path in paths), UNUSED)

    def with_role(self, path: Path, role: str) -> "EditedCapture":
        """Return the capture with a photograph used for something else.

        Raises SceneError: too few flash frames would be left, it is of another size, or shows another board or none.
        """
        draft, small, was = self.draft, self.found.small, self.role_of(path)
        if role == was:
            return self
        photographs = {one: [other for other in paths if other != path] for one, paths in draft.photographs.items()}
        if role != UNUSED:
            photographs[role] = sorted([*photographs.get(role, []), path], key=natural_key)
        photographs = {one: photographs[one] for one in ROLES if photographs.get(one)}
        if len(photographs.get("flash", [])) < FEWEST:
            raise SceneError(f"{path.name}: {FEWEST} flash frames are the fewest. Leave it, or add others first.")
        size = small[path].width, small[path].height
        if role not in (UNUSED, "board") and size != (draft.width, draft.height):
            raise SceneError(
                f"{path.name}: {size[0]} x {size[1]} px; the flash frames: {draft.width} x {draft.height}."
            )
        board, boards = draft.board, photographs.get("board", [])
        if role == "board" and board is None:
            board, shown = find_board([small[one] for one in boards])
            photographs["board"] = [one.path for one in shown] if board else boards
        elif role == "board":
            known = [one for one in boards if one != path][: FEWEST_SHOTS - 1]
            _, shown = find_board([small[one] for one in (*known, path)])
            if small[path] not in shown:
                raise SceneError(f"{path.name}: the board of the others is not seen in it.")
        elif len(boards) < FEWEST_SHOTS:
            board = None
        balls = _same_lights(draft, path, role)
        return self._with_camera(replace(draft, photographs=photographs, board=board, balls=balls), draft.lens)

    def with_lens(self, **lens: float | None) -> "EditedCapture":
        """Return the capture with `focal_mm` or `sensor_mm`, None for what is not known."""
        return self._with_camera(self.draft, replace(self.draft.lens, **lens))

    def _with_camera(self, draft: Draft, lens: Lens) -> "EditedCapture":
        try:
            draft = with_camera(draft, lens)
        except SessionError as error:
            # One of two numbers is typed before the other.
            draft = replace(draft, lens=lens, camera=None, camera_told=f"not known yet: {error}")
        return replace(self, draft=draft)

    def with_scan(self, path: Path | None) -> "EditedCapture":
        """Return the capture with another scan. Raises SceneError: it cannot be read."""
        return self.with_draft(scan=path, scan_size=None if path is None else read_scan(path))

    def described(self, outlines: Outlines) -> Draft:
        """Return what session.toml is to say."""
        apart = tuple(replace(ball, diameter_mm=self.diameters_mm.get(ball.kind)) for ball in self.draft.balls)
        placed = tuple(
            replace(ball, diameter_mm=ball.diameter_mm or self.diameters_mm.get(ball.kind)) for ball in outlines
        )
        by_hand = _needs_circles(as_found(self.found), placed)
        balls = tuple(
            DraftBall(
                ball.kind, ball.center_px, ball.radius_px, ball.diameter_mm, ball.is_moved or ball.kind in by_hand
            )
            for kind in KINDS
            for ball in placed
            if ball.kind == kind
        )
        draft = replace(self.draft, balls=(*apart, *balls))
        return replace(draft, unit=self.unit or draft.likely_unit or "unknown")


def as_found(found: FoundCapture) -> Outlines:
    """Return the balls that were found in the frames."""
    return tuple(Outline(ball.kind, ball.center_px, ball.radius_px) for ball in found.draft.balls if not ball.files)


def _needs_circles(found: Outlines, balls: Outlines) -> set[Kind]:
    """Return the kinds whose balls are all to be written with their circles.

    session.toml says how many balls of a kind are looked for: a circle that was found and given up would be found
    again in place of one that was kept. And of balls of several diameters it is known which has which.
    """
    by_circle: set[Kind] = set()
    for one in found:
        kept = [ball.center_px for ball in balls if ball.kind == one.kind]
        if not any(np.hypot(*np.subtract(center, one.center_px)) < one.radius_px / 2 for center in kept):
            by_circle.add(one.kind)
    for kind in KINDS:
        if len({ball.diameter_mm for ball in balls if ball.kind == kind}) > 1:
            by_circle.add(kind)
    return by_circle


def _same_lights(draft: Draft, path: Path, role: str) -> tuple[DraftBall, ...]:
    """Return balls that were shot apart, without the photograph of a flash frame that is left out."""
    flash = draft.photographs["flash"]
    if not draft.balls or (path not in flash and role != "flash"):
        return draft.balls
    if role == "flash":
        raise SceneError(f"{path.name}: the balls that were shot apart have no photograph of its light.")
    index = flash.index(path)
    return tuple(replace(ball, files=(*ball.files[:index], *ball.files[index + 1 :])) for ball in draft.balls)
