"""The panel of the materials: kind, colour, picture, gloss, what lies below the surface."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from studio.editor import edits
from studio.editor.desk import Desk
from studio.markdown import plain
from twin.description.materials import (
    VERTEX,
    Conductor,
    Diffuse,
    Material,
    Measured,
    Principled,
    RoughPlastic,
    Subsurface,
    Texture,
)
from twin.description.picture_files import read_picture

KINDS = {"matte": Diffuse, "glossy": RoughPlastic, "metal": Conductor, "principled": Principled}
METALS = ("Al", "Ag", "Au", "Cu", "Cr", "W", "none")
GRAY = (0.5, 0.5, 0.5)
FIRST_PATH_MM = 2.0
"""Of light below a surface where it is first let in."""
COLOUR, VERTICES = "(the colour)", "(the mesh's own colours)"


class MaterialsPanel:
    """Numbers of the selected object's material."""

    def __init__(self, desk: Desk) -> None:
        self._desk, gui = desk, desk.client.gui
        self._name = gui.add_markdown("")
        self._kind = gui.add_dropdown("kind", tuple(KINDS))
        self._colour = gui.add_rgb("colour", (188, 188, 188))
        self._numbers = gui.add_vector3(
            "reflectance", (0.5, 0.5, 0.5), min=(0.0, 0.0, 0.0), max=(1.0, 1.0, 1.0), step=0.01, hint="Linear: R, G, B"
        )
        self._picture = gui.add_dropdown("picture", (COLOUR,), hint="A texture from the workspace")
        desk.on_upload(gui.add_upload_button("Send a texture from here"), self._choose_picture)
        self._roughness = gui.add_slider("roughness", min=0.01, max=1.0, step=0.01, initial_value=0.1)
        self._specularity = gui.add_slider("specularity", min=0.0, max=1.0, step=0.01, initial_value=1.0)
        self._index = gui.add_slider("index of refraction", min=1.01, max=2.5, step=0.01, initial_value=1.49)
        self._metallic = gui.add_slider("metallic", min=0.0, max=1.0, step=0.01, initial_value=0.0)
        self._metal = gui.add_dropdown("metal", METALS)
        self._below = gui.add_checkbox("scatters below the surface", False, hint="Wax; the mesh must be closed")
        self._path = gui.add_number("mean free path, mm", FIRST_PATH_MM, min=0.01, step=0.1)
        self._new = gui.add_text("new material", "")
        desk.on_click(gui.add_button("Add material", hint="A copy of this one, for this object"), self._add)
        desk.on_click(gui.add_button("Remove unused materials"), lambda: desk.change("tidy", _tidied))
        self._textures: dict[str, Texture] = {}
        desk.on_input(self._kind, lambda label: self._change(lambda was: of_kind(KINDS[label], was)))
        desk.on_input(self._colour, self._from_colour)
        desk.on_input(self._numbers, lambda value: self._set(reflectance=tuple(map(float, value))))
        desk.on_input(self._picture, self._choose_picture)
        for handle, key in ((self._roughness, "roughness"), (self._specularity, "specularity"),
                            (self._index, "index"), (self._metallic, "metallic")):  # fmt: skip
            desk.on_input(handle, lambda value, key=key: self._set(**{key: float(value)}))
        desk.on_input(self._metal, lambda value: self._set(metal=value))
        desk.on_input(self._below, lambda on: self._set(subsurface=Subsurface(FIRST_PATH_MM) if on else None))
        desk.on_input(self._path, self._set_path)

    def refresh(self) -> None:
        """Show the material of the object that is selected, and only what its kind has."""
        desk, scene = self._desk, self._desk.scene
        name = scene.objects[desk.object].material
        material = scene.materials[name]
        self._name.content = f"**{plain(name)}**, of *{plain(scene.objects[desk.object].name)}*"
        measured = isinstance(material, Measured)
        kind = next((label for label, one in KINDS.items() if isinstance(material, one)), "matte")
        self._kind.value, self._kind.disabled = kind, measured
        has = {} if measured else vars(material)
        reflectance = has.get("reflectance")
        if isinstance(reflectance, tuple):
            self._numbers.value = tuple(map(float, reflectance))
            self._colour.value = tuple(_coded(part) for part in reflectance)
        shown = self._picture_of(reflectance)
        names = dict.fromkeys((*self._textures, *(name for name in desk.listing.pictures if not name.endswith(".npy"))))
        self._picture.options, self._picture.value = (COLOUR, VERTICES, *names), shown
        for handle in (self._colour, self._numbers, self._picture):
            handle.visible = "reflectance" in has
        for key, handle in (("roughness", self._roughness), ("specularity", self._specularity), ("index", self._index),
                            ("metallic", self._metallic), ("metal", self._metal)):  # fmt: skip
            handle.visible = key in has
            if key == "metal" and key in has:
                handle.options = tuple(dict.fromkeys((*METALS, has[key])))
            if key in has and not isinstance(has[key], Texture):
                handle.value = has[key]
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

    def _from_colour(self, coded: tuple[int, int, int]) -> None:
        from twin.description.mesh_files import linear_from_srgb

        self._set(reflectance=tuple(float(linear_from_srgb(part / 255)) for part in coded))

    def _choose_picture(self, name: str) -> None:
        """Take a picture, as its file is now, for the reflectance; or the colour that is shown."""
        if name == COLOUR:
            self._set(reflectance=tuple(map(float, self._numbers.value)))
            return
        if name == VERTICES:
            self._set(reflectance=VERTEX)
            return
        if name in self._desk.listing.pictures:
            self._textures[name] = Texture(read_picture(self._desk.workspace.path(name)))
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
        name = self._desk.scene.objects[self._desk.object].material
        self._desk.change(f"material {name}", lambda s: edits.with_material(s, name, edit(s.materials[name])))

    def _add(self) -> None:
        index, name = self._desk.object, Path(self._new.value.strip()).name

        def edit(scene: edits.TwinScene) -> edits.TwinScene:
            more = edits.with_material(scene, name, scene.materials[scene.objects[index].material])
            return edits.assigned(more, index, name)

        self._desk.change("add material", edit)


def of_kind(kind: type[Material], was: Material) -> Material:
    """Return a material of another kind with those fields of the old one that it has too; the others are the kind's."""
    fields = {} if isinstance(was, Measured) else vars(was)
    if kind is Principled and isinstance(fields.get("specularity"), Texture):
        fields = {key: value for key, value in fields.items() if key != "specularity"}
    first: dict[str, Any] = {"metal": METALS[0]} if kind is Conductor else {"reflectance": GRAY}
    return kind(**(first | {key: value for key, value in fields.items() if key in kind.__dataclass_fields__}))


def _tidied(scene: edits.TwinScene) -> edits.TwinScene:
    used = {one.material for one in scene.objects}
    for name in scene.materials:
        if name not in used:
            scene = edits.without_material(scene, name)
    return scene


def _coded(linear: float) -> int:
    value = min(max(linear, 0.0), 1.0)
    return round(255 * (12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055))
