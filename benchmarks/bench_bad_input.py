"""Damaged inputs at every door of the program: how many end in one message, a traceback, a crash or a hang.

    .venv/bin/python -m benchmarks.bench_bad_input 2000 [--seed 0] [--only PREFIX] [--keep FOLDER] [--messages]

Each case damages one file of a small real sample; a process of its own, with a limit of time and memory, takes it to
the door. --keep writes what went wrong there: the damaged file and what was said.
"""

import argparse
import re
import sys
import tempfile
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from fixtures.bad_input.cases import Case, shares
from fixtures.bad_input.law import take
from fixtures.bad_input.watch import Watched

BAD = ("fault", "crash", "hang")
ENDS = ("value", "refused", *BAD)


@dataclass
class Told:
    """What came of one door's cases."""

    ends: Counter = field(default_factory=Counter)
    slowest: float = 0.0
    said: Counter = field(default_factory=Counter)


def main() -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="doors whose names begin so")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--messages", action="store_true", help="also the commonest messages")
    words = parser.parse_args()
    start = time.perf_counter()
    told: dict[str, Told] = defaultdict(Told)
    with tempfile.TemporaryDirectory() as place:
        worker = Watched(Path(place))
        for door, count in shares(words.count, words.only).items():
            _run(worker, door, count, words.seed, told[door], words.keep)
            print(f"{door}: {dict(told[door].ends)}", file=sys.stderr, flush=True)
        worker.close()
    print(f"\n| door | {' | '.join(('cases', *ENDS))} | slowest, s |\n|---{'|---:' * 7}|")
    told["all"] = Told(sum((one.ends for one in told.values()), Counter()), max(one.slowest for one in told.values()))
    for door, one in told.items():
        row = (one.ends.total(), *(one.ends[end] for end in ENDS))
        print(f"| {door} | {' | '.join(map(str, row))} | {one.slowest:.1f} |")
        if words.messages:
            print("\n".join(f"    {number} {said}" for said, number in one.said.most_common(8)))
    print(f"\nseed {words.seed}, {time.perf_counter() - start:.0f} s")


def _run(worker: Watched, door: str, count: int, number: int, told: Told, keep: Path | None) -> None:
    """Take so many cases to one door."""

    def judge(case: Case) -> None:
        begin = time.perf_counter()
        end, said = worker.judge(*case)
        told.slowest = max(told.slowest, time.perf_counter() - begin)
        told.ends[end] += 1
        told.said[re.sub(r"[^ ]*/[^ ]*|[0-9.]+", "_", said)[:100]] += 1
        if end in BAD:
            print(f"{door}: {end}: {said.strip().splitlines()[-1][:200]}", flush=True)
            _keep(keep, case, said)

    take(worker, door, count, number, judge)


def _keep(folder: Path | None, case: Case, said: str) -> None:
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    number = len(list(folder.glob("*.txt")))
    (folder / f"{number:03d}.txt").write_text(f"{case[0]}: {list(case[1])}\n{said}\n")
    for name, data in case[1].items():
        if data is not None:
            (folder / f"{number:03d}-{name.replace('/', '_')}").write_bytes(data)


if __name__ == "__main__":
    main()
