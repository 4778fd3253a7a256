"""The documentation: links lead somewhere, what the code writes is up to date; the gallery is what its text says."""

import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest

from calibrate.known_lights.read_known import read_lights
from capture.session.manifest import TABLES
from capture.session.manifest_file import parse
from capture.session.session import load_session
from docs.write_gallery import EXAMPLES
from docs.write_reference import BLOCKS, REFERENCE
from rgbn.cli import app
from tests.conftest import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
WRITTEN = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
NAMES = [str(path.relative_to(ROOT)) for path in WRITTEN]


def prose(page):
    """Return a page's text without its code."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE))


def links(page):
    """Yield the targets of a page's links and pictures that are no web addresses."""
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if not re.match(r"[a-z]+:", target):
            yield target


def anchors(page):
    """Return the names of a page's headings, as links spell them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", WRITTEN, ids=NAMES)
def test_links_lead_somewhere(page):
    for target in links(page):
        name, _, anchor = target.partition("#")
        found = (page.parent / name).resolve() if name else page
        assert found.is_file(), f"{page.name}: {target}"
        assert found.is_relative_to(ROOT)
        if anchor:
            assert anchor in anchors(found), f"{page.name}: {target}"


def test_every_page_is_in_the_contents_and_linked_from_the_first():
    index = DOCS / "index.md"
    pages = {path.relative_to(DOCS).with_suffix("").as_posix() for path in PAGES} - {"index"}
    trees = re.findall(r"^```\{toctree\}\n(.*?)^```$", index.read_text(), re.DOTALL | re.MULTILINE)
    listed = [line for tree in trees for line in tree.splitlines() if line and not line.startswith(":")]
    assert sorted(listed) == sorted(pages)
    assert {target.removesuffix(".md") for target in links(index)} >= pages


def test_every_picture_is_shown():
    shown = {(page.parent / target).resolve() for page in WRITTEN for target in links(page)}
    pictures = {path for end in ("svg", "png") for path in DOCS.rglob(f"*.{end}") if "_build" not in path.parts}
    assert pictures <= shown


@pytest.mark.parametrize("page", BLOCKS)
def test_what_the_code_writes_is_up_to_date(page):
    name, write = BLOCKS[page]
    found = (REFERENCE / page).read_text().split(f"<!-- {name} -->\n")[1].split(f"<!-- end of {name} -->")[0]
    assert found == write(), "run: .venv/bin/python -m docs.write_reference"


def test_every_key_of_a_session_is_described_with_an_example():
    for name, table in TABLES.items():
        for key, field in table.model_fields.items():
            assert field.description, f"{name}.{key}"
            assert field.examples, f"{name}.{key}"


def commands(page):
    """Yield what a page gives to be typed as `rgbn ...`: in the text, and in lines of its code."""
    text = page.read_text()
    code = "\n".join(re.findall(r"^```.*?^```$", text, re.DOTALL | re.MULTILINE))
    yield from re.findall(r"`(?:\.venv/bin/)?rgbn ([a-z][^`]*)`", text)
    yield from re.findall(r"^(?:\.venv/bin/)?rgbn ([a-z][^;#\n]*)", code, re.MULTILINE)


def test_every_verb_and_key_is_in_the_reference_and_no_page_names_another():
    manual = (REFERENCE / "verbs.md").read_text()
    verbs = {name for name in app if not name.startswith("-")}
    assert {verb for verb in verbs if f"\n## rgbn {verb}\n" not in manual} == set()
    keys = (REFERENCE / "session-toml.md").read_text()
    titles = " ".join(re.findall(r"^## (.*)$", keys, re.MULTILINE))
    for name, table in TABLES.items():
        for key in table.model_fields:
            is_table = f"{name}.{key}".strip(".") in TABLES
            assert (f"{key}]" in titles or f"`{key}` of" in titles) if is_table else f"\n* `{key} = " in keys, key
    typed = [(page.name, command) for page in WRITTEN for command in commands(page)]
    assert len(typed) > 60
    assert [one for one in typed if one[1].split()[0] not in verbs] == []
    options = set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", manual))
    assert [one for one in typed if not set(re.findall(r"(?<= )--?[a-z][a-z-]*", one[1])) <= options] == []
    alone = {name for page in (DOCS / "guide").glob("*.md") for name in re.findall(r"`(--[a-z-]+)", page.read_text())}
    assert alone <= options


def test_the_words_that_the_guide_explains_are_those_of_messages():
    rows = re.findall(r"^\| (`.*?) \|", (DOCS / "guide" / "repair.md").read_text(), re.MULTILINE)
    code = "".join(path.read_text() for room in ROOT.glob("*/py.typed") for path in room.parent.rglob("*.py"))
    messages = re.sub(r"\"\s*\n\s*f?\"", "", code)
    words = [part for row in rows for part in re.findall("`([^`]+)`", row)]
    assert len(words) > 30
    assert [part for part in words if part not in messages] == []


def test_the_manuals_session_is_read():
    manual = (REFERENCE / "session-toml.md").read_text()
    manifest, faults = parse(tomllib.loads(manual.split("```toml")[1].split("```")[0]))
    assert not faults
    assert manifest is not None
    assert [ball.kind for ball in manifest.spheres] == ["chrome", "chrome", "white"]


def test_the_first_page_is_one_screen_with_the_two_commands():
    lines = (ROOT / "README.md").read_text().splitlines()
    assert len(lines) <= 60
    assert {"make demo", "make test"} <= {line.split("#")[0].strip() for line in lines}


def test_the_changelog_begins_with_this_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert re.search(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1] == version


def test_what_is_written_into_a_page_has_its_two_marks():
    for page in WRITTEN:
        begun = re.findall(r"^<!-- (?!end of )(.+) -->$", page.read_text(), re.MULTILINE)
        ended = re.findall(r"<!-- end of (.+) -->", page.read_text())
        assert begun == ended, page.name
        assert len(set(begun)) == len(begun), page.name


@pytest.mark.full
def test_the_site_is_built_without_a_warning_and_fetches_nothing(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", DOCS, tmp_path / "html"]
    run = subprocess.run([*command, "-d", tmp_path / "doctrees"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    built = sorted((tmp_path / "html").rglob("*.html"))
    assert len(built) >= len(PAGES)
    for page in built:
        assert not re.search(r"<(?:script|img|link|iframe)[^>]*(?:src|href)=\"(?:https?:)?//", page.read_text()), page


MADE = {example.name: example.make for example in EXAMPLES}
COUNT = 12


def test_the_wrong_lights_are_each_the_next_one_s(tmp_path):
    angles = 0.3 * np.arange(COUNT)
    right = np.stack([0.6 * np.cos(angles), 0.6 * np.sin(angles), np.full(COUNT, 0.8)], 1)
    rows = [f"flash_{k:03d}.dng {x:.8f} {y:.8f} {z:.8f}" for k, (x, y, z) in enumerate(right)]
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "lights.lp").write_text("\n".join([str(COUNT), *rows]) + "\n")
    session = load_session(MADE["lights"](tmp_path / "place", tmp_path))
    assert (session.scan, session.spheres) == (None, ())
    lights = read_lights(session.lights_file, tuple(path.stem for path in session.flash))
    np.testing.assert_allclose(lights.directions, np.roll(right, -1, 0), atol=1e-6)
    normals = np.load(session.normals)
    known = np.isfinite(normals).all(-1)
    assert known.sum() > 20_000
    np.testing.assert_allclose(np.linalg.norm(normals[known], axis=-1), 1, atol=1e-4)


def test_the_one_without_a_scan_has_all_else(tmp_path):
    session = load_session(MADE["photographs"](tmp_path, tmp_path))
    assert session.scan is None
    assert [ball.kind for ball in session.spheres] == ["chrome", "chrome", "white"]
    assert len(session.flash) == COUNT


def test_every_example_is_on_the_page():
    page = (DOCS / "gallery.md").read_text()
    assert [f"## {example.title}" for example in EXAMPLES] == [
        line for line in page.splitlines() if line.startswith("## ")
    ]
