"""The table of all methods on all datasets: for programs, for terminals, as a page."""

from html import escape
from pathlib import Path

from experiments.tables import DATASETS, Rows, write_table
from scene.files import write_text

FAILED = "failed"


def write_results(folder: Path, rows: Rows) -> None:
    """Write results.parquet, results.txt and index.html."""
    write_table(folder / "results.parquet", rows, DATASETS)
    write_text(folder / "results.txt", results_text(rows))
    write_text(folder / "index.html", _page(rows))


def grid(rows: Rows, quantity: str = "mean_deg") -> tuple[list[str], list[tuple[str, list[float | None]]]]:
    """Return the methods, and for each dataset its values in their order, None where one failed; last, their means.

    A mean is over the datasets that every method solved: else a method gained by failing on what is hard.
    """
    methods = list(dict.fromkeys(row["method"] for row in rows))
    found: dict[str, dict[str, float]] = {}
    for row in rows:
        found.setdefault(row["dataset"], {})
        if row["status"] == "ok":
            found[row["dataset"]][row["method"]] = row[quantity]
    lines = [(name, [values.get(method) for method in methods]) for name, values in found.items()]
    whole = [[value for value in values if value is not None] for _, values in lines if None not in values]
    if len(lines) > 1 and whole:
        means: list[float | None] = [sum(column) / len(whole) for column in zip(*whole, strict=True)]
        lines.append((f"mean of {len(whole)}", means))
    return methods, lines


def results_text(rows: Rows) -> str:
    """Return the mean angular errors, degrees, as lines for a terminal."""
    methods, lines = grid(rows)
    title = "mean angular error, degrees"
    wide = max(len(title), *(len(name) for name, _ in lines))
    widths = [max(len(method), 7) for method in methods]
    head = "".join(f"  {method:>{width}}" for method, width in zip(methods, widths, strict=True))
    text = [f"{title:{wide}}{head}"]
    for name, values in lines:
        cells = (FAILED if value is None else f"{value:.2f}" for value in values)
        text.append(f"{name:{wide}}" + "".join(f"  {cell:>{width}}" for cell, width in zip(cells, widths, strict=True)))
    text += [f"{row['dataset']}, {row['method']}: {row['status']}" for row in rows if row["status"] != "ok"]
    return "\n".join(text) + "\n"


def _page(rows: Rows) -> str:
    from compare.report.page import number, table
    from experiments.sweeps.sweep_page import STYLE

    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>Datasets</title>",
        f"<style>{STYLE} .best{{font-weight:bold}}</style><h1>Methods on datasets</h1>",
    ]
    for quantity, title in (
        ("mean_deg", "Mean angular error, degrees"),
        ("median_deg", "Median angular error, degrees"),
    ):
        methods, lines = grid(rows, quantity)
        body = []
        for name, values in lines:
            least = min((value for value in values if value is not None), default=None)
            cells = [
                FAILED if value is None else f"<span class='{'best' if value == least else ''}'>{number(value)}</span>"
                for value in values
            ]
            body.append([escape(name), *cells])
        parts.append(f"<h2>{title}</h2>{table(['dataset', *map(escape, methods)], body)}")
    failures = [row for row in rows if row["status"] != "ok"]
    if failures:
        lines = "".join(
            f"<li>{escape(row['dataset'])}, {escape(row['method'])}: {escape(row['status'])}</li>" for row in failures
        )
        parts.append(f"<h2>What failed</h2><ul>{lines}</ul>")
    parts.append("<p>Bold: the least of a row. More figures, and each method's doubts: results.parquet.</p></html>")
    return "\n".join(parts)
