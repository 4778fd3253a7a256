"""The outline, plane and blur under which a chrome ball shows the table beside it: one weighted least squares.

The model is that of `calibrate.silhouette.mirrored_table`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.silhouette.cone_fit import SHARPEST_PX
from calibrate.silhouette.explained_profiles import (
    REFLECTS,
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
from calibrate.silhouette.outline import SECTOR, moved
from scene.robust import cluster_sums
from scene.spheres import Sphere

Array = NDArray[np.float64]
Values = NDArray[np.floating]
SURE = 0.985  # share of the profiles' variance that a table explains which is seen: of a plain one chance explains less
LOCATES_PX = 0.15  # doubt of the radius up to which a table locates an outline
UNEXPLAINED_PX = 6.0
"""Doubt of the outline, times the share of the variance that is left: the table is no plane, things stand on it, or a
wall throws light."""
NEAREST_PLANE, FARTHEST_PLANE = 0.85, 2.0
"""Radii from the ball's centre to its table. It cannot cut the ball, but a soft one gives way; no foot is higher."""
TURNS, ROUGH_TURNS, LAST_TURNS = 40, 8, 20
LAST_STEP = 0.5  # whole steps would go to and fro: bilinear interpolation has kinks, and weights are read anew
FIRST_DAMPING, MOST_DAMPING = 1e-2, 1e1  # of a step that does not lead down
USUAL = 0.6  # reflectance of chromium where it faces the camera, before it is known
ROUGH_PX, REST = 0.1, 0.1  # a rough fit's step from which on no more is taken; the same in sigmas of each unknown
BLUR_DOUBT = 0.5  # relative, of the blur that edges alone suggest
FARTHEST = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2, 0.1])  # a step's (u, v, radius) px, plane, and blur in blurs
SINGULAR = 1e10
ANEW = 0.2  # relative change of the blur from which on the profiles are sampled anew
OUTLINE, PLANE, HEIGHT, BLUR = slice(0, 3), slice(3, 6), 5, 6
"""Places of the unknowns; the eighth is the reflectance, which is solved for in `explain`."""
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
        if plane is not None:
            # What another ball shows has a texture: that is not explained by chance.
            return located + self.left_px**2 < LOCATES_PX**2
        return self.explained > SURE and located < LOCATES_PX**2


def settle(table: Surroundings, start: Start, known: TablePlane, law: Law, *, rough: bool) -> MirroredTable | None:
    """Move outline, plane (3,) and blur until what the mirror shows is what the picture shows beside it.

    Levenberg-Marquardt under Cauchy's weights and a noise that are read anew in each turn that leads down.
    """
    (sphere, plane, blur_px), found = start, None
    blur, mirror, damping, at = blur_px, USUAL, 0.0, samples(sphere.radius_px, blur_px)
    prior, middle = np.zeros(8), np.zeros(8)
    prior[BLUR], prior[PLANE] = 1 / (BLUR_DOUBT * blur_px) ** 2, 1 / known.sigma**2
    middle[BLUR], middle[PLANE] = blur_px, known.values
    farthest = np.append(FARTHEST * [1, 1, 1, 1, 1, 1, blur_px], np.inf)
    normal, gradient, sigma, least, is_last = np.eye(8), np.zeros(8), np.ones(8), np.inf, False
    told: _Told | None = None
    for turn in range(ROUGH_TURNS if rough else TURNS):
        if abs(np.log(blur / at.blur_px)) > ANEW:
            at = samples(sphere.radius_px, blur)
        profiles, jacobian = table.profiles(sphere, at)
        shown = table.mirrored_by(sphere, plane, at)
        explained = explain(profiles, shown, law(at.middle, mirror), at.offsets, blur)
        beside = np.concatenate([np.zeros(3), plane, [blur, 0.0]]) - middle
        pulled = float(prior @ beside**2)
        if explained and explained.hopeful and (is_last or told is None or told.cost(explained) + pulled < least):
            looked = _Seen(profiles, at, jacobian, shown, table.slopes(sphere, plane, at))
            told = _told(looked, blur, law, explained, is_last=is_last)
            normal = told.information + np.diag(prior)
            size = np.sqrt(np.diag(normal))
            if not (size > 0).all() or np.linalg.cond(normal / np.outer(size, size)) > SINGULAR:
                return None
            inverse = np.linalg.inv(normal)
            covariance = inverse @ (told.scatter + np.diag(prior)) @ inverse
            sigma = np.sqrt(np.diag(covariance))
            seen = TablePlane(plane, sigma[PLANE])
            gradient, damping = told.gradient - prior * beside, damping / 10
            lift = seen.height + _rise(normal, gradient, seen.height, prior[HEIGHT])
            fitted = blur, explained.mirror, explained.share
            found = MirroredTable(sphere, covariance[OUTLINE, OUTLINE], seen, *fitted, lift)
            least = told.cost(explained) + pulled
        elif found is None or is_last:
            break
        else:
            damping = max(10 * damping, FIRST_DAMPING)
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
        step *= min(1.0, float(np.min(farthest / np.maximum(np.abs(step), 1e-12))))
        moves = np.abs(step[OUTLINE]) / ROUGH_PX if rough else np.abs(step[:BLUR]) / (REST * sigma[:BLUR])
        is_at_rest = moves.max() < 1
        if is_at_rest and (rough or is_last):
            break
        if is_last:
            step = LAST_STEP * step
        elif is_at_rest or damping > MOST_DAMPING or turn == TURNS - LAST_TURNS:
            is_last, damping, step = True, 0.0, 0 * step
        sphere, plane = moved(found.sphere, np.asarray(step[OUTLINE], np.float64)), found.plane.values + step[PLANE]
        plane[2] = np.clip(plane[2], NEAREST_PLANE, FARTHEST_PLANE)
        blur = float(max(found.blur_px + step[BLUR], SHARPEST_PX))
        mirror = min(max(found.mirror, REFLECTS[0]), REFLECTS[1])
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


class _Told(NamedTuple):
    """What the profiles say of the unknowns."""

    information: Array  # (8, 8), inverse covariance
    gradient: Array  # (8,)
    scatter: Array  # (8, 8), the gradient's covariance
    samples: float  # that err independently
    noise: Values  # (F, 1, 1)

    def cost(self, explained: ExplainedProfiles) -> float:
        """Return twice the negative log-likelihood of profiles, in this noise and as many samples."""
        return self.samples * explained.cost(self.noise)


def _told(seen: _Seen, blur: float, law: Law, explained: ExplainedProfiles, *, is_last: bool) -> _Told:
    """Return what the profiles say: neighbours err alike, so that many of them say what one does.

    How many is told by the scatter of their scores between sectors. Without that, what is known of the plane beforehand
    would count for nothing beside thousands of samples.
    """
    slopes, steeper = _slopes(seen, blur, law, explained)
    pull = explained.weight * explained.residual
    scores = np.einsum("pfnm,fnm->pn", slopes, pull).astype(np.float64)
    if not is_last:
        # Downhill in what the photographs show. At last by the model's own slopes, which have no noise: the sum
        # is least where interpolation smooths the noise most.
        scores[OUTLINE] -= seen.jacobian.T * np.sum(pull * steeper, (0, 2))
    rows = slopes.reshape(8, -1).astype(np.float64)
    information = (rows * explained.weight.reshape(-1)) @ rows.T
    sums = cluster_sums(scores.T, SECTOR)
    scatter = sums.T @ sums
    alike = max(float(np.trace(np.linalg.pinv(information) @ scatter)) / len(scatter), 1.0)
    count = np.count_nonzero(explained.weight)
    return _Told(information / alike, scores.sum(1) / alike, scatter / alike**2, count / alike, explained.noise)


def _slopes(seen: _Seen, blur: float, law: Law, explained: ExplainedProfiles) -> tuple[Values, Values]:
    """Return (8, F, BINS, M), the model's derivatives, in noises, free of d, e and f; and how much steeper the profiles
    (F, BINS, M) are than the model, by the offset.
    """
    shown, offsets, k = seen.shown, seen.at.offsets, explained.mirror
    grazing = law(seen.at.middle, k)
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
    steeper = np.gradient(seen.profiles, offsets, axis=-1) + by_shift
    slopes = np.nan_to_num(np.stack([*by_outline, *looked_up[3:], by_blur, by_facing, steeper]))
    slopes = without(slopes, basis, explained.weight) / explained.noise
    return slopes[:8], slopes[8]
