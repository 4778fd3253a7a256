"""Every level of every experiment: a virtual capture processed, its counterpart rendered, the two compared."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.catalogue import VIRTUAL_EXPERIMENTS, Experiment
from experiments.counterparts.captures import METHODS, write_capture, write_rendering
from experiments.counterparts.compare_folders import NUMBERS, compare_folders
from experiments.recipe import Setup
from experiments.scenes import BALLS
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json
from scene.output_folder import open_record
from scene.record import Record
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
    out: Path, experiments: Sequence[Experiment[Setup]] = VIRTUAL_EXPERIMENTS, *, tell: Callable[[str], None] = print
) -> Iterator[tuple[Experiment[Setup], list[Pair]]]:
    """Yield each experiment with its levels; what is there, of this setup and code, is not made again.

    out gets virtual-NAME-LEVEL (a session), processed-NAME-LEVEL, rendered-NAME-LEVEL and pairs/NAME-LEVEL.
    """
    with open_record(out) as record:
        out = record.folder
        balls = reference_balls(record)
        for experiment in experiments:
            pairs = []
            for level, setup in experiment.setups():
                label = f"{experiment.name}-{level:g}"
                place, mark = Store(out / "pairs" / label), _mark(setup)
                if not (record.is_current(label, mark) and place.path(NUMBERS).exists()):
                    tell(f"{label} ...")
                    capture, rendering = out / f"virtual-{label}", out / f"rendered-{label}"
                    with record.making(label, mark):
                        processed = process_capture(capture, out / f"processed-{label}", setup, balls)
                        write_rendering(Store(rendering), setup, f"rendered {label}")
                        compare_folders(processed, rendering, place.folder, methods=",".join(METHODS))
                pairs.append(Pair(level, place.read_json(NUMBERS)))
            yield experiment, pairs


def reference_balls(record: Record) -> list[Sphere]:
    """Return the balls, found in a session of their own by `calibrate`, in the order of `BALLS`."""
    from lab.plan import STEPS
    from lab.run import open_job

    folder, processed = record.folder / "virtual-balls", Store(record.folder / "processed-balls")
    mark = _mark(REFERENCE)
    if not (record.is_current("balls", mark) and processed.path("spheres.json").exists()):
        with record.making("balls", mark):
            write_capture(Store(folder), REFERENCE, folder.name)
            with open_job(folder, out=processed.folder) as job:
                job.run(STEPS, "calibrate")
    return in_order(processed.load_spheres(), processed.folder)


def in_order(found: Sequence[Sphere], folder: Path) -> list[Sphere]:
    """Return balls in the order of `BALLS`: those of one kind by their places from left to right.

    SceneError: they are others than stand there; `folder` is named.
    """
    ordered: dict[int, Sphere] = {}
    for kind in {kind for kind, _, _ in BALLS}:
        numbers = sorted((i for i, ball in enumerate(BALLS) if ball[0] == kind), key=lambda i: BALLS[i][2][0])
        there = sorted((ball for ball in found if ball.kind == kind), key=lambda ball: ball.center_px[0])
        if len(there) != len(numbers):
            raise SceneError(
                f"{folder}: found {len(there)} {kind} balls, expected {len(numbers)}; no other session can go by them. "
                "Look at the pictures of the balls there."
            )
        ordered |= dict(zip(numbers, there, strict=True))
    return [ordered[i] for i in range(len(BALLS))]


def _mark(setup: Setup) -> str:
    return fingerprint(setup, METHODS, code=code_fingerprint())


def process_capture(folder: Path, done: Path, setup: Setup, balls: Sequence[Sphere]) -> Path:
    """Photograph a setup into a session's folder, and process it into another; return that."""
    from lab.options import Solving
    from lab.plan import STEPS
    from lab.run import open_job
    from lab.summary import write_summary

    store = Store(folder)
    write_capture(store, setup, folder.name, balls)
    with open_job(folder, out=done, solving=Solving(",".join(METHODS))) as job:
        job.run(STEPS, "solve")
        write_summary(job, {"up_to": "solve", "session": folder.name, "methods": list(METHODS)})
    write_json(done / "virtual.json", store.read_json("virtual.json"))
    return done
