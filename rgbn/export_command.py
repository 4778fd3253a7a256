"""`rgbn export --format`: what other programs get: lights, photographs, a relightable picture, the twin's scene."""

import re
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from lab.options import AS_BEFORE, Out, Settings, named
from lab.progress import is_quiet, say
from rgbn.cli import SESSION
from scene.errors import SceneError

HERITAGE, SCENE = "heritage", "mitsuba"
FORMATS = ("diligent", "dome", "lp", "meshroom", "relight", HERITAGE, SCENE)

Made = tuple[list[Path], list[str]]
"""Files, and notes: what these cannot say."""


def export(
    session: Annotated[Path, Parameter(help=f"{SESSION} Mitsuba also takes a scene's .toml.")],
    /,
    *,
    format: Annotated[
        str,
        Parameter(
            alias="-f",
            help=f"Formats, with commas: {', '.join(FORMATS)}. meshroom: "
            "photographs and camera as SfMData, with AliceVision's lights. relight: one picture for OpenLIME and "
            "RelightLab. heritage: a bag for an archive, with a IIIF manifest. mitsuba: the twin's scene.",
        ),
    ],
    out: Out = None,
    base_url: Annotated[
        str, Parameter(help="Address at which data/ of heritage will be served. Its IIIF ids begin with it.")
    ] = "http://localhost:8000",
    said: Settings = AS_BEFORE,
) -> Made:
    """Write what is asked for into OUT/export, after the steps that it needs: `rgbn export`; and print what it is.

    Raises
    ------
    SceneError
        Unknown format, or one that cannot hold these lights or this scene; a session without a scan has none.
    """
    names = named("--format", format, FORMATS)
    if not re.fullmatch(r"https?://[^\s/?#]+(/[^\s?#]*)?", base_url):
        raise SceneError(
            f"--base-url {base_url}: expected a whole address, such as http://localhost:8000: IIIF asks for such ids."
        )
    # Loaded with the work: the help of the verb needs none of it.
    from lab.run import EXPORTED, STEPS, is_description, open_job, summed_up

    if is_description(session) and names == (SCENE,):
        from scene.origin import Origin
        from scene.output_folder import open_record, own_folder
        from twin.description.description_file import read_scene

        scene, origin = read_scene(session), Origin("scene", session.resolve())
        out = out or own_folder(Path("out") / session.stem, origin)
        with open_record(out, origin=origin, inputs=[session]) as record:
            return _told([_scene(scene, record.folder / "export")])
    made: list[Made] = []
    with open_job(session, out=out, said=said) as job:
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
                    made.append(_one(job, name))
    return _told(made)


def _told(made: list[Made]) -> Made:
    paths, notes = ([one for part in parts for one in part] for parts in zip(*made, strict=True))
    for note in notes:
        say(f"note: {note}")
    for path in () if is_quiet() else paths:
        print(path)
    return paths, notes


def _one(job: Any, name: str) -> Made:
    store, folder = job.store, job.store.path("export")
    lights, camera = store.load_lights(), store.load_camera()
    if name == SCENE:
        from lab.twin_step import twin_scene

        if not store.path("pose.json").exists():
            raise SceneError(
                f'{job.session.name}: no scan is registered, so there is no twin to export. Add [object] scan = "..." '
                "to session.toml."
            )
        scene, found, warnings = twin_scene(job)
        paths, notes = _scene(scene, folder)
        return paths, [f"the object is {found.fit}", *warnings, *notes]
    if name == "relight":
        from rgbn.relight_export import export_relight

        return export_relight(store, job.session.name)
    if lights.is_unknown:
        lights.check()
    from formats.light_files.light_formats import export_lights
    from formats.sfm_data import write_sfm

    paths, notes = export_lights(folder, name, lights, camera, files=job.frame_files)
    if name == "meshroom":
        paths.append(folder / "cameras.sfm")
        notes = write_sfm(paths[-1], camera, [path.resolve() for path in job.session.flash]) + notes
    return paths, notes


def _scene(scene: Any, folder: Path) -> Made:
    """Write scene.xml with all that it names."""
    from twin.engines.mitsuba_files import write_mitsuba

    made, notes = write_mitsuba(scene, folder)
    first = scene.lights.names[0]
    command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr {made[0]}"
    return [made[0]], [*notes, f"{len(scene.lights)} lights, one at a time: {command}"]
