"""The panel of the objects: load, choose, move, turn, scale by numbers, remove; of what each is made."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from studio.editor import edits
from studio.editor.desk import Desk
from studio.editor.placement import placement_of
from studio.workspace import MESHES
from twin.description.object_mesh import SHAPES, built_in

NONE = "(no file in the workspace)"


class ObjectsPanel:
    """Numbers of the object that is selected."""

    def __init__(self, desk: Desk) -> None:
        self._desk, gui = desk, desk.client.gui
        with gui.add_folder("Add an object"):
            self._file = gui.add_dropdown("model", (NONE,), hint="Models in the workspace")
            desk.on_click(gui.add_button("Load model"), self._load)
            desk.on_upload(gui.add_upload_button("Send a model from here", mime_type=",".join(MESHES)), self._load_file)
            self._shape = gui.add_dropdown("shape", SHAPES)
            desk.on_click(gui.add_button("Add shape"), self._add_shape)
        with gui.add_folder("Object"):
            self._object = gui.add_dropdown("object", ("sphere",), hint="Or click it in the view")
            self._material = gui.add_dropdown("material", ("matte",))
            self._middle = gui.add_vector3("place, mm", (0.0, 0.0, 0.0), step=0.1, hint="Of its middle; camera frame")
            self._angles = gui.add_vector3("turn, deg", (0.0, 0.0, 0.0), step=0.1, hint="About x, then y, then z")
            self._scale = gui.add_vector3("scale", (1.0, 1.0, 1.0), step=0.001, hint="Along its own axes")
            self._size = gui.add_markdown("")
            desk.on_click(gui.add_button("Remove object"), self._remove)
            desk.on_click(gui.add_button("Lights about the middle"), lambda: desk.change("centre", edits.centred))
        desk.on_input(self._object, lambda name: desk.select("object", self._names().index(name)))
        desk.on_input(self._material, self._assign)
        desk.on_input(self._middle, lambda value: self._place("place", middle_mm=np.array(value)))
        desk.on_input(self._angles, lambda value: self._place("turn", rotate_deg=np.array(value)))
        desk.on_input(self._scale, lambda value: self._place("scale", scale=np.array(value)))

    def refresh(self) -> None:
        """Show the models that there are, and the numbers of the object that is selected."""
        self._file.options = self._desk.listing.models or (NONE,)
        scene, index = self._desk.scene, self._desk.object
        one = scene.objects[index]
        self._object.options = self._names()
        self._object.value = self._names()[index]
        self._material.options = tuple(scene.materials)
        self._material.value = one.material
        placement = placement_of(one)
        self._middle.value = tuple(np.round(placement.middle_mm, 4).tolist())
        self._angles.value = tuple((np.round(placement.rotate_deg, 4) + 0.0).tolist())
        self._scale.value = tuple(np.round(placement.scale, 6).tolist())
        size = " x ".join(f"{part:.4g}" for part in np.ptp(one.placed.vertices, axis=0))
        sheared = "" if placement.is_exact else " Its matrix shears: numbers typed here drop that."
        self._size.content = f"{len(one.mesh.faces):,} triangles, {size} mm.{sheared}"

    def _names(self) -> tuple[str, ...]:
        # Two objects of a file may have one name.
        return tuple(f"{index + 1} {one.name}" for index, one in enumerate(self._desk.scene.objects))

    def _load(self) -> None:
        if self._file.value == NONE:
            self._desk.list_files()
            self._desk.refresh()
        if self._file.value != NONE:
            self._load_file(self._file.value)

    def _load_file(self, name: str) -> None:
        from twin.description.mesh_files import read_mesh

        mesh = read_mesh(self._desk.workspace.path(name))
        if self._desk.change(f"load {name}", lambda scene: edits.added(scene, Path(name).stem, mesh)):
            self._desk.select("object", len(self._desk.scene.objects) - 1)

    def _add_shape(self) -> None:
        name = self._shape.value
        if self._desk.change(f"add {name}", lambda scene: edits.added(scene, name, built_in(name))):
            self._desk.select("object", len(self._desk.scene.objects) - 1)

    def _place(self, label: str, **numbers: object) -> None:
        index = self._desk.object

        def edit(scene: edits.TwinScene) -> edits.TwinScene:
            was = placement_of(scene.objects[index])
            return edits.placed(scene, index, replace(was, **numbers))  # type: ignore[arg-type]

        self._desk.change(f"{label} {index}", edit)

    def _assign(self, name: str) -> None:
        index = self._desk.object
        self._desk.change(f"material of {index}", lambda scene: edits.assigned(scene, index, name))

    def _remove(self) -> None:
        index = self._desk.object
        self._desk.change("remove object", lambda scene: edits.removed(scene, index))
