"""The leaderboard stands alone: every page opens from a disk, every link leads somewhere, every checksum is right."""

import csv
import hashlib
import json
import re
import shutil
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
import yaml

from experiments.datasets.run_methods import run
from experiments.datasets.shelf import add
from experiments.datasets.site import write_site
from experiments.datasets.submissions import read_submissions
from lab.options import Solving

SHOTS = Path(__file__).parents[3] / "out" / "leaderboard"
"""Where screenshots are left to be looked at."""


class Links(HTMLParser):
    """Collects what a page refers to."""

    def __init__(self, text):
        super().__init__()
        self.hrefs, self.sources, self.alone = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.hrefs += [found["href"]] if tag == "a" and "href" in found else []
        self.sources += [found["src"]] if "src" in found else []
        self.alone += [tag] if tag in ("link", "iframe", "object") else []


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A shelf of three datasets, results of two methods and of a submission of one map; the site."""
    from tests.experiments.datasets.conftest import surface, write

    place = tmp_path_factory.mktemp("leaderboard")
    for name in ("first", "second", "third"):
        write(place / name, gloss=0.3 * (name == "second"))
        add(place / "shelf", place / name, name=name, text=f"the <{name}> one")
    folder = place / "theirs"
    folder.mkdir()
    np.save(folder / "second.npy", np.where(surface()[1] != 0, [0, 0, 1.0], 0))
    (folder / "submission.toml").write_text(
        'method = "Flat"\nauthors = "<b>Nobody</b>"\nsettings = "none"\nhardware = "none"\nseconds = 0.1\n'
        'paper = "https://example.org/flat"\n'
    )
    given = read_submissions(folder, place / "shelf")
    rows = run(place / "shelf", [], solving=Solving("ls,iterative"), submissions=given, out=place / "out")
    return place / "shelf", rows, write_site(place / "shelf", place / "out", rows, given).parent, given


def test_every_page_stands_alone_and_every_link_leads_somewhere(made):
    shelf, _, site, _ = made
    pages = sorted(path.name for path in site.glob("*.html"))
    assert pages == ["first.html", "index.html", "second.html", "submit.html", "third.html"]
    for name in pages:
        text = (site / name).read_text()
        links = Links(text)
        assert not links.alone
        assert all(source.startswith("data:image/") for source in links.sources)
        assert "default-src 'none'" in text
        for href in links.hrefs:
            if not href.startswith(("#", "https://example.org")):
                assert (site / unquote(href)).is_file(), f"{name}: {href}"
    assert "<b>Nobody</b>" not in (site / "index.html").read_text()
    assert "&lt;first&gt;" in (site / "first.html").read_text()
    hrefs = Links((site / "first.html").read_text()).hrefs
    assert {(site / href).resolve() for href in hrefs} >= {path.resolve() for path in (shelf / "first").glob("*.png")}


def test_checksums_and_numbers_are_those_of_the_files(made):
    shelf, rows, site, _ = made
    for line in (site / "second.sha256").read_text().splitlines():
        value, name = line.split("  ", 1)
        assert hashlib.sha256((shelf / "second" / name).read_bytes()).hexdigest() == value
        assert value in (site / "second.html").read_text()
    with open(site / "results.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert [(one["dataset"], one["method"]) for one in table] == [(row["dataset"], row["method"]) for row in rows]
    index = (site / "index.html").read_text()
    for row in rows:
        assert row["status"] != "ok" or index.count(f'data-value="{row["filled_deg"]!r}"') >= 1
    # Two datasets that were not submitted count as 90 degrees.
    flat = next(row["filled_deg"] for row in rows if row["method"] == "Flat" and row["status"] == "ok")
    assert f'data-value="{(flat + 180) / 3!r}"' in index or f'data-value="{(90.0 + flat + 90.0) / 3!r}"' in index


def test_downloads_go_where_the_datasets_are_served(made, tmp_path):
    shelf, rows, site, given = made
    out = tmp_path / "out"
    page = write_site(shelf, out, rows, given, downloads="https://data.example.org/sets/").parent / "first.html"
    hrefs = Links(page.read_text()).hrefs
    assert "https://data.example.org/sets/first/001.png" in hrefs
    found = json.loads((page.parent / "first.croissant.json").read_text())
    assert {one["contentUrl"] for one in found["distribution"] if "contentUrl" in one} == {
        f"https://data.example.org/sets/first/{line.split('  ', 1)[1]}"
        for line in (site / "first.sha256").read_text().splitlines()
    }


REQUIRED = {"@context", "@type", "conformsTo", "name", "description", "license", "url", "creator", "datePublished"}
"""Of a dataset, by the specification of Croissant 1.0."""


@pytest.mark.parametrize("name", ["croissant.json", "second.croissant.json"])
def test_croissant_has_what_the_format_asks_for(made, name):
    """Properties that 1.0 requires; every reference has its target; every checksum is the file's."""
    shelf, _, site, _ = made
    found = json.loads((site / name).read_text())
    assert set(found) >= REQUIRED | {"distribution", "recordSet", "citeAs", "version"}
    assert found["@type"] == "sc:Dataset"
    assert found["conformsTo"] == "http://mlcommons.org/croissant/1.0"
    assert "Berkiten" in found["citeAs"]
    files = {one["@id"]: one for one in found["distribution"]}
    assert len(files) == len(found["distribution"])
    for one in files.values():
        assert one["encodingFormat"]
        if one["@type"] == "cr:FileObject":
            assert re.fullmatch("[0-9a-f]{64}", one["sha256"])
            assert hashlib.sha256((site / one["contentUrl"]).read_bytes()).hexdigest() == one["sha256"]
        else:
            assert one["@type"] == "cr:FileSet"
            assert one["includes"] == ["*"]
            names = (shelf / "second" / "filenames.txt").read_text().split()
            assert [each["@id"] for each in one["containedIn"]] == names
            assert set(names) <= set(files)
    fields = {field["@id"] for records in found["recordSet"] for field in records["field"]}
    for records in found["recordSet"]:
        assert records["@type"] == "cr:RecordSet"
        own = {field["@id"] for field in records["field"]}
        assert {records["key"]["@id"]} <= own if "key" in records else True
        for field in records["field"]:
            assert field["@type"] == "cr:Field"
            assert field["dataType"].startswith("sc:")
            assert field.get("references", {}).get("field", {"@id": field["@id"]})["@id"] in fields
            source = field.get("source", {})
            for kind in ("fileObject", "fileSet"):
                assert source.get(kind, {"@id": next(iter(files))})["@id"] in files
            assert source or "data" in records
        assert all(set(row) == own for row in records.get("data", []))
    sets = {records["name"]: records for records in found["recordSet"]}
    if name == "croissant.json":
        assert [row["datasets/name"] for row in sets["datasets"]["data"]] == ["first", "second", "third"]
    else:
        lights = np.loadtxt(shelf / "second" / "light_directions.txt")
        data = sets["lights"]["data"]
        np.testing.assert_array_equal([[row[f"lights/{axis}"] for axis in "xyz"] for row in data], lights)
        assert [row["lights/file"] for row in data] == (shelf / "second" / "filenames.txt").read_text().split()
        assert {"images", "masks"} <= set(sets)


def test_the_citation_file_names_the_benchmark():
    """The fields that version 1.2.0 of the format requires, and the work that this project follows."""
    root = Path(__file__).parents[3]
    found = yaml.safe_load((root / "CITATION.cff").read_text())
    assert set(found) >= {"cff-version", "message", "title", "authors"}
    assert found["version"] == tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    (benchmark,) = (one for one in found["references"] if one["title"] == "An RGBN Benchmark")
    assert [author["family-names"] for author in benchmark["authors"]] == ["Berkiten", "Rusinkiewicz"]
    assert benchmark["type"] == "report"
    assert benchmark["year"] == 2016


def test_what_is_no_longer_there_leaves_the_site(made, tmp_path):
    shelf, rows, _, given = made
    out = tmp_path / "out"
    site = write_site(shelf, out, rows, given).parent
    assert (site / "third.html").is_file()
    write_site(shelf, out, [row for row in rows if row["dataset"] != "third"], given)
    assert not list(site.glob("third.*"))
    assert (site / "second.html").is_file()


@pytest.mark.full
def test_a_browser_shows_and_sorts_it_from_the_disk(made, chromium, tmp_path):
    site = tmp_path / "moved" / "site"
    shutil.copytree(made[2], site)
    page = chromium.new_page(viewport={"width": 1100, "height": 900})
    asked, wrong = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(f"file://{site}/index.html")
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SHOTS / "index.png", full_page=True)

    def order():
        return page.locator("#matrix table").first.locator("tbody tr th").all_inner_texts()

    head = page.locator("#matrix table").first.locator("thead th")
    values = {row["dataset"]: row["mean_deg"] for row in made[1] if row["method"] == "ls"}
    assert order() == ["first", "second", "third"]
    head.nth(1).click()
    assert order() == sorted(values, key=lambda name: values[name])
    head.nth(1).click()
    assert order()[0] == max(values, key=lambda name: values[name])
    head.nth(3).click()
    assert order()[0] == "second", "what has no result comes last"
    head.nth(0).click()
    assert order() == ["first", "second", "third"]
    page.get_by_role("link", name="second").first.click()
    assert page.locator("h1").inner_text() == "second"
    loaded = page.locator("img").evaluate_all("images => images.map(one => one.naturalWidth)")
    assert len(loaded) == 1 + 1 + 3
    assert min(loaded) > 30
    page.screenshot(path=SHOTS / "dataset.png", full_page=True)
    page.set_viewport_size({"width": 390, "height": 844})
    for name in ("index", "second", "submit"):
        page.goto(f"file://{site}/{name}.html")
        page.screenshot(path=SHOTS / f"{name}-phone.png", full_page=True)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
    assert all(url.startswith(("file://", "data:")) for url in asked)
    assert not wrong
    page.close()
