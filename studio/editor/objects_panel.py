"""The panel of the objects: load, choose, move, turn, scale by numbers, remove; of what each is made."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from studio.editor import edits
from studio.editor.editor_window import EditorWindow
from studio.editor.placement import placement_of
from studio.widgets import Inputs
from studio.workspace import MESHES
from twin.description.description import TwinScene
from twin.description.object_mesh import SHAPES, ObjectMesh, built_in

NONE = "(no file in the workspace)"
LABELS = {"middle_mm": "place", "rotate_deg": "turn", "scale": "scale"}
"""Of the changes in the past, by the fields of `Placement`."""


class ObjectsPanel:
    """Numbers of the object that is selected."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        self._place = Inputs(window, self._change_place)
        with gui.add_folder("Add an object"):
            self._file = gui.add_dropdown("model", (NONE,), hint="Models in the workspace")
            window.button("Load model", self._load, kind="main")
            upload = gui.add_upload_button("Send a model from here", color="gray", mime_type=",".join(MESHES))
            window.on_upload(upload, self._load_file)
            self._shape = gui.add_dropdown("shape", SHAPES)
            window.button("Add shape", self._add_shape)
        with gui.add_folder("Object"):
            self._object = gui.add_dropdown("object", ("sphere",), hint="Or click it in the view")
            self._material = gui.add_dropdown("material", ("matte",))
            add = self._place.add
            add("middle_mm", "vector3", "place, mm", (0.0, 0.0, 0.0), step=0.1, hint="Of its middle; camera frame")
            add("rotate_deg", "vector3", "turn, deg", (0.0, 0.0, 0.0), step=0.1, hint="About x, then y, then z")
            add("scale", "vector3", "scale", (1.0, 1.0, 1.0), step=0.001, hint="Along its own axes")
            self._size = gui.add_markdown("")
            window.button("Remove object", lambda: self._edit("remove object", edits.removed), kind="danger")
            window.button("Lights about the middle", lambda: window.change("centre", edits.centred))
        window.on_input(self._object, lambda name: window.select("object", self._names().index(name)))
        window.on_input(self._material, lambda name: self._edit(f"material of {window.object}", edits.assigned, name))

    def refresh(self) -> None:
        """Show the models that there are, and the numbers of the object that is selected."""
        self._file.options = self._window.listing.models or (NONE,)
        scene, index = self._window.scene, self._window.object
        one = scene.objects[index]
        self._object.options = self._names()
        self._object.value = self._names()[index]
        self._material.options = tuple(scene.materials)
        self._material.value = one.material
        placement = placement_of(one)
        self._place.show(
            middle_mm=tuple(np.round(placement.middle_mm, 4).tolist()),
            rotate_deg=tuple((np.round(placement.rotate_deg, 4) + 0.0).tolist()),
            scale=tuple(np.round(placement.scale, 6).tolist()),
        )
        size = " x ".join(f"{part:.4g}" for part in np.ptp(one.placed.vertices, axis=0))
        sheared = "" if placement.is_exact else " Its matrix shears: numbers typed here drop that."
        self._size.content = f"{len(one.mesh.faces):,} triangles, {size} mm.{sheared}"

    def _names(self) -> tuple[str, ...]:
        # Two objects of a file may have one name.
        return tuple(f"{index + 1} {one.name}" for index, one in enumerate(self._window.scene.objects))

    def _load(self) -> None:
        if self._file.value == NONE:
            self._window.list_files()
            self._window.refresh()
        if self._file.value != NONE:
            self._load_file(self._file.value)

    def _load_file(self, name: str) -> None:
        from twin.description.mesh_files import read_mesh

        self._add(f"load {name}", Path(name).stem, read_mesh(self._window.workspace.path(name)))

    def _add_shape(self) -> None:
        name = self._shape.value
        self._add(f"add {name}", name, built_in(name))

    def _add(self, label: str, name: str, mesh: ObjectMesh) -> None:
        # It is the last one, and selected as it comes: a large mesh is sent once.
        self._window.picked, self._window.object = "object", len(self._window.scene.objects)
        self._window.change(label, lambda scene: edits.added(scene, name, mesh))

    def _change_place(self, **said: tuple[float, float, float]) -> None:
        ((key, value),) = said.items()

        def edit(scene: TwinScene, index: int) -> TwinScene:
            was = placement_of(scene.objects[index])
            return edits.placed(scene, index, replace(was, **{key: np.array(value)}))

        self._edit(f"{LABELS[key]} {self._window.object}", edit)

    def _edit(self, label: str, edit, *values: object) -> None:
        index = self._window.object
        self._window.change(label, lambda scene: edit(scene, index, *values))
