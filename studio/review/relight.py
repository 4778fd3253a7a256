"""The twin beside the photograph: under the same flash as it was rendered, or under a light from anywhere."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import method_names
from compare.report.pictures import Exposure, Image, shrink, thumbnail
from compare.report.registration_pictures import WIDTH
from scene.errors import SceneError
from scene.lights import Lights
from scene.record import Record
from studio.review.folder import Review

Array = NDArray[np.float64]


def twin_picture(review: Review, index: int, exposure: Exposure) -> tuple[Image, float]:
    """Return the twin's frame in the photograph's tones, and how far the two differ on the object.

    Returns picture (h, w, 3). Returns difference: Median over the mask's pixels of abs(photograph - twin), in units of
    the photograph's median there; NaN without a mask. Raises SceneError: there is no twin, or it has no such frame.
    """
    frames, twin = review.material.frames, review.twin
    if twin is None or frames is None:
        raise SceneError(f"twin: {review.missing['twin' if twin is None else 'frames']}")
    name = frames.names[index]
    if name not in twin.names or (twin.width, twin.height) != (frames.width, frames.height):
        raise SceneError(
            f"twin: it has {len(twin)} frames of {twin.width} x {twin.height} px and none that is {name}; the "
            f"session's have {frames.width} x {frames.height} px. Run the step `twin` again."
        )
    place = twin.names.index(name)
    return exposure.develop(thumbnail(twin, place, WIDTH)), _difference(review, index, place)


def _difference(review: Review, index: int, place: int) -> float:
    frames, twin, mask = review.material.frames, review.twin, review.material.mask
    if mask is None or not mask.any() or frames is None or twin is None:
        return float("nan")
    v, u = np.nonzero(mask)
    some = slice(None, None, max(1, len(v) // 100_000))
    real, clipped = frames.read_pixels(index, v[some], u[some])
    made, _ = twin.read_pixels(place, v[some], u[some])
    usual = float(np.median(real[~clipped])) if (~clipped).any() else 0.0
    return float(np.median(np.abs(real - made)[~clipped]) / usual) if usual > 0 else float("nan")


def toward(zenith_deg: float, azimuth_deg: float) -> Array:
    """Return the unit direction (3,) so far from the camera's axis, azimuth 0 right and 90 up."""
    from twin.description.light_groups import direction

    return direction(azimuth_deg, 90 - zenith_deg)


def one_light(lights: Lights, direction: Array) -> Lights:
    """Return one light from another direction: near lights' median distance, all lights' mean strength."""
    reference = lights.reference_point_mm
    positions = None
    if lights.positions_mm is not None:
        away = float(np.median(np.linalg.norm(lights.positions_mm - reference, axis=1)))
        positions = (reference + away * direction)[None]
    return replace(
        lights,
        names=("anywhere",),
        directions=np.asarray(direction, np.float64)[None],
        intensities=np.ones((1, 3)),
        positions_mm=positions,
        direction_sigma_deg=np.full(1, np.nan),
        intensity_sigma=np.full(1, np.nan),
        flags=((),),
    )


def relit_scene(review: Review) -> Any:
    """Return the registered scan with measured albedo as a scene, its lights to be replaced by `one_light`.

    Raises SceneError: the session, the pose, the lights or a method's albedo is not there.
    """
    from lab.job import Job
    from twin.description.description import Sampling
    from twin.scan_scene import scan_scene

    store, lights, camera = review.store, review.lights, review.material.camera
    if review.session is None:
        raise SceneError(review.why_no_session)
    if not store.path("pose.json").exists() or lights is None or camera is None:
        raise SceneError(f"scan: {review.missing.get('scan') or review.missing.get('lights') or 'there is no pose.'}")
    methods = [name for name in method_names(store) if store.path("albedo", f"{name}.npy").exists()]
    if not methods:
        raise SceneError("albedo: no method has left one here. Run the step `solve`.")
    # The one that gloss disturbs least.
    method = "iterative" if "iterative" in methods else methods[0]
    mesh = Job(review.session, Record(store.folder), (method,)).load_scan()
    albedo = store.read_array("albedo", f"{method}.npy")
    depth = float(lights.reference_point_mm[2])
    scene, _ = scan_scene(mesh, store.load_pose(), camera, lights, albedo, albedo_depth_mm=depth, sampling=Sampling())
    return scene


def whole_picture(drawn: NDArray[np.float32], exposure: Exposure) -> Image:
    """Return a linear preview in the photograph's tones."""
    return exposure.develop(shrink(drawn, WIDTH))
