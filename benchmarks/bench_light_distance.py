"""How far lights are whose directions alone are given, and what normals gain by it; into docs/evidence/methods.md.

    .venv/bin/python -m benchmarks.bench_light_distance [--write]

Sessions of the test scenes (shadows, gloss, noise), their flashes' positions withheld. Seeds 0 to 7, untouched while
the method was made.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from benchmarks.bench_intensities import session, true_normals
from benchmarks.pages import put
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.problem import Problem
from solve.solve import solve
from solve.whole.light_distance import find_positions

PAGE = Path(__file__).resolve().parents[1] / "docs" / "evidence" / "methods.md"
SHAPES = ("blob", "potato", "relief", "brick", "pear", "knot", "mug", "gear")
FARTHER = (1.0, 3.0, 20.0)
FLASHES = 16


def row(shape: str, seed: int, farther: float) -> str:
    """Return the table's line of one session."""
    scene = session(seed, shape, FLASHES, farther)
    frames, lights, camera = scene.photograph(), scene.lights, scene.camera
    assert lights.positions_mm is not None
    normals, mask = true_normals(scene)
    given = Lights(lights.names, lights.directions, lights.intensities).normalised()

    def error(method: str, lights: Lights) -> str:
        found = solve(method, frames, lights, camera, mask)
        return f"{np.nanmedian(angular_error_deg(found.normals, normals)[mask]):.2f}"

    start = time.process_time()
    found = find_positions(Problem(frames, given, camera, mask, slice(0, len(mask)))).lights
    seconds = time.process_time() - start
    far = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
    told = "distant"
    if found.positions_mm is not None:
        # The object is put at 1000; its true distance gives the scale.
        scale = -lights.reference_point_mm[2] / 1000
        ratio = scale * np.linalg.norm(found.positions_mm - found.reference_point_mm, axis=1) / far
        told = f"{100 * (np.mean(ratio) - 1):+.0f} % | {100 * np.std(ratio):.0f} %"
    else:
        told += " |"
    errors = " | ".join(
        (error("iterative", given), error("near", given), error("near", lights), error("reflectance", given))
    )
    return f"| {shape} | {np.median(far) / 1000:.1f} | {told} | {errors} | {seconds:.1f} |"


def main() -> None:
    """Measure, print, and with --write put the table into docs/evidence/methods.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    lines = [
        "| shape | lights, m | distances, common | each | `iterative`, distant | `near`, found | "
        "`near`, true positions | `reflectance`, found | processor, s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for farther in FARTHER:
        for seed, shape in enumerate(SHAPES):
            lines.append(row(shape, seed, farther))
            print(lines[-1], flush=True)
    if arguments.write:
        text = "\n".join([*lines, "", "By `benchmarks/bench_light_distance.py`.", ""])
        put(PAGE, "light distance", text)


if __name__ == "__main__":
    main()
