"""Which normals to believe where no truth is known: the photographs judge, by frames that a method was not given."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.method_names import METHODS
from scene.normals import angular_error_deg, filled
from solve.assess import DARK
from solve.methods import NO_SETTINGS
from solve.problem import Problem
from solve.samples import all_samples, row_medians
from solve.solve import solve
from solve.whole import metal, reflectance
from solve.whole.metal_kernels import appearance
from solve.whole.reflectance_kernels import DIFFERENCE, GRAZING, HALF, INCIDENCE, SIZE, TABLE

Array = NDArray[np.float64]
PIXELS = 4_000
"""That are solved and judged, about."""
FOLDS, FEWEST = 3, 6
"""Every third frame in turn is predicted from the others; of fewer frames these would be three, which fit anything."""
NEAREST = 3
"""Other methods whose distance counts as doubt."""
LARGEST = 0.3
"""Of the albedo: an unexplained difference counts no more."""
LIMIT = 0.1
"""Share of the photographs, rms, that the best method may leave unexplained and still be believed."""


class JudgedMethod(NamedTuple):
    """What is said of one method: by how much frames differ from what it predicts of them, of the albedo, mean (None:
    another program, or `metal` of no metal, which are not run again); and how far its normals are from those of the
    recommended one, mean.
    """

    unexplained: float | None
    apart_deg: float


@dataclass(frozen=True)
class Trust:
    """What the photographs say of methods.

    Parameters
    ----------
    methods : mapping of str to JudgedMethod
        The recommended one, then the others as they come nearest to it.
    level : tuple of str
        Those that predict some third of the frames better than the recommended one does.
    relative_rmse : float
        By how much lit samples differ from those that its normals by all frames predict, of their root mean square.
    sigma_deg : (H, W) float32
        What the recommended normals may be wrong by, degrees, as the nearest judged pixel has it; NaN off the object.
    doubts : tuple of str
        Why the order should not be believed.
    """

    methods: Mapping[str, JudgedMethod]
    level: tuple[str, ...]
    relative_rmse: float
    sigma_deg: NDArray[np.float32]
    doubts: tuple[str, ...]

    @property
    def recommended(self) -> str:
        """The first."""
        return next(iter(self.methods))


def trust(
    frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_], answers: Mapping[str, NDArray], *,
    profile: str = "default",
) -> Trust:  # fmt: skip
    """Recommend the method that predicts frames best that it is not given, and order the others by it.

    Parameters
    ----------
    frames, lights, camera, mask, profile : as in `solve.solve.solve`
    answers : mapping of str to (H, W, 3) float
        Each method's normals by all frames.

    Raises
    ------
    SceneError
        Lights that are not known, too few frames, or none of our methods.

    Notes
    -----
    Cross-validation: each third of the frames is predicted from a method's normals by the others, each pixel's albedo
    by the others, and what all frames tell of the object as a whole: its reflectance, gloss included, and the light
    that it throws upon itself (`solve.whole.reflectance`); or which metal it is (`solve.whole.metal`), whose albedo is
    taken to be the photographs' 99th percentile. A pixel without an answer explains nothing. Judged are the
    samples that are lit, or that the normals say are. How far the others' normals are from the recommended ones orders
    them better than what they leave unexplained, which a bent reflectance may take up.

    A pixel's sigma is what moves its normal: leaving out a third of the frames, and taking another method. With d_k
    the angle to the normal without the k-th third, and a the median angle to the three methods that come nearest as
    a whole, sigma^2 = (2/3) sum d_k^2 + a^2: of thirds left out in turn, the jackknife's variance [Efron1993] is 2/3 of
    the squares' sum.

    Do not believe it where all that is wrong is wrong alike in every answer and fits the photographs: lights that are
    turned together, above all.
    """
    names = [name for name in answers if name in METHODS]
    if lights.is_unknown or not names:
        raise SceneError("trust: our methods are judged by calibrated lights; found none. Give lights or balls.")
    if len(frames) < FEWEST:
        raise SceneError(f"trust: found {len(frames)} frames; methods are judged from {FEWEST} on: three fit anything.")
    whole = Problem.of(frames, lights, camera, mask)
    step, given = whole.step_to(PIXELS), whole.thinned(PIXELS)
    photographs = _Photographs(given)
    if photographs.metal is None and len(names) > 1:
        # Of no metal its answer is not to be believed, however well clefts that light themselves agree with it.
        names = [name for name in names if name != "metal"]
    left_out = [np.arange(len(frames)) % FOLDS == fold for fold in range(FOLDS)]
    by_folds = {name: [_normals(name, given, ~out, profile) for out in left_out] for name in names}
    folds = np.array(
        [[photographs.judge(*fold)[0] for fold in zip(by_folds[name], left_out, strict=True)] for name in names]
    )
    best = int(folds.mean(1).argmin())
    answer = answers[names[best]][::step, ::step][given.mask]
    left = sum(photographs.judge(answer, out)[1] for out in left_out)
    rmse = min(float(np.sqrt(left / photographs.square)), 1.0)
    level = tuple(name for name, of_name in zip(names, folds, strict=True) if (of_name < folds[best]).any())
    doubts = ()
    if rmse > LIMIT:
        doubts = (
            f"not to be believed: the best method leaves {rmse:.0%} of the photographs unexplained (expected at most "
            f"{LIMIT:.0%}). "
            + (
                "Parts of a metal that mirror no flash are guesses."
                if photographs.metal
                else "Deep clefts, several materials, light from elsewhere, or wrong lights."
            ),
        )
    apart = {name: _apart_deg(normals[mask], answers[names[best]][mask]) for name, normals in answers.items()}
    told = dict(zip(names, folds.mean(1).tolist(), strict=True))
    order = sorted(answers, key=lambda name: (name != names[best], apart[name]))
    square = 2 / 3 * sum(angular_error_deg(normals, answer) ** 2 for normals in by_folds[names[best]])
    nearest = [answers[name][::step, ::step][given.mask] for name in order[1 : 1 + NEAREST]]
    if nearest:
        aside = np.ma.masked_invalid([angular_error_deg(normals, answer) for normals in nearest])
        square += np.ma.median(aside, axis=0).filled(0.0) ** 2
    sigma = np.full(given.mask.shape, np.nan, np.float32)
    sigma[given.mask] = np.sqrt(square)
    sigma = filled(sigma, np.isfinite(sigma))
    every = sigma.repeat(step, 0).repeat(step, 1)[: mask.shape[0], : mask.shape[1]]
    judged = {name: JudgedMethod(told.get(name), apart[name]) for name in order}
    return Trust(judged, level, rmse, np.where(mask, every, np.float32(np.nan)), doubts)


def _apart_deg(normals: NDArray, others: NDArray) -> float:
    """Return the mean angle between normals (P, 3); 90 where none is known."""
    angle = angular_error_deg(normals, others)
    return float(np.nanmean(angle)) if np.isfinite(angle).any() else 90.0


def _normals(name: str, problem: Problem, seen: NDArray[np.bool_], profile: str) -> NDArray:
    """Return a method's normals (P, 3) of some frames (F,) of a problem; NaN where it cannot be run."""
    frames, lights, mask = problem.frames.only(seen), problem.lights.only(seen), problem.mask
    try:
        return solve(name, frames, lights, problem.camera, mask, profile=profile).normals[mask]
    except SceneError:
        return np.full((np.count_nonzero(mask), 3), np.nan)


class _Photographs:
    """What is seen of a problem's pixels, and the reflectance that all of them share."""

    def __init__(self, problem: Problem) -> None:
        problem = reflectance.prepare(problem, NO_SETTINGS)
        samples = all_samples(problem)
        _, shared, thrown = reflectance.fit_prepared(problem, samples)
        self.gray, self.toward, self.views = samples.gray.astype(np.float64), samples.toward(), problem.views()
        self.valid, self.lit = samples.valid, samples.valid & (samples.gray > DARK * samples.scale())
        self.square = max(float(np.sum(self.gray[self.lit] ** 2)), 1e-300)
        self.table = RegularGridInterpolator((HALF, DIFFERENCE), shared[:TABLE].reshape(len(HALF), len(DIFFERENCE)))
        self.curve = shared[TABLE : SIZE - 1]
        self.thrown = shared[-1] * np.einsum("pcf,pc->pf", thrown.patches[thrown.corner], thrown.share)
        self.samples, self.metal = samples, metal.found(samples, self.views)

    def shading(self, normals: Array) -> tuple[Array, Array]:
        """Return n . l and the values (P, F) of pixels of albedo 1; see `solve.whole.reflectance.fit_to_views`."""
        cosine = np.einsum("pi,pfi->pf", normals, self.toward)
        if self.metal is not None:
            return cosine, appearance(self.samples, self.views, normals, self.metal.alpha) * self.metal.value
        half = self.toward / np.linalg.norm(self.toward, axis=-1, keepdims=True) + self.views[:, None]
        half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9)
        angles = [
            np.minimum(np.arccos(np.clip(np.einsum("pi,pfi->pf", each, half), -1, 1)), knots[-1])
            for each, knots in ((normals, HALF), (self.views, DIFFERENCE))
        ]
        factor = self.table(np.stack(angles, -1)) + np.interp(cosine, INCIDENCE, self.curve)
        return cosine, np.maximum(cosine * factor, 0) + self.thrown

    def judge(self, normals: NDArray, out: NDArray[np.bool_]) -> tuple[float, float]:
        """Return what normals (P, 3) leave unexplained of some frames (F,), mean; and the sum of the lit squares."""
        known = np.asarray(np.isfinite(normals).all(1))[:, None]
        cosine, shade = self.shading(np.where(known, normals, 0).astype(np.float64))
        usable = (self.lit & (cosine > GRAZING) & (shade > 0))[:, ~out]
        ratio = np.divide(self.gray[:, ~out], shade[:, ~out], out=np.zeros(usable.shape), where=usable)
        albedo = np.maximum(row_medians(ratio, usable), 1e-6 * self.gray.max())[:, None]
        if self.metal is not None:
            # It mirrors alike all over: what is dark in all of the other frames is known, too.
            albedo, shade = np.full_like(albedo, self.samples.scale()), shade / self.samples.scale()
        judged = (self.lit | (self.valid & (cosine > 0)))[:, out]
        share = np.where(known, np.minimum(np.abs(self.gray[:, out] / albedo - shade[:, out]), LARGEST), LARGEST)
        squares = np.where(self.lit[:, out], share * np.where(known, albedo, self.gray[:, out] / LARGEST), 0) ** 2
        return float(np.mean(share[judged])) if judged.any() else LARGEST, float(np.sum(squares))
