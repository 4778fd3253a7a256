"""Places of different gloss on one object: two materials, and which pixel is of which, if the photographs ask for it.

Every pixel's deviance under either material, and the length of the border between the two, decide together: both are
lengths of one description of the photographs [Schwarz1978], so that nothing has to be weighed against anything.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights
from scene.normals import filled
from twin.material.coat_search import TRIED
from twin.material.fit_material import MaterialFit, fit_material, robust
from twin.material.material_kernels import reduced
from twin.material.material_noise import Noise, deviances, inflation, noise_of, student_weights
from twin.material.material_regions import Neighbours
from twin.material.material_samples import FEWEST, Samples

Array = NDArray[np.float64]
Labels = NDArray[np.intp]

TIMES = np.array([0, 0.15, 0.25, 0.4, 0.6, 0.8, 1, 1.3, 1.7, 2.3, 3.2, 4.5])
"""Strengths that are tried first, of the whole object's."""
BLOCK = 16
"""Pixels, about, whose sums are looked at together at first."""
ROUNDS = 3
"""Of labels and fits in turn."""
CLEAR = 10.0
"""By how much BIC must fall."""


@dataclass(frozen=True, eq=False)
class Places:
    """What is where.

    fits: The one of the most pixels first.
    labels (P,): Which of them each of the samples' pixels is of.
    evidence: Why there are so many.
    """

    fits: tuple[MaterialFit, ...]
    labels: Labels
    evidence: str

    @property
    def shares(self) -> tuple[float, ...]:
        """Of the pixels."""
        return tuple(float(np.mean(self.labels == number)) for number in range(len(self.fits)))

    def picture(self, samples: Samples, mask: NDArray[np.bool_]) -> NDArray[np.int8]:
        """Return (H, W), each pixel of the mask as the nearest of the samples; -1 beyond."""
        out = np.full(mask.shape, -1, np.int8)
        if len(self.fits) == 1:
            out[mask] = 0
            return out
        out[samples.rows, samples.columns] = self.labels
        return np.where(mask, filled(out, out >= 0), np.int8(-1))

    def __str__(self) -> str:
        """The sentence that is printed."""
        if len(self.fits) == 1:
            return f"{self.fits[0]}; {self.evidence}" if self.evidence else str(self.fits[0])
        told = (
            f"place {number + 1}, {100 * share:.0f} % of the pixels: {fit}"
            for number, (share, fit) in enumerate(zip(self.shares, self.fits, strict=True))
        )
        return f"of two materials ({self.evidence}); {'; '.join(told)}"


def material_places(samples: Samples, lights: Lights, whole: MaterialFit) -> Places:
    """Return one material or two.

    whole: Of all samples. An object that is matte as a whole is not divided.

    First, of all pairs of a roughness and a strength, the two that leave least if every block of pixels takes the
    better of both. Then, in turn, labels (`Neighbours.cut`: the least sum of the pixels' deviances, over the
    samples' inflation, and the border's description) and a fit of each place to its own pixels. One noise for both
    places: where the normals, say, are worse, is no other material. Two are not divided again.
    """
    one = Places((whole,), np.zeros(len(samples), np.intp), "")
    if whole.model == "matte" or len(samples) < 2 * FEWEST:
        return one
    near = Neighbours(samples.rows, samples.columns)
    before = _together(samples, one)
    found = _first_look(samples, whole, before.weights)
    for turn in range(ROUNDS):
        after = _together(samples, found)
        each = [_deviances(samples, fit, after.noise) for fit in found.fits]
        labels = near.cut((each[1] - each[0]) / after.inflation)
        if np.bincount(labels, minlength=2).min() < FEWEST:
            return replace(one, evidence="no two places of it differ by more than their noise")
        if turn and np.array_equal(labels, found.labels):
            break
        found = Places(tuple(fit_material(samples.only(labels == number), lights) for number in (0, 1)), labels, "")
    after, fits, labels = _together(samples, found), found.fits, found.labels
    effective = float(np.count_nonzero(samples.usable)) / after.inflation
    more = sum(_parameters(fit, lights) for fit in fits) - _parameters(whole, lights)
    charge = more * np.log(effective) + near.description(labels)
    fall = (before.deviance - after.deviance) / after.inflation - charge
    if fall < CLEAR:
        return replace(one, evidence=f"BIC {'falls' if fall > 0 else 'rises'} by {abs(fall):,.0f} with two places")
    if np.mean(labels) > 0.5:
        fits, labels = fits[::-1], 1 - labels
    return Places(fits, labels, f"BIC falls by {fall:,.0f} against one")


@dataclass(frozen=True, eq=False)
class _Together:
    """How well places explain all samples: with one noise, whose variance it is."""

    noise: Noise
    weights: NDArray[np.float32]
    inflation: float
    deviance: float


def _together(samples: Samples, places: Places) -> _Together:
    """Return what places leave, with the noise that suits them best."""
    usable, shape = samples.usable, samples.values.shape
    values, slope = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    variance = np.ones(shape, np.float32)
    noise = places.fits[0].noise
    for turn in range(2):
        for number, fit in enumerate(places.fits):
            own = places.labels == number
            if own.any():
                values[own], slope[own], *_ = robust(samples.only(own), fit, fit.noise if turn == 0 else noise)
        noise = noise_of(samples.values - values, values, slope, usable)
        variance = noise.variance(values, slope)
    residual = np.where(usable[..., None], (samples.values - values) / np.sqrt(variance), 0)
    weights = student_weights(samples, values, variance)
    return _Together(noise, weights, inflation(samples, residual), float(deviances(samples, values, variance).sum()))


def _deviances(samples: Samples, fit: MaterialFit, noise: Noise) -> Array:
    values, _, variance, _ = robust(samples, fit, noise)
    return deviances(samples, values, variance)


def _parameters(fit: MaterialFit, lights: Lights) -> int:
    """Return how many numbers a material is, beside the albedo."""
    if fit.model == "matte":
        return 0
    return (2 if lights.white_value is not None else 4) + (fit.surface.covered != 1) + 2 * (fit.surface.second > 0)


def _first_look(samples: Samples, whole: MaterialFit, weights: NDArray[np.float32]) -> Places:
    """Return the two coats that explain blocks of pixels best, if each block takes the better one."""
    which = np.unique(samples.blocks(BLOCK), return_inverse=True)[1].reshape(-1)
    count = int(which.max()) + 1
    strengths = TIMES[:, None] * whole.strength
    surfaces = [whole.surface.changed(roughness=float(roughness)) for roughness in TRIED]
    left = []
    for surface in surfaces:
        sums = reduced(samples, weights, surface).reshape(len(samples), 9)
        blocks = np.stack([np.bincount(which, column, count) for column in sums.T], -1).reshape(count, 3, 3)
        a, b, c = np.moveaxis(blocks, -1, 0)
        left.append((c - 2 * strengths[:, None] * b + strengths[:, None] ** 2 * a).sum(-1))
    every = np.concatenate(left)
    least = np.stack([np.minimum(one, every).sum(1) for one in every])
    pair = divmod(int(np.argmin(least)), len(every))
    coats = [replace(whole, surface=surfaces[k // len(TIMES)], strength=strengths[k % len(TIMES)]) for k in pair]
    return Places(tuple(coats), (every[pair[1]] < every[pair[0]]).astype(np.intp)[which], "")
