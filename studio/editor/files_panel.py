"""The panel of the files: save; export for Mitsuba, render with a progress bar and a stop button, solve."""

from pathlib import Path

from scene.current import file_digest
from scene.errors import SceneError
from studio.editor.editor_window import FILE, EditorWindow, Saved
from studio.editor.edits import start_document
from studio.own_files import put_own
from studio.widgets import code, plain
from studio.work_buttons import WorkButtons


class FilesPanel:
    """What goes to the disk and comes from it; all in the workspace."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        with gui.add_folder("Scene"):
            self._saved = window.history.state.saved
            self._name = gui.add_text("name", self._saved.name, hint="Folder in the workspace")
            window.button("Save scene", lambda: window.notify("Saved", window.workspace.name(self._save())))
            window.button("New scene", self._new)
            window.button("Look for files again", self._look)
        with gui.add_folder("Dataset"):
            window.button("Export for Mitsuba", self._export)
            self._work = WorkButtons(window, "Render dataset", lambda: self._dataset, self._render, self._rendered)
            self._solve = window.button("Solve", self._to_session, kind="main", visible=False)

    def refresh(self) -> None:
        """Show where the scene is saved to, and whether it is rendered."""
        saved = self._window.history.state.saved
        if saved is not self._saved:
            self._saved, self._name.value = saved, saved.name
        is_made = self._dataset.is_dir() and not self._work.is_busy
        self._work.refresh("Render dataset", is_main=not is_made)
        self._solve.visible = is_made

    @property
    def _dataset(self) -> Path:
        """Where the scene's dataset is rendered to."""
        folder = self._window.history.state.saved.folder
        return (folder or self._window.workspace.root / "not saved yet") / "dataset"

    def _look(self) -> None:
        self._window.list_files()
        self._window.refresh()

    def _save(self) -> Path:
        """Write the scene into its folder, and return the description's path."""
        from twin.description.description_check import check_scene
        from twin.description.description_file import write_document

        window, saved, name = self._window, self._window.history.state.saved, self._name.value
        own = saved.folder
        # The workspace itself may be a scene's folder only where the scene was opened from there.
        folder = own if own and name.strip() == window.workspace.name(own) else window.workspace.folder_for(name)
        if (folder / FILE).exists() and folder != own:
            raise SceneError(f"{name}: holds another scene already. Open that first, or choose another name.")
        if folder == own and saved.digest != file_digest(folder / FILE):
            raise SceneError(
                f"{name}: was saved elsewhere, or removed, since it was opened here. Save under another name, or open "
                "it again."
            )
        document = window.document
        if folder != window.workspace.root:
            document = document.model_copy(update={"name": folder.name})
        check_scene(window.scene)
        put_own(folder, lambda place: write_document(document, place))
        saved.name, saved.folder, saved.digest = name, folder, file_digest(folder / FILE)
        self._look()
        return folder / FILE

    def _new(self) -> None:
        self._window.restart("new scene", start_document(), Saved())

    def _export(self) -> None:
        from twin.engines.mitsuba_files import write_mitsuba

        path = self._save()
        out, scene = self._window.workspace.path(path.parent / "export"), self._window.scene
        paths, notes = put_own(out, lambda place: write_mitsuba(scene, place))
        first = self._window.scene.lights.names[0]
        command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr scene.xml"
        where = self._window.workspace.name(out)
        lines = [f"Exported {len(paths) - 1} lights to {code(where)}.", code(command), *map(plain, notes)]
        self._work.text.content = "\n\n".join(lines)

    def _render(self) -> list[str]:
        path = self._save()
        return ["-m", "studio.studio_run", "render", str(path), str(path.parent / "dataset")]

    def _rendered(self) -> None:
        where = self._window.workspace.name(self._dataset)
        self._work.text.content = f"Rendered into {code(where)}, a session. **Solve** goes the whole way to its report."
        self._window.notify("Rendered", where)
        self._look()

    def _to_session(self) -> None:
        """Go to the dataset as a session, and begin the steps."""
        window, dataset = self._window, self._dataset
        out = window.workspace.path(dataset.parent / "results")
        window.desk.show_session(out, dataset, tab="Verdict", run="compare")
        window.turn()
