"""An output folder remembers its session, from every working directory, and when both are moved."""

import shutil
from pathlib import Path

import pytest

from lab.run import open_job, session_and_out
from scene.errors import SceneError, SessionError

LEAST = '[frames]\nflash = "raw/*.png"\nlinear = true\n'


@pytest.fixture
def lab(tmp_path):
    """A folder that holds a session and its output, in which nothing was run."""
    place = tmp_path / "lab"
    (place / "captures" / "pear" / "raw").mkdir(parents=True)
    for name in ("a", "b", "c"):
        (place / "captures" / "pear" / "raw" / f"{name}.png").write_bytes(b"")
    (place / "captures" / "pear" / "session.toml").write_text(LEAST)
    with open_job(place / "captures" / "pear", out=place / "out" / "pear"):
        pass
    return place


@pytest.mark.parametrize("inside", [".", "out", "out/pear", "captures/pear"])
def test_an_output_folder_leads_to_its_session_from_everywhere(lab, monkeypatch, inside):
    monkeypatch.chdir(lab / inside)
    session, out = lab / "captures" / "pear", lab / "out" / "pear"
    given = Path(*[".."] * len(Path(inside).parts)) / "out" / "pear"
    for path in (given, out):
        assert session_and_out(path) == (session, path)
        assert session_and_out(path, out) == (session, path)
        with pytest.raises(SceneError, match=r"--out other: .*pear is an output folder itself"):
            session_and_out(path, Path("other"))
    for path in (session, session / "session.toml"):
        assert session_and_out(path, given) == (path, given)
        # From inside the session its output lies beside it, not in it.
        beside = session.parent / "out" / "pear" if inside == "captures/pear" else Path("out/pear")
        assert session_and_out(path) == (path, beside)
    if inside == "out/pear":
        assert session_and_out(Path(".")) == (session, Path("."))


def test_both_may_be_moved_together_or_the_output_alone_and_a_copy_has_its_own_session(lab, tmp_path):
    copy = tmp_path / "elsewhere" / "copy"
    shutil.copytree(lab, copy)
    assert session_and_out(copy / "out" / "pear")[0] == copy / "captures" / "pear"
    shutil.move(lab, tmp_path / "moved")
    assert session_and_out(tmp_path / "moved" / "out" / "pear")[0] == tmp_path / "moved" / "captures" / "pear"
    # The folder notes the new places when it is opened, so that each of them is known.
    with open_job(tmp_path / "moved" / "out" / "pear") as job:
        assert job.session.folder == tmp_path / "moved" / "captures" / "pear"
    shutil.move(tmp_path / "moved" / "out" / "pear", tmp_path / "alone")
    assert session_and_out(tmp_path / "alone")[0] == tmp_path / "moved" / "captures" / "pear"


def test_a_session_that_has_gone_is_told_with_where_it_was_sought_and_what_to_do(lab, tmp_path):
    out = lab / "out" / "pear"
    shutil.move(lab / "captures", tmp_path / "gone")
    with pytest.raises(SessionError, match="not at") as caught:
        session_and_out(out)
    assert str(lab / "captures" / "pear") in str(caught.value)
    assert f"rgbn VERB SESSION --out {out}" in str(caught.value)
    # What it says to do, helps from then on.
    with open_job(tmp_path / "gone" / "pear", out=out):
        pass
    assert session_and_out(out)[0] == tmp_path / "gone" / "pear"


@pytest.mark.parametrize(
    "text", ["[", "[]", "{}", '{"session": 3, "relative": 4}', '{"session": ".", "relative": "\\u0000"}']
)
def test_a_damaged_note_is_one_message(lab, text):
    (lab / "out" / "pear" / "session.json").write_text(text)
    with pytest.raises(SessionError, match=r"session\.json"):
        session_and_out(lab / "out" / "pear")


def test_a_session_with_other_files_in_it_is_a_session(lab):
    """A user's own session.json beside session.toml, and a twin, which holds frames/, are no output folders."""
    session = lab / "captures" / "pear"
    (session / "session.json").write_text("{}")
    (session / "frames").mkdir()
    (session / "frames" / "frames.json").write_text("{}")
    assert session_and_out(session, lab / "new") == (session, lab / "new")
