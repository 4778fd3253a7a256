"""What is wrong with a scene, before anything is rendered: every fault at once."""

import numpy as np
from numpy.typing import NDArray

from formats.meshes.scan_files import LARGEST
from scene.errors import RenderError
from scene.mesh import Mesh
from scene.rays import RayCaster
from scene.reading import told
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import VERTEX, Material, Texture
from twin.engines.mitsuba_materials import material_faults


def check_scene(scene: TwinScene) -> None:
    """Raise RenderError, of every fault, when a scene cannot be rendered."""
    if faults := scene_faults(scene):
        raise RenderError(told(scene.name, faults))


def scene_faults(scene: TwinScene) -> list[str]:
    """Return what is wrong with a scene, one line each, with its key."""
    faults = material_faults(scene.materials)
    for index, one in enumerate(scene.objects):
        key = f"objects[{index}]"
        if one.material not in scene.materials:
            faults.append(f"{key}.material: {one.material!r} is none of the scene's materials.")
        elif not len(one.mesh.faces) or not _sound(one.placed.vertices).all():
            bad = np.count_nonzero(~_sound(one.placed.vertices))
            faults.append(
                f"{key}: {len(one.mesh.faces)} faces, and {bad} of its coordinates are not finite or beyond "
                f"{LARGEST:.0e} mm; nothing can be rendered. Load or export it again, or scale it down."
            )
        else:
            faults += _object_faults(key, one, scene.materials[one.material])
    radiance = np.zeros(1) if scene.environment.map is None else scene.environment.map.values
    if not (_sound(radiance) & (radiance >= 0)).all():
        bad = int(np.count_nonzero(~(_sound(radiance) & (radiance >= 0))))
        what = f"{bad} of {radiance.size} values are not finite, below 0 or beyond {LARGEST:.0e}"
        faults.append(f"environment.map: {what}. Mend the picture.")
    faults += _light_faults(scene)
    if not faults:
        try:
            scene.film()
        except RenderError as error:
            faults.append(f"camera: {error}")
    return faults


def _sound(values: NDArray) -> NDArray[np.bool_]:
    """Return which values are numbers that squares in single precision hold."""
    return np.abs(values) <= LARGEST


def _object_faults(key: str, one: TwinObject, material: Material) -> list[str]:
    """Return what a material wants of a mesh that the mesh has not."""
    faults = []
    values = [getattr(material, field, None) for field in ("reflectance", "specularity")]
    if one.mesh.texcoords is None and any(isinstance(value, Texture) for value in values):
        faults.append(
            f"{key}.material: {one.material!r} has a texture, but the mesh of {one.name!r} has no texture coordinates. "
            "Unwrap the mesh (in Blender, say) and export it with UVs, or take a reflectance without texture."
        )
    if one.mesh.colours is None and VERTEX in [value for value in values if isinstance(value, str)]:
        faults.append(f"{key}.material: {one.material!r} takes the vertices' colours, but {one.name!r} has none.")
    if getattr(material, "subsurface", None) is not None and not _welded(one.mesh).is_closed:
        faults.append(
            f"{key}.material: {one.material!r} scatters below the surface, but the mesh of {one.name!r} is not closed: "
            "there is no inside. Close its holes, or leave subsurface out."
        )
    return faults


def _welded(mesh: Mesh) -> Mesh:
    """Return the triangles with one vertex a place: at a texture's seam a mesh has several."""
    if mesh.texcoords is None:
        return mesh
    scale = float(np.ptp(mesh.vertices, axis=0).max()) or 1.0
    # The seams of the built-in shapes agree only to rounding.
    _, first, which = np.unique(np.round(mesh.vertices / scale, 7), axis=0, return_index=True, return_inverse=True)
    faces = which.reshape(-1)[mesh.faces]
    whole = (faces != np.roll(faces, 1, 1)).all(1)
    return Mesh(mesh.vertices[first], faces[whole])


def _light_faults(scene: TwinScene) -> list[str]:
    lights, of_session = scene.lights, "Of a session:"
    arrays = [lights.directions, lights.intensities, *([] if lights.positions_mm is None else [lights.positions_mm])]
    faults = [
        f"lights {name}: direction {row[:3]}, intensity {row[3:6]}, position {row[6:]}; expected numbers up to "
        f"{LARGEST:.0e}, no negative intensity. {of_session} calibrate again, or leave the frame out with frames.skip."
        for name, row in zip(lights.names, np.concatenate(arrays, 1), strict=True)
        if not _sound(row).all() or (row[3:6] < 0).any()
    ]
    if lights.positions_mm is None or faults:
        return faults
    for one in scene.objects:
        within = RayCaster(_welded(one.placed)).inside(lights.positions_mm)
        faults += [
            f"lights {lights.names[i]}: at {np.round(lights.positions_mm[i], 1)} mm, inside {one.name!r}, it lights "
            f"nothing. Move it. {of_session} check the balls' diameter_mm and scan_unit."
            for i in np.flatnonzero(within)
        ]
    return faults
