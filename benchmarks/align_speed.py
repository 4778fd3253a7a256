"""How long `rgbn align` takes, stage by stage, and how much memory of its own it needs.

    .venv/bin/python -m benchmarks.align_speed FOLDER     # one session made before; prints JSON

Two sessions of a shape, a scan and lights as in benchmarks/align_sessions: the small one as photographed, the large one
photographed at 3000 x 2000 and enlarged to 24 megapixels. The step itself is run, on a store as `calibrate` leaves it.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from fixtures.mesh_shapes import subdivided
from scene.frames import Frames
from scene.record import Record
from scene.store import Store

ROOT = Path(__file__).resolve().parents[1]
SIZES = {
    "1200 x 800, 16 frames": {"width": 1200, "height": 800, "flashes": 16, "faces": 60_000, "enlarged": 1},
    "24 MP, 60 frames": {"width": 3000, "height": 2000, "flashes": 60, "faces": 1_000_000, "enlarged": 2},
}
STAGES = {
    "scan, read": "lab.job.Job.load_scan",
    "mask": "align.mask.object_mask.find_object",
    "photometric normals": "solve.solve.solve",
    "scan, normals": "align.scan.smooth_normals.smooth_normals",
    "registration": "align.pose.register.register",
    "ground truth": "align.truth.ground_truth",
    "pictures": "compare.report.registration_pictures.write_pictures",
}
REST = "the rest: files written, the final mask"


def time_sizes(shape: str, seed: int) -> dict[str, dict]:
    """Return what `time_step` says of both sessions, each aligned in a process of its own.

    The frames were just written: as far as memory goes, they are read from it, as after `check` and `calibrate`.
    """
    (ROOT / "out").mkdir(exist_ok=True)
    found = {}
    for size, wanted in SIZES.items():
        with tempfile.TemporaryDirectory(dir=ROOT / "out") as scratch:
            # Made in a process of its own too: its memory is given back.
            call = f"from benchmarks.align_speed import *; make(Path({scratch!r}), {shape!r}, {seed}, **{wanted!r})"
            subprocess.run([sys.executable, "-c", call], check=True, cwd=ROOT)
            command = [sys.executable, "-m", "benchmarks.align_speed", scratch]
            answer = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
        found[size] = json.loads(answer.stdout)
        print(f"{size}: {found[size]}", file=sys.stderr)
    return found


def make(folder: Path, name: str, seed: int, *, enlarged: int, faces: int, **size: int) -> None:
    """Photograph and scan a shape into a folder: a store as `calibrate` leaves it, and scan.ply."""
    import cv2
    import trimesh

    from benchmarks import align_sessions

    if faces > 100_000:
        fine = subdivided(align_sessions.shape(name))
        with patch.object(align_sessions, "shape", lambda _: fine):
            made = align_sessions.session(name, seed, faces=faces, **size)
    else:
        made = align_sessions.session(name, seed, faces=faces, **size)
    store, camera, frames = Store(folder), made.scene.camera, made.frames
    camera = camera.scaled(enlarged * camera.width, enlarged * camera.height, enlarged, enlarged)
    store.save_camera(camera)
    store.save_spheres([], camera)
    store.save_lights(made.lights, files=frames.names)

    def enlarge(codes: np.ndarray) -> np.ndarray:
        return cv2.resize(codes, (camera.width, camera.height), interpolation=cv2.INTER_CUBIC)

    path = store.path("frames", "codes.npy")
    path.parent.mkdir(parents=True, exist_ok=True)
    codes = np.lib.format.open_memmap(path, "w+", np.uint16, (len(frames), camera.height, camera.width, 3))
    for index in range(len(frames)):
        codes[index] = enlarge(frames.codes[index])
    codes.flush()
    assert frames.ambient is not None
    store.save_frames_header(
        Frames(frames.names, codes, frames.gain, enlarge(frames.ambient), frames.saturation, frames.is_mosaic)
    )
    trimesh.Trimesh(made.scan.vertices, made.scan.faces, process=False).export(folder / "scan.ply")


def time_step(folder: Path) -> dict[str, Any]:
    """Return the wall and processor seconds of the step's stages, and the peak of the process' own memory, GB."""
    from lab.job import Job
    from lab.steps import align

    store = Store(folder)
    flash = [Path(name) for name in store.load_frames().names]
    session: Any = SimpleNamespace(
        scan=folder / "scan.ply", scan_unit="mm", scan_ball_diameter_mm=None, mask=None, normals=None, picks=None,
        flash=flash,
    )  # fmt: skip
    spent: dict[str, list[float]] = {stage: [0.0, 0.0] for stage in STAGES}
    with _watched_memory() as peak, _timed(spent):
        start = _clocks()
        outcome = align(Job(session, Record(folder), ()))
        total = _clocks() - start
    rest = total - np.sum(list(spent.values()), axis=0)
    return {
        "stages": {**spent, REST: rest.tolist(), "all": total.tolist()},
        "gigabytes": max(peak),
        "cores": os.cpu_count(),
        "warnings": list(outcome.warnings),
    }


def _clocks() -> np.ndarray:
    return np.array([time.perf_counter(), time.process_time()])


@contextmanager
def _timed(spent: dict[str, list[float]]) -> Iterator[None]:
    """Add to `spent` what passes in each stage's function, outermost only: a stage may call another's."""
    inside: list[str] = []

    def wrap(stage: str, call: Callable) -> Callable:
        def timed(*given: Any, **named: Any) -> Any:
            inside.append(stage)
            start = _clocks()
            try:
                return call(*given, **named)
            finally:
                inside.pop()
                if not inside:
                    spent[stage] = (spent[stage] + _clocks() - start).tolist()

        return timed

    patches = []
    for stage, place in STAGES.items():
        owner, _, name = place.rpartition(".")
        holder = _find(owner)
        patches.append(patch.object(holder, name, wrap(stage, getattr(holder, name))))
    for one in patches:
        one.start()
    try:
        yield
    finally:
        for one in patches:
            one.stop()


def _find(place: str) -> Any:
    """Return a module, or a class in one, by its dotted name."""
    try:
        return import_module(place)
    except ModuleNotFoundError:
        module, _, name = place.rpartition(".")
        return getattr(import_module(module), name)


@contextmanager
def _watched_memory() -> Iterator[list[float]]:
    """Fill a list with the process' own memory, GB, every 20 ms: without the page cache, which holds the frames."""
    seen, done = [0.0], threading.Event()

    def watch() -> None:
        while not done.wait(0.02):
            own = next(
                line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("RssAnon")
            )
            seen.append(int(own.split()[1]) / 1e6)

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield seen
    finally:
        done.set()
        thread.join()


if __name__ == "__main__":
    print(json.dumps(time_step(Path(sys.argv[1]))))
