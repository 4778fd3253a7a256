"""A scene description as files that Mitsuba's own command line renders, without us.

`scene.xml` is the scene, `lights/NAME.xml` a light; the light is a parameter:

    mitsuba -m llvm_ad_rgb -D light=NAME -o NAME.exr scene.xml
"""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from formats.meshes.scan_files import write_mesh
from formats.picture_files import write_exr
from scene.errors import RenderError
from scene.files import write_text
from twin.description.description import TwinScene
from twin.description.description_check import check_scene
from twin.description.kept_files import KeptFiles
from twin.engines.film import Film, sensor_description
from twin.engines.mitsuba_scene import flash, parts
from twin.engines.variant import import_mitsuba

SAMPLES = 256
"""A pixel, where the description names none; `-D samples=64` changes it."""

Element = ElementTree.Element
_TAGS = {
    "bitmap": "texture",
    "mesh_attribute": "texture",
    "disk": "shape",
    "homogeneous": "medium",
    "isotropic": "phase",
    "hdrfilm": "film",
    "box": "rfilter",
    "multijitter": "sampler",
    "perspective": "sensor",
    "orthographic": "sensor",
    **dict.fromkeys(("path", "volpath"), "integrator"),
    **dict.fromkeys(("directional", "point", "area", "constant", "envmap"), "emitter"),
}
"""What kind of thing a plugin is; materials are the rest."""


def write_mitsuba(scene: TwinScene, folder: Path) -> tuple[list[Path], list[str]]:
    """Write scene.xml, lights/, meshes/ (PLY) and textures/ (EXR).

    Returns
    -------
    paths : list of Path
        scene.xml, then the lights, in their order.
    notes : list of str
        What the files cannot say.

    Raises
    ------
    RenderError
        Every fault of the scene, or a light's name that can be no file's.

    Notes
    -----
    Pixel values are those of the engine `mitsuba`: linear, in the session's unit; see `TwinScene`. The pictures have
    the camera's full size, but for a camera with distortion or oblong pixels, which Mitsuba has not.
    """
    check_scene(scene)
    for name in scene.lights.names:
        if not re.fullmatch(r"[\w.-]+", name):
            raise RenderError(f"lights: {name!r} can be no file's name here; use letters, digits, _, - and dots.")
    import_mitsuba(slow=True)
    film, made, files, notes = scene.film(), parts(scene), _Files(folder), []
    if film.pixels is None:
        camera = film.camera
        film = Film.of_pinhole(camera, slice(0, camera.height), slice(0, camera.width))
    else:
        plain = film.rendered
        notes.append(
            f"Mitsuba's camera has square pixels and no distortion: its pictures are {plain.width} x {plain.height} px "
            f"of a camera with fx = fy = {plain.fx:.6g}, cx = {plain.cx:.6g}, cy = {plain.cy:.6g}, and still to be "
            "distorted."
        )
    root = Element("scene", version="3.0.0")
    samples = scene.sampling.samples or SAMPLES
    for name, value in (("light", scene.lights.names[0]), ("samples", str(samples))):
        ElementTree.SubElement(root, "default", name=name, value=value)
    root.append(files.element(made.integrator))
    sensor = files.element(sensor_description(film, scene.points, 0, film.window[2]))
    sampler = sensor.find("sampler")
    assert sampler is not None
    ElementTree.SubElement(sampler, "integer", name="sample_count", value="$samples")
    root.append(sensor)
    for name, material in made.materials.items():
        root.append(files.element(material, id=f"material {name}"))
    for name, within in made.media.items():
        root.append(files.element(within, id=f"medium {name}"))
    for number, (_, mesh, material) in enumerate(made.shapes):
        file = f"meshes/{number:02d}.ply"
        write_mesh(folder / file, mesh)
        shape = ElementTree.SubElement(root, "shape", type="ply", id=f"object_{number}")
        ElementTree.SubElement(shape, "string", name="filename", value=file)
        # In files texture coordinates point up.
        ElementTree.SubElement(shape, "boolean", name="flip_tex_coords", value="true")
        if mesh.normals is None:
            ElementTree.SubElement(shape, "boolean", name="face_normals", value="true")
        ElementTree.SubElement(shape, "ref", id=f"material {material}")
        if material in made.media:
            ElementTree.SubElement(shape, "ref", name="interior", id=f"medium {material}")
    if made.environment is not None:
        root.append(files.element(made.environment))
    ElementTree.SubElement(root, "include", filename="lights/$light.xml")
    paths = []
    for index, name in enumerate(scene.lights.names):
        light = Element("scene", version="3.0.0")
        light.append(files.element(flash(scene, index), id="flash"))
        paths.append(_write(folder / "lights" / f"{name}.xml", light))
    return [_write(folder / "scene.xml", root), *paths], notes


def _write(path: Path, root: Element) -> Path:
    ElementTree.indent(root)
    write_text(path, ElementTree.tostring(root, "unicode") + "\n")
    return path


class _Files:
    """Turns Mitsuba's dictionaries into XML; arrays and files that they name go into textures/."""

    def __init__(self, folder: Path) -> None:
        self._keep = KeptFiles(folder)

    def element(self, node: dict[str, Any], **attributes: str) -> Element:
        kind = node["type"]
        element = Element(_TAGS.get(kind, "bsdf"), {"type": kind, **attributes})
        for key, value in node.items():
            if key != "type":
                element.append(self._child(key, value))
        return element

    def _child(self, key: str, value: Any) -> Element:
        if isinstance(value, dict):
            if value["type"] == "rgb":
                return Element("rgb", name=key, value=_numbers(value["value"]))
            return self.element(value, name=key)
        if key == "data":
            return Element("string", name="filename", value=self._keep.made("textures", ".exr", value, write_exr))
        if isinstance(value, Path):
            return Element("string", name=key, value=self._keep.copy("textures", value))
        if isinstance(value, list):
            return Element("vector" if key == "direction" else "point", name=key, value=_numbers(value))
        for kind, tag in ((bool, "boolean"), (int, "integer"), (float, "float"), (str, "string")):
            if isinstance(value, kind):
                return Element(tag, name=key, value=str(value).lower() if kind is bool else str(value))
        matrix = np.asarray(value if isinstance(value, np.ndarray) else value.matrix, float)
        transform = Element("transform", name=key)
        ElementTree.SubElement(transform, "matrix", value=_numbers(matrix.ravel()))
        return transform


def _numbers(values: Any) -> str:
    return ", ".join(repr(float(value)) for value in values)
