"""The steps run from a review: as they were run before, with what was kept, and what stops them."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from capture.session.session import load_session
from lab.job import Outcome
from lab.options import Solving, TwinSettings
from lab.plan import STEPS
from lab.run import run_session
from rgbn.cli import app
from scene.errors import SceneError
from studio import background_process
from studio.background_process import BackgroundProcess
from studio.photograph.outlines import moved
from studio.review.corrected_session import write_amended
from studio.review.corrections import specs_of
from studio.review.review_window import ReviewWindow
from studio.review.run_panel import RunPanel, options_of, process_arguments
from studio.workspace import Workspace

FIXTURE = Path(__file__).parents[3] / "fixtures" / "bumpy"


def test_what_stops_the_steps_is_told(made):
    """The command line in its own process: photographs that are no pictures end it, with the line that says so."""
    said, ended = [], []
    arguments = process_arguments(made.session, made.folder.parent / "again")
    BackgroundProcess(arguments, said.append, ended.append).wait()
    (fault,) = ended
    assert "flash_0.png" in fault
    assert not fault.startswith("rgbn")
    assert "Traceback" not in "".join(said)


def test_steps_are_run_as_they_were(tmp_path, monkeypatch):
    """By the command line's own reading of the options: with them the steps are current, without any of them not."""
    shutil.copytree(FIXTURE / "raw", tmp_path / "session" / "raw")
    text = (FIXTURE / "session.toml").read_text()
    (tmp_path / "session" / "session.toml").write_text(
        text.replace("scan/object.ply", str(FIXTURE / "scan/object.ply"))
    )
    worked = []

    def step(name):
        return replace(STEPS[name], work=lambda job: worked.append(name) or Outcome({}), needs=())

    for name in list(STEPS):
        monkeypatch.setitem(STEPS, name, replace(step(name), needs=("solve", "twin") if name == "compare" else ()))
    monkeypatch.setattr("compare.report.report.write_report", lambda store, summary: None)
    monkeypatch.setattr("rgbn.summary_table.tell", lambda job, summary, **how: None)
    how = {
        "solving": Solving(
            "sbl,ls", "seed", ("Net=python net.py --data {data} --out '{out}'", "Other=x {data} {out}"), 60.0
        ),
        "twin": TwinSettings("many", 0.035, True, True),
    }
    out = tmp_path / "out"
    run_session(tmp_path / "session", "compare", out=out, **how)
    assert worked == ["solve", "twin", "compare"]
    worked.clear()
    options = options_of(json.loads((out / "summary.json").read_text()))
    again = ["process", str(tmp_path / "session"), "--out", str(out)]
    app([*again, *options], result_action="return_value")
    assert worked == []
    for left in options:
        app([*again, *(option for option in options if option != left)], result_action="return_value")
        assert "twin" in worked, f"{left} counts"
        worked.clear()
        app([*again, *options], result_action="return_value")
        worked.clear()
    with pytest.raises(SceneError, match="known truth"):
        options_of({"truth_check": {"held": True}})
    assert options_of({}) == []


def test_the_panel_runs_what_was_kept_as_the_session_is_now(made, nobody, no_preview, settle, monkeypatch):
    """And says before with what: a folder that came from elsewhere may name a program."""
    runs = []

    class Ran:
        def __init__(self, arguments, tell, ended):
            verb, session, *options = arguments[2:]
            assert (verb, options[:2]) == ("process", ["--out", str(made.folder)])
            runs.append((load_session(Path(session)), options[2:]))
            tell("<b>solve</b> ...")
            ended("")

        def stop(self):
            pass

    monkeypatch.setattr(background_process, "BackgroundProcess", Ran)
    arguments = {"methods": ["ls", "Net"], "external": {"Net": "python `net` {data} {out}"}}
    made.store.path("summary.json").write_text(json.dumps({"arguments": arguments}))
    window = ReviewWindow(nobody(), Workspace.at(made.folder.parent), no_preview, made.folder, made.session)
    window.read()
    panel = RunPanel(window)
    window.panels.append(panel)
    window.refresh()
    assert "--external=Net=python `net` {data} {out}" in panel._what.content
    window.client.says("Run the steps")
    settle(window)
    assert runs[0][0].folder == made.session
    assert "\\<b\\>solve" in panel.work.text.content
    write_amended(
        window.review,
        spheres=specs_of(window.review.session, moved(window.outlines, 0, (40.0, 30.0), made.camera), made.camera),
    )
    text = (made.session / "session.toml").read_text()
    (made.session / "session.toml").write_text(text + 'scan_unit = "cm"\n')
    window.client.says("Run the steps")
    settle(window)
    session, options = runs[1]
    assert (session.scan_unit, session.spheres[0].center_px) == ("cm", (40.0, 30.0))
    assert options == ["--method=ls", "--external=Net=python `net` {data} {out}"]
    window.client.says("Forget what was kept")
    window.client.says("Run the steps")
    settle(window)
    assert runs[2][0].folder == made.session
    made.store.path("summary.json").write_text(json.dumps({"arguments": arguments, "truth_check": {"a": 1}}))
    window.client.says("Run the steps")
    settle(window)
    assert len(runs) == 3
    assert "known truth" in window.client.told[-1]
    window.close()
    window.wait()
