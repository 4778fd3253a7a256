"""Laws of the output folder: nothing of others is written over or removed, and what is done is known by its content."""

import json
import os
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from scene.current import fingerprint
from scene.errors import SceneError
from scene.files import create_array, move, remove, write_text
from scene.output_folder import open_record, read_record

ROOT = Path(__file__).parents[2]


def contents(folder):
    """Return every file below a folder with its bytes, the record apart."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".rgbn" not in path.parts
    }


def work(folder, mark="1", names=("a.txt", "b/c.txt"), text="made", after=()):
    """Do a work that writes some files, unless it is current; return whether it was done."""
    with open_record(folder) as record:
        if record.is_current("work", mark):
            return False
        with record.making("work", mark, after):
            for name in names:
                write_text(record.folder / name, f"{text} {name}")
        return True


NAMES = ("a.txt", "b/c.txt", "frames/codes.npy", "b/notes.txt", "mine.tmp", ".hidden", "b/d/e.png")


@pytest.mark.parametrize("seed", range(10_000, 10_040))
def test_what_others_put_into_any_folder_stays(tmp_path, seed):
    """Whatever lies where, and whenever it was put there: each foreign file is there afterwards, byte for byte."""
    generator = np.random.default_rng(seed)
    out = tmp_path / "out"
    theirs, refusals = {}, []

    def put():
        for name in generator.choice(NAMES, generator.integers(0, 4), replace=False):
            path = out / name
            if any(parent.is_file() for parent in path.parents) or path.is_dir():
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(generator.bytes(9))
            theirs[str(path)] = path.read_bytes()

    if generator.random() < 0.4:
        put()
    for turn in range(4):
        names = [name for name in NAMES if generator.random() < 0.5]
        try:
            work(out, mark=str(turn), names=names, text=str(turn))
        except SceneError as error:
            refusals.append(str(error))
        for name, content in theirs.items():
            assert Path(name).read_bytes() == content, name
        put()
    assert all("rgbn did not" in text or "was changed after rgbn wrote it" in text for text in refusals)


def test_a_folder_with_anything_in_it_is_refused_and_stays_as_it_is(tmp_path):
    for kind in ("file", "folder", "link", "broken link"):
        out = tmp_path / kind
        out.mkdir()
        if kind == "file":
            (out / "photograph.dng").write_bytes(b"raw")
        elif kind == "folder":
            (out / "twin").mkdir()
        else:
            (out / "twin").symlink_to(ROOT / "scene" if kind == "link" else "nowhere")
        before = sorted(os.listdir(out))
        with pytest.raises(SceneError, match=r"is not empty .* nothing was written or removed"):
            work(out)
        assert sorted(os.listdir(out)) == before


def test_inputs_and_outputs_are_kept_apart(tmp_path):
    session = tmp_path / "session"
    session.mkdir()
    for out in (session, session / "out", session / "a" / "b"):
        with (
            pytest.raises(SceneError, match="which is read; rgbn writes nothing there"),
            open_record(out, input_folders=[session]),
        ):
            pass
    assert not list(session.iterdir())
    link = tmp_path / "link"
    link.symlink_to(session)
    with pytest.raises(SceneError, match="which is read"), open_record(link / "out", input_folders=[session]):
        pass
    with open_record(tmp_path / "session-out", input_folders=[session]):
        pass
    # A result is no input of the run that makes it anew.
    work(tmp_path / "made")
    with (
        pytest.raises(SceneError, match="is an input, and one of the results"),
        open_record(tmp_path / "made", inputs=[tmp_path / "made" / "a.txt"]),
    ):
        pass
    assert (tmp_path / "made" / "a.txt").exists()


def test_a_link_is_another_name_of_the_folder_that_it_names(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    assert work(tmp_path / "out")
    assert not work(tmp_path / "disk")
    with open_record(tmp_path / "out"), pytest.raises(SceneError, match="another run"):
        work(tmp_path / "disk")
    (tmp_path / "circle").symlink_to("circle")
    with pytest.raises(SceneError, match="cannot be used"):
        work(tmp_path / "circle")


def test_a_link_in_the_place_of_a_result_is_not_followed(tmp_path):
    out = tmp_path / "out"
    work(out)
    (tmp_path / "photograph").write_text("made a.txt")
    (out / "a.txt").unlink()
    (out / "a.txt").symlink_to(tmp_path / "photograph")
    with pytest.raises(SceneError, match="was changed after rgbn wrote it"):
        work(out, mark="2", text="new")
    assert (tmp_path / "photograph").read_text() == "made a.txt"


def test_one_run_leaves_alone_what_another_one_is_writing(tmp_path):
    """A run in a folder removed the unfinished files of a run in a folder within."""
    with open_record(tmp_path / "nest"):
        pass
    with open_record(tmp_path / "nest" / "inner") as inner:
        with create_array(inner.folder / "codes.npy", (9,), np.uint8) as array:
            with open_record(tmp_path / "nest"):
                pass
            array[:] = 7
        assert (np.load(inner.folder / "codes.npy") == 7).all()
    assert work(tmp_path / "nest", names=("inner/mine.txt",))
    with open_record(tmp_path / "nest") as record:
        record.forget(["work"])
    assert contents(tmp_path / "nest").keys() == {"inner/codes.npy"}


def test_a_result_that_was_changed_is_not_current_and_not_written_over(tmp_path):
    out = tmp_path / "out"
    work(out)
    assert not work(out)
    status = (out / "a.txt").stat()
    (out / "a.txt").write_text("MADE a.txt")
    os.utime(out / "a.txt", ns=(status.st_atime_ns, status.st_mtime_ns))
    assert (out / "a.txt").stat().st_size == status.st_size
    with pytest.raises(SceneError, match=r"a.txt: was changed after rgbn wrote it"):
        work(out)
    assert (out / "a.txt").read_text() == "MADE a.txt"
    (out / "a.txt").unlink()
    assert work(out)
    # Only touched, it is what it was.
    os.utime(out / "a.txt")
    assert not work(out)


def test_an_input_is_known_by_its_content_where_size_and_time_are_kept(tmp_path):
    one, two, out = tmp_path / "one.dng", tmp_path / "two.dng", tmp_path / "out"
    one.write_bytes(b"1" * 99)
    two.write_bytes(b"2" * 99)
    for path in (one, two):
        os.utime(path, ns=(10**18, 10**18))

    def mark():
        with open_record(out) as record:
            return fingerprint([one, two], digest=record.digest)

    before = mark()
    assert mark() == before
    three = tmp_path / "three"
    one.rename(three)
    two.rename(one)
    three.rename(two)
    assert one.stat().st_mtime_ns == 10**18
    assert mark() != before, "the two photographs have changed places"


def test_what_is_forgotten_goes_with_what_was_made_from_it_and_no_more(tmp_path):
    with open_record(tmp_path / "out") as record:
        for name in ("first", "second", "third"):
            with record.making(name, "1"):
                write_text(record.folder / name / "file.txt", name)
        write_text(record.folder / "summary.txt", "of no work")
        with record.making("second", "2", after=["third"]):
            # A file that an earlier work has made stays that one's.
            write_text(record.folder / "first" / "file.txt", "moved")
        assert set(record.done) == {"first", "second"}
    assert contents(tmp_path / "out") == {"first/file.txt": b"moved", "summary.txt": b"of no work"}
    assert set(read_record(tmp_path / "out").done) == {"first", "second"}
    assert not (tmp_path / "out" / "third").exists()


def test_a_damaged_record_is_told_and_nothing_is_touched(tmp_path):
    out = tmp_path / "out"
    work(out)
    path, before = out / ".rgbn" / "record.json", contents(out)
    whole = json.loads(path.read_text())
    path.with_suffix(".new").write_text('{"format": 2, "fi')
    assert not work(out), "the record that a killed run was writing is no damage"
    faults = (
        {"format": 99},
        {"files": {"x": 3}},
        {"notes": whole["notes"] | {"mine": 1}},
        {"notes": {"x": np.nan}},
        {"digest": ""},
    )
    for text in ("{", "", "[1]", "[" * 9999, *(json.dumps(whole | fault) for fault in faults)):
        path.write_text(text)
        with pytest.raises(SceneError, match=r"record.json: cannot be read"):
            work(out, mark="2")
        assert contents(out) == before


def test_a_record_that_cannot_be_opened_is_told(tmp_path):
    (tmp_path / "out" / ".rgbn" / "record.json").mkdir(parents=True)
    with pytest.raises(SceneError, match=r"record.json: cannot be read"):
        work(tmp_path / "out")


KILLED = """
import os, sys
from pathlib import Path
from scene import files, record
from scene.output_folder import open_record

moment = count = 0
def step():
    global count
    count += 1
    if count == moment:
        os.kill(os.getpid(), 9)
def around(function):
    def call(*arguments, **named):
        step()
        found = function(*arguments, **named)
        step()
        return found
    return call
record.os.replace = around(os.replace)
record.Record.save = around(record.Record.save)
Path.unlink = around(Path.unlink)

def run(folder, killed_at):
    global moment
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    moment = killed_at
    for mark in "12":
        with open_record(folder) as held:
            for name in ("a", "b"):
                if not held.is_current(name, mark):
                    with held.making(name, mark, after=["b"] if name == "a" else []):
                        for number in range(2):
                            files.write_text(held.folder / name / f"{number}.txt", f"{mark} {name} {number}")
    os._exit(0)

root = Path(sys.argv[1])
assert run(root / "whole", 0) == 0
for killed_at in range(1, 200):
    first, again = run(root / str(killed_at), killed_at), run(root / str(killed_at), 0)
    print(first, again)
    if first == 0:
        break
"""


@pytest.mark.full
def test_killed_at_every_moment_the_same_command_ends_with_the_same_files(tmp_path):
    """Between any two steps of the file system."""
    command = [sys.executable, "-c", KILLED, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    codes = [tuple(map(int, line.split())) for line in done.stdout.splitlines()]
    assert len(codes) > 40
    assert {first for first, _ in codes[:-1]} == {-signal.SIGKILL}
    assert codes[-1] == (0, 0), "the last moment is after the end"
    assert {again for _, again in codes} == {0}
    expected = contents(tmp_path / "whole")
    for moment in range(1, len(codes) + 1):
        assert contents(tmp_path / str(moment)) == expected


def test_a_folder_takes_its_place_at_once(tmp_path):
    with open_record(tmp_path / "out") as record:
        source = record.scratch("unfinished")
        for name in ("a.txt", "b/c.txt"):
            write_text(source / name, name)
        with record.making("work", "1"):
            move(source, record.folder / "made")
        assert record.is_current("work", "1")
        remove(record.folder / "made" / "a.txt")
        assert not record.files_of("work")[1:]
        (record.folder / "made" / "mine.txt").write_text("mine")
        with pytest.raises(SceneError, match="rgbn did not write it"):
            remove(record.folder / "made" / "mine.txt")


def test_what_is_finished_stays_where_its_place_is_taken(tmp_path):
    """Hours of rendering."""
    with open_record(tmp_path / "out") as record:
        source = record.scratch("unfinished") / "frames.npy"
        write_text(source, "rendered")
        (record.folder / "frames.npy").write_text("mine")
        with pytest.raises(SceneError, match="rgbn did not write it"):
            move(source, record.folder / "frames.npy")
        assert source.read_text() == "rendered"


@pytest.mark.parametrize("held", [True, False])
def test_the_longest_names_that_a_file_system_takes_are_written(tmp_path, held):
    with open_record(tmp_path / "out") if held else nullcontext():
        for name in (250 * "n" + ".txt", 83 * "名" + ".txt", os.fsdecode(b"M\xfcnchen.txt")):
            write_text(tmp_path / "out" / name, "text")
            assert (tmp_path / "out" / name).read_text() == "text"


def test_a_file_of_the_users_that_is_named_is_not_written_over(tmp_path):
    """`rgbn rig --out` beside the session."""
    (tmp_path / "scan.ply").write_text("mine")
    with open_record(tmp_path / "out"):
        with pytest.raises(SceneError, match="is there already, and rgbn did not write it"):
            write_text(tmp_path / "scan.ply", "ours")
        write_text(tmp_path / "mesh.ply", "first")
    with open_record(tmp_path / "out"):
        write_text(tmp_path / "mesh.ply", "second")
    assert (tmp_path / "scan.ply").read_text() == "mine"
    assert (tmp_path / "mesh.ply").read_text() == "second"
    assert json.loads((tmp_path / "out" / ".rgbn" / "record.json").read_text())["format"] == 4
