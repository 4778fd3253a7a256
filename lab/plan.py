"""The steps in the order in which data flow: what each needs, reads and leaves."""

from pathlib import Path
from typing import Any

from lab import steps
from lab.job import Job, Step


def _frame_inputs(job: Job) -> list[Any]:
    session = job.session
    files = (session.flash, session.ambient, session.dark, session.flat)
    return [*files, session.encoding, session.half, session.skip, session.camera]


def _object_inputs(job: Job) -> list[Any]:
    session = job.session
    return [session.mask, session.scan, session.scan_unit, session.normals]


def _methods_done(job: Job, *parts: str) -> list[Path]:
    return [job.store.path(*parts, "normals", f"{method}.npy") for method in job.methods]


def _twin_done(job: Job) -> list[Path]:
    return _methods_done(job, "twin") if job.store.path("pose.json").exists() else []


STEPS = {
    step.name: step
    for step in (
        Step(
            "check",
            steps.check,
            (),
            _frame_inputs,
            lambda job: [job.store.path("frames", "codes.npy"), job.store.path("camera.json")],
        ),
        Step(
            "calibrate",
            steps.calibrate,
            ("check",),
            lambda job: [job.session.spheres, job.session.lights_file],
            lambda job: [job.store.path("lights.json"), job.store.path("calibration.json")],
        ),
        Step("align", steps.align, ("calibrate",), _object_inputs, lambda job: [job.store.path("mask.png")]),
        Step("solve", steps.solve, ("align",), lambda job: job.methods, lambda job: _methods_done(job)),
        Step("twin", steps.twin, ("solve",), lambda job: job.methods, _twin_done),
        Step(
            "compare",
            steps.compare,
            ("twin",),
            lambda job: [job.methods, job.truth],
            lambda job: [job.store.path("compare")],
        ),
    )
}
"""In the order in which data flow."""
