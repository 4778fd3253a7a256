"""The panels of a scene: objects, the material of one, lights, camera. Most inputs are made from the declarations."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from studio.editor import edits
from studio.editor.editor_window import EditorWindow
from studio.editor.edits import value_at, with_value
from studio.editor.fields import METALS, Fields
from studio.widgets import Inputs, plain
from studio.workspace import MESHES
from twin.description.light_groups import LIGHTS, LightGroup
from twin.description.materials import KINDS, Measured
from twin.description.object_mesh import SHAPES, read_mesh
from twin.description.scene_toml import SceneDocument

NONE = "(no file in the workspace)"
NEAR_MM = 800.0
"""Of lights that stand somewhere, from the reference point, until another distance is typed."""
FIRST: dict[str, dict[str, Any]] = {
    "hemisphere": {"rings": 3, "around": 8},
    "ring": {"count": 8, "polar_deg": 40.0},
    "distant": {"azimuth_deg": 0.0, "elevation_deg": 60.0},
    "point": {},
    "area": {"radius_mm": 20.0},
    "session": {},
}
"""What new lights are, by their kind."""


class ObjectsPanel:
    """Load, choose, move, turn, size by numbers, remove; of what each is made."""

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
            add("place", "vector3", "place, mm", (0.0, 0.0, 0.0), step=0.1, hint="Of its middle; camera frame")
            add("turn", "vector3", "turn, deg", (0.0, 0.0, 0.0), step=0.1, hint="About x, then y, then z")
            add("size", "vector3", "size, mm", (1.0, 1.0, 1.0), min=(0.0, 0.0, 0.0), step=0.1, hint="Its own axes")
            self._whole = gui.add_checkbox("size in proportion", True, hint="One side changes the others too")
            self._smooth = Fields(window, self._at, skip=("scale", "rotate_deg", "translate_mm"))
            self._text = gui.add_markdown("")
            window.button("Remove object", lambda: self._edit("remove object", edits.without, "objects"), kind="danger")
        window.on_input(self._object, lambda name: window.select("object", self._names().index(name)))
        window.on_input(self._material, self._change_material)

    def _at(self) -> edits.Place:
        return ("objects", self._window.object)

    def refresh(self) -> None:
        """Show the models that there are, and the numbers of the object that is selected."""
        document, index = self._window.document, self._window.object
        self._file.options = self._window.listing.models or (NONE,)
        self._object.options = self._names()
        self._object.value = self._names()[index]
        self._material.options = tuple(document.materials)
        self._material.value = document.objects[index].material
        where = edits.placement(document, index)
        numbers = {"place": where.middle_mm, "turn": where.rotate_deg, "size": where.size_mm}
        self._place.show(**{name: tuple((np.round(part, 4) + 0.0).tolist()) for name, part in numbers.items()})
        self._smooth.refresh()
        sheared = "" if where.is_exact else " Its matrix shears: numbers typed here drop that."
        self._text.content = f"{len(self._window.scene.objects[index].mesh.faces):,} triangles.{sheared}"

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
        path = self._window.workspace.path(name)
        self._add(f"load {name}", Path(name).stem, mesh=read_mesh(path))

    def _add_shape(self) -> None:
        name = self._shape.value
        self._add(f"add {name}", name, shape=name)

    def _add(self, label: str, name: str, **source: Any) -> None:
        # It is the last one, and selected as it comes: a large mesh is sent once.
        self._window.picked, self._window.object = "object", len(self._window.document.objects)
        self._window.change(label, lambda document: edits.added(document, name, **source))

    def _change_place(self, **said: tuple[float, float, float]) -> None:
        ((key, value),) = said.items()
        in_proportion = bool(self._whole.value)

        def edit(document: SceneDocument, index: int) -> SceneDocument:
            was = edits.placement(document, index)
            if key == "size":
                return edits.placed(document, index, was.sized(value, in_proportion=in_proportion))
            name = {"place": "middle_mm", "turn": "rotate_deg"}[key]
            return edits.placed(document, index, replace(was, **{name: np.array(value)}))

        self._edit(f"{key} {self._window.object}", edit)

    def _change_material(self, name: str) -> None:
        place = (*self._at(), "material")
        self._window.change("material of object", lambda document: with_value(document, place, name))

    def _edit(self, label: str, edit: Any, *before: Any) -> None:
        index = self._window.object
        self._window.change(label, lambda document: edit(document, *before, index))


class MaterialsPanel:
    """The material of the object that is selected: its kind, and what that has."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        self._name = gui.add_markdown("")
        self._kind = gui.add_dropdown("kind", tuple(kind for kind in KINDS if kind != "measured"))
        self._fields = Fields(window, self._at)
        self._new = gui.add_text("new material", "")
        window.button("Add material", self._add, hint="A copy of this one, for this object")
        window.button("Remove unused materials", lambda: window.change("tidy", edits.tidied), kind="danger")
        window.on_input(self._kind, self._change_kind)

    def _at(self) -> edits.Place:
        return ("materials", self._window.document.objects[self._window.object].material)

    def refresh(self) -> None:
        """Show the material of the object that is selected, and only what its kind has."""
        window, place = self._window, self._at()
        material = value_at(window.document, place)
        self._name.content = (
            f"**{plain(str(place[1]))}**, of *{plain(window.scene.objects[window.object].name)}*"
        )  # fmt: skip
        self._kind.disabled = isinstance(material, Measured)
        if not self._kind.disabled:
            self._kind.value = next(kind for kind, one in KINDS.items() if type(material) is one)
        self._fields.refresh()

    def _change_kind(self, kind: str) -> None:
        place, first = self._at(), {"reflectance": edits.GRAY, "metal": METALS[0]}
        self._window.change(
            f"{place[1]} kind",
            lambda document: with_value(document, place, edits.of_kind(KINDS[kind], value_at(document, place), first)),
        )

    def _add(self) -> None:
        index, name, was = self._window.object, Path(self._new.value.strip()).name, self._at()

        def edit(document: SceneDocument) -> SceneDocument:
            if not name or name in document.materials:
                raise edits.RenderError(f"materials: {name!r} is empty, or there already. Type another name.")
            more = with_value(document, ("materials", name), value_at(document, was))
            return with_value(more, ("objects", index, "material"), name)

        self._window.change("add material", edit)


class LightsPanel:
    """Groups of lights, the light that is selected, and what shines all the time."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        with gui.add_folder("Make lights"):
            self._kind = gui.add_dropdown("kind", tuple(FIRST))
            self._session = gui.add_dropdown("session", (NONE,), hint="Whose lights are taken")
            window.button("Replace the lights", lambda: self._make(keep=False), kind="main")
            window.button("Add to the lights", lambda: self._make(keep=True))
        with gui.add_folder("Light"):
            self._text = gui.add_markdown("")
            self._fields = Fields(window, self._at)
            self._single = window.button("Single out", lambda: self._edit("single out", edits.singled_out))
            window.button("Remove light", lambda: self._edit("remove light", self._without), kind="danger")
            self._all = window.button(
                "Remove its group", lambda: self._edit("remove lights", self._less), kind="danger"
            )
            window.button("Lights about the middle", self._centre, hint="Of all objects, wherever they go")
        with gui.add_folder("Environment"):
            self._around = Fields(window, lambda: ("environment",))

    def _at(self) -> edits.Place:
        return ("lights", edits.group_of(self._window.document, self._window.light))

    def refresh(self) -> None:
        """Show the light that is selected, with those that are made with it, and the environment."""
        scene, index, group = self._window.scene, self._window.light, self._at()[1]
        name, kind = plain(scene.lights.names[index]), value_at(self._window.document, self._at()).kind
        self._text.content = f"**{name}**, {index + 1} of {len(scene.lights)}, {scene.lights.model}; {kind} {group}"
        self._session.options = self._window.listing.sessions or (NONE,)
        self._single.visible = self._all.visible = kind in ("ring", "hemisphere", "session")
        self._fields.refresh()
        self._around.refresh()

    def _make(self, *, keep: bool) -> None:
        kind = self._kind.value

        def edit(document: SceneDocument) -> SceneDocument:
            group = self._new(kind, document, like=keep)
            return document.model_copy(update={"lights": (*(document.lights if keep else ()), group)})

        self._window.change(f"{kind} lights", edit)

    def _new(self, kind: str, document: SceneDocument, *, like: bool) -> LightGroup:
        """Return lights of a kind; like: near where the others are."""
        first, scene = dict(FIRST[kind]), self._window.scene
        if kind == "session":
            if self._session.value == NONE:
                raise edits.RenderError("lights: no session is in the workspace. Calibrate one, or copy one there.")
            first["file"] = self._window.workspace.path(f"{self._session.value}/lights.json")
        if kind in ("point", "area"):
            first["position_mm"] = tuple((scene.lights.reference_point_mm + [0.0, 0.0, NEAR_MM]).tolist())
        elif "distance_mm" in LIGHTS[kind].model_fields and like and scene.lights.positions_mm is not None:
            first["distance_mm"] = NEAR_MM
        if like and kind in ("distant", "point", "area"):
            names = set(scene.lights.names)
            first["name"] = next(name for i in range(10**6) if (name := f"{kind}_{i:03d}") not in names)
        return LIGHTS[kind](**first)  # type: ignore[return-value]

    def _without(self, document: SceneDocument, index: int) -> SceneDocument:
        return self._less(edits.singled_out(document, index), index)

    def _less(self, document: SceneDocument, index: int) -> SceneDocument:
        return edits.without(document, "lights", edits.group_of(document, index))

    def _centre(self) -> None:
        self._window.change("centre", lambda document: with_value(document, ("reference_point_mm",), None))

    def _edit(self, label: str, edit: Any) -> None:
        index = self._window.light
        self._window.change(label, lambda document: edit(document, index))


class CameraPanel:
    """The camera, and how the scene is rendered."""

    def __init__(self, window: EditorWindow) -> None:
        gui = window.client.gui
        with gui.add_folder("Camera"):
            camera = Fields(window, lambda: ("camera",))
        with gui.add_folder("Rendering"):
            self._fields = camera, Fields(window, lambda: ("sampling",))

    def refresh(self) -> None:
        """Show the scene's camera and sampling."""
        for fields in self._fields:
            fields.refresh()
