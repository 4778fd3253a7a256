"""The flashes' strengths by the table on which the balls stand: a matte plane of whatever pattern.

    log v_pf = a_p + log e_f + log(N . l_f(x_p))

e_f: the flash's strength; a_p: how bright a pixel's place is; l_f: the light there, with its fall-off. With the plane
known each pixel tells all strengths, where a surface of unknown normals has three unknowns a pixel. The balls tell the
plane, and so do near lights, whose shading changes across it.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibrate.photometry.table_normal import normal_of, standing, touching
from calibrate.without_balls.probe import FEWEST_PIXELS, Probe, ProbePhotometry
from scene.camera import Camera
from scene.lights import Lights
from scene.robust import spread
from scene.spheres import Sphere

Array = NDArray[np.float64]
MOST, ASKED = 6000, 300  # pixels that are looked at, about, and those by which the plane is found
LEAST_SHADE = 0.05  # of the median shading: with less, light grazes the table
LEAST_NOISE = 1e-4  # of the logarithms
NOISE = 0.003  # of white, under which a pixel shows noise: tables are often dark
OFTEN = 0.6  # share of the frames in which a pixel must be lit
ROUNDS, KEPT = 3, 0.5  # turns, in each of which the pixels that keep best to the plane are chosen
ALTERNATIONS = 4  # of medians over frames and over pixels
SAMPLES = 100.0
"""Samples that err independently: neighbours share a texture's shine, relief, a shadow. With 50 to 800 the strengths
of 17 sessions by others err by 3.1 to 3.4 % in the median."""
LOOSE = 0.1  # of what the balls' places tell of the plane, where it is asked what the lights alone say
OUTLIER = 2.5  # spreads at which a sample counts half
STEP = 1e-3  # of the differences by the plane's slopes, and by its distance, relative
TABLE = 0.03  # what a table's strengths err by beyond: it bends, shines, gets light back from what stands on it
SECTORS = 8  # parts of the table whose errors are taken to agree


class _Table(NamedTuple):
    """Pixels (P) that may show the table, and where the lights stand."""

    probe: Probe
    camera: Camera
    lights: Lights

    def take(self, keep: NDArray) -> "_Table":
        return self._replace(probe=self.probe.take(keep))

    def logs(self, plane: Array, values: NDArray | None = None) -> Array:
        """Return log(v / N . l) (P, F) of a plane as `normal_of` has it; NaN where that says nothing.

        `values` (F, P): of one channel; None: the mean of all.
        """
        shown = self.probe.values.mean(-1) if values is None else values
        normal, rays = normal_of(plane), self.camera.points_at_depth(self.probe.pixels, -1.0)
        far = plane[2] / (rays @ normal)
        shade = self.lights.toward(rays * far[:, None]) @ normal
        least = LEAST_SHADE * max(float(np.median(shade)), 0.0) if shade.size else 0.0
        known = (shade > least) & (far > 0) & (shown > NOISE) & ~self.probe.clipped
        return np.log(np.where(known, shown, np.nan) / np.where(known, shade, np.nan)).T.astype(np.float64)


def strengths_on_table(
    probe: Probe, camera: Camera, spheres: Sequence[Sphere], lights: Lights
) -> ProbePhotometry | None:
    """Read near flashes' strengths from the table on which balls of known place stand; None where none tells them.

    `probe`: what is seen beside the balls. The lights' intensities are not looked at. Sigma: by how much parts of the
    table differ, what the plane's own error moves, and what it would move if the balls told next to nothing of it: what
    is seen may not be what they stand on.
    """
    balls = standing(camera, spheres)
    if not balls or lights.positions_mm is None:
        return None
    table = _Table(probe.take(slice(None, None, max(1, len(probe.pixels) // MOST))), camera, lights)
    misses, plane = touching(camera, balls)
    steps = STEP * np.diag([1.0, 1.0, plane[2]])

    def fitted(table: _Table, plane: Array, noise: float, balls: float = 1.0) -> tuple[Array, Array]:
        """Return the plane and its covariance; the balls count by so much."""

        def left(plane: Array) -> Array:
            rest = _split(table.logs(plane))[1] / (OUTLIER * noise)
            cauchy = OUTLIER * np.sign(rest) * np.sqrt(np.log1p(rest**2) * SAMPLES / rest.size)
            return np.concatenate([np.nan_to_num(cauchy).ravel(), balls * misses(plane)])

        def slopes(plane: Array) -> Array:
            return np.stack([(left(plane + step) - left(plane - step)) / (2 * step.sum()) for step in steps], -1)

        # By name through a dict: the type stub takes no function for the Jacobian.
        options: dict[str, Any] = {"jac": slopes, "x_scale": "jac"}
        found = least_squares(left, plane, **options)
        return found.x, np.linalg.inv(found.jac.T @ found.jac)

    for _ in range(ROUNDS):
        table = table.take(np.isfinite(table.logs(plane)).mean(1) > OFTEN)
        logs = table.logs(plane)
        if (np.isfinite(logs).sum(0) < FEWEST_PIXELS).any():
            return None
        off = _medians(np.abs(_split(logs)[1]), 1)[:, 0]
        best, noise = np.flatnonzero(off <= np.quantile(off, KEPT)), max(spread(off), LEAST_NOISE)
        some = table.take(best[:: max(1, len(best) // ASKED)])
        plane, covariance = fitted(some, plane, noise)
    other, _ = fitted(some, plane, noise, LOOSE)
    table = table.take(best)
    logs, pixels = table.logs(plane), table.probe.pixels
    strength, rest = _split(logs)
    channels = [_split(table.logs(plane, values))[0] for values in np.moveaxis(table.probe.values, -1, 0)]
    energy = np.exp(np.stack(channels, -1))
    turn = np.arctan2(*(pixels - pixels.mean(0)).T)
    sector = np.floor((turn / (2 * np.pi) + 0.5) * SECTORS)
    parts = [_split(logs[sector == k])[0] - strength for k in np.unique(sector)]
    told = [part for part in parts if np.isfinite(part).all()]
    if not told:
        return None
    size, axes = np.linalg.eigh(covariance)
    places = [other, *(plane + (axes * np.sqrt(size)).T)]
    moved = [_split(table.logs(place))[0] - strength for place in places]
    sigma = np.sqrt(TABLE**2 + np.mean(np.square(told), 0) + np.sum(np.square(moved), 0))
    believed = (np.abs(rest) < OUTLIER * noise).sum(0) / np.maximum(np.isfinite(rest).sum(0), 2 * FEWEST_PIXELS)
    return ProbePhotometry("the table", energy / energy.mean(0), sigma, noise, len(pixels), believed)


def _split(logs: Array) -> tuple[Array, Array]:
    """Return log strengths (F,) of mean 0, and what they and each pixel's own brightness leave of logs (P, F)."""
    strength = np.zeros(logs.shape[1])
    for _ in range(ALTERNATIONS):
        own = _medians(logs - strength, 1)
        strength = _medians(logs - own, 0)[0]
        strength -= strength.mean()
    return strength, logs - own - strength


def _medians(values: Array, axis: int) -> Array:
    """Return the medians along an axis, which is kept, of what is no NaN; NaN where all are."""
    count = np.isfinite(values).sum(axis, keepdims=True)
    middle = np.stack([np.maximum(count - 1, 0) // 2, count // 2])
    middle = np.minimum(middle, values.shape[axis] - 1)
    return np.take_along_axis(np.sort(values, axis)[None], middle, axis + 1).mean(0)
