"""The panel of the files: open, save, undo; export for Mitsuba, render here with a progress bar and a stop button."""

from dataclasses import replace
from pathlib import Path

from scene.errors import SceneError
from studio.background_process import WorkButtons
from studio.editor.editor_window import Document, EditorWindow
from studio.editor.edits import start_scene
from studio.own_files import put_own
from studio.widgets import code, plain

NONE = "(no scene in the workspace)"
FILE = "scene.toml"


class FilesPanel:
    """What goes to the disk and comes from it; all in the workspace."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        with gui.add_folder("Scene"):
            self._undo = window.button("Undo", window.undo)
            self._redo = window.button("Redo", window.redo)
            self._document = window.history.document
            self._name = gui.add_text("name", self._document.name, hint="Folder in the workspace")
            window.button("Save scene", lambda: window.notify("Saved", window.workspace.name(self._save())))
            self._file = gui.add_dropdown("scene", (NONE,))
            window.button("Open scene", self._open)
            window.button("New scene", self._new)
            window.button("Look for files again", self._look)
        with gui.add_folder("Dataset"):
            window.button("Export for Mitsuba", self._export)
            self._work = WorkButtons(window, {"Render dataset": self._render}, self._rendered)

    def refresh(self) -> None:
        """Show what can be taken back, where the scene is saved to, and what can be opened."""
        history = self._window.history
        if history.document is not self._document:
            self._document, self._name.value = history.document, history.document.name
        self._file.options = self._window.listing.scenes or (NONE,)
        self._undo.disabled, self._redo.disabled = not history.past, not history.future
        self._undo.label = f"Undo: {history.past[-1][0]}" if history.past else "Undo"
        self._redo.label = f"Redo: {history.future[0][0]}" if history.future else "Redo"

    def _look(self) -> None:
        self._window.list_files()
        self._window.refresh()

    def _save(self) -> Path:
        """Write the scene into its folder, and return the description's path."""
        from twin.description.description_check import check_scene
        from twin.description.description_writer import write_scene

        window, document, name = self._window, self._window.history.document, self._name.value
        own = document.folder
        # The workspace itself may be a scene's folder only where the scene was opened from there.
        folder = own if own and name.strip() == window.workspace.name(own) else window.workspace.folder_for(name)
        if (folder / FILE).exists() and folder != own:
            raise SceneError(f"{name}: holds another scene already. Open that first, or choose another name.")
        scene = replace(window.scene, name=window.scene.name if folder == window.workspace.root else folder.name)
        check_scene(scene)
        put_own(window.workspace.closed(folder), lambda place: write_scene(scene, place))
        document.name, document.folder = name, folder
        self._look()
        return folder / FILE

    def _open(self) -> None:
        from twin.description.description_file import read_scene

        if self._file.value == NONE:
            self._look()
            return
        path = self._window.workspace.description(self._file.value)
        scene = read_scene(path)
        # Another file than the studio's own is not written over.
        own = path.name == FILE
        name = self._window.workspace.name(path.parent if own else path.with_suffix(""))
        self._window.restart(f"open {name}", scene, Document(name, path.parent if own else None))

    def _new(self) -> None:
        scene = start_scene()
        self._window.restart("new scene", scene, Document(scene.name))

    def _export(self) -> None:
        from twin.engines.mitsuba_files import write_mitsuba

        path = self._save()
        out, scene = path.parent / "export", self._window.scene
        paths, notes = put_own(out, lambda place: write_mitsuba(scene, place))
        first = self._window.scene.lights.names[0]
        command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr scene.xml"
        where = self._window.workspace.name(out)
        lines = [f"Exported {len(paths) - 1} lights to {code(where)}.", code(command), *map(plain, notes)]
        self._work.text.content = "\n\n".join(lines)

    def _render(self) -> list[str]:
        path = self._save()
        self._out = path.parent / "dataset"
        return ["-m", "studio.editor.rendering", str(path), str(self._out)]

    def _rendered(self) -> None:
        where = self._window.workspace.name(self._out)
        self._work.text.content = f"Rendered into {code(where)}. Solve it with {code(f'rgbn process {where}')}."
        self._window.notify("Rendered", where)
        self._look()
