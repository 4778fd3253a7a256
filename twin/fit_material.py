"""The material of a registered object, from its photographs: no more of it than they ask for.

Matte, or rough plastic, or several of them in their places; the one whose evidence [Schwarz1978] is best. Each pixel's
albedo is eliminated [Golub1973], so what is searched is one number, the roughness.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from twin.description import WHITE_BALL_ALBEDO
from twin.material_kernels import predicted, reduced
from twin.material_noise import Noise, inflation, noise_of
from twin.material_samples import Samples
from twin.reflection_models import INDEX, Coat, coat, matte

Array = NDArray[np.float64]

SMOOTHEST, ROUGHEST = 0.02, 1.0
TRIED = np.geomspace(SMOOTHEST, ROUGHEST, 14)
ROUNDS = 4
"""Of weights and fit in turn."""
FIRST_LOOK = 2_000
"""Pixels that the first round is content with."""
STEP = 0.06
"""Of the logarithm of the roughness, between the three that a round puts a parabola through."""
FREEDOM = 4.0
"""Of Student's t: how far a sample may lie off."""


@dataclass(frozen=True, eq=False)
class Fit:
    """One model, fitted.

    Parameters
    ----------
    surface : Coat
    strength : (3,) float64
        Of the coat, by channel: its specularity times the pixel value of a surface of reflectance 1 (1 where that is
        unknown).
    covariance : (2, 2) float64
        Of the logarithms of roughness and mean strength.
    deviance : float
        -2 log likelihood, over the samples' inflation.
    parameters : int
        Beside the albedo.
    """

    surface: Coat
    strength: Array
    covariance: Array
    deviance: float
    parameters: int


@dataclass(frozen=True, eq=False)
class MaterialFit:
    """What an object is made of.

    Parameters
    ----------
    model : {"matte", "rough plastic"}
    roughness, specularity, index : float
        As in `twin.materials.RoughPlastic`; a matte object has specularity 0.
    roughness_sigma, specularity_sigma : float
        Relative standard deviations, the samples' dependence allowed for; NaN of a matte object.
    strength : (3,) float64
        See `Fit`.
    noise : Noise
    effective_samples : float
        As many independent ones tell as much.
    evidence : tuple of str
        How the model was chosen.
    warnings : tuple of str
    """

    model: Literal["matte", "rough plastic"]
    roughness: float
    specularity: float
    index: float
    roughness_sigma: float
    specularity_sigma: float
    strength: Array
    surface: Coat
    noise: Noise
    effective_samples: float
    evidence: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The sentence that is printed."""
        if self.model == "matte":
            return f"matte: {self.evidence[0]}"
        return (
            f"rough plastic, roughness {self.roughness:.3f} (± {100 * self.roughness_sigma:.1f} %), specularity "
            f"{self.specularity:.3f} (± {100 * self.specularity_sigma:.1f} %) at index {self.index:.2f}: "
            f"{self.evidence[0]}"
        )


def fit_material(samples: Samples, lights: Lights) -> MaterialFit:
    """Return the material that explains the samples with the fewest numbers.

    Parameters
    ----------
    samples : Samples
    lights : Lights
        The same; its white value, if known, ties strength to reflectance, and then the coat's is gray.

    Notes
    -----
    value = irradiance (albedo body(alpha) + k coat(alpha)), see `twin.reflection_models.shade`; each pixel's alpha^2 is
    the material's plus its own `spread`. Per pixel and channel the squared residual with the best albedo is
    C - 2 k B + k^2 A, whose sums over pixels give k in closed form for each alpha. Weights: 1 / variance, by `noise_of`
    from the residuals themselves (constant, photons, a share of the value, the normals' errors), times Student's
    (nu + 1) / (nu + r^2 / variance).
    """
    white = None if lights.white_value is None else lights.white_value / WHITE_BALL_ALBEDO
    few = samples.only(slice(None, None, max(1, len(samples) // FIRST_LOOK)))
    plastic = _plastic(few, _start(few), white)
    noise, weights = _weighed(samples, _start(samples), plastic)
    for _ in range(ROUNDS):
        plastic = _plastic(samples, weights, white, about=plastic.surface.roughness)
        noise, weights = _weighed(samples, weights, plastic)
    values, slope, _ = predicted(samples, weights, plastic.surface, _everywhere(samples, plastic.strength))
    variance = noise.variance(values, slope)
    residual = np.where(samples.usable[..., None], (samples.values - values) / np.sqrt(variance), 0)
    factor = inflation(samples, residual)
    effective = float(np.count_nonzero(samples.usable)) / factor
    bare = Fit(matte(), np.zeros(3), np.full((2, 2), np.nan), 0.0, 0)
    judged = [_judged(samples, fit, variance, factor) for fit in (bare, plastic)]
    fall = judged[0].deviance - judged[1].deviance - (plastic.parameters - bare.parameters) * np.log(effective)
    level = 1.0 if white is None else float(np.mean(white))
    told = f"{np.count_nonzero(samples.usable):,} samples, worth {effective:,.0f}"
    if fall <= 0 or plastic.strength.mean() <= 0:
        evidence = (f"BIC rises by {max(-fall, 0):.0f} with a coat ({told})",)
        return MaterialFit(
            "matte", 1.0, 0.0, 1.0, np.nan, np.nan, np.zeros(3), bare.surface, noise, effective, evidence
        )
    evidence = (f"BIC falls by {fall:,.0f} against matte ({told})",)
    sigma = np.sqrt(np.diag(plastic.covariance) * factor)
    warnings = []
    if white is None:
        warnings.append(
            "The white ball's pixel value is unknown: the specularity is relative to a surface whose pixel value is 1."
        )
    return MaterialFit(
        "rough plastic", plastic.surface.roughness, float(plastic.strength.mean() / level), INDEX, float(sigma[0]),
        float(sigma[1]), plastic.strength, plastic.surface, noise, effective, evidence, tuple(warnings),
    )  # fmt: skip


def _start(samples: Samples) -> NDArray[np.float32]:
    """Return first weights (P, F, 3): a twentieth of the value, and of the dark a hundredth of what is bright."""
    bright = np.percentile(samples.values[samples.usable], 90, axis=0)
    variance = (0.01 * bright) ** 2 + (0.05 * samples.values) ** 2
    return np.where(samples.usable[..., None], 1 / variance, 0).astype(np.float32)


def _everywhere(samples: Samples, strength: Array) -> Array:
    return np.broadcast_to(strength, (len(samples), 3))


def strengths(sums: Array, white: Array | None) -> tuple[Array, float]:
    """Return the best strength of each channel, and the sum of squares that it leaves, of sums (3 channels, 3)."""
    a, b, c = sums.T
    a = np.maximum(a, 1e-300)
    if white is None:
        strength = np.maximum(b / a, 0)
    else:
        strength = white * max(float(np.sum(white * b) / np.sum(white**2 * a)), 0)
    return strength, float(np.sum(c - 2 * strength * b + strength**2 * a))


def _plastic(samples: Samples, weights: NDArray[np.float32], white: Array | None, about: float | None = None) -> Fit:
    """Return the best rough plastic under given weights; its roughness near `about`, where that is given."""
    from scipy.optimize import minimize_scalar

    seen: dict[float, tuple[Array, float]] = {}

    def left(logarithm: float) -> float:
        seen[logarithm] = strengths(reduced(samples, weights, coat(float(np.exp(logarithm)))).sum(0), white)
        return seen[logarithm][1]

    if about is None:
        tried = np.log(TRIED)
        best = int(np.argmin([left(x) for x in tried]))
        bounds = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
        found = float(minimize_scalar(left, bounds=bounds, method="bounded", options={"xatol": 5e-3}).x)  # type: ignore[attr-defined]
    else:
        middle = float(np.log(about))
        low, here, high = (left(middle + side * STEP) for side in (-1, 0, 1))
        bend = low - 2 * here + high
        move = 0.5 * (low - high) / bend if bend > 0 else np.sign(low - high) * np.inf
        found = float(np.clip(middle + STEP * np.clip(move, -3, 3), np.log(SMOOTHEST), np.log(ROUGHEST)))
    strength, _ = seen[found] if found in seen else (left(found), seen[found])[1]
    return Fit(
        coat(float(np.exp(found))), strength, _covariance(samples, weights, found, strength), 0.0,
        2 if white is not None else 4,
    )  # fmt: skip


def _covariance(samples: Samples, weights: NDArray[np.float32], logarithm: float, strength: Array) -> Array:
    """Return the inverse of half the second differences of the sum of squares in log roughness and log strength."""
    if not strength.any():
        return np.full((2, 2), np.nan)
    step = 0.03
    sums = {i: reduced(samples, weights, coat(float(np.exp(logarithm + i * step)))).sum(0) for i in (-1, 0, 1)}

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


def _weighed(samples: Samples, weights: NDArray[np.float32], fit: Fit) -> tuple[Noise, NDArray[np.float32]]:
    values, slope, _ = predicted(samples, weights, fit.surface, _everywhere(samples, fit.strength))
    residual = samples.values - values
    noise = noise_of(residual, values, slope, samples.usable)
    variance = noise.variance(values, slope)
    robust = (FREEDOM + 1) / (FREEDOM + residual**2 / variance)
    return noise, np.where(samples.usable[..., None], robust / variance, 0).astype(np.float32)


def _judged(samples: Samples, fit: Fit, variance: NDArray[np.float32], factor: float) -> Fit:
    """Return a fit with its deviance under one variance for all models, its albedo the best for that."""
    weights = np.where(samples.usable[..., None], 1 / variance, 0).astype(np.float32)
    for _ in range(3):
        values = predicted(samples, weights, fit.surface, _everywhere(samples, fit.strength))[0]
        square = (samples.values - values) ** 2 / variance
        robust = (FREEDOM + 1) / (FREEDOM + square)
        weights = np.where(samples.usable[..., None], robust / variance, 0).astype(np.float32)
    # Three channels err together: they count as one sample.
    deviance = float(np.sum((FREEDOM + 1) * np.log1p(square / FREEDOM).mean(-1)[samples.usable])) / factor
    return Fit(fit.surface, fit.strength, fit.covariance, deviance, fit.parameters)
