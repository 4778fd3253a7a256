"""What a fitted material leaves of the photographs, frame by frame, and what would explain it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from scene.lights import Lights
from twin.material.fit_material import MaterialFit
from twin.material.material_kernels import predicted
from twin.material.material_samples import Samples
from twin.material.reflection_models import reflected
from twin.material.tilted_normals import STEP, change, tangents, turned

Array = NDArray[np.float64]

SOME = 48_000
"""Samples, pixels times frames, that the parts are found on."""
TOGETHER = 64
"""Pixels to a block: neighbours err alike, and must not foretell each other."""
LOBE, LAMBERT = 10, 6
"""Bends of the free curves that stand for another coat and another body: over the half angle, over the cosine to the
light."""
TELLING = 0.25
"""Share of the squared residual above which another coat or another body is said to be wanted."""


@dataclass(frozen=True)
class Part:
    """One cause of the residual, let free.

    explains: Share of the squared residual that goes, the freedom it takes allowed for; 0 if none.
    size: Root mean square of what was found, in `unit`.
    expected: Relative RMSE that the calibration's own sigma would leave; NaN where it tells none.
    foretells: Share of the squared residual that goes on samples that it was not found on: the other half of the
        pixels, in blocks; of the normals the other half of the frames. Below 0 if it makes them worse.
    """

    explains: float
    size: float
    unit: str
    expected: float = float("nan")
    foretells: float = float("nan")


@dataclass(frozen=True, eq=False)
class Residual:
    """Relative RMSE: root of the squared residuals' sum over the squared values', usable samples, all channels.

    per_frame (F,): NaN of a frame without samples.
    parts: Each let free alone: `direction`, `intensity`, `ambient`, `registration` (pose), `normals` (each pixel's
        own), `highlights` (a coat of any shape), `body` (any law of the light's angle); they overlap and do not add up.
    """

    whole: float
    per_frame: Array
    parts: dict[str, Part]

    @property
    def doubts(self) -> tuple[str, ...]:
        """What the residual says against the model."""
        wanted = {
            "highlights": "a second lobe, or highlights of another shape,",
            "body": "a body that gives back light otherwise than the fitted one",
        }
        return tuple(
            f"One roughness and one strength are not all: {what} would explain {100 * self.parts[name].explains:.0f} % "
            "of the squared residual."
            for name, what in wanted.items()
            if self.parts[name].explains > TELLING
        )

    def __str__(self) -> str:
        """The line that is printed."""
        told = ", ".join(
            f"{name} {100 * part.explains:.0f} % ({100 * part.foretells:.0f} %)" for name, part in self.parts.items()
        )
        return (
            f"relative RMSE {100 * self.whole:.2f} %; of its square, each alone would explain (of samples that it was "
            f"not found on): {told}"
        )


def material_residual(samples: Samples, fit: MaterialFit, lights: Lights) -> Residual:
    """Return what a fit leaves, and what explains it.

    The prediction's change for each nuisance, linearised, is fitted to the residual by plain least squares, with each
    pixel's albedo free all along (eliminated, as in the fit).
    """
    weights = np.repeat(samples.usable[..., None], 3, -1).astype(np.float32)
    values, _, _ = predicted(samples, weights, fit.surface, fit.strength)
    square = np.where(samples.usable, np.sum((samples.values - values).astype(np.float64) ** 2, -1), 0)
    bright = np.where(samples.usable, np.sum(samples.values.astype(np.float64) ** 2, -1), 0)
    with np.errstate(invalid="ignore"):
        per_frame = np.sqrt(square.sum(0) / bright.sum(0))
    whole = float(np.sqrt(square.sum() / bright.sum()))
    some = samples.only(slice(None, None, max(1, samples.usable.size // SOME)))
    return Residual(whole, per_frame, dict(_parts(some, fit, lights)))


def _parts(samples: Samples, fit: MaterialFit, lights: Lights) -> Iterator[tuple[str, Part]]:
    usable = samples.usable[..., None]
    weights = np.repeat(usable, 3, -1).astype(np.float32)
    values, _, albedo = predicted(samples, weights, fit.surface, fit.strength)
    light = np.where(usable, samples.irradiance, 0).astype(np.float64)
    body, _ = reflected(fit.surface, samples.normals, samples.views, samples.toward)
    design = light * body[..., None]
    residual = np.where(usable, samples.values - values, 0).astype(np.float64)
    bright = float(np.sum(np.where(usable, samples.values, 0).astype(np.float64) ** 2))
    own = albedo.astype(np.float64)[:, None]

    def changed(normals: NDArray, toward: NDArray) -> Array:
        return change(samples, fit, albedo, normals, toward)

    second = samples.blocks(TOGETHER) % 2 == 1
    project = _Eliminated(design, int(np.count_nonzero(usable)), residual, second)
    bent = np.stack([changed(samples.normals, turned(samples.toward, t)) for t in tangents(samples.toward)], -1)
    scaled = np.where(usable, values, 0).astype(np.float64)[..., None] * np.eye(3)

    def expected(columns: Array, sigma: Array) -> float:
        return float(np.sqrt(np.sum(columns**2 * (sigma**2)[:, None, None]) / bright))

    sigma, degree = np.radians(lights.direction_sigma_deg), float(np.degrees(1))
    yield "direction", project.part(bent, "deg", by_frame=True, factor=degree, expected=expected(bent, sigma))
    known = expected(scaled, lights.intensity_sigma)
    yield "intensity", project.part(scaled, "relative", by_frame=True, expected=known)
    yield "ambient", project.part(np.where(usable, own, 0)[..., None] * np.eye(3), "pixel value on white")
    shifts = [np.cross(axis, samples.normals) for axis in np.eye(3)]
    shifts += [samples.slopes[:, k] for k in (0, 1)]
    pose = np.stack([changed(samples.normals + STEP * shift, samples.toward) for shift in shifts], -1)
    yield "registration", project.part(pose, "rad, px")
    lean = [changed(turned(samples.normals, t), samples.toward) for t in tangents(samples.normals)]
    yield "normals", project.each_pixel(np.stack(lean, -1))
    lobe, lambert = _curves(samples, light, own)
    yield "highlights", project.part(lobe, "pixel value")
    yield "body", project.part(lambert, "relative")


class _Eliminated:
    """Least squares on residuals (P, F, 3) with each pixel's albedo, of the columns `design`, free.

    second (P,): Which of the pixels are of the second half, where one half is to foretell the other.
    """

    def __init__(self, design: Array, pixels_lit: int, residual: Array, second: NDArray[np.bool_]) -> None:
        self._design, self._halves = design, (~second, second)
        self._residual = self._free(residual)
        self._left = float(np.sum(self._residual**2))
        self._freedom = 3 * pixels_lit - design.shape[0] * design.shape[2]

    def _free(self, columns: Array, frames: slice = slice(None)) -> Array:
        """Return columns less what the albedo that suits some of the frames best makes of them."""
        design, own = self._design[:, frames], columns[:, frames]
        share = np.einsum("pfc,pfc->pc", design, own) / np.maximum(np.einsum("pfc,pfc->pc", design, design), 1e-300)
        return columns - self._design * share[:, None]

    def part(
        self, columns: Array, unit: str, *, by_frame: bool = False, factor: float = 1.0, expected: float = np.nan
    ) -> Part:
        """Return the part of nuisances that do `columns` (P, F, 3, K): K for all frames, or for each by itself."""
        (one, first), (other, second) = (self._equations(columns, half, by_frame=by_frame) for half in self._halves)
        solved, rank = _solved(one + other, first + second)
        fall = 0.0
        for here, right, there, theirs in ((one, first, other, second), (other, second, one, first)):
            found = _solved(here, right)[0]
            fall += float(2 * found @ theirs - found @ there @ found)
        size = factor * float(np.sqrt(np.mean(solved**2)))
        part = self._told(float(solved @ (first + second)), rank, size, unit)
        return replace(part, expected=expected, foretells=fall / max(self._left, 1e-300))

    def _equations(self, columns: Array, pixels: NDArray[np.bool_], *, by_frame: bool) -> tuple[Array, Array]:
        design, columns = self._design[pixels], columns[pixels]
        square = np.maximum(np.einsum("pfc,pfc->pc", design, design), 1e-300)
        over = np.einsum("pfc,pfck->fkpc", design, columns) / np.sqrt(square)
        inner = np.einsum("pfck,pfcl->fkl", columns, columns)
        right = np.einsum("pfck,pfc->fk", columns, self._residual[pixels])
        if not by_frame:
            over, inner, right = (sums.sum(0, keepdims=True) for sums in (over, inner, right))
        over = over.reshape(right.size, -1)
        return block_diag(*inner) - over @ over.T, right.ravel()

    def each_pixel(self, columns: Array) -> Part:
        """Return the part of two nuisances of each pixel's own, columns (P, F, 3, 2)."""
        every = slice(None)
        lean, right, good = self._lean(columns, every)
        size = float(np.degrees(np.sqrt(np.median(np.sum(lean**2, 1)) / 2)))
        part = self._told(float(np.sum(lean * right)), 2 * int(good.sum()), size, "deg, median")
        before, after = 0.0, 0.0
        for here, there in ((slice(0, None, 2), slice(1, None, 2)), (slice(1, None, 2), slice(0, None, 2))):
            lean = self._lean(columns, here)[0]
            left = self._free(self._residual, here)
            free = np.stack([self._free(columns[..., k], here) for k in (0, 1)], -1)
            before += float(np.sum(left[:, there] ** 2))
            after += float(np.sum((left - np.einsum("pfck,pk->pfc", free, lean))[:, there] ** 2))
        return replace(part, foretells=1 - after / max(before, 1e-300))

    def _lean(self, columns: Array, frames: slice) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return the leans (P, 2) that some frames tell, the right sides (P, 2), and where they tell any (P,)."""
        free = np.stack([self._free(columns[..., k], frames) for k in (0, 1)], -1)[:, frames]
        residual = self._free(self._residual, frames)[:, frames]
        inner, right = np.einsum("pfck,pfcl->pkl", free, free), np.einsum("pfck,pfc->pk", free, residual)
        good = np.linalg.det(inner) > 1e-6 * (inner[:, 0, 0] * inner[:, 1, 1] + 1e-300)
        lean = np.zeros_like(right)
        lean[good] = np.linalg.solve(inner[good], right[good][..., None])[..., 0]
        return lean, right, good

    def _told(self, fall: float, freed: int, size: float, unit: str) -> Part:
        left = max(self._left - fall, 0) / max(self._freedom - freed, 1)
        return Part(float(max(1 - left / (self._left / self._freedom), 0)), size, unit)


def _solved(square: Array, right: Array) -> tuple[Array, int]:
    # A constant factor on all lights is the albedo's: the smallest step of all is taken along such directions.
    found, _, rank, _ = np.linalg.lstsq(square, right, rcond=1e-9)
    return np.asarray(found, np.float64), int(rank)


def _curves(samples: Samples, light: Array, albedo: Array) -> tuple[Array, Array]:
    """Return (P, F, 3, LOBE), any coat over the half angle, and (P, F, 3, LAMBERT), any body over the light's."""
    half = samples.toward + samples.views[:, None]
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    angle = np.arccos(np.clip(np.einsum("pfi,pi->pf", half, samples.normals), 0, 1))
    cosine = np.einsum("pfi,pi->pf", samples.toward, samples.normals)
    # Finer where highlights are: evenly in the square root of the angle.
    lobe = _hats(np.sqrt(angle / (np.pi / 2)), LOBE)[:, :, None] * light[..., None]
    lambert = _hats(cosine, LAMBERT)[:, :, None] * (light * albedo)[..., None]
    return lobe, lambert


def _hats(where: NDArray, count: int) -> Array:
    """Return (..., count), the weights of linear interpolation between nodes at 0 to 1."""
    return np.maximum(1 - np.abs(np.asarray(where, np.float64)[..., None] * (count - 1) - np.arange(count)), 0)
