"""How far lights, intensities or the dark may be off before a method breaks: the smallest strength, by bisection."""

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.recipe import Cell, Recipe
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from solve.methods import UNCALIBRATED
from solve.solve import solve

BREAKS_DEG = 10.0
"""Median angular error past which a method counts as broken."""
STEPS = 7
EASY = Recipe(shape="pear", side=128, noise=0.005)
"""32 flashes over a cap of 60 degrees, a matte pear, a good camera's noise: every method's default solves it."""
DRAWS = 5


@dataclass(frozen=True)
class Perturbation:
    """One quantity that is made wrong."""

    name: str  # in the tables, as an experiment's
    label: str
    unit: str  # of the strength
    least: float  # the strengths that are looked between
    most: float


PERTURBATIONS = {
    one.name: one
    for one in (
        Perturbation("light directions off", "Light directions", "°", 0.5, 64.0),
        Perturbation("intensities off", "Intensities", "%", 1.0, 128.0),
        Perturbation("ambient left in", "Ambient", "%", 1.0, 128.0),
    )
}


def perturbation_cells(methods: tuple[str, ...], *, quick: bool = False) -> Iterator[Cell]:
    """Yield a cell for each quantity and draw."""
    for name in PERTURBATIONS:
        for seed in range(1 if quick else DRAWS):
            yield Cell(name, 0, 0.0, replace(EASY, seed=seed), methods)


def perturbed(photographs: Any, name: str, strength: float, seed: int) -> tuple[Frames, Lights]:
    """Return the frames and the lights as a method is given them.

    light directions off: each is turned about an axis of its own, `strength` degrees root mean square. intensities off:
    each is multiplied by exp(`strength` / 100 x a normal number). ambient left in: to every frame is added `strength` %
    of what a flash along the normal gives. Strengths of one draw, `seed`, have the same axes and numbers.
    """
    frames, lights = photographs.frames, photographs.lights
    generator = np.random.default_rng([seed, list(PERTURBATIONS).index(name), 4711])
    if name == "light directions off":
        numbers = generator.standard_normal((len(lights), 3))
        numbers -= np.sum(numbers * lights.directions, 1, keepdims=True) * lights.directions
        # Two numbers across the direction: their sum of squares is 2 on the mean.
        angle = np.radians(strength) / np.sqrt(2) * np.linalg.norm(numbers, axis=1, keepdims=True)
        return frames, replace(lights, directions=np.cos(angle) * lights.directions + np.sin(angle) * unit(numbers))
    if name == "intensities off":
        factors = np.exp(strength / 100 * generator.standard_normal((len(lights), 1)))
        return frames, replace(lights, intensities=lights.intensities * factors).normalised()
    share = np.float32(strength / 100)
    linear = frames.read() + share * np.nan_to_num(photographs.albedo)
    # Exposed anew, as for the cells of `ambient`: nothing is clipped.
    return Frames.from_linear(frames.names, linear / (1 + share)), lights


def breaking_point(
    photographs: Any, cell: Cell, method: str, profile: str, executor: Executor
) -> tuple[float | None, Any]:
    """Return the smallest strength that breaks a method, and its estimate there, None where it refused.

    Broken: a median error past `BREAKS_DEG`, or no result. 0 where that is so unperturbed; None where not even the
    greatest strength does it, with the estimate of that. Bisection of the logarithm: where the error does not rise
    evenly it finds one crossing, not the first.
    """
    from scene.normals import angular_error_deg

    one, p = PERTURBATIONS[cell.experiment], photographs

    def breaks(strength: float) -> tuple[bool, Any]:
        frames, lights = perturbed(p, one.name, strength, cell.recipe.seed)
        try:
            found = solve(method, frames, lights, p.camera, p.mask, profile=profile, executor=executor)
        except SceneError:
            return True, None
        error = angular_error_deg(found.normals, p.normals)[p.mask]
        known = error[np.isfinite(error)]
        return not (len(known) > len(error) / 2 and np.median(known) <= BREAKS_DEG), found

    is_broken, found = breaks(0.0)
    if is_broken:
        return 0.0, found
    is_broken, found = breaks(one.most)
    if not is_broken:
        return None, found
    low, high = one.least, one.most
    for _ in range(STEPS):
        middle = float(np.sqrt(low * high))
        is_broken, estimate = breaks(middle)
        if is_broken:
            high, found = middle, estimate
        else:
            low = middle
    return high, found


def is_told(method: str, name: str) -> bool:
    """Tell whether a method is given the quantity at all."""
    return not (name == "light directions off" and method in UNCALIBRATED)
