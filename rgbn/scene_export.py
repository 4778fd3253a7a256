"""`rgbn export --format mitsuba`: a session's twin, or a scene description, as files of Mitsuba's command line."""

from pathlib import Path

from lab.job import Job
from lab.plan import EXPORTED
from lab.run import is_description, open_job
from lab.twin_step import twin_scene
from scene.errors import SceneError
from scene.output_folder import open_record


def export_scene(source: Path, out: Path | None) -> tuple[list[Path], list[str]]:
    """Write scene.xml with all that it names into OUT/export.

    Parameters
    ----------
    source : Path
        A session's folder: the twin that `rgbn twin` renders, registered and solved first if it is not yet. Or a scene
        description's .toml.
    out : Path or None
        Default: out/NAME.

    Returns
    -------
    paths : list of Path
        scene.xml first.
    notes : list of str
        How to render it, and what the files cannot say.

    Raises
    ------
    SceneError
        The scene cannot be rendered, or the session has no scan.
    """
    from twin.description.description_file import read_scene
    from twin.engines.mitsuba_files import write_mitsuba

    if is_description(source):
        scene = read_scene(source)
        with open_record(out or Path("out") / source.stem, inputs=[source]) as record:
            paths, notes = write_mitsuba(scene, record.folder / "export")
    else:
        with open_job(source, out=out) as job:
            scene, warnings = _session_scene(job)
            with job.record.part_of(EXPORTED):
                paths, notes = write_mitsuba(scene, job.store.path("export"))
            notes = [*warnings, *notes]
    first = scene.lights.names[0]
    command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr {paths[0]}"
    return paths, [*notes, f"{len(scene.lights)} lights, one at a time: {command}"]


def _session_scene(job: Job):
    from lab.plan import STEPS

    job.run(STEPS, "solve")
    if not job.store.path("pose.json").exists():
        raise SceneError(
            f'{job.session.name}: no scan is registered, so there is no twin to export. Add [object] scan = "..." to '
            "session.toml."
        )
    scene, material, warnings = twin_scene(job)
    return scene, [f"the object is {material['sentence']}", *warnings]
