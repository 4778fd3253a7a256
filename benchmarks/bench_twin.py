"""The engines `many` and `direct` against stock Mitsuba at equal error, in one run; written into docs/evidence/twin.md.

    .venv/bin/python -m benchmarks.bench_twin [--write] [--side 256]

Each engine at several settings, its error against a converged rendering of a few of the lights by stock Mitsuba; the
stock's error at several sample counts, and from there its cost at the engine's error: between two counts by their own
slope, beyond the last by the last slope. Processor seconds of all threads, warm: what is compiled on first use is
counted apart. The reference's own noise, from its two halves, is taken off every squared error.
"""

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.pages import put
from benchmarks.twin_scenes import StockMitsuba, dome, stage, whole_picture
from compare.report.line_chart import line_chart
from twin.engines.direct import Direct
from twin.engines.many import Indirect
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.variant import import_mitsuba

ROOT = Path(__file__).resolve().parents[1]
SAMPLERS = "multijitter", "independent", "orthogonal"


@dataclass(frozen=True)
class Point:
    """One engine at one setting: cost of the whole stack, and relative error."""

    setting: str
    processor_s: float
    wall_s: float
    error: float


@dataclass(frozen=True)
class Reference:
    """Converged images (K, H, W, 3) of some lights, and the variance of their noise."""

    lights: list[int]
    images: NDArray[np.float32]
    variance: float

    def error(self, images: NDArray[np.float32]) -> float:
        """Return the root mean square error over the mean, the reference's own noise taken off."""
        square = float(np.mean((images - self.images) ** 2)) - self.variance
        return float(np.sqrt(max(square, 0))) / float(self.images.mean())


def clocked(work: Callable[[], NDArray[np.float32]]) -> tuple[NDArray[np.float32], float, float]:
    """Return what was made, processor seconds and wall seconds."""
    wall, processor = time.perf_counter(), time.process_time()
    made = work()
    return made, time.process_time() - processor, time.perf_counter() - wall


def reference(stock: StockMitsuba, lights: list[int], samples: int) -> Reference:
    """Render the lights twice with `samples` each."""
    halves = [np.stack([stock.image(i, samples, seed) for i in lights]) for seed in (101, 102)]
    return Reference(lights, (halves[0] + halves[1]) / 2, float(np.mean((halves[0] - halves[1]) ** 2)) / 4)


def stock_curve(made: dict[str, StockMitsuba], truth: Reference, count: int, samples: list[int]) -> list[Point]:
    """Return the curve of the sampler that is cheapest at equal error at the second sample count."""
    share, points = count / len(truth.lights), {}
    for name, stock in made.items():
        stock.image(truth.lights[0], samples[0], 1)
        points[name] = [_stock_point(stock, name, truth, share, n) for n in samples[:2]]
    best = min(points, key=lambda name: points[name][1].processor_s * points[name][1].error ** 2)
    return points[best] + [_stock_point(made[best], best, truth, share, n) for n in samples[2:]]


def _stock_point(stock: StockMitsuba, sampler: str, truth: Reference, share: float, samples: int) -> Point:
    images, processor, wall = clocked(lambda: np.stack([stock.image(i, samples, samples) for i in truth.lights]))
    return Point(f"{samples} samples, {sampler}", processor * share, wall * share, truth.error(images))


def cost_at(curve: list[Point], error: float) -> float:
    """Return the processor seconds at which a curve has an error, straight on logarithmic scales."""
    cost, seen = np.log([p.processor_s for p in curve]), np.log([p.error for p in curve])
    where = int(np.clip(np.searchsorted(-seen, -np.log(error)) - 1, 0, len(curve) - 2))
    slope = (cost[where + 1] - cost[where]) / (seen[where + 1] - seen[where])
    return float(np.exp(cost[where] + slope * (np.log(error) - seen[where])))


def engine_curve(settings: dict[str, Callable[[], NDArray[np.float32]]], truth: Reference) -> tuple[list[Point], float]:
    """Return the engine's curve, and the seconds that its first call took beyond its second."""
    points, first = [], None
    for name, work in settings.items():
        if first is None:
            first = clocked(work)[2]
        runs = [clocked(work) for _ in range(2)]
        processor, wall = (min(run[k] for run in runs) for k in (1, 2))
        if not points:
            first -= wall
        points.append(Point(name, processor, wall, truth.error(runs[0][0][truth.lights])))
    return points, float(first or 0)


def table(title: str, ours: list[Point], stock: list[Point]) -> list[str]:
    """Return the lines of one comparison."""
    lines = [
        f"| {title} | error | processor, s | wall, s | stock at that error, processor s | times |",
        "|---|---|---|---|---|---|",
    ]
    for p in ours:
        other = cost_at(stock, p.error)
        beyond = "" if p.error > stock[-1].error else " (extrapolated)"
        lines.append(
            f"| {p.setting} | {100 * p.error:.2f} % | {p.processor_s:.2f} | {p.wall_s:.2f} | {other:.0f}{beyond} | "
            f"**{other / p.processor_s:.0f}** |"
        )
    for p in stock:
        lines.append(f"| stock, {p.setting} | {100 * p.error:.2f} % | {p.processor_s:.1f} | {p.wall_s:.1f} | | |")
    return lines


def against_path(side: int) -> tuple[list[str], dict[str, list[Point]]]:
    """Measure `many`: 24 lights, depth 5."""
    mi = import_mitsuba()
    scene = stage(dome(24), side, 5)
    film, shapes = whole_picture(scene.camera), mitsuba_scene(scene)
    stock = {name: StockMitsuba(mi, scene, "path", name) for name in SAMPLERS}
    truth = reference(stock["independent"], [3, 15], 512)
    theirs = stock_curve(stock, truth, 24, [4, 16, 64])

    def many(error: float, samples: int) -> Callable[[], NDArray[np.float32]]:
        def work() -> NDArray[np.float32]:
            straight = Direct(shapes, film, scene.lights, error=error).images()
            return straight + Indirect(shapes, film, scene.lights, samples=samples, max_depth=5).images()

        return work

    settings = {
        f"`many`, direct {100 * e:g} %, {n} samples": many(e, n) for e, n in ((0.03, 4), (0.015, 16), (0.008, 64))
    }
    ours, first = engine_curve(settings, truth)
    lines = [*table("24 lights, depth 5", ours, theirs), "", f"First call: {first:.1f} s more, compiling.", ""]
    return lines, {"mitsuba, path": theirs, "many": ours}


def against_direct(side: int) -> tuple[list[str], dict[str, list[Point]]]:
    """Measure `direct`: 96 lights."""
    mi = import_mitsuba()
    scene = stage(dome(96), side, 2)
    film, shapes = whole_picture(scene.camera), mitsuba_scene(scene)
    stock = {name: StockMitsuba(mi, scene, "direct", name) for name in SAMPLERS}
    truth = reference(stock["multijitter"], [5, 41], 128)
    theirs = stock_curve(stock, truth, 96, [4, 16, 64])
    settings = {
        f"`direct`, error {100 * error:g} %": lambda error=error: Direct(
            shapes, film, scene.lights, error=error
        ).images()
        for error in (0.02, 0.01, 0.005, 0.002)
    }
    ours, first = engine_curve(settings, truth)
    lines = [*table("96 lights, direct", ours, theirs), "", f"First call: {first:.1f} s more, compiling.", ""]
    return lines, {"mitsuba, direct": theirs, "direct": ours}


def main() -> None:
    """Measure, print, and with --write put table and chart into docs/."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--side", type=int, default=256)
    arguments = parser.parse_args()
    many_lines, many_curves = against_path(arguments.side)
    print("\n".join(many_lines), flush=True)
    direct_lines, direct_curves = against_direct(2 * arguments.side)
    side = arguments.side
    text = "\n".join(
        [
            *many_lines,
            *direct_lines,
            f"Measured on {os.cpu_count()} cores, {side} x {side} pixels (`many`) and {2 * side} x {2 * side} "
            "(`direct`), by `benchmarks/bench_twin.py`.\n",
        ]
    )
    print(text)
    curves = {"mitsuba, path": 24, "many": 24, "mitsuba, direct": 96, "direct": 96}
    found = {**many_curves, **direct_curves}
    chart = line_chart(
        {
            name: ([p.processor_s / count for p in found[name]], [100 * p.error for p in found[name]])
            for name, count in curves.items()
        },
        x_title="processor seconds a frame",
        y_title="error of the image, % of its mean",
        log_x=True,
        log_y=True,
    )
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "twin.md"
        put(path, "engines", text)
        (ROOT / "docs" / "evidence" / "twin-error-time.svg").write_text(chart)


if __name__ == "__main__":
    main()
