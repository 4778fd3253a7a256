"""`import rgbn`: the same steps as the command line's, run where they are asked for, resumed where they are done."""

import json

import numpy as np
import pytest

import rgbn
from fixtures.bad_input import samples
from rgbn.examples import fixture_folder
from scene.errors import SceneError
from scene.files import plain
from scene.light_text import lights_json
from scene.lights import Lights
from scene.normals import angular_error_deg


@pytest.fixture
def small(tmp_path):
    """A session of known lights with given normals."""
    samples.write_pictures(tmp_path / "session")
    (tmp_path / "session" / "session.toml").write_bytes(samples.toml_bytes(samples.SMALL))
    return tmp_path / "session"


def made(out):
    """Return when each file of results was written."""
    return {path: path.stat().st_mtime_ns for path in out.rglob("*.npy")}


def done(out):
    return list(json.loads((out / "summary.json").read_text())["seconds"])


def test_what_is_asked_for_runs_what_it_needs_and_no_more(small, tmp_path):
    """Nothing on opening; the lights without a solver; what is done and current is not done again."""
    out = tmp_path / "out"
    session = rgbn.open(small, out=out)
    assert not out.exists(), "nothing runs yet"
    lights = session.lights
    assert done(out) == ["check", "calibrate"]
    assert len(lights) == len(session.frames)
    normals = session.normals("ls")
    assert done(out) == ["check", "calibrate", "align", "solve"]
    assert session.methods == ("ls",)
    before = made(out)
    again = rgbn.open(small, out=out)
    assert normals.shape == (*again.mask.shape, 3) == again.truth.shape == again.albedo("ls").shape
    assert again.camera.width == normals.shape[1]
    assert np.array_equal(again.normals("LS"), normals, equal_nan=True), "names in any case"
    assert np.allclose(np.linalg.norm(normals[again.mask & np.isfinite(normals[..., 0])], axis=-1), 1, atol=1e-5)
    assert np.allclose(again.error_deg("ls"), angular_error_deg(normals, again.truth), atol=1e-4, equal_nan=True)
    assert made(out) == before
    assert again.summary["seconds"] == session.summary["seconds"]


def test_verbs_return_the_session_and_methods_add_up(small, tmp_path):
    """`solve` by one more method loses none; `compare` judges all of them."""
    session = rgbn.open(small, out=tmp_path / "out")
    assert session.calibrate() is session
    assert session.solve("ls").solve("iterative").methods == ("ls", "iterative")
    estimate = session.estimate("position")
    assert session.methods == ("ls", "iterative", "position")
    assert np.array_equal(estimate.normals, session.normals("position"), equal_nan=True)
    assert np.array_equal(estimate.albedo, session.albedo("position"), equal_nan=True)
    known = np.isfinite(estimate.normals[..., 0])
    assert (estimate.samples[known] >= 3).all()
    assert (estimate.samples[~session.mask] == 0).all()
    assert estimate.settings == session.summary["solve"]["methods"]["position"]["settings"]
    rows = session.errors.rows()
    assert [row["method"] for row in rows] == ["ls", "iterative", "position"]
    for row in rows:
        assert row["median_deg"] == pytest.approx(np.nanmedian(session.error_deg(row["method"])), abs=1e-4)
    assert session.report.read_text().startswith("<!")
    before = session.report.stat().st_mtime_ns
    assert session.report.stat().st_mtime_ns == before, "a report that is there is not written again"
    with pytest.raises(SceneError, match="unknown"):
        session.solve("best")
    assert session.methods == ("ls", "iterative", "position")


def test_an_output_folder_is_gone_on_with(small, tmp_path):
    """It goes to its session, and stays as it was made: methods, profile."""
    out = tmp_path / "out"
    rgbn.open(small, out=out).solve(rgbn.Solving("ls,l1", profile="seed"))
    before = made(out)
    session = rgbn.open(out)
    assert (session.path, session.out) == (small, out)
    session.normals("l1")
    session.solve()
    assert made(out) == before
    assert session.summary["arguments"]["profile"] == "seed"


def test_lights_are_those_of_the_last_step_that_is_current(small, tmp_path):
    """`align` moves near lights to the object; once its inputs change, its lights are no longer given."""
    names = tuple(f"flash_{index}" for index in range(samples.COUNT))
    toward = 600 * samples.directions()
    beside = np.array([30.0, 0, -500])
    known = Lights(names, samples.directions(), np.ones((samples.COUNT, 3)), beside + toward, beside)
    (small / "lights.json").write_text(json.dumps(plain(lights_json(known))))
    document = {**samples.SMALL, "lights": {"file": "lights.json"}}
    (small / "session.toml").write_bytes(samples.toml_bytes(document))
    session = rgbn.open(small, out=tmp_path / "out")
    amid, aligned = session.lights, session.align().lights
    assert np.array_equal(amid.reference_point_mm, beside)
    assert abs(aligned.reference_point_mm[0]) < 5, "the object is on the axis"
    assert np.array_equal(session.lights.directions, aligned.directions)
    assert np.array_equal(aligned.positions_mm, amid.positions_mm)
    normals = np.load(small / "normals.npy")
    normals[20:22] = 0
    np.save(small / "normals.npy", normals)
    assert "align" in done(tmp_path / "out")
    assert np.array_equal(session.lights.reference_point_mm, beside)


@pytest.mark.parametrize(
    "ask",
    [
        lambda session: session.truth,
        lambda session: session.errors,
        lambda session: session.error_deg("ls"),
        lambda session: session.pose,
        lambda session: session.normals("ls", twin=True),
    ],
)
def test_what_cannot_be_had_is_said_before_anything_runs(small, tmp_path, ask):
    document = {**samples.SMALL, "object": {"mask": "mask.png"}}
    (small / "session.toml").write_bytes(samples.toml_bytes(document))
    with pytest.raises(SceneError, match=r"there is no .*scan = "):
        ask(rgbn.open(small, out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_an_example_is_the_fixture_or_a_part_of_it_and_is_written_over_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    whole, own = files(fixture_folder()), files(rgbn.example("fixture"))
    assert own == whole
    bare = files(rgbn.example("no-session-toml", "mine"))
    assert {*whole} - {*bare} == {"session.toml", "truth.json", "truth.npz"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fixture", "mine"], "nothing unfinished stays"
    for name, place, told in (
        ("fixture", tmp_path / "mine", "is there already"),
        ("fixture", tmp_path / "fixture" / "session.toml", "is there already"),
        ("fixture", tmp_path / "fixture" / "session.toml" / "below", "cannot be written"),
        ("other", tmp_path / "new", "unknown; there are fixture, no-session-toml"),
    ):
        with pytest.raises(SceneError, match=told):
            rgbn.example(name, place)
    assert files(tmp_path / "fixture") == whole
    assert files(tmp_path / "mine") == bare
