"""The answer that all methods give together, as an estimate like each of theirs: albedo, samples, condition."""

from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from scene.camera import Camera
from scene.clock import now, since
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from solve.given_normals import NoSettings, with_lambertian_albedo
from solve.methods import Method, Whole
from solve.problem import Problem
from solve.samples import Samples
from solve.solve import solve
from solve.trust.trust import Trust

BEST = "best"


def estimate_of(
    judged: Trust, frames: Frames, lights: Lights, camera: Camera, mask: Any, *, executor: Executor | None = None
) -> Estimate:
    """Return the joined normals with the albedo of Lambert's law under them; sigma is their predicted error.

    sigma_deg is along one tangent axis, as everywhere: the predicted error is the root mean square of the whole angle.
    """
    start = now()
    normals = np.nan_to_num(judged.best[mask]).astype(np.float64)

    def fit(_problem: Problem, samples: Samples, _settings: Any) -> Whole:
        return with_lambertian_albedo(normals, samples, ())

    method = Method(BEST, {"default": NoSettings()}, fit_whole=fit)
    found = solve(method, frames, lights, camera, mask, executor=executor)
    sigma = (judged.sigma_deg / np.sqrt(2)).astype(np.float32)
    return replace(found, **since(start), sigma_deg=sigma)
