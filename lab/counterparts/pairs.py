"""Every level of every experiment: a virtual capture processed, its counterpart rendered, the two compared."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lab.compare_folders import NUMBERS, compare_folders
from lab.counterparts.captures import write_capture
from lab.counterparts.experiments import EXPERIMENTS, METHODS, Experiment, Setup
from lab.counterparts.renderings import write_rendering
from scene.errors import SceneError
from scene.files import write_json
from scene.spheres import Sphere
from scene.store import Store

REFERENCE = Setup(shape="cardboard", fold_deg=160.0)
"""Where the balls are found for all sessions: beside a white sphere nothing tells the white ball from the object."""


@dataclass(frozen=True)
class Pair:
    """One level: its value, and what `compare_folders` says of capture and counterpart."""

    level: float
    found: dict[str, Any]

    def medians(self, kind: str) -> dict[str, float]:
        """Return each method's median error on `real` or `twin`."""
        return {name: row[kind]["median_deg"] for name, row in self.found["methods"].items()}

    @property
    def spearman(self) -> float:
        """Rank correlation of the methods' medians between the two."""
        from scipy.stats import spearmanr

        real, twin = self.medians("real"), self.medians("twin")
        return float(spearmanr(list(real.values()), [twin[name] for name in real]).statistic)  # type: ignore[union-attr]


def run_experiments(
    out: Path, experiments: Sequence[Experiment] = EXPERIMENTS, *, tell: Callable[[str], None] = print
) -> Iterator[tuple[Experiment, list[Pair]]]:
    """Yield each experiment with its levels; what is there is not made again.

    Parameters
    ----------
    out : Path
        Gets virtual-NAME-LEVEL (a session, and out/ in it) and rendered-NAME-LEVEL, and pairs/NAME-LEVEL.
    experiments : sequence of Experiment
    tell : callable
        Called with what is being done.
    """
    balls = reference_balls(out)
    for experiment in experiments:
        pairs = []
        for level, setup in experiment.setups():
            label = f"{experiment.name}-{level:g}"
            place = Store(out / "pairs" / label)
            if not place.path(NUMBERS).exists():
                tell(f"{label} ...")
                capture, rendering = out / f"virtual-{label}", out / f"rendered-{label}"
                processed = process_capture(capture, setup, balls)
                write_rendering(Store(rendering), setup, f"rendered {label}")
                compare_folders(processed, rendering, place.folder, methods=",".join(METHODS))
            pairs.append(Pair(level, place.read_json(NUMBERS)))
        yield experiment, pairs


def reference_balls(out: Path) -> list[Sphere]:
    """Return the balls, found in a session of their own by `calibrate`, in the order of `scenes.BALLS`."""
    from lab.counterparts.scenes import BALLS
    from lab.plan import STEPS
    from lab.run import open_job

    folder, known = out / "virtual-balls", out / "balls.json"
    if not known.exists():
        write_capture(Store(folder), REFERENCE, folder.name)
        with open_job(folder, out=folder / "out") as job:
            job.run(STEPS, "calibrate")
        write_json(known, Store(folder / "out").read_json("spheres.json"))
    found = Store(folder / "out").load_spheres()
    if len(found) != len(BALLS):
        raise SceneError(f"{folder}: found {len(found)} of {len(BALLS)} balls; no other session can go by them.")
    ordered = []
    for kind, _, center in BALLS:
        near = [sphere for sphere in found if sphere.kind == kind]
        # Chrome balls stand apart: left and right of the picture's middle.
        ordered.append(min(near, key=lambda sphere: abs(np.sign(center[0]) - np.sign(sphere.center_px[0] - 160))))
    return ordered


def process_capture(folder: Path, setup: Setup, balls: Sequence[Sphere]) -> Path:
    """Photograph a setup and process it; return the output folder."""
    from lab.plan import STEPS
    from lab.run import open_job
    from lab.summary import write_summary

    store, done = Store(folder), folder / "out"
    if not store.path("session.toml").exists():
        write_capture(store, setup, folder.name.replace("_", "-"), balls)
    with open_job(folder, out=done, method=",".join(METHODS)) as job:
        job.run(STEPS, "solve")
        write_summary(job, {"up_to": "solve", "session": folder.name, "methods": list(METHODS)})
    write_json(done / "virtual.json", store.read_json("virtual.json"))
    return done
