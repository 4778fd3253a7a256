"""`rgbn export --format`: what a session gives to other programs: lights, photographs, the twin's scene."""

import re
from pathlib import Path

from formats.light_files.light_formats import FORMATS as LIGHTS
from formats.light_files.light_formats import export_lights
from formats.sfm_data import write_sfm
from lab.job import Job
from lab.options import AS_BEFORE, Solving, named
from lab.plan import EXPORTED, STEPS
from lab.run import is_description, open_job, summed_up
from lab.twin_step import twin_scene
from rgbn.relight_export import export_relight
from scene.errors import SceneError
from scene.origin import Origin
from scene.output_folder import open_record, own_folder
from twin.description.description import TwinScene
from twin.description.description_file import read_scene

HERITAGE, SCENE = "heritage", "mitsuba"
FORMATS = (*sorted(LIGHTS), "meshroom", "relight", HERITAGE, SCENE)

Made = tuple[list[Path], list[str]]
"""Files, and notes: what these cannot say."""


def export_session(
    source: Path, text: str, out: Path | None, sfm: Path | None, base_url: str, said: Solving = AS_BEFORE
) -> Made:
    """Write what is asked for into OUT/export, after the steps that it needs.

    Parameters
    ----------
    source, text, out, sfm, base_url, said
        As `rgbn export` has them; `text`: formats with commas.

    Raises
    ------
    SceneError
        Unknown format, or one that cannot hold these lights or this scene; a session without a scan has none.
    """
    names = named("--format", text, FORMATS)
    if not re.fullmatch(r"https?://[^\s/?#]+(/[^\s?#]*)?", base_url):
        raise SceneError(
            f"--base-url {base_url}: expected a whole address, such as http://localhost:8000: IIIF asks for such ids."
        )
    if is_description(source) and names == (SCENE,):
        scene, origin = read_scene(source), Origin("scene", source.resolve())
        out = out or own_folder(Path("out") / source.stem, origin)
        with open_record(out, origin=origin, inputs=[source]) as record:
            return _scene(scene, record.folder / "export")
    made: list[Made] = []
    with open_job(source, out=out, said=said) as job:
        # First what may take steps that remove what the others wrote.
        if HERITAGE in names:
            from rgbn.heritage_export import export_heritage

            made.append(export_heritage(job, base_url.rstrip("/")))
        before = dict(job.done)
        job.run(STEPS, "solve" if SCENE in names else "calibrate")
        if SCENE in names and job.done != before:
            # What was told of the normals that this has replaced.
            summed_up(job, "export")
        if job.store.load_lights().is_unknown and job.session.scan:
            job.run(STEPS, "align")
        for name in names:
            if name != HERITAGE:
                with job.record.part_of(EXPORTED):
                    made.append(_one(job, name, sfm))
    return [path for paths, _ in made for path in paths], [note for _, notes in made for note in notes]


def _one(job: Job, name: str, sfm: Path | None) -> Made:
    store, folder = job.store, job.store.path("export")
    lights, camera = store.load_lights(), store.load_camera()
    if name == SCENE:
        if not store.path("pose.json").exists():
            raise SceneError(
                f'{job.session.name}: no scan is registered, so there is no twin to export. Add [object] scan = "..." '
                "to session.toml."
            )
        scene, found, warnings = twin_scene(job)
        paths, notes = _scene(scene, folder)
        return paths, [f"the object is {found.fit}", *warnings, *notes]
    if name == "relight":
        return export_relight(store, job.session.name)
    if lights.is_unknown:
        lights.check()
    if name != "meshroom":
        return export_lights(folder, name, lights, camera, files=job.frame_files, sfm=sfm)
    views = folder / "cameras.sfm"
    said = write_sfm(views, camera, [path.resolve() for path in job.session.flash])
    paths, notes = export_lights(folder, "alicevision", lights, camera, files=job.frame_files, sfm=views)
    return [*paths, views], [*said, *notes]


def _scene(scene: TwinScene, folder: Path) -> Made:
    """Write scene.xml with all that it names."""
    from twin.engines.mitsuba_files import write_mitsuba

    made, notes = write_mitsuba(scene, folder)
    first = scene.lights.names[0]
    command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr {made[0]}"
    return [made[0]], [*notes, f"{len(scene.lights)} lights, one at a time: {command}"]
