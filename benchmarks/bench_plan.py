"""Is a plan's word good? Writes docs/evidence/plan.md. Run from the project's root:

    python -m benchmarks.bench_plan [errors] [flashes] [speed] [--runs 10]

Each part writes its own table; its rows, and every shoot, are kept in out/bench-plan, so that a run that was cut off
goes on. Twenty minutes of two cores for `errors`, five for `flashes`. Seeds 31 to 40 are the page's; develop on others.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from benchmarks.pages import put
from benchmarks.plan_captures import Case
from benchmarks.plan_comparison import OBJECTS, TARGET, compare_arrangements
from experiments.shapes import SHAPES
from formats.meshes.ply_write import write_ply
from scene.rays import import_open3d

ROOT = Path(__file__).resolve().parents[1]
PAGE, KEPT = ROOT / "docs" / "evidence" / "plan.md", ROOT / "out" / "bench-plan"
CASES = (
    Case("sphere, dome of 12", "sphere", "dome", 12, seed=31),
    Case("sphere, dome of 24, two balls of 40 mm, ISO 100", "sphere", "dome", 24, (40.0, 40.0), iso=100, seed=32),
    Case("blob, 16 by hand, ISO 1600", "blob", "free", 16, iso=1600, seed=33),
    Case("knot, dome of 24, ISO 800", "knot", "dome", 24, iso=800, seed=34),
    Case("knot, 12 as planned", "knot", "plan", 12, seed=35),
    Case("bowl, dome of 16", "bowl", "dome", 16, seed=36),
    Case("waves with gloss, ring of 8", "waves", "ring", 8, gloss="gloss", seed=37),
    Case("waves, semi-gloss, 20 by hand, two balls, ISO 1600", "waves", "free", 20, (60.0, 60.0), iso=1600,
         gloss="semi-gloss", seed=38),
    Case("pear with gloss, dome of 16, ISO 800", "pear", "dome", 16, iso=800, gloss="gloss", seed=39),
    Case("ridges, dark, 10 as planned, balls of 40 mm", "ridges", "plan", 10, (40.0, 40.0, 40.0), iso=200, albedo=0.2,
         seed=40),
)  # fmt: skip
BAR, STRETCH = 0.2, 0.1
FACES, CANDIDATES = 100_000, 60


def shoot(task: tuple[int, int]) -> None:
    """Photograph, calibrate and solve one case once, unless that is done; `task`: the case's number, and the run's."""
    number, run = task
    path = KEPT / f"case-{number}-{run}.npz"
    if not path.is_file():
        normals, off_deg, stated_deg = CASES[number].normals(run)
        with path.open("wb") as file:
            np.savez(file, normals=np.asarray(normals, np.float32), off_deg=off_deg, stated_deg=stated_deg)


def errors_of(number: int, runs: int) -> dict[str, Any]:
    """Return one case's predicted and found sigma."""
    case = CASES[number]
    predicted, light_sigma = case.predicted()
    found = [np.load(KEPT / f"case-{number}-{run}.npz") for run in range(runs)]
    normals = np.array([one["normals"] for one in found], np.float64)
    known = np.isfinite(normals).all((0, 2)) & (predicted.sigma_deg < 90)
    mean = normals.mean(0)
    freedom = 2 * (runs - 1)
    spread = np.degrees(np.sqrt(((normals - mean) ** 2).sum(-1).sum(0) / freedom))
    # The median of so few shoots' standard deviations lies below the true one.
    spread /= np.sqrt(chi2.median(freedom) / freedom)
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    constant = np.degrees(np.linalg.norm(mean - case.pixels.normals, axis=1))
    return {
        "case": case.name, "shoots": runs, "pixels": len(known), "known": float(known.mean()),
        "predicted_deg": float(np.median(predicted.sigma_deg[known])),
        "found_deg": float(np.median(spread[known])),
        "constant_deg": float(np.median(constant[known])),
        "by_lights_deg": predicted.lights_deg,
        "light_predicted_deg": light_sigma,
        "light_found_deg": float(np.sqrt(np.mean(np.square([one["off_deg"] for one in found])) / 2)),
        "light_stated_deg": float(np.median([one["stated_deg"] for one in found])),
    }  # fmt: skip


def measured_errors(runs: int) -> list[dict[str, Any]]:
    """Return a row a case; all cases' first shoots first, so that a run that is cut off has as many of each."""
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(shoot, [(number, run) for run in range(runs) for number in range(len(CASES))]))
    return [errors_of(number, runs) for number in range(len(CASES))]


def measured_flashes() -> list[dict[str, Any]]:
    """Return a row an object."""
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(compare_arrangements, OBJECTS))


def measured_speed() -> list[dict[str, Any]]:
    """Return the seconds of `rgbn plan` on a scan of `FACES` faces."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        scan = Path(folder) / "knot.ply"
        faces = _write_scan(scan)
        words = [sys.executable, "-c", "from rgbn.cli import main; main()"]
        words += ["plan", str(scan), "--unit", "mm", "--flashes", "24"]
        for gloss in ("matte", "gloss"):
            before, start = os.times(), time.perf_counter()
            out = ["--out", str(Path(folder) / gloss), "--gloss", gloss]
            subprocess.run([*words, *out], check=True, capture_output=True)
            after = os.times()
            spent = after.children_user + after.children_system - before.children_user - before.children_system
            rows.append({"gloss": gloss, "faces": faces, "processor_s": spent, "wall_s": time.perf_counter() - start})
            print(rows[-1], flush=True)
    return rows


def _write_scan(path: Path) -> int:
    """Write a knot of about `FACES` faces; return how many."""
    open3d, shape = import_open3d(), SHAPES["knot"](1.0)
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(75.0 * shape.vertices),
        open3d.utility.Vector3iVector(shape.faces.astype(np.int32)),
    ).simplify_quadric_decimation(FACES)
    faces = np.asarray(mesh.triangles)
    write_ply(path, {"x y z": np.asarray(mesh.vertices)}, faces)
    return len(faces)


def error_rows(rows: list[dict[str, Any]]) -> str:
    """Return the table of predicted against found sigma."""
    ratios = np.array([row["predicted_deg"] / row["found_deg"] for row in rows])
    off = np.maximum(ratios, 1 / ratios) - 1
    lines = [
        f"{len(rows)} set-ups, {rows[0]['shoots']} shoots each: within {BAR:.0%} in {int((off <= BAR).sum())}, within "
        f"{STRETCH:.0%} in {int((off <= STRETCH).sum())}; median ratio {np.median(ratios):.2f}, worst "
        f"{ratios[int(off.argmax())]:.2f}.",
        "",
        "| set-up | pixels | sigma predicted | found | ratio | of it by the lights | light directions predicted "
        "| found | as `calibrate` states | what all shoots share |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row, ratio in zip(rows, ratios, strict=True):
        degrees = ("predicted_deg", "found_deg")
        rest = ("by_lights_deg", "light_predicted_deg", "light_found_deg", "light_stated_deg", "constant_deg")
        cells = [row["case"], str(row["pixels"]), *(f"{row[name]:.3f}°" for name in degrees), f"{ratio:.2f}"]
        lines.append("| " + " | ".join([*cells, *(f"{row[name]:.3f}°" for name in rest)]) + " |")
    return "\n".join(lines) + "\n"


def flash_rows(rows: list[dict[str, Any]]) -> str:
    """Return the table of flashes needed."""
    names = [f"{plan} / {other}" for plan in ("next best", "planned") for other in ("even", "random")]
    means = {name: float(np.mean([row[name] for row in rows])) for name in names}
    lines = [
        "Mean over the objects: " + ", ".join(f"{name} {mean:.2f}" for name, mean in means.items()) + ".",
        "",
        f"| object | samples in shadow or gloss | error of {TARGET} even / random | " + " | ".join(names) + " |",
        "|---|---|---|" + "---|" * len(names),
    ]
    for row in rows:
        at = row["counts"].index(TARGET)
        even, random = (row["errors_deg"][name][at] for name in ("even", "random"))
        cells = [row["object"], f"{row['shadowed']:.0%}", f"{even:.2f}° / {random:.2f}°"]
        lines.append("| " + " | ".join([*cells, *(f"{row[name]:.2f}" for name in names)]) + " |")
    shown = [4, 6, 8, 12, 16, 24, 32, 48]
    lines += ["", "Mean error, degrees, of the next best flash / the even dome / random places, by flashes:", ""]
    lines += ["| object | " + " | ".join(map(str, shown)) + " |", "|---|" + "---|" * len(shown)]
    for row in rows:
        cells = []
        for count in shown:
            at = row["counts"].index(count)
            cells.append(" / ".join(f"{row['errors_deg'][name][at]:.2f}" for name in ("next best", "even", "random")))
        lines.append("| " + " | ".join([row["object"], *cells]) + " |")
    return "\n".join(lines) + "\n"


def speed_rows(rows: list[dict[str, Any]]) -> str:
    """Return the table of seconds."""
    lines = ["| object | faces | candidates | processor seconds | seconds by the clock |", "|---|---|---|---|---|"]
    for row in rows:
        spent = f"{row['processor_s']:.1f} | {row['wall_s']:.1f}"
        lines.append(f"| {row['gloss']} | {row['faces']:,} | {CANDIDATES} | {spent} |")
    return "\n".join(lines) + "\n"


PARTS: dict[str, tuple[Callable[..., list[dict[str, Any]]], Callable[[list[dict[str, Any]]], str]]] = {
    "errors": (measured_errors, error_rows),
    "flashes": (measured_flashes, flash_rows),
    "speed": (measured_speed, speed_rows),
}


def main() -> None:
    """Measure the parts that are named, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("parts", nargs="*", default=list(PARTS))
    parser.add_argument("--runs", type=int, default=10)
    arguments = parser.parse_args()
    KEPT.mkdir(parents=True, exist_ok=True)
    for part in arguments.parts:
        measure, written = PARTS[part]
        rows = measure(arguments.runs) if part == "errors" else measure()
        (KEPT / f"{part}.json").write_text(json.dumps(rows, indent=1))
        put(PAGE, part, written(rows))


if __name__ == "__main__":
    main()
