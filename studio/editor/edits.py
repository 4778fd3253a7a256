"""What can be done to a scene's document: functions from one to the next. None changes what it is given.

They raise RenderError where the next would be none: what a key may be, its declaration tells.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import TypeAdapter, ValidationError
from scipy.spatial.transform import Rotation

from scene.errors import RenderError
from scene.mesh import Mesh
from twin.description.description_file import faults_in
from twin.description.light_groups import AreaLight, DistantLight, GridTable, LightGroup, PointLight, SessionLights
from twin.description.materials import Diffuse, Material, Measured
from twin.description.object_mesh import built_in
from twin.description.scene_toml import CameraTable, ObjectTable, SceneDocument

Array = NDArray[np.float64]
Place = tuple[str | int, ...]
"""Where a value stands in a document: keys, names and numbers from the top."""
FILLED = 0.8
"""Share of the picture's width or height that a new object fills."""
GRAY = (0.5, 0.5, 0.5)


class Placement(NamedTuple):
    """An object's matrix in numbers.

    middle_mm (3,): Of the object's bounding box, where it is now: what gizmos turn it about.
    rotation (3, 3): Comes after the scale.
    scale (3,): Factors along the object's own axes. The first is negative where the matrix mirrors.
    size_mm (3,): Extent along the object's own axes, as it is.
    is_exact: False: the matrix shears as well, and these numbers are the nearest without.
    """

    middle_mm: Array
    rotation: Array
    scale: Array
    size_mm: Array
    is_exact: bool


@lru_cache(8)
def _box(mesh: Mesh) -> tuple[Array, Array]:
    """Return a mesh's least and greatest coordinates (3,)."""
    return mesh.vertices.min(0), mesh.vertices.max(0)


def placement_of(mesh: Mesh, matrix: Array) -> Placement:
    """Return the placement that a matrix (4, 4) gives a mesh.

    The matrix' linear part is R diag(s) if its columns are at right angles: s their lengths, R the rest. Else R is the
    rotation nearest to it, which SciPy takes, and s the lengths.
    """
    linear, (low, high) = matrix[:3, :3], _box(mesh)
    scale = np.linalg.norm(linear, axis=0) * [np.sign(np.linalg.det(linear)), 1, 1]
    rotation = Rotation.from_matrix(linear / scale).as_matrix()
    is_exact = bool(np.allclose(rotation, linear / scale, atol=1e-6))
    size = np.abs(scale) * (high - low)
    return Placement(linear @ ((low + high) / 2) + matrix[:3, 3], rotation, scale, size, is_exact)


def quaternion(rotation: Array) -> Array:
    """Return (w, x, y, z), unit, w >= 0, of a rotation (3, 3): viser's."""
    return Rotation.from_matrix(rotation).as_quat(canonical=True, scalar_first=True)


@cache
def start_document() -> SceneDocument:
    """Return what a new scene is: a matte sphere, whose place the first object takes, in 24 distant lights."""
    return SceneDocument(
        name="scene",
        camera=CameraTable(width=640, height=480, fx=1600.0),
        objects=(ObjectTable(name="sphere", shape="sphere", material="matte", scale=(60.0, 60.0, 60.0),
                             translate_mm=(0.0, 0.0, -600.0)),),
        materials={"matte": Diffuse(GRAY)},
        lights=(GridTable(name="light", rings=3, around=8),),
    )  # fmt: skip


def value_at(document: Any, place: Place) -> Any:
    """Return what stands at a place; None where there is nothing."""
    for part in place:
        if isinstance(part, int):
            document = document[part]
        else:
            document = document.get(part) if isinstance(document, Mapping) else getattr(document, part)
    return document


def with_value(document: Any, place: Place, value: Any) -> Any:
    """Return the document with another value at a place. Raises RenderError: it may not be; with its key."""
    if not place:
        return value
    (part, *rest), inner = place, value_at(document, place[:1])
    new = with_value(inner, tuple(rest), value)
    if isinstance(document, tuple):
        assert isinstance(part, int)
        return (*document[:part], new, *document[part + 1 :])
    if isinstance(document, Mapping):
        return {**document, part: new}
    if rest:
        changed = {str(part): new}
        return document.model_copy(update=changed) if hasattr(document, "model_copy") else replace(document, **changed)
    try:
        return TypeAdapter(type(document)).validate_python(dict(vars(document)) | {str(part): new})
    except ValidationError as error:
        raise RenderError("; ".join(faults_in(error, (part,)))) from None


def added(document: SceneDocument, name: str, **source: Any) -> SceneDocument:
    """Return the document with one object more, before the camera so that it fills most of the picture.

    source: `mesh`, in millimetres as it is, or `shape`, which gets the size of the sphere of a new scene, whose place
    the first object takes. Its axes are the camera's.
    """
    others = () if document.objects == start_document().objects else document.objects
    size, mesh = (60.0, built_in(source["shape"])) if "shape" in source else (1.0, source["mesh"])
    low, high = (size * end for end in _box(mesh))
    place = _before_the_camera(document, high - low) - (low + high) / 2
    one = ObjectTable(
        name=name, material=next(iter(document.materials)),
        scale=(size, size, size), translate_mm=tuple(place.tolist()), **source,
    )  # fmt: skip
    return document.model_copy(update={"objects": (*others, one)})


def _before_the_camera(document: SceneDocument, size: Array) -> Array:
    """Return where the middle of a box (3,) stands, that its front fills `FILLED` of the picture in one direction."""
    camera = document.camera.camera()
    if camera.is_orthographic:
        return np.array([0.0, 0.0, -2 * float(size.max())])
    away = max(size[0] * camera.fx / camera.width, size[1] * camera.fy / camera.height) / FILLED
    return np.array([0.0, 0.0, -float(away + size[2] / 2)])


def without(document: SceneDocument, key: str, index: int) -> SceneDocument:
    """Return the document without one of its `objects` or `lights`, which may not be the only one."""
    tables = getattr(document, key)
    if len(tables) == 1:
        raise RenderError(f"{key}: this is the only one; a scene has at least one.")
    return document.model_copy(update={key: (*tables[:index], *tables[index + 1 :])})


def without_lights(document: SceneDocument, index: int) -> SceneDocument:
    """Return the document without the group of a light."""
    return without(document, "lights", group_of(document, index))


def placement(document: SceneDocument, index: int) -> Placement:
    """Return where an object stands."""
    table = document.objects[index]
    return placement_of(table.own_mesh(), table.camera_from_object())


def with_matrix(document: SceneDocument, index: int, matrix: Array) -> SceneDocument:
    """Return the document with an object where a matrix (4, 4) puts it: as scale, turns and move, unless it shears."""
    where = placement_of(document.objects[index].own_mesh(), matrix)
    # Where y is +-90 degrees, x and z turn about one axis, and z is taken as 0.
    turns = Rotation.from_matrix(where.rotation).as_euler("xyz", degrees=True, suppress_warnings=True)
    said = where.scale.tolist(), turns.tolist(), matrix[:3, 3].tolist()
    said = said if where.is_exact else ([1.0] * 3, [0.0] * 3, [0.0] * 3)
    keys: dict[str, Any] = dict(zip(("scale", "rotate_deg", "translate_mm"), map(tuple, said), strict=True))
    keys |= {"matrix": None if where.is_exact else tuple(map(tuple, matrix.tolist())), "pose": None}
    return with_value(document, ("objects", index), document.objects[index].model_copy(update=keys))


def turned(document: SceneDocument, index: int, middle_mm: ArrayLike, rotation: Array) -> SceneDocument:
    """Return the document with an object moved rigidly, so that its middle and its rotation (3, 3) are these."""
    was, move = placement(document, index), np.eye(4)
    move[:3, :3] = rotation @ was.rotation.T
    move[:3, 3] = np.asarray(middle_mm) - move[:3, :3] @ was.middle_mm
    return with_matrix(document, index, move @ document.objects[index].camera_from_object())


def sized(document: SceneDocument, index: int, size_mm: ArrayLike, *, in_proportion: bool) -> SceneDocument:
    """Return the document with an object of another extent (3,) along its own axes, about its middle.

    A flat mesh stays flat. in_proportion: What was changed of the extent changes the rest too.
    """
    was, wanted, matrix = placement(document, index), np.asarray(size_mm, float), np.eye(4)
    factors = np.divide(wanted, was.size_mm, out=np.ones(3), where=was.size_mm > 0)
    if in_proportion:
        factors = np.full(3, factors[np.argmax(np.abs(factors - 1))])
    if not (factors > 0).all():
        raise RenderError(f"objects: the size {' x '.join(f'{one:g}' for one in wanted)} mm; every side is above 0.")
    low, high = _box(document.objects[index].own_mesh())
    matrix[:3, :3] = was.rotation * (was.scale * factors)
    matrix[:3, 3] = was.middle_mm - matrix[:3, :3] @ ((low + high) / 2)
    return with_matrix(document, index, matrix)


def of_kind(kind: type[Material], was: Material, first: Mapping[str, Any]) -> Material:
    """Return a material of another kind with what the old one has that it has too; the others are the kind's.

    first: What a kind must have.
    """
    fields = {} if isinstance(was, Measured) else vars(was)
    known = {key: value for key, value in (dict(first) | fields).items() if key in kind.__dataclass_fields__}
    try:
        return TypeAdapter(kind).validate_python(known)
    except ValidationError:
        # A picture where the other kind has a number.
        return kind(**{key: value for key, value in known.items() if key != "specularity"})


def group_of(document: SceneDocument, index: int) -> int:
    """Return in which group the light of a number stands."""
    ends = np.cumsum([_count(group) for group in document.lights])
    return min(int(np.searchsorted(ends, index, "right")), len(ends) - 1)


def _count(group: LightGroup) -> int:
    return len(group.lights()) if isinstance(group, SessionLights) else len(group.offsets(np.zeros(3)))


def singled_out(document: SceneDocument, index: int) -> SceneDocument:
    """Return the document with the lights of the group of one written out one by one."""
    group = group_of(document, index)
    first = sum(map(_count, document.lights[:group]))
    count = _count(document.lights[group])
    if count == 1 and isinstance(document.lights[group], PointLight | DistantLight):
        return document
    scene = document.scene()
    lights, singles = scene.lights, []
    for i in range(first, first + count):
        common = {"name": lights.names[i], "intensity": tuple(lights.intensities[i].tolist())}
        if lights.positions_mm is None:
            singles.append(DistantLight(direction=tuple(lights.directions[i].tolist()), **common))
            continue
        common["position_mm"], radius = tuple(lights.positions_mm[i].tolist()), float(scene.radii_mm[i])
        singles.append(AreaLight(radius_mm=radius, **common) if radius else PointLight(**common))
    changed: dict[str, Any] = {"lights": (*document.lights[:group], *singles, *document.lights[group + 1 :])}
    if isinstance(document.lights[group], SessionLights):
        changed["reference_point_mm"] = tuple(lights.reference_point_mm.tolist())
    return document.model_copy(update=changed)


def moved_light(document: SceneDocument, index: int, place_mm: ArrayLike) -> SceneDocument:
    """Return the document with a light at a place (3,): a near one stands there, a distant one shines from that way.

    The place may not be the reference point, where the light's intensity is to hold. Of a group it is singled out.
    """
    document = singled_out(document, index)
    place, group = np.asarray(place_mm, float), ("lights", group_of(document, index))
    if isinstance(value_at(document, group), PointLight):
        return with_value(document, (*group, "position_mm"), tuple(place.tolist()))
    away = place - document.scene().lights.reference_point_mm
    if not np.linalg.norm(away) > 1e-6:
        raise RenderError("lights: it would stand in the reference point. Move it elsewhere.")
    one = {"azimuth_deg": None, "elevation_deg": None, "direction": tuple((away / np.linalg.norm(away)).tolist())}
    return with_value(document, group, value_at(document, group).model_copy(update=one))
