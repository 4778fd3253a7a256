"""report.pdf: two pages that hold the words and numbers of report.html, whatever a session lacks or is called."""

import hashlib
import json
import re
import shutil

import pytest
from pypdf import PdfReader

from compare.compare import compare
from compare.report.facts import all_warnings
from compare.report.page import plain
from compare.report.report import write_report
from compare.report.verdict import verdict
from lab.options import Settings
from lab.run import run_session
from tests.lab.test_foreign_files import make_session

DIGESTS = {"object.ply": "0123456789abcdef" * 4, "normals/ls.npy": "f" * 64, "lights.json": None}
NUMBER = r"\d+(?:[.:]\d+)*"


def squeezed(text):
    """Return a text without its spaces: lines are broken elsewhere on paper."""
    return re.sub(r"\s", "", text)


def text_of(path):
    pages = PdfReader(path).pages
    for page in pages:
        assert (float(page.mediabox.width), float(page.mediabox.height)) == pytest.approx((595.28, 841.89), abs=0.1)
    return len(pages), "\n".join(page.extract_text() for page in pages)


@pytest.fixture
def printed(copied):
    """Return what writes both reports of a changed summary, and gives pages and text of the PDF and of the page."""

    def write(change=lambda store, summary: None, digests=DIGESTS):
        store, summary = copied
        change(store, summary)
        page = plain(write_report(store, summary, digests).read_text("utf-8"))
        count, text = text_of(store.path("report.pdf"))
        assert 1 <= count <= 2
        first = verdict(summary)[0]
        for one in verdict(summary):
            assert squeezed(one.text) in squeezed(page)
            assert squeezed(one.text) in squeezed(text)
        assert squeezed(first.text) in squeezed(text.partition("Each result")[0]), "on top"
        for _, warning in all_warnings(summary):
            assert squeezed(warning) in squeezed(text)
        return text, page, store

    return write


def test_it_says_what_the_page_says_and_the_same_bytes_each_time(printed, session):
    text, page, store = printed()
    assert squeezed(session.summary["name"]) in squeezed(text)
    assert "The decoded frames" not in text
    # By what each is called so.
    for one in verdict(session.summary):
        assert squeezed(f"{one.text} ({one.why})" if one.why else one.text) in squeezed(text)
    for name, digest in DIGESTS.items():
        assert squeezed(f"{name}{digest or 'is not there'}") in squeezed(text)
    told = re.sub("|".join([*filter(None, DIGESTS.values()), str(store.folder), r"page \d of \d"]), "", text)
    known = {*re.findall(NUMBER, page), *re.findall(NUMBER, json.dumps(session.summary["versions"])), "16"}
    # The chart's numbers, of the lights and the rings, stand as close as the lights do.
    told = re.sub(r"The set-up.*?(?=Normals and their errors)", "", told, flags=re.DOTALL)
    assert set(re.findall(NUMBER, told)) - known == set()
    before = store.path("report.pdf").read_bytes()
    links = [note.get_object()["/A"]["/URI"] for one in PdfReader(store.path("report.pdf")).pages
             for note in one.get("/Annots", [])]  # fmt: skip
    assert set(links) == {store.folder.resolve().as_uri()}
    assert b'pdfaid:part="2"' in before
    write_report(store, session.summary, DIGESTS)
    assert store.path("report.pdf").read_bytes() == before


def without_truth(store, summary):
    store.path("normals", "truth.npy").unlink()
    summary["compare"] = compare(store)


def without_twin_and_scan(store, summary):
    summary |= {"twin": None, "align": None}
    store.path("pose.json").unlink()
    shutil.rmtree(store.path("twin"))


def with_long_warnings(store, summary):
    words = "the flash did not fire, or something stood before it, and the ball does not show it; reshoot it. " * 4
    summary["warnings"] = [{"step": "check", "text": f"flash_{number:03d}: {words}"} for number in range(30)]


def with_an_odd_name(store, summary):
    summary["name"] = "漢 Δίας Пингвин הר <b>& “x”"


def with_a_hundred_lights(store, summary):
    lights = summary["compare"]["lights"]
    lights["frames"] = [{**lights["frames"][number % 12], "name": f"flash_{number}"} for number in range(100)]


@pytest.mark.parametrize(
    ("change", "words"),
    [(without_truth, "no scan, no known normals"), (with_long_warnings, "flash_029"),
     (with_an_odd_name, r"\u6f22 Δίας Пингвин \u05d4\u05e8 <b>& “x”"),
     pytest.param(without_twin_and_scan, "Calibration balls", marks=pytest.mark.full),
     pytest.param(with_a_hundred_lights, "page 2 of 2", marks=pytest.mark.full)],
)  # fmt: skip
def test_whatever_a_session_lacks(printed, change, words):
    text = printed(change)[0]
    assert squeezed(words) in squeezed(text)
    assert "flash_99" not in text


def test_each_checksum_is_that_of_the_file(tmp_path):
    session, out = tmp_path / "session", tmp_path / "out"
    make_session(session)
    for verb in ("compare", "check"):
        run_session(session, verb, out=out, said=Settings("ls"))
        text = squeezed(text_of(out / "report.pdf")[1])
        made = {name: out / name for name in ("lights.json", "summary.json", "normals/ls.npy")}
        for name, path in {"session.toml": session / "session.toml", **made}.items():
            assert f"{name}{hashlib.sha256(path.read_bytes()).hexdigest()}" in text, verb
    run_session(session, "solve", out=out, said=Settings("iterative"))
    assert not (out / "report.pdf").exists(), "what it told of is no longer there"
