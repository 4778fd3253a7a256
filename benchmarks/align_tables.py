"""The tables of bench_align, as markdown."""

from collections.abc import Iterable

import numpy as np

from benchmarks.align_sessions import FOUND_PX
from fixtures.mesh_shapes import NEARLY_SYMMETRIC, OWN_MIRROR_IMAGE, SYMMETRIC

INSIDE_6 = 12.592
"""95 % quantile of chi-square with 6 degrees of freedom."""


def tables(results: dict) -> str:
    """Return all tables whose rows are there."""
    made = [_found, _full, _wrong, _speed]
    rows = ["found", "full", "wrong", "speed"]
    return "\n".join(
        f"{table(results[row]['marks'])}\n\n(`{row}`, at {results[row]['commit']}.)\n"
        for row, table in zip(rows, made, strict=True)
        if results.get(row, {}).get("marks")
    )


def _kind(name: str) -> str:
    return "symmetric" if name in SYMMETRIC else "nearly symmetric" if name in NEARLY_SYMMETRIC else ""


def _found(marks: dict) -> str:
    lines = [
        "| shape | | sessions | found | said to be ambiguous | refused | wrong, and not said |",
        "|---|---|---|---|---|---|---|",
    ]
    total = np.zeros(5, int)
    for name, seeds in marks.items():
        row = np.sum([_verdict(mark) for mark in seeds.values()], axis=0)
        # The turn of a solid of revolution cannot be found; that it is said is what counts.
        total += 0 if name in SYMMETRIC else row
        lines.append(f"| {name} | {_kind(name)} | " + " | ".join(map(str, row)) + " |")
    share = 100 * total[1] / max(total[0], 1)
    lines.append(f"| **all but the symmetric** | | {total[0]} | **{total[1]} ({share:.1f} %)** | ")
    lines[-1] += " | ".join(map(str, total[2:])) + " |"
    found = [mark for name, seeds in marks.items() for mark in seeds.values() if _is_found(mark)]
    pixels = [mark["apart_px"] for mark in found]
    inside = np.mean([mark["inside_square"] < INSIDE_6 for mark in found])
    lines.append("")
    lines.append(
        f"Where found: {_spread(pixels)} px from the true pose's picture (rms over the scan; median, 90 %), true pose "
        f"inside the 95 % region in {100 * inside:.0f} %, {_spread(mark['register_seconds'] for mark in found)} s on "
        "one core."
    )
    return "\n".join(lines)


def _is_found(mark: dict) -> bool:
    return mark.get("apart_px", np.inf) < FOUND_PX


def _verdict(mark: dict) -> list[int]:
    found, refused, ambiguous = _is_found(mark), mark["refused"] > 0, mark.get("ambiguous", 0) > 0
    return [1, int(found), int(ambiguous), int(refused), int(not (found or refused or ambiguous))]


def _full(marks: dict) -> str:
    lines = [
        "| shape | rms, px | rotation, deg | truth normals, deg | at the true pose | under 2 sigma | seconds |",
        "|---|---|---|---|---|---|---|",
    ]
    pool: dict[str, list[float]] = {}
    for name, seeds in marks.items():
        good = [mark for mark in seeds.values() if _is_found(mark) or (name in SYMMETRIC and "normal_deg" in mark)]
        cells = []
        for key, form in (
            ("apart_px", "{:.2f}"), ("degrees", "{:.2f}"), ("normal_deg", "{:.2f}"),
            ("normal_at_true_pose_deg", "{:.2f}"), ("under_two_sigma", "{:.3f}"), ("register_seconds", "{:.0f}"),
        ):  # fmt: skip
            values = [mark[key] for mark in good]
            if name not in SYMMETRIC:
                pool.setdefault(key, []).extend(values)
            hidden = name in SYMMETRIC and key in ("apart_px", "degrees")
            cells.append("" if hidden or not values else form.format(np.median(values)))
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    cells = [f"**{np.median(values):.2f}**" for values in pool.values()]
    return "\n".join([*lines, "| **median** | " + " | ".join(cells) + " |"])


def _wrong(marks: dict) -> str:
    lines = ["| scan | sessions | refused | a warning said so | accepted in silence |", "|---|---|---|---|---|"]
    table: dict[str, list[int]] = {}
    for name, seeds in marks.items():
        fault, _, shape = name.partition(": ")
        if shape in OWN_MIRROR_IMAGE and fault == "mirrored":
            # Its mirror image is itself.
            continue
        row = table.setdefault(fault, [0, 0, 0, 0])
        for mark in seeds.values():
            refused, warned = mark["refused"] > 0, mark["warned"] > 0
            row[0] += 1
            row[1] += refused
            row[2] += warned and not refused
            row[3] += not (warned or refused)
    return "\n".join(lines + [f"| {fault} | " + " | ".join(map(str, row)) + " |" for fault, row in table.items()])


def _speed(marks: dict) -> str:
    sizes = list(marks)
    lines = [
        "| seconds (on one core) | " + " | ".join(sizes) + " |",
        "|---|" + "---|" * len(sizes),
    ]
    for stage in marks[sizes[0]]["stages"]:
        spent = [marks[size]["stages"][stage] for size in sizes]
        lines.append(f"| {stage} | " + " | ".join(f"{wall:.1f} ({cpu:.1f})" for wall, cpu in spent) + " |")
    lines.append("| own memory, GB | " + " | ".join(f"{marks[size]['gigabytes']:.1f}" for size in sizes) + " |")
    cores = marks[sizes[0]]["cores"]
    return "\n".join([*lines, "", f"`rgbn align` after `calibrate`, {cores} cores; in brackets what one would need."])


def _spread(values: Iterable[float]) -> str:
    array = np.array(list(values))
    return f"{np.median(array):.2f}, {np.percentile(array, 90):.2f}" if len(array) else "-"
