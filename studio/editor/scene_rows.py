"""The rows of a scene: objects, the material of one, lights, camera, files. Most inputs are made from declarations."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from formats.meshes.scan_files import SUFFIXES as MESHES
from studio.editor import edits
from studio.editor.editor_window import EditorWindow
from studio.editor.edits import Place, value_at, with_value
from studio.editor.fields import METALS, fields
from studio.tabs import WORK_ROWS, tab_rows
from studio.widgets import Row, button, plain, text
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


def _choice(name: str, label: str, options: Callable[[EditorWindow], tuple[str, ...]], hint: str | None = None) -> Row:
    """Return a drop-down that only says what a button takes; it is kept in the window's `chosen`."""

    def show(window: EditorWindow) -> dict[str, Any]:
        found = options(window)
        return {"options": found or (NONE,), "value": _chosen(window, name, found) or NONE}

    return Row("dropdown", label, show, lambda window, value: window.chosen.update({name: value}),
               {"options": (NONE,), "hint": hint})  # fmt: skip


def _chosen(window: EditorWindow, name: str, options: tuple[str, ...]) -> str | None:
    chosen = window.chosen.get(name)
    return chosen if chosen in options else next(iter(options), None)


def _edit(label: str, edit: Callable[..., SceneDocument], of: str) -> Callable[[EditorWindow], Any]:
    """Return a change by an edit that is given the document and the index of the chosen `of`, object or light."""

    def use(window: EditorWindow) -> None:
        index = getattr(window, of)
        window.change(label, lambda document: edit(document, index))

    return use


def _object(window: EditorWindow) -> Place:
    return ("objects", window.object)


def _load_file(window: EditorWindow, name: str) -> None:
    _add(window, f"load {name}", Path(name).stem, mesh=read_mesh(window.workspace.path(name)))


def _add_shape(window: EditorWindow) -> None:
    name = _chosen(window, "shape", SHAPES) or SHAPES[0]
    _add(window, f"add {name}", name, shape=name)


def _add(window: EditorWindow, label: str, name: str, **source: Any) -> None:
    # It is the last one, and selected as it comes: a large mesh is sent once.
    window.object = len(window.document.objects)
    window.change(label, lambda document: edits.added(document, name, **source))


def _material(window: EditorWindow) -> Place:
    return ("materials", window.document.objects[window.object].material)


def _kind(window: EditorWindow) -> dict[str, Any]:
    material = value_at(window.document, _material(window))
    if isinstance(material, Measured):
        return {"disabled": True}
    return {"disabled": False, "value": next(kind for kind, one in KINDS.items() if type(material) is one)}


def _change_kind(window: EditorWindow, kind: str) -> None:
    place, first = _material(window), {"reflectance": edits.GRAY, "metal": METALS[0]}
    window.change(
        f"{place[1]} kind",
        lambda document: with_value(document, place, edits.of_kind(KINDS[kind], value_at(document, place), first)),
    )


def _add_material(window: EditorWindow) -> None:
    index, name, was = window.object, Path(window.chosen.get("material", "").strip()).name, _material(window)

    def edit(document: SceneDocument) -> SceneDocument:
        if not name or name in document.materials:
            raise edits.RenderError(f"materials: {name!r} is empty, or there already. Type another name.")
        more = with_value(document, ("materials", name), value_at(document, was))
        return with_value(more, ("objects", index, "material"), name)

    window.change("add material", edit)


def _light(window: EditorWindow) -> Place:
    return ("lights", edits.group_of(window.document, window.light))


def _is_group(window: EditorWindow) -> dict[str, bool]:
    return {"visible": value_at(window.document, _light(window)).kind in ("ring", "hemisphere", "session")}


def _make_lights(window: EditorWindow, *, keep: bool) -> None:
    kind = _chosen(window, "lights", tuple(FIRST)) or ""

    def edit(document: SceneDocument) -> SceneDocument:
        group = _new_lights(window, kind, like=keep)
        return document.model_copy(update={"lights": (*(document.lights if keep else ()), group)})

    window.change(f"{kind} lights", edit)


def _new_lights(window: EditorWindow, kind: str, *, like: bool) -> LightGroup:
    """Return lights of a kind; like: near where the others are."""
    first, scene = dict(FIRST[kind]), window.scene
    if kind == "session":
        if window.state.session is None:
            raise edits.RenderError("lights: no session is open. Open one that was calibrated.")
        first["file"] = window.state.session[0] / "lights.json"
    if kind in ("point", "area"):
        first["position_mm"] = tuple((scene.lights.reference_point_mm + [0.0, 0.0, NEAR_MM]).tolist())
    elif "distance_mm" in LIGHTS[kind].model_fields and like and scene.lights.positions_mm is not None:
        first["distance_mm"] = NEAR_MM
    if like and kind in ("distant", "point", "area"):
        names = set(scene.lights.names)
        first["name"] = next(name for i in range(10**6) if (name := f"{kind}_{i:03d}") not in names)
    return LIGHTS[kind](**first)  # type: ignore[return-value]


SCENE_ROWS = tab_rows({
    "Objects": (
        Row("folder", "Add an object", rows=(
            Row("upload", "Load model", use=_load_file, start={"mime_type": ",".join(MESHES), "kind": "main"}),
            _choice("shape", "shape", lambda window: SHAPES),
            button("Add shape", _add_shape),
        )),
        Row("folder", "Object", rows=(
            Row("dropdown", "object",
                lambda window: {"options": window.names, "value": window.names[window.object]},
                lambda window, name: window.select("object", window.names.index(name)),
                {"options": ("sphere",), "hint": "Or click it in the view"}),
            Row("dropdown", "material",
                lambda window: {"options": tuple(window.document.materials), "value": _material(window)[1]},
                lambda window, name: window.change("material of object", lambda document: with_value(
                    document, (*_object(window), "material"), name)), {"options": ("matte",)}),
            fields(_object, skip=("scale",)),
            Row("vector3", "size, mm",
                lambda window: tuple(np.round(edits.placement(window.document, window.object).size_mm, 4).tolist()),
                lambda window, said: window.change("size of object", lambda document: edits.sized(
                    document, window.object, said, in_proportion=window.size_in_proportion)),
                {"value": (0.0,) * 3, "min": (0.0,) * 3, "hint": "Along the object's own axes"}),
            Row("checkbox", "size in proportion", lambda window: window.size_in_proportion,
                lambda window, said: window.choose(size_in_proportion=said), {"value": True}),
            text(lambda window: f"{len(window.scene.objects[window.object].mesh.faces):,} triangles."),
            button("Remove object",
                   _edit("remove object", lambda document, index: edits.without(document, "objects", index), "object"),
                   kind="danger"),
        )),
    ),
    "Material": (
        text(lambda window: f"**{plain(str(_material(window)[1]))}**, of "
             f"*{plain(window.scene.objects[window.object].name)}*"),
        Row("dropdown", "kind", _kind, _change_kind, {"options": tuple(kind for kind in KINDS if kind != "measured")}),
        fields(_material),
        Row("text", "new material", lambda window: window.chosen.get("material", ""),
            lambda window, value: window.chosen.update(material=value), {"value": ""}),
        button("Add material", _add_material, hint="A copy of this one, for this object"),
    ),
    "Lights": (
        Row("folder", "Make lights", rows=(
            _choice("lights", "kind", lambda window: tuple(FIRST), "session: those of the session that is open"),
            button("Replace the lights", lambda window: _make_lights(window, keep=False), kind="main"),
            button("Add to the lights", lambda window: _make_lights(window, keep=True)),
        )),
        Row("folder", "Light", rows=(
            text(lambda window: f"**{plain(window.scene.lights.names[window.light])}**, {window.light + 1} of "
                 f"{len(window.scene.lights)}, {window.scene.lights.model}; "
                 f"{value_at(window.document, _light(window)).kind} {_light(window)[1]}"),
            fields(_light),
            button("Single out", _edit("single out", edits.singled_out, "light"), _is_group),
            button("Remove light", _edit("remove light", lambda document, index: edits.without_lights(
                edits.singled_out(document, index), index), "light"), kind="danger"),
            button("Remove its group", _edit("remove lights", edits.without_lights, "light"), _is_group, kind="danger"),
        )),
        Row("folder", "Environment", rows=(fields(lambda window: ("environment",)),)),
    ),
    "Camera": (
        Row("folder", "Camera", rows=(fields(lambda window: ("camera",)),)),
        Row("folder", "Rendering", rows=(fields(lambda window: ("sampling",)),)),
    ),
    "Dataset": (
        Row("folder", "Scene", rows=(
            Row("text", "name", lambda window: window.saved.name,
                lambda window, value: setattr(window.saved, "name", value),
                {"value": "scene", "hint": "Folder in the workspace"}),
            button("Save scene", lambda window: window.notify("Saved", window.workspace.name(window.save()))),
            button("New scene", lambda window: window.start_again()),
        )),
        Row("folder", "Dataset", rows=(
            button("Export for Mitsuba", lambda window: window.export()),
            *WORK_ROWS,
            button("Solve", lambda window: window.solve(), lambda window: {
                "visible": window.dataset.is_dir() and not window.is_busy}, kind="main", visible=False),
        )),
    ),
})  # fmt: skip
