"""`rgbn export --format mitsuba,gltf`: a session's twin, or a scene description, as files of other programs."""

from pathlib import Path
from typing import Any

from lab.job import Job
from lab.plan import EXPORTED
from lab.run import is_description, open_job
from lab.twin_step import twin_scene
from scene.errors import SceneError
from scene.output_folder import open_record


def export_scene(source: Path, out: Path | None, names: list[str]) -> tuple[list[Path], list[str]]:
    """Write a scene for other programs into OUT/export.

    Parameters
    ----------
    source : Path
        A session's folder: the twin that `rgbn twin` renders, registered and solved first if it is not yet. Or a scene
        description's .toml.
    out : Path or None
        Default: out/NAME.
    names : list of str
        `mitsuba`: scene.xml with all that it names. `gltf`: scene.glb.

    Returns
    -------
    paths : list of Path
        scene.xml, scene.glb.
    notes : list of str
        How to render it, and what the files cannot say.

    Raises
    ------
    SceneError
        The scene cannot be rendered, the format cannot hold it, or the session has no scan.
    """
    from twin.description.description_file import read_scene

    if is_description(source):
        scene = read_scene(source)
        with open_record(out or Path("out") / source.stem, inputs=[source]) as record:
            return _written(scene, record.folder / "export", names, {})
    with open_job(source, out=out) as job:
        scene, material, warnings = _session_scene(job)
        with job.record.part_of(EXPORTED):
            paths, notes = _written(scene, job.store.path("export"), names, material)
    return paths, [f"the object is {material['sentence']}", *warnings, *notes]


def _written(scene: Any, folder: Path, names: list[str], material: dict[str, Any]) -> tuple[list[Path], list[str]]:
    from twin.description.gltf_file import write_gltf
    from twin.engines.mitsuba_files import write_mitsuba

    paths, notes = [], []
    if "mitsuba" in names:
        made, more = write_mitsuba(scene, folder)
        first = scene.lights.names[0]
        command = f"mitsuba -m llvm_ad_rgb -D light={first} -o {first}.exr {made[0]}"
        paths, notes = [made[0]], [*more, f"{len(scene.lights)} lights, one at a time: {command}"]
    if "gltf" in names:
        kept = {key: material[key] for key in ("sentence", "relative_rmse") if key in material}
        folder.mkdir(parents=True, exist_ok=True)
        notes += write_gltf(scene, folder / "scene.glb", kept)
        paths.append(folder / "scene.glb")
        if "relative_rmse" in kept:
            notes.append(f"its material misses the photographs by {100 * kept['relative_rmse']:.1f} % (rms)")
    return paths, notes


def _session_scene(job: Job) -> tuple[Any, dict[str, Any], list[str]]:
    from lab.plan import STEPS

    job.run(STEPS, "solve")
    if not job.store.path("pose.json").exists():
        raise SceneError(
            f'{job.session.name}: no scan is registered, so there is no twin to export. Add [object] scan = "..." to '
            "session.toml."
        )
    scene, material, warnings = twin_scene(job)
    return scene, material, warnings
