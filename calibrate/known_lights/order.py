"""Is a lights file in the photographs' order? Lambert's law knows, whatever the surface.

Every matte pixel says v_f = b . l_f with a vector b of its own. Three unknowns fit many frames only if each frame has
its own light. Lights in other axes fit as well (b follows them): these are told by balls, or by `solve.axes_test`.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibrate.known_lights.read_known import lacks_intensities
from calibrate.without_balls.from_object import varied
from calibrate.without_balls.probe import Probe, read_probe
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights

Array = NDArray[np.float64]
PIXELS, FEWEST_PIXELS = 12000, 200
FEWEST_FRAMES = 6
"""Below, three unknowns a pixel fit any order."""
LIT = 0.15
"""Share of a pixel's brightest samples under which it is taken to stand in shadow."""
SUSPICIOUS = 0.06
"""Relative misfit under which nothing is looked for."""
BETTER = 0.7
"""Share of the misfit that another order must leave at most."""
CHANCE = 0.55
"""Share of the misfit of lights at random from which the file tells nothing of these photographs."""


def wrong_order(frames: Frames, camera: Camera, lights: Lights, region: NDArray[np.bool_]) -> str | None:
    """Say which other order of the lights explains the photographs, or that none does; None where theirs will do.

    Parameters
    ----------
    region : (H, W) bool
        Pixels to be asked: the object, or all that is no mirror.
    """
    count = len(lights)
    probe = read_probe(frames, region, most=PIXELS)
    if count < FEWEST_FRAMES or not len(probe.pixels):
        return None
    depth = float(lights.reference_point_mm[2])

    def toward_of(pixels: NDArray) -> Array:
        return lights.toward(camera.points_at_depth(pixels, depth) if depth < 0 else np.zeros((len(pixels), 3)))

    # A table is one normal, and fits any order: pixels that face many ways tell.
    probe = probe.take(varied(probe, toward_of(probe.pixels)))
    if len(probe.pixels) < FEWEST_PIXELS:
        return None
    values, weight = _samples(probe)
    toward = np.moveaxis(toward_of(probe.pixels) * lights.intensities.mean(1)[:, None, None], 0, 1)

    # What the file does not tell of the strengths is the photographs' to tell, in each order anew.
    rounds = 4 if lacks_intensities(lights) else 1

    def misfit(order: NDArray[np.intp]) -> float:
        light, strength = toward[:, order] * weight[..., None], np.ones(count)
        matrix = np.linalg.inv(np.swapaxes(light, 1, 2) @ light + 1e-9 * np.eye(3))
        rest = values
        for turn in range(rounds):
            right = np.swapaxes(light, 1, 2) @ (values / strength)[..., None]
            shade = (light @ (matrix @ right))[..., 0]
            if turn < rounds - 1:
                strength = np.sum(shade * values, 0) / np.maximum(np.sum(shade**2, 0), 1e-12)
                strength = np.clip(strength / strength.mean(), 0.1, 10)
            rest = values - shade * strength
        return float(np.median(np.sqrt(np.sum(rest**2, 1) / np.sum(values**2, 1))))

    here = np.arange(count)
    given = misfit(here)
    if given < SUSPICIOUS:
        return None
    trials = [(f"{k} frames later", np.roll(here, k)) for k in range(1, count)] + [("in reverse order", here[::-1])]
    if count <= 40:
        for i, j in combinations(range(count), 2):
            order = here.copy()
            order[[i, j]] = j, i
            trials.append((f"with {frames.names[i]} and {frames.names[j]} exchanged", order))
    words, best = min(((words, misfit(order)) for words, order in trials), key=lambda trial: trial[1])
    if best < BETTER * given:
        return (
            f"lights.file: the photographs miss Lambert's law by {given:.0%} under these lights, but only by "
            f"{best:.0%} {words}: the lights are in another order than the photographs. Correct lights.file; it is "
            "used as it stands."
        )
    rng = np.random.default_rng(0)
    chance = float(np.median([misfit(rng.permutation(count)) for _ in range(20)]))
    if given > CHANCE * chance:
        return (
            f"lights.file: the photographs miss Lambert's law by {given:.0%} under these lights, and by "
            f"{chance:.0%} under the same in any order: the lights do not belong to these photographs, or their order "
            "is lost. Correct lights.file; it is used as it stands."
        )
    return None


def _samples(probe: Probe) -> tuple[Array, Array]:
    """Return the lit, unclipped values (P, F), zero elsewhere, and which they are, 1 or 0."""
    values = probe.values.mean(-1, dtype=np.float64).T
    bright = np.quantile(values, 0.9, axis=1, keepdims=True)
    weight = (~probe.clipped.T & (values > LIT * bright)).astype(np.float64)
    return values * weight, weight
