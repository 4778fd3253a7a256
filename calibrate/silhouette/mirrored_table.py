"""A chrome ball's outline by what it mirrors: the table beside it, which the same photograph shows.

Just inside its outline a mirror shows, squeezed into a few pixels, the table that the picture shows just outside. On a
textured table no smooth profile describes that limb; but the mirror's law does. With a plane for the table, three
unknowns, each pixel inside the outline is some pixel outside of it, dimmed by the reflectance:

    inside   k I(pixel that the mirrored ray meets),     outside   d + e s

s: distance from the outline. Outline, plane and reflectance are shared by all frames and directions; d and e are each
profile's own (variable projection [Golub1973]). Texture, shadows and the shadows' edges all speak for the outline then,
where they would bend a smooth profile's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrate.silhouette.cone_fit import BINS, SECTORS
from calibrate.silhouette.edge_profile import SHARPEST_PX, STEP_PX
from calibrate.silhouette.outline import moved, offset_jacobian, outline_with_normals
from calibrate.silhouette.reflection import SHARE, Shown, Surroundings
from calibrate.silhouette.strips import read_strips
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
Values = NDArray[np.floating]
FRAMES = 12
"""Frames that are looked at: the table is the same in all, only its shadows move."""
DEEP_STEP = 0.015
"""Spacing of the samples where the mirror's picture is no longer squeezed, of the radius."""
TILTS = np.tan(np.deg2rad([30, 55]))
HEIGHTS = 1.0, 1.6
AZIMUTHS = np.deg2rad(np.arange(0, 360, 60))
LEAST_SEEN, LEAST_EXPLAINED = 0.25, 0.2
LOWEST = 0.85
"""A plane nearer to the ball's centre than this, in radii, would cut the ball (a ring lets it in a little)."""
TURNS = 40
CAUCHY = 3.0
"""Noises at which a sample counts half: a highlight or another ball may be mirrored, too."""
BLUR_DOUBT = 0.5
"""Relative, of the blur that edges alone suggest."""
OUTLINE, PLANE, BLUR = slice(0, 3), slice(3, 6), 6


@dataclass(frozen=True)
class MirroredTable:
    """An outline and the table that fits it.

    Parameters
    ----------
    sphere : Sphere
    covariance : (3, 3) float64
        Of (center u, center v, radius), px^2.
    plane : (3,) float64
        Slopes n_x / n_z and n_y / n_z of its normal, and its distance from the ball's centre in radii.
    blur_px : float
        Standard deviation of the blur under which the limb is seen.
    mirror : float
        The ball's reflectance.
    explained : float
        Share of the profiles' variance that the model explains; d and e alone explain none of it.
    """

    sphere: Sphere
    covariance: Array
    plane: Array
    blur_px: float
    mirror: float
    explained: float


def fit_mirrored_table(frames: Frames, camera: Camera, sphere: Sphere, *, blur_px: float) -> MirroredTable | None:
    """Fit the outline of a chrome ball and the table that it mirrors.

    Parameters
    ----------
    frames : Frames
    camera : Camera
    sphere : Sphere
        The start.
    blur_px : float
        Standard deviation of the picture's blur, roughly.

    Returns
    -------
    MirroredTable or None
        None where no table is seen to be mirrored.
    """
    some = frames.some(FRAMES)
    model = _Model(some, Surroundings(some, camera, sphere))
    plane = model.rough_plane(sphere, blur_px)
    if plane is None:
        return None
    return model.settle(sphere, plane, blur_px)


@dataclass(frozen=True)
class _Seen:
    """Profiles (F, BINS, M) about an outline, and what the mirror's law makes of them."""

    profiles: Values
    offsets: Array
    jacobian: Array
    mirrored: Values


@dataclass(frozen=True)
class _Explained:
    """The share of the profiles' variance explained, the reflectance, residuals (F, BINS, M) in noises (F, 1, 1)."""

    share: float
    mirror: float
    residual: Values
    weight: Values
    noise: Values


@dataclass(frozen=True)
class _Model:
    frames: Frames
    table: Surroundings

    def rough_plane(self, sphere: Sphere, blur_px: float) -> Array | None:
        """Return the best of some tilts of a table on which the ball rests, or None where none explains anything."""
        best, out = LEAST_EXPLAINED, None
        slopes = [(0.0, 0.0), *((t * np.cos(a), t * np.sin(a)) for t in TILTS for a in AZIMUTHS)]
        profiles, offsets, jacobian = self._look(sphere, blur_px)
        for x, y, height in ((x, y, height) for x, y in slopes for height in HEIGHTS):
            plane = np.array([x, y, height])
            mirrored = self.table.mirrored_by(sphere, plane, blur_px).blurred(offsets, blur_px, sphere.radius_px)
            explained = _explain(_Seen(profiles, offsets, jacobian, mirrored), blur_px)
            if explained is not None and explained.share > best:
                best, out = explained.share, plane
        return out

    def settle(self, sphere: Sphere, plane: Array, blur_px: float) -> MirroredTable | None:
        """Move outline, plane and blur until what the mirror shows is what the picture shows beside it."""
        blur = blur_px
        prior = np.zeros(8)
        prior[BLUR] = 1 / (BLUR_DOUBT * blur_px) ** 2
        farthest = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2, 0.1 * blur_px, np.inf])
        for turn in range(TURNS):
            profiles, offsets, jacobian = self._look(sphere, blur)
            shown = self.table.mirrored_by(sphere, plane, blur)
            seen = _Seen(profiles, offsets, jacobian, shown.blurred(offsets, blur, sphere.radius_px))
            explained = _explain(seen, blur)
            if explained is None:
                return None
            slopes = self._slopes(seen, explained, shown, sphere, plane, blur)
            scores = np.einsum("pfnm,fnm->pn", slopes, explained.weight * explained.residual).astype(np.float64)
            rows = slopes.reshape(8, -1).astype(np.float64)
            normal = (rows * explained.weight.reshape(-1)) @ rows.T + np.diag(prior)
            if np.linalg.cond(normal / np.sqrt(np.outer(np.diag(normal), np.diag(normal)))) > 1e10:
                return None
            gradient = scores.sum(1) - prior * (np.arange(8) == BLUR) * (blur - blur_px)
            step = np.linalg.solve(normal, gradient)
            step *= min(1.0, float(np.min(farthest / np.maximum(np.abs(step), 1e-12))))
            sphere, plane = moved(sphere, step[OUTLINE]), plane + step[PLANE]
            blur = float(max(blur + step[BLUR], SHARPEST_PX))
            if turn > 2 and np.abs(step[OUTLINE]).max() < 1e-3:
                break
        else:
            return None
        if plane[2] < LOWEST:
            return None
        sector = np.arange(BINS) * SECTORS // BINS
        sums = np.stack([scores[:, sector == s].sum(1) for s in range(SECTORS)])
        inverse = np.linalg.inv(normal)
        covariance = inverse @ (sums.T @ sums + np.diag(prior)) @ inverse
        return MirroredTable(sphere, covariance[OUTLINE, OUTLINE], plane, blur, explained.mirror, explained.share)

    def _look(self, sphere: Sphere, blur_px: float) -> tuple[Values, Array, Array]:
        """Return profiles (F, BINS, M), their offsets and the Jacobian (BINS, 3)."""
        camera, radius = self.table.camera, sphere.radius_px
        count = BINS * int(np.clip(np.ceil(2 * np.pi * radius / BINS), 2, 12))
        points, normals = outline_with_normals(camera, sphere, count)
        near = np.arange(-6 * blur_px, 2.6 * blur_px + 2, STEP_PX)
        deep = np.arange(-max(SHARE * radius - 3 * blur_px, 0), near[0] - 0.01, max(STEP_PX, DEEP_STEP * radius))
        offsets = np.concatenate([deep, near])
        strips = read_strips(self.frames, points, normals, offsets)
        jacobian = offset_jacobian(camera, sphere, points, normals).reshape(BINS, -1, 3).mean(1)
        return strips.reshape(len(strips), BINS, -1, len(offsets)).mean(2), offsets, jacobian

    def _slopes(
        self, seen: _Seen, explained: _Explained, shown: Shown, sphere: Sphere, plane: Array, blur: float
    ) -> Values:
        """Return (8, F, BINS, M), the derivatives of the model in noises, free of what d and e take up."""
        k, radius, offsets = explained.mirror, sphere.radius_px, seen.offsets
        basis = _outside(offsets, blur)
        beyond = _coefficients(np.nan_to_num(seen.profiles - k * seen.mirrored), basis, explained.weight)

        def at(shift: float, blur_px: float) -> Values:
            outside = beyond @ _outside(offsets - shift, blur_px).T.astype(np.float32)
            return k * shown.blurred(offsets - shift, blur_px, radius) + outside

        def looked_up(sphere: Sphere, plane: Array, step: float) -> Values:
            other = self.table.mirrored_by(sphere, plane, blur).blurred(offsets, blur, radius)
            return (other - seen.mirrored) * np.float32(k / step)

        by_shift = (at(0.1, blur) - at(-0.1, blur)) / 0.2
        by_outline = [
            by_shift * seen.jacobian[:, j, None].astype(np.float32) + looked_up(moved(sphere, e), plane, 0.1)
            for j, e in enumerate(0.1 * np.eye(3))
        ]
        by_plane = [looked_up(sphere, plane + e, 0.05) for e in 0.05 * np.eye(3)]
        by_blur = (at(0, blur + 0.05) - at(0, blur - 0.05)) / 0.1
        slopes = np.nan_to_num(np.stack([*by_outline, *by_plane, by_blur, seen.mirrored]))
        return np.stack([_free(one, basis, explained.weight) for one in slopes]) / explained.noise


def _explain(seen: _Seen, blur_px: float) -> _Explained | None:
    """Fit d, e of each profile and the common reflectance, robustly; None where too little is seen."""
    basis = _outside(seen.offsets, blur_px)
    known = (np.isfinite(seen.profiles) & np.isfinite(seen.mirrored)).astype(np.float32)
    if np.mean(known.sum(-1) > 8) < LEAST_SEEN:
        return None
    profiles, mirrored = np.nan_to_num(seen.profiles), np.nan_to_num(seen.mirrored)
    weight, noise, mirror = known, np.ones((len(known), 1, 1), np.float32), 0.0
    for _ in range(3):
        y, x = _free(profiles, basis, weight), _free(mirrored, basis, weight)
        scale = weight / noise**2
        mirror = float((scale * x * y).sum() / max(float((scale * x * x).sum()), 1e-12))
        residual = y - np.float32(mirror) * x
        level = np.abs(np.where(known > 0, residual, np.nan))
        noise = (1.4826 * np.nanmedian(level, axis=(1, 2), keepdims=True) + 1e-5).astype(np.float32)
        residual = residual / noise
        weight = known / (1 + (residual / CAUCHY) ** 2)
    left, total = (weight * residual**2).sum(), (weight * (y / noise) ** 2).sum()
    return _Explained(float(1 - left / max(float(total), 1e-12)), mirror, residual, weight, noise)


def _outside(offsets: Array, blur_px: float) -> Array:
    """Return (M, 2), the blurred profiles of what lies outside: its value at the outline, and its slope."""
    s = offsets / blur_px
    step = ndtr(s)
    return np.stack([step, blur_px * (s * step + np.exp(-0.5 * s**2) / np.sqrt(2 * np.pi))], -1)


def _coefficients(values: Values, basis: Array, weight: Values) -> Values:
    """Return (F, BINS, 2): what of the basis (M, 2) each profile holds, by weighted least squares."""
    b = basis.astype(np.float32)
    normal = np.einsum("fnm,mi,mj->fnij", weight, b, b, optimize=True) + 1e-6 * np.eye(2, dtype=np.float32)
    right = np.einsum("fnm,mi->fni", weight * values, b, optimize=True)
    return np.linalg.solve(normal, right[..., None])[..., 0]


def _free(values: Values, basis: Array, weight: Values) -> Values:
    """Return the profiles without what the basis explains of them."""
    return np.asarray(values - _coefficients(values, basis, weight) @ basis.T.astype(np.float32), np.float32)
