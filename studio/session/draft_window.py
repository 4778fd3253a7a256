"""The window of a session that is begun, and its rows: the document that is to be written, as it is put right."""

import re
from pathlib import Path
from typing import Any

from capture.session.manifest import TABLES
from capture.survey.folder_files import name_of
from lab.session_place import MANIFEST
from scene.errors import SceneError
from shoot.init.draft import ROLES, Draft
from shoot.init.init_session import check_free, write_manifest
from shoot.init.session_text import facts_of, notes_of, session_text
from studio.session.ball_rows import BALL_ROWS, MILLIMETRES, OBJECT
from studio.session.looking import BOARD, UNUSED, FolderLook, role_of, with_role
from studio.session.photograph_window import Balls, PhotographWindow, Shown
from studio.session.plane import Plane
from studio.studio_state import Edits, History
from studio.tabs import tab_rows
from studio.widgets import Row, button, code, fenced, plain, text

MEAN = "(mean of the flash frames)"
NONE = "(none)"
USUAL = "(mm; m for GLB)"
COLOURS = {"chrome": (90, 220, 255), "white": (255, 190, 60)}
FILES = {"object.scan": "scans", "object.mask": "masks", "object.normals": "normals", "lights.file": "lights"}
"""Keys that name files, and which of the folder's."""


class DraftWindow(PhotographWindow):
    """What a browser begins sessions in: what is put right is a `Draft`. A frame of -1 is the mean of the flash frames.

    place, taken: The folder that is looked at, among the state's `looks`, and the look.
    """

    page, first_tab = "Draft", "Balls"
    place: Path

    def __init__(self, *window: Any) -> None:
        super().__init__(*window)
        self.frame, self.edited, self._is_shown = -1, self.place, False
        self.taken: FolderLook = self.state.looks[self.place]

    def begin(self) -> None:
        """Look at the folder."""
        self.taken.begin()
        self.follow()

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
    def ball_facts(self) -> str:
        """What is known of the chosen ball, or of all, as Markdown."""
        draft, balls = self.draft, self.outlines
        if draft is None:
            return ""
        if self.ball is None:
            apart = [f" The {ball.kind} ball has photographs of its own." for ball in self.balls if ball.frames]
            return f"Is every ball circled, and nothing else? {len(balls)} circles.{''.join(apart)}"
        ball = balls[self.ball]
        number = next(number for number, one in enumerate(self.balls) if one is ball)
        given = draft.written.spheres[number].center_px
        return (
            f"{'As found' if self.is_found(ball) else 'Placed by hand'}. session.toml gives "
            f"{'its circle' if given else 'no circle: the ball is looked for again'}."
        )

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
        for place in (self.place, self.folder):
            self.state.edits.pop(place, None)
        self.state.show_session(out, self.place, tab="Verdict")
        self.turn()


def _found(window: DraftWindow) -> str:
    """Return what was found, or what is looked for, as Markdown."""
    draft, lines = window.draft, [code(str(window.place)), ""]
    if draft is None:
        return "\n".join([*lines, f"**{plain(window.taken.told)}**"])
    # No table: its first column would be as wide as the longest key, and the panel is narrow.
    lines += [f"- **{plain(what)}**: {plain(told)}" for what, told in facts_of(draft)]
    count = len(notes_of(draft))
    notes = f"⚠ {count} missing or assumed: see **session.toml**." if count else "Nothing is missing, nothing assumed."
    return "\n".join([*lines, "", notes])


def _photographs(window: DraftWindow) -> tuple[str, ...]:
    return MEAN, *(name_of(path, window.place) for path in window.taken.small)


def _use(window: DraftWindow, role: str) -> None:
    if window.photograph is not None:
        window.alter("use", with_role(window.need(), window.taken.small, window.photograph, role))


def _key(path: str) -> Row:
    """Return the input of a key of session.toml, as in camera.focal_mm, made from its declaration.

    It is a number, 0 where it is not said; a checkbox; or a choice.
    """
    table, key = path.split(".")
    schema = TABLES[table].model_json_schema()["properties"][key]
    declared, start = schema.get("anyOf", [schema])[0], {"hint": schema["description"]}
    widget, nothing = {"boolean": ("checkbox", False), "number": ("number", 0.0)}.get(
        declared["type"], ("dropdown", USUAL if "enum" in declared else NONE)
    )
    start |= {"checkbox": {"value": False}, "number": MILLIMETRES, "dropdown": {"options": (nothing,)}}[widget]

    def show(window: DraftWindow) -> dict[str, Any]:
        draft = window.draft
        said = getattr(draft.manifest, table) if draft else None
        value = getattr(said, key) if said is not None and key in said.model_fields_set else None
        shown: dict[str, Any] = {"value": nothing if value is None else value}
        if widget == "dropdown":
            paths = getattr(window.taken.files, FILES[path]) if path in FILES else ()
            names = (name_of(one, window.place) for one in paths)
            shown = {"options": (nothing, *declared.get("enum", names))} | shown
        # How values are coded is a question of some kinds of files only.
        return shown | ({"visible": value is not None} if widget == "checkbox" else {})

    def use(window: DraftWindow, value: Any) -> None:
        said = None if widget != "checkbox" and value == nothing else value
        window.alter(key, window.need().saying(table, **{key: said}))

    return Row(widget, key, show, use, start)


def _where(window: DraftWindow) -> str:
    if window.draft is None:
        return ""
    return (
        f"Writes {code(str(window.place / MANIFEST))}. Results go to {code(window.workspace.name(window.taken.out))}."
    )


TABS = {
    "Balls": BALL_ROWS,
    "Photographs": (
        text("Click a photograph in the strip below the large one; a second click shows the mean again. One that is "
             "not to be used, because somebody walked by or the flash failed: choose *not used*."),
        Row("dropdown", "photograph",
            lambda window: {"options": _photographs(window), "value": _photographs(window)[window.frame + 1]},
            lambda window, name: window.choose(frame=_photographs(window).index(name) - 1, ball=None),
            {"options": (MEAN,)}),
        Row("dropdown", "used for", lambda window: {"disabled": True} if window.photograph is None else {
            "disabled": False, "value": role_of(window.need(), window.photograph)}, _use,
            {"options": (*ROLES, BOARD, UNUSED), "disabled": True}),
    ),
    "Camera": (
        *(_key(f"camera.{key}") for key in ("focal_mm", "sensor_mm", "pixel_um", "crop_factor")),
        text("0: as the photographs say. Shots of a ChArUco board or a chessboard measure all of it."),
    ),
    "Object": tuple(map(_key, ("object.scan", "object.scan_unit", "object.mask", "object.normals", "lights.file",
                               "frames.linear", "object.tolerance_deg"))),
    # The columns of comments would be cut off here.
    "session.toml": (text(lambda window: fenced(
        re.sub(r"(?<=\S) {2,}#", "  #", window.text), "toml") if window.draft else ""),),
}  # fmt: skip
DRAFT_ROWS = (
    OBJECT,
    text(_found),
    Row("progress_bar", start={"value": 0, "visible": False, "animated": True}, show=lambda window: {
        "visible": not window.taken.is_over, "value": 100 * window.taken.done / window.taken.total}),
    *tab_rows(TABS, when=lambda window: window.draft is not None),
    button("Write session", lambda window: window.write(), lambda window: {"visible": window.draft is not None},
           kind="main", visible=False),
    text(_where),
)  # fmt: skip
