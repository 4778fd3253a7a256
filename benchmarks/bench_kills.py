"""What `kill -9` costs, at random moments of every verb; written into docs/evidence/robustness.md.

    .venv/bin/python -m benchmarks.bench_kills [--write] [--kills 100] [--only VERB,VERB]

Each verb runs on the fixture at half size (or on a scene, a dataset, an experiment of its own), where what it needs is
done already: once undisturbed, then killed at a moment spread over that time, and run again to its end. All files must
be the same then; times of day and seconds are left out of the comparison. All on one core.
"""

import argparse
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
from pathlib import Path

from pyarrow import parquet

from benchmarks.pages import put

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "evidence" / "robustness.md"
COMMAND = [str(Path(sys.executable).parent / "rgbn")]
SEED = 601
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
engine = "direct"
"""
TWIN = ["--engine", "direct"]
VERBS: dict[str, tuple[list[str], list[str]]] = {
    "check": ([], ["check", "SESSION"]),
    "calibrate": (["check", "SESSION"], ["calibrate", "SESSION"]),
    "align": (["calibrate", "SESSION"], ["align", "SESSION"]),
    "solve": (["align", "SESSION"], ["solve", "SESSION", "--method", "ls,iterative,tv", "--mesh", "OUT/mesh.ply"]),
    "twin": (["solve", "SESSION"], ["twin", "SESSION", *TWIN]),
    "compare": (["twin", "SESSION", *TWIN], ["compare", "SESSION", *TWIN]),
    "export": (["calibrate", "SESSION"], ["export", "SESSION", "--format", "dome"]),
    "process": ([], ["process", "SESSION", *TWIN]),
    "twin SCENE": ([], ["twin", "SCENE"]),
    "sweep": ([], ["sweep", "noise", "--quick", "--method", "ls,iterative"]),
    "dataset make": ([], ["dataset", "make", "blob-ambient-0.00", "--side", "64"]),
    "dataset run": ([], ["dataset", "run", "--method", "ls,iterative"]),
}
"""What is done before, and what is killed."""
CHANGING = re.compile(r'"(created|seconds|[a-z_]*seconds[a-z_]*|session|exif|time_and_error)"')
UNALIKE = ("seconds.parquet", "report.html", "index.html", "speed.svg")
"""Files of seconds: only their being there is compared."""


def words(command: list[str], place: Path, out: Path) -> list[str]:
    """Return a command line for one folder."""
    known = {"SESSION": place / "session", "SCENE": place / "scene.toml"}
    said = [str(known.get(word, word)).replace("OUT", str(out)) for word in command]
    if command[0] == "dataset":
        shelf = place / "shelf" if command[1] == "run" else out
        more = ["--shelf", str(shelf)]
        return [*COMMAND, *said, *more, *(["--out", str(out)] if command[1] == "run" else [])]
    return [*COMMAND, *said, "--out", str(out)]


def contents(folder: Path) -> dict[str, str]:
    """Return the hash of every file, the record and what tells the time apart."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if not path.is_file() or ".rgbn" in path.parts:
            continue
        data = path.read_bytes()
        if path.suffix == ".json":
            data = json.dumps(timeless(json.loads(data))).encode()
        elif path.suffix == ".parquet":
            table = parquet.read_table(path)
            kept = [column for column in table.column_names if column != "seconds"]
            data = repr(table.select(kept).to_pylist()).encode()
        found[name] = "" if path.name.endswith(UNALIKE) else hashlib.sha256(data).hexdigest()
    return found


def timeless(value: object) -> object:
    """Return JSON without the keys that tell when, or how fast."""
    if isinstance(value, dict):
        return {key: timeless(part) for key, part in value.items() if not CHANGING.fullmatch(json.dumps(key))}
    return [timeless(part) for part in value] if isinstance(value, list) else value


def run(command: list[str]) -> float:
    """Run a command to its end; return its seconds."""
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.returncode}\n{done.stderr}")
    return time.perf_counter() - start


def kill(command: list[str], after_s: float) -> bool:
    """Start a command and kill it with all that it started; return whether it was still at work."""
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT, start_new_session=True
    )
    time.sleep(after_s)
    at_work = process.poll() is None
    os.killpg(process.pid, signal.SIGKILL) if at_work else None
    process.wait()
    return at_work


def prepare(place: Path) -> None:
    """Make what the verbs read."""
    shutil.copytree(ROOT / "fixtures" / "bumpy", place / "session")
    manifest = place / "session" / "session.toml"
    manifest.write_text(manifest.read_text().replace("[frames]", "[frames]\nhalf = true"))
    (place / "scene.toml").write_text(SCENE)
    run([*COMMAND, "dataset", "make", "blob-ambient-0.00", "--side", "64", "--shelf", str(place / "shelf")])


def tried(verb: str, place: Path, kills: int, generator: random.Random) -> tuple[int, int, float]:
    """Return how often a verb was killed, how often it ended alike, and its seconds undisturbed."""
    before, command = VERBS[verb]
    # A twin is named after the folder that it lies in.
    base, whole = (place / f"{verb}-{state}" / "out" for state in ("before", "whole"))
    if before:
        run(words(before, place, base))
        shutil.copytree(base, whole)
    seconds = run(words(command, place, whole))
    expected, killed, alike, moment, first = contents(whole), 0, 0, 0, generator.random()
    while killed < kills and moment < 3 * kills:
        out = place / f"{verb}-{moment}" / "out"
        if before:
            shutil.copytree(base, out)
        at = seconds * (0.1 + 0.9 * ((first + moment * 0.618034) % 1))
        moment += 1
        if kill(words(command, place, out), at):
            killed += 1
            run(words(command, place, out))
            found = contents(out)
            alike += found == expected
            if found != expected:
                differing = sorted(n for n in {*found, *expected} if found.get(n) != expected.get(n))
                print(f"  {verb}, killed after {at:.2f} s: {', '.join(differing[:5])}", file=sys.stderr)
        shutil.rmtree(out.parent, ignore_errors=True)
    return killed, alike, seconds


def main() -> None:
    """Kill every verb, and print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100, help="in all")
    parser.add_argument("--only", default=",".join(VERBS), help="verbs, with commas")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--write", action="store_true", help="add to the table in docs/evidence/robustness.md")
    arguments = parser.parse_args()
    # On more cores the renderer's threads add to a pixel in the order in which they come: a code more or less.
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    generator, wanted = random.Random(arguments.seed), [name.strip() for name in arguments.only.split(",")]
    known = dict.fromkeys(VERBS, (0.0, 0, 0))
    if arguments.write:
        rows = re.findall(r"\| `(.+)` \| ([\d.]+) \| (\d+) \| (\d+) \|", PAGE.read_text())
        known |= {verb: (float(seconds), int(killed), int(alike)) for verb, seconds, killed, alike in rows}
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        prepare(place)
        for verb in wanted:
            killed, alike, seconds = tried(verb, place, -(-arguments.kills // len(wanted)), generator)
            known[verb] = (seconds, known[verb][1] + killed, known[verb][2] + alike)
            print(verb, *known[verb], file=sys.stderr, flush=True)
    lines = ["| verb | seconds | killed | ended with the same files |", "|---|---|---|---|"]
    lines += [f"| `{verb}` | {seconds:.1f} | {killed} | {alike} |" for verb, (seconds, killed, alike) in known.items()]
    lines.append(f"| all |  | {sum(row[1] for row in known.values())} | {sum(row[2] for row in known.values())} |")
    text = "\n".join(lines) + "\n"
    print(text)
    if arguments.write:
        put(PAGE, "kills", text)


if __name__ == "__main__":
    main()
