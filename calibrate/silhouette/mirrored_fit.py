"""The outline, plane and blur under which a chrome ball shows the table beside it: one weighted least squares.

The model is that of `calibrate.silhouette.mirrored_table`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.silhouette.cone_fit import SHARPEST_PX
from calibrate.silhouette.explained_profiles import (
    CHROMIUM_SIGMA,
    METALS_SIGMA,
    REFLECTS,
    REFRACTION,
    REFRACTIONS,
    ExplainedProfiles,
    Law,
    coefficients,
    combined,
    explain,
    without,
)
from calibrate.silhouette.mirrored_surroundings import (
    FOOT_SIGMA,
    MirroredSamples,
    MirroredView,
    Surroundings,
    TablePlane,
    samples,
)
from calibrate.silhouette.outline import SECTOR, binned_jacobian, moved
from scene.robust import cluster_sums
from scene.spheres import Sphere

Array = NDArray[np.float64]
Values = NDArray[np.floating]
SURE = 0.985  # share of the profiles' variance that a table explains which is seen: of a plain one chance explains less
LOCATES_PX = 0.15  # doubt of the radius up to which a table locates an outline
TELLS_SLOPE = 0.3  # doubt of the plane's slopes up to which they are seen: what chance explains tells nothing of them
UNEXPLAINED_PX = 6.0
"""Doubt of the outline, times the share of the variance that is left: the table is no plane, things stand on it, or a
wall throws light."""
NEAREST_PLANE = 0.85  # radii from the ball's centre to its table: it cannot cut the ball, but a soft one gives way
TURNS, ROUGH_TURNS = 40, 8
LEAST_PACE, FASTER, FASTEST = 0.02, 1.3, 2.0
"""Share of a step under which no shorter one is tried; by how much more is taken of each next one; and most of all. A
texture that is finer than what the outline is off by makes steps too short. One that leads back is followed by half of
the next: what is looked up between pixels has kinks, and weights are read anew."""
USUAL = 0.6  # reflectance of chromium where it faces the camera, before it is known
ROUGH, REST, REST_SIGMAS = np.repeat([0.1, np.inf], [3, 5]), np.repeat([0.005, 0.0], [3, 5]), 0.3
"""Steps of (u, v, radius) px, and of plane, blur and log n, under which a rough fit, and another, is at rest; and in
sigmas, where these are larger."""
BLUR_DOUBT, ROUGH_BLUR_DOUBT = 0.5, 0.1
"""Relative, of the blur that edges alone suggest; and in a rough fit, where a wrong outline looks like blur."""
FARTHEST = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2, 0.1, 0.3])  # a step's (u, v, radius) px, plane, blur in blurs, log n
SINGULAR = 1e10
ANEW = 0.2  # relative change of the blur from which on the profiles are sampled anew
OUTLINE, PLANE, HEIGHT, BLUR, METAL, STEPPED = slice(0, 3), slice(3, 6), 5, 6, 7, slice(0, 8)
"""Places of the unknowns; the metal's is log n. The ninth is the reflectance, which is solved for in `explain`."""
Start = tuple[Sphere, Array, float]
"""Outline, plane (3,) and blur, px, from which a fit begins."""


class MirroredTable(NamedTuple):
    """An outline and the table that fits it."""

    sphere: Sphere
    covariance: Array  # (3, 3) of (u, v, radius), px^2
    plane: TablePlane
    blur_px: float  # standard deviation of the blur under which the silhouette edge is seen
    mirror: float  # reflectance where it faces the camera
    explained: float  # share of the profiles' variance that the model explains; d, e and f alone explain none of it
    lift: float  # radii above the table at which the photographs alone would have the ball, to first order
    refraction: float  # real part of its refractive index
    is_fresnels: float = 0.0  # log ratio of what Schlick's law and Fresnel's leave; 0 where only one was tried

    @property
    def left_px(self) -> float:
        """The outline's doubt by what is not explained."""
        return UNEXPLAINED_PX * (1 - self.explained)

    @property
    def begin(self) -> Start:
        """Where another fit may begin."""
        return self.sphere, self.plane.values, self.blur_px

    def gain(self, other: "MirroredTable") -> float:
        """Return the log ratio of what another fit of the same profiles leaves to what this one leaves."""
        return float(np.log((1 - other.explained) / (1 - self.explained)))

    def is_seen(self, plane: TablePlane | None) -> bool:
        """Whether the ball shows the table, and this its outline; `plane`: what other balls show of it."""
        located = float(self.covariance[2, 2])
        if self.plane.sigma[:2].max() > TELLS_SLOPE:
            return False
        if plane is not None:
            # What another ball shows has a texture: that is not explained by chance.
            return located + self.left_px**2 < LOCATES_PX**2
        return self.explained > SURE and located < LOCATES_PX**2


def settle(
    table: Surroundings, start: Start, known: TablePlane, law: Law, *, rough: bool, any_metal: bool = False
) -> MirroredTable | None:
    """Move outline, plane (3,) and blur until what the mirror shows is what the picture shows beside it.

    Gauss-Newton under Cauchy's weights and a noise that are read anew in each turn, by the model's own slopes. Steps
    that go on get longer, steps that go to and fro shorter. None where the start explains too little, or a fit that is
    not `rough` is still moving at last. `any_metal`: the real part of the refractive index moves, too; else it is
    chromium's.
    """
    (sphere, plane, blur), found = start, None
    mirror, pace, at = USUAL, 1.0, samples(sphere.radius_px, blur)
    refraction, prior, middle = REFRACTION, np.zeros(9), np.zeros(9)
    prior[BLUR], prior[PLANE] = 1 / ((ROUGH_BLUR_DOUBT if rough else BLUR_DOUBT) * blur) ** 2, 1 / known.sigma**2
    middle[BLUR], middle[PLANE] = blur, known.values
    prior[METAL], middle[METAL] = (METALS_SIGMA if any_metal else CHROMIUM_SIGMA) ** -2, np.log(REFRACTION)
    farthest = np.append(FARTHEST * [1, 1, 1, 1, 1, 1, blur, 1], np.inf)
    step = np.zeros(9)
    for _ in range(ROUGH_TURNS if rough else TURNS):
        if abs(np.log(blur / at.blur_px)) > ANEW:
            at = samples(sphere.radius_px, blur)
        profiles = table.profiles(sphere, at)
        shown, steepness = table.mirrored_by(sphere, plane, at)
        explained = explain(profiles, shown, law(at.middle, mirror, refraction), at.offsets, blur)
        if explained and explained.hopeful:
            moves = table.moves(sphere, plane, at, steepness)
            looked = _Seen(profiles, at, binned_jacobian(table.camera, sphere), shown, moves, any_metal)
            information, pull, scatter = _told(looked, blur, law, refraction, explained)
            normal = information + np.diag(prior)
            size = np.sqrt(np.diag(normal))
            if not (size > 0).all() or np.linalg.cond(normal / np.outer(size, size)) > SINGULAR:
                return None
            inverse = np.linalg.inv(normal)
            covariance = inverse @ (scatter + np.diag(prior)) @ inverse
            sigma = np.sqrt(np.diag(covariance))
            seen = TablePlane(plane, sigma[PLANE])
            gradient = pull - prior * (np.concatenate([np.zeros(3), plane, [blur, np.log(refraction), 0.0]]) - middle)
            lift = seen.height + _rise(normal, gradient, seen.height, prior[HEIGHT])
            of_metal = explained.mirror, explained.share
            found = MirroredTable(sphere, covariance[OUTLINE, OUTLINE], seen, blur, *of_metal, lift, refraction)
            last, step = step, inverse @ gradient
            if np.all(np.abs(step[STEPPED]) < (ROUGH if rough else np.maximum(REST, REST_SIGMAS * sigma[STEPPED]))):
                break
            step *= min(1.0, float(np.min(farthest / np.maximum(np.abs(step), 1e-12))))
            back = last[STEPPED] @ normal[STEPPED, STEPPED] @ step[STEPPED] < 0
            pace = pace / 2 if back else min(FASTER * pace, FASTEST)
        elif found is None or pace < LEAST_PACE:
            break
        else:
            pace /= 2
        move = pace * step
        sphere, plane = moved(found.sphere, move[OUTLINE]), found.plane.values + move[PLANE]
        plane[2] = max(plane[2], NEAREST_PLANE)
        blur = float(max(found.blur_px + move[BLUR], SHARPEST_PX))
        refraction = float(np.clip(found.refraction * np.exp(move[METAL]), *REFRACTIONS))
        mirror = min(max(found.mirror, REFLECTS[0]), REFLECTS[1])
    else:
        return found if rough else None
    return found


def _rise(normal: Array, gradient: Array, height: float, weight: float) -> float:
    """Return by how much the height would grow, to first order, if nothing said that the ball stands on the table.

    `weight`: the inverse variance by which it is held to stand there.
    """
    free, pull = normal.copy(), gradient.copy()
    free[HEIGHT, HEIGHT] += 1 / FOOT_SIGMA**2 - weight
    pull[HEIGHT] += weight * height
    return float(np.linalg.solve(free, pull)[HEIGHT])


class _Seen(NamedTuple):
    """What the photographs show in one turn."""

    profiles: Values  # (F, BINS, M)
    at: MirroredSamples
    jacobian: Array  # (BINS, 3)
    shown: MirroredView
    moves: Values  # (6, F, BINS, K)
    any_metal: bool


def _told(
    seen: _Seen, blur: float, law: Law, refraction: float, explained: ExplainedProfiles
) -> tuple[Array, Array, Array]:
    """Return what the profiles say of the unknowns: inverse covariance (9, 9), gradient (9,), and its scatter (9, 9).

    Neighbours err alike, so that many of them say what one does. How many is told by the scatter of their scores
    between sectors. Without that, what is known of the plane beforehand would count for nothing beside thousands of
    samples.
    """
    slopes = _slopes(seen, blur, law, refraction, explained)
    pull = explained.weight * explained.residual
    scores = np.einsum("pfnm,fnm->pn", slopes, pull).astype(np.float64)
    rows = slopes.reshape(9, -1).astype(np.float64)
    information = (rows * explained.weight.reshape(-1)) @ rows.T
    sums = cluster_sums(scores.T, SECTOR)
    scatter = sums.T @ sums
    alike = max(float(np.trace(np.linalg.pinv(information) @ scatter)) / len(scatter), 1.0)
    return information / alike, scores.sum(1) / alike, scatter / alike**2


def _slopes(seen: _Seen, blur: float, law: Law, refraction: float, explained: ExplainedProfiles) -> Values:
    """Return (9, F, BINS, M), the model's derivatives, in noises, free of d, e and f."""
    shown, offsets, k = seen.shown, seen.at.offsets, explained.mirror
    grazing = law(seen.at.middle, k, refraction)
    reflects = k + (1 - k) * grazing
    basis, mirrored = shown.basis(offsets, blur), shown.blurred(offsets, blur, reflects)
    unmirrored = coefficients(np.nan_to_num(seen.profiles - mirrored), basis, explained.weight)

    def moved_by(shift: float, blur_px: float, grown: float = 1.0) -> Values:
        larger = shown._replace(depths=grown * shown.depths, until=grown * shown.until)
        of_basis = combined(unmirrored, larger.basis(offsets - shift, blur_px))
        return larger.blurred(offsets - shift, blur_px, reflects) + of_basis

    by_shift = (moved_by(0.1, blur) - moved_by(-0.1, blur)) / 0.2
    by_size = (moved_by(0, blur, 1.01) - moved_by(0, blur, 0.99)) / (0.02 * shown.radius_px)
    by_blur = (moved_by(0, blur + 0.05) - moved_by(0, blur - 0.05)) / 0.1
    looked_up = [shown._replace(values=move).blurred(offsets, blur, reflects) for move in seen.moves]
    by_outline = [by_shift * seen.jacobian[:, j, None].astype(np.float32) + looked_up[j] for j in range(3)]
    by_outline[2] += by_size
    by_facing = shown.blurred(offsets, blur, 1 - grazing)
    by_metal = np.zeros_like(by_facing)
    if seen.any_metal:
        more = (1 - k) * (law(seen.at.middle, k, 1.01 * refraction) - grazing) / np.log(1.01)
        by_metal = shown.blurred(offsets, blur, more)
    slopes = np.nan_to_num(np.stack([*by_outline, *looked_up[3:], by_blur, by_metal, by_facing]))
    return without(slopes, basis, explained.weight) / explained.noise
