"""Datasets of others join the list and the tables; programs of others join with one line."""

import json
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from scipy.io import loadmat

from experiments.datasets import run_methods as run_module
from experiments.datasets.run_methods import grid, run
from experiments.datasets.shelf import add, entries, families_markdown
from lab.options import Solving
from scene.errors import SceneError

RGBN = [str(Path(sys.executable).parent / "rgbn"), "dataset"]
PROGRAM = """
import sys
from pathlib import Path
import cv2, numpy as np
data, out, calls = map(Path, sys.argv[1:])
with open(calls / "log", "a") as file:
    file.write("x")
if "dented" in sys.argv[0]:
    sys.exit("no weights here")
gray = np.stack([cv2.imread(str(data / name), -1).mean(-1) for name in (data / "filenames.txt").read_text().split()])
gray /= np.loadtxt(data / "light_intensities.txt").mean(1)[:, None, None]
normals = np.einsum("if,fhw->hwi", np.linalg.pinv(np.loadtxt(data / "light_directions.txt")), gray)
np.save(out / "normals.npy", normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9))
"""
GAPS = """
normals = np.load(out / "normals.npy")
normals[:, :20] = np.nan
np.save(out / "normals.npy", normals)
"""


def test_the_guide_shows_the_families_as_they_are(tmp_path):
    guide = Path(__file__).parents[3] / "docs" / "guide" / "datasets.md"
    assert families_markdown(entries(tmp_path)) in guide.read_text()


@pytest.mark.full
def test_what_is_at_fault_is_not_added(dented, tmp_path):
    lights = dented / "light_directions.txt"
    np.savetxt(lights, np.loadtxt(lights) * [1, -1, 1])
    shelf = tmp_path / "shelf"
    done = subprocess.run(
        [*RGBN, "add", str(dented), "--shelf", str(shelf)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "not added, light_directions.txt: y points down" in done.stderr
    assert "Traceback" not in done.stderr
    assert not shelf.exists()


@pytest.mark.full
def test_copied_or_linked_it_is_listed_and_must_not_change(dented, tmp_path):
    shelf = tmp_path / "shelf"
    copied = add(shelf, dented, text="a dented ball")
    linked = add(shelf, dented, name="by-link", link=True)
    assert copied.folder == shelf / "dented"
    assert linked.folder == dented
    assert [one.name for one in entries(shelf) if one.state == "added"] == ["by-link", "dented"]
    for taken in ("dented", "pear-roughness-0.30"):
        with pytest.raises(SceneError, match="the name is taken"):
            add(shelf, dented, name=taken)
    picture = dented / "003.png"
    picture.write_bytes(picture.read_bytes() + b" ")
    how = {"solving": Solving("ls"), "out": tmp_path / "out"}
    assert [row["status"] for row in run(shelf, ["dented"], **how)] == ["ok"]
    with pytest.raises(SceneError, match=r"003.png has changed, since it was put on the shelf"):
        run(shelf, ["by-link"], **how)
    with pytest.raises(SceneError, match=r"pear-roughness-0.30: is in the catalogue, but not made yet"):
        run(shelf, ["pear-roughness-0.30"], **how)


@pytest.mark.full
def test_a_dataset_with_a_recipe_of_its_own_is_listed_once(dented, tmp_path):
    """Whatever lies in it; even under a name that one of ours might have."""
    (dented / "recipe.json").write_text('{"flour": "500 g"}')
    shelf = tmp_path / "shelf"
    for name in ("bread", "pear-roughness-0.30-48px"):
        add(shelf, dented, name=name)
    (shelf / "by-hand").mkdir()
    (shelf / "by-hand" / "recipe.json").write_text("no json")
    found = [(one.name, one.state) for one in entries(shelf) if one.state]
    assert found == [("bread", "added"), ("pear-roughness-0.30-48px", "added")]
    assert [row["status"] for row in run(shelf, [], solving=Solving("ls"), out=tmp_path / "out")] == ["ok", "ok"]


@pytest.mark.full
@pytest.mark.parametrize("killed_at", ["experiments.datasets.shelf.write_json", "os.replace"])
def test_what_was_killed_while_it_was_added_can_be_added_again(dented, tmp_path, monkeypatch, killed_at):
    def kill(*_):
        raise KeyboardInterrupt

    shelf = tmp_path / "shelf"
    with monkeypatch.context() as patch:
        patch.setattr(killed_at, kill)
        with pytest.raises(KeyboardInterrupt):
            add(shelf, dented)
    add(shelf, dented)
    assert [one.name for one in entries(shelf) if one.state] == ["dented"]
    assert [row["status"] for row in run(shelf, ["dented"], solving=Solving("ls"), out=tmp_path / "out")] == ["ok"]


def test_a_stopped_run_keeps_the_methods_that_were_done(dented, tmp_path, monkeypatch):
    shelf, asked = tmp_path / "shelf", []
    add(shelf, dented)

    def counted(name, *more):
        asked.append(name)
        if asked == ["ls", "iterative"]:
            raise KeyboardInterrupt
        return row_of(name, *more)

    row_of = run_module._row
    monkeypatch.setattr(run_module, "_row", counted)
    with pytest.raises(KeyboardInterrupt):
        run(shelf, ["dented"], solving=Solving("ls,iterative"), out=tmp_path / "out")
    rows = run(shelf, ["dented"], solving=Solving("ls,iterative"), out=tmp_path / "out")
    assert asked == ["ls", "iterative", "iterative"]
    assert [(row["method"], row["status"]) for row in rows] == [("ls", "ok"), ("iterative", "ok")]


@pytest.mark.full
def test_a_program_that_was_changed_runs_again(dented, tmp_path):
    shelf, calls, program = tmp_path / "shelf", tmp_path / "calls", tmp_path / "program.py"
    add(shelf, dented)
    calls.mkdir()
    command = f"Fine={shlex.quote(sys.executable)} {program} {{data}} {{out}} {calls}"

    def mean_deg():
        return run(shelf, [], solving=Solving("ls", external=(command,)), out=tmp_path / "out")[1]["mean_deg"]

    program.write_text(PROGRAM)
    first, again = mean_deg(), mean_deg()
    program.write_text(PROGRAM.replace("normals /", "normals * [1, 1, 2] /"))
    assert first == again < mean_deg() - 5
    assert (calls / "log").read_text() == "xx"


@pytest.mark.full
def test_programs_join_the_table_and_run_once(dented, tmp_path):
    shelf, out, calls = tmp_path / "shelf", tmp_path / "out", tmp_path / "calls"
    calls.mkdir()
    add(shelf, dented)
    (tmp_path / "fine.py").write_text(PROGRAM + GAPS)
    (tmp_path / "dented.py").write_text(PROGRAM)

    def command(name):
        return f"{name.capitalize()}={shlex.quote(sys.executable)} {tmp_path / name}.py {{data}} {{out}} {calls}"

    words = [*RGBN, "run", command("fine"), "--shelf", str(shelf), "--out", str(out), "--method", "ls"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = run(
        shelf,
        [],
        solving=Solving(
            "ls",
            external=(
                command("fine"),
                command("dented"),
            ),
            external_timeout_s=60.0,
        ),
        out=out,
    )
    assert (calls / "log").read_text() == "xx", "the first program's result was kept"
    by_method = {row["method"]: row for row in rows}
    assert by_method["ls"]["status"] == by_method["Fine"]["status"] == "ok"
    assert "no weights here" in by_method["Dented"]["status"]
    table = parquet.read_table(out / "results.parquet").to_pylist()
    assert [row["mean_deg"] for row in table] == [row.get("mean_deg") for row in rows]
    assert "Dented: failed" in (out / "results.txt").read_text()
    # The figure itself, by the test's own hand: pinv on the files.
    import cv2

    names = (dented / "filenames.txt").read_text().split()
    gray = np.stack([cv2.imread(str(dented / name), -1).mean(-1) for name in names])
    gray /= np.loadtxt(dented / "light_intensities.txt").mean(1)[:, None, None]
    normals = np.einsum("if,fhw->hwi", np.linalg.pinv(np.loadtxt(dented / "light_directions.txt")), gray)
    truth = loadmat(dented / "Normal_gt.mat")["Normal_gt"]
    mask = np.any(truth != 0, -1)
    answered = mask & (np.arange(mask.shape[1]) >= 20)
    cosine = np.sum(normals * truth, -1)[answered] / np.linalg.norm(normals[answered], axis=1)
    expected = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    fine, gaps = by_method["Fine"], 1 - answered.sum() / mask.sum()
    assert fine["mean_deg"] == pytest.approx(expected.mean(), abs=0.05)
    assert fine["pixels"] == answered.sum()
    assert fine["unanswered"] == pytest.approx(gaps)
    assert fine["filled_deg"] == pytest.approx((1 - gaps) * expected.mean() + gaps * 90, abs=0.05)
    codes = cv2.imread(str(fine["map"]), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(codes != 65535, answered)
    np.testing.assert_allclose(codes[answered] / 100, expected, atol=0.1)


def test_means_are_over_what_all_have_solved():
    rows = [
        {"dataset": dataset, "method": method, "status": "ok" if value else "failed", "mean_deg": value}
        for dataset, values in {"a": (1, 3), "b": (5, None), "c": (3, 9)}.items()
        for method, value in zip("xy", values, strict=True)
    ]
    methods, lines = grid(rows)
    assert methods == ["x", "y"]
    assert lines[1] == ("b", [5, None])
    assert lines[-1] == ("mean of 2", [2.0, 6.0])


def test_check_as_json(dented):
    done = subprocess.run([*RGBN, "check", str(dented), "--json"], capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    assert found["ok"]
    assert found["facts"]["photographs"] == 12
    assert found["facts"]["agreement"] > 0.999
