"""In whose axes normals and lights are: told by the photographs under known lights, and by a normal map itself.

Convex for concave is one of these ways. Uncalibrated methods see no difference between a surface under its lights and
the inverted surface under mirrored ones. Lights that were calibrated know.
"""

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from solve.pixelwise.kernels import least_squares
from solve.plausible_axes import AXES, INVERTED, axes_words, plausible_axes
from solve.problem import Problem, spread_over
from solve.samples import Samples, all_samples

Array = NDArray[np.float64]

PIXELS = 4000
_EXPLAINED = 0.75
"""Share of what least squares explains of the photographs, beyond normals at random, under which a map is refused.

True normals of glossy objects explain 0.96 and more, right normals in wrong axes 0.64 at most, a shifted map 0.7."""
_CAUTIOUS = 0.9
_TELLING = 0.1
"""Share of the misfit of normals at random that must be removed, or the object tells nothing of axes."""
_ALIKE = 0.05
"""Axes whose misfit lies within this share of the best's gain count as equally good."""
_WHOLE, _LEAST = 0.25, 0.003
"""Share of what the lights can tell by which the inverted relief must be the better one; misfit that is noise's as well
as any relief's."""
_LAMBERT = 0.15**2
"""Misfit of Lambert's law, the same in all axes, above which something else is wrong: the order, the strengths."""
_LIT, _FEWEST_LIT = 0.05, 4
"""Share of a pixel's brightest sample under which it stands in shadow; lit samples that tell a normal and a misfit."""


class _Lit:
    """Samples (P, F) under known lights, against which normals are held."""

    def __init__(self, samples: Samples) -> None:
        self.samples, self.valid, self.toward = samples, samples.valid, samples.toward()
        self.values = samples.valid * np.maximum(samples.gray, 0).astype(np.float64)
        self.lit = self.valid & (self.values > _LIT * self.values.max(1, keepdims=True))

    def misfit(self, normals: Array) -> float:
        """Return the median over pixels of the misfit under normals (P, 3), min_r |m - r max(0, l . n)|^2 / |m|^2."""
        shade = np.maximum(np.einsum("pfi,pi->pf", self.toward, normals), 0) * self.valid
        square, power = (shade**2).sum(1), (self.values**2).sum(1)
        explained = np.divide((self.values * shade).sum(1) ** 2, square, out=np.zeros_like(square), where=square > 0)
        seen = (power > 0) & np.isfinite(explained)
        return float(np.median(1 - explained[seen] / power[seen])) if seen.any() else 1.0

    def by_chance(self, normals: Array) -> float:
        """Return the misfit of the same normals dealt out to the pixels at random."""
        return self.misfit(normals[np.random.default_rng(0).permutation(len(normals))])

    def least_squares(self) -> Array:
        """Return each pixel's own albedo x normal (P, 3), by its lit samples."""
        return least_squares(self.samples, self.lit.copy(), self.valid)


def find_axes(normals: Array, samples: Samples, *, name: str) -> tuple[Array, tuple[str, ...]]:
    """Return the axes of `AXES` in which unit normals (P, 3) explain the photographs, and what is to be said of them.

    `name` stands in messages.

    Raises
    ------
    SceneError
        No axes explain them.

    Notes
    -----
    A candidate's misfit is set between that of the same normals dealt out to the pixels at random, and that of least
    squares, so that gloss, which no normal explains, counts neither way.
    """
    lit = _Lit(samples)
    misfit = np.array([lit.misfit(normals @ axes.T) for axes in AXES])
    best = int(misfit.argmin())
    by_chance = lit.by_chance(normals @ AXES[best].T)
    least = min(misfit[best], lit.misfit(lit.least_squares()))
    if by_chance - least < _TELLING * by_chance:
        said = "the object is too flat to tell the axes of its normals from the photographs: taken as x, y, z."
        return AXES[0], (said,)
    explained = (by_chance - misfit[best]) / (by_chance - least)
    if explained < _EXPLAINED:
        raise SceneError(
            f"{name}: its normals do not explain the photographs by the lights, whichever way their axes are flipped "
            f"or swapped (the best way {axes_words(AXES[best])} explains {max(explained, 0):.0%} of what least squares "
            f"does, expected {_EXPLAINED:.0%}). Is the picture upside down, of another object, or in a frame that is "
            "turned?"
        )
    alike = misfit <= misfit[best] + _ALIKE * (by_chance - misfit[best])
    cautions = ()
    if explained < _CAUTIOUS:
        cautions = (f"its normals explain {explained:.0%} only of what least squares does of the photographs.",)
    if alike[0]:
        return AXES[0], cautions
    if np.array_equal(AXES[best], INVERTED):
        cautions += ("its relief is inverted, convex for concave: the lights say so, and x and y are negated.",)
    if alike.sum() > 1:
        other = axes_words(AXES[next(k for k in np.argsort(misfit) if k != best)])
        cautions += (f"its axes may be {axes_words(AXES[best])} or {other}: both explain the photographs.",)
    return AXES[best], cautions


def relief_cautions(
    normals: NDArray, frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_]
) -> tuple[str, ...]:
    """Return what is to be said of the relief of normals (H, W, 3), camera frame, NaN where unknown.

    Nothing under unknown lights, nor of an object that is too flat to tell. The normals stay as a method gave them:
    what is its own is to be judged as its own.
    """
    known = mask & np.isfinite(normals[..., 0]) & (normals[..., 2] > 0)
    if lights.is_unknown or not known.any():
        return ()
    thin = spread_over(known, PIXELS)
    lit = _Lit(all_samples(Problem.of(frames, lights, camera, thin)))
    there = normals[thin].astype(np.float64)
    chance, own, inverted = lit.by_chance(there), lit.misfit(there), lit.misfit(there @ INVERTED)
    room = chance - min(own, inverted)
    if room < _TELLING * chance or own <= _LEAST or own - inverted <= _WHOLE * room:
        return ()
    return (
        "its relief is inverted, convex for concave: under the calibrated lights normals with x and y negated "
        f"explain the photographs to {inverted:.1%}, its own to {own:.1%} only. It is left as the method gave it; "
        "believe a calibrated method.",
    )


def lights_in_other_axes(frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_]) -> str | None:
    """Say in which axes known lights must be for the object to be a surface; None where they make sense as they are.

    Lambert's law fits lights in any axes: the normals follow. But turned normals are no surface's slope, or point into
    it at its rim; the latter are a hollow's too. Nothing is said where Lambert's law does not fit.
    """
    small = Problem.of(frames, lights, camera, mask).thinned(2 * PIXELS)
    lit = _Lit(all_samples(small))
    fitted = lit.least_squares()
    if lit.misfit(fitted) > _LAMBERT:
        return None
    normals = np.full((*small.mask.shape, 3), np.nan)
    normals[small.mask] = np.where((lit.lit.sum(1) >= _FEWEST_LIT)[:, None], unit(fitted), np.nan)
    found = plausible_axes(normals, small.mask)
    best = found.by_rim if found.is_unique else found.plain
    if not best:
        return None
    fault, makes = "is no surface's slope", "It makes"
    if not found.plain:
        # Its slopes do not speak against the file: only the rim does.
        fault, makes = "points inward at its rim", "Unless it is hollow, it makes"
    return (
        f"lights.file: under its lights the object {fault}. {makes} sense if the file's axes are changed to "
        f"{axes_words(AXES[best])}; expected are x right, y up, z toward the viewer. Correct lights.file; it is used "
        "as it stands."
    )
