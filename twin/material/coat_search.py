"""The coat that suits samples best: each pixel's albedo eliminated [Golub1973], weights and fit in turn."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.material.material_kernels import predicted, reduced
from twin.material.material_noise import Noise, deviances, first_noise, inflation, noise_of, student_weights
from twin.material.material_samples import MaterialSamples
from twin.material.reflection_models import Coat, coat

Array = NDArray[np.float64]

SMOOTHEST, ROUGHEST = 0.02, 1.0
TRIED = np.geomspace(SMOOTHEST, ROUGHEST, 25)
ROUNDS, SETTLED = 4, 2e-3
"""Of weights and fit in turn, at most; change of each number that is searched, below which they have come to rest."""
STEP = 1e-3
"""Of the finite differences: of shares, and of the roughness' logarithm."""


class Model(NamedTuple):
    """What is supposed of a coat and of the body below it.

    words: What the evidence says of it.
    tried: Numbers of `twin.material.reflection_models.coat`, each with all roughnesses.
    free: Those that are searched; the last is the roughness.
    has_coat: Else nothing reflects but the body.
    """

    words: str
    tried: tuple[dict[str, Any], ...]
    free: tuple[str, ...] = ("roughness",)
    has_coat: bool = True


SHARES = (0.0, 0.33, 0.67, 1.0)
COVERED = Model("a coated body", ({},))
METAL = Model("a metal", ({"is_metal": True},), has_coat=False)
ROUGH = Model("a rough body", tuple({"body": share} for share in SHARES), ("body", "roughness"))


@dataclass(frozen=True, eq=False)
class CoatFit:
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
    model: What is supposed of coat and body.
    about: Where the search starts; None: everywhere.
    """

    def __init__(
        self, samples: MaterialSamples, white: Array | None, most: Array, model: Model, about: CoatFit | None = None
    ) -> None:  # fmt: skip
        self._samples, self._white, self._most, self.model = samples, white, model.has_coat * most, model
        self._parameters = model.has_coat * (1 if white is not None else 3) + len(model.free)
        variance = first_noise(samples).variance(samples.values)
        self.weights = np.where(samples.usable[..., None], 1 / variance, 0).astype(np.float32)
        self.fit = self._anywhere() if about is None else about
        self.noise = self._weigh()
        for _ in range(ROUNDS):
            before, self.fit = self.fit, self._descended()
            self.noise = self._weigh()
            if np.allclose(self._place(before), self._place(self.fit), rtol=0, atol=SETTLED):
                break

    def on(self, samples: MaterialSamples) -> "CoatSearch":
        """Return the search on other samples, about what was found on these."""
        return CoatSearch(samples, self._white, self._most, self.model, about=self.fit)

    def predicted(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return what the coat gives back (P, F, 3), and its variance."""
        values = predicted(self._samples, self.weights, self.fit.surface, self.fit.strength)[0]
        return values, self.noise.variance(values)

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
        sums = {
            i: self._sums(self.fit.surface.changed(roughness=float(np.exp(middle_at + i * step)))) for i in (-1, 0, 1)
        }

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

    def _best(self, surface: Coat) -> tuple[float, CoatFit]:
        """Return the sum of squares that a surface leaves, and it with its best strength."""
        strength, left = strengths(self._sums(surface), self._white, self._most)
        return left, CoatFit(surface, strength, self._parameters)

    def _anywhere(self) -> CoatFit:
        """Return the best coat of any roughness that is tried, over any body that is.

        A body that is dimmed too much or too little makes wide lobes attractive: both must be searched together.
        """
        tried = [coat(float(x), **one) for x in TRIED for one in self.model.tried]
        found = [self._best(surface) for surface in tried]
        return min(found, key=lambda one: one[0])[1]

    def _descended(self) -> CoatFit:
        """Return the best fit near the present one, by all numbers that are free."""
        from scipy.optimize import minimize

        free, surface = self.model.free, self.fit.surface
        level = max(self._best(surface)[0], 1e-300)
        # The last one is the roughness, by its logarithm; the others are shares.
        bounds = [*[(0.0, 1.0)] * (len(free) - 1), np.log([SMOOTHEST, ROUGHEST])]

        def at(x: Array) -> Coat:
            return surface.changed(**dict(zip(free, [*map(float, x[:-1]), float(np.exp(x[-1]))], strict=True)))

        found = minimize(
            lambda x: self._best(at(x))[0] / level, self._place(self.fit), method="L-BFGS-B", bounds=bounds,
            options={"eps": STEP, "ftol": 2e-6, "maxiter": 30},
        )  # fmt: skip
        return self._best(at(found.x))[1]

    def _place(self, fit: CoatFit) -> Array:
        """Return the numbers that are searched; of the roughness, which is the last, the logarithm."""
        shares = [float(getattr(fit.surface, name)) for name in self.model.free[:-1]]
        return np.array([*shares, np.log(max(fit.surface.roughness, SMOOTHEST))])

    def _weigh(self) -> Noise:
        """Put weights in place that suit the fit; return the noise."""
        samples = self._samples
        values = predicted(samples, self.weights, self.fit.surface, self.fit.strength)[0]
        noise = noise_of(samples, values)
        self.weights = student_weights(samples, values, noise.variance(values))
        return noise


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
