"""`rgbn export --format`: what a session gives to other programs: lights, photographs, the twin's scene."""

import re
from pathlib import Path
from typing import TYPE_CHECKING

from lab.options import AS_BEFORE, Solving, named
from lab.run import is_description, open_job, summed_up
from scene.errors import SceneError

if TYPE_CHECKING:
    from lab.job import Job
    from twin.description.description import TwinScene

LIGHTS = ("alicevision", "diligent", "dome", "lp", "mat")
"""The formats of `formats.light_files`: here they are known without loading anything."""
SCENE = "mitsuba"
HERITAGE, BASE_URL = "heritage", "http://localhost:8000"
"""The address: that of `python -m http.server`."""
FORMATS = (*LIGHTS, "meshroom", "relight", HERITAGE, SCENE)


def export_session(
    source: Path, text: str, out: Path | None, sfm: Path | None, base_url: str = BASE_URL, said: Solving = AS_BEFORE
) -> tuple[list[Path], list[str]]:
    """Write what is asked for into OUT/export, after the steps that it needs.

    Parameters
    ----------
    source : Path
        A session, its output folder, or for `mitsuba` alone a scene description.
    text : str
        Formats with commas.
    out : Path or None
    sfm : Path or None
        AliceVision's .sfm of the photographs.
    base_url : str
        At which `data/` of `heritage` will be served.
    said : Solving
        How the steps run.

    Returns
    -------
    paths : list of Path
    notes : list of str
        What the files cannot say.

    Raises
    ------
    SceneError
        Unknown format, or one that cannot hold these lights or this scene; a session without a scan has none.
    """
    names, paths, notes = named("--format", text, FORMATS), [], []
    if not re.fullmatch(r"https?://[^\s/?#]+(/[^\s?#]*)?", base_url):
        raise SceneError(
            f"--base-url {base_url}: expected a whole address, such as {BASE_URL}: IIIF asks for such ids."
        )
    if lights := [name for name in names if name != SCENE]:
        with open_job(source, out=out, said=said) as job:
            if HERITAGE in lights:
                from rgbn.heritage_export import export_heritage

                # First: it may take steps that remove what the others wrote.
                lights.remove(HERITAGE)
                paths, notes = export_heritage(job, base_url.rstrip("/"))
            made, more = _lights(job, lights, sfm)
            paths, notes = [*paths, *made], [*notes, *more]
    if SCENE in names:
        made, more = _scene(source, out, said)
        paths, notes = [*paths, *made], [*notes, *more]
    return paths, notes


def _lights(job: "Job", names: list[str], sfm: Path | None) -> tuple[list[Path], list[str]]:
    from formats.light_files.light_formats import export_lights
    from formats.sfm_data import write_sfm
    from lab.plan import EXPORTED, STEPS
    from rgbn.relight_export import export_relight

    job.run(STEPS, "calibrate")
    if job.store.load_lights().is_unknown and job.session.scan:
        job.run(STEPS, "align")
    store, files = job.store, tuple(path.name for path in job.session.flash)
    lights, camera, folder = store.load_lights(), store.load_camera(), store.path("export")
    paths, notes = [], []
    for name in names:
        with job.record.part_of(EXPORTED):
            if name == "relight":
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
        paths += made
        notes += more
    return paths, notes


def _scene(source: Path, out: Path | None, said: Solving) -> tuple[list[Path], list[str]]:
    """Write scene.xml with all that it names, of a scene description or a session's twin.

    The twin is the one that `rgbn twin` renders, registered and solved first if it is not yet.
    """
    from lab.plan import EXPORTED, STEPS
    from lab.twin_step import twin_scene
    from scene.origin import Origin
    from scene.output_folder import open_record, own_folder
    from twin.description.description_file import read_scene

    if is_description(source):
        scene = read_scene(source)
        origin = Origin("scene", source.resolve())
        out = out or own_folder(Path("out") / source.stem, origin)
        with open_record(out, origin=origin, inputs=[source]) as record:
            return _written(scene, record.folder / "export")
    with open_job(source, out=out, said=said) as job:
        before = dict(job.done)
        job.run(STEPS, "solve")
        if job.done != before:
            # What was told of the normals that this has replaced.
            summed_up(job, "export")
        if not job.store.path("pose.json").exists():
            raise SceneError(
                f'{job.session.name}: no scan is registered, so there is no twin to export. Add [object] scan = "..." '
                "to session.toml."
            )
        scene, found, warnings = twin_scene(job)
        with job.record.part_of(EXPORTED):
            paths, notes = _written(scene, job.store.path("export"))
    return paths, [f"the object is {found.fit}", *warnings, *notes]


def _written(scene: "TwinScene", folder: Path) -> tuple[list[Path], list[str]]:
    from twin.engines.mitsuba_files import write_mitsuba

    made, notes = write_mitsuba(scene, folder)
    first = scene.lights.names[0]
    command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr {made[0]}"
    return [made[0]], [*notes, f"{len(scene.lights)} lights, one at a time: {command}"]
