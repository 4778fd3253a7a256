"""Peak memory of the engines `direct` and `many` on 24 megapixels and a million triangles; into docs/evidence/twin.md.

    .venv/bin/python -m benchmarks.bench_twin_memory [--write]

A relief that fills the picture, four distant lights, true maps included; each engine in a process of its own. Own
memory is what the process must have; mapped pages of the frames' file are the system's to drop.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.bench_solve_memory import Watch
from benchmarks.pages import put
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from scene.store import Store
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Diffuse
from twin.description.object_mesh import ObjectMesh
from twin.engines.render import render_scene

PAGE = Path(__file__).resolve().parents[1] / "docs" / "evidence" / "twin.md"
WIDTH, HEIGHT, LIGHTS, SIDE, PATHS = 6000, 4000, 4, 708, 4
ENGINES = "direct", "many"


def relief(engine: str) -> TwinScene:
    """Return hills of 2 (SIDE - 1)^2 triangles before a camera that they fill."""
    y, x = np.mgrid[:SIDE, :SIDE] / (SIDE - 1) * 2 - 1
    z = 0.08 * np.sin(9 * x + 2 * y) * np.cos(7 * y) + 0.02 * np.sin(60 * x) * np.sin(50 * y)
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    across, down, both = corner + 1, corner + SIDE, corner + SIDE + 1
    faces = np.concatenate([np.stack([corner, across, down], 1), np.stack([across, both, down], 1)])
    mesh = ObjectMesh(np.stack([150 * x, 100 * y, 150 * z - 600], -1).reshape(-1, 3), faces, None, None)
    angle = np.arange(LIGHTS) * 2 * np.pi / LIGHTS
    directions = unit(np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), np.ones(LIGHTS)], -1))
    names = tuple(f"light_{index}" for index in range(LIGHTS))
    camera = Camera(WIDTH, HEIGHT, 2.0 * WIDTH, 2.0 * WIDTH, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    return TwinScene(
        camera,
        (TwinObject("relief", mesh, "grey"),),
        {"grey": Diffuse((0.6, 0.6, 0.6))},
        Lights(names, directions, np.ones((LIGHTS, 3))),
        sampling=Sampling(engine, samples=PATHS, max_depth=3, error=0.01),  # type: ignore[arg-type]
    )


def measure(engine: str) -> str:
    """Render in this process, and return the table's row."""
    watch, scene = Watch(), relief(engine)
    with tempfile.TemporaryDirectory() as folder:
        wall, processor = time.perf_counter(), time.process_time()
        rendered = render_scene(scene, store=Store(Path(folder)))
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        assert rendered.choice.engine == engine
    return f"| `{engine}` | {watch.own:.1f} GB | {wall:.0f} | {processor:.0f} |"


def main() -> None:
    """Measure, print, and with --write put the table into docs/evidence/twin.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--engine", choices=ENGINES, help="Measure this one here, and print its row alone.")
    arguments = parser.parse_args()
    if arguments.engine:
        print(measure(arguments.engine))
        return
    lines = [
        f"| 24 megapixels x {LIGHTS}, {2 * (SIDE - 1) ** 2 / 1e6:.1f} million triangles | own memory, peak | wall, s "
        "| processor, s |",
        "|---|---|---|---|",
    ]
    for engine in ENGINES:
        command = [sys.executable, "-m", "benchmarks.bench_twin_memory", "--engine", engine]
        lines.append(subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip())
    text = "\n".join([*lines, "", "`many` with 4 paths a pixel; on 2 cores, by `benchmarks/bench_twin_memory.py`.", ""])
    print(text)
    if arguments.write:
        put(PAGE, "memory", text)


if __name__ == "__main__":
    main()
