"""The window of a session that is begun: the document that is to be written, as it is put right."""

from pathlib import Path
from typing import Any

from scene.errors import SceneError
from shoot.init.contact_sheet import COLOURS
from shoot.init.draft import Draft
from shoot.init.init_session import check_free, write_manifest
from shoot.init.session_text import session_text
from studio.session.looking import FolderLook, role_of
from studio.session.photograph_window import Balls, PhotographWindow, Shown
from studio.session.plane import Plane
from studio.studio_state import Edits, History


class DraftWindow(PhotographWindow):
    """What a browser begins sessions in: what is put right is a `Draft`. A frame of -1 is the mean of the flash frames.

    place: The folder that is looked at, among the state's `looks`.
    """

    page, first_tab = "Draft", "Balls"
    place: Path

    def __init__(self, *window: Any) -> None:
        super().__init__(*window)
        self.frame, self.edited, self._is_shown = -1, self.place, False

    @property
    def taken(self) -> FolderLook:
        """The look at the folder."""
        return self.state.looks[self.place]

    def begin(self) -> None:
        """Look at the folder."""
        self.taken.begin()

    def follow(self) -> bool:
        """Take what came of the look, once; until then it is shown how far it is."""
        look, was_shown = self.taken, self._is_shown
        if look.is_over and not was_shown:
            self._is_shown = True
            self.reading += 1
            if look.fault is not None:
                self.show_fault(str(look.fault))
            elif self.edits is None:
                self.state.edits[self.place] = Edits(History(look.draft), look.draft)
        return not was_shown

    @property
    def draft(self) -> Draft | None:
        """What would be written now, once the folder was looked at."""
        return self.history.state if self.history else None

    def need(self) -> Draft:
        """Return the document. Raises SceneError: the folder was not looked at yet."""
        if self.draft is None:
            raise SceneError(f"{self.place.name}: is still being looked at. Wait for it.")
        return self.draft

    @property
    def balls(self) -> Balls:
        """The balls that are known so far, in the frames and shot apart."""
        draft = self.draft or self.taken.draft
        return draft.balls if draft else ()

    @property
    def photograph(self) -> Path | None:
        """The photograph that is shown; None: the mean of the flash frames."""
        return list(self.taken.small)[self.frame] if 0 <= self.frame < len(self.taken.small) else None

    def choose_small(self, index: int) -> None:
        """Look at a photograph; a second click goes back to all of them together."""
        self.choose(frame=-1 if self.frame == index else index, ball=None, looks=self.looks + 1)

    def shown(self) -> Shown | None:
        """Return the photograph that is chosen, or the mean; while the folder is looked at, the first, with balls."""
        look, draft, photograph = self.taken, self.draft or self.taken.draft, self.photograph
        if draft is None:
            first = None if look.is_over else look.first
            return None if first is None else Shown(Plane(*first.shape[1::-1]), None, ("first", lambda: first))
        plane, colours = Plane(draft.width, draft.height), tuple(COLOURS[ball.kind] for ball in self.outlines)
        picture = ((self.reading, photograph), lambda: look.picture(photograph))
        if self.draft is None:
            return Shown(plane, draft.assumed_camera, picture, colours=colours)
        roles = tuple(role_of(draft, path) for path in look.small)
        # One photograph is looked at as it is.
        crop = (draft.small, look.exposure, draft.step) if photograph is None else None
        strip, chosen = ((self.reading, roles), lambda: look.strip(roles)), None if crop else self.frame
        return Shown(plane, draft.assumed_camera, picture, strip, chosen, crop, colours)

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
        # Photographs are hundreds of megabytes.
        self.state.looks[self.place] = FolderLook(self.taken.files, self.taken.out)
        del self.state.edits[self.place]
        self.state.show_session(out, self.place, tab="Verdict")
        self.turn()
