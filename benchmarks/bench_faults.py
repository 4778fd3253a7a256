"""The faults table: each plausible mistake made in several sessions of known truth; into docs/evidence/faults.md.

    .venv/bin/python -m benchmarks.bench_faults [--only NAME] [--session NAME] [--looked-at] [--jobs 1] [--write]

Goes on where it was stopped: a case's result is kept in out/faults/REVISION, the last commit's, or --out.
"""

import argparse
import contextlib
import io
import json
import multiprocessing
import re
import subprocess
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.fault_list import MISTAKES, Mistake, session, varied
from benchmarks.fault_sessions import LOOKED_AT, ROOT, SESSIONS, WITH_SCAN, Taken, write
from benchmarks.pages import put
from scene.errors import SceneError
from scene.normals import angular_error_deg
from scene.store import Store

HARMFUL_DEG = 1.0


@dataclass(frozen=True)
class Outcome:
    """What became of a session.

    Parameters
    ----------
    lights_deg, normals_deg : float or None
        Median errors: of the lights' directions at the object, of least squares' normals; None: there are none.
    turn_deg, shift_mm : float or None
        Of the scan's pose.
    refused : str
        The error's message; empty: none.
    warnings : list of str
    crashed : bool
        It ended in a traceback, which `refused` ends with.
    """

    lights_deg: float | None = None
    normals_deg: float | None = None
    turn_deg: float | None = None
    shift_mm: float | None = None
    refused: str = ""
    warnings: tuple[str, ...] = ()
    crashed: bool = False


def run(taken: Taken) -> Outcome:
    """Write a session, take it as far as least squares, and compare with the truth what is there."""
    from lab.options import Solving
    from lab.plan import STEPS
    from lab.run import open_job

    refused, crashed, warnings = "", False, []
    with tempfile.TemporaryDirectory(prefix="rgbn-faults-") as scratch:
        folder, out = Path(scratch) / "session", Path(scratch) / "out"
        write(taken, folder)
        try:
            with contextlib.redirect_stderr(io.StringIO()), open_job(folder, out=out, solving=Solving("ls")) as job:
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
    told = [text.replace(scratch, "") for text in warnings]
    return Outcome(**marks, refused=refused.replace(scratch, ""), warnings=tuple(told), crashed=crashed)


def _marks(taken: Taken, store: Store) -> dict[str, float | None]:
    marks: dict[str, float | None] = {}
    if store.path("lights.json").exists():
        found = store.load_lights().directions
        if len(found) == len(taken.directions):
            marks["lights_deg"] = float(np.median(angular_error_deg(found, taken.directions)))
    if taken.normals is not None and store.path("normals", "ls.npy").exists():
        normals = store.load_normals("ls")
        if normals.shape == taken.normals.shape:
            marks["normals_deg"] = float(np.nanmedian(angular_error_deg(normals, taken.normals)))
    if (
        taken.pose is not None
        and taken.scan is not None
        and taken.true_center_mm is not None
        and store.path("pose.json").exists()
    ):
        pose = store.load_pose()
        marks["turn_deg"] = (pose @ taken.pose.inverse()).angle_deg()
        # Where a scaled scan's middle should be is where that of the scan itself is.
        marks["shift_mm"] = float(
            np.linalg.norm(pose.apply(taken.scan.center_mm) - taken.pose.apply(taken.true_center_mm))
        )
    return marks


@dataclass(frozen=True)
class Verdict:
    """How a mistake was met: `harm_deg` above the session's own errors, what was new among the messages."""

    harm_deg: float
    noticed: bool
    named: bool
    said: tuple[str, ...]


def judge(mistake: Mistake, found: Outcome, sound: Outcome) -> Verdict:
    """Compare a case with the same session without the mistake."""
    known = {_plain(text) for text in sound.warnings}
    # That there is no scan is the session's doing, and no alarm.
    said = [text for text in found.warnings if _plain(text) not in known and not text.startswith("No scan and no")]
    said += [found.refused] if found.refused and not found.crashed else []
    named = any(all(re.search(word, text, re.IGNORECASE) for word in mistake.words) for text in said)
    harm = 0.0
    for name in ("lights_deg", "normals_deg", "turn_deg"):
        value = getattr(found, name)
        if value is not None:
            harm = max(harm, value - (getattr(sound, name) or 0.0))
    return Verdict(harm, bool(said), bool(mistake.words) and named, tuple(said))


def _plain(text: str) -> str:
    """Return a message without its numbers."""
    return re.sub(r"[-+]?\d[\d.,]*", "#", text)


def can_tell(name: str, where: str) -> bool:
    """Whether a session's data can tell a mistake."""
    kind = MISTAKES[name].kind
    return kind == "tells" or (kind == "with scan" and where in WITH_SCAN)


def case(name: str, where: str, folder: Path) -> None:
    """Run a case unless its result is there."""
    path = folder / re.sub(r"\W+", "-", where) / f"{re.sub(r'[^a-z0-9]+', '-', name.lower())}.json"
    if path.exists():
        return
    mistake = MISTAKES[name]
    begin = time.process_time()
    made = mistake.make(varied(session(where), mistake.variant))
    result = {"name": name, "session": where, "applies": made is not None}
    if made is not None:
        result |= asdict(run(made))
    result["seconds"] = time.process_time() - begin
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result, indent=1))
    print(f"{where}: {name}: {result['seconds']:.0f} s", flush=True)


def results(folder: Path, names: list[str], sessions: list[str]) -> dict[tuple[str, str], dict]:
    """Return the cases that there are, by mistake and session."""
    rows = [json.loads(path.read_text()) for path in sorted(folder.glob("*/*.json"))]
    found = {(row["name"], row["session"]): row for row in rows if row["applies"]}
    return {key: row for key, row in found.items() if key[0] in names and key[1] in sessions}


def outcome_of(row: dict) -> Outcome:
    """Return a stored case's outcome."""
    return Outcome(**{key: row[key] for key in Outcome.__dataclass_fields__})


def verdicts(rows: dict[tuple[str, str], dict]) -> dict[tuple[str, str], Verdict]:
    """Judge every case whose sound session was run, too."""
    sound = {
        "balls": "nothing wrong",
        "balls and light file": "nothing wrong, light file and balls",
        "light file": "nothing wrong, light file",
    }
    found = {}
    for (name, where), row in rows.items():
        base = rows.get((sound[MISTAKES[name].variant], where))
        if base is not None:
            # What the sound session says is said of it, not of a mistake: only its own row counts it.
            against = Outcome() if name in sound.values() else outcome_of(base)
            found[name, where] = judge(MISTAKES[name], outcome_of(row), against)
    return found


def table(rows: dict[tuple[str, str], dict], judged: dict[tuple[str, str], Verdict], sessions: list[str]) -> str:
    """Return the page's table and the rates."""
    lines = [
        "| mistake | " + " | ".join(sessions) + " | data can tell |",
        "|---" * (len(sessions) + 2) + "|",
    ]
    for name, mistake in MISTAKES.items():
        if not any((name, where) in judged for where in sessions):
            continue
        cells = []
        for where in sessions:
            if (name, where) not in judged:
                cells.append("")
                continue
            cells.append(_cell(outcome_of(rows[name, where]), judged[name, where], mistake))
        told = {"tells": "yes", "with scan": f"with a scan: {mistake.why}", "cannot": f"no: {mistake.why}"}
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {told.get(mistake.kind, f'no harm: {mistake.why}')} |")
    telling = [judged[key] for key in rows if key in judged and can_tell(*key)]
    count = max(len(telling), 1)
    sound = [key for key in judged if key[0].startswith("nothing wrong")]
    silent = [key for key, one in judged.items() if key not in sound and not one.noticed and one.harm_deg > HARMFUL_DEG]
    mute = sum(not can_tell(*key) for key in silent)
    others = sum(not can_tell(*key) for key in judged if key not in sound)
    alarms = [key for key in sound if judged[key].noticed]
    lines += [
        "",
        "| of the mistakes that data can tell | bar | measured |",
        "|---|---|---|",
        f"| named rightly | 80 % | {sum(one.named for one in telling) / count:.0%} |",
        f"| noticed | 95 % | {sum(one.noticed for one in telling) / count:.0%} |",
        f"| silent with more than 1° of harm | 0 % | {(len(silent) - mute) / count:.0%} |",
        "",
        f"{len(telling)} cases. Silent with more than 1° of harm, of the {others} others: {mute}. "
        f"Sound sessions with a warning: {len(alarms)} of {len(sound)}.",
    ]
    return "\n".join(lines) + "\n"


def _cell(found: Outcome, verdict: Verdict, mistake: Mistake) -> str:
    state = "**silent**" if verdict.harm_deg > HARMFUL_DEG else "silent"
    if found.crashed:
        state = "**traceback**"
    elif verdict.named:
        state = "refused, named" if found.refused else "named"
    elif verdict.noticed:
        state = "refused" if found.refused else "noticed"
    if mistake.kind == "harmless" and not verdict.noticed:
        state = "silent"
    error = [f"{found.lights_deg:.1f}°" if found.lights_deg is not None else "–"]
    error += [f"{found.normals_deg:.1f}°"] if found.normals_deg is not None else []
    error += [f"{found.turn_deg:.1f}° {found.shift_mm:.0f} mm"] if found.turn_deg is not None else []
    return f"{state}; {', '.join(error)}"


def _revision() -> str:
    command = ["git", "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def main() -> None:
    """Run what is missing, print the table, and write it if asked to."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", action="append", default=[], help="mistakes whose name has this in it")
    parser.add_argument("--session", action="append", default=[], choices=list(SESSIONS))
    parser.add_argument("--looked-at", action="store_true", help="the sessions on which thresholds were chosen")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--said", action="store_true", help="print what was said in each case")
    arguments = parser.parse_args()
    folder = arguments.out or ROOT / "out" / "faults" / _revision()
    looked = [name for name in SESSIONS if (name in LOOKED_AT) == arguments.looked_at]
    sessions = arguments.session or looked
    names = [
        name
        for name in MISTAKES
        if not arguments.only or name.startswith("nothing wrong") or any(part in name for part in arguments.only)
    ]
    todo = [(name, where, folder) for where in sessions for name in names]
    with ProcessPoolExecutor(arguments.jobs, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(case, *zip(*todo, strict=True)))
    rows = results(folder, names, sessions)
    judged = verdicts(rows)
    if arguments.said:
        for (name, where), verdict in judged.items():
            print(f"\n{where} | {name} | {_cell(outcome_of(rows[name, where]), verdict, MISTAKES[name])}")
            for text in verdict.said:
                print(f"    {text[:400]}")
    text = table(rows, judged, sessions)
    print(text)
    if arguments.write:
        put(ROOT / "docs" / "evidence" / "faults.md", "faults", text)


if __name__ == "__main__":
    main()
