"""The steps in the order in which data flow: what each needs, reads and leaves."""

from typing import Any

from lab import steps
from lab.job import Job, Step
from lab.results import FOLDER, recommended, results
from lab.twin_step import twin
from scene.light_text import FILENAMES, INTENSITIES


def _frame_inputs(job: Job) -> list[Any]:
    session = job.session
    files = (session.flash, session.ambient, session.dark, session.flat, session.chart)
    coding = (session.encoding, session.encoding_stated, session.half, session.skip, session.layout)
    # A scan wants a camera: whether there is one decides what `check` accepts.
    return [*files, *coding, session.camera, session.scan is None]


def _light_inputs(job: Job) -> list[Any]:
    session, file = job.session, job.session.lights_file
    # DiLiGenT's directions have their intensities and names beside them.
    beside = [] if file is None else [file.with_name(INTENSITIES), file.with_name(FILENAMES)]
    # AliceVision's lights have its view ids beside them.
    beside += [] if file is None else sorted(file.parent.glob("*.sfm"))
    # Without balls and file the object's normals are the probe, or its scan.
    return [session.spheres, session.no_spheres, file, *beside, session.normals, session.mask, session.scan is None]


def _object_inputs(job: Job) -> list[Any]:
    session = job.session
    scan = (session.scan, session.scan_unit, session.scan_ball_diameter_mm)
    return [session.mask, session.box, *scan, session.normals, session.picks, bool(job.settings.refine_lights)]


def _methods(job: Job) -> list[Any]:
    programs = job.externals.values()
    return [job.methods, job.profile, *((program.command, program.files) for program in programs)]


def _judged_by(job: Job) -> list[Any]:
    return [
        *_methods(job),
        job.tolerances_deg,
        *([] if job.settings.truth is None else [job.settings.truth / "truth.json", job.settings.truth / "truth.npz"]),
    ]


EXPORTED = "export"
"""Files for other programs: `calibrate` finds the lights, `align` moves them to the object."""
ARCHIVED = "heritage"
"""The bag for an archive: of one method's maps in `results`."""
REPORTED = "report"

STEPS = {
    step.name: step
    for step in (
        Step("check", steps.check, (), _frame_inputs),
        Step("calibrate", steps.calibrate, ("check",), _light_inputs, (EXPORTED,)),
        Step("align", steps.align, ("calibrate",), _object_inputs, (EXPORTED,)),
        Step("solve", steps.solve, ("align",), _methods),
        Step("trust", steps.trust, ("solve",), lambda job: []),
        Step("twin", twin, ("solve",), lambda job: [*_methods(job), job.twin]),
        Step("compare", steps.compare, ("twin",), _judged_by, (REPORTED,)),
        # Of what `compare` and `trust` found nothing but which method is recommended, so that neither is waited for.
        Step(FOLDER, results, ("solve",), lambda job: [job.settings.normals, recommended(job)], (ARCHIVED,)),
    )
}
"""In the order in which data flow."""
