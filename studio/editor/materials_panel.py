"""The panel of the materials: kind, colour, picture, gloss, what lies below the surface."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from formats.pictures import linear_from_srgb, read_picture, srgb_from_linear
from studio.editor import edits
from studio.editor.editor_window import EditorWindow
from studio.widgets import Inputs, plain
from twin.description import materials
from twin.description.description import TwinScene
from twin.description.materials import (
    VERTEX,
    Conductor,
    Distribution,
    Material,
    Measured,
    Principled,
    Subsurface,
    Texture,
)

KINDS = {
    "matte": materials.Diffuse,
    "glossy": materials.RoughPlastic,
    "metal": Conductor,
    "principled": Principled,
}
METALS = ("Al", "Ag", "Au", "Cu", "Cr", "W", "none")
GRAY = (0.5, 0.5, 0.5)
FIRST_PATH_MM = 2.0
"""Of light below a surface where it is first let in."""
COLOUR, VERTICES = "(the colour)", "(the mesh's own colours)"


class MaterialsPanel:
    """Numbers of the selected object's material; `_fields` are inputs that a kind has or has not, by its fields."""

    def __init__(self, window: EditorWindow) -> None:
        self._window, gui = window, window.client.gui
        self._textures: dict[str, Texture] = {}
        self._fields = Inputs(window, self._set)
        add = self._fields.add
        self._name = gui.add_markdown("")
        self._kind = gui.add_dropdown("kind", tuple(KINDS))
        self._colour = gui.add_rgb("colour", (188, 188, 188))
        linear = {"min": (0.0, 0.0, 0.0), "max": (1.0, 1.0, 1.0), "step": 0.01, "hint": "Linear: R, G, B"}
        add("reflectance", "vector3", "reflectance", GRAY, **linear)
        self._picture = gui.add_dropdown("picture", (COLOUR,), hint="A texture from the workspace")
        window.on_upload(gui.add_upload_button("Send a texture from here", color="gray"), self._choose_picture)
        add("roughness", "slider", "roughness", min=0.01, max=1.0, step=0.01, initial_value=0.1)
        add("distribution", "dropdown", "facets", get_args(Distribution), hint="GGX: a halo; Beckmann: a Gaussian")
        add("specularity", "slider", "specularity", min=0.0, max=1.0, step=0.01, initial_value=1.0)
        add("index", "slider", "index of refraction", min=1.01, max=2.5, step=0.01, initial_value=1.49)
        add("metallic", "slider", "metallic", min=0.0, max=1.0, step=0.01, initial_value=0.0)
        add("metal", "dropdown", "metal", METALS)
        self._below = gui.add_checkbox("scatters below the surface", False, hint="Wax; the mesh must be closed")
        self._path = gui.add_number("mean free path, mm", FIRST_PATH_MM, min=0.01, step=0.1)
        self._new = gui.add_text("new material", "")
        window.button("Add material", self._add, hint="A copy of this one, for this object")
        window.button("Remove unused materials", lambda: window.change("tidy", _tidied), kind="danger")
        window.on_input(self._kind, lambda label: self._change(lambda was: of_kind(KINDS[label], was)))
        window.on_input(self._colour, self._set_colour)
        window.on_input(self._picture, self._choose_picture)
        window.on_input(self._below, lambda on: self._set(subsurface=Subsurface(FIRST_PATH_MM) if on else None))
        window.on_input(self._path, self._set_path)

    def refresh(self) -> None:
        """Show the material of the object that is selected, and only what its kind has."""
        window, scene = self._window, self._window.scene
        name = scene.objects[window.object].material
        material = scene.materials[name]
        self._name.content = f"**{plain(name)}**, of *{plain(scene.objects[window.object].name)}*"
        measured = isinstance(material, Measured)
        kind = next((label for label, one in KINDS.items() if isinstance(material, one)), "matte")
        self._kind.value, self._kind.disabled = kind, measured
        has = {} if measured else dict(vars(material))
        if "metal" in has:
            self._fields["metal"].options = tuple(dict.fromkeys((*METALS, has["metal"])))
        reflectance = has.get("reflectance")
        if isinstance(reflectance, tuple):
            has["reflectance"] = tuple(map(float, reflectance))
            self._colour.value = tuple(map(_coded, reflectance))
        # A picture, or the mesh's own colours, is no value of these inputs.
        said = {key: has[key] for key in self._fields if key in has and not isinstance(has[key], Texture)}
        self._fields.show(**{key: value for key, value in said.items() if value != VERTEX})
        self._fields.show_only(set(has))
        shown = self._picture_of(reflectance)
        names = (*self._textures, *(name for name in window.listing.pictures if not name.endswith(".npy")))
        self._picture.options, self._picture.value = tuple(dict.fromkeys((COLOUR, VERTICES, *names))), shown
        self._colour.visible = self._picture.visible = "reflectance" in has
        below = has.get("subsurface")
        self._below.visible, self._below.value = "subsurface" in has, below is not None
        self._path.visible = below is not None
        if below is not None:
            self._path.value = float(below.mean_free_path_mm)

    def _picture_of(self, reflectance: Any) -> str:
        if reflectance == VERTEX:
            return VERTICES
        if not isinstance(reflectance, Texture):
            return COLOUR
        known = next((name for name, texture in self._textures.items() if texture is reflectance), None)
        if known is None:
            known = f"(picture {len(self._textures) + 1} of the scene)"
            self._textures[known] = reflectance
        return known

    def _set_colour(self, coded: tuple[int, int, int]) -> None:
        self._set(reflectance=tuple(float(linear_from_srgb(part / 255)) for part in coded))

    def _choose_picture(self, name: str) -> None:
        """Take a picture, as its file is now, for the reflectance; or the colour that is shown."""
        if name == COLOUR:
            self._set(reflectance=tuple(map(float, self._fields["reflectance"].value)))
            return
        if name == VERTICES:
            self._set(reflectance=VERTEX)
            return
        if name in self._window.listing.pictures:
            self._textures[name] = Texture(read_picture(self._window.workspace.path(name)))
        self._set(reflectance=self._textures[name])

    def _set_path(self, value: float) -> None:
        def edit(was: Any) -> Material:
            below = was.subsurface or Subsurface(FIRST_PATH_MM)
            return replace(was, subsurface=replace(below, mean_free_path_mm=float(value)))

        self._change(edit)

    def _set(self, **said: Any) -> None:
        """Give the material these fields; the others, shown or not, stay."""
        self._change(lambda was: replace(was, **said))

    def _change(self, edit: Callable[[Any], Material]) -> None:
        name = self._window.scene.objects[self._window.object].material
        self._window.change(f"material {name}", lambda s: edits.with_material(s, name, edit(s.materials[name])))

    def _add(self) -> None:
        index, name = self._window.object, Path(self._new.value.strip()).name

        def edit(scene: TwinScene) -> TwinScene:
            more = edits.with_material(scene, name, scene.materials[scene.objects[index].material])
            return edits.assigned(more, index, name)

        self._window.change("add material", edit)


def of_kind(kind: type[Material], was: Material) -> Material:
    """Return a material of another kind with those fields of the old one that it has too; the others are the kind's."""
    fields = {} if isinstance(was, Measured) else vars(was)
    if kind is Principled and isinstance(fields.get("specularity"), Texture):
        fields = {key: value for key, value in fields.items() if key != "specularity"}
    first: dict[str, Any] = {"metal": METALS[0]} if kind is Conductor else {"reflectance": GRAY}
    return kind(**(first | {key: value for key, value in fields.items() if key in kind.__dataclass_fields__}))


def _tidied(scene: TwinScene) -> TwinScene:
    for name in scene.materials.keys() - {one.material for one in scene.objects}:
        scene = edits.without_material(scene, name)
    return scene


def _coded(linear: float) -> int:
    return round(255 * float(srgb_from_linear(linear)))
