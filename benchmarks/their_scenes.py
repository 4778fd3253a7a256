"""Scenes by somebody else's renderer: `scene_*/asked/` and `scene_*/unasked/`, sessions with and without `[[spheres]]`,
and `scene_*/truth.json`: `table`, `room`, `fx`, `light_positions_mm`, and `spheres` with `kind`, `diameter_mm`,
`centre_mm`, `centre_px`.
"""

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere, SphereRequest

SAME, SAME_PX = 0.04, 1.5  # share of the radius, and pixels at least, by which a found ball's circle may differ


def scenes_in(folder: Path) -> list[Path]:
    return [path.parent for path in sorted(folder.glob("scene_*/truth.json"))]


def read_truth(scene: Path) -> tuple[dict[str, Any], list[Sphere]]:
    """Return what truth.json says, and its balls."""
    truth = json.loads((scene / "truth.json").read_text())
    balls = []
    for one in truth["spheres"]:
        radius = truth["fx"] * one["diameter_mm"] / 2 / -one["centre_mm"][2]
        balls.append(Sphere(one["kind"], np.array(one["centre_px"]), radius, one["diameter_mm"]))
    return truth, balls


@contextmanager
def opened(scene: Path, mode: str) -> Iterator[tuple[Frames, Camera, list[SphereRequest]]]:
    """Decode the session of a scene; it is there as long as the context."""
    from capture.camera.session_camera import camera_of
    from capture.photographs.decode import decode
    from capture.session.requests import sphere_requests
    from capture.session.session import load_session
    from scene.store import Store

    with tempfile.TemporaryDirectory() as folder:
        session, store = load_session(scene / mode), Store(Path(folder))
        frames, report = decode(session, store)
        camera, _ = camera_of(session, report.exif, frames.width, frames.height)
        yield frames, camera, sphere_requests(session, store)[0]


def is_same(found: Sphere, true: Sphere) -> bool:
    """Whether a found ball is the true one."""
    off = max(float(np.hypot(*(found.center_px - true.center_px))), abs(found.radius_px - true.radius_px))
    return found.kind == true.kind and off < max(SAME_PX, SAME * true.radius_px)
