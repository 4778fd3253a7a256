"""Fit what tells a ball from other things; into calibrate/detection/ball_weights.toml and docs/evidence/calibration.md.

    .venv/bin/python -m benchmarks.fit_ball_weights FOLDER [--own 60] [--jobs 2] [--write]

FOLDER holds scenes as benchmarks/their_scenes.py reads them, by somebody else's renderer; `--own` more are drawn by
fixtures/random_scenes.py, seeds 20000 and up. The weights are those of logistic regression; the calibration curve is
of scenes that the weights were not fitted to (five folds).
"""

import argparse
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.pages import put
from benchmarks.their_scenes import is_same, opened, read_truth, scenes_in
from calibrate.detection.agreement import agreement
from calibrate.detection.choice import FEATURES, PAIRS, WEIGHTS, Suspect, choose, considered
from calibrate.detection.circles import overlap
from calibrate.detection.coarse import shrink
from calibrate.detection.detect import find_suspects
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
PAGE = Path(__file__).resolve().parents[1] / "docs" / "evidence" / "calibration.md"
AT = 0.85  # radii from a ball's centre within which a circle stands at its place
FIRST_OWN, FOLDS = 20000, 5
RIDGE, ASKED = 0.3, 3.0  # penalty on the scaled weights; log-odds that being asked for adds
BESIDE = 0.3  # weight of a ball's own other circles: they are no balls, and yet at one
BINS = np.array([0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 1])


class Labelled(NamedTuple):
    """A scene's suspects, with the ball (its number) at whose place each stands, -1 for none, and whether it is it."""

    suspects: list[Suspect]
    place: list[int]
    right: list[bool]

    def best(self, chosen: list[Suspect]) -> dict[int, Suspect]:
        """Return the true circle of each ball."""
        index = {id(s): n for n, s in enumerate(self.suspects)}
        return {self.place[index[id(s)]]: s for s in reversed(chosen) if self.right[index[id(s)]]}


def collect(job: tuple[str, str]) -> Labelled:
    """Return the labelled suspects of a scene."""
    source, name = job
    if source == "own":
        from fixtures.random_scenes import random_scene

        scene = random_scene(int(name))
        return _labelled(scene.photograph(), scene.world.camera, scene.spheres)
    with opened(Path(name), "unasked") as (frames, camera, _):
        return _labelled(frames, camera, read_truth(Path(name))[1])


def _labelled(frames: Frames, camera: Camera, balls: list[Sphere]) -> Labelled:
    coarse = shrink(frames, camera)
    suspects = find_suspects(frames, camera, coarse)
    place, right = [], []
    for suspect in suspects:
        sphere = coarse.sphere_to_full(suspect.sphere)
        off = [float(np.hypot(*(sphere.center_px - ball.center_px))) for ball in balls]
        at = [n for n, ball in enumerate(balls) if off[n] < AT * ball.radius_px]
        same = [n for n, ball in enumerate(balls) if is_same(sphere, ball)]
        place.append((same or at or [-1])[0])
        right.append(bool(same))
    return Labelled(suspects, place, right)


def fit(scenes: list[Labelled]) -> dict[str, dict[str, Any]]:
    """Return the weights, as ball_weights.toml holds them."""
    circle = _split(_logistic(*_circles(scenes), np.ones(1)))
    rows, right, weight = _balls(scenes, {"circle": circle})
    all_weights = _logistic(rows, right, weight)
    ball = _split(all_weights) | {"asked": ASKED}
    pairs = all_weights[_width() :].reshape(-1, 2)
    return {"circle": circle, "ball": ball, "pair": {name: list(w) for name, w in zip(PAIRS, pairs, strict=True)}}


def _width() -> int:
    return sum(len(names) for names in FEATURES.values())


def _row(suspect: Suspect, others: Iterable[Suspect] = ()) -> Array:
    """Return its features, each kind's in columns of their own, and the agreement with other balls."""
    parts = [suspect.features if kind == suspect.like else np.zeros(len(n)) for kind, n in FEATURES.items()]
    pairs = np.zeros((len(PAIRS), 2))
    for other in others:
        if not overlap(suspect.sphere, other.sphere):
            which = PAIRS.index(" and ".join(sorted((suspect.like, other.like))))
            pairs[which] += agreement(suspect.rays, other.rays)
    return np.concatenate([*parts, pairs.ravel()])


def _circles(scenes: list[Labelled]) -> tuple[Array, NDArray[np.bool_]]:
    """Return how each ball's best circle differs from its others, and the reverse."""
    rows = []
    for scene in scenes:
        for number in set(scene.place) - {-1}:
            here = [n for n, place in enumerate(scene.place) if place == number]
            true = [scene.suspects[n] for n in here if scene.right[n]]
            if true:
                best = max(true, key=lambda s: (s.features[1] if s.sphere.kind == "chrome" else 0, s.sphere.score))
                kind = best.sphere.kind
                wrong = [scene.suspects[n] for n in here if not scene.right[n]]
                wrong = [s for s in wrong if s.sphere.kind == kind]
                rows += [_row(best)[: _width()] - _row(other)[: _width()] for other in wrong]
    table = np.array(rows)
    return np.concatenate([table, -table]), np.arange(2 * len(table)) < len(table)


def _balls(scenes: list[Labelled], weights: Mapping[str, Any]) -> tuple[Array, NDArray[np.bool_], Array]:
    rows, right, weight = [], [], []
    for scene in scenes:
        index = {id(s): n for n, s in enumerate(scene.suspects)}
        some = considered(scene.suspects, weights)
        true = scene.best(some)
        for suspect in some:
            n = index[id(suspect)]
            rows.append(_row(suspect, [s for place, s in true.items() if place != scene.place[n]]))
            right.append(scene.right[n])
            weight.append(1.0 if scene.right[n] or scene.place[n] < 0 else BESIDE)
    return np.array(rows), np.array(right, bool), np.array(weight)


def _logistic(rows: Array, right: NDArray[np.bool_], weight: Array) -> Array:
    """Return the weights of a ridge logistic regression, its columns scaled to unit deviation."""
    scale = np.where(rows.std(0) > 1e-9, rows.std(0), 1.0)
    scaled = rows / scale

    def loss(b: Array) -> tuple[float, Array]:
        odds = scaled @ b
        value = np.sum(weight * (np.logaddexp(0, odds) - right * odds)) + RIDGE / 2 * b @ b
        return float(value), scaled.T @ (weight * (expit(odds) - right)) + RIDGE * b

    return minimize(loss, np.zeros(rows.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 5000}).x / scale


def _split(weights: Array) -> dict[str, Any]:
    out, start = {}, 0
    for kind, names in FEATURES.items():
        out[kind] = [float(w) for w in weights[start : start + len(names)]]
        start += len(names)
    return out


def curve(scenes: list[Labelled]) -> str:
    """Return the calibration table, each scene judged by weights fitted to the other folds."""
    said, true, found, there, false = [], [], 0, 0, 0
    for fold in range(FOLDS):
        weights = fit([s for n, s in enumerate(scenes) if n % FOLDS != fold])
        for scene in scenes[fold::FOLDS]:
            index = {id(s): n for n, s in enumerate(scene.suspects)}
            taken, left = choose(considered(scene.suspects, weights), None, weights)
            beside = [o for o in left if not any(overlap(o.suspect.sphere, t.suspect.sphere) for t in taken)]
            said += [one.probability for one in (*taken, *beside)]
            true += [scene.right[index[id(one.suspect)]] for one in (*taken, *beside)]
            hits = {scene.place[index[id(o.suspect)]] for o in taken if scene.right[index[id(o.suspect)]]}
            found, false = found + len(hits), false + len(taken) - len(hits)
            there += len({p for p, r in zip(scene.place, scene.right, strict=True) if r})
    lines = ["| probability said | circles | that are balls |", "|---|---|---|"]
    for low, high in pairwise(BINS):
        here = [t for s, t in zip(said, true, strict=True) if low <= s < high or s == high == 1]
        lines.append(f"| {low:.0%} to {high:.0%} | {len(here)} | {f'{np.mean(here):.0%}' if here else '-'} |")
    text = f"Of {there} balls with a circle to be found, {found} were taken, and {false} circles that are none"
    return "\n".join([*lines, "", f"{text}, in {len(scenes)} scenes, each judged by weights fitted to others."])


def write(weights: Mapping[str, Mapping[str, Any]], scenes: int) -> None:
    lines = [f"# Written by benchmarks/fit_ball_weights.py from {scenes} scenes. In order:"]
    lines += [f"# {kind}: {', '.join(names)}" for kind, names in FEATURES.items()]
    for part, values in weights.items():
        lines += ["", f"[{part}]"]
        for name, value in values.items():
            key = name if name.isidentifier() else f'"{name}"'
            shown = ", ".join(f"{w:.3f}" for w in np.atleast_1d(value))
            lines.append(f"{key} = {f'[{shown}]' if np.ndim(value) else shown}")
    WEIGHTS.write_text("\n".join(lines) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--own", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    jobs = [("theirs", str(path)) for path in scenes_in(args.folder)]
    jobs += [("own", str(FIRST_OWN + n)) for n in range(args.own)]
    with ProcessPoolExecutor(args.jobs) as pool:
        scenes = []
        for job, scene in zip(jobs, pool.map(collect, jobs), strict=True):
            scenes.append(scene)
            print(*job, f"{len(scene.suspects)} suspects, {len(set(scene.place) - {-1})} places", flush=True)
    weights = fit(scenes)
    text = curve(scenes)
    print(text)
    if args.write:
        write(weights, len(scenes))
        put(PAGE, "ball weights", text)


if __name__ == "__main__":
    main()
