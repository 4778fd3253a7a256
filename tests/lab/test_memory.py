"""How much memory of its own a step needs: it must not depend on how many photographs there are."""

import json
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from align.truth import ground_truth
from fixtures.mesh_scene import random_scene
from fixtures.mesh_shapes import blob, scan_of
from lab.job import Job
from lab.options import Settings
from lab.steps import compare, solve
from lab.twin_step import twin
from scene.frames import Frames
from scene.lights import Lights, known_median
from scene.record import Record
from scene.store import Store
from tests.conftest import ROOT

WIDTH, HEIGHT, FLASHES, TIMES = 900, 600, 6, 12
STEPS = {"solve": solve, "twin": twin, "compare": compare}


class OwnMemory(threading.Thread):
    """Looks every 20 ms at how much anonymous memory this process has: `peak`, GB, is the most since it was set to 0.

    Without the page cache, which holds the frames.
    """

    def __init__(self):
        super().__init__(daemon=True)
        self.peak, self.done = 0.0, threading.Event()
        self.start()

    def run(self):
        while not self.done.wait(0.02):
            status = Path("/proc/self/status").read_text()
            self.peak = max(self.peak, int(status.split("RssAnon:")[1].split()[0]) * 1024 / 1e9)


def registered(folder, times):
    """Return a job as `align` leaves it, each photograph `times` times."""
    import trimesh

    mesh = scan_of(blob(), np.random.default_rng(10_074), faces=20_000, noise_mm=0.0)
    scene = random_scene(mesh, 4, width=WIDTH, height=HEIGHT, flashes=FLASHES)
    frames, lights, store = scene.photograph(), scene.lights, Store(folder)
    names = tuple(f"flash_{index:03d}" for index in range(times * FLASHES))
    codes = np.concatenate([frames.codes] * times)
    store.save_frames(Frames(names, codes, np.ones(len(names)), frames.ambient, is_mosaic=True))
    every = [np.concatenate([part] * times) for part in (lights.directions, lights.intensities, lights.positions_mm)]
    store.save_lights(Lights(names, *every, lights.reference_point_mm))
    truth = ground_truth(mesh, scene.pose, scene.camera)
    store.save_camera(scene.camera)
    store.save_spheres([], scene.camera)
    store.save_mask(truth.mask)
    store.save_truth(truth.normals, truth.sigma_deg)
    store.save_pose(scene.pose, residual_px=0.0, sigma_mm=0.0, sigma_deg=0.0)
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(folder / "scan.ply")
    session = SimpleNamespace(
        scan=folder / "scan.ply", scan_unit="mm", scan_ball_diameter_mm=None, tolerance_deg=None, spheres=()
    )
    settings = Settings("ls,iterative", engine="many", error=0.3)
    return Job(session, Record(folder), settings)


def print_peaks(folder, times):
    """Print the most memory (GB) that each step needs, as JSON."""
    job, watch, peaks = registered(folder, times), OwnMemory(), {}
    for name, step in STEPS.items():
        watch.peak = 0.0
        step(job)
        peaks[name] = watch.peak
    watch.done.set()
    watch.join()
    print(json.dumps(peaks))


@pytest.mark.full
@pytest.mark.render
def test_a_step_needs_no_more_memory_for_twelve_times_the_frames(tmp_path):
    few, many = {}, {}
    for times, peaks in ((1, few), (TIMES, many)):
        (tmp_path / str(times)).mkdir()
        call = f"from tests.lab.test_memory import *; print_peaks(Path({str(tmp_path / str(times))!r}), {times})"
        command = [sys.executable, "-c", call]
        peaks |= json.loads(subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout)
    grown = {name: many[name] - few[name] for name in STEPS}
    # The photographs' codes, mapped from their file, are this much more; in float32 they were twice as much.
    codes_gb = (TIMES - 1) * FLASHES * WIDTH * HEIGHT * 3 * 2 / 1e9
    assert max(grown.values()) < codes_gb, grown


def test_the_median_of_a_map_is_that_of_all_its_numbers():
    """Without a copy of the whole map in float64: what is infinite counts, what is unknown does not."""
    values = np.random.default_rng(10_073).random((60, 80)).astype(np.float32)
    values[::3], values[1::6] = np.nan, np.inf
    assert known_median(values) == np.nanmedian(values.astype(np.float64))
    assert known_median(values[::3]) is None
    assert known_median(np.full(3, np.inf)) is None
    assert known_median(None) is None
