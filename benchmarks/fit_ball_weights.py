"""Fit what tells a ball from other things, by logistic regression; into calibrate/detection/ball_weights.toml.

    .venv/bin/python -m benchmarks.fit_ball_weights FOLDER [--own 60] [--jobs 2] [--write]

FOLDER holds scenes by somebody else's renderer, as `benchmarks.calibration` reads them; `--own` more are drawn by
fixtures/random_scenes.py, seeds 20000 and up. How good the weights are the tables of calibration say, on other seeds.
"""

import argparse
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.calibration import is_same, read_truth, scenes_of
from benchmarks.harness import opened
from calibrate.detection.agreement import agreement
from calibrate.detection.choice import FEATURES, PAIRS, WEIGHTS, Suspect, considered
from calibrate.detection.circles import overlap
from calibrate.detection.coarse import shrink
from calibrate.detection.detect import find_suspects
from fixtures.random_scenes import random_scene
from lab.plan import STEPS
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
AT = 0.85  # radii from a ball's centre within which a circle stands at its place
FIRST_OWN = 20000
RIDGE, ASKED = 0.3, 3.0  # penalty on the scaled weights; log-odds that being asked for adds
BESIDE = 0.3  # weight of a ball's own other circles: they are no balls, and yet at one
ENDS = np.cumsum([len(names) for names in FEATURES.values()])  # of each kind's features in a row of the regression


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
        scene = random_scene(int(name))
        return _labelled(scene.photograph(), scene.world.camera, scene.spheres)
    with tempfile.TemporaryDirectory() as out, opened(Path(name) / "unasked", Path(out)) as run:
        run.run(STEPS, "check")
        return _labelled(run.store.load_frames(), run.store.load_camera(), read_truth(Path(name)).balls)


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
    pairs = all_weights[ENDS[-1] :].reshape(-1, 2)
    return {"circle": circle, "ball": ball, "pair": {name: list(w) for name, w in zip(PAIRS, pairs, strict=True)}}


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
                wrong = [scene.suspects[n] for n in here if not scene.right[n]]
                wrong = [s for s in wrong if s.sphere.kind == best.sphere.kind]
                rows += [_row(best)[: ENDS[-1]] - _row(other)[: ENDS[-1]] for other in wrong]
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
    return {kind: part.tolist() for kind, part in zip(FEATURES, np.split(weights, ENDS), strict=False)}


def as_toml(weights: Mapping[str, Mapping[str, Any]], scenes: int) -> str:
    """Return weights as the product reads them."""
    lines = [f"# Written by benchmarks/fit_ball_weights.py from {scenes} scenes. In order:"]
    lines += [f"# {kind}: {', '.join(names)}" for kind, names in FEATURES.items()]
    for part, values in weights.items():
        lines += ["", f"[{part}]"]
        for name, value in values.items():
            key = name if name.isidentifier() else f'"{name}"'
            shown = ", ".join(f"{w:.3f}" for w in np.atleast_1d(value))
            lines.append(f"{key} = {f'[{shown}]' if np.ndim(value) else shown}")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--own", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    jobs = [("theirs", str(path)) for path in scenes_of(args.folder)]
    jobs += [("own", str(FIRST_OWN + n)) for n in range(args.own)]
    with ProcessPoolExecutor(args.jobs) as pool:
        scenes = list(pool.map(collect, jobs))
    text = as_toml(fit(scenes), len(scenes))
    print(text)
    if args.write:
        WEIGHTS.write_text(text)


if __name__ == "__main__":
    main()
