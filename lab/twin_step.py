"""The verb `twin`: the registered scan rendered under the calibrated lights, and solved like the photographs."""

from dataclasses import asdict, replace
from typing import Any

from lab.job import Job, Outcome
from lab.progress import alive, progress_bar, say
from lab.steps import material_method, solve_all
from scene.errors import RenderError
from scene.store import Store

ENOUGH = 0.5
"""Of the share of the photographs that the material leaves unexplained: an error of the rendering that hides in it."""


@alive("twin")
def twin(job: Job) -> Outcome:
    """Render the registered scan under the calibrated lights, and solve the rendering too."""
    store = job.store
    if not store.path("pose.json").exists():
        # Not a warning of its own: that there is no scan, or that it is not used, was said when it was to be aligned.
        return Outcome({"rendered": False})
    folder = Store(store.path("twin"))
    # Scene and true normals are gone before the solvers' maps come.
    result, warnings = _render(job, folder)
    solved, more = solve_all(job, folder, "twin")
    result["twin_seconds"] = {method: row["seconds"] for method, row in solved["methods"].items()}
    return Outcome(result, [*warnings, *(f"twin: {text}" for text in more)])


def _render(job: Job, folder: Store) -> tuple[dict[str, Any], list[str]]:
    """Write the twin as a session of its own; return what the summary keeps of it, and what is suspicious."""
    from twin.engines.render import render_scene
    from twin.twin_session import Shooting, write_session

    store = job.store
    scene, material, scene_warnings = twin_scene(job)
    say(f"twin: {material['sentence']}")
    say(f"twin: rendered to an error of {100 * scene.sampling.error:.2g} %")
    with progress_bar("twin") as progress:
        rendered = render_scene(
            scene,
            apart=job.twin.layers,
            executor=job.executor,
            store=folder,
            progress=progress,
            tell=say,
        )
    sensor = _sensor(job) if job.twin.photograph else None
    camera, truth = store.load_camera(), store.load_normals("truth")
    write_session(
        folder, rendered.frames, camera, store.load_lights(), store.load_mask(), truth, shooting=Shooting(sensor)
    )
    if sensor is not None:
        _develop(folder)
    facts = rendered.facts()
    facts["warnings"] = (*scene_warnings, *rendered.warnings)
    photographed = {} if sensor is None else {"sensor": asdict(sensor)}
    return {"rendered": True, "material": material, **facts, **photographed}, list(facts["warnings"])


def twin_scene(job: Job) -> tuple[Any, dict[str, Any], list[str]]:
    """Return the registered scan under the calibrated lights as a scene: of the material that explains the photographs.

    Returns
    -------
    scene : twin.description.description.TwinScene
    material : dict
        `twin.material.scan_material.ScanMaterial.facts`; where it could not be fitted, model and sentence alone: matte,
        of a solver's albedo.
    warnings : list of str
    """
    from twin.description.description import Sampling
    from twin.material.material_light import material_scene
    from twin.material.scan_material import scan_material
    from twin.scan_scene import scan_scene
    from twin.visibility import Sight

    store, lights = job.store, job.store.load_lights()
    sight = Sight.of_scan(job.load_scan(), store.load_pose(), store.load_camera(), lights)
    sampling = job.twin.sampling(Sampling())
    try:
        found = scan_material(sight, store.load_frames(), store.load_mask(), store.load_normals("truth"))
    except RenderError as error:
        method = material_method(job)
        reason = f"matte, of the albedo of {method}: no material could be fitted. {error}"
        albedo = store.read_array("albedo", f"{method}.npy")
        # The solvers evaluate near lights at this one depth; the scan knows better.
        depth = float(lights.reference_point_mm[2])
        scene, warnings = scan_scene(sight, albedo, sampling, albedo_depth_mm=depth)
        return scene, {"model": "matte", "sentence": reason}, [f"The twin is {reason}", *warnings]
    if job.twin.error is None:
        # No more than the scene needs: what the material is wrong by, exact light would not mend.
        sampling = replace(sampling, error=max(sampling.error, ENOUGH * found.residual.whole))
    scene, warnings = material_scene(sight, found.places.fits, found.labels, found.albedo, sampling)
    return scene, found.facts(), [*found.warnings, *warnings]


def _sensor(job: Job) -> Any:
    """Return a sensor as noisy as the session's, of its kind."""
    from twin.camera.grain import sensor_like

    frames = job.store.load_frames()
    sensor, iso = sensor_like(frames), (job.done["check"]["result"]["frames_table"][0].get("iso") or 100)
    bayer = frames.is_mosaic and not job.session.half and frames.width % 2 == 0 and frames.height % 2 == 0
    # The full well was measured at the session's ISO.
    return replace(sensor, cfa="RGGB" if bayer else "none", iso=iso, full_well_e=sensor.full_well_e * iso / 100)


def _develop(folder: Store) -> None:
    """Put a twin's photographs in the place of its rendered frames."""
    from capture.photographs.decode import decode
    from capture.session.session import load_session

    with progress_bar("twin: decode") as progress:
        decode(load_session(folder.folder), folder, progress=progress)
