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
from studio.editor.preview import Drawn
from studio.review.folder import Review
from studio.review.review_window import Beside, ReviewWindow
from studio.widgets import plain

Array = NDArray[np.float64]
NOTHING, SAME, ANYWHERE = "nothing", "the twin, same flash", "the object, light from anywhere"


class TwinPanel:
    """What stands beside the photograph."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        self._scene: tuple[int, Any] | None = None
        self._drawn: Any = None
        self._reading = window.reading
        self._beside = gui.add_dropdown("beside the photograph", (NOTHING, SAME, ANYWHERE))
        self._zenith = gui.add_slider("from the axis, deg", min=0, max=85, step=1, initial_value=45, visible=False)
        self._azimuth = gui.add_slider("azimuth, deg", min=-180, max=180, step=1, initial_value=90, visible=False,
                                       hint="0 right, 90 up")  # fmt: skip
        self._facts = gui.add_markdown("")
        window.on_input(self._beside, lambda value: self._choose())
        for handle in (self._zenith, self._azimuth):
            window.on_input(handle, lambda value: self._relight())

    def refresh(self) -> None:
        """Let the twin follow the frame."""
        window = self._window
        if self._reading != window.reading:
            # What stood beside the photograph was taken away with what it was made of.
            self._reading, self._drawn, self._beside.value = window.reading, None, NOTHING
        self._zenith.visible = self._azimuth.visible = self._beside.value == ANYWHERE
        wanted = (window.reading, window.frame, window.shown.brightness)
        if self._beside.value == SAME and self._drawn != wanted:
            self._drawn = wanted
            picture, difference = twin_picture(window.review, window.frame, self._exposure())
            told = "" if np.isnan(difference) else f"; differs by {difference:.1%} of the object's brightness (median)"
            self._facts.content = f"The rendered frame of the same flash{told}."
            window.beside = Beside(picture, "twin")

    def _choose(self) -> None:
        window = self._window
        self._drawn, self._facts.content = None, ""
        if self._beside.value == NOTHING:
            window.choose(beside=None)
        elif self._beside.value == SAME:
            window.choose(view="Photograph")
        else:
            self._relight()
        window.refresh()

    def _exposure(self) -> Any:
        review = self._window.review
        exposure = review.material.exposure
        if exposure is None:
            raise SceneError(f"frames: {review.missing['frames']} How bright the twin is shown goes by them.")
        return replace(exposure, white=exposure.white / self._window.shown.brightness)

    def _relight(self) -> None:
        window = self._window
        if self._scene is None or self._scene[0] != window.reading:
            self._facts.content = "Loading the scan ..."
            self._scene = (window.reading, relit_scene(window.review))
        scene = self._scene[1]
        direction = toward(float(self._zenith.value), float(self._azimuth.value))
        lit = replace(scene, lights=one_light(scene.lights, direction), radii_mm=np.zeros(1))
        window.preview.request(window.client.client_id, lit, 0, lambda drawn: window.post(lambda: self._show(drawn)))

    def _show(self, drawn: Drawn) -> None:
        if self._beside.value != ANYWHERE:
            return
        if drawn.picture is None:
            self._facts.content = f"**Not drawn.** {plain(drawn.fault)}"
            return
        self._facts.content = f"The scan with its measured albedo, matte, drawn small: {drawn.stage}."
        picture = self._exposure().develop(shrink(drawn.picture, WIDTH))
        self._window.choose(beside=Beside(picture, "light from anywhere"))


def twin_picture(review: Review, index: int, exposure: Exposure) -> tuple[Image, float]:
    """Return the twin's frame in the photograph's tones, and how far the two differ on the object.

    The difference is the median over the mask's pixels of abs(photograph - twin), in units of the photograph's median
    there; NaN without a mask. Raises SceneError: there is no twin, or it has no such frame.
    """
    twin, frames = review.need("twin", "frames")
    name = frames.names[index]
    if name not in twin.names or (twin.width, twin.height) != (frames.width, frames.height):
        raise SceneError(
            f"twin: it has {len(twin)} frames of {twin.width} x {twin.height} px and none that is {name}; the "
            f"session's have {frames.width} x {frames.height} px. Run the step `twin` again."
        )
    place, mask = twin.names.index(name), review.material.mask
    picture = exposure.develop(thumbnail(twin, place, WIDTH))
    if mask is None or not mask.any():
        return picture, float("nan")
    v, u = np.nonzero(mask)
    some = slice(None, None, max(1, len(v) // 100_000))
    real, clipped = frames.read_pixels(index, v[some], u[some])
    made, _ = twin.read_pixels(place, v[some], u[some])
    usual = float(np.median(real[~clipped])) if (~clipped).any() else 0.0
    return picture, float(np.median(np.abs(real - made)[~clipped]) / usual) if usual > 0 else float("nan")


def toward(zenith_deg: float, azimuth_deg: float) -> Array:
    """Return the unit direction (3,) so far from the camera's axis, azimuth 0 right and 90 up."""
    from twin.description.light_groups import direction

    return direction(azimuth_deg, 90 - zenith_deg)


def one_light(lights: Lights, direction: Array) -> Lights:
    """Return one light from another direction: near lights' median distance, all lights' mean strength."""
    reference, positions = lights.reference_point_mm, None
    if lights.positions_mm is not None:
        away = float(np.median(np.linalg.norm(lights.positions_mm - reference, axis=1)))
        positions = (reference + away * direction)[None]
    return replace(
        lights,
        names=("anywhere",),
        directions=np.asarray(direction, np.float64)[None],
        intensities=np.ones((1, 3)),
        positions_mm=positions,
        direction_sigma_deg=np.zeros(0),
        intensity_sigma=np.zeros(0),
        flags=(),
    )


def relit_scene(review: Review) -> Any:
    """Return the registered scan with measured albedo as a scene, its lights to be replaced by `one_light`.

    Raises SceneError: the session, the pose, the lights or a method's albedo is not there.
    """
    from lab.job import Job
    from twin.description.description import Sampling
    from twin.scan_scene import scan_scene
    from twin.visibility import Sight

    store, lights, camera = review.store, review.lights, review.material.camera
    (session,) = review.need("session")
    if not store.path("pose.json").exists() or lights is None or camera is None:
        raise SceneError(f"scan: {review.missing.get('scan') or review.missing.get('lights') or 'there is no pose.'}")
    methods = [name for name in method_names(store) if store.path("albedo", f"{name}.npy").exists()]
    if not methods:
        raise SceneError("albedo: no method has left one here. Run the step `solve`.")
    # The one that gloss disturbs least.
    method = "iterative" if "iterative" in methods else methods[0]
    mesh = Job(session, Record(store.folder), (method,)).load_scan()
    albedo = store.read_array("albedo", f"{method}.npy")
    depth = float(lights.reference_point_mm[2])
    sight = Sight.of_scan(mesh, store.load_pose(), camera, lights)
    scene, _ = scan_scene(sight, albedo, Sampling(), albedo_depth_mm=depth)
    return scene
