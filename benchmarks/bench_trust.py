"""Predicted against true errors of all methods, on scenes by seed and on sessions with truth: docs/evidence/trust.md.

    .venv/bin/python -m benchmarks.bench_trust [--first 100] [--count 10] [--write]

The seeds below 100 are those that it was developed on.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import spearmanr

from benchmarks.bench_methods import SESSIONS
from benchmarks.pages import put
from benchmarks.trust_scenes import trust_scene
from scene.normals import angular_error_deg
from solve.methods import METHODS, UNCALIBRATED
from solve.solve import solve
from solve.trust.trust import trust

ROOT = Path(__file__).resolve().parents[1]
PAGE, CHART = ROOT / "docs" / "evidence" / "trust.md", "trust.svg"


class Row(NamedTuple):
    """One scene: by method (`best` among them), predicted and true median and mean, degrees, and the share of pixels
    whose error is within twice the predicted sigma.
    """

    name: str
    recommended: str
    methods: dict[str, dict[str, float]]
    seconds: float


def of_seed(seed: int) -> Row:
    """Return the row of a scene by seed."""
    scene = trust_scene(seed)
    shot, mask = scene.photographs, scene.photographs.mask
    found = {name: solve(name, shot.frames, scene.lights, shot.camera, mask) for name in METHODS}
    answers = {name: one.normals for name, one in found.items()}
    noise = {name: one.sigma_deg for name, one in found.items() if one.sigma_deg is not None}
    start = time.perf_counter()
    judged = trust(shot.frames, scene.lights, shot.camera, mask, answers, sigma_deg=noise)
    seconds, methods = time.perf_counter() - start, {}
    for name, normals in {**answers, "best": judged.best}.items():
        error, predicted = angular_error_deg(normals, shot.normals)[mask], judged.predicted_deg(normals)[mask]
        known = np.isfinite(error) & np.isfinite(predicted)
        methods[name] = {
            "median": judged.methods[name].median_deg, "mean": judged.methods[name].mean_deg,
            "true_median": float(np.nanmedian(error)), "true_mean": float(np.nanmean(error)),
            "within": float(np.mean(error[known] <= 2 * predicted[known])),
        }  # fmt: skip
    return Row(scene.name, judged.recommended, methods, seconds)


def of_session(name: str, folder: Path) -> Row:
    """Return the row of a session with truth."""
    command = [str(Path(sys.executable).parent / "rgbn"), "process", str(folder), "--json", "--trust"]
    with tempfile.TemporaryDirectory() as out:
        run = subprocess.run([*command, "--out", out], capture_output=True, text=True, check=False)
    if run.returncode:
        raise SystemExit(run.stderr)
    summary = json.loads(run.stdout)
    found = summary["trust"]
    methods = {
        method: {
            "median": row["median_deg"], "mean": row["mean_deg"], "true_median": row["true"]["median_deg"],
            "true_mean": row["true"]["mean_deg"], "within": row["true"]["within_2_sigma"],
        }
        for method, row in found["methods"].items()
    }  # fmt: skip
    return Row(name, found["recommended"], methods, summary["seconds"]["trust"])


def _spearman(methods: list[dict[str, float]]) -> float:
    ranked: Any = spearmanr([one["mean"] for one in methods], [one["true_mean"] for one in methods])
    return float(ranked.statistic)


def figures(row: Row) -> dict[str, float]:
    """Return what is said of a scene: see `HEADS`."""
    own = {name: one for name, one in row.methods.items() if name != "best"}
    true = {name: one["true_mean"] for name, one in own.items()}
    least = min(true.values())
    calibrated = [one for name, one in own.items() if name not in UNCALIBRATED]
    factor = [abs(np.log(one["median"] / one["true_median"])) for one in own.values()]
    return {
        "spearman": _spearman(list(own.values())),
        "spearman_calibrated": _spearman(calibrated),
        "ratio": true[row.recommended] / least,
        "factor": float(np.exp(np.median(factor))),
        "worst_factor": float(np.exp(np.max(factor))),
        "within": float(np.mean([one["within"] for one in own.values()])),
        "within_best": row.methods["best"]["within"],
        "best": row.methods["best"]["true_mean"] / least,
    }


HEADS = (
    "scene", "Spearman", "of the calibrated", "recommended", "its error over the least",
    "predicted median within a factor of (worst method)", "within 2 sigma, methods", "`best`",
    "`best` over the best method", "seconds",
)  # fmt: skip


def table(rows: list[Row]) -> list[str]:
    """Return a row a scene."""
    lines = [f"| {' | '.join(HEADS)} |", "|---" * len(HEADS) + "|"]
    for row in rows:
        f = figures(row)
        cells = (
            row.name, f"{f['spearman']:.2f}", f"{f['spearman_calibrated']:.2f}", f"`{row.recommended}`",
            f"{f['ratio']:.2f}", f"{f['factor']:.2f} ({f['worst_factor']:.2f})", f"{f['within']:.0%}",
            f"{f['within_best']:.0%}", f"{f['best']:.2f}", f"{row.seconds:.0f}",
        )  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def summary_line(rows: list[Row]) -> str:
    """Return the figures over all scenes."""
    every = [figures(row) for row in rows]
    mean = {key: float(np.mean([one[key] for one in every])) for key in every[0]}
    geometric = {
        key: float(np.exp(np.mean(np.log([one[key] for one in every])))) for key in ("ratio", "factor", "best")
    }
    return (
        f"Over {len(rows)} scenes: Spearman {mean['spearman']:.2f} (calibrated methods "
        f"{mean['spearman_calibrated']:.2f}); recommended over least {geometric['ratio']:.2f}; predicted median "
        f"within a factor of {geometric['factor']:.2f}; within 2 sigma {mean['within']:.0%} (`best` "
        f"{mean['within_best']:.0%}); `best` over the best method {geometric['best']:.2f}."
    )


def chart(rows: list[Row]) -> str:
    """Return the predicted over the true mean error, every method and scene, logarithmic."""
    low, high, side, margin = 0.3, 120.0, 420.0, 46.0

    def at(value: float) -> float:
        return side * float(np.log(np.clip(value, low, high) / low) / np.log(high / low))

    parts = []
    for tick in (0.5, 1, 2, 5, 10, 20, 50, 100):
        x, y = margin + at(tick), side - at(tick) + 10
        parts.append(f'<path d="M{x:.1f},10V{side + 10:.0f}M{margin},{y:.1f}H{margin + side:.0f}" stroke="#ddd"/>')
        parts.append(f'<text x="{x:.1f}" y="{side + 24:.0f}" text-anchor="middle">{tick:g}</text>')
        parts.append(f'<text x="{margin - 5}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    parts.append(f'<path d="M{margin},{side + 10:.0f}L{margin + side:.0f},10" stroke="#888"/>')
    for row in rows:
        for name, one in row.methods.items():
            x, y = margin + at(one["true_mean"]), side - at(one["mean"]) + 10
            fill = "#c33" if name == "best" else "#e8a33d" if name in UNCALIBRATED else "#2b6cb0"
            title = f"<title>{name}, {row.name}: true {one['true_mean']:.2f}, predicted {one['mean']:.2f}</title>"
            dot = f'cx="{x:.1f}" cy="{y:.1f}" r="3.2" fill="{fill}" fill-opacity="0.65"'
            parts.append(f"<circle {dot}>{title}</circle>")
    middle = margin + side / 2
    parts.append(f'<text x="{middle:.0f}" y="{side + 42:.0f}" text-anchor="middle">true mean error, degrees</text>')
    label = f'transform="translate(13,{side / 2 + 10:.0f}) rotate(-90)" text-anchor="middle"'
    parts.append(f"<text {label}>predicted mean error, degrees</text>")
    for number, (colour, words) in enumerate(
        (("#2b6cb0", "calibrated"), ("#e8a33d", "uncalibrated"), ("#c33", "best: all joined"))
    ):
        y = 26 + 16 * number
        parts.append(f'<circle cx="{margin + 14}" cy="{y - 4}" r="4" fill="{colour}"/>')
        parts.append(f'<text x="{margin + 24}" y="{y}">{words}</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {margin + side + 12:.0f} {side + 50:.0f}" '
        'font-size="11" font-family="sans-serif" fill="none"><rect width="100%" height="100%" fill="white"/>'
        '<g fill="#222">'
        f"{''.join(parts)}</g></svg>\n"
    )


def main() -> None:
    """Run, print and, if asked, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    rows = []
    for seed in range(options.first, options.first + options.count):
        rows.append(of_seed(seed))
        print(table(rows)[-1], flush=True)
    print(summary_line(rows))
    if not options.write:
        return
    real = [of_session(name, folder) for name, folder in SESSIONS.items() if folder.exists()]
    lines = [*table(rows), "", summary_line(rows), "", *table(real), ""]
    lines.append(
        f"By `benchmarks/bench_trust.py`, seeds {options.first} to {options.first + options.count - 1}, 2 cores."
    )
    put(PAGE, "trust", "\n".join(lines) + "\n")
    (PAGE.parent / CHART).write_text(chart([*rows, *real]))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
