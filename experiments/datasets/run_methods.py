"""`rgbn dataset run`: methods and other programs on datasets of the shelf; kept results, a table, a gallery."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from experiments.datasets.shelf import Entry, contents, contents_of, entries, select
from experiments.tables import DATASETS, Row, Rows, errors_of
from lab.many_sessions import PICTURE_PX
from lab.options import BY_DEFAULT, DEFAULT_PROFILE, TIMEOUT_S, Solving
from lab.progress import logged, say
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json, write_text
from scene.map_pictures import data_uri, shrink
from scene.notebook import csv_text
from scene.output_folder import open_record
from scene.reading import json_of

END_DEG = 20.0
"""Where the colours of error maps end: one scale for all, so that pictures can be compared."""


def run(shelf: Path, patterns: Sequence[str], *, solving: Solving = BY_DEFAULT, out: Path) -> Rows:
    """Run methods on datasets, as far as their results are not there yet; write table and page, and return the rows.

    patterns: names of datasets that are on the shelf, patterns, `benchmark`; none: all of them. out gets results.csv
    and index.html; results/ keeps each result, work/ what programs said. SceneError: no such dataset, method or
    program; a dataset that has changed.
    """
    # What an earlier run was told is not kept.
    solving = replace(
        solving, profile=solving.profile or DEFAULT_PROFILE, external=solving.external or (),
        external_timeout_s=solving.external_timeout_s or TIMEOUT_S, trust=None,
    )  # fmt: skip
    programs = solving.programs()
    names = [*solving.methods(), *programs]
    there, rows, shown, code = _wanted(shelf, patterns), [], {}, code_fingerprint("experiments")
    with open_record(out, origin="table of datasets") as record, logged(record):
        for number, entry in enumerate(there, 1):
            digest, kept = contents_of(shelf, entry), {}
            for name in names:
                how = (programs[name].command, programs[name].files) if name in programs else solving.profile
                kept[name] = out / "results" / f"{fingerprint(digest, name, how, code=code)[:24]}.json"
            found = {name: json_of(path) for name, path in kept.items() if record.is_intact(path)}
            if missing := [name for name in names if name not in found]:
                say(f"{number} of {len(there)}: {entry.name}: {', '.join(missing)}")
                for name, row in _solve(out, entry, missing, solving):
                    found[name] = row
                    # What failed is tried again.
                    if row["status"] == "ok":
                        write_json(kept[name], row)
            rows += [{"dataset": entry.name, "family": entry.family, **found[name]} for name in names]
            shown[entry.name] = _figures(entry, {name: found[name].pop("picture", "") for name in names})
        rows = [{key: row.get(key) for key in DATASETS} for row in rows]
        write_text(out / "results.csv", csv_text(rows))
        write_text(out / "index.html", _gallery(rows, shown))
    return rows


def _wanted(shelf: Path, patterns: Sequence[str]) -> list[Entry]:
    known = entries(shelf)
    if not any(one.state for one in known):
        raise SceneError(
            f"{shelf}: there is no dataset yet. Make some (`rgbn dataset make 'pear-*'`), or add your own."
        )
    fitting = select(known, patterns) if patterns else [one for one in known if not one.same_as]
    there = [one for one in fitting if one.state]
    if not there:
        raise SceneError(
            f"dataset {fitting[0].name}: is in the catalogue, but not made yet. Make it: "
            f"rgbn dataset make {patterns[0]!r}."
        )
    return there


def _solve(out: Path, entry: Entry, names: list[str], solving: Solving) -> Iterator[tuple[str, Row]]:
    """Yield the rows of some methods on one dataset, each as soon as it is made."""
    from lab.run import STEPS, open_job

    left = list(names)
    try:
        with open_job(entry.folder, out=out / "work" / entry.name, said=solving) as job:
            try:
                job.run(STEPS, "align")
                while left:
                    yield left[0], _row(left[0], "" if left[0] in job.externals else job.profile, job, entry.name)
                    del left[0]
            finally:
                # The frames are half a gigabyte for a hundred datasets; they are made again in a second.
                job.record.forget(job.record.done)
    except SceneError as error:
        for name in left:
            yield name, _failed(name, solving.profile, error)


def _row(name: str, profile: str, job: Any, dataset: str) -> Row:
    """Return the row of one method, with `picture`, a PNG's data URI of its error map, if it has a result."""
    from compare.report.pictures import PixelBox, error_picture
    from lab.steps import solve_all
    from scene.normals import angular_error_deg

    store = job.store
    try:
        table, _, _ = solve_all(job, store, dataset, (name,))
    except SceneError as error:
        return _failed(name, profile, error)
    facts, normals, truth = table["methods"][name], store.load_normals(name), store.load_normals("truth")
    judged = store.load_mask() & np.isfinite(truth[..., 0])
    row = {"method": name, "profile": profile, **errors_of(normals[judged], truth[judged], "failed")}
    if row["status"] != "ok":
        return row
    error = angular_error_deg(np.where(judged[..., None], normals, np.nan), truth)
    small = shrink(PixelBox.of_mask(judged, margin=0.03).of(error), PICTURE_PX)
    picture = data_uri(error_picture(small, END_DEG), photograph=False)
    return {**row, "seconds": facts["seconds"], "doubts": " ".join(facts["warnings"]), "picture": picture}


def _failed(name: str, profile: str | None, error: Exception) -> Row:
    return {"method": name, "profile": profile, "status": f"failed: {' '.join(str(error).split())}"}


def results_text(rows: Rows) -> str:
    """Return mean angular errors, degrees, as lines for a terminal, and what failed.

    The last line's means are over the datasets that every method solved: else a method gained by failing on what is
    hard.
    """
    from pandas import DataFrame

    table = DataFrame(rows).pivot(index="dataset", columns="method", values="mean_deg").astype(float)
    table = table.loc[
        list(dict.fromkeys(row["dataset"] for row in rows)), list(dict.fromkeys(r["method"] for r in rows))
    ]
    whole = table.dropna()
    if len(table) > 1 and len(whole):
        table.loc[f"mean of {len(whole)}"] = whole.mean()
    table = table.rename_axis(index=None, columns="mean angular error, degrees")
    text = table.to_string(float_format="{:.2f}".format, na_rep="failed")
    failed = (f"{row['dataset']}, {row['method']}: {row['status']}" for row in rows if row["status"] != "ok")
    return "\n".join([text, *failed]) + "\n"


def _figures(entry: Entry, errors: Mapping[str, str]) -> str:
    """Return a dataset's photograph, its true normals, and each method's error map as figures."""
    from compare.report.pictures import Exposure, PixelBox, normal_picture

    _, image, mask, normals = contents(entry.folder)
    colours = image[..., :3] if image.ndim == 3 else np.repeat(image[..., None], 3, -1)
    box = PixelBox.of_mask(mask, margin=0.03)
    small = shrink(box.of(colours).astype(np.float32), PICTURE_PX)
    shown = Exposure(max(float(np.quantile(small.max(-1), 0.995)), 1e-6), np.ones(3)).develop(small)
    pictures = {"photograph": data_uri(shown, photograph=True)}
    pictures |= {"true normals": data_uri(normal_picture(box.of(normals), PICTURE_PX), photograph=False)}
    return "".join(
        f'<figure><img src="{uri}" alt=""><figcaption>{escape(words)}</figcaption></figure>'
        for words, uri in (pictures | dict(errors)).items()
        if uri
    )


def _gallery(rows: Rows, shown: Mapping[str, str]) -> str:
    """Return the page: methods against datasets, then each dataset's pictures."""
    from compare.report.page import number, pieces, section, table, whole_page

    methods = list(dict.fromkeys(row["method"] for row in rows))
    by_place = {(row["dataset"], row["method"]): row for row in rows}
    lines = []
    for name in shown:
        found = [by_place[name, method] for method in methods]
        cells = [number(row["filled_deg"]) if row["status"] == "ok" else escape(row["status"]) for row in found]
        lines.append([f'<a href="#{name}">{escape(name)}</a>', *cells])
    lead = (
        "Mean angular error, degrees; a pixel without an answer counts 90. More: <a href='results.csv'>results.csv</a>"
    )
    errors = section("errors", "Errors", table(["dataset", *map(escape, methods)], lines, kind="numbers"), lead)
    parts = (
        f'<h3 id="{name}">{escape(name)}</h3><div class="gallery many">{html}</div>' for name, html in shown.items()
    )
    pictures = section("datasets", "Datasets", f"{pieces().colour_scale(END_DEG)}{''.join(parts)}")
    said = f"{len(shown)} datasets, {len(methods)} methods"
    return whole_page("Photometric stereo on datasets with known truth", "datasets", said, errors + pictures)
