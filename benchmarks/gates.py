"""One set of figures of every step, as one JSON; and what moved between two of them.

    python -m benchmarks.gates out/gates.json            `make gates`: half an hour on two cores
    python -m benchmarks.gates OLD.json NEW.json         `make gates-compare OLD=... NEW=...`

Each figure is a list of values: what depends on the clock is measured twice, and their difference is its noise. What
needs a folder that is absent is said, and not measured.
"""

import json
import os
import sys
import time
from math import inf, isnan
from pathlib import Path

from benchmarks.harness import commit, rounded, run, tables

LEFT_OUT = (
    "calibration/balls", "calibration/scan as probe", "methods/light distance",
    "methods/intensities", "methods/four ways", "sweeps/stability", "twin/engines",
    "robustness/memory",
)  # fmt: skip
"""Tables of no step's own figures, or whose time is too long here; measured where they are named."""
SHOWN = 1e-4
"""A relative change that is called one, where a figure has no noise of its own."""


def measure(file: Path, only: list[str]) -> None:
    """Measure all tables at the scale of the gates, keep each as soon as it is there, and write the JSON."""
    found = json.loads(file.read_text()) if file.is_file() else {}
    head = {"commit": commit(), "cores": os.cpu_count()}
    # What is in no commit may have changed since.
    if found.get("commit") != head["commit"] or head["commit"].endswith("-dirty"):
        found = {**head, "figures": {}, "seconds": {}, "absent": {}}
    file.parent.mkdir(parents=True, exist_ok=True)
    for table in tables():
        is_wanted = table.key in only or table.page in only if only else table.key not in LEFT_OUT
        if table.key in found["seconds"] or not is_wanted:
            continue
        if table.absent:
            found["absent"][table.key] = str(table.absent[0])
            print(f"{table.key}: not measured, {table.absent[0]} is absent", file=sys.stderr)
            continue
        start = time.perf_counter()
        is_twice = table.is_timed and not table.is_steady
        rounds = [rounded(table.figures(run(table, "gates", is_new=is_twice)))]
        if is_twice:
            rounds.append(rounded(table.figures(run(table, "gates", is_new=True))))
        found["figures"] |= {f"{table.key}: {name}": [one[name] for one in rounds] for name in rounds[0]}
        found["seconds"][table.key] = round(time.perf_counter() - start, 1)
        file.write_text(json.dumps(found, indent=1) + "\n")
    print(f"{file}: {len(found['figures'])} figures, {sum(found['seconds'].values()) / 60:.1f} minutes")


def moved(old: dict[str, list[float]], new: dict[str, list[float]]) -> list[str]:
    """Return a line for each figure that moved by more than its own noise, the greatest relative change first."""
    lines = []
    for name in old.keys() & new.keys():
        before, after = (sum(values) / len(values) for values in (old[name], new[name]))
        noise = max(max(values) - min(values) for values in (old[name], new[name]))
        if isnan(before) != isnan(after):
            lines.append((-inf, f"{name}: {before:.4g} -> {after:.4g}"))
        size = max(abs(before), abs(after), 1e-12)
        if abs(after - before) > max(noise, SHOWN * size):
            told = f"{name}: {before:.4g} -> {after:.4g} ({100 * (after - before) / size:+.1f} %"
            lines.append((-abs(after - before) / size, told + (f", noise {noise:.2g})" if noise else ")")))
    gone = [(0.0, f"{name}: only in the {where} one") for where, names in
            (("old", old.keys() - new.keys()), ("new", new.keys() - old.keys())) for name in sorted(names)]  # fmt: skip
    return [told for _, told in sorted(lines) + gone]


def main() -> None:
    """Measure, or compare."""
    files = [Path(word) for word in sys.argv[1:] if word.endswith(".json")]
    if len(files) == 2:
        old, new = (json.loads(file.read_text()) for file in files)
        print(f"{old['commit']} -> {new['commit']}, {len(old['figures'].keys() & new['figures'].keys())} figures")
        print("\n".join(moved(old["figures"], new["figures"])) or "nothing moved")
    else:
        measure(files[0], [word for word in sys.argv[1:] if not word.endswith(".json")])


if __name__ == "__main__":
    main()
