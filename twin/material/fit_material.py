"""The material of a registered object, from its photographs: no more of it than they ask for.

Matte; rough plastic; that on a bare and rough body, not Lambert's below the coat; or a metal: the one whose evidence
[Schwarz1978] is best.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from scene.spheres import WHITE_BALL_ALBEDO
from twin.material.coat_search import COVERED, METAL, ROUGH, ROUGHEST, SMOOTHEST, CoatFit, CoatSearch
from twin.material.material_kernels import predicted
from twin.material.material_noise import Noise, deviances, first_noise, student_weights
from twin.material.material_samples import MaterialSamples
from twin.material.reflection_models import INDEX, Coat, matte

Array = NDArray[np.float64]

FIRST_LOOK = 2_000
"""Pixels on which the model is chosen."""
BRIGHTEST = 2.0
"""Strength that is tried, of a full coat's: a higher index has it. A body of another law would like still more."""
WHITE_SIGMA = 0.05
"""Relative standard deviation of what white balls reflect about the value that they are taken to have."""
METAL_LEAVES = 0.75
"""Share of what the best other model leaves that a metal may leave: light from elsewhere looks a little like one."""
AT_THE_END = 1.02
"""Factor between a roughness and the end of what is tried, below which it is said that it lies there."""


@dataclass(frozen=True, eq=False)
class MaterialFit:
    """What an object is made of.

    specularity: As in `twin.description.materials.RoughPlastic`; 0 of a matte object and of a metal.
    roughness_sigma, specularity_sigma: Relative standard deviations, the samples' dependence allowed for; NaN of a
        matte object and of a metal.
    surface: The coat and what lies below it.
    strength (3,): See `twin.material.coat_search.CoatFit`.
    effective_samples: As many independent ones tell as much.
    evidence: How the model was chosen.
    """

    model: Literal["matte", "rough plastic", "metal"]
    specularity: float
    roughness_sigma: float
    specularity_sigma: float
    surface: Coat
    strength: Array
    noise: Noise
    effective_samples: float
    evidence: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The sentence that is printed."""
        if self.model == "matte":
            return f"matte: {self.evidence[0]}"
        coat = self.surface
        if self.model == "metal":
            return f"metal, roughness {coat.roughness:.3f}: {'; '.join(self.evidence)}"
        bare = "" if coat.body < 0 else f", on a body of roughness {coat.body:.2f}"
        roughness, specularity = (
            f" (± {100 * sigma:.1f} %)" if np.isfinite(sigma) else ""
            for sigma in (self.roughness_sigma, self.specularity_sigma)
        )
        return (
            f"rough plastic, roughness {coat.roughness:.3f}{roughness}, "
            f"specularity {self.specularity:.3f}{specularity} at index {coat.index:.2f}{bare}: "
            f"{'; '.join(self.evidence)}"
        )


def fit_material(samples: MaterialSamples, lights: Lights) -> MaterialFit:
    """Return the material that explains the samples with the fewest numbers.

    lights: The same; its white value, if known, ties strength to reflectance, and then the coat's is gray.

    value = irradiance (albedo body(alpha) + k coat(alpha)), see `twin.material.reflection_models.shade`; each
    pixel's alpha^2 is the material's plus its own `spread`. Per pixel and channel the squared residual with the best
    albedo is C - 2 k B + k^2 A, whose sums over pixels give k in closed form for each alpha. Weights: 1 /
    variance, by `noise_of` from the residuals themselves, times Student's (nu + 1) / (nu + r^2 / variance).
    """
    white = None if lights.white_value is None else lights.white_value / WHITE_BALL_ALBEDO
    # Where the white ball tells nothing, the brightest albedo is white: the twin's scene supposes the same.
    brightest = np.percentile(matte_albedo(samples).astype(np.float64), 99, axis=0) if white is None else None
    full: Array = np.asarray(white if brightest is None else brightest / WHITE_BALL_ALBEDO, np.float64)
    some = samples.only(slice(None, None, max(1, len(samples.rows) // FIRST_LOOK)))
    first, told = _likeliest(some, white, BRIGHTEST * full)
    search = first.on(samples)
    variance = search.predicted()[1]
    factor = search.inflation()
    effective = float(np.count_nonzero(samples.usable)) / factor
    none = CoatFit(matte(), np.zeros(3), 0)
    falls = _deviance(samples, none, variance) - _deviance(samples, search.fit, variance)
    fall = falls / factor - search.fit.parameters * np.log(effective)
    worth = f"{np.count_nonzero(samples.usable):,} samples, worth {effective:,.0f}"
    fit = search.fit
    if fall <= 0 or (fit.strength.mean() <= 0 and fit.surface.body < 0 and not fit.surface.is_metal):
        evidence = (f"BIC rises by {max(-fall, 0):.0f} with a coat ({worth})",)
        return MaterialFit(
            "matte", 0.0, np.nan, np.nan, none.surface, none.strength, search.noise, effective, evidence
        )  # fmt: skip
    told = (f"BIC falls by {fall:,.0f} against matte ({worth})", *told)
    if fit.surface.is_metal:
        return MaterialFit(
            "metal", 0.0, np.nan, np.nan, fit.surface, fit.strength, search.noise, effective, told,
            tuple(_doubts(fit.surface.roughness)),
        )  # fmt: skip
    sigma = np.sqrt(np.diag(search.covariance()) * factor)
    specularity = float(fit.strength.mean() / (1.0 if white is None else np.mean(white)))
    return MaterialFit(
        "rough plastic", specularity, float(sigma[0]), float(sigma[1]), fit.surface, fit.strength, search.noise,
        effective, told,
        tuple(_doubts(fit.surface.roughness, specularity, float(sigma[1]), known=white is not None)),
    )  # fmt: skip


def matte_albedo(samples: MaterialSamples) -> NDArray[np.float32]:
    """Return the albedo (P, 3) of a matte object; highlights, outliers, count little."""
    return robust_albedo(samples, CoatFit(matte(), np.zeros(3), 0), first_noise(samples))


def robust_albedo(samples: MaterialSamples, fit: MaterialFit | CoatFit, noise: Noise) -> NDArray[np.float32]:
    """Return the albedo (P, 3) that is best for Student's weights."""
    weights = np.repeat(samples.usable[..., None], 3, -1).astype(np.float32)
    for _ in range(2):
        values, _ = predicted(samples, weights, fit.surface, fit.strength)
        weights = student_weights(samples, values, noise.variance(values))
    return predicted(samples, weights, fit.surface, fit.strength)[1]


def _likeliest(samples: MaterialSamples, white: Array | None, most: Array) -> tuple[CoatSearch, tuple[str, ...]]:
    """Return the coat that the evidence favours, and the words for it; a metal only where the others leave far more."""
    on = f"({len(samples.rows):,} pixels)"
    first, other, metal = (CoatSearch(samples, white, most, model) for model in (COVERED, ROUGH, METAL))
    if _left(samples, metal) < METAL_LEAVES * min(_left(samples, first), _left(samples, other)):
        other = metal
    gain = _gain(samples, first, other)
    if gain > 0:
        return other, (f"by {gain:,.0f} more with {other.model.words} {on}",)
    return first, (f"it rises by {-gain:,.0f} with {other.model.words} {on}",)


def _left(samples: MaterialSamples, search: CoatSearch) -> float:
    """Return the root mean square of what a fit leaves of usable samples."""
    return float(np.sqrt(np.mean((samples.values - search.predicted()[0])[samples.usable].astype(np.float64) ** 2)))


def _gain(samples: MaterialSamples, one: CoatSearch, other: CoatSearch) -> float:
    """Return by how much BIC falls from one fit to another, of the same samples."""
    factor = max(one.inflation(), other.inflation())
    charge = float(np.log(np.count_nonzero(samples.usable) / factor))
    return (one.deviance() - other.deviance()) / factor + charge * (one.fit.parameters - other.fit.parameters)


def _doubts(roughness: float, specularity: float = 0.0, sigma: float = 0.0, *, known: bool = True) -> Iterator[str]:
    """Yield what is suspicious about a coat, or a metal."""
    for end, what in ((ROUGHEST, "a sheen, or a body of another law"), (SMOOTHEST, "a polished coat")):
        if abs(np.log(roughness / end)) < np.log(AT_THE_END):
            yield f"The roughness ran to {end:g}, the end of what is tried: {what} would do that."
    if not known:
        yield "The white ball's pixel value is unknown: the specularity is that of a surface whose pixel value is 1."
    elif specularity > 1 + 3 * float(np.hypot(sigma, WHITE_SIGMA)):
        yield (
            f"The highlights are {specularity:.2f} times those of a full coat of index {INDEX}; the twin has 1. A "
            "higher index, a metal, or a wrong white ball would do that."
        )


def _deviance(samples: MaterialSamples, fit: CoatFit, variance: NDArray[np.float32]) -> float:
    """Return -2 log likelihood of a fit, its albedo the best for it, up to a constant."""
    weights = np.where(samples.usable[..., None], 1 / variance, 0).astype(np.float32)
    for _ in range(3):
        values = predicted(samples, weights, fit.surface, fit.strength)[0]
        weights = student_weights(samples, values, variance)
    return float(deviances(samples, values, variance).sum())
