"""An output folder belongs to one session: no order of verbs, places and names loses the results of another."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.job import Outcome
from lab.options import Settings, Solving
from lab.run import STEPS, run_session, session_and_out
from scene.errors import SceneError
from scene.files import write_text
from scene.output_folder import open_record, read_record

KEPT = {"check": "frames", "calibrate": "lights", "align": "mask", "trust": "trust", "compare": "report"}


@pytest.fixture
def quick(monkeypatch, tmp_path, no_report):
    """Steps that write what they are told, and nothing else; the working directory is empty."""

    def work(name):
        def write(job):
            about = f"{name} of {job.session.flash[0].read_text()}"
            if name in ("solve", "twin"):
                for method in job.methods:
                    write_text(job.store.path(name, method), f"{about} by {method}, {job.profile}")
                return Outcome({"methods": {method: {"profile": job.profile} for method in job.methods}})
            write_text(job.store.path(KEPT[name]), about)
            return Outcome({"model": "distant"})

        return write

    for name in ("check", "calibrate", "align", "solve", "trust", "twin", "compare"):
        monkeypatch.setitem(STEPS, name, replace(STEPS[name], work=work(name)))
    monkeypatch.setitem(STEPS, "results", replace(STEPS["results"], work=lambda job: Outcome({})))
    monkeypatch.setattr("lab.run.write_tables", lambda *_: [])
    (tmp_path / "desk").mkdir()
    monkeypatch.chdir(tmp_path / "desk")
    return tmp_path


def photographed(folder: Path, text: str) -> Path:
    """Write a session of four photographs, all others than those of another text."""
    folder.mkdir(parents=True)
    for number in range(4):
        (folder / f"{number}.png").write_text(f"{text} {number}")
    (folder / "session.toml").write_text('name = "vase"\n[frames]\nflash = "*.png"\nlinear = true\n')
    return folder


def results(out):
    """Return what is in an output folder but for what is written at each run."""
    paths = [path for path in out.rglob("*") if path.is_file() and ".rgbn" not in path.parts]
    changing = ("summary.json", "rgbn.log", "session.json")
    return {path.relative_to(out).as_posix(): path.read_text() for path in paths if path.name not in changing}


def test_two_sessions_of_one_name_have_two_folders(quick, capsys):
    may, june = photographed(quick / "may" / "vase", "may"), photographed(quick / "june" / "vase", "june")
    run_session(may, "compare")
    before = results(Path("out/vase"))
    assert before["solve/ls"] == "solve of may 0 by ls, default"
    run_session(june, "check")
    assert results(Path("out/vase")) == before
    assert results(Path("out/vase-2")) == {"frames": "check of june 0"}
    assert f"the results of {june} go to out/vase-2" in capsys.readouterr().err
    for out in ("out/vase", Path("out/vase").resolve()):
        with pytest.raises(SceneError, match=f"holds the results of the session {may}, not of the session {june}"):
            run_session(june, "check", out=Path(out))
    assert results(Path("out/vase")) == before
    # Each goes on where it was, from wherever it is named.
    run_session(june, "calibrate")
    run_session(Path("out/vase-2"), "align")
    assert set(results(Path("out/vase-2"))) == {"frames", "lights", "mask"}
    shutil.rmtree("out/vase")
    run_session(june, "check")
    assert set(results(Path("out/vase-2"))) == {"frames", "lights", "mask"}
    assert not Path("out/vase").exists()


def test_other_photographs_in_the_same_folder_are_another_session_and_some_more_are_not(quick):
    folder = photographed(quick / "hot", "monday")
    run_session(folder, "solve")
    before = results(Path("out/vase"))
    (folder / "9.png").write_text("one more")
    (folder / "1.png").write_text("taken again")
    run_session(folder, "solve")
    assert results(Path("out/vase")) == before, "the first photograph is the same"
    for path in folder.glob("*.png"):
        path.write_text(f"tuesday {path.name}")
    with pytest.raises(SceneError, match=r"results of other photographs, which lay in .*hot before"):
        run_session(folder, "check", out=Path("out/vase"))
    run_session(folder, "check")
    assert results(Path("out/vase")) == before
    assert results(Path("out/vase-2"))["frames"].startswith("check of tuesday")


def test_a_folder_is_gone_on_with_as_it_was_made(quick):
    may, out = photographed(quick / "may", "may"), Path("out/vase")
    (quick / "truth.json").write_text("{}")
    said = Settings("position,ls", "seed", truth=quick, engine="many")
    run_session(may, "compare", said=said)
    before = results(out)
    assert before["solve/position"] == "solve of may 0 by position, seed"
    assert before["mask"] == "align of may 0"
    written = {path: path.stat().st_mtime_ns for path in out.rglob("*") if ".rgbn" not in path.parts}
    for verb in ("solve", "twin", "compare", "align", "check"):
        for source in (may, out):
            summary = run_session(source, verb)
            assert results(out) == before
            told = summary["arguments"]
            assert (told["methods"], told["profile"]) == (["position", "ls"], "seed")
            assert (told["truth"], told["twin"]["engine"]) == (str(quick), "many")
    changing = {out / name for name in ("summary.json", "rgbn.log", ".")}
    assert all(path.stat().st_mtime_ns == then for path, then in written.items() if path not in changing)


def test_what_an_option_removes_is_said(quick, capsys):
    may, out = photographed(quick / "may", "may"), Path("out/vase")
    run_session(may, "compare", said=Solving("position,ls"))
    capsys.readouterr()
    run_session(out, "solve", said=Solving("ls"))
    said = capsys.readouterr().err
    assert "solve: is made anew; removed with what was there before: position, trust, twin, compare\n" in said
    assert set(results(out)) == {"frames", "lights", "mask", "solve/ls"}
    run_session(out, "compare")
    assert {"solve/ls", "twin/ls", "report"} < set(results(out))
    assert "removed" not in capsys.readouterr().err
    # One setting is changed; the others stay, and it can be taken back.
    run_session(out, "compare", said=Settings(profile="seed"))
    assert results(out)["solve/ls"].endswith("by ls, seed")
    run_session(out, "compare", said=Settings(profile="default"))
    assert results(out)["solve/ls"] == "solve of may 0 by ls, default"


SEEDS = [*range(6), *(pytest.param(seed, marks=pytest.mark.full) for seed in range(6, 100))]


@pytest.mark.parametrize("seed", SEEDS)
def test_no_order_of_verbs_sessions_and_folders_loses_results(quick, seed):
    """Random runs and moves of sessions of one name: what was made stays, but what the session makes anew."""
    generator = np.random.default_rng(seed)
    sessions = {text: photographed(quick / text / "vase", text) for text in ("may", "june", "july")}
    owner, asked = {}, {}
    for turn in range(8):
        text = str(generator.choice(list(sessions)))
        if generator.random() < 0.2:
            sessions[text] = Path(shutil.move(sessions[text], quick / f"{text}{turn}"))
        verb = str(generator.choice(["check", "calibrate", "align", "solve", "twin", "compare"]))
        methods = str(generator.choice(["", "position", "ls,l1"])) if verb in ("solve", "twin", "compare") else ""
        mine = [out for out, whose in owner.items() if whose == text]
        source, given = sessions[text], None
        if generator.random() < 0.3:
            given = Path("out") / str(generator.choice(["vase", "vase-2", "mine"]))
        elif mine and generator.random() < 0.4:
            # Its session may have moved, and then cannot be found by the folder alone.
            source = mine[0] if json.loads((mine[0] / "session.json").read_text())["session"] == str(source) else source
        before = {out: results(out) for out in owner}
        went_to = session_and_out(source, given)[1]
        try:
            run_session(source, verb, out=given, said=Solving(methods or None))
        except SceneError:
            assert owner.get(given, text) != text
            assert {out: results(out) for out in owner} == before
            continue
        made = [out for out in Path("out").iterdir() if results(out) != before.get(out)]
        assert len(made) <= 1
        for out in made:
            assert owner.setdefault(out, text) == text
            assert all(f" of {text} 0" in content for content in results(out).values())
            assert out == went_to
            wanted = methods.split(",") if methods else asked.get(out, ["ls", "iterative"])
            for step in ("solve", "twin"):
                there = {name.split("/")[1] for name in results(out) if name.startswith(f"{step}/")}
                assert there in (set(), set(wanted))
            lost = set(before.get(out, {})) - set(results(out))
            assert not lost or methods, f"{lost} without an option that asks for others"
        if methods:
            asked[went_to] = methods.split(",")


def test_links_are_never_written_through(tmp_path):
    """The lock, the record and the folder of both may be a link to a file or a folder of the user's."""
    for name in ("lock", "record.json", "tmp", ""):
        out, mine = tmp_path / f"out{name}", tmp_path / f"mine{name}"
        if name == "tmp" or not name:
            mine.mkdir()
            (mine / "file").write_text("mine")
        else:
            mine.write_text("mine")
        if name:
            with open_record(out) as record, record.making("work", ""):
                write_text(out / "a", "made")
            place = out / ".rgbn" / name
            place.rmdir() if name == "tmp" else place.unlink()
        else:
            out.mkdir()
        os.symlink(mine, out / ".rgbn" / name)
        with pytest.raises(SceneError, match=r"is a link|rgbn did not make it"), open_record(out):
            pass
        assert (mine / "file" if mine.is_dir() else mine).read_text() == "mine"


def test_a_copy_of_a_session_is_another_and_a_moved_one_is_the_same(quick):
    may = photographed(quick / "may" / "vase", "may")
    run_session(may, "solve")
    before = results(Path("out/vase"))
    copy = Path(shutil.copytree(may, quick / "copy" / "vase"))
    run_session(copy, "check")
    assert results(Path("out/vase")) == before
    assert set(results(Path("out/vase-2"))) == {"frames"}
    moved = Path(shutil.move(may, quick / "archive"))
    run_session(moved, "align")
    assert results(Path("out/vase")) == before
    # Another one in the place of the first.
    other = photographed(quick / "may" / "vase", "other")
    run_session(other, "check")
    assert results(Path("out/vase")) == before
    assert results(Path("out/vase-3"))["frames"] == "check of other 0"
    with pytest.raises(SceneError, match="it holds the results of the session"):
        run_session(other, "check", out=Path("out/vase"))


def test_a_setting_that_is_refused_changes_nothing(quick):
    may, out = photographed(quick / "may", "may"), Path("out/vase")
    run_session(may, "solve", said=Solving("position"))
    before = results(out), read_record(out).notes
    for wrong in (Solving("nothing"), Solving(external=("no command",)), Solving(profile="sead")):
        with pytest.raises(SceneError):
            run_session(out, "solve", said=wrong)
        assert (results(out), read_record(out).notes) == before


def test_copies_by_hard_links_do_not_share_their_record(tmp_path):
    """`cp -al`: each goes on, and what one does is not known to the other."""
    first, second = tmp_path / "first", tmp_path / "second"
    with open_record(first) as record, record.making("work", "1"):
        write_text(first / "a", "made")
    shutil.copytree(first, second, copy_function=os.link)
    for folder in (first, second, first):
        for mark in "23":
            with open_record(folder) as record, record.making("work", mark):
                write_text(folder / "a", f"{folder.name} {mark}")
        with open_record(folder) as record:
            assert record.is_current("work", "3")
    assert ((first / "a").read_text(), (second / "a").read_text()) == ("first 3", "second 3")
    # A copy that is made while a run is at work.
    with open_record(first) as record, record.making("work", "4"):
        write_text(first / "a", "begun")
        shutil.copytree(first, tmp_path / "third", copy_function=os.link)
        write_text(first / "b", "done")
    for folder in (first, tmp_path / "third"):
        with open_record(folder) as record, record.making("work", "5"):
            write_text(folder / "a", "again")
