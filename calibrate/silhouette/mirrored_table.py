"""A chrome ball's outline by what it mirrors: the table beside it, which the same photograph shows.

Just inside its outline a mirror shows, squeezed into a few pixels, the table that the picture shows just outside. On a
textured table no smooth profile describes that edge; but the mirror's law does. With a plane for the table, three
unknowns, each pixel inside the outline is some pixel outside of it, dimmed by the reflectance:

    inside   R I(pixel that the mirrored ray meets); f where no pixel shows that,     outside   d + e s

s: distance from the outline; f: what is mirrored beyond the table that is seen, or of a ball that hides it; R: as a
metal's, it rises to 1 at the outline, by the one of two laws that explains more
(`calibrate.silhouette.explained_profiles`). Outline, plane and reflectance are shared by all frames and directions; d,
e and f are each profile's own (variable projection [Golub1973]). Texture, shadows and the shadows' edges all speak for
the outline then, where they would bend a smooth profile's. The mirror's picture is squeezed without bound towards the
outline; so it is looked up at even steps of the ball's normal, and blurred as the camera blurs it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.silhouette.cone_fit import SHARPEST_PX
from calibrate.silhouette.explained_profiles import (
    LAWS,
    REFLECTS,
    ExplainedProfiles,
    Law,
    coefficients,
    combined,
    explain,
    without,
)
from calibrate.silhouette.mirrored_surroundings import (
    ANY_PLANE,
    MirroredSamples,
    MirroredView,
    Surroundings,
    TablePlane,
    samples,
)
from calibrate.silhouette.outline import SECTOR, moved
from scene.camera import Camera
from scene.frames import Frames
from scene.robust import cluster_sums
from scene.spheres import Sphere

Array = NDArray[np.float64]
Values = NDArray[np.floating]
FRAMES = 12  # frames that are looked at: the table is the same in all, only its shadows move
TILTS, AZIMUTHS = np.tan(np.deg2rad([30, 55])), np.deg2rad(np.arange(0, 360, 60))
SURE = 0.985  # share of the profiles' variance that a table explains which is seen: of a plain one chance explains less
LOCATES_PX = 0.15  # doubt of the radius up to which a table locates an outline
UNEXPLAINED_PX = 6.0
"""Doubt of the outline, times the share of the variance that is left: the table is no plane, things stand on it, or a
wall throws light."""
NEAREST_PLANE, FARTHEST_PLANE = 0.85, 2.0
"""Radii from the ball's centre to its table: nearer it would cut the ball (a ring lets it in a little), and no foot on
which a ball stands is higher."""
TURNS, ROUGH_TURNS, LAST_TURNS = 40, 8, 20
LAST_STEP = 0.5  # whole steps would go to and fro: bilinear interpolation has kinks, and weights are read anew
FIRST_DAMPING, MOST_DAMPING = 1e-2, 1e1  # of a step that does not lead down
USUAL = 0.6  # the same of chromium, before it is known
ROUGH_PX, REST = 0.1, 0.1  # a rough fit's step from which on no more is taken; the same in sigmas of each unknown
BLUR_DOUBT = 0.5  # relative, of the blur that edges alone suggest
FARTHEST = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2, 0.1])  # a step's (u, v, radius) px, plane, and blur in blurs
SINGULAR = 1e10
ANEW = 0.2  # relative change of the blur from which on the profiles are sampled anew
OUTLINE, PLANE, BLUR = slice(0, 3), slice(3, 6), 6
"""Places of the unknowns; the eighth is the reflectance, which is solved for in `explain`."""


class Beside(NamedTuple):
    """What is known of what stands beside a chrome ball, before its outline is fitted."""

    plane: TablePlane | None = None  # what other balls show of the table
    laws: Sequence[Law] = LAWS  # those that the ball's metal may have
    others: Sequence[Sphere] = ()  # balls that hide the table


NOTHING_KNOWN = Beside()


class MirroredTable(NamedTuple):
    """An outline and the table that fits it."""

    sphere: Sphere
    covariance: Array  # (3, 3) of (u, v, radius), px^2
    plane: TablePlane
    blur_px: float  # standard deviation of the blur under which the silhouette edge is seen
    mirror: float  # reflectance where it faces the camera
    explained: float  # share of the profiles' variance that the model explains; d, e and f alone explain none of it
    is_fresnels: float = 0.0  # log ratio of what Schlick's law and Fresnel's leave; 0 where only one was tried

    @property
    def left_px(self) -> float:
        """The outline's doubt by what is not explained."""
        return UNEXPLAINED_PX * (1 - self.explained)

    def is_seen(self, plane: TablePlane | None) -> bool:
        """Whether the ball shows the table, and this its outline; `plane`: what other balls show of it."""
        located = float(self.covariance[2, 2])
        if plane is not None:
            # What another ball shows has a texture: that is not explained by chance.
            return located + self.left_px**2 < LOCATES_PX**2
        return self.explained > SURE and located < LOCATES_PX**2


def fit_mirrored_table(
    frames: Frames,
    camera: Camera,
    sphere: Sphere,
    *,
    blur_px: float,
    beside: Beside = NOTHING_KNOWN,
    start: Array | None = None,
    rough: bool = False,
) -> MirroredTable | None:
    """Fit a chrome ball's outline from a start, and a rough blur; None where no table is seen to be mirrored.

    `beside`: what is known already; of two laws the one that explains more is taken. `start` (3,): the plane to begin
    with, where one is known. `rough`: a few turns only, enough to tell a mirror's outline from another circle.
    """
    plane, laws, others = beside
    table, known = Surroundings(frames.some(FRAMES), camera, sphere, others), ANY_PLANE if plane is None else plane
    if start is None:
        start = _rough_plane(table, sphere, blur_px, rough=rough) if plane is None else plane.values
    if start is None:
        return None
    best = _settle(table, (sphere, start, blur_px), known, laws[0], rough=rough)
    if rough or len(laws) < 2:
        return best
    near = (best.sphere, best.plane.values, best.blur_px) if best else (sphere, start, blur_px)
    other = _settle(table, near, known, laws[1], rough=False)
    if best is None or other is None:
        return best or other
    is_fresnels = float(np.log((1 - other.explained) / (1 - best.explained)))
    return max(best, other, key=lambda one: one.explained)._replace(is_fresnels=is_fresnels)


def mirrored_share(frames: Frames, camera: Camera, sphere: Sphere, *, blur_px: float, beside: Beside) -> float:
    """Return the share of the profiles' variance that the table explains beside a circle, as it is; 0: unknown."""
    table, at = Surroundings(frames, camera, sphere, beside.others), samples(sphere.radius_px, blur_px)
    profiles, _ = table.profiles(sphere, at)
    shown = table.mirrored_by(sphere, (beside.plane or ANY_PLANE).values, at)
    explained = explain(profiles, shown, LAWS[0](at.middle, USUAL), at.offsets, blur_px)
    return explained.share if explained else 0.0


def _rough_plane(table: Surroundings, sphere: Sphere, blur_px: float, *, rough: bool) -> Array | None:
    """Return the best of some tilts of a table under the ball, or None where none explains anything."""
    at, best, least = samples(sphere.radius_px, blur_px), None, np.inf
    profiles, _ = table.profiles(sphere, at)
    for x, y in [(0.0, 0.0), *((t * np.cos(a), t * np.sin(a)) for t in TILTS for a in AZIMUTHS)]:
        plane = np.array([x, y, 1.0])
        explained = explain(
            profiles, table.mirrored_by(sphere, plane, at), LAWS[0](at.middle, USUAL), at.offsets, blur_px
        )
        if explained and explained.hopeful:
            # Of an even table any tilt explains much: on an outline a slope must pay for itself.
            left = (1 - explained.share) * (1.0 if rough else 1 + x * x + y * y)
            best, least = (plane, left) if left < least else (best, least)
    return best


def _settle(
    table: Surroundings, start: tuple[Sphere, Array, float], known: TablePlane, law: Law, *, rough: bool
) -> MirroredTable | None:
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
            found = MirroredTable(sphere, covariance[OUTLINE, OUTLINE], seen, blur, explained.mirror, explained.share)
            gradient, damping = told.gradient - prior * beside, damping / 10
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
