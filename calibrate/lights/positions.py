"""From highlights to lights, distant or near, robustly; with the covariance of all that was adjusted."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibrate.lights.adjustment import Adjustment, ObservedSpots
from scene.camera import Camera
from scene.lights import Lights
from scene.spheres import Sphere

Array = NDArray[np.float64]
ROUNDS = 4  # of least squares, each with the highlights that agree with the one before
LOOSENED = (1, 2)  # rounds after which outlines that the highlights contradict count less
MOST_TRIALS = 100
"""Points at which a round looks: sound highlights need 50 at most, and those that contradict each other never rest."""
INLIER_SIGMAS = 5.0
CONTRADICTION_PX = 1.0
"""Miss from which one of two balls is left out, which costs the light's range: a reflection of something else misses
by pixels, an undersampled highlight by a third of one."""
MEDIAN_SQUARE = 1.39  # median of the sum of two squared normal errors
STATED = 8.0
"""How many residuals' worth the highlights' stated sigmas are believed, against their scatter: on balls of others these
are a quarter apart, in the logarithm, and 8 residuals tell a scatter to that."""
CAP = 30.0  # sigmas at which a highlight that was left out counts in the comparison of models


@dataclass(frozen=True)
class LightFit:
    """Lights, balls and camera that explain the highlights."""

    camera: Camera  # adjusted within its sigmas, which are then what is left of them
    spheres: list[Sphere]  # adjusted
    reference: Array  # (3,) where the directions hold; it moves with the camera as the balls do
    directions: Array  # (F, 3) at the reference point
    positions_mm: Array | None  # (F, 3); None for distant lights, and for near ones whose ranges nothing tells
    direction_sigma_deg: Array  # (F,) one tangent axis
    range_sigma: Array  # (F,) relative; NaN for distant lights
    position_covariance_mm2: Array | None  # (F, 3, 3)
    residual_px: Array  # (S, F) from the highlight to where the model mirrors the light; NaN where unused
    used: NDArray[np.bool_]  # (S, F)
    shaded: NDArray[np.bool_]  # (W, F) which of the white balls' shading is used
    chi2: float  # sum of squared residuals in expected standard deviations, outlines' as Student's
    outline_chi2: Array  # (S,) of each ball's three numbers against its outline's
    left_out_chi2: float  # of highlights that were left out, capped at `CAP` sigmas each: to compare models
    highlight_chi2: float  # the highlights' part of `chi2`
    scale: float  # how many times larger the highlights' errors are than was stated, by their scatter
    unknowns: int
    observations: int

    def lights(self, names: tuple[str, ...]) -> Lights:
        """Return the lights, all of one intensity."""
        equal = np.ones_like(self.directions)
        return Lights(names, self.directions, equal, self.positions_mm, self.reference, self.direction_sigma_deg)

    @property
    def is_near(self) -> bool:
        """Whether each light has a range, known or not."""
        return bool(np.isfinite(self.range_sigma).any())

    @property
    def freedom(self) -> int:
        """Degrees of freedom: observations without the loose priors of the ranges, less unknowns; 1 at least."""
        return max(self.observations - self.unknowns - self.is_near * len(self.directions), 1)

    @property
    def chi2_all(self) -> float:
        """What all that was stated misses by, highlights that were left out among it."""
        return self.chi2 + self.left_out_chi2

    def chi2_at(self, scale: float) -> float:
        """Return the same with the highlights' sigmas `scale` times as large as stated; all others as they are."""
        highlights = self.highlight_chi2 + self.left_out_chi2
        return self.chi2 - self.highlight_chi2 + highlights / scale**2

    @property
    def misfit(self) -> float:
        """Root of chi2 per degree of freedom: highlights, outlines, diameters against all that was stated of them."""
        return float(np.sqrt(self.chi2 / self.freedom))

    @property
    def miss(self) -> float:
        """The misfit, or that of the worst outline: one wrong outline among many good highlights hides in the mean."""
        return max(self.misfit, float(np.sqrt(self.outline_chi2.max() / 3)))

    @property
    def distance_mm(self) -> Array:
        """(F,) of near lights from the reference point."""
        assert self.positions_mm is not None
        return np.linalg.norm(self.positions_mm - self.reference, axis=1)


def fit_lights(seen: ObservedSpots, *, near: bool) -> LightFit:
    """Adjust lights, balls and camera to the highlights; `near`: fit a range per light too, which needs diameters.

    The stated sigmas keep their proportions, but not their size: s^2 = (chi^2 + m) / (n + m), n the highlights'
    degrees of freedom, m = `STATED`. With a wrong model s is large, and the balls stay on their outlines.
    """
    problem = Adjustment(seen, near=near)
    x = problem.start()
    shown = np.isfinite(seen.highlights[..., 0])
    # By name through a dict: the type stub takes no function for the Jacobian.
    options: dict[str, Any] = {"jac": problem.slopes, "x_scale": "jac", "max_nfev": MOST_TRIALS}
    for index in range(ROUNDS):
        x = least_squares(problem.residuals, x, **options).x
        if near and index < ROUNDS - 1:
            # Lights of one session are about as far as each other; how far, they tell themselves.
            problem.middle[problem.first_light + 2 :: 3] = np.median(x[problem.first_light + 2 :: 3])
        size = np.linalg.norm(problem.residual_pixels(x), axis=-1)
        square = np.nanmedian((size / seen.sigma_px)[problem.used] ** 2) / MEDIAN_SQUARE
        least = np.where(shown.sum(0) < 3, CONTRADICTION_PX, 0)
        good = size < np.maximum(INLIER_SIGMAS * max(1.0, float(np.sqrt(square))) * seen.sigma_px, least)
        problem.used = shown.copy()
        for f in np.flatnonzero((shown & ~good).any(0)):
            # Of two that contradict each other nobody knows which is right: the surer one is kept.
            doubt = size[:, f] if shown[:, f].sum() > 2 else seen.sigma_px[:, f]
            problem.used[np.where(shown[:, f], doubt, -1).argmax(), f] = False
        problem.shaded = _agreeing_shading(problem, x)
        if index in LOOSENED:
            problem.loosen(x)
        problem.scale = _scale(problem, x)
        problem.sigma = seen.sigma_px * problem.scale
    return _conclude(problem, x)


def _covariance(slopes: Array) -> Array:
    return np.asarray(np.linalg.pinv(slopes.T @ slopes, hermitian=True), np.float64)


def _scale(problem: Adjustment, x: Array) -> float:
    """Return by how much the highlights scatter more than stated."""
    rows = 2 * int(problem.used.sum())
    residual, slopes = problem.residuals(x)[:rows], problem.slopes(x)
    # What the unknowns took of the highlights' freedom, their leverage; the priors carry the rest of them.
    taken = np.sum((slopes @ _covariance(slopes) * slopes)[:rows])
    chi2 = float(residual @ residual) * problem.scale**2
    return float(np.sqrt((chi2 + STATED) / (max(rows - taken, 0.0) + STATED)))


def _agreeing_shading(problem: Adjustment, x: Array) -> NDArray[np.bool_]:
    """Return (W, F) which of the shading to believe; all of it where no highlight is seen."""
    clear = problem.shading.clear
    if not clear.any():
        return clear
    square = np.sum(problem.shading_misses(x) ** 2, -1)
    limit = INLIER_SIGMAS**2 * max(1.0, float(np.median(square[clear])) / MEDIAN_SQUARE)
    return clear & ((np.nan_to_num(square) < limit) | ~problem.used.any(0))


def _conclude(problem: Adjustment, x: Array) -> LightFit:
    """Return what the solution `x` says, with the covariance (J^T J)^-1 of the whitened problem."""
    camera, seen = problem.camera_at(x), problem.seen
    directions, _ = problem.lights_at(x)
    residual, covariance = problem.residuals(x), _covariance(problem.slopes(x))
    variance = np.diag(covariance)
    own = variance[problem.first_light :].reshape(problem.lights, problem.per_light)
    of_balls = variance[problem.first_ball : problem.first_diameter].reshape(-1, 3)
    sigmas = np.zeros(3)
    sigmas[problem.free_camera] = np.sqrt(variance[: problem.first_ball])
    center = float(np.hypot(sigmas[1], sigmas[2]) / np.sqrt(2))
    size = np.linalg.norm(problem.residual_pixels(x), axis=-1)
    left_out = np.isfinite(seen.highlights[..., 0]) & ~problem.used
    beside = np.linalg.norm(problem.shading_misses(x), axis=-1)[problem.shading.clear & ~problem.shaded]
    missed = np.concatenate([np.nan_to_num(size / seen.sigma_px, nan=CAP)[left_out], beside])
    capped = np.minimum(missed, CAP)
    rows = 2 * int(problem.used.sum())
    highlight_chi2 = float(np.sum(residual[:rows] ** 2)) * problem.scale**2
    spheres = [problem.ball_at(x, ball) for ball in range(problem.balls)]
    moves = problem.position_slopes(x) if problem.near else np.zeros(0)
    return LightFit(
        camera=replace(camera, focal_sigma=float(sigmas[0]), center_sigma_px=center),
        spheres=[
            replace(sphere, sigma_px=float(np.sqrt(v.mean()))) for sphere, v in zip(spheres, of_balls, strict=True)
        ],
        reference=problem.reference_at(camera),
        directions=directions,
        positions_mm=problem.positions_at(x) if problem.near else None,
        direction_sigma_deg=np.rad2deg(np.sqrt((own[:, 0] + own[:, 1]) / 2)),
        range_sigma=np.sqrt(own[:, 2]) if problem.near else np.full(problem.lights, np.nan),
        position_covariance_mm2=moves @ covariance @ moves.swapaxes(1, 2) if problem.near else None,
        residual_px=np.where(problem.used, size, np.nan),
        used=problem.used.copy(),
        shaded=problem.shaded.copy(),
        chi2=highlight_chi2 + float(np.sum(residual[rows:] ** 2)) + problem.outline_excess(x),
        outline_chi2=problem.outline_chi2(x),
        left_out_chi2=float(np.sum(capped**2)),
        highlight_chi2=highlight_chi2,
        scale=problem.scale,
        unknowns=len(x),
        observations=len(residual),
    )
