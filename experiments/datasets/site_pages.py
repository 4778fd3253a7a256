"""The pages of the site: HTML of what `site` has gathered, each page whole in itself, nothing fetched."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from compare.report.page import UNKNOWN, colour_scale, folded, number, percent, picture, section, table, whole_page
from experiments.catalogue import FAMILIES
from experiments.datasets.shelf import Entry
from experiments.tables import Row, Rows
from scene.map_pictures import Image

QUANTITIES = {
    "filled_deg": "Mean angular error, degrees, each gap counted as 90",
    "mean_deg": "Mean angular error of the answered pixels, degrees",
    "median_deg": "Median angular error of the answered pixels, degrees",
}
_LEAST_DEG, _MOST_DEG = 0.3, 90.0
"""Ends of the matrix's colours, which follow the logarithm: white, and the darkest."""
_SORT = """addEventListener("click", event => {
  const head = event.target.closest("table.numbers thead th"); if (!head) return;
  const body = head.closest("table").tBodies[0], up = head.getAttribute("aria-sort") != "ascending";
  const key = row => { const cell = row.cells[head.cellIndex], one = cell.querySelector("[data-value]");
    return one ? +one.dataset.value : head.cellIndex ? Infinity : cell.textContent; };
  for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", up ? "ascending" : "descending");
  const rows = [...body.rows].map(row => [key(row), row]);
  rows.sort(([a], [b]) => (a < b ? -1 : a > b ? 1 : 0) * (up ? 1 : -1));
  body.append(...rows.map(([, row]) => row));
});"""
_COLUMNS = {
    "mean_deg": "mean", "filled_deg": "mean, gaps as 90", "median_deg": "median", "std_deg": "std", "min_deg": "min",
    "q1_deg": "lower quartile", "q3_deg": "upper quartile", "max_deg": "max",
}  # fmt: skip


@dataclass(frozen=True)
class Shown:
    """What a dataset's page shows."""

    entry: Entry
    strip: Image  # some photographs side by side
    thumbnail: Image  # one of them
    maps: Mapping[str, Image]  # the truth's, by what they are
    errors: Mapping[str, Image]  # of the methods, in `end_deg`'s colours
    end_deg: float
    base: str  # where its files are, ending in /
    sums: Mapping[str, str]  # SHA-256 by file
    rows: Rows


def index_page(entries: Sequence[Entry], thumbnails: Mapping[str, Image], rows: Rows, said: str) -> str:
    """Return the first page: matrix, datasets by family, what failed; `said`: HTML below the title."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    by_place = {(row["dataset"], row["method"]): row for row in rows}
    matrices = [_matrix(entries, by_place, methods, quantity) for quantity in QUANTITIES]
    first, *others = (f"<h3>{words}</h3>{html}" for words, html in zip(QUANTITIES.values(), matrices, strict=True))
    more = folded("The same of the answered pixels alone: mean, median", "".join(others))
    failed = [row for row in rows if row["status"] != "ok"]
    chapters = {
        "Methods x datasets": section(
            "matrix", "Methods x datasets", first + more,
            "The darker, the larger the error. A click on a column's head sorts by it.",
        ),
        "Datasets": section("datasets", "Datasets", _families(entries, thumbnails)),
    }  # fmt: skip
    if failed:
        said_of = (f"{row['dataset']}, {row['method']}: {row['status']}" for row in failed)
        lines = "".join(f"<li>{escape(text)}</li>" for text in said_of)
        chapters["What failed"] = section("failed", "What failed", f'<ul class="notes">{lines}</ul>')
    return whole_page("Photometric stereo on datasets with known truth", "datasets", said, chapters, script=_SORT)


def dataset_page(shown: Shown, aliases: Sequence[str]) -> str:
    """Return the page of a dataset; `aliases`: its other names."""
    entry = shown.entry
    lead = f"Also named {escape(', '.join(aliases))}." if aliases else ""
    truth = "".join(
        picture(image, f"{what} of {entry.name}", what, photograph=True) for what, image in shown.maps.items()
    )
    chapters = {
        "Photographs": section(
            "photographs", "Photographs", picture(shown.strip, f"photographs of {entry.name}", photograph=True), lead
        ),
        "Truth": section("truth", "Truth", f'<div class="gallery many">{truth}</div>'),
        "Errors": section("errors", "Errors", _errors(shown)),
        "Files": section("files", "Files", _files(shown)),
    }
    which = "of the benchmark's list" if entry.benchmark else "not of the benchmark's list"
    subtitle = f'{escape(entry.text)} · {which} · <a href="index.html">all datasets</a>'
    return whole_page(entry.name, "dataset", subtitle, chapters, script=_SORT)


def _errors(shown: Shown) -> str:
    body = []
    for row in shown.rows:
        ok = row["status"] == "ok"
        values = [number(row[key]) for key in _COLUMNS] if ok else [escape(row["status"]), *[""] * (len(_COLUMNS) - 1)]
        answered = [percent(1 - row["unanswered"], 1), percent(row["under_5_deg"])] if ok else ["", ""]
        seconds = row.get("seconds")
        body.append([escape(row["method"]), *values, *answered, UNKNOWN if seconds is None else number(seconds)])
    head = ["method", *_COLUMNS.values(), "pixels answered", "of these under 5°", "seconds"]
    statistics = table(head, body, caption="Angular error, degrees.", kind="numbers")
    if not shown.errors:
        return statistics
    figures = "".join(
        picture(image, f"error map of {name}", escape(name), photograph=True) for name, image in shown.errors.items()
    )
    return f'{colour_scale(shown.end_deg)}<div class="gallery many">{figures}</div>{statistics}'


def _files(shown: Shown) -> str:
    name, base = shown.entry.name, escape(shown.base, quote=True)
    lines = [[_link(base + file, file), f"<code>{value}</code>"] for file, value in shown.sums.items()]
    by_hand = f"cut -c67- {name}.sha256 | xargs -I % curl --create-dirs -o % BASE/%; sha256sum --check {name}.sha256"
    return (
        f"<p>{_link(f'{name}.sha256', f'{name}.sha256')}. All files at once, BASE being where they are served: "
        f"<code>{by_hand}</code></p>"
        + folded(f"{len(lines)} files with their SHA-256", table(["file", "SHA-256"], lines))
    )


def _matrix(entries: Sequence[Entry], by_place: Mapping[tuple[str, str], Row], methods: Sequence[str], key: str) -> str:
    lines = []
    for one in entries:
        cells = [_link(f"{one.name}.html", one.name)]
        for method in methods:
            row = by_place[one.name, method]
            if row["status"] != "ok":
                cells.append("failed")
                continue
            share = math.log(max(row[key], _LEAST_DEG) / _LEAST_DEG) / math.log(_MOST_DEG / _LEAST_DEG)
            cells.append(f'<span class="heat" style="--share:{min(share, 1):.2f}">{number(row[key])}</span>')
        lines.append(cells)
    return table(["dataset", *map(escape, methods)], lines, kind="numbers")


def _families(entries: Sequence[Entry], thumbnails: Mapping[str, Image]) -> str:
    parts = []
    for family, text in FAMILIES.items():
        own = [one for one in entries if one.family == family]
        figures = "".join(
            f'<a href="{one.name}.html">{picture(thumbnails[one.name], "", escape(one.name), photograph=True)}</a>'
            for one in own
        )
        parts += [f"<h3>{family}</h3><p>{escape(text)}</p><div class='sheet width-120'>{figures}</div>"] if own else []
    return "".join(parts)


def _link(target: str, words: str) -> str:
    return f'<a href="{escape(target, quote=True)}">{escape(words)}</a>'
