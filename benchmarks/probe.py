"""Lights by the scan alone: no ball, no light file. Seeds 6000 to 6005 were untouched while the method was made."""

import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from align.light_probe.from_scan import lights_from_scan
from align.mask.object_mask import find_object
from align.pose.photographed import Photographs
from align.scan.smooth_normals import smooth_normals
from benchmarks.align_sessions import session
from benchmarks.calibration import Truth, of_lights, read_truth, scenes_of
from benchmarks.harness import ROOT, SHARED, Figures, Scale, Table, markdown, opened, spread
from benchmarks.real_captures import REAL
from benchmarks.real_surfaces import diligent_object, moved_scan
from lab.run import STEPS
from scene.camera import Camera
from scene.clock import now, since
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster

SHAPES, FIRST_SEED = ("blob", "knot", "relief", "mug", "dented_pear", "potato"), 6000
SIZE = {"width": 960, "height": 640, "flashes": 16, "faces": 50_000}
SMALL = {"width": 240, "height": 160, "flashes": 6, "faces": 4_000}
"""There the pose is given, some pixels off: to look for it takes the most time."""
SHOTS, FAR_MM = 32, 1e7
"""Of DiLiGenT's 96; where distant lights are put."""


class Told(NamedTuple):
    """What a scan told, and the truth; `pose_deg` None: the object is round."""

    name: str
    lights: Lights
    truth: Truth
    pose_deg: float | None


@dataclass(frozen=True)
class ProbeRow:
    """One object: errors of each light, at the object; its pose's; None: not to be had."""

    group: str
    name: str
    refused: str
    model: str
    direction_deg: tuple[float, ...]
    position_percent: tuple[float, ...]
    intensity_percent: tuple[float, ...]
    sigma_deg: float | None
    pose_deg: float | None
    processor_s: float


def _off_deg(pose: Pose, true: Pose) -> float:
    return (pose @ true.inverse()).angle_deg()


def _asked(
    scan: Mesh, camera: Camera, frames: Frames, mask: np.ndarray, start: Pose | None = None
) -> tuple[Lights, Pose]:
    normals, sigma_deg = smooth_normals(scan)
    photographs = Photographs(camera, frames, Lights.unknown(frames.names), mask)
    found = lights_from_scan(RayCaster(scan, normals), sigma_deg, photographs, start=start)
    return found.lights, found.pose


def _of_session(folder: str) -> Told:
    """Take the balls out of a session with a scan, and register it."""
    scene = Path(folder)
    manifest = next(path for path in (scene / "whole" / "session.toml", scene / "session.toml") if path.is_file())
    text = re.sub(r"\[\[spheres\]\]\n(?:[^\[\n].*\n|\n)*", "", manifest.read_text() + "\n")
    with tempfile.TemporaryDirectory() as place:
        here = Path(place) / "scene" / manifest.relative_to(scene)
        here.parent.mkdir(parents=True)
        for one in set(scene.iterdir()) - {manifest, manifest.parent}:
            (Path(place) / "scene" / one.name).symlink_to(one.resolve())
        here.write_text("spheres = []\n" + text)
        with opened(here.parent, Path(place) / "out") as job:
            job.run(STEPS, "align")
            lights, pose = job.store.load_lights(), job.store.load_pose()
    truth = read_truth(scene)
    assert truth.camera_from_scan is not None
    return Told(scene.name, lights, truth, _off_deg(pose, Pose(truth.camera_from_scan)))


def _diligent(name: str) -> Told:
    """Return what the surface of DiLiGenT's given normals tells."""
    made = diligent_object(name, "orthographic", shots=SHOTS)
    scan, true = moved_scan(made.surface, 1)
    lights, pose = _asked(scan, made.camera, made.frames, made.mask)
    truth = Truth([], FAR_MM * made.lights.directions, made.lights.intensities)
    return Told(f"DiLiGenT's {name}", lights, truth, None if name == "ball" else _off_deg(pose, true))


def _virtual(number: int, scale: Scale) -> Told:
    """Return what the scan of a shape tells; positions as seen from the scan, wherever it is thought to be."""
    made = session(SHAPES[number], FIRST_SEED + number, **(SMALL if scale == "small" else SIZE))
    camera, true, mask = made.scene.camera, made.scene.lights, find_object(made.frames, made.scene.camera, []).mask
    lights, pose = _asked(made.scan, camera, made.frames, mask, made.pose if scale == "small" else None)
    assert true.positions_mm is not None
    away = np.linalg.norm(true.positions_mm - true.reference_point_mm, axis=1, keepdims=True)
    places = true.positions_mm - made.pose.apply(made.scan.center_mm) + lights.reference_point_mm
    name, truth = f"{SHAPES[number]}, gloss {made.scene.gloss:g}", Truth([], places, true.intensities * away**2)
    return Told(name, lights, truth, _off_deg(pose, made.pose))


KINDS: dict[str, Callable[..., Told]] = {
    "photographs by others": _diligent,
    "rendered by others": _of_session,
    "the fixture": _of_session,
    "virtual": _virtual,
}


def _measured(group: str, *case: Any) -> list[ProbeRow]:
    start = now()
    try:
        told = KINDS[group](*case)
    except SceneError as error:
        return [ProbeRow(group, Path(str(case[0])).name, str(error), "", (), (), (), None, None, 0.0)]
    spent = since(start)["processor_seconds"]
    direction, sigma, position, intensity = of_lights(told.lights, told.truth)
    return [
        ProbeRow(
            group, told.name, "", told.lights.model, direction, position, tuple(np.abs(intensity)),
            float(np.median(sigma)), told.pose_deg, spent,
        )
    ]  # fmt: skip


def _cases(scale: Scale) -> list[tuple]:
    fixture, ours = (
        ("the fixture", str(ROOT / "fixtures" / "bumpy")),
        [("virtual", n, scale) for n in range(len(SHAPES))],
    )
    if scale != "full":
        return ours[:1] if scale == "small" else [fixture, *ours[1:3]]
    photographs = [("photographs by others", name) for name in ("cat", "ball")]
    rendered = [("rendered by others", str(one)) for one in scenes_of(SHARED / "sessions")]
    return [*(photographs if REAL.is_dir() else ()), *rendered, fixture, *ours]


def _figures(rows: Sequence[ProbeRow]) -> Figures:
    lit = [row for row in rows if not row.refused]
    return {f"{row.name}: direction_median_deg": float(np.median(row.direction_deg)) for row in lit} | {
        f"{row.name}: position_median_percent": float(np.median(row.position_percent))
        for row in lit
        if row.position_percent
    }


TABLES = (
    Table(
        "calibration", "scan as probe", ("lab.run",), ProbeRow, _cases, _measured,
        lambda rows: markdown(
            {
                "session": "{group}", "object": "{name}", "lights": "{model}{refused}",
                "direction, degrees: median / p95": "{direction}", "stated sigma": "{sigma_deg:.2f}°",
                "position, % of the distance": "{position}", "intensity, %": "{intensity}", "pose": "{pose_deg:.2f}°",
                "processor, s": "{processor_s:.0f}",
            },
            [
                vars(row) | {
                    "direction": spread(row.direction_deg), "position": spread(row.position_percent),
                    "intensity": spread(row.intensity_percent),
                }
                for row in rows
            ],
        ),
        _figures,
    ),
)  # fmt: skip
