"""A session with a scan and no balls: the whole way, and what is said where the scan cannot be the probe."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lab.registration import register_scan
from scene.errors import AlignError
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.store import Store
from tests.conftest import FIXTURE


@pytest.fixture(scope="module")
def without_balls(tmp_path_factory):
    """The fixture's session; session.toml says that no ball is in the picture."""
    folder = tmp_path_factory.mktemp("session") / "bumpy"
    folder.mkdir()
    for name in ("raw", "scan"):
        (folder / name).symlink_to(FIXTURE / name)
    text = (FIXTURE / "session.toml").read_text()
    kept = [part for part in text.split("\n\n") if not part.startswith("[[spheres]]")]
    (folder / "session.toml").write_text("spheres = []\n" + "\n\n".join(kept))
    return folder


@pytest.fixture(scope="module")
def processed(without_balls, rgbn_process, tmp_path_factory):
    """(output folder, summary) of `rgbn process`."""
    out = tmp_path_factory.mktemp("out") / "bumpy"
    run = rgbn_process("process", without_balls, "--out", out, "--json")
    assert run.returncode == 0, run.stderr
    return out, json.loads(run.stdout)


def test_a_scan_of_unknown_unit_cannot_be_the_probe():
    session = SimpleNamespace(scan_unit="unknown", scan_ball_diameter_mm=None)
    job: Any = SimpleNamespace(session=session, store=None)
    nothing: Any = None
    with pytest.raises(AlignError, match=r"scan_unit: it is unknown, and no ball .*scan_ball_diameter_mm"):
        register_scan(job, nothing, nothing, Lights.unknown(("a", "b")), nothing)


@pytest.mark.full
@pytest.mark.slow
def test_process_goes_the_whole_way_and_says_where_the_lights_come_from(processed):
    out, summary = processed
    truth = json.loads((FIXTURE / "truth.json").read_text())
    lights = Store(out).load_lights()
    assert lights.model == "near"
    seen = lights.seen_from(truth["object_centre_mm"])
    assert np.median(angular_error_deg(seen.directions, np.array(truth["directions_at_object"]))) < 1
    assert set(summary["solve"]["methods"]) == {"ls", "iterative"}
    assert summary["compare"]["methods"]["iterative"]["real"]["median_deg"] < 3
    assert summary["twin"]["rendered"]
    assert summary["align"]["light_probe"]["model"] == "near"
    pose = json.loads((out / "pose.json").read_text())["camera_from_scan"]
    turn = np.array(pose)[:3, :3] @ np.array(truth["camera_from_scan"])[:3, :3].T
    assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) < 0.1
    # And it is said where the lights come from.
    page = (out / "report.html").read_text()
    assert "they come from the scan's own shading" in page.replace("&#x27;", "'")
    assert any("from the scan's own shading" in text for text in summary["align"]["evidence"])
    assert any("judged too kindly" in row["text"] for row in summary["warnings"] if row["step"] == "align")
    assert not [row for row in summary["warnings"] if row["step"] == "calibrate"]
