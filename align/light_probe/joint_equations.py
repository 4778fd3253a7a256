"""Pose and lights together: what a small change of both does to outline and shading, each pixel's own unknowns gone.

A turn of scan and lights together leaves all shading as it is; what holds the pose is where in the picture the scan's
outline and its folds lie. So neither is found with the other held: they would follow each other slowly, and each would
seem surer than it is.

The scan's normals have errors. Taken as exact they flatten what shading tells, and lights come out too far away: by a
third, for 2 degrees of noise on a surface of waves of 10. So a pixel has three unknowns, m = albedo times its true
normal, which the photographs tell, and the scan as well as its normals are known (total least squares [Golub1980]).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import FinalEvidence
from align.pose.motion import looking_along
from scene.lights import Lights
from scene.normals import unit
from scene.robust import spread

Array = NDArray[np.float64]
SECTORS = 8
"""Of the object, about its middle."""
REWEIGHTED = 5
UNIT = 2.0
"""Sigmas at which Geman and McClure's loss bends: gloss must not pull."""
LEAST_SIGMA, LEAST_DOUBT_DEG = 0.003, 0.2
"""Of the samples, relative to the pixel; of the scan's normals."""
TINY, HELD = 1e-6, 1e6
NEAREST, FARTHEST = 1.3, 300.0
"""Distances of a light from the object's middle that are tried, in radii of the object."""
POSE_PX = 30.0
"""Each of the pose's unknowns is known to so much beforehand: the silhouette found it."""


@dataclass(frozen=True)
class JointEquations:
    """The normal equations of N lights of k unknowns each and a pose of six, in the order of `light_slopes`."""

    matrices: Array  # (SECTORS, 6 + k N, 6 + k N): what each sector's samples know
    pulls: Array  # (SECTORS, 6 + k N)
    beside: tuple[Array, Array]  # the same of the outline, and of what is known beforehand
    count: int  # N

    @classmethod
    def about(cls, here: FinalEvidence, doubt_deg: Array, *, near: bool) -> "JointEquations":
        """Linearise at the evidence's pose and lights; `doubt_deg` (P,) is the sigma of the scan's normals."""
        seen, units, used = here.seen, here.steps(1.0), here.used
        lights, asked = seen.lights, used.any(0)
        points, normals = (array[asked] for array in here.surface)
        values = np.where(used, seen.samples.values, 0)[:, asked] / seen.samples.scale[asked]
        turned = here.view.normal_slopes(seen.rays, *here.surface)[asked] * units
        terms = here.terms(here.pose)
        effect = terms[1].information(units)[2]
        outline = [term.information(units)[:2] for term in terms[::2]]
        pixels = _Pixels.of(seen.toward(points), normals, values, used[:, asked], doubt_deg[asked])
        slopes = light_slopes(lights, points, pixels.m, near=near)
        matrices, pulls = pixels.equations(slopes, turned, _sector_of(seen.samples.pixels)[asked])
        beside = _beside(len(lights), near, seen.caster.mesh.radius_mm, outline)
        return cls(matrices / effect, pulls / effect, beside, len(lights))

    def solve(self, *, without: int | None = None) -> tuple[Array, Array]:
        """Return the best step (6 + k N,), the pose's six first, in its units, and the pose's covariance (6, 6).

        `without`: of all sectors but this one.
        """
        matrix, pull = self.matrices.sum(0) + self.beside[0], self.pulls.sum(0) + self.beside[1]
        if without is not None:
            matrix, pull = matrix - self.matrices[without], pull - self.pulls[without]
        inverse = np.linalg.inv(matrix)
        return inverse @ pull, inverse[:6, :6]

    def lights_of(self, step: Array) -> Array:
        """Return the lights' part (N, k) of a step."""
        return step[6:].reshape(self.count, -1)

    def jackknife(self) -> Array:
        """Return the lights' covariance (N, k, k) by leaving out each sector in turn [Efron1981].

        Gloss, bounced light and the scan's own faults err over whole regions.
        """
        steps = np.stack([self.lights_of(self.solve(without=sector)[0]) for sector in range(SECTORS)])
        steps -= steps.mean(0)
        return (SECTORS - 1) / SECTORS * np.einsum("sni,snj->nij", steps, steps)


@dataclass(frozen=True)
class _Pixels:
    """P pixels, each with its best m under the lights."""

    vectors: Array  # (N, P, 3)
    weight: Array  # (N, P) in 1 / variance
    residuals: Array  # (N, P)
    m: Array  # (P, 3) albedo times normal
    albedo: Array  # (P,)
    prior: Array  # (P, 3, 3) what the scan knows of m

    @classmethod
    def of(cls, vectors: Array, normals: Array, values: Array, used: NDArray[np.bool_], doubt_deg: Array) -> "_Pixels":
        doubt = np.radians(np.maximum(doubt_deg, LEAST_DOUBT_DEG)) / np.sqrt(2)
        across = np.eye(3) - normals[:, :, None] * normals[:, None, :]
        b = np.einsum("npk,pk->np", vectors, normals)
        albedo = (used * b * values).sum(0) / np.maximum((used * b * b).sum(0), 1e-12)
        m, residuals, sigma = albedo[:, None] * normals, np.where(used, values - albedo * b, 0.0), 0.0
        weight, prior = used.astype(np.float64), across
        for _ in range(REWEIGHTED):
            sigma = max(spread(residuals[used]), LEAST_SIGMA)
            weight = used / (1 + (residuals / (UNIT * sigma)) ** 2) ** 2 / sigma**2
            albedo = np.maximum(np.einsum("pk,pk->p", m, normals), 0.05)
            prior = across / (doubt * albedo)[:, None, None] ** 2
            right = np.einsum("np,npi->pi", weight * values, vectors)
            m = np.linalg.solve(_squares(weight, vectors) + prior + TINY * np.eye(3), right[..., None])[..., 0]
            residuals = np.where(used, values - np.einsum("npi,pi->np", vectors, m), 0.0)
        return cls(vectors, weight, residuals, m, albedo, prior)

    def equations(self, slopes: Array, turned: Array, sector: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return the sectors' matrices and pulls by slopes (N, P, k) of the lights, and `turned` (P, 3, 6), normals'.

        With m eliminated (Schur complement [Triggs2000]): what of a change m takes up tells nothing. The pose acts
        through the scan's normals alone: it turns what m should be.
        """
        count, total, k = slopes.shape
        moved = self.albedo[:, None, None] * turned
        shared = np.zeros((total, 3, 6 + count * k))
        shared[:, :, :6] = -self.prior @ moved
        told = np.einsum("npi,npk->pink", self.weight[..., None] * self.vectors, slopes)
        shared[:, :, 6:] = told.reshape(total, 3, -1)
        taken = np.linalg.solve(_squares(self.weight, self.vectors) + self.prior + TINY * np.eye(3), shared)
        lean = np.einsum("pij,pj->pi", self.prior, self.m)
        size = shared.shape[2]
        matrices, pulls = np.zeros((SECTORS, size, size)), np.zeros((SECTORS, size))
        for matrix, pull, number in zip(matrices, pulls, range(SECTORS), strict=True):
            here = np.flatnonzero(sector == number)
            matrix -= np.tensordot(shared[here], taken[here], axes=([0, 1], [0, 1]))
            matrix[:6, :6] += np.tensordot(moved[here], self.prior[here] @ moved[here], axes=([0, 1], [0, 1]))
            pull[:6] = np.einsum("pik,pi->k", moved[here], lean[here])
            for n in range(count):
                own, part = slopes[n, here], slice(6 + n * k, 6 + n * k + k)
                weighted = self.weight[n, here, None] * own
                matrix[part, part] += weighted.T @ own
                pull[part] = weighted.T @ self.residuals[n, here]
        return matrices, pulls


def _squares(weight: Array, vectors: Array) -> Array:
    return np.einsum("npi,npj->pij", weight[..., None] * vectors, vectors, optimize=True)


def _sector_of(pixels: Array) -> NDArray[np.int64]:
    """Return the sector (P,) of pixels (P, 2), by their direction from their middle."""
    u, v = (pixels - pixels.mean(0)).T
    return ((np.arctan2(v, u) / (2 * np.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS


def _beside(count: int, near: bool, radius_mm: float, outline: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return the equations of what is known beside the samples: of the outline, and how far unknowns can be at all.

    A light turns by a radian, its strength changes by a factor of e, its nearness by one over the object's radius. A
    factor that all lights share is the albedo's: it is held.
    """
    k = 4 if near else 3
    loose = np.tile([1.0, 1.0, 1.0, radius_mm**2][:k], count)
    matrix, pull = np.diag(np.concatenate([np.full(6, POSE_PX**-2), loose])), np.zeros(6 + count * k)
    for known, slope in outline:
        matrix[:6, :6] += known
        pull[:6] -= slope
    strengths = slice(8, None, k)
    matrix[strengths, strengths] += HELD
    return matrix, pull


def light_slopes(lights: Lights, points: Array, normals: Array, *, near: bool) -> Array:
    """Return d(vector . normal) (N, P, 3 or 4) of lights of intensity 1 at points and normals (P, 3), mm.

    Per light: its direction's turn along two tangents (radians), the logarithm of its intensity at the reference point
    c, and where `near` the inverse k of its distance from there (1 / mm). With u = d - k (p - c) the vector at p is
    s u / |u|^3, which for k = 0 is a distant light's: a light can be followed from there without a jump.
    """
    arm, nearness = points - lights.reference_point_mm, nearness_of(lights)
    u = lights.directions[:, None] - nearness[:, None, None] * arm
    length = np.linalg.norm(u, axis=-1, keepdims=True)
    along, cosine = u / length, np.einsum("npk,pk->np", u / length, normals)
    # d(u / |u|^3) . n = du . gradient
    gradient = (normals - 3 * cosine[..., None] * along) / length**3
    across = looking_along(lights.directions)[:, :2]
    columns = [np.einsum("npk,nk->np", gradient, across[:, axis]) for axis in range(2)]
    columns.append(cosine / length[..., 0] ** 2)
    if near:
        columns.append(-np.einsum("npk,pk->np", gradient, arm))
    return np.stack(columns, -1)


def changed(lights: Lights, step: Array, radius_mm: float) -> Lights:
    """Return the lights after a step (N, 3 or 4) of `light_slopes`; with four columns near ones, whatever they were."""
    across = looking_along(lights.directions)[:, :2]
    directions = unit(lights.directions + np.einsum("na,nak->nk", step[:, :2], across))
    nearness, positions = nearness_of(lights), None
    if step.shape[1] == 4:
        nearness = np.clip(nearness + step[:, 3], 1 / (FARTHEST * radius_mm), 1 / (NEAREST * radius_mm))
    if nearness.all():
        positions = lights.reference_point_mm + directions / nearness[:, None]
    brighter = np.exp(step[:, 2:3])
    return replace(lights, directions=directions, positions_mm=positions, intensities=lights.intensities * brighter)


def nearness_of(lights: Lights) -> Array:
    """Return (N,) 1 / distance from the reference point, 1 / mm; 0 of distant lights."""
    if lights.positions_mm is None:
        return np.zeros(len(lights))
    return 1 / np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
