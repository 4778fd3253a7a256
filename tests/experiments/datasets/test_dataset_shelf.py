"""Datasets of others join the list and the table; programs of others join with one line; one page shows all."""

import csv
import re
import shlex
import sys
import tomllib

import numpy as np
import pytest
import yaml

from experiments.datasets import run_methods as run_module
from experiments.datasets.run_methods import results_text, run
from experiments.datasets.shelf import add, entries
from fixtures.lit_surfaces import dome, even_cap, lights_along, matte
from formats.diligent_layout import write_diligent
from lab.options import Solving
from scene.errors import SceneError
from scene.frames import Frames
from tests.conftest import ROOT

PROGRAM = """
import sys
from pathlib import Path
import cv2, numpy as np
data, out, calls = map(Path, sys.argv[1:])
with open(calls / "log", "a") as file:
    file.write("x")
if "striped" in sys.argv[0]:
    sys.exit("no <b>weights</b> here")
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


@pytest.fixture
def striped(tmp_path):
    """The folder of a small dataset of our own truth: a striped ball under twelve uneven lights, seen straight."""
    normals, mask = dome(44, rim=0.07)
    rng = np.random.default_rng(10001)
    lights = lights_along(even_cap(12, 60.0), rng.uniform(0.4, 1.6, (12, 1)) * rng.uniform(0.9, 1.1, (12, 3)))
    albedo = 0.2 + 0.2 * ((np.arange(44) // 6) % 2)[None, :, None] * np.array([1.0, 0.6, 0.3])
    folder = tmp_path / "striped"
    write_diligent(folder, Frames.from_linear(lights.names, matte(lights, normals, normals, albedo)), lights, mask)
    # A .mat file is read in a process of its own, which takes half a second each time.
    np.savetxt(folder / "normal.txt", normals.reshape(-1, 3))
    return folder


@pytest.fixture
def command(tmp_path):
    """Return what writes a program, and the words that start it."""
    (tmp_path / "calls").mkdir()

    def written(name, text=PROGRAM):
        (tmp_path / f"{name}.py").write_text(text)
        words = f"{shlex.quote(sys.executable)} {tmp_path / name}.py {{data}} {{out}} {tmp_path / 'calls'}"
        return f"{name.capitalize()}={words}"

    return written


def test_what_is_at_fault_is_not_added(striped, tmp_path):
    lights = striped / "light_directions.txt"
    np.savetxt(lights, np.loadtxt(lights)[:-1])
    with pytest.raises(SceneError, match=r"not added, .*light_directions.txt has 11 lights"):
        add(tmp_path / "shelf", striped)
    assert not (tmp_path / "shelf").exists()


def test_what_is_added_is_listed_and_must_not_change(striped, tmp_path):
    shelf = tmp_path / "shelf"
    # Whatever lies in it; even under a name that one of ours might have.
    (striped / "recipe.json").write_text('{"flour": "500 g"}')
    assert add(shelf, striped, text="a striped ball").folder == striped
    add(shelf, striped, name="pear-roughness-0.30-48px")
    found = [(one.name, one.state) for one in entries(shelf) if one.state]
    assert found == [("pear-roughness-0.30-48px", "added"), ("striped", "added")]
    other = tmp_path / "other"
    other.mkdir()
    for name, folder in (("striped", other), ("pear-roughness-0.30", striped)):
        for path in striped.iterdir():
            (folder / path.name).write_bytes(path.read_bytes())
        with pytest.raises(SceneError, match="the name is taken"):
            add(shelf, folder, name=name)
    how = {"solving": Solving("ls"), "out": tmp_path / "out"}
    assert [row["status"] for row in run(shelf, [], **how)] == ["ok", "ok"]
    (striped / "003.png").write_bytes((striped / "003.png").read_bytes() + b" ")
    with pytest.raises(SceneError, match=r"003.png is not as it was when the dataset was put on the shelf"):
        run(shelf, ["striped"], **how)
    with pytest.raises(SceneError, match=r"pear-roughness-0.30: is in the catalogue, but not made yet"):
        run(shelf, ["pear-roughness-0.30"], **how)


def test_what_was_killed_while_it_was_added_can_be_added_again(striped, tmp_path, monkeypatch):
    def kill(*_):
        raise KeyboardInterrupt

    shelf = tmp_path / "shelf"
    with monkeypatch.context() as patch:
        patch.setattr("experiments.datasets.shelf.write_json", kill)
        with pytest.raises(KeyboardInterrupt):
            add(shelf, striped)
    add(shelf, striped)
    assert [one.name for one in entries(shelf) if one.state] == ["striped"]


def test_a_stopped_run_keeps_the_methods_that_were_done(striped, tmp_path, monkeypatch):
    shelf, asked = tmp_path / "shelf", []
    add(shelf, striped)

    def counted(name, *more):
        asked.append(name)
        if asked == ["ls", "iterative"]:
            raise KeyboardInterrupt
        return row_of(name, *more)

    row_of = run_module._row
    monkeypatch.setattr(run_module, "_row", counted)
    with pytest.raises(KeyboardInterrupt):
        run(shelf, ["striped"], solving=Solving("ls,iterative"), out=tmp_path / "out")
    rows = run(shelf, ["striped"], solving=Solving("ls,iterative"), out=tmp_path / "out")
    assert asked == ["ls", "iterative", "iterative"]
    assert [(row["method"], row["status"]) for row in rows] == [("ls", "ok"), ("iterative", "ok")]


@pytest.mark.full
def test_a_program_that_was_changed_runs_again(striped, tmp_path, command):
    shelf, words = tmp_path / "shelf", command("fine")
    add(shelf, striped)

    def mean_deg():
        return run(shelf, [], solving=Solving("ls", external=(words,)), out=tmp_path / "out")[1]["mean_deg"]

    first, again = mean_deg(), mean_deg()
    command("fine", PROGRAM.replace("gray)\nnp.save", "gray ** 0.3)\nnp.save"))
    assert first == again < mean_deg() - 5
    assert (tmp_path / "calls" / "log").read_text() == "xx"


def test_programs_join_the_table_and_what_fails_is_told(striped, tmp_path, command):
    shelf, out = tmp_path / "shelf", tmp_path / "out"
    add(shelf, striped, text="the <first> one")
    programs = (command("fine", PROGRAM + GAPS), command("striped"))
    rows = run(shelf, [], solving=Solving("ls", external=programs, external_timeout_s=60.0), out=out)
    assert (tmp_path / "calls" / "log").read_text() == "xx"
    by_method = {row["method"]: row for row in rows}
    assert by_method["ls"]["status"] == by_method["Fine"]["status"] == "ok"
    assert "weights</b> here" in by_method["Striped"]["status"]
    with (out / "results.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [(one["dataset"], one["method"]) for one in table] == [(row["dataset"], row["method"]) for row in rows]
    assert "striped, Striped: failed" in results_text(rows)
    # The figure itself, by the test's own hand: pinv on the files.
    import cv2

    names = (striped / "filenames.txt").read_text().split()
    gray = np.stack([cv2.imread(str(striped / name), -1).mean(-1) for name in names])
    gray /= np.loadtxt(striped / "light_intensities.txt").mean(1)[:, None, None]
    normals = np.einsum("if,fhw->hwi", np.linalg.pinv(np.loadtxt(striped / "light_directions.txt")), gray)
    truth = np.loadtxt(striped / "normal.txt").reshape(44, 44, 3)
    mask = np.any(truth != 0, -1)
    answered = mask & (np.arange(mask.shape[1]) >= 20)
    cosine = np.sum(normals * truth, -1)[answered] / np.linalg.norm(normals[answered], axis=1)
    expected = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    fine, gaps = by_method["Fine"], 1 - answered.sum() / mask.sum()
    assert (fine["mean_deg"], fine["pixels"]) == (pytest.approx(expected.mean(), abs=0.05), answered.sum())
    assert fine["filled_deg"] == pytest.approx((1 - gaps) * expected.mean() + gaps * 90, abs=0.05)
    # The page stands alone, and escapes what others wrote.
    page = (out / "index.html").read_text()
    assert "default-src 'none'" in page
    sources = re.findall(r'src="([^"]+)"', page)
    assert len(sources) == 2 + 2
    assert all(source.startswith("data:image/") for source in sources)
    assert "<b>weights" not in page
    assert f'data-value="{fine["filled_deg"]!r}"' in page


def test_means_are_over_what_all_have_solved():
    rows = [
        {"dataset": dataset, "method": method, "status": "ok" if value else "failed", "mean_deg": value}
        for dataset, values in {"a": (1, 3), "b": (5, None), "c": (3, 9)}.items()
        for method, value in zip("xy", values, strict=True)
    ]
    lines = [line.split() for line in results_text(rows).splitlines()]
    assert lines[0][-2:] == ["x", "y"]
    assert lines[2] == ["b", "5.00", "failed"]
    assert lines[4] == ["mean", "of", "2", "2.00", "6.00"]


def test_the_citation_file_names_the_benchmark():
    """The fields that version 1.2.0 of the format requires, and the work that this project follows."""
    found = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert set(found) >= {"cff-version", "message", "title", "authors"}
    assert found["version"] == tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    (benchmark,) = (one for one in found["references"] if one["title"] == "An RGBN Benchmark")
    assert [author["family-names"] for author in benchmark["authors"]] == ["Berkiten", "Rusinkiewicz"]


@pytest.mark.full
def test_a_dataset_is_added_at_the_command_line(striped, tmp_path, rgbn_process):
    done = rgbn_process("dataset", "add", striped, "--shelf", tmp_path / "shelf")
    assert (done.returncode, "12" in done.stdout) == (0, True)
