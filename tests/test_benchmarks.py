"""Tables of the evidence are measured on their smallest case, shown, read again; README quotes what was measured."""

import csv
import json
import re
from dataclasses import asdict, fields, replace
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks import harness
from benchmarks.faults import FaultRow, _judged
from benchmarks.gates import moved
from benchmarks.harness import EVIDENCE, MEASURED, commits_since, run, shown, tables, write
from benchmarks.readme import AGREED, QUOTED, README, Quoted, cell, readme_table

LONG = {
    "calibration/lights", "calibration/balls", "calibration/scan as probe", "registration/poses",
    "methods/table", "methods/speed", "methods/light distance", "trust/trust", "twin/relighting", "twin/material",
    "twin/engines", "counterparts/series", "faults/faults", "sweeps/stability", "sweeps/agreement", "sweeps/means",
    "findings/findings", "robustness/kills", "robustness/bad input", "robustness/memory", "sessions/verbs",
    "real-captures/captures",
}  # fmt: skip
"""More than one and a half processor seconds. The other tables tell at once whether the harness works."""


def plain(rows):
    """Return rows as JSON has them."""
    return json.dumps([asdict(row) for row in rows], default=lambda value: np.asarray(value).tolist())


@pytest.mark.parametrize(
    "table",
    [pytest.param(one, id=one.key, marks=[pytest.mark.full] if one.key in LONG else []) for one in tables()],
)
def test_a_table_is_measured_shown_and_read_again(table, tmp_path, monkeypatch):
    if table.absent:
        pytest.skip(f"{table.absent[0]} is absent")
    monkeypatch.setattr(harness, "KEPT", tmp_path / "kept")
    rows = run(table, "small", processes=0, is_new=True)
    assert {type(row) for row in rows} == {table.row}
    assert plain(run(table, "small", processes=0)) == plain(rows), "what is kept is not what was measured"

    real = (harness.EVIDENCE / f"{table.page}.md").read_text()
    assert real.count(f"<!-- {table.name} -->\n") == real.count(f"<!-- end of {table.name} -->") == 1
    monkeypatch.setattr(harness, "EVIDENCE", tmp_path)
    monkeypatch.setattr(harness, "MEASURED", tmp_path / "measured.json")
    page = tmp_path / f"{table.page}.md"
    page.write_text(f"before\n<!-- {table.name} -->\n<!-- end of {table.name} -->\nafter\n")
    write(table, rows, "small")

    assert page.read_text().startswith("before\n")
    assert page.read_text().endswith("after\n")
    assert " cores, with the smallest case alone.\n<!-- end of" in page.read_text()
    blocks = re.findall(r"(?:^\|.*\|\n)+", page.read_text(), re.MULTILINE)
    for block in blocks:
        head, line, *body = block.splitlines()
        assert set(line) == {"|", "-"}
        assert body, head
        assert {one.count("|") for one in (head, *body)} == {line.count("|")}, block
    assert not re.search(r"\bnan\b|\bNone\b|\{\w+", "".join(blocks))

    with table.data().open(newline="") as file:
        kept = list(csv.DictReader(file))
    assert len(kept) == len(rows)
    for line, row in zip(kept, rows, strict=True):
        assert list(line) == [field.name for field in fields(table.row)]
        for name, value in asdict(row).items():
            if isinstance(value, float):
                assert float(line[name]) == pytest.approx(value, rel=1e-5, nan_ok=True), name

    known = json.loads(harness.MEASURED.read_text())[table.key]
    assert (known["code"], known["scale"]) == (table.code, "small")
    assert all(isinstance(value, float) for value in known["figures"].values())
    assert all(np.isfinite(value) for value in known["figures"].values()), known["figures"]
    for name in table.draw(rows) if table.draw else ():
        assert ElementTree.parse(tmp_path / name).getroot().tag.endswith("svg")


def test_harm_is_the_greatest_error_beyond_the_sound_session_s_own():
    sound = FaultRow("nothing wrong", "bunny", True, 0.2, 1.5, 0.1, 0.0, "", False, ())
    for name, off in (("lights_deg", 5.2), ("normals_deg", 6.5), ("turn_deg", 5.1)):
        (_, one) = _judged([sound, replace(sound, mistake="one frame twice", **{name: off})])
        assert one.harm_deg == pytest.approx(5.0)
        assert one.silent_harm


TABLES = {table.key: table for table in tables()}
KNOWN = json.loads(MEASURED.read_text()) if MEASURED.is_file() else {}
NOTHING = pytest.mark.skipif(not MEASURED.is_file(), reason="nothing is measured: python -m benchmarks --write")


@NOTHING
def test_readme_says_what_was_measured():
    """No figure there is typed by hand."""
    block = README.read_text().split("<!-- figures -->\n")[1].split("<!-- end of figures -->")[0]
    assert block == readme_table()
    assert "[" not in re.sub(r"\[[^]]*\]\(docs/evidence/[a-z-]+\.md[#a-z0-9-]*\)", "", block), "a figure has no name"


def test_what_readme_quotes_is_a_table():
    assert {one.table for one in QUOTED} <= TABLES.keys()
    assert README.read_text().count("<!-- figures -->\n") == README.read_text().count("<!-- end of figures -->") == 1


@NOTHING
@pytest.mark.full
@pytest.mark.parametrize("key", sorted({one.table for one in QUOTED} & KNOWN.keys()))
def test_what_readme_quotes_is_of_the_code_as_it_is(key):
    """Measured on this code; or all that was committed to it since is agreed to move no figure."""
    agreed = {line.split()[0] for line in AGREED.read_text().splitlines() if line.strip() and line[0] != "#"}
    table, was = TABLES[key], KNOWN[key]
    assert not was["commit"].endswith("-dirty"), f"{key}: measured on code that is in no commit"
    if was["code"] == table.code:
        return
    since = commits_since(was["commit"], table.files)
    if since is None:
        pytest.skip(f"the history does not reach back to {was['commit']}")
    left = [one for one in since if not any(one.startswith(known) or known.startswith(one) for known in agreed)]
    assert not left, f"{key}: measure it again (python -m benchmarks {key} --write), or agree on {', '.join(left)}"


@pytest.mark.parametrize("key", sorted(KNOWN))
def test_each_table_is_on_its_page_with_its_commit_as_its_data_say(key):
    table = TABLES[key]
    page = (EVIDENCE / f"{table.page}.md").read_text()
    part = page.split(f"<!-- {table.name} -->\n")[1].split(f"<!-- end of {table.name} -->")[0]
    table_part, _, measured = part.rpartition("\n\nMeasured at ")
    assert measured.startswith(f"{KNOWN[key]['commit']} on ")
    # None: measured when the row had other fields.
    assert shown(table) in (table_part, None)


def test_a_quoted_cell_holds_its_figures():
    quoted = Quoted("what", "page/table", "[a: b]°, [a: c:.0%], [a: c]")
    assert cell(quoted, {"a: b": 1.234, "a: c": 0.5}) == "1.23°, 50%, 0.50"


def test_gates_tell_what_moved_by_more_than_its_noise():
    old = {"same": [1.0], "moved": [1.0], "noisy": [1.0, 1.3], "slower": [1.0, 1.1], "gone": [1.0]}
    new = {"same": [1.0], "moved": [1.1], "noisy": [1.2, 1.4], "slower": [2.0, 2.1], "come": [1.0]}
    said = moved(old, new)
    assert [line.split(":")[0] for line in said] == ["slower", "moved", "gone", "come"]
    assert "1.05 -> 2.05 (+48.8 %, noise 0.1)" in said[0]
