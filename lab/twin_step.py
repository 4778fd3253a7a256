"""The verb `twin`: the registered scan rendered under the calibrated lights, and solved like the photographs."""

import shutil
from dataclasses import asdict, replace
from typing import Any

from lab.job import Job, Outcome
from lab.progress import progress_bar, say
from lab.steps import solve_all
from scene.errors import RenderError
from scene.store import Store


def twin(job: Job) -> Outcome:
    """Render the registered scan under the calibrated lights, and solve the rendering too."""
    store = job.store
    if not store.path("pose.json").exists() or store.load_lights().is_unknown:
        # Not a warning of its own: what there is not, scan or lights, was said when it was to be aligned.
        return Outcome({"rendered": False})
    folder = Store(store.path("twin"))
    try:
        scene, found, scene_warnings = twin_scene(job)
    except RenderError as error:
        return Outcome({"rendered": False}, [f"There is no twin. {error}"])
    result, warnings = _render(job, folder, scene, found, scene_warnings)
    # They are large, and the solvers' maps come.
    del scene, found
    solved, more, _ = solve_all(job, folder, "twin", job.methods)
    result["twin_processor_seconds"] = {method: row["processor_seconds"] for method, row in solved["methods"].items()}
    return Outcome(result, [*warnings, *(f"twin: {text}" for text in more)])


def _render(
    job: Job, folder: Store, scene: Any, found: Any, scene_warnings: list[str]
) -> tuple[dict[str, Any], list[str]]:
    """Write the twin as a session of its own; return what the summary keeps of it, and what is suspicious."""
    from capture.photographs.decode import decode
    from capture.session.session import load_session
    from twin.engines.render import render_scene
    from twin.session_scene import session_sensor
    from twin.twin_session import Shooting, write_session

    store = job.store
    say(f"twin: {str(found.fit).partition(': ')[0]}")
    say(f"twin: rendered to an error of {100 * scene.sampling.error:.2g} %")
    with progress_bar("twin") as progress:
        how = {"apart": job.twin.layers, "executor": job.executor, "progress": progress, "tell": say}
        rendered = render_scene(scene, store=folder, **how)
    sensor = None
    if job.twin.photograph:
        iso = job.done["check"]["result"]["frames_table"][0].get("iso") or 100
        sensor = session_sensor(store.load_frames(), half=job.session.half, iso=iso)
    camera, truth = store.load_camera(), store.load_normals("truth")
    write_session(
        folder, rendered.frames, camera, store.load_lights(), store.load_mask(), truth, shooting=Shooting(sensor)
    )
    if sensor is not None:
        # The twin's photographs take the place of its rendered frames.
        with progress_bar("twin: decode") as progress:
            decode(load_session(folder.folder), folder, progress=progress)
    predicted = _held_out(job, scene, rendered.choice) if job.twin.held_out else None
    facts = rendered.facts() | {"warnings": [*scene_warnings, *rendered.warnings]}
    facts |= {} if sensor is None else {"sensor": asdict(sensor)}
    return {"rendered": True, "material": found.facts(), "held_out": predicted, **facts}, facts["warnings"]


def twin_scene(job: Job) -> tuple[Any, Any, list[str]]:
    """Return the twin's scene, its material, warnings; see `twin.session_scene.session_scene`."""
    from twin.description.description import Sampling
    from twin.session_scene import session_scene

    sampling, how = job.twin.sampling(Sampling()), job.twin
    return session_scene(job.store, job.load_scan(), sampling, is_error_given=how.error is not None)


def _held_out(job: Job, scene: Any, choice: Any) -> dict[str, Any] | None:
    """Fit the material to half of the frames, predict the others; return what the summary keeps of it."""
    from twin.engines.render import render_scene
    from twin.relighting import relighting
    from twin.session_scene import session_sight

    # As the twin was rendered.
    sampling = replace(scene.sampling, engine=choice.engine, samples=choice.samples)
    with progress_bar("twin: frames not fitted to") as progress:
        scratch = job.record.scratch("predicted")
        how: Any = {"executor": job.executor, "progress": progress, "scratch": scratch}
        try:
            known = session_sight(job.store, job.load_scan()), job.store.load_frames(), job.store.load_mask()
            found = relighting(*known, sampling, lambda unseen: render_scene(unseen, **how).frames)
        except RenderError as error:
            say(f"twin: not held against frames that it was not fitted to. {error}")
            return None
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    say(f"twin: {found}")
    return found.facts()
