"""The panel of the materials: kind, colour, picture, gloss, what lies below the surface."""

from pathlib import Path
from typing import Any

from lab.studio import edits
from lab.studio.desk import Desk
from lab.studio.workspace import PICTURES
from twin.materials import VERTEX, Conductor, Diffuse, Material, Measured, Principled, RoughPlastic, Subsurface, Texture
from twin.picture_files import read_picture

KINDS = {"matte": Diffuse, "glossy": RoughPlastic, "metal": Conductor, "principled": Principled}
METALS = ("Al", "Ag", "Au", "Cu", "Cr", "W", "none")
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
        desk.on_upload(gui.add_upload_button("Send a texture from here"), self._send)
        self._roughness = gui.add_slider("roughness", min=0.01, max=1.0, step=0.01, initial_value=0.1)
        self._specularity = gui.add_slider("specularity", min=0.0, max=1.0, step=0.01, initial_value=1.0)
        self._index = gui.add_slider("index of refraction", min=1.01, max=2.5, step=0.01, initial_value=1.49)
        self._metallic = gui.add_slider("metallic", min=0.0, max=1.0, step=0.01, initial_value=0.0)
        self._metal = gui.add_dropdown("metal", METALS)
        self._below = gui.add_checkbox("scatters below the surface", False, hint="Wax; the mesh must be closed")
        self._path = gui.add_number("mean free path, mm", 2.0, min=0.01, step=0.1)
        self._new = gui.add_text("new material", "")
        desk.on_click(gui.add_button("Add material", hint="A copy of this one, for this object"), self._add)
        desk.on_click(gui.add_button("Remove unused materials"), lambda: desk.change("tidy", _tidied))
        self._textures: dict[str, Texture] = {}
        desk.on_input(self._colour, self._from_colour)
        for handle in (self._kind, self._numbers, self._picture, self._roughness, self._specularity, self._index,
                       self._metallic, self._metal, self._below, self._path):  # fmt: skip
            desk.on_input(handle, lambda value: self._change())

    def refresh(self) -> None:
        """Show the material of the object that is selected, and only what its kind has."""
        scene = self._desk.scene
        name = scene.objects[self._desk.object].material
        material = scene.materials[name]
        self._name.content = f"**{name}**, of *{scene.objects[self._desk.object].name}*"
        measured = isinstance(material, Measured)
        kind = next((label for label, one in KINDS.items() if isinstance(material, one)), "matte")
        self._kind.value, self._kind.disabled = kind, measured
        has = {} if measured else vars(material)
        reflectance = has.get("reflectance")
        if isinstance(reflectance, tuple):
            self._numbers.value = tuple(map(float, reflectance))
            self._colour.value = tuple(_coded(part) for part in reflectance)
        self._picture.options = (COLOUR, VERTICES, *self._pictures())
        self._picture.value = self._picture_of(reflectance)
        for handle in (self._colour, self._numbers, self._picture):
            handle.visible = "reflectance" in has
        for key, handle in (("roughness", self._roughness), ("specularity", self._specularity), ("index", self._index),
                            ("metallic", self._metallic), ("metal", self._metal)):  # fmt: skip
            handle.visible = key in has
            if key in has and not isinstance(has[key], Texture):
                handle.value = has[key] if key != "metal" or has[key] in METALS else METALS[0]
        below = has.get("subsurface")
        self._below.visible, self._below.value = "subsurface" in has, below is not None
        self._path.visible = below is not None
        if below is not None:
            self._path.value = float(below.mean_free_path_mm)

    def _pictures(self) -> tuple[str, ...]:
        files = [name for name in self._desk.workspace.files(PICTURES) if not name.endswith(".npy")]
        return tuple(dict.fromkeys((*self._textures, *files)))

    def _picture_of(self, reflectance: Any) -> str:
        if reflectance == VERTEX:
            return VERTICES
        if not isinstance(reflectance, Texture):
            return COLOUR
        known = next((name for name, texture in self._textures.items() if texture is reflectance), None)
        if known is None:
            known = f"(picture {len(self._textures) + 1} of the scene)"
            self._textures[known] = reflectance
            self._picture.options = (COLOUR, VERTICES, *self._pictures())
        return known

    def _from_colour(self, coded: tuple[int, int, int]) -> None:
        from twin.mesh_files import linear_from_srgb

        self._numbers.value = tuple(float(linear_from_srgb(part / 255)) for part in coded)
        self._picture.value = COLOUR
        self._change()

    def _send(self, name: str) -> None:
        self._picture.options = (COLOUR, VERTICES, *self._pictures())
        self._picture.value = name
        self._change()

    def _change(self) -> None:
        name = self._desk.scene.objects[self._desk.object].material
        if not self._desk.change(f"material {name}", lambda s: self._changed(s, name)):
            self.refresh()

    def _changed(self, scene: edits.TwinScene, name: str) -> edits.TwinScene:
        return edits.with_material(scene, name, self._material(scene.materials[name]))

    def _material(self, was: Material) -> Material:
        """Return what the inputs say; what they do not show is kept."""
        kind = KINDS[self._kind.value]
        if kind is Conductor:
            return Conductor(self._metal.value, self._roughness.value)
        reflectance = self._reflectance()
        if kind is Principled:
            return Principled(reflectance, self._roughness.value, self._metallic.value, self._specularity.value)
        below = getattr(was, "subsurface", None)
        if not self._below.value:
            below = None
        elif below is None or below.mean_free_path_mm != self._path.value:
            below = Subsurface(float(self._path.value))
        if kind is Diffuse:
            return Diffuse(reflectance, below)
        given = getattr(was, "specularity", None)
        specularity = given if isinstance(given, Texture) else self._specularity.value
        return RoughPlastic(reflectance, self._roughness.value, specularity, self._index.value, below)

    def _reflectance(self) -> Any:
        picture = self._picture.value
        if picture == COLOUR:
            return tuple(float(part) for part in self._numbers.value)
        if picture == VERTICES:
            return VERTEX
        if picture not in self._textures:
            self._textures[picture] = Texture(read_picture(self._desk.workspace.path(picture)))
        return self._textures[picture]

    def _add(self) -> None:
        index, name = self._desk.object, Path(self._new.value.strip()).name

        def edit(scene: edits.TwinScene) -> edits.TwinScene:
            more = edits.with_material(scene, name, scene.materials[scene.objects[index].material])
            return edits.assigned(more, index, name)

        self._desk.change("add material", edit)


def _tidied(scene: edits.TwinScene) -> edits.TwinScene:
    used = {one.material for one in scene.objects}
    for name in scene.materials:
        if name not in used:
            scene = edits.without_material(scene, name)
    return scene


def _coded(linear: float) -> int:
    value = min(max(linear, 0.0), 1.0)
    return round(255 * (12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055))
