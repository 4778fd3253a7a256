"""The levels of the staging "benchmark", from the least and the greatest error of the benchmark's Lsq column alone.

    .venv/bin/python -m benchmarks.fit_benchmark_levels [--write]

First the noise of the renderings: that with which plain least squares (`ls`, profile seed) has on the pear with nothing
else wrong the least error of "Ambient" and "Number of Images", which are one number. Then, of each experiment whose
levels the text leaves open, wide levels are tried; chosen are those at which the mean error (a pixel without a normal
counts 90 degrees) goes in even steps from the benchmark's least to its greatest: in what unit a level is told does not
matter. The numbers of images are even steps between the two counts that come nearest; the nine rings stand evenly from
the camera to the one that comes nearest to the greatest. No other column and no other statistic is looked at: they are
the test. --write puts the levels into experiments/benchmark_levels.csv.
"""

import argparse
import csv
from dataclasses import replace
from io import StringIO

import numpy as np
from numpy.typing import NDArray

from experiments.photographs import one_thread, photograph
from experiments.recipe import Recipe
from experiments.stagings import FITTED, NOISE, Experiment, benchmark_bases
from experiments.sweeps.cell import measured
from experiments.sweeps.sweep_statistics import benchmark_statistics
from experiments.tables import GAP_DEG
from scene.errors import SceneError
from scene.files import write_text
from solve.solve import solve

LEVELS = 9
"""Of an experiment: as many as the text has rings."""
WIDE: dict[str, tuple[float, ...]] = {
    "ambient": (0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1, 2, 4, 8, 16, 32, 64),
    "interreflection": (0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1, 1.4, 2, 3, 4, 6, 8, 12),
    "images": (3, 4, 5, 6, 8, 12, 16, 24, 32),
    "noise": (0, 0.005, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2),
    "ring": (50, 60, 70, 75, 80, 83, 85, 86, 87, 87.5, 88, 88.5, 88.8),
    "shadow": (0.05, 0.1, 0.2, 0.4, 0.7, 1, 1.5, 2, 3, 4.5, 7, 10),
    "specularity": (0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1),
}
"""Levels that are tried. The text gives those of the roughness (0 to 1) and of the material (eight words)."""


def error_of(recipe: Recipe) -> float:
    """Return the mean error of plain least squares, gaps at 90 degrees; that where it refuses."""
    with one_thread():
        p = photograph(recipe)
        try:
            found = solve("ls", p.frames, p.lights, p.camera, p.mask, profile="seed")
        except SceneError:
            return GAP_DEG
    return float(measured(p, "ls", found)["filled_deg"])


def errors_over(one: Experiment, levels: tuple[float, ...]) -> NDArray[np.float64]:
    """Return the mean error at each level, of all draws."""
    found = []
    for level in levels:
        value = int(level) if one.name == "images" else float(level)
        recipes = [replace(one.base, shape=one.shapes[0], seed=i, **{one.vary: value}) for i in range(one.seeds)]
        found.append(float(np.mean([error_of(recipe) for recipe in recipes])))
        print(f"{one.name} {level:g}: {found[-1]:.2f}", flush=True)
    return np.array(found)


def levels_of(name: str, tried: tuple[float, ...], errors: NDArray, least: float, greatest: float) -> list[float]:
    """Return the levels of an experiment from the errors at those that were tried; see the module."""
    hard, easy = (float(tried[np.argmin(np.abs(errors - end))]) for end in (greatest, least))
    if name == "images":
        return [float(round(count)) for count in np.linspace(hard, easy, LEVELS)]
    if name == "ring":
        fine = np.linspace(tried[0], tried[-1], 400)
        last = float(fine[np.argmin(np.abs(np.interp(fine, tried, errors) - greatest))])
        return [last * (i + 1) / LEVELS for i in range(LEVELS)]
    # Where the error falls again, harder is what lies beyond; ties are told apart by the level.
    rising = np.maximum.accumulate(errors) + 1e-9 * np.arange(len(errors))
    wanted = np.linspace(max(least, rising[0]), min(greatest, rising[-1]), LEVELS)
    return [float(level) for level in np.interp(wanted, rising, tried)]


def main() -> None:
    """Fit the levels, print them, and write them if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    theirs, text = benchmark_statistics(), StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["experiment", "level", "ls_deg", "lsq_min_deg", "lsq_max_deg"])
    least = theirs["ambient", "ls"]["min"]
    errors = errors_over(benchmark_bases(0.0)["noise"], WIDE["noise"])
    noise = float(f"{np.interp(least, errors, WIDE['noise']):.2g}")
    writer.writerow([NOISE, noise, f"{np.interp(noise, WIDE['noise'], errors):.2f}", least, ""])
    for name, tried in WIDE.items():
        errors, lsq = errors_over(benchmark_bases(noise)[name], tried), theirs[name, "ls"]
        for level in levels_of(name, tried, errors, lsq["min"], lsq["max"]):
            there = f"{np.interp(level, tried, errors):.2f}" if level >= tried[0] else ""
            writer.writerow([name, f"{level:.3g}", there, lsq["min"], lsq["max"]])
    print(text.getvalue())
    if options.write:
        write_text(FITTED, text.getvalue())


if __name__ == "__main__":
    main()
