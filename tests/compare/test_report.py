"""The page: whole, self-contained, escaped, true to the summary, and drawn by a browser."""

import copy
import json
import re
import shutil
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compare.compare import compare
from compare.report.report import write_report
from scene.camera import Camera
from scene.files import write_json, write_png
from scene.frames import Frames
from scene.lights import Lights

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Collects what a test asks of a page, and fails on tags that do not pair."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.source = path.read_text(encoding="utf-8")
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}
        self.open: list[str] = []
        self.section = ""
        self.scripts: list[str] = []
        self.feed(self.source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.tags.append((tag, values))
        if tag == "section":
            self.section = values.get("id") or ""
            assert self.section not in self.texts, "a section appears once"
            self.texts[self.section] = ""
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        if tag == "section":
            self.section = ""

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
        elif self.section and self.open[-1] != "style":
            self.texts[self.section] += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [values for name, values in self.tags if name == tag]


def leaves(value: Any) -> set[float]:
    if isinstance(value, dict):
        return set().union(*map(leaves, value.values()), set())
    if isinstance(value, list):
        return set().union(*map(leaves, value), set())
    return {float(value)} if isinstance(value, int | float) else set()


@pytest.fixture(scope="module")
def page(session) -> Page:
    return Page(write_report(session.store, session.summary))


def assert_self_contained(page: Page) -> None:
    for tag, values in page.tags:
        assert tag not in {"link", "iframe", "object", "embed", "base", "audio", "video", "source"}
        for name in ("src", "href", "xlink:href", "data", "poster", "action", "srcset"):
            address = values.get(name)
            assert address is None or address.startswith(("data:image/", "#")), (tag, name, address[:60])
        style = values.get("style") or ""
        assert "url(" not in style
    style = re.search(r"<style>(.*?)</style>", page.source, re.S)
    assert style is not None
    assert "url(" not in style[1]
    assert "@import" not in style[1]
    (policy,) = [v["content"] for v in page.all("meta") if "http-equiv" in v]
    assert policy is not None
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_every_number_on_the_page_is_in_the_summary(page, session, tmp_path):
    write_json(tmp_path / "summary.json", session.summary)
    known = leaves(json.loads((tmp_path / "summary.json").read_text()))
    shown = [values["data-value"] for values in page.all("span") if "data-value" in values]
    assert len(shown) > 150
    assert {value for value in shown if float(value or "nan") not in known} == set()


def test_pictures_are_all_there_each_with_words_for_it(page):
    images = page.all("img")
    # 3 on the first screen; of the viewer 12 frames, real and twin, normals of the truth and of 2 methods real and
    # twin, their errors, 2 albedos, 3 sigmas; 3 balls, the outline, key ball.
    assert len(images) == 3 + 2 * 12 + (1 + 4) + 4 + 2 + 3 + 3 + 1 + 1
    assert all(image["alt"] for image in images)
    assert all(values.get("aria-label") for values in page.all("svg"))


def test_how_alike_each_photograph_and_its_twin_are_is_listed(page, session):
    twin = page.source[page.source.index('<section id="twin"') :]
    rows = session.summary["compare"]["frames_alike"]["frames"]
    assert len(rows) == 12
    for row in rows:
        (cells,) = re.findall(rf"\d {row['name']}</th>(.*?)</tr>", twin)
        assert re.findall(r'data-value="(.*?)"', cells) == [repr(row["psnr_db"]), repr(row["ssim"])]


def test_what_align_drew_of_a_registered_scan_is_shown(copied):
    store, summary = copied
    write_png(store.path("align", "outline_zoom.png"), np.zeros((20, 30, 3), np.uint8))
    shown = [image["alt"] for image in Page(write_report(store, summary)).all("img")]
    assert "four stretches of the outline" in shown


def test_hostile_names_stay_text_wherever_they_go(copied):
    evil, (store, summary) = '"><script>evil()</script><img src=x onerror=evil()>', copied
    frames = store.load_frames()
    store.save_frames_header(Frames((evil, *frames.names[1:]), frames.codes, frames.gain))
    summary["capture"]["frames_table"][0]["name"] = evil
    summary["compare"]["lights"]["frames"][0].update(name=evil, flags=[evil])
    summary["solve"]["methods"]["ls"]["settings"] = {evil: evil}
    summary["name"] = summary["versions"][evil] = evil
    summary["arguments"] = {evil: [evil]}
    summary["calibrate"].update(model=evil, evidence=[evil])
    summary["truth_check"] = {evil: {"value": 1.0, "unit": evil, "bar": 2.0, "text": evil}}
    summary["warnings"] = [{"step": evil, "text": evil}]
    summary["twin"] |= {"engine": evil, "reason": evil, "material": {"sentence": evil}}
    summary["compare"]["methods"][evil] = copy.deepcopy(summary["compare"]["methods"]["ls"])
    rows = {evil: {"unexplained": 0.02, "apart_deg": 0.0}}
    summary["trust"] = {
        "methods": rows,
        "recommended": evil,
        "level": [evil],
        "doubts": [evil],
        "sigma_deg": {"median": None, "q90": None},
    }
    page = Page(write_report(store, summary))
    assert_self_contained(page)
    assert "<script>evil" not in page.source
    assert evil in unescape("".join(re.findall(r"<h1>(.*?)</h1>", page.source)))
    assert not [values for _, values in page.tags if "onerror" in values]
    assert all(evil not in script for script in page.scripts)


def test_the_first_screen_says_where_files_for_other_programs_are_if_there_are_any(page, copied):
    for word in ("results/ of the output folder", "rgbn export SESSION --format relight"):
        assert word in page.texts["verdict"]
    store, summary = copied
    del summary["results"]
    assert "in results/" not in Page(write_report(store, summary)).texts["verdict"]


def test_chapters_lead_to_sections_that_exist(page):
    targets = [values["href"] for values in page.all("a")]
    assert len(targets) >= 13
    assert {target.removeprefix("#") for target in targets if target} <= set(page.texts)


def test_the_outline_lies_on_the_ball_and_the_highlights_inside(page, session):
    """The drawing counts from the crop's corner: half a pixel, or a swapped axis, would show here."""
    spheres, camera = session.store.load_spheres(), session.store.load_camera()
    frames = session.store.load_frames()
    drawings = re.findall(r'<svg viewBox="0 0 (\d+) (\d+)"[^>]*highlights">(.*?)</svg>', page.source)
    assert len(drawings) == 3
    brightest = frames.read().max(0).sum(-1)
    for sphere, (width, height, shapes) in zip(spheres, drawings, strict=True):
        points = np.array([pair.split(",") for pair in re.findall(r'points="([^"]*)"', shapes)[1].split()], float)
        v, u = np.nonzero(sphere.mask(camera))
        # Of the ball's own pixels, half a pixel in from the outline on all sides.
        assert np.ptp(points[:, 0]) == pytest.approx(u.max() - u.min() + 1, abs=1.2)
        offset = points.min(0) - [u.min(), v.min()]
        for cross in re.findall(r'class="highlight" d="M([\d.]+),([\d.]+)H([\d.]+)', shapes):
            left, row, right = map(float, cross)
            column, line = (left + right) / 2 - offset[0], row - offset[1]
            around = brightest[round(line) - 2 : round(line) + 3, round(column) - 2 : round(column) + 3]
            assert around.max() > 0.3
        assert points.min() >= 0
        assert (points.max(0) <= [int(width), int(height)]).all()


def test_the_methods_are_ranked_on_top_with_what_they_doubt(page, session):
    methods = session.summary["compare"]["methods"]
    best, other = sorted(methods, key=lambda name: methods[name]["real"]["median_deg"])
    assert f"those of method {best}" in page.texts["verdict"]
    top = page.texts["normals"]
    assert top.index("All methods, against") < top.index(f"{best} take care") < top.index(f"{other} take care")
    assert "3 pixels see fewer than four lit samples" in top
    assert "least squares over the samples that are not in shadow" in page.texts["how-to-read"]


def leave_out(store, *paths):
    for path in map(store.path, paths):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


@pytest.mark.parametrize(
    ("paths", "key", "reasons"),
    [
        (("normals/truth.npy", "pose.json"), "align",
         {"errors": "No ground truth", "statistics": "which tells where they disagree",
          "time": "ls, iterative: there is no ground truth", "normals": "without truth no order of belief follows"}),
        (("pose.json",), "align", {"registration": "No scan was registered"}),
        (("twin",), "twin", {"twin": "No twin was rendered", "errors": "No twin was solved", "statistics": "No twin"}),
        ((), "solve", {"time": "No method's time"}),
    ],
)  # fmt: skip
def test_a_part_that_is_missing_is_said_to_be_missing(copied, paths, key, reasons):
    store, summary = copied
    leave_out(store, *paths)
    del summary[key]
    summary["compare"] = compare(store)
    page = Page(write_report(store, summary))
    for section, reason in reasons.items():
        assert reason in page.texts[section]
    assert_self_contained(page)


PARTS = (
    "name", "created", "versions", "arguments", "seconds", "warnings", "capture", "camera", "calibrate", "align",
    "solve", "twin", "compare", "truth_check",
)  # fmt: skip


@pytest.mark.full
@pytest.mark.parametrize(("missing", "null"), [(key, PARTS[i - 1]) for i, key in enumerate(PARTS)])
def test_any_part_of_the_summary_may_be_missing_or_null(session, missing, null):
    summary = {key: value for key, value in session.summary.items() if key != missing} | {null: None}
    assert_self_contained(Page(write_report(session.store, summary)))


@pytest.mark.parametrize("summary", [{}, dict.fromkeys(PARTS)], ids=["missing", "null"])
def test_without_a_ball_that_is_said_and_an_empty_summary_calls_nothing_good(copied, summary):
    store, _ = copied
    store.save_spheres([], store.load_camera())
    write_json(store.path("calibration.json"), {})
    page = Page(write_report(store, summary))
    assert_self_contained(page)
    assert "No ball" in page.texts["balls"]
    assert "good" not in re.findall(r'class="badge (\w+)"', page.source)


def test_given_lights_an_orthographic_camera_and_balls_apart(copied):
    """What a session without balls in the frames gives: distant lights, no sigmas, no pictures of the balls."""
    store, summary = copied
    leave_out(store, "pose.json", "normals/truth.npy", "normals/truth_sigma.npy", "twin")
    camera = Camera.orthographic(160, 120)
    store.save_camera(camera)
    lights = store.load_lights()
    store.save_lights(Lights(lights.names, lights.directions, lights.intensities))
    rows = store.read_json("spheres.json")
    for row in rows:
        row.update(apart=True, diameter_mm=None, center_mm=None)
    write_json(store.path("spheres.json"), rows)
    summary |= {"camera": store.read_json("camera.json"), "align": None, "twin": None}
    summary["calibrate"] = {"model": "distant", "direction_sigma_deg_median": None}
    summary["compare"] = compare(store)
    page = Page(write_report(store, summary))
    assert "orthographic" in page.texts["why"]
    assert "take care Camera" in page.texts["verdict"]
    assert "taken as distant" in page.texts["lights"]
    assert "not known" in page.texts["lights"]
    assert page.texts["balls"].count("only the fit is drawn") == 3
    assert "seen from above" not in page.source


def test_without_a_truth_the_page_begins_with_the_method_that_the_photographs_recommend(copied):
    store, summary = copied
    rows = {name: {"unexplained": 0.02, "apart_deg": 0.0} for name in ("ls", "iterative")}
    summary["trust"] = {
        "methods": rows,
        "recommended": "ls",
        "level": [],
        "relative_rmse": 0.03,
        "sigma_deg": {"median": 1.5, "q90": 4.2},
        "doubts": [],
    }
    for has_truth, shown in ((False, "ls"), (True, "iterative")):
        summary["compare"]["has_truth"] = has_truth
        first = Page(write_report(store, summary)).texts["verdict"]
        assert f"normals, {shown}" in first
