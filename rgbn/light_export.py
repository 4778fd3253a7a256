"""`rgbn export`: a session's lights and photographs as files of other programs, and its numbers as tables."""

from pathlib import Path
from typing import TYPE_CHECKING

from lab.options import named
from lab.run import open_job
from scene.errors import SceneError

if TYPE_CHECKING:
    from lab.job import Job

LIGHTS = ("alicevision", "csv", "diligent", "dome", "lp", "mat")
"""What `all` writes: the formats of `formats.light_files`, and tables. Here they are known without loading anything."""
SCENES = ("gltf", "mitsuba")
FORMATS = (*LIGHTS, "meshroom", "relight", *SCENES)


def formats_of(text: str) -> tuple[str, ...]:
    """Return the formats that a command line names; raise SceneError for one that there is not."""
    return LIGHTS if text.strip().casefold() == "all" else named("--format", text, (*FORMATS, "all"))


def export_session(source: Path, text: str, out: Path | None, sfm: Path | None) -> tuple[list[Path], list[str]]:
    """Write what is asked for into OUT/export, after the steps that it needs.

    Parameters
    ----------
    source : Path
        A session, its output folder, or for `mitsuba` and `gltf` alone a scene description.
    text : str
        Formats with commas, or `all`.
    out : Path or None
    sfm : Path or None
        AliceVision's .sfm of the photographs.

    Returns
    -------
    paths : list of Path
    notes : list of str
        What the files cannot say.

    Raises
    ------
    SceneError
        Unknown format, or one that cannot hold these lights; of `all` such a one is left out with a note.
    """
    from rgbn.scene_export import export_scene

    names, paths, notes = formats_of(text), [], []
    if lights := [name for name in names if name not in SCENES]:
        with open_job(source, out=out) as job:
            paths, notes = _lights(job, lights, sfm, left_out=text.strip().casefold() == "all")
    if scenes := [name for name in names if name in SCENES]:
        made, more = export_scene(source, out, scenes)
        paths, notes = [*paths, *made], [*notes, *more]
    return paths, notes


def _lights(job: "Job", names: list[str], sfm: Path | None, *, left_out: bool) -> tuple[list[Path], list[str]]:
    from formats.light_files.light_formats import export_lights
    from formats.sfm_data import write_sfm
    from lab.plan import EXPORTED, STEPS
    from lab.summary import write_tables
    from rgbn.relight_export import export_relight

    job.run(STEPS, "calibrate")
    if job.store.load_lights().is_unknown and job.session.scan:
        job.run(STEPS, "align")
    store, files = job.store, tuple(path.name for path in job.session.flash)
    lights, camera, folder = store.load_lights(), store.load_camera(), store.path("export")
    paths, notes = [], []
    for name in names:
        with job.record.part_of(EXPORTED):
            try:
                if name == "csv":
                    compared = job.done.get("compare", {}).get("result", {})
                    made, more = write_tables(store, folder, compared), []
                elif name == "relight":
                    made, more = export_relight(store, job.session.name)
                else:
                    if lights.is_unknown:
                        lights.check()
                    views, said = sfm, []
                    if name == "meshroom":
                        name, views = "alicevision", folder / "cameras.sfm"
                        said = write_sfm(views, camera, [path.resolve() for path in job.session.flash])
                    made, more = export_lights(folder, name, lights, camera, files=files, sfm=views)
                    made, more = [*made, *([views] if said else [])], [*said, *more]
            except SceneError as error:
                if not left_out:
                    raise
                made, more = [], [f"left out: {error}"]
        paths += made
        notes += more
    return paths, notes
