"""What a kill costs at random moments of every verb, and what damaged files do at every door of the program."""

import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.harness import ROOT, Scale, Table, folded
from fixtures.bad_input.law import Case, Watched, shares, take

SCENE = """name = "box"
[camera]
width = 96
height = 72
fx = 150.0
[[objects]]
shape = "sphere"
scale = 40
translate_mm = [4, -3, -300]
material = "m"
[materials.m]
kind = "diffuse"
reflectance = 0.5
[[lights]]
kind = "ring"
count = 24
polar_deg = 35
distance_mm = 700
[sampling]
engine = "many"
"""
SESSION = "{session} --out {out}"
TWIN = f"{SESSION} --engine many"
SMALL_DATASET = "dataset make blob-ambient-0.00 --side 64 --shelf"
VERBS = {
    "check": ("", f"check {SESSION}"),
    "calibrate": (f"check {SESSION}", f"calibrate {SESSION}"),
    "align": (f"calibrate {SESSION}", f"align {SESSION}"),
    "solve": (f"align {SESSION}", f"solve {SESSION} --method ls,iterative,tv"),
    "twin": (f"solve {SESSION}", f"twin {TWIN}"),
    "compare": (f"twin {TWIN}", f"compare {TWIN}"),
    "export": (f"calibrate {SESSION}", f"export {SESSION} --format dome"),
    "process": ("", f"process {TWIN}"),
    "twin SCENE": ("", "twin {scene} --out {out}"),
    "sweep": ("", "sweep noise --quick --method ls,iterative --out {out}"),
    "dataset make": ("", f"{SMALL_DATASET} {{out}}"),
    "dataset run": (f"{SMALL_DATASET} {{shelf}}", "dataset run --method ls,iterative --shelf {shelf} --out {out}"),
}
"""What is done before, and what is killed: on the fixture at half its size, a small scene, a small dataset."""
TIMES = re.compile(r"created|seconds|[a-z_]*seconds[a-z_]*|session|exif")
"""Keys that tell when, or how fast."""
UNALIKE = ("rgbn.log", "seconds.parquet", "results.csv", "report.html", "index.html", "speed.svg")
"""Files of seconds: only their being there is compared."""


@dataclass(frozen=True)
class KillRow:
    """What became of one verb: `alike` of `killed` ended, run again, with the files of a run that nobody killed."""

    verb: str
    undisturbed_s: float
    killed: int
    alike: int
    differing: tuple[str, ...]


def _killed(verb: str, kills: int) -> list[KillRow]:
    """Run a verb undisturbed; then kill it at moments spread over that time, and run it again to its end."""
    before, command = VERBS[verb]
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        shutil.copytree(ROOT / "fixtures" / "bumpy", place / "session")
        manifest = place / "session" / "session.toml"
        manifest.write_text(manifest.read_text().replace("[frames]", "[frames]\nhalf = true"))
        (place / "scene.toml").write_text(SCENE)
        # A twin is named after the folder that it lies in.
        base, whole = place / "before" / "out", place / "whole" / "out"
        if before:
            _to_end(_words(before, place, base))
        _copied(base, whole)
        start = time.perf_counter()
        _to_end(_words(command, place, whole))
        seconds, expected = time.perf_counter() - start, _contents(whole)
        killed, alike, differing, first = 0, 0, set[str](), random.Random(verb).random()
        for moment in range(3 * kills):
            out = place / str(moment) / "out"
            _copied(base, out)
            if _kill(_words(command, place, out), seconds * (0.1 + 0.9 * ((first + moment * 0.618034) % 1))):
                _to_end(_words(command, place, out))
                found = _contents(out)
                killed, alike = killed + 1, alike + (found == expected)
                differing |= {name for name in {*found, *expected} if found.get(name) != expected.get(name)}
            shutil.rmtree(out.parent, ignore_errors=True)
            if killed == kills:
                break
    return [KillRow(verb, seconds, killed, alike, tuple(sorted(differing)))]


def _copied(base: Path, out: Path) -> None:
    if base.exists():
        shutil.copytree(base, out)


def _words(command: str, place: Path, out: Path) -> list[str]:
    known = {"session": place / "session", "scene": place / "scene.toml", "shelf": place / "shelf", "out": out}
    return [str(Path(sys.executable).with_name("rgbn")), *(word.format(**known) for word in command.split())]


def _to_end(words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.returncode}\n{done.stderr}")


def _kill(words: list[str], after_s: float) -> bool:
    """Start a command and kill it with all that it started; return whether it was still at work."""
    with subprocess.Popen(
        words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT, start_new_session=True
    ) as process:
        time.sleep(after_s)
        if at_work := process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    return at_work


def _contents(folder: Path) -> dict[str, str]:
    """Return the hash of every file but the record's, without what tells the time."""
    from pyarrow import parquet

    found = {}
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or ".rgbn" in path.parts:
            continue
        data = path.read_bytes()
        if path.suffix == ".json":
            data = json.dumps(_timeless(json.loads(data))).encode()
        elif path.suffix == ".parquet":
            table = parquet.read_table(path)
            data = repr(table.drop_columns([c for c in table.column_names if c == "seconds"]).to_pylist()).encode()
        name = path.relative_to(folder).as_posix()
        found[name] = "" if name.endswith(UNALIKE) else hashlib.sha256(data).hexdigest()
    return found


def _timeless(value: object) -> object:
    if isinstance(value, dict):
        return {key: _timeless(part) for key, part in value.items() if not TIMES.fullmatch(key)}
    return [_timeless(part) for part in value] if isinstance(value, list) else value


def _kill_cases(scale: Scale) -> list[tuple]:
    if scale == "full":
        return [(verb, 12 if "process" not in verb else 6) for verb in VERBS]
    return [("check", 1)] if scale == "small" else [(verb, 2) for verb in ("check", "twin SCENE", "dataset make")]


def _of_kills(rows: Sequence[KillRow]) -> str:
    killed, alike = (sum(getattr(row, field) for row in rows) for field in ("killed", "alike"))
    text = f"{killed} runs of {len(rows)} verbs were killed; {alike} ended with the same files.\n\n"
    wrong = (f"`{row.verb}`: {', '.join(row.differing)}" for row in rows if row.differing)
    return text + folded("Files that differed", wrong)


@dataclass(frozen=True)
class DoorRow:
    """How damaged files ended at one door; `wrong` tells of tracebacks, crashes and hangs."""

    door: str
    cases: int
    read: int
    refused: int
    wrong: tuple[str, ...]
    slowest_s: float


def _damaged(door: str, count: int, seed: int) -> list[DoorRow]:
    """Damage one file of a small real sample, so many times; a process with a limit of time and memory reads it."""
    ends, slowest, wrong = Counter[str](), 0.0, []

    def judge(case: Case) -> None:
        nonlocal slowest
        start = time.perf_counter()
        end, said = worker.judge(*case)
        slowest = max(slowest, time.perf_counter() - start)
        ends[end] += 1
        if end not in ("value", "refused"):
            wrong.append(f"{end}, {', '.join(case[1])}: {said.strip().splitlines()[-1][:200]}")

    with tempfile.TemporaryDirectory() as place:
        worker = Watched(Path(place))
        try:
            take(worker, door, count, seed, judge)
        finally:
            worker.close()
    return [DoorRow(door, ends.total(), ends["value"], ends["refused"], tuple(wrong), slowest)]


def _door_cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [("lights lights.lp", 20, 0)]
    seed, counts = (0, shares(200)) if scale == "gates" else (11, shares(4000))
    slow = ("process", "rgbn") if scale == "gates" else ()
    return [(door, count, seed) for door, count in counts.items() if not door.startswith(slow)]


def _of_doors(rows: Sequence[DoorRow]) -> str:
    cases, read, refused = (sum(getattr(row, field) for row in rows) for field in ("cases", "read", "refused"))
    wrong = [f"{row.door}: {said}" for row in rows for said in row.wrong]
    text = (
        f"{cases} damaged files of {len(rows)} kinds: {read} read, {refused} refused by one message, {len(wrong)} "
        "ended in a traceback, crash or hang.\n\n"
    )
    return text + folded("What must not be", wrong)


TABLES = (
    Table(
        "robustness", "kills", ("rgbn.cli",), KillRow, _kill_cases, _killed, _of_kills,
        lambda rows: {"ended otherwise": float(sum(row.killed - row.alike for row in rows))},
    ),
    Table(
        "robustness", "bad input", ("rgbn.cli",), DoorRow, _door_cases, _damaged, _of_doors,
        lambda rows: {"traceback, crash, hang": float(sum(len(row.wrong) for row in rows)),
                      "read": float(sum(row.read for row in rows))},
    ),
)  # fmt: skip
