"""A person's mistakes, each made in sessions of known truth: which are named, noticed, refused or passed in silence."""

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fault_list import ALL, MISTAKES, Mistake, varied
from benchmarks.fault_sessions import BUNNY, LackingError, Taken, session, write
from benchmarks.harness import Figures, Scale, Table, markdown, opened
from lab.options import Solving
from lab.run import STEPS
from scene.errors import SceneError
from scene.normals import angular_error_deg
from scene.store import Store

HARMFUL_DEG = 1.0
FULL = (*(("bunny",) if BUNNY.is_dir() else ()), "balls 903", "far 902")
GATES = ("fixture without scan", "fixture")
"""The second, which is slow, for mistakes with the scan or the mask; a third of all mistakes."""


@dataclass(frozen=True)
class FaultRow:
    """What became of one session with one mistake in it.

    `lights_deg`, `normals_deg`: median errors of the lights' directions at the object and of least squares' normals;
    `turn_deg`, `shift_mm`: of the scan's pose; None: there are none. `refused`: the message, or what a traceback ends
    with. `can_tell`: whether this session's data can tell the mistake.
    """

    mistake: str
    session: str
    can_tell: bool
    lights_deg: float | None
    normals_deg: float | None
    turn_deg: float | None
    shift_mm: float | None
    refused: str
    crashed: bool
    warnings: tuple[str, ...]


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [
            (name, "fixture without scan") for name in ("nothing wrong, light file", "light file in degrees (no balls)")
        ]
    kept = [one.name for number, one in enumerate(ALL) if scale == "full" or number % 3 == 1 or _is_sound(one)]
    # A mistake is made in all sessions one after the other: what was stopped has whole rows.
    if scale == "full":
        return [(name, where) for name in kept for where in FULL]
    slow = [name for name in kept if re.search("nothing wrong|scan|mask", name)]
    return [(name, GATES[0]) for name in kept] + [(name, GATES[1]) for name in slow]


def _is_sound(mistake: Mistake) -> bool:
    return mistake.name.startswith("nothing wrong")


def _measured(name: str, where: str) -> list[FaultRow]:
    """Take a session as far as least squares, and compare with the truth what is there; no row: it cannot have it."""
    mistake = MISTAKES[name]
    try:
        taken = mistake.make(varied(session(where), mistake.variant))
    except LackingError:
        return []
    refused, crashed, warnings = "", False, []
    with tempfile.TemporaryDirectory(prefix="rgbn-faults-") as scratch:
        folder, out = Path(scratch) / "session", Path(scratch) / "out"
        write(taken, folder)
        try:
            with opened(folder, out, Solving("ls")) as job:
                try:
                    job.run(STEPS, "solve")
                finally:
                    warnings = [text for step in job.done.values() for text in step["warnings"]]
        except SceneError as error:
            refused = str(error)
        except Exception as error:
            refused, crashed = f"{type(error).__name__}: {error}", True
        marks = _marks(taken, Store(out))
    # A message tells of the case, not of where it lay.
    refused, *told = (text.replace(scratch, "") for text in (refused, *warnings))
    return [FaultRow(name, where, mistake.can_tell(taken), *marks, refused, crashed, tuple(told))]


def _marks(taken: Taken, store: Store) -> tuple[float | None, float | None, float | None, float | None]:
    """Return the errors of lights (degrees), normals (degrees) and pose (degrees, mm)."""
    lights_deg = normals_deg = turn_deg = shift_mm = None
    if store.path("lights.json").exists():
        lights = store.load_lights()
        if len(lights.directions) == len(taken.vectors):
            true = taken.directions(lights.reference_point_mm)
            lights_deg = float(np.median(angular_error_deg(lights.directions, true)))
    if taken.normals is not None and store.path("normals", "ls.npy").exists():
        normals = store.load_normals("ls")
        if normals.shape == taken.normals.shape:
            error = angular_error_deg(normals, taken.normals)
            normals_deg = float(np.nanmedian(error)) if np.isfinite(error).any() else None
    if (
        taken.pose is not None
        and taken.scan is not None
        and taken.scan_center_mm is not None
        and store.path("pose.json").exists()
    ):
        pose = store.load_pose()
        turn_deg = (pose @ taken.pose.inverse()).angle_deg()
        # Where a scaled scan's middle should be is where that of the scan itself is.
        off = pose.apply(taken.scan.center_mm) - taken.pose.apply(taken.scan_center_mm)
        shift_mm = float(np.linalg.norm(off))
    return lights_deg, normals_deg, turn_deg, shift_mm


@dataclass(frozen=True)
class Verdict:
    """How a case was met: harm above the session's own errors, whether what is new among the messages names it."""

    row: FaultRow
    harm_deg: float
    noticed: bool
    named: bool
    counts: bool
    """The same session without the mistake is not refused."""

    @property
    def silent_harm(self) -> bool:
        """Whether nothing was said and harm was done."""
        return not self.noticed and self.harm_deg > HARMFUL_DEG


def _judged(rows: Sequence[FaultRow]) -> list[Verdict]:
    """Judge every case whose sound session was run, too."""
    sound = {(MISTAKES[row.mistake].variant, row.session): row for row in rows if _is_sound(MISTAKES[row.mistake])}
    pairs = [(row, sound.get((MISTAKES[row.mistake].variant, row.session))) for row in rows]
    return [_verdict(row, base) for row, base in pairs if base is not None]


def _verdict(row: FaultRow, base: FaultRow) -> Verdict:
    # What the sound session says is said of it, not of a mistake: only its own row counts it.
    known = set() if row is base else {_plain(text) for text in base.warnings}
    # That there is no scan is the session's doing, and no alarm.
    said = [text for text in row.warnings if _plain(text) not in known and not text.startswith("No scan and no")]
    said += [row.refused] if row.refused and not row.crashed else []
    words = MISTAKES[row.mistake].words
    named = any(all(re.search(word, text, re.IGNORECASE) for word in words.split(" & ")) for text in said)
    errors = [(getattr(row, name), getattr(base, name)) for name in ("lights_deg", "normals_deg", "turn_deg")]
    harm = max((mine - (own or 0.0) for mine, own in errors if mine is not None), default=0.0)
    return Verdict(row, harm, bool(said), bool(words) and named, not base.refused)


def _plain(text: str) -> str:
    """Return a message without its numbers."""
    return re.sub(r"[-+]?\d[\d.,]*", "#", text)


def _figures(rows: Sequence[FaultRow]) -> Figures:
    """Return rates, 0 to 1, and counts."""
    judged = _judged(rows)
    sound = [one for one in judged if _is_sound(MISTAKES[one.row.mistake])]
    made = [one for one in judged if one not in sound and one.counts]
    telling, others = ([one for one in made if one.row.can_tell == can] for can in (True, False))
    return {
        "cases": len(telling), "named": _rate([one.named for one in telling]),
        "noticed": _rate([one.noticed for one in telling]), "silent": _rate([one.silent_harm for one in telling]),
        "others": len(others), "silent others": _rate([one.silent_harm for one in others]),
        "sound": len(sound), "sound refused": sum(bool(one.row.refused) for one in sound),
        "sound warned": sum(one.noticed and not one.row.refused for one in sound),
        "not counted": len(judged) - len(sound) - len(made), "crashed": sum(one.row.crashed for one in judged),
    }  # fmt: skip


def _rate(values: list[bool]) -> float:
    return sum(values) / max(len(values), 1)


def _shown(rows: Sequence[FaultRow]) -> str:
    figures = _figures(rows)
    lines = [
        ("mistakes that data can tell, cases", "{cases:.0f}"), ("named rightly", "{named:.0%}"),
        ("noticed", "{noticed:.0%}"), (f"silent, more than {HARMFUL_DEG:g}° of harm", "{silent:.0%}"),
        ("mistakes that they cannot tell or that do no harm, cases", "{others:.0f}"),
        (f"silent, more than {HARMFUL_DEG:g}° of harm", "{silent others:.0%}"),
        ("sessions without a mistake, warned; refused", "{sound warned:.0f}; {sound refused:.0f} of {sound:.0f}"),
        ("ended in a traceback", "{crashed:.0f}"),
    ]  # fmt: skip
    rates = markdown({"": "{what}", "measured": "{value}"},
                     [{"what": what, "value": form.format(**figures)} for what, form in lines])  # fmt: skip
    sessions = list(dict.fromkeys(row.session for row in rows))
    cells: dict[str, dict[str, Any]] = {}
    for one in _judged(rows):
        name = one.row.mistake
        told = MISTAKES[name].tells.removeprefix("yes")
        cells.setdefault(name, {"name": name, "tells": told, **dict.fromkeys(sessions, "")})[one.row.session] = _cell(
            one
        )
    columns = {
        "mistake": "{name}",
        **{where: f"{{{where}}}" for where in sessions},
        "data can tell; empty: yes": "{tells}",
    }
    return f"{rates}\n{markdown(columns, cells.values())}"


def _cell(one: Verdict) -> str:
    row, refused = one.row, "refused" if one.row.refused else ""
    state = "**silent**" if one.silent_harm else "silent"
    if row.crashed:
        state = "**traceback**"
    elif one.noticed:
        state = ", ".join(word for word in (refused, "named" if one.named else "" if refused else "noticed") if word)
    forms = (("{:.1f}°", row.lights_deg), ("{:.1f}°", row.normals_deg), ("{:.1f}°", row.turn_deg),
             ("{:.0f} mm", row.shift_mm))  # fmt: skip
    return f"{state}; {', '.join(form.format(value) for form, value in forms if value is not None) or '–'}"


TABLES = (Table("faults", "faults", ("lab.run",), FaultRow, _cases, _measured, _shown, _figures),)
