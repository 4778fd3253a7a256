"""`rgbn series FOLDER`: sessions of one object in which one factor changes; do photographs and twins get worse alike?

As Figures 5 and 6 of the RGBN benchmark: error against the factor, real beside synthetic, method by method.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from capture.session.session import load_session
from compare.report.facts import read_optional
from compare.report.page import section, table, whole_page
from compare.statistics.statistics import error_correlation, statistics_rows
from draw.line_chart import line_chart
from draw.readable import readable
from lab.many_sessions import process_all, sessions_below
from lab.options import AS_BEFORE, Place, Settings
from lab.progress import say
from scene.errors import SceneError
from scene.files import write_text
from scene.notebook import csv_text
from scene.store import Store

PAGE, TABLE = "series.html", "series.csv"
KINDS = {"real": "photographs", "twin": "twin"}
WIDE_RANGE = 20.0
"""Largest over smallest value from which on the axis is logarithmic."""
Value = float | str


def series(
    folder: Path, place: Place, said: Settings = AS_BEFORE, *, jobs: int = 1, scheduler: str | None = None
) -> None:
    """Process all sessions of a series, as `rgbn process PARENT` does, and write series.html and series.csv, too.

    The twins get a noise like the photographs', unless `said` has it otherwise: an ISO is a factor, too.

    Raises
    ------
    SceneError
        Fewer than two sessions, one that names no factor or another, one value in all; some could not be processed.
    """
    sessions = sessions_below(folder)
    names = [session.relative_to(folder).as_posix() for session in sessions]
    told = {name: load_session(session).series for name, session in zip(names, sessions, strict=True)}
    factor, values = _factor(folder, told)

    def write(out: Path) -> None:
        rows = series_rows(out, values)
        write_text(out / TABLE, csv_text(rows))
        write_text(out / PAGE, series_page(folder.resolve().name, factor, rows))
        say(f"written: {out / PAGE}, {out / TABLE}")

    said = replace(said, photograph=True) if said.photograph is None else said
    process_all(folder, sessions, place, said, jobs=jobs, scheduler=scheduler, more=write, own=(PAGE, TABLE))


def _factor(parent: Path, told: Mapping[str, tuple[str, Value] | None]) -> tuple[str, dict[str, Value]]:
    """Return what changes, and its value in each session."""
    do = 'In each session.toml: [series] factor = "iso", value = 400.'
    if not told:
        raise SceneError(f"{parent}: found fewer than two sessions below it. A series is two or more. {do}")
    if lacking := [name for name, one in told.items() if one is None]:
        raise SceneError(f"{parent}: {', '.join(lacking)}: has no [series]. {do}")
    known = {name: one for name, one in told.items() if one is not None}
    factors, values = {factor for factor, _ in known.values()}, {name: value for name, (_, value) in known.items()}
    if len(factors) > 1:
        raise SceneError(f"{parent}: found the factors {', '.join(sorted(factors))}; a series has one. {do}")
    if len({type(value) is str for value in values.values()}) > 1:
        raise SceneError(f"{parent}: some values are numbers, some are words. {do}")
    if len(set(values.values())) < 2:
        raise SceneError(f"{parent}: all sessions have the value {next(iter(values.values()))}. {do}")
    return factors.pop(), values


def series_rows(folder: Path, values: Mapping[str, Value]) -> list[dict[str, Any]]:
    """Return the table: session, value, and a row for each method and each of real and twin as statistics.csv has it.

    median_difference_low_deg, median_difference_high_deg: 95 % interval of real less twin. By the value; a session
    without errors is left out.
    """
    found: list[dict[str, Any]] = []
    for name, value in sorted(values.items(), key=lambda item: item[1]):
        compared = (read_optional(Store(folder / name), "summary.json") or {}).get("compare") or {}
        for row in statistics_rows(compared):
            of = compared["methods"][row["method"]]
            ends = {key: of.get(key) for key in ("median_difference_low_deg", "median_difference_high_deg")}
            found.append({"session": name, "value": value, **row, **ends})
    return found


def series_page(title: str, factor: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the page: a chart and a table for each method, and how alike photographs and twins rank the levels."""
    if not rows:
        said = "No session has a ground truth: without a scan or given normals there is no error to show."
        return whole_page(title, "series", said, "")
    every = list(dict.fromkeys(row["value"] for row in rows))
    chapters, means, ranked = [], [], []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        curves = {kind: [_mean(own, kind, value) for value in every] for kind in KINDS}
        pairs = np.array([curves["real"], curves["twin"]])
        means.append(pairs)
        ranked.append((escape(method), _rank(*pairs), str(np.isfinite(pairs).all(0).sum())))
        chapters.append(section(method, escape(method), _chart(factor, every, curves) + _table(factor, own)))
    together = _rank(*np.concatenate(means, axis=1))
    lead = (
        "Mean angular errors of the photographs against those of the twins, which are rendered with each session's own "
        f"lights, noise and scan. All methods and levels together rank alike to {together} (1: the same order)."
    )
    alike = section("alike", "Fail alike?", table(("method", "rank correlation", "levels"), ranked), lead)
    said = f"{factor}: {', '.join(map(_value, every))}"
    return whole_page(title, "series", escape(said), alike + "".join(chapters))


def _rank(real: Sequence[float], twin: Sequence[float]) -> str:
    """Return the rank correlation in words: of three levels at least, and where neither is the same at all."""
    rank = error_correlation(np.asarray(real), np.asarray(twin))["spearman"]
    return readable(rank, 2) if np.isfinite(rank) else "not known"


def _value(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _mean(rows: Sequence[Mapping[str, Any]], kind: str, value: Value) -> float:
    """Return the mean error at a level, over its sessions; nan where there is none."""
    found = [row["mean_deg"] for row in rows if (row["frames"], row["value"]) == (kind, value)]
    return float(np.mean(found)) if found else float("nan")


def _chart(factor: str, every: Sequence[Value], curves: Mapping[str, Sequence[float]]) -> str:
    are_words = any(isinstance(value, str) for value in every)
    places = [float(place) if are_words else float(value) for place, value in enumerate(every)]
    lines = {words: (places, curves[kind]) for kind, words in KINDS.items()}
    is_wide = not are_words and min(places) > 0 and max(places) > WIDE_RANGE * min(places)
    names = [str(value) for value in every] if are_words else ()
    return line_chart(lines, x_title=factor, y_title="mean angular error, °", log_x=is_wide, x_names=names)


def _table(factor: str, rows: Sequence[Mapping[str, Any]]) -> str:
    lines = []
    for name in dict.fromkeys(row["session"] for row in rows):
        own = {row["frames"]: row for row in rows if row["session"] == name}
        first = next(iter(own.values()))
        ends = [first[f"median_difference_{end}_deg"] for end in ("low", "high")]
        between = "" if None in ends else " to ".join(readable(end, 2) for end in ends)
        errors = [
            readable(own[kind][key], 2) if kind in own else "" for kind in KINDS for key in ("mean_deg", "median_deg")
        ]
        lines.append((_value(first["value"]), escape(name), *errors, between))
    heads = [f"{words}, {name}" for words in KINDS.values() for name in ("mean", "median")]
    return table((escape(factor), "session", *heads, "real less twin, median (95 %)"), lines, kind="numbers")
