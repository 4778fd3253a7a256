"""README quotes what was measured, on the code that stands beside it."""

import json
import re

import pytest

from benchmarks.gates import moved
from benchmarks.harness import EVIDENCE, MEASURED, commits_since, shown, tables
from benchmarks.readme import AGREED, QUOTED, README, Quoted, cell, readme_table

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
