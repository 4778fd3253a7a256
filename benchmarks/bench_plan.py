"""Is a plan's word good? Writes docs/evidence/plan.md. Run from the project's root:

    python -m benchmarks.bench_plan [errors] [flashes] [speed] [--runs 10]

Each part keeps its rows in out/bench-plan/PART.json, and the page is written from the parts that there are. Twenty
minutes of two cores for `errors`, five for `flashes`. Seeds 1 to 99 are the page's; develop on others.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pages import put
from benchmarks.plan_captures import Case
from benchmarks.plan_comparison import OBJECTS, compare_arrangements

PAGE, KEPT = Path("docs/evidence/plan.md"), Path("out/bench-plan")
CASES = (
    Case("sphere, dome of 12", "sphere", "dome", 12, seed=1),
    Case("sphere, dome of 24, two balls of 40 mm, ISO 100", "sphere", "dome", 24, (40.0, 40.0), iso=100, seed=2),
    Case("blob, 16 by hand, ISO 1600", "blob", "free", 16, iso=1600, seed=3),
    Case("knot, dome of 24, ISO 800", "knot", "dome", 24, iso=800, seed=4),
    Case("knot, 12 as planned", "knot", "plan", 12, seed=5),
    Case("bowl, dome of 16", "bowl", "dome", 16, seed=6),
    Case("waves with gloss, ring of 8", "waves", "ring", 8, gloss="gloss", seed=7),
    Case("waves, semi-gloss, 20 by hand, two balls, ISO 1600", "waves", "free", 20, (60.0, 60.0), iso=1600,
         gloss="semi-gloss", seed=8),
    Case("pear with gloss, dome of 16, ISO 800", "pear", "dome", 16, iso=800, gloss="gloss", seed=9),
    Case("ridges, dark, 10 as planned, balls of 40 mm", "ridges", "plan", 10, (40.0, 40.0, 40.0), iso=200, albedo=0.2,
         seed=10),
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
    spread = np.degrees(np.sqrt(((normals - mean) ** 2).sum(-1).sum(0) / (2 * (runs - 1))))
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
    import subprocess
    import sys
    import tempfile

    from experiments.shapes import SHAPES
    from formats.meshes.ply_write import write_ply
    from lab.shoot.flash_places import CANDIDATES as USUAL

    assert USUAL == CANDIDATES
    shape = SHAPES["knot"](1.0)
    with tempfile.TemporaryDirectory() as folder:
        scan = Path(folder) / "knot.ply"
        faces = np.asarray(shape.faces)[:, :3]
        step = max(1, len(faces) // FACES)
        write_ply(scan, shape.vertices * 75.0, faces)
        words = [sys.executable, "-m", "rgbn", "plan", str(scan), "--unit", "mm", "--flashes", "24", "--out"]
        rows = []
        for gloss in ("matte", "gloss"):
            before, start = os.times(), time.perf_counter()
            out = str(Path(folder) / gloss)
            subprocess.run([*words, out, "--gloss", gloss], check=True, capture_output=True)
            after = os.times()
            spent = after.children_user + after.children_system - before.children_user - before.children_system
            rows.append({"gloss": gloss, "faces": len(faces) // step * step, "processor_s": spent,
                         "wall_s": time.perf_counter() - start})  # fmt: skip
    return rows


PARTS: dict[str, Callable[..., list[dict[str, Any]]]] = {
    "errors": measured_errors, "flashes": measured_flashes, "speed": measured_speed
}  # fmt: skip


def main() -> None:
    """Measure the parts that are named, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("parts", nargs="*", default=list(PARTS))
    parser.add_argument("--runs", type=int, default=10)
    arguments = parser.parse_args()
    KEPT.mkdir(parents=True, exist_ok=True)
    for part in arguments.parts:
        rows = PARTS[part](arguments.runs) if part == "errors" else PARTS[part]()
        (KEPT / f"{part}.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
