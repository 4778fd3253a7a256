"""Own memory and processor seconds of each verb on a session as large as they come: 24 megapixels, sixty photographs.

Twelve different flashes, each photograph listed several times: memory does not care whether two are alike. Each verb
runs in a process of its own, under the limit that it is to keep; what the verbs before it made is there.
"""

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.harness import ROOT, Figures, Scale, Table, markdown, ran
from benchmarks.memory_session import write_session

FLASHES = 12
LIMIT_GB = 4.0
"""What is reserved counts too, so this is harder than a machine with so much memory."""
TWIN_ERROR = 0.2
"""Of the twin's rendering; memory does not depend on it, and the time is not what is measured here."""


@dataclass(frozen=True)
class StepRow:
    """What one verb needed of a session."""

    session: str
    verb: str
    own_gb: float
    processor_s: float
    wall_s: float


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(0, 0, 0, "check")]
    if scale == "gates":
        return [(600, 4, 20_000, "check,calibrate,align,solve")]
    return [(6000, 5, 1_000_000, "check,calibrate,align,solve,twin,compare")]


def _measured(width: int, times: int, triangles: int, verbs: str) -> list[StepRow]:
    """Run verbs on a session of such photographs, each listed so many times; without a width on the fixture."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        folder, name = ROOT / "fixtures" / "bumpy", "the fixture"
        if width:
            folder = write_session(
                Path(place) / "session", width=width, flashes=FLASHES, faces=triangles, times=times
            ).parent
            name = f"{width**2 / 1.5e6:.2g} megapixels x {times * FLASHES}, {triangles:,} triangles"
        for verb in verbs.split(","):
            command = [Path(sys.executable).with_name("rgbn"), verb, folder, "--out", Path(place) / "out", "-q"]
            command += ["--error", TWIN_ERROR] if verb in ("twin", "compare") else []
            wall, processor, own = ran(command, limit_gb=LIMIT_GB)
            rows.append(StepRow(name, verb, own, processor, wall))
    return rows


def _shown(rows: Sequence[StepRow]) -> str:
    columns = {rows[0].session: "`rgbn {verb}`", "own memory, GB": "{own_gb:.2f}"}
    return markdown({**columns, "processor, s": "{processor_s:.0f}", "wall, s": "{wall_s:.0f}"}, rows)


def _figures(rows: Sequence[StepRow]) -> Figures:
    return {f"{row.verb}: {name}": getattr(row, name) for row in rows for name in ("own_gb", "processor_s")}


TABLES = (Table("robustness", "memory", ("lab.run",), StepRow, _cases, _measured, _shown, _figures, is_timed=True),)
