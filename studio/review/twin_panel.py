"""The panel of the twin: its picture beside the photograph, under the same flash or a light from anywhere."""

from dataclasses import replace
from typing import Any

import numpy as np

from scene.errors import SceneError
from studio.editor.preview import Drawn
from studio.markdown import plain
from studio.review.relight import one_light, relit_scene, toward, twin_picture, whole_picture
from studio.review.review_desk import Beside, ReviewDesk

NOTHING, SAME, ANYWHERE = "nothing", "the twin, same flash", "the object, light from anywhere"


class TwinPanel:
    """What stands beside the photograph."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, gui = desk, desk.client.gui
        self._scene: tuple[int, Any] | None = None
        self._drawn: Any = None
        self._reading = desk.reading
        self._beside = gui.add_dropdown("beside the photograph", (NOTHING, SAME, ANYWHERE))
        self._zenith = gui.add_slider("from the axis, deg", min=0, max=85, step=1, initial_value=45, visible=False)
        self._azimuth = gui.add_slider("azimuth, deg", min=-180, max=180, step=1, initial_value=90, visible=False,
                                       hint="0 right, 90 up")  # fmt: skip
        self._facts = gui.add_markdown("")
        desk.on_input(self._beside, lambda value: self._choose())
        for handle in (self._zenith, self._azimuth):
            desk.on_input(handle, lambda value: self._relight())

    def refresh(self) -> None:
        """Let the twin follow the frame."""
        desk = self._desk
        if self._reading != desk.reading:
            # What stood beside the photograph was taken away with what it was made of.
            self._reading, self._drawn, self._beside.value = desk.reading, None, NOTHING
        self._zenith.visible = self._azimuth.visible = self._beside.value == ANYWHERE
        if self._beside.value == SAME and self._drawn != (desk.reading, desk.frame, desk.look.brightness):
            self._drawn = (desk.reading, desk.frame, desk.look.brightness)
            picture, difference = twin_picture(desk.review, desk.frame, self._exposure())
            told = "" if np.isnan(difference) else f"; differs by {difference:.1%} of the object's brightness (median)"
            self._facts.content = f"The rendered frame of the same flash{told}."
            desk.beside = Beside(picture, "twin")

    def _choose(self) -> None:
        desk = self._desk
        self._drawn, self._facts.content = None, ""
        if self._beside.value == NOTHING:
            desk.stand_beside(None)
        elif self._beside.value == SAME:
            desk.choose(view="Photograph")
        else:
            self._relight()
        desk.refresh()

    def _exposure(self) -> Any:
        review = self._desk.review
        exposure = review.material.exposure
        if exposure is None:
            raise SceneError(f"frames: {review.missing['frames']} How bright the twin is shown goes by them.")
        return replace(exposure, white=exposure.white / self._desk.look.brightness)

    def _relight(self) -> None:
        desk = self._desk
        if self._scene is None or self._scene[0] != desk.reading:
            self._facts.content = "Loading the scan ..."
            self._scene = (desk.reading, relit_scene(desk.review))
        scene = self._scene[1]
        direction = toward(float(self._zenith.value), float(self._azimuth.value))
        lit = replace(scene, lights=one_light(scene.lights, direction), radii_mm=np.zeros(1))
        desk.preview.wish(desk.client.client_id, lit, 0, lambda drawn: desk.post(lambda: self._show(drawn)))

    def _show(self, drawn: Drawn) -> None:
        desk = self._desk
        if self._beside.value != ANYWHERE:
            return
        if drawn.picture is None:
            self._facts.content = f"**Not drawn.** {plain(drawn.fault)}"
            return
        stage = "refined" if drawn.is_refined else "first picture"
        self._facts.content = f"The scan with its measured albedo, matte, drawn small: {stage}, {drawn.seconds:.2f} s."
        desk.stand_beside(Beside(whole_picture(drawn.picture, self._exposure()), "light from anywhere"))
