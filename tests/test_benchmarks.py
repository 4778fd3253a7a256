"""Each table of the evidence is measured on its smallest case, shown, and read again."""

import csv
import json
import re
from dataclasses import asdict, fields, replace
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks import harness
from benchmarks.faults import FaultRow, _judged
from benchmarks.harness import run, tables, write

LONG = {
    "calibration/lights", "calibration/balls", "calibration/scan as probe", "registration/poses",
    "methods/table", "trust/trust", "twin/relighting", "twin/material", "counterparts/series", "sweeps/stability",
    "sweeps/agreement", "sweeps/means", "findings/findings", "robustness/kills",
}  # fmt: skip
"""More than five processor seconds."""


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
