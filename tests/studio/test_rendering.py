"""Work in its own process: told how far it is, stopped, gone on with, and its faults."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from studio import studio_state
from studio.editor import edits
from studio.studio_state import Work
from tests.conftest import until
from tests.studio.conftest import small_document
from twin.description.description_file import write_document
from twin.description.light_groups import RingTable

pytestmark = [pytest.mark.render]


def small_scene(folder, samples):
    camera, sampling = {"width": 48, "height": 36, "fx": 120.0}, {"engine": "mitsuba", "samples": samples}
    document = small_document(camera=camera, sampling=sampling)
    return write_document(edits.with_value(document, ("lights",), (RingTable(count=24, polar_deg=40.0),)), folder)


def render(scene, out):
    return Work("Render", out, ["twin", scene, "--out", out])


@pytest.mark.full
def test_a_rendering_is_stopped_and_goes_on(tmp_path):
    """What was rendered when it was stopped is kept, and the whole is as if it had never been stopped."""
    scene = small_scene(tmp_path / "scene", samples=1600)
    stopped = render(scene, tmp_path / "a")
    until(lambda: stopped.share, lambda: stopped.said)
    done = stopped.share
    stopped.stop()
    assert (stopped.is_over, stopped.is_stopped, stopped.fault) == (True, True, "")
    assert not (tmp_path / "a" / "session.toml").exists()
    assert (tmp_path / "a" / ".rgbn" / "unfinished").is_dir()
    again, first = render(scene, tmp_path / "a"), 0.0
    while not (again.is_over or first):
        first = again.share
        time.sleep(0.01)
    again.wait()
    assert (again.fault, again.share) == ("", 1.0)
    assert first >= done, "it goes on from what was done"
    render(scene, tmp_path / "b").wait()
    a, b = (np.load(tmp_path / name / "frames" / "codes.npy") for name in "ab")
    # Threads add to a pixel in the order in which they come: the last bit of a float, one code at most.
    assert np.abs(a.astype(int) - b.astype(int)).max() <= 1


@pytest.mark.parametrize(
    ("said", "code", "fault", "shown"),
    [
        (["hello", "twin: 1 of 2", "[1, 2]", "twin: 2 of 2, about 3 s left"], 0, "", ["hello", "[1, 2]", 3]),
        ([], 3, "the process ended with code 3.", []),
        (["at work", "rgbn: no scan.", "Add one."], 2, "no scan.\nAdd one.", [0, 1, 2]),
    ],
)
def test_whatever_is_printed_the_end_is_told(tmp_path, monkeypatch, said, code, fault, shown):
    """A library may print between the lines, more than a pipe holds too; how far it is takes the place of how far."""
    program = tmp_path / "renderer"
    program.write_text("\n".join(["#!/bin/sh", "seq 100000", *(f"echo '{line}' >&2" for line in said), f"exit {code}"]))
    program.chmod(0o755)
    monkeypatch.setattr(studio_state, "sys", SimpleNamespace(executable=str(program)))
    work = render(tmp_path / "scene.toml", tmp_path / "out")
    work.wait()
    assert (work.fault, work.is_over) == (fault, True)
    assert work.said == [said[one] if isinstance(one, int) else one for one in shown]


def test_a_fault_is_told(tmp_path):
    """Of a scene, and of photographs that are no pictures: the line that says so, and no more."""
    scene = small_scene(tmp_path, samples=4)
    scene.write_text(scene.read_text().replace('kind = "ring"', 'kind = "rink"', 1))
    work = render(scene, tmp_path / "out")
    work.wait()
    assert "rink" in work.fault
    assert not (tmp_path / "out").exists()
    session = tmp_path / "session"
    session.mkdir()
    for number in range(3):
        (session / f"flash_{number}.png").write_bytes(b"")
    (session / "session.toml").write_text('[frames]\nflash = "flash_*.png"\nlinear = true\n')
    work = Work("Run", session, ["check", str(session), "--out", str(tmp_path / "o")])
    work.wait()
    assert "flash_0.png" in work.fault
    assert not work.fault.startswith("rgbn")
    assert "Traceback" not in "".join(work.said)
