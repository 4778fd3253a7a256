"""What a path is, how it becomes what is worked on, and the area in which one is chosen.

A path is a folder of photographs, a session, an output folder, a scene or a model.
"""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

from capture.session.session import load_session
from capture.survey.folder_files import survey
from formats.meshes.scan_files import SUFFIXES as MESHES
from lab.many_sessions import sessions_below
from lab.session_place import MANIFEST, default_out, is_output, is_session, origin_of, session_and_out
from scene.errors import SceneError
from scene.origin import Origin
from scene.reading import reading
from studio.editor.editor_window import FILE, begun
from studio.editor.edits import added
from studio.studio_state import SCENE, Edits, History, StudioState
from studio.widgets import Row, button, code, text
from studio.window import Window
from studio.workspace import Workspace

Kind = Literal["results", "session", "scene", "model", "folder"]
MOST = 200
"""Entries of a folder that are listed."""
HERE = {"folder": "New session here", "session": "Open this session", "results": "Open these results"}
"""What is done with the folder itself, by what it is."""


def kind_of(path: Path) -> Kind | None:
    """Return what a path is; None: nothing that can be opened."""
    if path.is_dir():
        return "results" if is_output(path) else "session" if is_session(path) else "folder"
    if path.suffix.lower() in MESHES:
        return "model"
    return "scene" if path.suffix == ".toml" and path.name != MANIFEST else None


def entries(folder: Path) -> Iterator[tuple[Path, Kind]]:
    """Yield what a folder holds that can be opened, folders first; what is hidden, and links, are left out."""
    with reading(folder, do="Choose another folder."), os.scandir(folder) as found:
        paths = sorted((Path(one.path) for one in found if not one.name.startswith(".") and not one.is_symlink()),
                       key=lambda path: (path.is_file(), path.name))  # fmt: skip
    for path in paths[:MOST]:
        if kind := kind_of(path):
            yield path, kind


def open_path(state: StudioState, workspace: Workspace, source: Path, out: Path | None = None) -> None:
    """Make a path, whatever it is, what is worked on.

    out: Output folder of a session. Raises SceneError: it cannot be read, or lies outside of the workspace.
    """
    from twin.description.description_file import read_document
    from twin.description.object_mesh import read_mesh

    if not source.exists():
        # Given as the workspace knows it.
        source = workspace.root / source
    kind = kind_of(source)
    if kind == "folder" and sessions_below(source):
        state.area, state.folder = "Open", workspace.path(source.resolve())
    elif kind == "folder":
        folders = survey(source)
        if out is not None and len(folders) > 1:
            raise SceneError(f"--out {out}: there are {len(folders)} objects, each with a folder of its own: out/NAME.")
        origin = Origin("session", folders[0].folder, tuple(folders[0].by_role["flash"]))
        place = out or default_out(origin, folders[0].folder.name, workspace.root / "out")
        state.show_session(workspace.path(place.resolve()), source.resolve())
    elif source.is_dir() or source.name == MANIFEST:
        is_own = kind == "results" and (out is None or out.resolve() == source.resolve())
        # Results can be looked at without their session.
        session, place = (None, source) if is_own else session_and_out(source, out)
        place = place.resolve()
        if out is None and not is_own and not place.is_relative_to(workspace.root):
            found = load_session(source)
            place = default_out(origin_of(found, source), found.name, workspace.root / "out")
        state.show_session(workspace.path(place), session)
    elif source.suffix == ".toml":
        path = workspace.path(source.resolve())
        opened = begun(workspace, read_document(path), path.parent if path.name == FILE else None)
        _change_scene(state, f"open {path.stem}", opened)
    elif kind == "model":
        path = workspace.path(source.resolve())
        scene = (state.edits.get(SCENE) or begun(workspace, None, None)).history.state
        more = added(scene.document, path.stem, mesh=read_mesh(path))
        _change_scene(state, f"load {path.stem}", Edits(History(replace(scene, document=more))))
    else:
        raise SceneError(
            f"{source}: neither a folder nor a model or scene description, .toml. Give photographs, a session or its "
            "output folder."
        )


def _change_scene(state: StudioState, label: str, scene: Edits) -> None:
    """Go to a scene; what was made before can be taken back to."""
    if known := state.edits.get(SCENE):
        known.history = known.history.did(label, scene.history.state, 0.0)
    state.edits.setdefault(SCENE, scene)
    state.area = "Scene"


class OpenWindow(Window):
    """What a browser opens things in: folders below the workspace."""

    area = "Open"

    @property
    def folder(self) -> Path:
        """The one that is looked into."""
        return self.state.folder or self.workspace.root

    def look_into(self, folder: Path) -> None:
        """Show another folder of the workspace."""
        self.state.folder = self.workspace.path(folder)
        self.refresh()

    def open(self, path: Path) -> None:
        """Open something in the area that is for it."""
        open_path(self.state, self.workspace, self.workspace.path(path))
        self.turn()


def _entry_rows(window: OpenWindow) -> list[Row]:
    def row(path: Path, kind: Kind) -> Row:
        if kind == "folder":
            return button(f"{path.name}/", lambda window: window.look_into(path))
        return button(f"{path.name}: {kind}", lambda window: window.open(path))

    return [row(*one) for one in entries(window.folder)] or [text("Nothing that can be opened.")]


OPEN_ROWS = (
    text(lambda window: f"{code(str(window.folder))}\n\nChoose a folder of photographs, a session, its output folder, "
         "or a scene."),
    button("One folder up", lambda window: window.look_into(window.folder.parent),
           lambda window: {"visible": window.folder != window.workspace.root}),
    button(HERE["folder"], lambda window: window.open(window.folder),
           lambda window: {"label": HERE[kind_of(window.folder) or "folder"]}, kind="main"),
    button("New scene", lambda window: window.go("Scene")),
    Row("folder", "In this folder", rows=_entry_rows, key=lambda window: tuple(entries(window.folder))),
)  # fmt: skip
"""What is to be done with the folder itself, and the folders and scenes in it."""
