"""What a matte ball shows under every flash:

    value = E_f (m + k B) + a

m is the flash's own shading, B the light that an even white table under the ball throws back at it, k the table's
albedo, and a the light that is there without flash. Only E_f is a frame's own. The table's
normal is (x, y, 1) / |(x, y, 1)|; k, x and y are the nonlinear numbers.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibrate.photometry.patches import Patches, bounce_of_table
from scene.normals import unit

Array = NDArray[np.float64]
DIM = 0.3  # share of the median flash under which a frame is not brought up to the others' weight
START, LEAST, MOST = [0.1, 0.0, 0.0], [0.0, -2.0, -2.0], [1.0, 2.0, 2.0]
"""The table's albedo and slopes: where they are sought from, and their bounds."""
STEP = 1e-4  # of differences by them


class Fit(NamedTuple):
    """The model fitted; `ambient` is 0 where it would be negative."""

    table: Array  # (3,) k, x and y: its albedo, as far as the ball sees an even, endless one, and its slopes
    energy: Array  # (F,) pixel value of the surface that faces the flash at the reference point
    ambient: float  # a
    residual: Array  # (F, B) value less model


class ShadingModel:
    """One ball's patches under all flashes, and the solver of the model above."""

    def __init__(self, ball: Patches) -> None:
        self.ball = ball
        level = np.sum(ball.weight * ball.shading * ball.values.mean(-1), 1)
        level /= np.maximum(np.sum(ball.weight * ball.shading**2, 1), 1e-12)
        # Relative errors: a bright flash's patches scatter in proportion. Not those of a ball in shadow.
        self.level = level
        self.weight = ball.weight / np.maximum(level, DIM * np.median(level))[:, None] ** 2

    def shape(self, table: Array) -> Array:
        """Return (F, B), what the patches show of a flash of energy 1."""
        return self.ball.shading + table[0] * bounce_of_table(self.ball, unit(np.append(table[1:], 1.0)))

    def slopes(self, table: Array) -> list[Array]:
        """Return the derivatives (F, B) of `shape` by the table's numbers."""
        return [(self.shape(table + e) - self.shape(table - e)) / (2 * STEP) for e in STEP * np.eye(3)]

    def energies(self, shape: Array, ambient: float, values: Array) -> tuple[Array, Array]:
        """Return energy (F,) and value less model (F, B), all else held."""
        rest = values - ambient
        energy = np.sum(self.weight * shape * rest, 1) / np.maximum(np.sum(self.weight * shape**2, 1), 1e-30)
        return energy, rest - energy[:, None] * shape

    def misfit(self, residual: Array) -> Array:
        """Return (F,) the rms of residuals (F, B), relative to each frame's flash."""
        return np.sqrt(np.sum(self.weight * residual**2, 1))

    def fit(self, values: Array) -> Fit:
        """Fit the table, the ambient light and the energies to values (F, B)."""
        root = np.sqrt(self.weight)

        def residual(table: Array) -> Array:
            shape = self.shape(table)
            return (root * self.energies(shape, self._ambient(shape, values), values)[1]).ravel()

        table = np.asarray(least_squares(residual, START, bounds=(LEAST, MOST), diff_step=STEP).x, np.float64)
        shape = self.shape(table)
        ambient = self._ambient(shape, values)
        energy, left = self.energies(shape, ambient, values)
        return Fit(table, energy, ambient, left)

    def _ambient(self, shape: Array, values: Array) -> float:
        """Return the ambient light, with every energy eliminated; 0 where it would be negative."""
        weight = self.weight
        square = np.maximum(np.sum(weight * shape**2, 1), 1e-30)
        mixed = np.sum(weight * shape, 1)
        left = weight.sum() - np.sum(mixed**2 / square)
        right = np.sum(weight * values) - np.sum(mixed * np.sum(weight * shape * values, 1) / square)
        return max(float(right / left), 0.0) if left > 1e-9 * weight.sum() else 0.0
