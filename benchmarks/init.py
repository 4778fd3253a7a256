"""From photographs alone to lights: what `rgbn init` finds in a folder, and what lights are worth without a camera.

The photographs of a scene get names that tell nothing. A ball that is found gets its true diameter, as a person would
give it; the camera is given, or told by the balls, or, without diameters too, orthographic. Directions are those from
the middle of the balls.
"""

import json
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.calibration import SCENES, is_same, read_truth, scenes_of
from benchmarks.calibration_sessions import directions_to
from benchmarks.harness import ROOT, SHARED, Figures, Scale, Table, markdown, opened
from capture.session.session_types import Lens
from capture.survey.folder_files import survey
from lab.init.answers import Answers, Asking
from lab.init.draft import Draft, DraftBall
from lab.init.prepare import prepare
from lab.init.session_text import session_text
from lab.plan import STEPS
from scene.clock import now, since
from scene.errors import SceneError
from scene.normals import angular_error_deg
from scene.spheres import Sphere

CAMERAS = ("known", "by the balls", "orthographic")


@dataclass(frozen=True)
class InitRow:
    """One scene with one camera; `source`: where `calibrate` has it from. None: not to be had."""

    scene: str
    roles_right: bool
    balls: int
    found: int
    false: int
    processor_s: float
    camera: str = ""
    refused: str = ""
    source: str = ""
    direction_deg: float | None = None
    sigma_deg: float | None = None
    focal_off_percent: float | None = None


def _described(folder: str, cameras: tuple[str, ...]) -> list[InitRow]:
    scene, true = Path(folder), read_truth(Path(folder)).balls

    def diameter(ball: DraftBall) -> float | None:
        found = Sphere(ball.kind, np.array(ball.center_px), ball.radius_px)
        return next((one.diameter_mm for one in true if is_same(found, one)), None)

    with tempfile.TemporaryDirectory() as place:
        capture = Path(place) / "capture"
        capture.mkdir()
        shots = sorted(path for some in ("asked/*.png", "raw/*.dng") for path in scene.glob(some))
        names = {path: f"IMG_{number}{path.suffix}" for number, path in enumerate(shots, 100)}
        for path, name in names.items():
            shutil.copy(path, capture / name)
        start = now()
        draft = prepare(survey(capture)[0], Asking(Answers(linear=True), silent=True))
        spent = since(start)["processor_seconds"]
        ambient = {name for path, name in names.items() if path.name.startswith("ambient")}
        right = {path.name for path in draft.photographs.get("ambient", [])} == ambient
        draft = replace(draft, balls=tuple(replace(one, diameter_mm=diameter(one)) for one in draft.balls))
        found = sum(ball.diameter_mm is not None for ball in draft.balls)
        row = InitRow(scene.name, right, len(true), found, len(draft.balls) - found, spent)
        return [_lit(replace(row, camera=camera), draft, scene, Path(place) / camera) for camera in cameras] or [row]


def _lit(row: InitRow, draft: Draft, scene: Path, out: Path) -> InitRow:
    """Calibrate, and hold the lights' directions against the truth, seen from where they hold."""
    said = json.loads((scene / "truth.json").read_text())
    if row.camera == "known":
        draft = replace(draft, lens=Lens(fx=said["fx"], cx=said["cx"], cy=said["cy"]))
    elif row.camera == "orthographic":
        draft = replace(draft, balls=tuple(replace(ball, diameter_mm=None) for ball in draft.balls))
    (draft.folder / "session.toml").write_text(session_text(draft))
    try:
        with opened(draft.folder, out) as job:
            job.run(STEPS, "calibrate")
            lights, camera = job.store.load_lights(), job.store.load_camera()
    except SceneError as error:
        return replace(row, refused=str(error).splitlines()[0])
    middle = np.mean([ball["centre_mm"] for ball in said["spheres"]], axis=0)
    if lights.positions_mm is not None:
        # The same point among the balls: what a focal length scales is the depth.
        lights = lights.seen_from(middle * [1, 1, camera.fx / said["fx"]])
    error = np.median(angular_error_deg(lights.directions, directions_to(read_truth(scene).lights_mm, middle)))
    sigma = None if lights.direction_sigma_deg is None else float(np.median(lights.direction_sigma_deg))
    focal = 100 * (camera.fx / said["fx"] - 1) if camera.source == "balls" else None
    told = {"source": camera.source, "direction_deg": float(error), "sigma_deg": sigma, "focal_off_percent": focal}
    return replace(row, **told)


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(str(ROOT / "fixtures" / "bumpy"), ())]
    scenes = [*scenes_of(SHARED / "sessions")[:5], *scenes_of(SCENES / "mitsuba")[:6]]
    return [(str(scene), CAMERAS) for scene in (scenes[:1] if scale == "gates" else scenes)]


def _shown(rows: Sequence[InitRow]) -> str:
    scenes = {row.scene: row for row in rows}.values()
    text = (
        f"{len(scenes)} folders. The ambient frame was told from the others in {sum(row.roles_right for row in scenes)}"
        f"; {sum(row.found for row in scenes)} of {sum(row.balls for row in scenes)} balls were found, "
        f"{sum(row.false for row in scenes)} circles were none. "
        f"{np.median([row.processor_s for row in scenes]):.0f} processor seconds a folder (median).\n\n"
    )
    return text + markdown(
        {
            "scene": "{scene}", "camera": "{camera}", "told by": "{source}{refused}",
            "direction, median": "{direction_deg:.2f}°", "stated sigma": "{sigma_deg:.2f}°",
            "focal length off by": "{focal_off_percent:+.1f} %",
        },
        rows,
    )  # fmt: skip


def _figures(rows: Sequence[InitRow]) -> Figures:
    found: Figures = {
        "balls found": float(sum(row.found for row in rows)),
        "false": float(sum(row.false for row in rows)),
    }
    for camera in CAMERAS:
        errors = [row.direction_deg for row in rows if row.camera == camera and row.direction_deg is not None]
        found |= {f"camera {camera}: direction_median_deg": float(np.median(errors))} if errors else {}
    return found


TABLES = (
    Table("first-capture", "init", ("lab.init.prepare", "lab.run"), InitRow, _cases, _described, _shown, _figures),
)  # fmt: skip
