"""The window on a folder without session.toml: the document that is to be written, as it is put right."""

from pathlib import Path
from typing import Any

from capture.session.globs import natural_key
from capture.session.manifest import SphereTable
from capture.survey.folder_files import FEWEST
from capture.survey.small_pictures import Small
from compare.report.picture_strip import INK, PictureStrip
from lab.session_place import MANIFEST
from scene.errors import SceneError
from shoot.init.contact_sheet import COLOURS
from shoot.init.draft import Draft
from shoot.init.init_session import check_free, write_manifest
from shoot.init.session_text import session_text
from studio.new_session.looking import FolderLook
from studio.photograph.photograph_window import Outlines, PhotographWindow, Shown
from studio.photograph.plane import Plane
from studio.studio_state import History

BOARD, UNUSED = "board", "not used"
LEFT_OUT, OTHER = (255, 120, 110), (255, 210, 90)
"""Colours of the names of photographs that are not used, and of those that are no flash frames."""


class NewSessionWindow(PhotographWindow):
    """What a browser begins sessions in. Its panels call `edit`, `measure` and `correct`.

    place: Of the folder that is looked at, among the state's `looks`.
    photograph: The one that is shown; None: the mean of the flash frames.
    """

    area = "New session"
    first_tab = "Balls"

    def __init__(self, *place: Any) -> None:
        super().__init__(*place)
        without = [folder for folder in self.state.looks if not (folder / MANIFEST).exists()]
        self.place: Path = (without or list(self.state.looks))[0]
        self.photograph: Path | None = None
        self._is_shown = False

    def begin(self) -> None:
        """Look at the first folder that has no session yet."""
        self.open(self.place)

    @property
    def taken(self) -> FolderLook:
        """The look at the folder."""
        return self.state.looks[self.place]

    @property
    def manifest(self) -> Path:
        """Where session.toml is written."""
        return self.place / MANIFEST

    @property
    def history(self) -> History[Draft] | None:
        """The document with what was put right in it; None before the folder was looked at."""
        return self.taken.history

    def keep(self, history: History[Any]) -> None:
        """Keep what was put right."""
        self.taken.history = history

    @property
    def capture(self) -> Draft | None:
        """What would be written now, once the folder was looked at."""
        return self.history.state if self.history else None

    def need(self) -> Draft:
        """Return the document. Raises SceneError: the folder was not looked at yet."""
        if self.capture is None:
            raise SceneError(f"{self.place.name}: is still being looked at. Wait for it.")
        return self.capture

    @property
    def balls(self) -> list[SphereTable]:
        """The balls that are known so far, in the frames and shot apart."""
        draft = self.capture or self.taken.draft
        return draft.manifest.spheres if draft else []

    @property
    def outlines(self) -> Outlines:
        """The balls in the frames."""
        return tuple(ball for ball in self.balls if ball.center_px and ball.radius_px)

    def is_found(self, ball: SphereTable) -> bool:
        """Whether a ball's circle was found."""
        return self.need().is_found(ball)

    def correct(self, outlines: Outlines, label: str = "correct a ball", held_s: float | None = None) -> None:
        """Take other balls in the frames; a new one, or one of another kind, is as large as all of its kind."""
        was = self.outlines if len(outlines) == len(self.outlines) else outlines
        balls = [ball for ball in self.balls if not ball.center_px]
        for ball, before in zip(outlines, was, strict=True):
            alike = {one.diameter_mm for one in self.balls if one.kind == ball.kind}
            usual = alike.pop() if len(alike) == 1 else None
            diameter = ball.diameter_mm if ball.kind == before.kind else None
            balls.append(ball.model_copy(update={"diameter_mm": diameter or usual}))
        self.alter(label, held_s=held_s, manifest=self.need().with_balls(balls).manifest)

    def measure(self, which: str | int, diameter_mm: float) -> None:
        """Say the diameter of all balls of a kind, or of one in the frames; 0: it is not known."""
        one = self.outlines[which] if isinstance(which, int) else None
        balls = [
            SphereTable(**{**ball.model_dump(), "diameter_mm": float(diameter_mm) or None})
            if ball is one or ball.kind == which
            else ball
            for ball in self.balls
        ]
        self.edit(self.need().with_balls(balls), "diameter")

    def edit(self, draft: Draft, label: str = "edit") -> None:
        """Take the document as it was edited."""
        self.alter(label, manifest=draft.manifest)

    def back_to_found(self) -> None:
        """Take the balls as they were found, with the diameters that are known of their kinds."""
        self.correct(tuple(ball for ball in self.need().found if ball.center_px), "balls as found")

    def shown(self) -> Shown | None:
        """Return the photograph that is chosen, or the mean; while the folder is looked at, the first, with balls."""
        look, draft, photograph = self.taken, self.capture or self.taken.draft, self.photograph
        if draft is None:
            first = look.first if look.begun_s and not look.is_over else None
            plane = None if first is None else Plane(first.shape[1], first.shape[0])
            return None if plane is None or first is None else Shown(plane, None, ("first", lambda: first))
        plane, colours = Plane(draft.width, draft.height), tuple(COLOURS[ball.kind] for ball in self.outlines)
        picture = ((self.reading, photograph), lambda: look.picture(photograph))
        if self.capture is None:
            return Shown(plane, draft.assumed_camera, picture, colours=colours)
        roles = tuple(role_of(draft, path) for path in look.small)
        # One photograph is looked at as it is.
        crop = (draft.small, look.exposure, draft.step) if photograph is None else None
        chosen = None if photograph is None else list(look.small).index(photograph)
        strip = ((self.reading, roles), lambda: _strip(look, roles))
        return Shown(plane, draft.assumed_camera, picture, strip, chosen, crop, colours)

    def choose_small(self, index: int) -> None:
        """Look at a photograph; a second click goes back to all of them together."""
        path = list(self.taken.small)[index]
        self.choose(photograph=None if self.photograph == path else path, ball=None, looks=self.looks + 1)

    def open(self, place: Path) -> None:
        """Look at a folder; what was put right in it, or in another one, is kept."""
        self.place, self.on_photograph, self._is_shown = place, None, False
        if self.manifest.exists():
            self._let_go()
        else:
            self.taken.begin()
        self.choose(ball=None, photograph=None, reading=self.reading + 1)
        self.look_again()

    def _let_go(self) -> None:
        """Forget what was found: photographs are hundreds of megabytes."""
        self.state.looks[self.place] = FolderLook(self.taken.files, self.taken.out)

    def look_again(self) -> None:
        """Show how far the look is, and once what came of it."""
        super().look_again()
        look = self.taken
        if self._is_shown or not look.begun_s:
            return
        if look.is_over:
            self._is_shown = True
            self.reading += 1
            if look.fault is not None:
                self.show_fault(str(look.fault))
        self.refresh()

    @property
    def text(self) -> str:
        """What would be written now, as session.toml has it."""
        return session_text(self.need(), "rgbn studio")

    def write(self) -> None:
        """Write session.toml, once, and go on with the session.

        Raises SceneError: there is one already, what it would say cannot be read again, or the output folder would lie
        outside of the workspace.
        """
        draft, out = self.need(), self.workspace.path(self.taken.out)
        check_free(self.taken.files)
        write_manifest(draft, self.text)
        self._let_go()
        self.state.show_session(out, self.place, tab="Verdict")
        self.turn()

    def open_session(self) -> None:
        """Show the session that the folder has already."""
        self.state.show_session(self.workspace.path(self.taken.out), self.place)
        self.turn()


def _strip(look: FolderLook, roles: tuple[str, ...]) -> PictureStrip:
    """Return the small photographs, each with its use; those that are not used are dim."""
    colours = {"flash": INK, UNUSED: LEFT_OUT}
    labels = [
        (path.stem if role == "flash" else f"{role}: {path.stem}", colours.get(role, OTHER))
        for path, role in zip(look.small, roles, strict=True)
    ]
    dimmed = [small // (3 if role == UNUSED else 1) for small, role in zip(look.thumbnails, roles, strict=True)]
    return PictureStrip.of(dimmed, labels)


def role_of(draft: Draft, path: Path) -> str:
    """Return what a photograph is used for."""
    return next((role for role, paths in draft.photographs.items() if path in paths), UNUSED)


def with_role(draft: Draft, small: dict[Path, Small], path: Path, role: str) -> Draft:
    """Return a draft with a photograph used for something else.

    Raises SceneError: too few flash frames would be left, it is of another size, or it is one of a board.
    """
    was = role_of(draft, path)
    if role == was:
        return draft
    if BOARD in (role, was):
        raise SceneError(
            f"{path.name}: a board's shots are found by themselves. Put three or more that show all of it into a "
            "folder called board, or others out of it, and look at the folder again."
        )
    if "flash" in (role, was) and any(ball.frames for ball in draft.manifest.spheres):
        raise SceneError(
            f"{path.name}: the balls that were shot apart have one photograph for each flash frame. Name it under "
            "frames.skip in session.toml, which leaves out theirs, too."
        )
    photographs = {one: [other for other in paths if other != path] for one, paths in draft.photographs.items()}
    if role != UNUSED:
        photographs[role] = sorted([*photographs.get(role, []), path], key=natural_key)
    if len(photographs["flash"]) < FEWEST:
        raise SceneError(f"{path.name}: {FEWEST} flash frames are the fewest. Leave it, or add others first.")
    size = small[path].width, small[path].height
    if role != UNUSED and size != (draft.width, draft.height):
        raise SceneError(f"{path.name}: {size[0]} x {size[1]} px; the flash frames: {draft.width} x {draft.height}.")
    return draft.with_photographs(photographs)
