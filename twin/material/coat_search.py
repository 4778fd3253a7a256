"""The coat that suits samples best: each pixel's albedo eliminated [Golub1973], weights and fit in turn."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.description.materials import Distribution
from twin.material.material_kernels import predicted, reduced
from twin.material.material_noise import Noise, deviances, first_noise, inflation, noise_of, student_weights
from twin.material.material_samples import Samples
from twin.material.reflection_models import Coat, coat

Array = NDArray[np.float64]

SMOOTHEST, ROUGHEST = 0.02, 1.0
TRIED = np.geomspace(SMOOTHEST, ROUGHEST, 25)
ROUNDS = 4
"""Of weights and fit in turn."""
STEP = 0.06
"""Of the logarithm of the roughness, between the three that a round puts a parabola through."""
BODY_STEP = 0.15
"""The same of a body's one number."""


class Body(NamedTuple):
    """How a body lies below the coat.

    words: What the evidence says of it.
    tried: What of `twin.material.reflection_models.coat`.
    free: The one that is searched, if any.
    """

    words: str
    tried: tuple[dict[str, float], ...]
    free: str | None = None


SHARES = (0.0, 0.33, 0.67, 1.0)
COVERED = Body("all of the body covered", ({"covered": 1.0},))
PARTLY = Body("part of the body bare", tuple({"covered": share} for share in SHARES), "covered")
ROUGH = Body("a rough body", tuple({"covered": 0.0, "body": share} for share in SHARES), "body")


@dataclass(frozen=True, eq=False)
class Fit:
    """One model, fitted.

    strength (3,): Of the coat, by channel: its specularity times the pixel value of a surface of reflectance 1 (1 where
        that is unknown).
    parameters: Beside the albedo.
    """

    surface: Coat
    strength: Array
    parameters: int


class CoatSearch:
    """The best coat on samples.

    white (3,): Pixel value of reflectance 1: the coat is gray by it. None: each channel for itself.
    most (3,): Of the strength.
    body: What is supposed of it.
    distribution: Of the coat's facets.
    about: Where the search starts, its distribution the same; None: everywhere.
    """

    def __init__(
        self, samples: Samples, white: Array | None, most: Array, body: Body, distribution: Distribution,
        about: Fit | None = None,
    ) -> None:  # fmt: skip
        self._samples, self._white, self._most, self.body = samples, white, most, body
        self._parameters = (2 if white is not None else 4) + (body.free is not None)
        variance = first_noise(samples).variance(samples.values, np.zeros_like(samples.values))
        self.weights = np.where(samples.usable[..., None], 1 / variance, 0).astype(np.float32)
        self.fit = self._anywhere(distribution) if about is None else about
        self.noise = self._weigh()
        for _ in range(ROUNDS):
            self.fit = self._along_roughness(self._along_body(self.fit))
            self.noise = self._weigh()

    def on(self, samples: Samples) -> "CoatSearch":
        """Return the search on other samples, about what was found on these."""
        facets = self.fit.surface.distribution
        return CoatSearch(samples, self._white, self._most, self.body, facets, about=self.fit)

    def predicted(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return what the coat gives back (P, F, 3), and its variance."""
        values, slope, _ = predicted(self._samples, self.weights, self.fit.surface, self.fit.strength)
        return values, self.noise.variance(values, slope)

    def inflation(self) -> float:
        """Return by how much the samples count too often; see `twin.material.material_noise.inflation`."""
        values, variance = self.predicted()
        samples = self._samples
        residual = (samples.values - values) / np.sqrt(variance)
        return inflation(samples, np.where(samples.usable[..., None], residual, 0))

    def deviance(self) -> float:
        """Return -2 log likelihood with the noise that suits this coat, up to a constant."""
        return float(deviances(self._samples, *self.predicted()).sum())

    def covariance(self) -> Array:
        """Return that of the logarithms of roughness and strength: the inverse of half the second differences."""
        strength, step = self.fit.strength, 0.03
        if not strength.any():
            return np.full((2, 2), np.nan)
        middle_at = float(np.log(self.fit.surface.roughness))
        sums = {i: self._sums(roughened(self.fit.surface, middle_at + i * step)) for i in (-1, 0, 1)}

        def left(i: int, j: int) -> float:
            a, b, c = sums[i].T
            k = strength * np.exp(j * step)
            return float(np.sum(c - 2 * k * b + k * k * a))

        middle = left(0, 0)
        first = (left(1, 0) - 2 * middle + left(-1, 0)) / step**2
        second = (left(0, 1) - 2 * middle + left(0, -1)) / step**2
        mixed = (left(1, 1) - left(1, -1) - left(-1, 1) + left(-1, -1)) / (4 * step**2)
        bend = np.array([[first, mixed], [mixed, second]]) / 2
        if not (np.linalg.det(bend) > 0 and first > 0):
            return np.full((2, 2), np.nan)
        return np.asarray(np.linalg.inv(bend), np.float64)

    def _sums(self, surface: Coat) -> Array:
        return reduced(self._samples, self.weights, surface).sum(0)

    def _best(self, surface: Coat) -> tuple[float, Fit]:
        """Return the sum of squares that a surface leaves, and it with its best strength."""
        strength, left = strengths(self._sums(surface), self._white, self._most)
        return left, Fit(surface, strength, self._parameters)

    def _anywhere(self, distribution: Distribution) -> Fit:
        """Return the best coat of any roughness that is tried, over any body that is.

        A body that is dimmed too much or too little makes wide lobes attractive: both must be searched together.
        """
        tried = [coat(float(x), distribution=distribution, **body) for x in TRIED for body in self.body.tried]
        found = [self._best(surface) for surface in tried]
        return min(found, key=lambda one: one[0])[1]

    def _along_roughness(self, fit: Fit) -> Fit:
        middle = float(np.log(fit.surface.roughness))
        ends = float(np.log(SMOOTHEST)), float(np.log(ROUGHEST))
        return self._moved(lambda x: roughened(fit.surface, x), middle, STEP, 3, ends)

    def _along_body(self, fit: Fit) -> Fit:
        free = self.body.free
        if free is None:
            return fit
        here = getattr(fit.surface, free)
        return self._moved(lambda share: fit.surface._replace(**{free: share}), here, BODY_STEP, 4, (0.0, 1.0))

    def _moved(
        self, surfaces: Callable[[float], Coat], here: float, step: float, most: float, ends: tuple[float, float]
    ) -> Fit:
        """Return the best fit along one number: the lowest point of a parabola through three."""
        middle = float(np.clip(here, ends[0] + step, ends[1] - step))
        low, mid, high = (self._best(surfaces(middle + side * step))[0] for side in (-1, 0, 1))
        bend = low - 2 * mid + high
        move = 0.5 * (low - high) / bend if bend > 0 else np.sign(low - high) * most  # Level: it stays.
        return self._best(surfaces(float(np.clip(middle + step * np.clip(move, -most, most), *ends))))[1]

    def _weigh(self) -> Noise:
        """Put weights in place that suit the fit; return the noise."""
        samples = self._samples
        values, slope, _ = predicted(samples, self.weights, self.fit.surface, self.fit.strength)
        noise = noise_of(samples.values - values, values, slope, samples.usable)
        self.weights = student_weights(samples, values, noise.variance(values, slope))
        return noise


def roughened(surface: Coat, logarithm: float) -> Coat:
    """Return a coat with another roughness, by its logarithm; the body and all else stay."""
    return coat(float(np.exp(logarithm)), covered=surface.covered, distribution=surface.distribution, body=surface.body)


def strengths(sums: Array, white: Array | None, most: Array) -> tuple[Array, float]:
    """Return the best strength of each channel, no more than `most` (3,), and the sum of squares that it leaves.

    sums (3 channels, 3).
    """
    a, b, c = sums.T
    a = np.maximum(a, 1e-300)
    if white is None:
        strength = np.clip(b / a, 0, most)
    else:
        strength = white * np.clip(np.sum(white * b) / np.sum(white**2 * a), 0, np.min(most / white))
    return strength, float(np.sum(c - 2 * strength * b + strength**2 * a))
