"""The steps in the order in which data flow: what each needs, reads and leaves."""

from pathlib import Path
from typing import Any

from lab import steps
from lab.job import Job, Step
from lab.self_test import self_test
from lab.twin_step import twin
from solve.solve import METHODS


def _frame_inputs(job: Job) -> list[Any]:
    session = job.session
    files = (session.flash, session.ambient, session.dark, session.flat)
    coding = (session.encoding, session.encoding_stated, session.half, session.skip, session.layout)
    # A scan wants a camera: whether there is one decides what `check` accepts.
    return [*files, *coding, session.camera, session.scan is None]


def _light_inputs(job: Job) -> list[Any]:
    session, file = job.session, job.session.lights_file
    # DiLiGenT's directions have their intensities and names beside them.
    beside = [] if file is None else [file.with_name("light_intensities.txt"), file.with_name("filenames.txt")]
    # AliceVision's lights have its view ids beside them.
    beside += [] if file is None else sorted(file.parent.glob("*.sfm"))
    # Without balls and file the object's normals are the probe.
    return [session.spheres, file, *beside, session.normals, session.mask]


def _object_inputs(job: Job) -> list[Any]:
    session = job.session
    scan = (session.scan, session.scan_unit, session.scan_ball_diameter_mm)
    return [session.mask, *scan, session.normals, session.picks]


def _methods(job: Job) -> list[Any]:
    return [job.methods, job.profile, *(program.command for program in job.externals.values())]


def _judged_by(job: Job) -> list[Any]:
    return [*_methods(job), *([] if job.truth is None else [job.truth / "truth.json", job.truth / "truth.npz"])]


def _paths(job: Job, *names: str) -> list[Path]:
    return [job.store.path(*name.split("/")) for name in names]


def _aligned(job: Job) -> list[Path]:
    truth = ("normals/truth.npy", "normals/truth.png", "normals/truth_sigma.npy")
    has_truth = job.session.scan or job.session.normals
    has_pose = job.session.scan and not job.session.normals
    return _paths(
        job, "mask.png", *(truth if has_truth else ()), *(("pose.json", "align/outline.png") if has_pose else ())
    )


def _solved(job: Job, *place: str) -> list[Path]:
    kinds = (("normals", "npy"), ("normals", "png"), ("albedo", "npy"), ("sigma", "npy"), ("condition", "npy"))
    return [job.store.path(*place, folder, f"{name}.{end}") for name in job.methods for folder, end in kinds]


def _rendered(job: Job) -> list[Path]:
    return [*_paths(job, "twin/session.toml"), *_solved(job, "twin")] if job.store.path("pose.json").exists() else []


LIGHTS = ("lights.json", "light_directions.txt", "light_intensities.txt", "filenames.txt", "lights.lp")
# `align` moves the lights to the object: what was exported before is of other lights.
ALIGNED = ("pose.json", "mask.png", "normals/truth*", "align", "export")
# Other programs' names begin with a capital, ours do not.
SOLVED = (
    *(f"{folder}/{name}.*" for name in (*METHODS, "[A-Z]*") for folder in steps.MAPS),
    "external",
)

STEPS = {
    step.name: step
    for step in (
        Step(
            "check",
            steps.check,
            (),
            _frame_inputs,
            lambda job: _paths(job, "frames/codes.npy", "frames/frames.json", "frames/camera.json", "camera.json"),
        ),
        Step(
            "calibrate",
            steps.calibrate,
            ("check",),
            _light_inputs,
            lambda job: _paths(job, "calibration.json", "spheres.json", *LIGHTS),
            ("calibration.json", "spheres.json", *LIGHTS, "export"),
        ),
        Step(
            "self_test",
            self_test,
            ("calibrate",),
            lambda job: [],
            lambda job: _paths(job, "self_test.json"),
            ("self_test.json", "self_test"),
        ),
        Step("align", steps.align, ("calibrate",), _object_inputs, _aligned, ALIGNED),
        Step("solve", steps.solve, ("align",), _methods, _solved, SOLVED),
        Step("twin", twin, ("solve",), lambda job: [*_methods(job), job.twin], _rendered, ("twin",)),
        Step("compare", steps.compare, ("twin",), _judged_by, lambda job: [], ("compare", "report.html")),
    )
}
"""In the order in which data flow."""
