"""What `rgbn watch` takes from a photograph's last byte to its verdict."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.harness import Table, markdown
from benchmarks.memory_session import write_session
from capture.hot_folder.tracker import STILL_S
from capture.photographs.kept import Kept
from lab.init.answers import Answers, Asking
from lab.watch.shoot import Shoot
from lab.watch.shots import read_shot
from scene.clock import now, since
from scene.current import file_digest
from scene.spheres import Kind

DIAMETERS_MM: dict[Kind, tuple[float, ...]] = {"chrome": (84.0,), "white": (76.0,)}
FACES = 20_000
STAGES = ("decode, keep, what is seen at a glance", "its light, focus, movement", "the object's sigma, the next flash")


@dataclass(frozen=True)
class StageRow:
    """One stage of one photograph's verdict; `looked`: balls were looked for, with it and all before it."""

    photographs: int
    megapixels: float
    number: int
    looked: bool
    stage: str
    processor_s: float
    wall_s: float


def _judged(width: int, flashes: int) -> list[StageRow]:
    """Treat the photographs of a shoot one after the other, as `watch` does."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        raw = write_session(Path(place) / "session", width=width, flashes=flashes, faces=FACES).parent / "raw"
        shoot, kept = Shoot(raw, Asking(Answers(DIAMETERS_MM), silent=True)), Kept(Path(place), "linear", half=False)
        for number, path in enumerate(sorted(raw.glob("*.dng"))):
            looked = False
            for stage in STAGES:
                start = now()
                if stage == STAGES[0]:
                    shoot.add([read_shot(path, str(file_digest(path)), kept)], time.monotonic())
                elif stage == STAGES[1]:
                    looked = shoot.lights_so_far.is_due(len(shoot.sorted.flash))
                    list(shoot.follow())
                else:
                    shoot.look_at_object()
                spent = since(start)
                numbers = spent["processor_seconds"], spent["seconds"]
                rows.append(StageRow(flashes, width**2 / 1.5e6, number, looked, stage, *numbers))
    return rows


def _stages(rows: Sequence[StageRow]) -> dict[str, list[StageRow]]:
    """Return the rows of the second half, where balls were not looked for, by stage; and those where they were."""
    late = [row for row in rows if row.number > row.photographs / 2]
    usual = {stage: [row for row in late if row.stage == stage and not row.looked] for stage in STAGES}
    return usual | {"balls looked for": [row for row in rows if row.looked and row.stage == STAGES[1]]}


def _shown(rows: Sequence[StageRow]) -> str:
    lines = [
        {"stage": stage, "processor": np.median([row.processor_s for row in some]),
         "wall": np.median([row.wall_s for row in some])}
        for stage, some in _stages(rows).items() if some
    ]  # fmt: skip
    head = f"{rows[0].megapixels:.2g} megapixels, second half of {rows[0].photographs} photographs, median"
    return markdown({head: "{stage}", "processor, s": "{processor:.2f}", "wall, s": "{wall:.2f}"}, [
        {"stage": "the file stands still", "processor": 0.0, "wall": STILL_S}, *lines,
    ])  # fmt: skip


TABLES = (
    Table(
        "watch", "verdict", ("lab.watch.shoot", "lab.watch.shots"), StageRow,
        lambda scale: [{"small": (600, 3), "gates": (2400, 12), "full": (6000, 24)}[scale]], _judged, _shown,
        lambda rows: {
            f"{stage}: processor_s": float(np.median([row.processor_s for row in some]))
            for stage, some in _stages(rows).items() if some
        },
        is_timed=True,
    ),
)  # fmt: skip
