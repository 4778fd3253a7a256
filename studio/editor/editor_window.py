"""The window of a scene: the scene with its past, to be undone, what is selected, and its files in the workspace."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scene.current import file_digest
from scene.errors import SceneError
from studio.editor.edits import start_document
from studio.editor.preview import Drawn, Preview
from studio.studio_state import SCENE, Edits, History, RunningJob, StudioState
from studio.widgets import code, plain
from studio.window import Window
from studio.workspace import Workspace, put_own
from twin.description.description import TwinScene
from twin.description.scene_toml import SceneDocument

Edit = Callable[[SceneDocument], SceneDocument]
FILE = "scene.toml"


@dataclass(eq=False)
class Saved:
    """What a row of documents is saved as: those that were made of each other by changes share it.

    name: What the browser calls the folder that it is to be saved to.
    folder: Where it was opened from, or saved to last; None: nowhere yet.
    digest: Of its file as it was then: somebody else may have saved since.
    """

    name: str = "scene"
    folder: Path | None = None
    digest: str | None = None


@dataclass(frozen=True)
class Edited:
    """A document, and what it is saved as."""

    document: SceneDocument
    saved: Saved


def begun(workspace: Workspace, document: SceneDocument | None, folder: Path | None) -> Edits:
    """Return the history of a document, None: a new one, without a past; `folder` is where it was opened from."""
    document, digest = document or start_document(), None if folder is None else file_digest(folder / FILE)
    name = workspace.name(folder) if folder else document.name or "scene"
    return Edits(History(Edited(document, Saved(name, folder, digest))))


class EditorWindow(Window):
    """What a browser makes a scene on. Its panels call `change`; whatever changed, all panels are refreshed."""

    area, edited = "Scene", SCENE
    first_tab = "Objects"

    def __init__(self, client: Any, workspace: Workspace, state: StudioState, preview: Preview) -> None:
        super().__init__(client, workspace, state)
        state.edits.setdefault(SCENE, begun(workspace, None, None))
        self._preview, self._asked = preview, None
        # The one that was added last.
        self.object, self.light = len(self.document.objects) - 1, 0
        self._scene = self.document, self.document.scene()
        self.gain, self.drawn = 1.0, None
        """Brightness of the preview, and what was drawn last."""
        self.drawn: Drawn | None
        self.show_preview: Callable[[Drawn], None] = lambda drawn: None
        self.chosen: dict[str, str] = {}
        """What is chosen or typed for a button to take, by what it is for."""
        self.size_in_proportion = True
        """One side that is typed changes the others too."""

    @property
    def _made(self) -> Edited:
        return self.state.edits[SCENE].history.state

    @property
    def document(self) -> SceneDocument:
        """What is edited."""
        return self._made.document

    @property
    def saved(self) -> Saved:
        """What it is saved as."""
        return self._made.saved

    @property
    def scene(self) -> TwinScene:
        """What the document says."""
        if self._scene[0] is not self.document:
            self._scene = self.document, self.document.scene()
        return self._scene[1]

    @property
    def names(self) -> tuple[str, ...]:
        """The objects' names, which begin with their numbers: two objects of a file may have one name."""
        return tuple(f"{index + 1} {one.name}" for index, one in enumerate(self.scene.objects))

    def change(self, label: str, edit: Edit) -> None:
        """Make the document another one, where it can be. A fault is told, and the document stays."""
        self.attempt(lambda: self._do(label, replace(self._made, document=edit(self.document))))
        # What could not be done is taken out of the input that asked for it.
        self.refresh()

    def drag(self, edit: Edit) -> None:
        """Show in the preview what the scene would be; nothing is kept of it."""
        self.attempt(lambda: self._request(edit(self.document).scene()))

    def start_again(self) -> None:
        """Work on a new document. It can be taken back as any change can."""
        self.object, self.light = 0, 0
        self._do("new scene", Edited(start_document(), Saved()))
        self.refresh()

    def _do(self, label: str, state: Edited) -> None:
        # Raises where the document says no scene.
        self._scene = state.document, state.document.scene()
        self.did(label, state)

    def select(self, what: str, index: int) -> None:
        """Look at another one: `what` is "object", which has the gizmo then, or "light"."""
        setattr(self, what, index)
        self.refresh()

    def on_upload(self, handle: Any, use: Callable[[str], Any]) -> Any:
        """Keep a file that was sent in the workspace, and call `use` with its name there. Return the handle."""

        async def _(event: Any) -> None:
            # The button would keep the content until the next file comes.
            name, content = event.target.value.name, event.target.value.content
            event.target.value.content = b""
            self.post(lambda: use(self.workspace.keep_upload(name, content)))

        handle.on_upload(_)
        return handle

    def _refresh_panels(self) -> None:
        self.object = min(self.object, len(self.document.objects) - 1)
        self.light = min(self.light, len(self.scene.lights) - 1)
        with self.client.atomic():
            super()._refresh_panels()
        self._request(self.scene)

    def _request(self, scene: TwinScene) -> None:
        """Have a scene drawn, unless it is the one that was asked for last."""
        light = min(self.light, len(scene.lights) - 1)
        if not self.is_gone and self._asked != (id(scene), light):
            self._asked = id(scene), light
            self._preview.request(scene, light, lambda drawn: self.post(lambda: self.show_preview(drawn)))

    def save(self) -> Path:
        """Write the scene into its folder, and return the description's path."""
        from twin.description.description_check import check_scene
        from twin.description.description_file import write_document

        saved, document = self.saved, self.document
        name, own = saved.name, saved.folder
        # The workspace itself may be a scene's folder only where the scene was opened from there.
        folder = own if own and name.strip() == self.workspace.name(own) else self.workspace.folder_for(name)
        if (folder / FILE).exists() and folder != own:
            raise SceneError(f"{name}: holds another scene already. Open that first, or choose another name.")
        if folder == own and saved.digest != file_digest(folder / FILE):
            raise SceneError(
                f"{name}: was saved elsewhere, or removed, since it was opened here. Save under another name, or open "
                "it again."
            )
        if folder != self.workspace.root:
            document = document.model_copy(update={"name": folder.name})
        check_scene(self.scene)
        put_own(folder, lambda place: write_document(document, place))
        saved.folder, saved.digest = folder, file_digest(folder / FILE)
        self.refresh()
        return folder / FILE

    def export(self) -> None:
        """Save the scene, and write it as Mitsuba's files."""
        from twin.engines.mitsuba_files import write_mitsuba

        out = self.workspace.path(self.save().parent / "export")
        paths, notes = put_own(out, lambda place: write_mitsuba(self.scene, place))
        first = self.scene.lights.names[0]
        command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr scene.xml"
        told = f"Exported {len(paths) - 1} lights to {code(self.workspace.name(out))}."
        self.state.work = None if self.work and self.work.is_over else self.state.work
        self.work_told = "\n\n".join([told, code(command), *map(plain, notes)])
        self.refresh()

    @property
    def dataset(self) -> Path:
        """Where the scene's dataset is rendered to."""
        return (self.saved.folder or self.workspace.root / "not saved yet") / "dataset"

    def job(self) -> RunningJob:
        """Render the scene, which is saved first; solving comes first once that is done."""

        def words() -> list[str]:
            path = self.save()
            return ["twin", str(path), "--out", str(path.parent / "dataset")]

        return RunningJob("Render dataset", self.dataset, words, is_main=not self.dataset.is_dir())

    def work_ended(self) -> None:
        """Say where the dataset is."""
        where = self.workspace.name(self.dataset)
        self.work_told = f"Rendered into {code(where)}, a session. **Solve** opens it."
        self.notify("Rendered", where)

    def solve(self) -> None:
        """Go to the dataset as a session."""
        out = self.workspace.path(self.dataset.parent / "results")
        self.state.show_session(out, self.dataset, tab="Verdict")
        self.turn()
