"""A folder of photographs and nothing that tells the lights: normals come all the same, and what that costs is said."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from compare.report.facts import Material
from fixtures.lit_surfaces import even_cap
from lab.job import Job
from lab.options import Settings, Solving
from lab.run import run_session
from rgbn.export_command import export
from scene.errors import CalibrationError, SceneError
from scene.method_names import UNCALIBRATED
from scene.normals import angular_error_deg, unit
from scene.store import Store
from tests.lab.test_foreign_files import make_session

SIZE, COUNT = 120, 14


@pytest.fixture(scope="module")
def dome(tmp_path_factory):
    """(folder, true normals, mask) of an ellipsoid with dents in front of nothing, matte, of two albedos."""
    v, u = np.mgrid[:SIZE, :SIZE]
    x, y = 2.6 * (u - SIZE / 2) / SIZE, -2.6 * (v - SIZE / 2) / SIZE
    mask = x**2 + 1.3 * y**2 < 0.9
    height = np.sqrt(np.maximum(1 - x**2 - 1.3 * y**2, 1e-9)) + 0.05 * np.sin(7 * x) * np.cos(6 * y)
    up, right = -np.gradient(height, axis=0), np.gradient(height, axis=1)
    normals = unit(np.stack([-right, -up, np.full_like(x, 2.6 / SIZE)], -1))
    albedo = np.where(np.sin(4 * x + 1) * np.sin(5 * y) > 0, 0.7, 0.45)
    folder = tmp_path_factory.mktemp("dome")
    for i, toward in enumerate(even_cap(COUNT, 50)):
        image = mask * albedo * np.maximum(normals @ toward, 0)
        cv2.imwrite(str(folder / f"photo_{i:02d}.png"), np.round(image * 65535).astype(np.uint16))
    (folder / "session.toml").write_text('[frames]\nflash = "*.png"\nlinear = true\n')
    return folder, normals, mask


@pytest.fixture(scope="module")
def processed(dome, tmp_path_factory):
    """(output folder, summary) of the whole way with the default methods."""
    out = tmp_path_factory.mktemp("out") / "dome"
    return out, run_session(dome[0], "compare", out=out)


@pytest.mark.full
def test_the_methods_that_need_no_lights_are_taken_and_find_the_surface(dome, processed):
    _, normals, mask = dome
    out, summary = processed
    assert tuple(summary["solve"]["methods"]) == UNCALIBRATED == tuple(summary["arguments"]["methods"])
    inner = mask & Store(out).load_mask()
    assert inner.sum() > 0.9 * mask.sum()
    off = [np.median(angular_error_deg(Store(out).load_normals(name)[inner], normals[inner])) for name in UNCALIBRATED]
    # The sign, too, is right: the outline tells it.
    assert max(off) < 12
    assert min(off) < 4
    texts = [row["text"] for row in summary["warnings"] if row["step"] == "calibrate"]
    assert len(texts) == 1
    for words in ("no ball found", "lights, which are unknown", "ldr, entropy and tv"):
        assert words in texts[0]


@pytest.mark.full
def test_what_is_written_says_unknown_and_holds_no_invented_direction(processed):
    out, summary = processed
    rows = json.loads((out / "lights.json").read_text())
    assert rows["model"] == summary["calibrate"]["model"] == "unknown"
    assert all(row["direction"] is None and row["intensity"] == [1, 1, 1] for row in rows["frames"])
    assert not (out / "light_directions.txt").exists()
    assert not (out / "lights.lp").exists()
    assert (out / "lights.csv").read_text().splitlines()[1].startswith("photo_00,,,,")
    assert "Nothing tells where" in (out / "report.html").read_text()
    lights = Material(Store(out), summary).lights
    assert lights
    assert lights["model"] == "unknown"


@pytest.mark.full
def test_a_method_that_needs_lights_is_refused_before_anything_is_solved(dome, processed, tmp_path):
    with pytest.raises(SceneError, match="--method ls: the lights are unknown") as error:
        run_session(dome[0], "solve", out=processed[0], said=Solving("ldr,ls"))
    assert "ldr,entropy,tv" in str(error.value)
    assert "[[spheres]]" in str(error.value)
    with pytest.raises(CalibrationError, match="directions are unknown"):
        export(dome[0], format="lp", out=processed[0])


@pytest.mark.parametrize(
    ("model", "asked", "expected"),
    [
        ("with a scan", "ls,iterative", ("ls", "iterative", "Learned")),
        ("distant", None, ("ls", "iterative", "Learned")),
        ("unknown", None, (*UNCALIBRATED, "Learned")),
        ("unknown", "tv", ("tv", "Learned")),
        ("unknown", "tv,ls", None),
        (None, "tv,ls", ("tv", "ls", "Learned")),
    ],
)
def test_which_methods_run_under_which_lights(model, asked, expected):
    """Another program needs no lights; before `calibrate` nothing is known of them; `align` finds them by a scan."""
    session: Any = SimpleNamespace(scan=Path("scan.ply") if model == "with a scan" else None)
    model = "unknown" if session.scan else model
    done = {} if model is None else {"calibrate": {"result": {"model": model}}}
    record: Any = SimpleNamespace(done=done)
    job = Job(session, record, Settings(asked, external=("Learned=learned {data} {out}",)))
    if expected is None:
        with pytest.raises(SceneError, match="--method ls: the lights are unknown"):
            _ = job.methods
    else:
        assert job.methods == expected


def test_given_normals_alone_leave_the_lights_unknown_and_it_is_said(tmp_path, run_rgbn):
    make_session(tmp_path / "pear")
    np.save(tmp_path / "pear" / "normals.npy", np.broadcast_to(np.float32([0, 0, 1]), (24, 32, 3)))
    text = (tmp_path / "pear" / "session.toml").read_text().replace('[lights]\nfile = "known/lights.lp"\n', "")
    (tmp_path / "pear" / "session.toml").write_text(f'{text}normals = "normals.npy"\n')
    code, printed, said = run_rgbn("calibrate", tmp_path / "pear", "--out", tmp_path / "out", "--json")
    assert code == 0, said
    assert "no probe tells the lights" in " ".join(row["text"] for row in json.loads(printed)["warnings"])
    code, _, said = run_rgbn("solve", tmp_path / "pear", "--out", tmp_path / "out", "--method", "ls")
    assert code == 2
    assert "--method ldr,entropy,tv" in said


def test_lights_that_are_known_in_part_are_a_fault_of_the_file(tmp_path):
    data = {"frames": [{"name": "a", "direction": [0, 0, 1], "intensity": [1, 1, 1]},
                       {"name": "b", "direction": None, "intensity": [1, 1, 1]}]}  # fmt: skip
    (tmp_path / "lights.json").write_text(json.dumps(data))
    with pytest.raises(SceneError, match="directions"):
        Store(tmp_path).load_lights()
