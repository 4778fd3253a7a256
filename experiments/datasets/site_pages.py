"""The pages of the leaderboard: HTML of what `site` has gathered, each page whole in itself, nothing fetched."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from compare.report.maps import colour_scale
from compare.report.page import UNKNOWN, folded, number, percent, picture, section, table, whole_page
from experiments.catalogue import FAMILIES
from experiments.datasets.run_methods import ABSENT
from experiments.datasets.shelf import Entry
from experiments.datasets.submissions import FILE, Submission
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
    maps: Mapping[str, Image]  # the truth's, by what they are; empty where it is kept back
    errors: Mapping[str, Image]  # of the methods, in `end_deg`'s colours
    end_deg: float
    base: str  # where its files are, ending in /
    sums: Mapping[str, str]  # SHA-256 by file
    rows: Rows


def index_page(
    entries: Sequence[Entry], thumbnails: Mapping[str, Image], rows: Rows, submissions: Sequence[Submission], said: str
) -> str:
    """Return the first page: ranking, matrix, datasets by family, submissions; `said`: HTML below the title."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    by_place = {(row["dataset"], row["method"]): row for row in rows}
    lists = {"All datasets": entries}
    if 0 < len(listed := [one for one in entries if one.benchmark]) < len(entries):
        lists = {"The benchmark's list": listed, **lists}
    ranking = "".join(
        f"<h3>{words}, {len(those)}</h3>{_ranking(those, by_place, methods)}" for words, those in lists.items()
    )
    matrices = [_matrix(entries, by_place, methods, quantity) for quantity in QUANTITIES]
    first, *others = (f"<h3>{words}</h3>{html}" for words, html in zip(QUANTITIES.values(), matrices, strict=True))
    more = folded("The same of the answered pixels alone: mean, median", "".join(others))
    failed = [row for row in rows if row["status"] not in ("ok", ABSENT)]
    chapters = {
        "Ranking": section("ranking", "Ranking", ranking, "A dataset without a result counts as 90 degrees."),
        "Methods x datasets": section(
            "matrix", "Methods x datasets", first + more,
            "The darker, the larger the error. A click on a column's head sorts by it.",
        ),
        "Datasets": section("datasets", "Datasets", _families(entries, thumbnails)),
    }  # fmt: skip
    if submissions:
        chapters["Submissions"] = section("submissions", "Submissions", _submissions(submissions))
    if failed:
        said_of = (f"{row['dataset']}, {row['method']}: {row['status']}" for row in failed)
        lines = "".join(f"<li>{escape(text)}</li>" for text in said_of)
        chapters["What failed"] = section("failed", "What failed", f"<ul>{lines}</ul>")
    return whole_page("Photometric stereo on datasets with known truth", "leaderboard", said, chapters, script=_SORT)


def dataset_page(shown: Shown, aliases: Sequence[str]) -> str:
    """Return the page of a dataset; `aliases`: its other names."""
    entry = shown.entry
    lead = f"Also named {escape(', '.join(aliases))}." if aliases else ""
    truth = (
        "".join(picture(image, f"{what} of {entry.name}", what, photograph=True) for what, image in shown.maps.items())
        if shown.maps
        else "<p>Kept back: neither the true maps nor error maps are shown, and submissions are scored where it is.</p>"
    )
    chapters = {
        "Photographs": section(
            "photographs", "Photographs", picture(shown.strip, f"photographs of {entry.name}", photograph=True), lead
        ),
        "Truth": section("truth", "Truth", f'<div class="gallery many">{truth}</div>' if shown.maps else truth),
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
        f"<p>{_link(f'{name}.sha256', f'{name}.sha256')}, {_link(f'{name}.croissant.json', 'croissant.json')}. All "
        f"files at once, BASE being where they are served: <code>{by_hand}</code></p>"
        + folded(f"{len(lines)} files with their SHA-256", table(["file", "SHA-256"], lines))
    )


def _ranking(entries: Sequence[Entry], by_place: Mapping[tuple[str, str], Row], methods: Sequence[str]) -> str:
    """Return a table of the methods, the least mean error first; no result: 90 degrees."""
    lines = []
    for method in methods:
        found = [by_place[one.name, method] for one in entries]
        solved = [row for row in found if row["status"] == "ok"]
        mean = sum(row["filled_deg"] if row["status"] == "ok" else 90.0 for row in found) / len(found)
        share = sum(1 - row["unanswered"] for row in solved) / len(found)
        answered = [_mean(solved, key) for key in ("mean_deg", "median_deg", "seconds")]
        lines.append((mean, [escape(method), number(mean), *answered, percent(share, 1), number(len(solved))]))
    head = [
        "method",
        "mean, gaps as 90°",
        "mean of answered",
        "mean of medians",
        "seconds",
        "pixels answered",
        "datasets",
    ]
    return table(head, [cells for _, cells in sorted(lines, key=lambda line: line[0])], kind="numbers")


def _mean(rows: Rows, key: str) -> str:
    known = [row[key] for row in rows if row.get(key) is not None]
    return number(sum(known) / len(known)) if known else UNKNOWN


def _matrix(entries: Sequence[Entry], by_place: Mapping[tuple[str, str], Row], methods: Sequence[str], key: str) -> str:
    lines = []
    for one in entries:
        cells = [_link(f"{one.name}.html", one.name)]
        for method in methods:
            row = by_place[one.name, method]
            if row["status"] != "ok":
                cells.append("–" if row["status"] == ABSENT else "failed")
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


def _submissions(submissions: Sequence[Submission]) -> str:
    lines = []
    for one in submissions:
        assert one.description is not None
        said = one.description
        links = [_link(text, words) if text.startswith(("https://", "http://")) else escape(text)
                 for text, words in ((said.paper, "paper"), (said.code, "code"))]  # fmt: skip
        lines.append([escape(one.method), escape(said.authors), *links, escape(said.settings), escape(said.hardware)])
    return table(["method", "authors", "paper", "code", "settings", "hardware"], lines) if lines else ""


def submit_page(example: str) -> str:
    """Return the page that says how to submit; `example`: a dataset's name."""
    toml = (
        'method = "MyNet"\nauthors = "A. Author, B. Author"\npaper = "https://..."      # or a text; optional\n'
        'code = "https://..."       # optional\nsettings = "the published weights; no parameter chosen by hand"\n'
        'hardware = "one core of a laptop"\nseconds = 1.5               # of one dataset, on the mean\n'
    )
    body = (
        "<p>A submission is a folder: a description and one normal map a dataset. A dataset may be left out; it counts "
        f"as 90 degrees in the ranking.</p><pre>MyNet/\n  {FILE}\n  {escape(example)}.npy     (or .png)\n  ...</pre>"
        f"<p>{FILE}:</p><pre>{escape(toml)}</pre>"
        "<p>A map has the size of the dataset's mask.png: <code>.npy</code>, H x W x 3, or <code>.png</code>, 16 bits, "
        "R G B = (n + 1) / 2. Unit vectors, x right, y up, z toward the viewer, first row above. Where there is no "
        "answer: 0 or NaN. What may be used: the photographs, their lights and the mask; not the true maps.</p>"
        "<p>Check it before you send it; all that is wrong is said at once, flipped axes too:</p>"
        "<pre>rgbn dataset check MyNet --shelf DATASETS</pre>"
        "<p>Then send the folder to who serves these pages. It is scored by</p>"
        "<pre>rgbn dataset run --submissions FOLDER</pre>"
    )
    body = body.replace("<pre>", "<div class='scroll'><pre>").replace("</pre>", "</pre></div>")
    lead = '<a href="index.html">all datasets</a>'
    return whole_page("How to submit", "leaderboard", lead, {"Submission": section("submission", "A submission", body)})


def _link(target: str, words: str) -> str:
    return f'<a href="{escape(target, quote=True)}">{escape(words)}</a>'
