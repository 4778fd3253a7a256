"""How fast the methods that treat each pixel alone are, in one run; written into docs/evidence/methods.md.

    .venv/bin/python -m benchmarks.bench_solve [--write] [--side 1024]

A glossy, noisy ball that fills a square picture under 96 lights, 16-bit RGB as in the store. `ls` against a compiled
sum over the same bytes on as many threads; `l1` and `sbl` against benchmarks/pixel_loops.py, with the same floors and
tolerances on the same pixels. Processor seconds where it says so: they bear a loaded machine better than the clock.
"""

import argparse
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np

from benchmarks.pages import put
from benchmarks.pixel_loops import l1_loop, sbl_loop
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.pixelwise import l1, sbl
from solve.samples import Geometry, Samples
from solve.solve import solve

ROOT = Path(__file__).resolve().parents[1]
LIGHTS, SEED, LOOP_PIXELS, ROUNDS = 96, 10_001, 300, 3
ALONE = ("ls", "iterative", "position", "l1", "sbl", "hsh")


def ball(side: int) -> tuple[Frames, Lights, np.ndarray, np.ndarray]:
    """Return frames, lights, true normals (side, side, 3) and the ball's mask."""
    rng = np.random.default_rng(SEED)
    k = np.arange(LIGHTS)
    z = 1 - (1 - np.cos(np.radians(50.0))) * (k + 0.5) / LIGHTS
    across, azimuth = np.sqrt(1 - z**2), k * 2.39996
    directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)
    y, x = np.mgrid[1 : -1 : side * 1j, -1 : 1 : side * 1j]
    # The ball is larger than the picture: every pixel is on it, the corners almost at the limb.
    normals = np.stack([0.69 * x, 0.69 * y, np.sqrt(np.clip(1 - 0.476 * (x**2 + y**2), 0.01, 1))], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    albedo = 0.35 + 0.1 * np.sin(20 * x) * np.sin(17 * y)
    half = directions + [0, 0, 1]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    codes = np.empty((LIGHTS, side, side, 3), np.uint16)
    for f in range(LIGHTS):
        shade = albedo * np.maximum(normals @ directions[f], 0) + 0.3 * np.clip(normals @ half[f], 0, 1) ** 100
        noise = 0.003 * rng.standard_normal((side, side), np.float32)
        pixels = shade[..., None] * [1.0, 0.8, 0.6] + noise[..., None]
        codes[f] = np.clip(pixels * 60_000 + 2048.5, 0, 65_535)
    names = tuple(f"{f:03d}" for f in range(LIGHTS))
    frames = Frames(names, codes, np.ones(LIGHTS))
    return frames, Lights(names, directions, np.ones((LIGHTS, 3))), normals, np.ones((side, side), bool)


@numba.njit(nogil=True)
def _total(values):
    total = np.uint64(0)
    for i in range(len(values)):
        total += values[i]
    return total


def clocked(work: Callable[[], object]) -> tuple[float, float]:
    """Return the least wall and the least processor seconds of some rounds."""
    seen = []
    for _ in range(ROUNDS):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        seen.append((time.perf_counter() - wall, time.process_time() - cpu))
    return tuple(np.min(seen, axis=0))


def whole_pictures(side: int) -> list[str]:
    """Return the lines of the methods on a whole picture."""
    frames, lights, normals, mask = ball(side)
    camera, millions = Camera.orthographic(side, side), side * side / 1e6
    pieces = np.array_split(frames.codes.reshape(-1), 64)
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        reading = clocked(lambda: list(pool.map(_total, pieces)))
    lines = [
        f"| method, {millions:.2f} megapixels x {LIGHTS} | wall, s | processor, s a megapixel | to reading | error |",
        "|---|---|---|---|---|",
        f"| reading the bytes once | {reading[0]:.2f} | {reading[1] / millions:.2f} | 1 | |",
    ]
    for method in ALONE:
        found = solve(method, frames, lights, camera, mask)
        wall, cpu = clocked(lambda method=method: solve(method, frames, lights, camera, mask))
        error = np.nanmean(angular_error_deg(found.normals, normals))
        lines.append(f"| `{method}` | {wall:.2f} | {cpu / millions:.2f} | {cpu / reading[1]:.1f} | {error:.2f}° |")
    return lines


def against_loops() -> list[str]:
    """Return the lines that compare `l1` and `sbl` with the loops, on the same pixels."""
    frames, lights, normals, mask = ball(128)
    chosen = np.random.default_rng(SEED).choice(mask.size, LOOP_PIXELS, replace=False)
    gray = frames.read().mean(-1).reshape(LIGHTS, -1).T
    truth = normals.reshape(-1, 3)
    scale = float(np.percentile(gray, 99))
    lines = [
        "| method | tolerance | this, µs a pixel | loop, µs a pixel | times | error | loop's |",
        "|---|---|---|---|---|---|---|",
    ]
    for module, loop, names in (
        (l1, l1_loop, ("residual_floor", "tolerance", "iterations")),
        (sbl, sbl_loop, ("prior", "residual_floor", "tolerance", "iterations")),
    ):
        for settings in module.METHOD.profiles.values():
            settings = settings._replace(shadow_threshold=-np.inf)
            points = np.zeros((len(gray), 3))
            samples = Samples(gray, np.ones(gray.shape, bool), points, Geometry.distant(lights.directions))
            b, _ = module.fit(samples, scale, settings)
            _, ours = clocked(lambda m=module, r=samples, s=settings: m.fit(r, scale, s))
            start = time.process_time()
            other = loop(gray[chosen] / scale, lights.directions, **{name: getattr(settings, name) for name in names})
            theirs = (time.process_time() - start) / LOOP_PIXELS
            ours /= len(gray)
            errors = [
                np.mean(angular_error_deg(v / np.linalg.norm(v, axis=1, keepdims=True), truth[chosen]))
                for v in (b[chosen], other)
            ]
            lines.append(
                f"| `{module.__name__.removeprefix('solve.')}` | {settings.tolerance:.0e} | {ours * 1e6:.1f} | "
                f"{theirs * 1e6:.0f} | {theirs / ours:.0f} | {errors[0]:.3f}° | {errors[1]:.3f}° |"
            )
    return lines


def main() -> None:
    """Measure, print, and with --write put the tables into docs/evidence/methods.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--side", type=int, default=1024)
    arguments = parser.parse_args()
    tables = ["\n".join(whole_pictures(arguments.side)), "\n".join(against_loops())]
    text = "\n\n".join(tables) + f"\n\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_solve.py`.\n"
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "methods.md"
        put(path, "speed", text)


if __name__ == "__main__":
    main()
