"""`rgbn process PARENT`: which folders are sessions, what is told of each, and that none outlives the command."""

import csv
import json
import os
import re
import shutil
import signal
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import psutil
import pytest

from lab import many_sessions
from lab.many_sessions import sessions_below
from lab.options import AS_BEFORE
from lab.run import run_session
from scene.errors import SceneError
from scene.files import write_json
from tests.conftest import started, until
from tests.lab.test_foreign_files import make_session

ODD = 'b #1 100%25 [red]<i>"x"&'
"""A folder's name that means something else in HTML, in an address, and in the tables' own markup."""
NAMES = ["a", ODD, "broken", "x/y", "x-y"]


@pytest.fixture
def captures(tmp_path, monkeypatch):
    """A folder with sessions, two of them below folders of like names, and one that cannot be read."""
    parent = tmp_path / "captures"
    for name in NAMES:
        if name != "broken":
            make_session(parent / name)
    (parent / "broken").mkdir()
    (parent / "broken" / "session.toml").write_text("[frames\n")
    monkeypatch.chdir(tmp_path)
    return parent


@pytest.fixture
def here(monkeypatch):
    """Sessions are processed in this process, which costs no imports; give those that were begun."""
    begun = []

    def process(session, out, said, scheduler):
        begun.append(session.name)
        try:
            run_session(session, "compare", out=out, said=said, scheduler=scheduler)
        except SceneError as error:
            return str(error)
        return ""

    monkeypatch.setattr(many_sessions, "_in_its_own_process", process)
    return begun


def words_of(page):
    """Return what stands between the tags of a page."""
    return [unescape(text) for text in re.split(r"<[^>]*>", page)]


def marks(out):
    """Return what the record of each session's folder keeps of its steps."""
    records = sorted(out.rglob(".rgbn/record.json"))
    done = {path.parents[1].relative_to(out).as_posix(): json.loads(path.read_text())["done"] for path in records}
    return {name: found for name, found in done.items() if found}


def names_of(parent):
    return [path.relative_to(parent).as_posix() for path in sessions_below(parent)]


def test_sessions_are_found_wherever_one_stands(captures, monkeypatch):
    assert names_of(captures) == NAMES
    for place, said in ((captures, "."), (captures / "a", ".."), (captures / "x" / "y", "../..")):
        monkeypatch.chdir(place)
        assert names_of(Path(said)) == NAMES, said
    hidden = captures.parent / ".private"
    captures.rename(hidden)
    assert names_of(hidden) == NAMES, "the parent itself may be hidden"


def test_no_twin_no_output_and_no_hidden_folder_is_a_session(captures):
    for place in ("out/pear/twin", ".trash/old", "x/.kept/old", "a/within", "out/pear/.rgbn/tmp/one"):
        make_session(captures / place)
    (captures / "link").symlink_to(captures / "a")
    (captures / "round").symlink_to(captures)
    assert names_of(captures) == [*NAMES[:3], "link", *NAMES[3:]]
    assert sessions_below(captures / "a") == [], "a session itself"
    assert sessions_below(captures / "out" / "pear") == [], "an output folder"
    assert sessions_below(captures / "a" / "session.toml") == sessions_below(captures / "nowhere") == []


def test_a_folder_that_may_not_be_looked_into_is_passed_over(captures, monkeypatch):
    # For root all may be looked into.
    access, is_session = os.access, many_sessions.is_session

    def refusing(path):
        if Path(path).name == "lost+found":
            raise PermissionError(13, "Permission denied")
        return is_session(path)

    (captures / "lost+found").mkdir()
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "lost+found" and access(path, mode))
    monkeypatch.setattr(many_sessions, "is_session", refusing)
    assert names_of(captures) == NAMES


@pytest.mark.full
def test_one_that_is_refused_stops_no_other(captures, here, run_rgbn):
    code, printed, said = run_rgbn("process", "captures", "--json")
    assert code == 2
    last = said.strip().splitlines()[-1]
    assert last.startswith("rgbn: captures: 1 of 5 sessions could not be processed: broken (")
    assert "line 1 is not TOML" in last
    assert here == [Path(name).name for name in NAMES]
    out = Path("out/captures")
    rows = json.loads(printed)
    assert [row["name"] for row in rows] == NAMES
    assert {row["name"] for row in rows if row["fault"]} == {"broken"}
    assert {row["level"] for row in rows if not row["fault"]} == {"unknown"}, "there is nothing to judge them by"
    table = list(csv.DictReader((out / "sessions.csv").read_text().splitlines()))
    assert [row["name"] for row in table] == NAMES
    page = (out / "index.html").read_text()
    links = map(unescape, re.findall(r'<a [^>]*href="([^"]*)"', page))
    reports = [out / unquote(link) for link in links if link.endswith("report.html")]
    assert reports == [out / name / "report.html" for name in NAMES if name != "broken"]
    assert all(path.is_file() for path in reports)
    assert ODD in words_of(page)
    assert "<i>" not in page

    before = marks(out)
    assert set(before) == set(NAMES) - {"broken"}
    code, printed, said = run_rgbn("process", "captures")
    assert code == 2
    assert marks(out) == before, "a second call does nothing again"
    assert "[red]<i>" in printed
    assert "not processed" in printed


def test_a_tolerance_is_passed_or_failed_on_the_page(captures, monkeypatch, run_rgbn):
    shares = dict(zip(NAMES, (0.95, 0.95, 0.4, 0.95, 0.95), strict=True))

    def process(session, out, said, scheduler):
        share = shares[session.relative_to(captures).as_posix()]
        found = {"deg": 3.0, "method": "ls", "share": share, "least_share": 0.9, "passes": share >= 0.9}
        write_json(out / "summary.json", {"compare": {"tolerance": found}})
        return ""

    monkeypatch.setattr(many_sessions, "_in_its_own_process", process)
    assert run_rgbn("process", captures, "--tolerance", "3deg", "-o", "out/captures")[0] == 0
    text = Path("out/captures/index.html").read_text()
    assert "5 sessions: 4 pass, 1 fail" in text
    assert words_of(text).count("fail") == 1


def test_of_one_that_can_no_longer_be_processed_nothing_old_is_told(captures, here, run_rgbn, no_report):
    for name in ("broken", ODD, "x/y"):
        (captures / name / "session.toml").unlink()
    assert run_rgbn("process", "captures")[0] == 0
    (captures / "a" / "session.toml").write_text("[frames\n")
    code, printed, _ = run_rgbn("process", "captures", "--json")
    row, other = json.loads(printed)
    assert code == 2
    assert (row["name"], other["fault"]) == ("a", "")
    assert (row["level"], row["method"], row["median_deg"], row["warnings"], row["seconds"]) == (
        "not processed", "", None, 0, 0,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["index.html", "sessions.csv/a"])
def test_a_session_where_the_list_is_to_be_is_refused(captures, here, run_rgbn, name):
    make_session(captures / name)
    code, _, said = run_rgbn("process", "captures")
    assert code == 2
    assert f"captures/{name.partition('/')[0]}: a file of the results has that name" in said
    assert here == []
    assert not Path("out").exists()


def test_a_folder_of_another_keeps_its_results(captures, here, run_rgbn, tmp_path, no_report):
    """The usual output folder is a session's of the same name; that given is another's."""
    for name in (ODD, "x/y"):
        shutil.rmtree(captures / name)
    make_session(tmp_path / "else" / "captures")
    assert run_rgbn("check", tmp_path / "else" / "captures")[0] == 0
    code, _, said = run_rgbn("process", "captures")
    assert code == 2
    assert "go to out/captures-2" in said
    assert Path("out/captures-2/index.html").is_file()
    before = here[:]
    code, _, said = run_rgbn("process", "captures", "-o", "out/captures")
    assert code == 2
    assert "it holds the results of the session" in said
    assert here == before
    code, _, said = run_rgbn("process", "captures", "-o", captures / "a" / "out")
    assert code == 2
    assert "rgbn writes nothing there" in said
    assert here == before


@pytest.mark.parametrize("jobs", ["0", "-1", "many"])
def test_a_number_of_jobs_that_cannot_be_is_refused(captures, here, run_rgbn, jobs):
    code, _, said = run_rgbn("process", "captures", "--jobs", jobs)
    assert code == 2
    assert "jobs" in said.lower()
    assert here == []


def die(*_):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_dies_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(many_sessions, "_work", die)
    fault = many_sessions._in_its_own_process(tmp_path, tmp_path / "out", AS_BEFORE, None)
    assert fault.startswith("its process ended with code -9; ")
    assert str(tmp_path / "out" / ".rgbn" / "running.log") in fault, "where a killed run leaves what it had said"


@pytest.mark.full
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_session_goes_on_without_the_command(captures, number):
    command = started("process", "captures", "--jobs", "2")
    until(lambda: len(list(Path("out").glob("captures/*/.rgbn/running.log"))) == 2)
    children = psutil.Process(command.pid).children()
    assert len(children) >= 2
    # To the command alone, as a service's end is; a terminal tells all.
    command.send_signal(number)
    _, said = command.communicate(timeout=60)
    assert command.returncode == (130 if number == signal.SIGINT else -number)
    assert not psutil.wait_procs(children, 30)[1]
    assert not list(Path("out").rglob("summary.json")), "they were ended, not waited for"
    assert "Traceback" not in said
    if number == signal.SIGINT:
        assert said.strip().endswith("the same command goes on from there.")
    assert not Path("out/captures/x-y").exists(), "none is begun any more"


@pytest.mark.full
def test_processes_of_their_own_go_on_where_they_were_stopped(captures):
    """Ctrl-C as a terminal sends it, to all; then the same command does the rest, two at a time."""
    command = started("process", "captures", start_new_session=True)
    until(lambda: list(Path("out").glob("captures/a/.rgbn/running.log")))
    os.killpg(command.pid, signal.SIGINT)
    said = command.communicate(timeout=60)[1]
    assert command.returncode == 130
    assert "Traceback" not in said
    again = started("process", "captures", "--jobs", "2", "--json")
    printed, said = again.communicate(timeout=300)
    assert again.returncode == 2
    rows = json.loads(printed)
    assert {row["name"]: bool(row["fault"]) for row in rows} == {name: name == "broken" for name in NAMES}
    assert "Traceback" not in said
