"""Every level of every experiment: a virtual capture processed, its counterpart rendered, the two compared."""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lab.compare_folders import NUMBERS, compare_folders
from lab.counterparts.captures import write_capture
from lab.counterparts.experiments import EXPERIMENTS, METHODS, Experiment, Setup
from lab.counterparts.renderings import write_rendering
from lab.counterparts.scenes import BALLS
from lab.datasets.checksums import code_checksum
from scene.errors import SceneError
from scene.files import write_json, write_text
from scene.spheres import Sphere
from scene.store import Store

REFERENCE = Setup(shape="cardboard", fold_deg=160.0)
"""Where the balls are found for all sessions: beside a white sphere nothing tells the white ball from the object."""

MARK = "mark.txt"
"""Beside what was made: of which setup, methods and code."""
_SOURCES = ("scene/**/*.py", "capture/**/*.py", "calibrate/**/*.py", "align/**/*.py", "solve/**/*.py", "twin/**/*.py",
            "compare/*.py", "lab/*.py", "lab/counterparts/*.py")  # fmt: skip


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
    """Yield each experiment with its levels; what is there, of this setup and code, is not made again.

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
            if not _is_current(place.folder, setup):
                tell(f"{label} ...")
                capture, rendering = out / f"virtual-{label}", out / f"rendered-{label}"
                for old in (place.folder, capture, rendering):
                    shutil.rmtree(old, ignore_errors=True)
                processed = process_capture(capture, setup, balls)
                write_rendering(Store(rendering), setup, f"rendered {label}")
                compare_folders(processed, rendering, place.folder, methods=",".join(METHODS))
                write_text(place.path(MARK), _mark(setup))
            pairs.append(Pair(level, place.read_json(NUMBERS)))
        yield experiment, pairs


def reference_balls(out: Path) -> list[Sphere]:
    """Return the balls, found in a session of their own by `calibrate`, in the order of `scenes.BALLS`."""
    from lab.plan import STEPS
    from lab.run import open_job

    folder = out / "virtual-balls"
    if not _is_current(folder, REFERENCE):
        shutil.rmtree(folder, ignore_errors=True)
        write_capture(Store(folder), REFERENCE, folder.name)
        with open_job(folder, out=folder / "out") as job:
            job.run(STEPS, "calibrate")
        write_text(folder / MARK, _mark(REFERENCE))
    return in_order(Store(folder / "out").load_spheres(), folder)


def in_order(found: Sequence[Sphere], folder: Path) -> list[Sphere]:
    """Return balls in the order of `scenes.BALLS`: those of one kind by their places from left to right.

    Raises
    ------
    SceneError
        They are others than stand there; `folder` is named.
    """
    ordered: dict[int, Sphere] = {}
    for kind in {kind for kind, _, _ in BALLS}:
        numbers = sorted((i for i, ball in enumerate(BALLS) if ball[0] == kind), key=lambda i: BALLS[i][2][0])
        there = sorted((ball for ball in found if ball.kind == kind), key=lambda ball: ball.center_px[0])
        if len(there) != len(numbers):
            raise SceneError(
                f"{folder}: found {len(there)} {kind} balls, expected {len(numbers)}; no other session can go by them. "
                "Look at the pictures of the balls in its out/."
            )
        ordered |= dict(zip(numbers, there, strict=True))
    return [ordered[i] for i in range(len(BALLS))]


def _mark(setup: Setup) -> str:
    return hashlib.sha256(json.dumps([asdict(setup), METHODS, code_checksum(_SOURCES)]).encode()).hexdigest()


def _is_current(folder: Path, setup: Setup) -> bool:
    return (folder / MARK).exists() and (folder / MARK).read_text() == _mark(setup)


def process_capture(folder: Path, setup: Setup, balls: Sequence[Sphere]) -> Path:
    """Photograph a setup and process it; return the output folder."""
    from lab.plan import STEPS
    from lab.run import open_job
    from lab.summary import write_summary

    store, done = Store(folder), folder / "out"
    write_capture(store, setup, folder.name, balls)
    with open_job(folder, out=done, method=",".join(METHODS)) as job:
        job.run(STEPS, "solve")
        write_summary(job, {"up_to": "solve", "session": folder.name, "methods": list(METHODS)})
    write_json(done / "virtual.json", store.read_json("virtual.json"))
    return done
