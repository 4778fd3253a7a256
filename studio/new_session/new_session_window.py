"""The window on a folder without session.toml: the document that is to be written, as it is put right."""

from pathlib import Path
from typing import Any

from capture.session.manifest import SphereTable
from capture.survey.folder_files import FolderFiles
from compare.report.picture_strip import INK, PictureStrip
from compare.report.pictures import Exposure
from lab.session_place import MANIFEST
from scene.camera import Camera
from scene.errors import SceneError
from scene.map_pictures import Image
from shoot.init.contact_sheet import COLOURS
from shoot.init.draft import Draft
from shoot.init.init_session import check_free, write_manifest
from shoot.init.session_text import session_text
from studio.new_session.looking import FoundCapture, Look, mean_of
from studio.new_session.photograph_roles import UNUSED, role_of
from studio.photograph.outlines import Outlines
from studio.photograph.photograph_window import PhotographWindow, Shown
from studio.photograph.plane import Plane
from studio.studio_state import History

LEFT_OUT, OTHER = (255, 120, 110), (255, 210, 90)
"""Colours of the names of photographs that are not used, and of those that are no flash frames."""


class NewSessionWindow(PhotographWindow):
    """What a browser begins sessions in. Its panels call `edit`, `measure` and `correct`."""

    area = "New session"
    first_tab = "Balls"
    is_flat = True

    def __init__(self, *place: Any) -> None:
        super().__init__(*place)
        self.looking = self.state.looking
        without = [files for files in self.looking.folders if not (files.folder / MANIFEST).exists()]
        self.files: FolderFiles = (without or self.looking.folders)[0]
        self.photograph: Path | None = None
        """The one that is shown; None: the mean of the flash frames."""
        self._is_taken = False

    def begin(self) -> None:
        """Look at the first folder that has no session yet."""
        self.open(self.files)

    @property
    def folder_look(self) -> Look | None:
        """The look at the folder; None: it has a session.toml."""
        return self.looking.looks.get(self.files.folder)

    @property
    def is_looking(self) -> bool:
        """Whether the folder is being looked at."""
        return self.folder_look is not None and not self.folder_look.is_over

    @property
    def found(self) -> FoundCapture | None:
        """The folder as it was found; None before it was looked at."""
        return self.folder_look.found if self.folder_look else None

    @property
    def history(self) -> History[Draft] | None:
        """The document with what was put right in it; None before the folder was looked at."""
        return self.state.captures.get(self.files.folder) if self.found else None

    def keep(self, history: History[Any]) -> None:
        """Keep what was put right."""
        self.state.captures[self.files.folder] = history

    @property
    def capture(self) -> Draft | None:
        """What would be written now, once the folder was looked at."""
        return self.history.state if self.history else None

    @property
    def seen(self) -> Draft | None:
        """The same, or what is known so far."""
        return self.capture or (self.folder_look.draft if self.folder_look else None)

    @property
    def balls(self) -> list[SphereTable]:
        """The balls, in the frames and shot apart."""
        return self.seen.manifest.spheres if self.seen else []

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

    @property
    def plane(self) -> Plane | None:
        """Where the photographs stand."""
        if self.seen is not None:
            return Plane(self.seen.width, self.seen.height)
        first = self.folder_look.first if self.folder_look and self.is_looking else None
        return None if first is None else Plane(first.shape[1], first.shape[0])

    @property
    def camera(self) -> Camera | None:
        """By which the outlines are drawn."""
        return None if self.seen is None else self.seen.assumed_camera

    def shown(self) -> Shown:
        """Return the photograph that is chosen, or the mean; while the folder is looked at, the first, with balls."""
        look, draft, found, photograph = self.folder_look, self.capture, self.found, self.photograph
        assert look is not None
        colours = tuple(COLOURS[ball.kind] for ball in self.outlines)
        if draft is None or found is None:
            return Shown((look.draft is None, lambda: first_picture(look)), colours=colours)
        roles = tuple(role_of(draft, path) for path in found.photographs)
        return Shown(
            ((self.reading, photograph), lambda: found.picture(photograph)),
            ((self.reading, roles), lambda: _strip(found, roles)),
            None if photograph is None else found.photographs.index(photograph),
            # One photograph is looked at as it is.
            (found.draft.small, found.exposure, found.draft.step) if photograph is None else None,
            colours,
        )

    def choose_small(self, index: int) -> None:
        """Look at a photograph; a second click goes back to all of them together."""
        assert self.found is not None
        path = self.found.photographs[index]
        self.choose(photograph=None if self.photograph == path else path, ball=None, looks=self.looks + 1)

    @property
    def text(self) -> str:
        """What would be written now, as session.toml has it."""
        return session_text(self.need(), "rgbn studio")

    @property
    def manifest(self) -> Path:
        """Where it is written."""
        return self.files.folder / MANIFEST

    def need(self) -> Draft:
        """Return the document. Raises SceneError: the folder was not looked at yet."""
        if self.capture is None:
            raise SceneError(f"{self.files.folder.name}: is still being looked at. Wait for it.")
        return self.capture

    def open(self, files: FolderFiles) -> None:
        """Look at a folder; what was put right in it, or in another one, is kept."""
        self.files, self.on_photograph, self._is_taken = files, None, False
        if self.manifest.exists():
            self.state.captures.pop(files.folder, None)
            self.looking.looks.pop(files.folder, None)
        else:
            self.looking.look_at(files)
        self.choose(ball=None, photograph=None, reading=self.reading + 1)
        self.look_again()

    def look_again(self) -> None:
        """Show how far the look is, and once what came of it."""
        super().look_again()
        look = self.folder_look
        if look is None or self._is_taken:
            return
        if look.is_over:
            self._is_taken = True
            if look.fault is not None:
                self.attempt(lambda: _raise(look.fault))
            elif look.found is not None and self.files.folder not in self.state.captures:
                self.keep(History(look.found.draft))
            self.reading += 1
        self.refresh()

    def edit(self, draft: Draft, label: str = "edit") -> None:
        """Take the document as it was edited."""
        self.alter(label, manifest=draft.manifest)

    def back_to_found(self) -> None:
        """Take the balls as they were found, with the diameters that are known of their kinds."""
        self.correct(tuple(ball for ball in self.need().found if ball.center_px), "balls as found")

    def write(self) -> None:
        """Write session.toml, once, and go on with the session.

        Raises SceneError: there is one already, what it would say cannot be read again, or the output folder would lie
        outside of the workspace.
        """
        draft, out = self.need(), self.out
        check_free(self.files)
        write_manifest(draft, self.text)
        self.state.captures.pop(self.files.folder, None)
        self.looking.looks.pop(self.files.folder, None)
        self.state.show_session(out, self.files.folder, tab="Verdict")
        self.turn()

    @property
    def out(self) -> Path:
        """The output folder, in the workspace."""
        return self.workspace.path(self.looking.out_of(self.files))

    def open_session(self) -> None:
        """Show the session that the folder has already."""
        self.state.show_session(self.out, self.files.folder)
        self.turn()


def _raise(fault: BaseException | None) -> None:
    if fault is not None:
        raise fault


def first_picture(look: Look) -> Image:
    """Return what is shown of a folder that is being looked at: its first photograph, then the mean."""
    if look.draft is not None:
        mean = mean_of(look.draft)
        return Exposure.for_picture(mean).develop(mean)
    assert look.first is not None
    return look.first


def _strip(found: FoundCapture, roles: tuple[str, ...]) -> PictureStrip:
    """Return the small photographs, each with its use; those that are not used are dim."""
    colours = {"flash": INK, UNUSED: LEFT_OUT}
    labels = [
        (path.stem if role == "flash" else f"{role}: {path.stem}", colours.get(role, OTHER))
        for path, role in zip(found.photographs, roles, strict=True)
    ]
    dimmed = [picture // (3 if role == UNUSED else 1) for picture, role in zip(found.thumbnails, roles, strict=True)]
    return PictureStrip.of(dimmed, labels)
