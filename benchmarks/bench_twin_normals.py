"""What an engine's error does to the normals downstream, against what the rendering costs; into docs/evidence/twin.md.

    .venv/bin/python -m benchmarks.bench_twin_normals [--write] [--side 160]

The stage of bench_twin.py, where light goes on from wall to object: 24 lights, depth 5. Each stack is solved by
`iterative`; its normals on the object are held against those of a converged stack of stock Mitsuba. `direct` leaves the
light out that goes on: no number of samples mends that.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.pages import put
from benchmarks.twin_scenes import StockMitsuba, dome, stage, whole_picture
from compare.report.line_chart import line_chart
from scene.frames import Frames
from scene.normals import angular_error_deg
from solve.solve import solve
from twin.engines.direct import Direct
from twin.engines.many import Indirect
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.variant import import_mitsuba
from twin.ground_truth import ground_truth

DOCS = Path(__file__).resolve().parents[1] / "docs" / "evidence"
LIGHTS, CONVERGED = 24, 256

Images = NDArray[np.float32]


def clocked(work: Callable[[], Images]) -> tuple[Images, float]:
    """Return what is made, and the least processor seconds of two runs after one that may compile."""
    made = work()
    seconds = []
    for _ in range(2):
        start = time.process_time()
        made = work()
        seconds.append(time.process_time() - start)
    return made, min(seconds)


def main() -> None:
    """Measure, print, and with --write put table and chart into docs/."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--side", type=int, default=160)
    arguments = parser.parse_args()
    mi = import_mitsuba()
    scene = stage(dome(LIGHTS), arguments.side, 5)
    film, shapes = whole_picture(scene.camera), mitsuba_scene(scene)
    names = [thing.name for thing in scene.objects]
    truth = ground_truth(scene)
    mask = truth.object == names.index("blob")
    stock = StockMitsuba(mi, scene, "path", "multijitter")

    def of_stock(samples: int) -> Images:
        return np.stack([stock.image(index, samples, samples) for index in range(LIGHTS)])

    def normals(images: Images) -> NDArray:
        frames = Frames.from_linear(scene.lights.names, images / np.percentile(images, 99.9))
        return solve("iterative", frames, scene.lights, scene.camera, mask).normals

    converged = of_stock(CONVERGED)
    wanted = normals(converged)
    error_of_method = float(np.nanmedian(angular_error_deg(wanted, truth.normals)[mask]))
    engines: dict[str, dict[str, Callable[[], Images]]] = {
        "mitsuba": {f"{n} samples": lambda n=n: of_stock(n) for n in (1, 4, 16, 64)},
        "many": {
            f"direct {100 * e:g} %, {n} samples": lambda e=e, n=n: (
                Direct(shapes, film, scene.lights, error=e).images()
                + Indirect(shapes, film, scene.lights, samples=n, max_depth=5).images()
            )
            for e, n in ((0.03, 4), (0.015, 16), (0.008, 64))
        },
        "direct": {
            f"error {100 * e:g} %": lambda e=e: Direct(shapes, film, scene.lights, error=e).images()
            for e in (0.02, 0.005)
        },
    }
    lines = [
        "| engine | setting | processor, s a frame | image's error | normals moved, median |",
        "|---|---|---|---|---|",
    ]
    curves: dict[str, tuple[list[float], list[float]]] = {}
    for engine, settings in engines.items():
        curves[engine] = [], []
        for setting, work in settings.items():
            images, seconds = clocked(work)
            error = float(np.sqrt(np.mean((images - converged) ** 2)) / converged.mean())
            moved = float(np.nanmedian(angular_error_deg(normals(images), wanted)[mask]))
            curves[engine][0].append(seconds / LIGHTS)
            curves[engine][1].append(moved)
            lines.append(f"| `{engine}` | {setting} | {seconds / LIGHTS:.3f} | {100 * error:.1f} % | {moved:.2f}° |")
            print(lines[-1], flush=True)
    text = "\n".join(
        [
            *lines,
            "",
            f"{arguments.side} x {arguments.side} pixels; `iterative` on the converged stack ({CONVERGED} samples) is "
            f"{error_of_method:.2f}° from the true normals (median). By `benchmarks/bench_twin_normals.py`.",
            "",
        ]
    )
    chart = line_chart(
        curves, x_title="processor seconds a frame", y_title="normals moved, degrees", log_x=True, log_y=True
    )
    if arguments.write:
        page = DOCS / "twin.md"
        put(page, "normals", text)
        (DOCS / "twin-normals-time.svg").write_text(chart)
    print(text)


if __name__ == "__main__":
    main()
