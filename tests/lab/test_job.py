"""Laws of resuming, on steps that cost nothing."""

from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from capture.session.session_types import CaptureSession, SphereSpec
from lab.job import Job, Outcome, Step
from lab.options import NOTE, Settings, degrees_of
from lab.run import STEPS, run_session
from scene.camera import Camera
from scene.files import write_text
from scene.output_folder import open_record, read_record
from scene.record import Record
from tests.lab.test_foreign_files import make_session


class Bench:
    """Three steps a -> b -> c; each writes a file and counts its runs."""

    def __init__(self, folder):
        self.folder, self.ran = folder, []
        self.values = {"a": 1, "b": 1, "c": 1}
        self.fails = False
        self.steps = {name: self.step(name, needs) for name, needs in (("a", ()), ("b", ("a",)), ("c", ("b",)))}

    def step(self, name, needs):
        def work(job):
            self.ran.append(name)
            if self.fails and name == "b":
                raise KeyboardInterrupt
            write_text(self.folder / name, name)
            return Outcome({"name": name}, [])

        return Step(name, work, needs, lambda _: [self.values[name]])

    def run(self, wanted="c"):
        self.ran.clear()
        # A new job each time, as a new command has.
        with open_record(self.folder) as record:
            Job(None, record).run(self.steps, wanted)
        return "".join(self.ran)


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


@pytest.mark.parametrize(("lost", "again"), [("a", "abc"), ("b", "bc"), ("c", "c")])
def test_what_is_done_is_not_done_again_but_a_lost_file_with_what_was_made_from_it(bench, lost, again):
    """A step that runs again may write other files although its inputs read the same."""
    assert (bench.run(), bench.run()) == ("abc", "")
    (bench.folder / lost).unlink()
    assert bench.run() == again


def test_a_step_run_alone_leaves_no_old_results_beside_its_new_ones(bench):
    bench.run()
    bench.values["a"] = 2
    assert bench.run("a") == "a"
    assert set(read_record(bench.folder).done) == {"a"}
    assert not (bench.folder / "b").exists()
    assert bench.run() == "bc"


def test_a_stopped_run_goes_on_where_it_was(bench):
    bench.run()
    bench.values["b"], bench.fails = 2, True
    with pytest.raises(KeyboardInterrupt):
        bench.run()
    bench.values["b"], bench.fails = 1, False
    assert bench.run() == "bc"


def session(folder):
    def file(name):
        path = folder / name
        path.write_text(name)
        return path

    return CaptureSession(
        "name", folder, (file("f"),), ("f",), (0,), (file("a"),), (file("d"),), (file("t"),), camera=None,
        lights_file=file("light_directions.txt"), mask=file("m"), scan=file("s"), normals=file("n"),
    )  # fmt: skip


OTHER = {
    "ambient": (), "dark": (), "flat": (), "encoding": "srgb", "encoding_stated": False, "half": True, "skip": ("x",),
    "flash": (), "camera": Camera(9, 9, 9.0, 9.0, 4.0, 4.0), "spheres": (SphereSpec("white"),), "lights_file": None,
    "mask": None, "box": (1.0, 2.0, 30.0, 40.0), "scan": None, "scan_unit": "m", "scan_ball_diameter_mm": 38.0,
    "normals": None, "picks": Path("picks.csv"), "chart": Path("chart.dng"), "layout": "diligent", "no_spheres": True,
    "tolerance_deg": 3.0, "board_shots": (Path("board.png"),),
}  # fmt: skip
NO_INPUT = {"name", "folder", "names", "kept", "photographed", "series"}
"""What follows from the others, or changes no pixel."""


def marks(session, folder):
    found = {}
    with open_record(folder / "out") as record:
        job = Job(session, record, Settings("ls"))
        for name, step in STEPS.items():
            found[name] = job.fingerprint(step)
            job.done[name] = {"fingerprint": found[name]}
    return found


@pytest.mark.parametrize("name", [field.name for field in fields(CaptureSession) if field.name not in NO_INPUT])
def test_every_word_of_a_session_counts(tmp_path, name):
    """Whatever the user edits in session.toml, some step notices, and with it the last."""
    before = session(tmp_path)
    plain = marks(before, tmp_path)
    assert marks(before, tmp_path) == plain
    assert marks(replace(before, **{name: OTHER[name]}), tmp_path)["compare"] != plain["compare"]


def test_a_tolerance_is_a_matter_of_the_comparison_alone(tmp_path):
    before = session(tmp_path)
    plain, told = marks(before, tmp_path), marks(replace(before, tolerance_deg=3.0), tmp_path)
    assert {name for name in STEPS if plain[name] != told[name]} == {"compare"}


def test_the_option_goes_before_the_file_and_both_are_told(tmp_path, no_report):
    make_session(tmp_path / "session")
    text = (tmp_path / "session" / "session.toml").read_text()

    def judged(said_deg, option_deg=None):
        (tmp_path / "session" / "session.toml").write_text(f"{text}tolerance_deg = {said_deg}\n")
        said = Settings("ls", tolerance_deg=option_deg)
        found = run_session(tmp_path / "session", "compare", out=tmp_path / "out", said=said)
        told = [row["text"] for row in found["warnings"] if row["text"].startswith("tolerance")]
        return *(found["arguments"][key] for key in ("tolerance_deg", "tolerances_deg")), len(told)

    assert judged(3) == (3, {"session.toml": 3}, 0)
    assert judged(3, 2.0) == (2, {"--tolerance": 2, "session.toml": 3}, 1)
    assert judged(2) == (2, {"--tolerance": 2, "session.toml": 2}, 0), "it is kept by the folder"
    none = degrees_of(None, [SimpleNamespace(value="None")])
    assert judged(3, none) == judged(3) == (3, {"session.toml": 3}, 0), "until it is taken back"


def test_the_scan_is_loaded_with_its_unit_and_its_ball(tmp_path):
    from scene.errors import AlignError

    path = tmp_path / "scan.obj"
    path.write_text("v 0 0 0\nv 3 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    known = replace(session(tmp_path), scan=path, scan_unit="inch")
    assert np.ptp(Job(known, Record(tmp_path)).load_scan().vertices, axis=0) == pytest.approx([76.2, 50.8, 25.4])
    with pytest.raises(AlignError, match="expects one ball"):
        Job(replace(known, scan_ball_diameter_mm=38.0), Record(tmp_path)).load_scan()


@pytest.mark.parametrize("name", ["f", "a", "d", "t", "light_directions.txt", "light_intensities.txt", "m", "s", "n"])
def test_every_file_of_a_session_counts(tmp_path, name):
    before = session(tmp_path)
    plain = marks(before, tmp_path)
    Path(tmp_path / name).write_text("something else")
    assert marks(before, tmp_path)["compare"] != plain["compare"]


def test_a_setting_that_an_earlier_version_had_is_left(tmp_path):
    """It was a TypeError, in every verb on such a folder."""
    kept = Settings(method="ls")
    record = SimpleNamespace(notes={NOTE: {**vars(kept), "exr": True}})
    assert Settings.of(record) == kept
