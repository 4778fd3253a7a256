"""Peak memory of `ls` and `iterative` on 24 megapixels x 60 frames; written into docs/evidence/methods.md.

    .venv/bin/python -m benchmarks.bench_solve_memory [--write]

The stack is read through a memory map from a temporary file of 8.6 GB. Own memory is what the process must have; mapped
pages of the file are the system's to drop.
"""

import argparse
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from benchmarks.bench_solve import ball
from benchmarks.pages import put
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from solve.solve import solve

PAGE = Path(__file__).resolve().parents[1] / "docs" / "evidence" / "methods.md"
WIDTH, HEIGHT, FRAMES = 6000, 4000, 60


class Watch(threading.Thread):
    """Notes the most memory that the process had, in GB."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.own = 0.0
        self.start()

    def run(self) -> None:
        while True:
            for line in Path("/proc/self/status").read_text().splitlines():
                if line.startswith("RssAnon"):
                    self.own = max(self.own, int(line.split()[1]) / 2**20)
            time.sleep(0.02)


def main() -> None:
    """Measure, print, and with --write put the table into docs/evidence/methods.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    frames, lights, *_ = ball(500)
    names = frames.names[:FRAMES]
    lines = ["| 24 megapixels x 60 | own memory, peak | wall, s | processor, s |", "|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "codes.npy"
        codes = np.lib.format.open_memmap(path, mode="w+", dtype=np.uint16, shape=(FRAMES, HEIGHT, WIDTH, 3))
        for code, tile in zip(codes, frames.codes, strict=False):
            code[:] = np.tile(tile, (HEIGHT // 500, WIDTH // 500, 1))
        codes.flush()
        stack = Frames(names, np.load(path, mmap_mode="r"), np.ones(FRAMES))
        given = Lights(names, lights.directions[:FRAMES], lights.intensities[:FRAMES])
        mask, camera = np.ones((HEIGHT, WIDTH), bool), Camera.orthographic(WIDTH, HEIGHT)
        watch, kept = Watch(), []
        for method in ("ls", "iterative"):
            wall, cpu = time.perf_counter(), time.process_time()
            # Both results stay, as they do in a run of both.
            kept.append(solve(method, stack, given, camera, mask))
            lines.append(
                f"| {'then ' if len(kept) > 1 else ''}`{method}` | {watch.own:.2f} GB | "
                f"{time.perf_counter() - wall:.0f} | {time.process_time() - cpu:.0f} |"
            )
    print("\n".join(lines))
    if arguments.write:
        text = "\n".join([*lines, "", "By `benchmarks/bench_solve_memory.py`.", ""])
        put(PAGE, "memory", text)


if __name__ == "__main__":
    main()
