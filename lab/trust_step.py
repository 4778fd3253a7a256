"""The step `trust`: each method's error predicted from the photographs, and one answer joined from all."""

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.job import Job, Outcome
from lab.progress import alive, progress_bar
from scene.errors import SceneError
from scene.files import write_npy, write_png
from scene.normals import angular_error_deg

FOLDER = "trust"
"""In the output folder: a predicted error NAME.npy for each method, and `nearest.png`."""


@alive(FOLDER)
def trust(job: Job) -> Outcome:
    """Predict how far each method is off, and write the answer that all give together as the method `best`."""
    from solve.frame_intensities import corrected
    from solve.trust.joined_estimate import estimate_of
    from solve.trust.trust import trust as predict

    store = job.store
    frames, camera, mask = store.load_frames(), store.load_camera(), store.load_mask()
    lights, _ = corrected(frames, store.load_lights(), camera, mask)
    answers = {name: store.read_array("normals", f"{name}.npy") for name in job.methods}
    noise = {name: store.read_array("sigma", f"{name}.npy") for name in answers}
    try:
        with progress_bar(FOLDER) as progress:
            judged = predict(
                frames, lights, camera, mask, answers, sigma_deg=noise, profile=job.profile, progress=progress,
            )  # fmt: skip
    except SceneError as error:
        return Outcome({}, [str(error)])
    store.save_estimate(estimate_of(judged, frames, lights, camera, mask, executor=job.executor))
    shown = {**answers, "best": judged.best}
    for name, normals in shown.items():
        write_npy(store.path(FOLDER, f"{name}.npy"), judged.predicted_deg(normals))
    write_png(store.path(FOLDER, "nearest.png"), judged.won)
    methods: dict[str, dict[str, Any]] = {name: asdict(row) for name, row in judged.methods.items()}
    if store.path("normals", "truth.npy").exists():
        truth = store.load_normals("truth")
        for name, normals in shown.items():
            methods[name]["true"] = _true(normals, truth, mask, judged.predicted_deg(normals))
    result = {
        "recommended": judged.recommended,
        "margin_deg": judged.margin_deg,
        "doubt_deg": judged.doubt_deg,
        "world_relative_rmse": judged.world_rms,
        "methods": methods,
    }
    return Outcome(result, [])


def _true(normals: NDArray, truth: NDArray, mask: NDArray[np.bool_], predicted_deg: NDArray) -> dict[str, Any]:
    """Return a method's true errors, and the share of pixels whose error is within twice the predicted one."""
    from compare.statistics.statistics import angular_statistics

    error = angular_error_deg(normals[mask], truth[mask])
    found = angular_statistics(error)
    known = np.isfinite(error) & np.isfinite(predicted_deg[mask])
    within = float(np.mean(error[known] <= 2 * predicted_deg[mask][known])) if known.any() else None
    p90 = float(np.percentile(error[known], 90)) if known.any() else None
    return {"median_deg": found["median_deg"], "mean_deg": found["mean_deg"], "p90_deg": p90, "within_2_sigma": within}
