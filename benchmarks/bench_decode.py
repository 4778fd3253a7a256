"""Decode speed and memory: this project's RAW decode against LibRaw's own, on the same files, in one run.

    python benchmarks/bench_decode.py [SESSION]

Without a session: frames of 24 megapixels (Bayer DNG, 14 bits, uncompressed), written to a temporary folder. The first
table decodes one file on one thread; the second a whole session, audit included, and the process' peak memory.
"""

import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from datetime import datetime
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

LIBRAW = """
import rawpy
locked = dict(
    demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR, user_wb=[1, 1, 1, 1], output_color=rawpy.ColorSpace.raw,
    gamma=(1, 1), no_auto_bright=True, adjust_maximum_thr=0, output_bps=16, user_flip=0,
)
"""


def synthetic_session(folder: Path, *, count: int, height: int, width: int) -> Path:
    """Write flash frames of smooth light, texture and noise, and a session.toml."""
    from twin.camera.virtual_camera import Sensor, write_dng

    rng = np.random.default_rng(0)
    v, u = np.mgrid[:height, :width].astype(np.float32) / width
    texture = rng.integers(-300, 300, (height, width), dtype=np.int16)
    for i in range(count):
        angle = 2 * np.pi * i / count
        light = 4000 + 2000 * (np.cos(angle) * (u - 0.5) + np.sin(angle) * (v - 0.3))
        write_dng(
            folder / f"flash_{i:03d}.dng",
            (light + texture).astype(np.uint16),
            Sensor(),
            exposure_s=0.01,
            iso=100,
            aperture=8.0,
            focal_mm=50.0,
            time=datetime(2026, 1, 1, 12, 0, i),
        )
    (folder / "session.toml").write_text('[frames]\nflash = "flash_*.dng"\n')
    return folder


def seconds(work, repeats: int = 5) -> float:
    """Return the shortest of several runs."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def one_file(path: Path) -> None:
    import rawpy

    from capture.photographs.raw import read_raw

    scope: dict = {}
    exec(LIBRAW, scope)

    def libraw():
        with rawpy.imread(str(path)) as raw:
            raw.postprocess(**scope["locked"])

    def unpack():
        with rawpy.imread(str(path)) as raw:
            raw.raw_image_visible.max()

    theirs, ours = seconds(libraw), seconds(lambda: read_raw(path))
    print(f"{path.name}, one thread of the caller's")
    print(f"  LibRaw, locked, linear   {theirs * 1e3:8.1f} ms")
    print(f"  read_raw                 {ours * 1e3:8.1f} ms   {theirs / ours:.2f} times as fast")
    print(f"  read_raw, half           {seconds(lambda: read_raw(path, half=True)) * 1e3:8.1f} ms")
    print(f"  unpacking alone          {seconds(unpack) * 1e3:8.1f} ms")


def whole_session(folder: Path) -> None:
    """Time in processes of their own, so that each has its own peak memory."""
    programs = {
        "LibRaw, a thread a core, into arrays": LIBRAW
        + """
from concurrent.futures import ThreadPoolExecutor
import os
from capture.session.session import load_session
def work(path):
    with rawpy.imread(str(path)) as raw:
        return raw.postprocess(**locked).shape
session = load_session(sys.argv[1])
start = time.perf_counter()
with ThreadPoolExecutor(os.cpu_count()) as pool:
    list(pool.map(work, session.flash + session.ambient))
""",
        "decode, with store and audit": """
from capture.photographs.decode import decode
from capture.session.session import load_session
from scene.store import Store
session = load_session(sys.argv[1])
start = time.perf_counter()
decode(session, Store(Path(sys.argv[2])))
""",
    }
    print(f"\n{folder.name}, whole session: seconds, peak MB of memory of its own, peak MB of mapped files")
    for name, program in programs.items():
        source = "import sys, time\nfrom pathlib import Path\nsys.path.insert(0, sys.argv[3])\n" + program
        source += "\nprint(time.perf_counter() - start)"
        with tempfile.TemporaryDirectory() as out:
            words = [sys.executable, "-c", source, str(folder), out, str(Path(__file__).parents[1])]
            process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
            peak, mapped = watch(process)
            assert process.stdout
            print(f"  {name:40s} {float(process.stdout.read()):8.2f}   {peak:8.0f} {mapped:8.0f}")


def watch(process: subprocess.Popen) -> tuple[float, float]:
    """Return the greatest private memory and the greatest mapped-file memory of a process, MB, looked at often."""
    peak = mapped = 0.0
    while process.poll() is None:
        try:
            lines = dict(line.split(":", 1) for line in Path(f"/proc/{process.pid}/status").read_text().splitlines())
            peak = max(peak, int(lines["RssAnon"].split()[0]) / 1024)
            mapped = max(mapped, int(lines["RssFile"].split()[0]) / 1024)
        except (OSError, KeyError):
            peak = max(peak, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)
        time.sleep(0.02)
    return peak, mapped


def main() -> None:
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    with tempfile.TemporaryDirectory() as scratch:
        if len(sys.argv) > 1:
            folder = Path(sys.argv[1]).resolve()
        else:
            folder = Path(scratch) / "24 megapixels"
            folder.mkdir()
            synthetic_session(folder, count=12, height=4000, width=6000)
        from capture.session.session import load_session

        one_file(load_session(folder).flash[0])
        whole_session(folder)


if __name__ == "__main__":
    main()
