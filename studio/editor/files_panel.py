"""The panel of the files: open, save, undo; export for Mitsuba, render here with a progress bar and a stop button."""

from dataclasses import replace
from pathlib import Path

from scene.errors import SceneError
from studio.editor.desk import Desk
from studio.editor.edits import start_scene
from studio.editor.history import Document
from studio.editor.rendering import Progress, Rendering
from studio.markdown import code, plain
from studio.own_files import put_own

NONE = "(no scene in the workspace)"
FILE = "scene.toml"


class FilesPanel:
    """What goes to the disk and comes from it; all in the workspace."""

    def __init__(self, desk: Desk) -> None:
        self._desk, gui = desk, desk.client.gui
        self._rendering: Rendering | None = None
        with gui.add_folder("Scene"):
            self._undo = desk.on_click(gui.add_button("Undo"), desk.undo)
            self._redo = desk.on_click(gui.add_button("Redo"), desk.redo)
            self._document = desk.history.document
            self._name = gui.add_text("name", self._document.name, hint="Folder in the workspace")
            desk.on_click(gui.add_button("Save scene"), self._save_aloud)
            self._file = gui.add_dropdown("scene", (NONE,))
            desk.on_click(gui.add_button("Open scene"), self._open)
            desk.on_click(gui.add_button("New scene"), self._new)
            desk.on_click(gui.add_button("Look for files again"), self._look)
        with gui.add_folder("Dataset"):
            desk.on_click(gui.add_button("Export for Mitsuba"), self._export)
            self._render = desk.on_click(gui.add_button("Render dataset", color="green"), self._start)
            self._stop = desk.on_click(gui.add_button("Stop", color="red", disabled=True), self._halt)
            self._bar = gui.add_progress_bar(0, visible=False)
            self._status = gui.add_markdown("")
        desk.on_close(self._close)

    def refresh(self) -> None:
        """Show what can be taken back, where the scene is saved to, and what can be opened."""
        history = self._desk.history
        if history.document is not self._document:
            self._document, self._name.value = history.document, history.document.name
        self._file.options = self._desk.listing.scenes or (NONE,)
        self._undo.disabled, self._redo.disabled = not history.past, not history.future
        self._undo.label = f"Undo: {history.past[-1][0]}" if history.past else "Undo"
        self._redo.label = f"Redo: {history.future[0][0]}" if history.future else "Redo"

    def _look(self) -> None:
        self._desk.list_files()
        self._desk.refresh()

    def _save(self) -> Path:
        """Write the scene into its folder, and return the description's path."""
        from twin.description.description_check import check_scene
        from twin.description.description_writer import write_scene

        desk, document, name = self._desk, self._desk.history.document, self._name.value
        own = document.folder
        # The workspace itself may be a scene's folder only where the scene was opened from there.
        folder = own if own and name.strip() == desk.workspace.name(own) else desk.workspace.folder_for(name)
        if (folder / FILE).exists() and folder != own:
            raise SceneError(f"{name}: holds another scene already. Open that first, or choose another name.")
        scene = replace(desk.scene, name=desk.scene.name if folder == desk.workspace.root else folder.name)
        check_scene(scene)
        put_own(desk.workspace.closed(folder), lambda place: write_scene(scene, place))
        document.name, document.folder = name, folder
        self._look()
        return folder / FILE

    def _save_aloud(self) -> None:
        self._desk.tell("Saved", self._desk.workspace.name(self._save()))

    def _open(self) -> None:
        from twin.description.description_file import read_scene

        if self._file.value == NONE:
            self._look()
            return
        path = self._desk.workspace.description(self._file.value)
        scene = read_scene(path)
        # Another file than the studio's own is not written over.
        own = path.name == FILE
        name = self._desk.workspace.name(path.parent if own else path.with_suffix(""))
        self._desk.restart(f"open {name}", scene, Document(name, path.parent if own else None))

    def _new(self) -> None:
        scene = start_scene()
        self._desk.restart("new scene", scene, Document(scene.name))

    def _export(self) -> None:
        from twin.engines.mitsuba_files import write_mitsuba

        path = self._save()
        out, scene = path.parent / "export", self._desk.scene
        paths, notes = put_own(out, lambda place: write_mitsuba(scene, place))
        first = self._desk.scene.lights.names[0]
        command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr scene.xml"
        where = self._desk.workspace.name(out)
        lines = [f"Exported {len(paths) - 1} lights to {code(where)}.", code(command), *map(plain, notes)]
        self._status.content = "\n\n".join(lines)

    def _start(self) -> None:
        if self._rendering is not None:
            raise SceneError("a dataset is being rendered. Stop it first, or wait.")
        path = self._save()
        out = path.parent / "dataset"
        where = self._desk.workspace.name(out)
        self._bar.value, self._bar.visible, self._stop.disabled, self._render.disabled = 0, True, False, True
        self._status.content = f"Rendering {len(self._desk.scene.lights)} frames into {code(where)} ..."
        post = self._desk.post
        self._rendering = Rendering(
            path,
            out,
            lambda progress: post(lambda: self._tell(progress)),
            lambda fault: post(lambda: self._end(fault, where)),
        )

    def _tell(self, progress: Progress) -> None:
        if self._rendering is None:
            return
        if progress.total:
            self._bar.value = 100 * progress.done / progress.total
            self._status.content = plain(f"{progress.label}: {progress.done} of {progress.total}")
        else:
            self._status.content = plain(progress.label)

    def _end(self, fault: str, where: str) -> None:
        self._idle()
        if fault:
            self._status.content = "Not rendered."
            self._desk.tell_fault(fault)
        else:
            self._status.content = f"Rendered into {code(where)}. Solve it with {code(f'rgbn process {where}')}."
            self._desk.tell("Rendered", where)
            self._look()

    def _halt(self) -> None:
        if self._rendering is not None:
            self._rendering.stop()
            self._idle()
            self._status.content = "Stopped. What was rendered is kept; **Render dataset** goes on from there."

    def _idle(self) -> None:
        self._rendering = None
        self._bar.visible, self._stop.disabled, self._render.disabled = False, True, False

    def _close(self) -> None:
        if self._rendering is not None:
            self._rendering.stop()
