"""Did a part without edges move? What the frames show of it against what the others foretell, before and after."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from capture.audit.movement import FEWEST_BESIDE, Step
from scene.robust import spread

Array = NDArray[np.float64]
LIT = 0.15
"""Of a pixel's bright frames: what is darker lies in shadow, or nearly."""
OUTLIER = 3.0
"""Standard deviations from which on a residual counts less and less."""
FEWEST_FRAMES, FEWEST_PX = 8, 20
TURNS = 4
CHANCE = 0.05
"""That scatter alone has such a step somewhere: at most."""
UNEXPLAINED = 0.85
"""Of the frames' misfit, what is left of it when the step is taken back: at most."""
AGREED = 0.5
"""Shifts of edges where nothing moved have hardly anything of the shading's: less than four tenths."""
LEAST, MOST = 0.01, 0.15
"""Of a step, in the part's size: what is glossy drifts by half a hundredth, and far steps have nothing in common."""
BESIDE = 3
"""Frames by which the place of a step may be off at first."""


@dataclass(frozen=True, eq=False)
class MattePart:
    """What frames show of a matte part: `FEWEST_FRAMES` at least, `FEWEST_PX` wide and high.

    Parameters
    ----------
    pictures : (F, h, w) float32
        Gray, linear, the ambient light subtracted.
    mask : (h, w) bool
        Where the part is, well within its outline.
    toward : (F, N, 3) float64
        From what the N pixels of the mask show to the lights: directions, times the intensities there.
    """

    pictures: NDArray[np.float32]
    mask: NDArray[np.bool_]
    toward: Array

    @property
    def size_px(self) -> float:
        """Side of a square as large as the part."""
        return float(np.sqrt(np.count_nonzero(self.mask)))

    def step(self) -> Step | None:
        """Return the movement that stays, by the shading alone; None where there is none.

        Notes
        -----
        Least squares over the other frames foretells each one, and its shift is that of the foretold picture that fits
        best [Lucas1981]. What is not matte pulls the shading after the light: so the shifts are fitted by what is
        linear in the light's direction, and a step. The step counts where scatter has one as clear with a probability
        of `CHANCE` (Hotelling's T-squared, for the best of all places), and the frames fit better by `UNEXPLAINED` once
        it is taken back.
        """
        moves, misfit = self._shifts
        places = range(FEWEST_BESIDE, len(self.pictures) - FEWEST_BESIDE + 1)
        by_chance = [self._step_at(first, moves)[1] for first in places]
        if min(by_chance) * len(places) > CHANCE:
            return None
        found, left = Step(places[int(np.argmin(by_chance))], np.zeros(2), 0.0), misfit
        for _ in range(TURNS):
            found = replace(found, shift_px=found.shift_px + self._step_at(found.first, moves)[0])
            if np.linalg.norm(found.shift_px) > MOST * self.size_px:
                return None
            moves, left = self._without(found)._shifts
        if left > UNEXPLAINED * misfit or np.linalg.norm(found.shift_px) < LEAST * self.size_px:
            return None
        near = [replace(found, first=place) for place in places if abs(place - found.first) <= BESIDE]
        return min(near, key=lambda step: self._without(step)._shifts[1])

    def confirmed(self, step: Step | None) -> Step | None:
        """Return a step that was found otherwise; None unless the frames fit better by `UNEXPLAINED` without it."""
        is_borne_out = step is not None and self._without(step)._shifts[1] <= UNEXPLAINED * self._shifts[1]
        return step if is_borne_out else None

    def agreed(self, step: Step | None) -> Step | None:
        """Return a step that was found otherwise; None unless the shading moves there by as much, to `AGREED` of it."""
        if step is None:
            return None
        own, _ = self._step_at(step.first, self._shifts[0])
        return step if np.linalg.norm(own - step.shift_px) < AGREED * np.linalg.norm(step.shift_px) else None

    def _without(self, step: Step) -> "MattePart":
        """Return the same with a step taken back."""
        import cv2

        right, down = step.shift_px
        how, size = np.array([[1, 0, -right], [0, 1, -down]]), self.mask.shape[::-1]
        after = [cv2.warpAffine(one, how, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
                 for one in self.pictures[step.first :]]  # fmt: skip
        return replace(self, pictures=np.stack([*self.pictures[: step.first], *after]))

    @cached_property
    def _shifts(self) -> tuple[Array, float]:
        """Return each frame's shift (F, 2) beside what the others foretell, and how far they miss it, relative."""
        mask, values = self.mask, self.pictures[:, self.mask].astype(np.float64)
        foretold, weight, top = _foretold(values, self.toward)
        missed, lit = np.abs(values - foretold) / np.maximum(top, 1e-12), weight > 0
        whole = np.zeros(self.pictures.shape)
        whole[:, mask] = foretold
        down, right = np.gradient(whole, axis=(1, 2))
        # A pixel whose neighbours are not all inside has no slope.
        inside = mask.copy()
        inside[1:-1, 1:-1] &= mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
        moves = np.full((len(values), 2), np.nan)
        for f, clear in enumerate(lit & inside[mask]):
            if np.count_nonzero(clear) >= FEWEST_PX**2:
                # A frame may be brighter than is known.
                slopes = np.stack([-right[f][mask], -down[f][mask], foretold[f]], -1)[clear]
                moves[f] = _robust(slopes, (values - foretold)[f, clear], weight[f, clear])[0][:2]
        misfits = [np.median(one[own]) for one, own in zip(missed, lit, strict=True) if own.any()]
        return moves, float(np.mean(misfits or [0.0]))

    @cached_property
    def _across(self) -> Array:
        """(F, 2) of the directions to the lights, as the part's middle has them."""
        toward = self.toward.mean(1)
        return toward[:, :2] / np.linalg.norm(toward, axis=1, keepdims=True)

    def _step_at(self, first: int, moves: Array) -> tuple[Array, float]:
        """Return the step (2,) of the shifts (F, 2) before a frame, and its probability by chance."""
        from scipy.stats import f as ratio_of_variances

        known = np.isfinite(moves[:, 0])
        columns = np.ones(len(moves)), self._across, np.arange(len(moves)) >= first
        slopes = np.column_stack(columns)[known].astype(np.float64)
        unknowns, left, weight = _robust(slopes, moves[known], np.ones(len(slopes)))
        free = weight.sum() - slopes.shape[1]
        if free < 2:
            return unknowns[-1], 1.0
        scatter = (weight[:, None] * left).T @ left / free + 1e-12 * np.eye(2)
        variance = np.linalg.pinv(slopes.T @ (weight[:, None] * slopes))[-1, -1]
        square = float(unknowns[-1] @ np.linalg.solve(scatter, unknowns[-1])) / max(variance, 1e-12)
        return unknowns[-1], float(ratio_of_variances.sf(square * (free - 1) / (2 * free), 2, free - 1))


def _foretold(values: Array, toward: Array) -> tuple[Array, Array, Array]:
    """Return values (F, N) as the other frames foretell them, their weights (F, N), and bright ones (N,)."""
    top = np.quantile(values, 0.9, axis=0)
    lit = values > LIT * top
    ridge = 1e-9 * np.mean(toward**2) * len(toward) * np.eye(3)
    weight, left, inverse = lit.astype(np.float64), values, ridge
    for _ in range(TURNS):
        weighted = weight[..., None] * toward
        inverse = np.linalg.inv(np.einsum("fni,fnj->nij", weighted, toward, optimize=True) + ridge)
        facing = np.einsum("nij,fnj,fn->ni", inverse, weighted, values, optimize=True)
        left = values - np.einsum("fni,ni->fn", toward, facing)
        weight = lit / (1 + (left / (OUTLIER * _spread(left[lit]))) ** 2)
    leverage = weight * np.einsum("fni,nij,fnj->fn", toward, inverse, toward, optimize=True)
    return values - left / np.maximum(1 - leverage, 0.05), weight, top


def _spread(residuals: Array) -> float:
    return spread(residuals) + 1e-12 if residuals.size else 1.0


def _robust(slopes: Array, values: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Return the unknowns (n, ...) of values (N, ...), residuals, and weights (N,), by least squares reweighted."""
    own, left, unknowns = weight, values, np.zeros(0)
    for _ in range(TURNS):
        normal = slopes.T @ (own[:, None] * slopes)
        weighted = own.reshape(-1, *[1] * (values.ndim - 1)) * values
        unknowns = np.asarray(np.linalg.lstsq(normal, slopes.T @ weighted)[0], np.float64)
        left = values - slopes @ unknowns
        size = np.abs(left) if values.ndim == 1 else np.linalg.norm(left, axis=1)
        own = weight / (1 + (size / (OUTLIER * _spread(size[weight > 0]))) ** 2)
    return unknowns, left, own
