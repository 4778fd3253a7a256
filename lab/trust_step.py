"""The step `trust`: which method's normals the photographs speak for."""

from lab.job import Job, Outcome
from lab.progress import alive
from scene.errors import SceneError


@alive("trust")
def trust(job: Job) -> Outcome:
    """Find which method predicts frames best that it is not given, and how far the others are from it."""
    from solve.frame_intensities import corrected
    from solve.trust import trust as judge

    store = job.store
    frames, camera, mask = store.load_frames(), store.load_camera(), store.load_mask()
    lights, _ = corrected(frames, store.load_lights(), camera, mask)
    answers = {name: store.read_array("normals", f"{name}.npy") for name in job.methods}
    try:
        found = judge(frames, lights, camera, mask, answers, profile=job.profile)
    except SceneError as error:
        return Outcome({}, [str(error)])
    result = {
        "recommended": found.recommended,
        "level": found.level,
        "relative_rmse": found.relative_rmse,
        "doubts": found.doubts,
        "methods": {name: row._asdict() for name, row in found.methods.items()},
    }
    return Outcome(result, [f"trust: {text}" for text in found.doubts])
