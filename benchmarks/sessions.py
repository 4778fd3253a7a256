"""The whole way on sessions whose truth is known: those that others made, then the fixture; and what each verb costs.

`registered` hands other benchmarks what a method is given of a session.
"""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.calibration import SCENES, of_lights, read_truth, scenes_of
from benchmarks.harness import ROOT, SHARED, Figures, Scale, Table, folded, markdown, opened, ran
from compare.statistics.known_truth import reprojection_px
from lab.run import STEPS
from scene.camera import Camera
from scene.clock import now, since
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose

FIXTURE = ROOT / "fixtures" / "bumpy"
VERBS = ("check", "calibrate", "align", "solve", "twin", "compare")


class Registered(NamedTuple):
    """What a method is given of a session, the ground truth (H, W, 3), NaN where unknown, and the scan as it stands
    before the camera.
    """

    frames: Frames
    lights: Lights
    camera: Camera
    mask: NDArray[np.bool_]
    normals: NDArray
    surface: Mesh | None = None


@contextmanager
def registered(session: Path) -> Iterator[Registered]:
    """Hold a session for a block, as it is after `align`; raise SceneError where it does not get so far."""
    with tempfile.TemporaryDirectory() as out, opened(session, Path(out)) as job:
        job.run(STEPS, "align")
        store = job.store
        given = store.load_frames(), store.load_lights(), store.load_camera(), store.load_mask()
        surface = None
        if job.session.scan and not job.session.normals:
            scan = job.load_scan()
            surface = Mesh(store.load_pose().apply(scan.vertices), scan.faces)
        yield Registered(*given, store.load_normals("truth"), surface)


def with_truth() -> dict[str, Path]:
    """Return the sessions with a scan whose truth is known, by name: the fixture, which is ours, is the last."""
    scenes = [scene for home in (SHARED / "sessions", SCENES / "blender") for scene in scenes_of(home)]
    whole = {scene.name: scene / "whole" if (scene / "whole").is_dir() else scene for scene in scenes}
    bunny = {name: whole.pop(name) for name in ("bunny",) if name in whole}
    return {**bunny, **whole, "fixture": FIXTURE}


@dataclass(frozen=True)
class SessionRow:
    """What came of one session; None: it did not get so far, or the truth does not tell.

    Lights at the object. `truth`: of the ground truth against the true normals; methods (medians) against the true
    normals, against the ground truth, and on the twin against the ground truth.
    """

    session: str
    refused: str
    frames: int
    direction_median_deg: float | None = None
    direction_worst_deg: float | None = None
    position_median_percent: float | None = None
    intensity_rms_percent: float | None = None
    pose_rms_px: float | None = None
    pose_deg: float | None = None
    truth_median_deg: float | None = None
    ls_true_deg: float | None = None
    ls_deg: float | None = None
    ls_twin_deg: float | None = None
    iterative_true_deg: float | None = None
    iterative_deg: float | None = None
    iterative_twin_deg: float | None = None
    processor_s: float | None = None


def _whole(name: str, last: str) -> list[SessionRow]:
    session, refused, found = with_truth()[name], "", {}
    home = session.parent if session.name == "whole" else session
    truth, start = read_truth(home), now()
    with tempfile.TemporaryDirectory() as out, opened(session, Path(out)) as job:
        try:
            job.run(STEPS, last)
        except SceneError as error:
            refused = str(error).splitlines()[0]
        found["processor_s"] = since(start)["processor_seconds"]
        store, done = job.store, job.done
        if "calibrate" in done:
            direction, _, position, intensity = of_lights(store.load_lights(), truth)
            found |= {"direction_median_deg": np.median(direction), "direction_worst_deg": np.max(direction)}
            found["position_median_percent"] = np.median(position) if position else None
            found["intensity_rms_percent"] = np.sqrt(np.mean(np.square(intensity))) if intensity else None
        if "align" in done and truth.camera_from_scan is not None:
            pose, true = store.load_pose(), Pose(truth.camera_from_scan)
            found["pose_rms_px"] = reprojection_px(job.load_scan(), store.load_camera(), pose, true)
            found["pose_deg"] = (pose @ true.inverse()).angle_deg()
        if "align" in done and truth.normals is not None:
            found["truth_median_deg"] = _median(store.load_normals("truth"), truth.normals)
        for method in job.methods if "solve" in done else ():
            normals = store.load_normals(method)
            found[f"{method}_deg"] = _median(normals, store.load_normals("truth"))
            if truth.normals is not None:
                found[f"{method}_true_deg"] = _median(normals, truth.normals)
        for method, errors in done["compare"]["result"]["methods"].items() if "compare" in done else ():
            found[f"{method}_twin_deg"] = errors["twin"]["median_deg"]
    known = {key: None if value is None else float(value) for key, value in found.items()}
    return [SessionRow(name, refused, len(truth.lights_mm), **known)]


def _median(normals: NDArray, truth: NDArray) -> float:
    return float(np.nanmedian(angular_error_deg(normals, truth)))


def _sessions(scale: Scale) -> list[tuple]:
    names = list(with_truth())
    if scale == "small":
        return [("fixture", "check")]
    return [(name, "compare") for name in (names[:2] if scale == "gates" else names)]


def _shown(rows: Sequence[SessionRow]) -> str:
    of_way = markdown(
        {
            "session": "{session}, {frames} lights", "direction, median": "{direction_median_deg:.2f}°",
            "worst": "{direction_worst_deg:.2f}°", "position, of the distance": "{position_median_percent:.2f} %",
            "intensity, rms": "{intensity_rms_percent:.2f} %", "scan's pose, rms": "{pose_rms_px:.2f} px",
            "rotation": "{pose_deg:.3f}°", "ground truth off": "{truth_median_deg:.2f}°",
            "processor, s": "{processor_s:.0f}",
        },
        rows,
    )  # fmt: skip
    solved = [row for row in rows if row.ls_deg is not None]
    of_methods = markdown(
        {"median errors": "{session}"}
        | {f"`{method}`, {words}": f"{{{method}{key}_deg:.2f}}°" for method in ("ls", "iterative") for key, words in (
            ("_true", "true normals"), ("", "ground truth"), ("_twin", "twin"))},
        solved,
    )  # fmt: skip
    refused = folded("Refused", [f"{row.session}: {row.refused}" for row in rows if row.refused])
    return "\n".join([of_way, *([of_methods] if solved else []), refused])


def _figures(rows: Sequence[SessionRow]) -> Figures:
    names = [field.name for field in fields(SessionRow)[3:-1]]
    known = {f"{row.session}: {name}": getattr(row, name) for row in rows for name in names}
    refused = {"refused": float(sum(bool(row.refused) for row in rows))}
    return refused | {name: value for name, value in known.items() if value is not None}


@dataclass(frozen=True)
class VerbRow:
    """One verb of the command line on the fixture; what the verbs before it made is there. Memory: its own, at most."""

    verb: str
    processor_s: float
    wall_s: float
    own_gb: float


def _verbs(verbs: str) -> list[VerbRow]:
    rows, command = [], Path(sys.executable).with_name("rgbn")
    with tempfile.TemporaryDirectory() as out:
        for verb in verbs.split(","):
            wall, processor, own = ran([command, verb, FIXTURE, "--out", out, "-q"])
            rows.append(VerbRow(verb, processor, wall, own))
    return rows


def _of_verbs(rows: Sequence[Any]) -> str:
    columns = {"verb": "`rgbn {verb}`", "processor, s": "{processor_s:.1f}", "wall, s": "{wall_s:.1f}"}
    return markdown({**columns, "own memory, GB": "{own_gb:.2f}"}, rows)


TABLES = (
    Table("sessions", "sessions", ("lab.run",), SessionRow, _sessions, _whole, _shown, _figures),
    Table(
        "sessions", "verbs", ("rgbn.cli",), VerbRow,
        lambda scale: [("check" if scale == "small" else ",".join(VERBS),)], _verbs, _of_verbs,
        lambda rows: {f"{row.verb}: {name}": getattr(row, name) for row in rows for name in ("processor_s", "own_gb")},
        is_timed=True,
    ),
)  # fmt: skip
