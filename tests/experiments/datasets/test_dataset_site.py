"""The site stands alone: every page opens from a disk, every link leads somewhere, every checksum is right."""

import csv
import hashlib
import shlex
import shutil
import sys
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
import yaml

from experiments.datasets.run_methods import run
from experiments.datasets.shelf import add
from experiments.datasets.site import write_site
from lab.options import Solving

SHOTS = Path(__file__).parents[3] / "out" / "datasets-site"
"""Where screenshots are left to be looked at."""
PROGRAM = """
import sys
from pathlib import Path
import cv2, numpy as np
data, out = map(Path, sys.argv[1:])
if "second" not in str(data):
    sys.exit("no <b>weights</b> here")
gray = np.stack([cv2.imread(str(data / name), -1).mean(-1) for name in (data / "filenames.txt").read_text().split()])
gray /= np.loadtxt(data / "light_intensities.txt").mean(1)[:, None, None]
normals = np.einsum("if,fhw->hwi", np.linalg.pinv(np.loadtxt(data / "light_directions.txt")), gray)
np.save(out / "normals.npy", normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9))
"""


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
    """A shelf of three datasets, results of two methods and of a program that fails on two of them; the site."""
    from tests.experiments.datasets.conftest import write

    place = tmp_path_factory.mktemp("site")
    for name in ("first", "second", "third"):
        write(place / name, gloss=0.3 * (name == "second"))
        add(place / "shelf", place / name, name=name, text=f"the <{name}> one")
    (place / "partly.py").write_text(PROGRAM)
    command = f"Partly={shlex.quote(sys.executable)} {place / 'partly.py'} {{data}} {{out}}"
    rows = run(place / "shelf", [], solving=Solving("ls,iterative", external=(command,)), out=place / "out")
    return place / "shelf", rows, write_site(place / "shelf", place / "out", rows).parent


def test_every_page_stands_alone_and_every_link_leads_somewhere(made):
    shelf, _, site = made
    pages = sorted(path.name for path in site.glob("*.html"))
    assert pages == ["first.html", "index.html", "second.html", "third.html"]
    for name in pages:
        text = (site / name).read_text()
        links = Links(text)
        assert not links.alone
        assert all(source.startswith("data:image/") for source in links.sources)
        assert "default-src 'none'" in text
        for href in links.hrefs:
            if not href.startswith("#"):
                assert (site / unquote(href)).is_file(), f"{name}: {href}"
    index = (site / "index.html").read_text()
    assert "first, Partly: failed" in index
    assert "<b>weights</b>" not in index
    assert "&lt;b&gt;weights&lt;/b&gt;" in index
    assert "&lt;first&gt;" in (site / "first.html").read_text()
    hrefs = Links((site / "first.html").read_text()).hrefs
    assert {(site / href).resolve() for href in hrefs} >= {path.resolve() for path in (shelf / "first").glob("*.png")}


def test_checksums_and_numbers_are_those_of_the_files(made):
    shelf, rows, site = made
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
    assert {row["dataset"] for row in rows if row["method"] == "Partly" and row["status"] == "ok"} == {"second"}


def test_downloads_go_where_the_datasets_are_served(made, tmp_path):
    shelf, rows, site = made
    out = tmp_path / "out"
    page = write_site(shelf, out, rows, downloads="https://data.example.org/sets/").parent / "first.html"
    hrefs = Links(page.read_text()).hrefs
    assert "https://data.example.org/sets/first/001.png" in hrefs
    assert {href for href in hrefs if href.startswith("https:")} == {
        f"https://data.example.org/sets/first/{line.split('  ', 1)[1]}"
        for line in (site / "first.sha256").read_text().splitlines()
    }


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
    shelf, rows, _ = made
    out = tmp_path / "out"
    site = write_site(shelf, out, rows).parent
    assert (site / "third.html").is_file()
    write_site(shelf, out, [row for row in rows if row["dataset"] != "third"])
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
    for name in ("index", "second"):
        page.goto(f"file://{site}/{name}.html")
        page.screenshot(path=SHOTS / f"{name}-phone.png", full_page=True)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
    assert all(url.startswith(("file://", "data:")) for url in asked)
    assert not wrong
    page.close()
