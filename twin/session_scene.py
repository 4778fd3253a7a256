"""A session's twin as the session calls for it: of which material, how exact, and by what sensor it is photographed."""

from dataclasses import replace
from typing import TYPE_CHECKING

from scene.frames import Frames
from scene.mesh import Mesh
from scene.store import Store
from twin.camera.grain import sensor_like
from twin.camera.virtual_camera import NO_FILTER, Sensor
from twin.description.description import Sampling, TwinScene

if TYPE_CHECKING:
    from twin.material.scan_material import ScanMaterial
    from twin.visibility import Sight

ENOUGH = 0.5
"""Of the share of the photographs that the material leaves unexplained: an error of the rendering that hides in it."""


def session_sight(store: Store, mesh: Mesh) -> "Sight":
    """Return a registered scan with its true normals under the calibrated lights; `store`: after `align`."""
    from twin.visibility import Sight

    lights, normals = store.load_lights(), store.load_normals("truth")
    return Sight(mesh.moved(store.load_pose().matrix), store.load_camera(), lights, normals)


def session_scene(
    store: Store, mesh: Mesh, sampling: Sampling, *, is_error_given: bool
) -> "tuple[TwinScene, ScanMaterial, list[str]]":
    """Return a registered scan under the calibrated lights as a scene, the material fitted to it, and warnings.

    store: the session's output folder, after `align`. is_error_given: the sampling's error is what the user asked for.
    Raises RenderError: no material can be fitted, or the scene cannot be rendered.
    """
    from twin.material.scan_material import scan_material
    from twin.scan_scene import scan_scene

    sight = session_sight(store, mesh)
    found = scan_material(sight, store.load_frames(), store.load_mask())
    if not is_error_given:
        # No more than the scene needs: what the material is wrong by, exact light would not mend.
        sampling = replace(sampling, error=max(sampling.error, ENOUGH * found.relative_rmse))
    scene, warnings = scan_scene(sight, found.albedo, sampling, fit=found.fit)
    return scene, found, [*found.warnings, *warnings]


def session_sensor(frames: Frames, *, half: bool, iso: float = 100.0) -> Sensor:
    """Return a sensor as noisy as the session's at its ISO, and of its kind: a Bayer sensor where the frames are one's.

    half: the frames are 2 x 2 superpixels.
    """
    sensor = sensor_like(frames)
    bayer = frames.is_mosaic and not half and frames.width % 2 == 0 and frames.height % 2 == 0
    # The full well was measured at the session's ISO.
    return replace(sensor, cfa=sensor.cfa if bayer else NO_FILTER, iso=iso, full_well_e=sensor.full_well_e * iso / 100)
