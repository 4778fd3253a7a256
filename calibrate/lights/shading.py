"""What white balls' shading says of the lights, beside the chrome balls' highlights: less exact, but from other places.

One chrome ball shows each flash's direction where it stands; a white ball beside it shows another, and the two meet
where the flash is. A white ball's error is its surroundings': light that the table and its neighbours reflect onto it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.directions import two_across
from scene.normals import unit

Array = NDArray[np.float64]
SURROUNDINGS_DEG = 2.5
"""What bends a white ball's shading, one axis: in 280 frames of path-traced scenes with tables of any albedo half were
off by less than 1.3 degrees, 90 % by less than 3.3, while the fit's own sigma was 0.2. Frames err alike, so a single
one counts less than that."""
CLEAR_DEG, CLEAR = 1.0, 5.0
"""The fit's own sigma up to which a frame's shading is clear, or times the ball's median: half in shadow it is 3 to 12
degrees, else 0.2."""


@dataclass(frozen=True)
class Shading:
    """What W white balls show of F lights by their shading."""

    directions: Array  # (W, F, 3) unit, from each ball; NaN where it shows too little
    sigma_deg: Array  # (W, F) one tangent axis, of the fit alone
    centers_mm: Array  # (W, 3) NaN where the distance is not known

    @cached_property
    def clear(self) -> NDArray[np.bool_]:
        """(W, F): whether the ball shows the light, and it alone."""
        known = np.isfinite(self.sigma_deg)
        usual = [np.median(row[good]) if good.any() else 0.0 for row, good in zip(self.sigma_deg, known, strict=True)]
        limit = np.maximum(CLEAR * np.array(usual).reshape(-1, 1), CLEAR_DEG)
        return known & (np.nan_to_num(self.sigma_deg, nan=np.inf) < limit)

    @property
    def rough(self) -> Array:
        """(F, 3) the mean of the balls that show the light clearly, NaN where none does."""
        seen = self.clear[..., None]
        total = np.where(seen, self.directions, 0).sum(0)
        return np.where(seen.any(0), unit(np.where(seen.any(0), total, 1.0)), np.nan)

    @property
    def placed(self) -> int:
        """How many of the balls show a light clearly, from a known place."""
        return int(np.sum(np.isfinite(self.centers_mm).all(1) & self.clear.any(1)))

    @cached_property
    def stated_deg(self) -> Array:
        """(W, F) one tangent axis, of the fit and of what surrounds the balls."""
        return np.hypot(self.sigma_deg, SURROUNDINGS_DEG)

    def only(self, frames: NDArray[np.bool_]) -> "Shading":
        """Return the same with nothing shown in all other frames."""
        sigma = np.where(frames, self.sigma_deg, np.nan)
        return Shading(np.where(frames[:, None], self.directions, np.nan), sigma, self.centers_mm)

    def misses(self, directions: Array, inverse: Array, reference: Array) -> Array:
        """Return (W, F, 2), how far lights are beside the shading, in sigmas; NaN where it shows too little.

        `directions` (F, 3) from the reference point (3,), and inverse ranges (F,): 0 for distant lights. A ball whose
        place is not known is taken to be at the reference point.
        """
        arm = np.nan_to_num(reference - self.centers_mm)[:, None]
        target = unit(directions + inverse[:, None] * arm)
        # Stereographic, as in `Adjustment`.
        half = np.maximum(1 + np.sum(self.directions * target, -1), 1e-6) / 2
        miss = np.stack([np.sum(axis * target, -1) for axis in self._across], -1) / half[..., None]
        # What surrounds them is alike for all: several white balls err together.
        sigma = np.deg2rad(self.stated_deg * np.sqrt(len(self.centers_mm)))
        return np.where(self.clear, 1.0, np.nan)[..., None] * miss / sigma[..., None]

    @cached_property
    def _across(self) -> tuple[Array, Array]:
        return two_across(self.directions)


def no_shading(frames: int) -> Shading:
    """Return what no white ball shows."""
    return Shading(np.zeros((0, frames, 3)), np.zeros((0, frames)), np.zeros((0, 3)))
