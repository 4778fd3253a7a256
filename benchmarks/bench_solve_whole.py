"""The methods that look at all pixels at once: CPU seconds, and what uncalibrated results are worth on real captures.

    .venv/bin/python -m benchmarks.bench_solve_whole [--real] [--write]

Speed: `rpca`'s recursion against the same with a full singular value decomposition, round for round, in one run; and
the uncalibrated methods on 45 kpx x 96. CPU seconds of all threads, the least of three; the linear algebra library
runs on one thread for all, as its waiting threads count too. --real: DiLiGenT's ball and cat, where ../shared is; the
settings are the default ones, tuned on neither. --write puts the tables into docs/evidence/methods.md.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.pages import put
from compare.statistics.ambiguity import four_ways
from scene.normals import unit
from scene.store import Store
from solve.methods import UNCALIBRATED, method_of
from solve.problem import Problem
from solve.samples import Geometry, Samples
from solve.solve import solve
from solve.whole.low_rank import low_rank

ROOT = Path(__file__).resolve().parents[1]
DILIGENT = ROOT / ".." / "shared" / "real" / "diligent"
ROUNDS = 12


def by_svd(data: np.ndarray, there: np.ndarray, weight: float, rounds: int) -> np.ndarray:
    """Return the low-rank part after some rounds of the textbook's recursion, by full decompositions of (P, F)."""
    data = np.where(there, data, 0).astype(np.float64)
    largest = np.linalg.norm(data, 2)
    strength = 1.25 / largest
    dual = data / max(largest, np.abs(data).max() / weight)
    low = np.zeros_like(data)
    for _ in range(rounds):
        argument = data - low + dual / strength
        sparse = np.sign(argument) * np.maximum(np.abs(argument) - weight / strength, 0)
        sparse = np.where(there, sparse, argument)
        u, s, vt = np.linalg.svd(data - sparse + dual / strength, full_matrices=False)
        low = (u * np.maximum(s - 1 / strength, 0)) @ vt
        dual = dual + strength * (data - low - sparse)
        strength *= 1.5
    return low


def scene(pixels_across: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return gray samples (P, F), normals (P, 3) and mask of a glossy ball under lights up to 50 degrees."""
    v, u = np.mgrid[:pixels_across, :pixels_across]
    x, y = 2.1 * (u / pixels_across - 0.5), -2.1 * (v / pixels_across - 0.5)
    mask = x**2 + y**2 < 0.95
    normals = unit(np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1)[mask])
    k = np.arange(count) + 0.5
    z = 1 - 0.36 * k / count
    lights = np.stack([np.sqrt(1 - z**2) * np.cos(2.4 * k), np.sqrt(1 - z**2) * np.sin(2.4 * k), z], -1)
    half = unit(lights + [0, 0, 1.0])
    gray = 0.5 * np.maximum(normals @ lights.T, 0) + 0.4 * np.maximum(normals @ half.T, 0) ** 100
    gray += np.random.default_rng(seed).normal(0, 0.003, gray.shape)
    return gray.astype(np.float32), normals, mask


def cpu(call, times: int = 3) -> tuple[float, float, object]:
    """Return the least CPU and wall seconds of some calls, after one that compiles, and the result."""
    result, spent, passed = call(), [], []
    for _ in range(times):
        start, began = time.process_time(), time.perf_counter()
        result = call()
        spent.append(time.process_time() - start)
        passed.append(time.perf_counter() - began)
    return min(spent), min(passed), result


def low_rank_rows() -> list[str]:
    """Time both recursions on the same samples."""
    lines = [
        "| lights | kpx | full SVD, CPU s a round | Gram matrix | ratio, CPU | ratio, wall | difference |",
        "|---|---|---|---|---|---|---|",
    ]
    for count in (20, 96):
        gray, _, _ = scene(160, count, 10_000)
        data, there = gray, gray > 0.02
        weight = 1 / np.sqrt(len(data))
        # No tolerance: both do the same number of rounds.
        ours, ours_wall, found = cpu(lambda d=data, t=there, w=weight: low_rank(d, t, w, tolerance=0, rounds=ROUNDS))
        theirs, theirs_wall, low = cpu(lambda d=data, t=there, w=weight: by_svd(d, t, w, ROUNDS))
        off = np.linalg.norm(found.low - low) / np.linalg.norm(low)
        lines.append(
            f"| {count} | {len(data) / 1e3:.0f} | {theirs / ROUNDS:.3f} | {ours / ROUNDS:.4f} | {theirs / ours:.0f}x | "
            f"{theirs_wall / ours_wall:.0f}x | "
            f"{off:.0e} |"
        )
    return lines


def uncalibrated_rows() -> list[str]:
    """Time the uncalibrated methods on 45 kpx x 96."""
    gray, _, mask = scene(257, 96, 10_001)
    nowhere = Geometry.distant(np.full((gray.shape[1], 3), np.nan))
    samples = Samples(gray, np.ones(gray.shape, bool), np.zeros((len(gray), 3)), nowhere)
    problem = Problem(None, None, None, mask, slice(0, len(mask)))
    lines = [f"| method, {len(gray) / 1e3:.0f} kpx x 96 | CPU s | wall s |", "|---|---|---|"]
    for name in UNCALIBRATED:
        method = method_of(name)
        spent, passed, _ = cpu(lambda m=method: m.fit_whole(problem, samples, m.settings("default")))
        lines.append(f"| `{name}` | {spent:.2f} | {passed:.2f} |")
    return lines


def real_rows() -> list[str]:
    """Solve DiLiGenT's objects, once, and measure each result four ways."""
    lines = [
        "| object | method | profile | raw, degrees | best sign | oracle relief | oracle linear | doubts |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for folder in sorted(DILIGENT.glob("*PNG")):
        with tempfile.TemporaryDirectory() as out:
            command = [str(Path(sys.executable).parent / "rgbn"), "align", str(folder), "--out", out]
            subprocess.run(command, check=True, capture_output=True)
            store = Store(Path(out))
            frames, lights, camera, mask = (
                store.load_frames(),
                store.load_lights(),
                store.load_camera(),
                store.load_mask(),
            )
            truth = np.load(store.path("normals", "truth.npy"))
            for method in ("rpca", *UNCALIBRATED):
                for profile in ("default", "seed"):
                    found = solve(method, frames, lights, camera, mask, profile=profile)
                    ways = four_ways(found.normals, truth, mask)
                    numbers = (ways.raw_deg, ways.best_sign_deg, ways.oracle_relief_deg, ways.oracle_linear_deg)
                    errors = " | ".join(f"{number:.2f}" for number in numbers)
                    name = folder.name.removesuffix("PNG")
                    lines.append(f"| {name} | `{method}` | {profile} | {errors} | {len(found.warnings)} |")
                    print(lines[-1], *found.warnings, sep="\n    ")
    return lines


def main() -> None:
    """Measure, print, and with --write put the tables into docs/evidence/methods.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", action="store_true")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    tables = {"whole speed": [*low_rank_rows(), "", *uncalibrated_rows()]}
    print("\n".join(tables["whole speed"]))
    if arguments.real:
        tables["whole real"] = real_rows()
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "methods.md"
        for name, lines in tables.items():
            put(path, name, "\n".join(lines) + "\n")


if __name__ == "__main__":
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        # Read when the library loads: once more, from the start.
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        os.execv(sys.executable, [sys.executable, "-m", "benchmarks.bench_solve_whole", *sys.argv[1:]])
    main()
