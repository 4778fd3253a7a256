"""How long calibrate takes on 60 frames of 24 megapixels, against LibRaw's decode of the same files in the same run.

The frames are DNG files of the virtual camera: 12 different flashes, each file listed five times. Both times are on
warm files: the decode reads files that were just written, calibrate a stack that was just decoded.
"""

import json
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import datetime
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.calibration_sessions import CAMERA, session_world
from fixtures.ball_scene import radiance
from twin.camera.virtual_camera import Sensor, expose, write_dng

ROOT = Path(__file__).resolve().parents[1]
REPEATS = 5

DECODE = """
import sys, time
from concurrent.futures import ThreadPoolExecutor
import rawpy
def work(path):
    with rawpy.imread(path) as raw:
        return raw.postprocess(
            demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR, user_wb=[1, 1, 1, 1], output_color=rawpy.ColorSpace.raw,
            gamma=(1, 1), no_auto_bright=True, adjust_maximum_thr=0, output_bps=16, user_flip=0).shape
start = time.perf_counter()
with ThreadPoolExecutor(2) as pool:
    list(pool.map(work, sys.argv[1:]))
print(time.perf_counter() - start)
"""

CALIBRATE = """
import json, sys, threading, time
import lab  # before numpy: the command line's setting of OpenBLAS
import numpy as np
from benchmarks.calibration_speed import world_of_size
from calibrate.calibrate import calibrate
from scene.camera import Camera
from scene.frames import Frames
codes = np.load(sys.argv[1], mmap_mode="r")
world = world_of_size(codes.shape[2], codes.shape[1])
frames = Frames(tuple(f"flash_{i:03d}" for i in range(len(codes))), codes, np.ones(len(codes)), is_mosaic=True)
requests = world.requests()
memory = []
def watch():
    while True:
        memory.append(int(next(l for l in open("/proc/self/status") if l.startswith("RssAnon")).split()[1]) / 1e6)
        time.sleep(0.05)
threading.Thread(target=watch, daemon=True).start()
start = time.perf_counter()
result = calibrate(frames, world.camera, requests)
seconds = time.perf_counter() - start
print(json.dumps({"seconds": seconds, "spheres": len(result.spheres), "private_gb": max(memory)}))
"""


def world_of_size(width: int, height: int):
    """Return the world of a session "two" (seed 900), seen by a sensor of this size."""
    world = session_world(900, "two")
    f = width / CAMERA.width
    return replace(world, camera=CAMERA.scaled(width, height, f, f))


def write_frames(folder: Path, first: int, last: int, width: int, height: int) -> None:
    """Photograph the flashes from first to last; write DNG files, a few at a time to bound the memory."""
    world, sensor = world_of_size(width, height), Sensor(blur_px=0.9)
    for start in range(first, last, 3):
        frames = slice(start, min(start + 3, last))
        images, _ = radiance(world, frames, blur_px=sensor.blur_px)
        for index, image in enumerate(images, start):
            mosaic = expose(image, replace(sensor, blur_px=0.0), np.random.default_rng([900, index]))
            facts = {"exposure_s": 0.01, "iso": 100, "aperture": 8.0, "focal_mm": 50.0}
            write_dng(folder / f"{index:03d}.dng", mosaic, sensor, **facts, time=datetime(2026, 1, 1, 12, 0, index))


def measure(width: int = 6000, height: int = 4000) -> dict[str, float]:
    """Return the seconds of LibRaw and of calibrate, and calibrate's peak memory."""
    from capture.photographs.raw import read_raw

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            halves = [pool.submit(write_frames, folder, a, a + 6, width, height) for a in (0, 6)]
            for half in halves:
                half.result()
        files = sorted(folder.glob("*.dng")) * REPEATS
        codes = np.lib.format.open_memmap(folder / "codes.npy", "w+", np.uint16, (len(files), height, width, 3))
        for index, file in enumerate(files[:12]):
            codes[index::12] = read_raw(file).codes
        codes.flush()
        del codes
        decode = float(_run(DECODE, *map(str, files)))
        ours = json.loads(_run(CALIBRATE, str(folder / "codes.npy")))
    return {"frames": len(files), "megapixels": width * height / 1e6, "decode_s": decode, **ours}


def _run(program: str, *arguments: str) -> str:
    """Return what a process of its own prints."""
    run = subprocess.run([sys.executable, "-c", program, *arguments], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    if run.returncode:
        raise SystemExit(f"exit code {run.returncode}")
    return run.stdout
