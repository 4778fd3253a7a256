"""Where an object's normals changed between two sessions, by more than both sessions' errors explain."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.robust import TUKEY, tukey

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STATED = 0.01
"""Share of an unchanged object's pixels that is flagged; and the chance that a place is told of an unchanged object."""
MEDIAN = 2 * np.log(2)
"""Of chi-square with two degrees of freedom: of a normal's squared change over its variance along one tangent axis."""
LOCAL = 16
"""Windows across the object, in each of which errors are measured."""
CLIPPED = 24.0
"""Medians at which a squared change is cut for the window's mean: a real change shall not pass for an error."""
MEAN_PX = 5
"""Side of the window over which a stated variance is averaged: a few samples tell a pixel's badly."""
BORDER_PX = 3
"""What lies nearer to an edge of what is known tells nothing: lens and demosaicing mix the two sides."""
FINEST_PX, COARSER = 1.4, 1.6
"""Standard deviation of the narrowest bump that is looked for; how much wider the next one is, up to the window's."""
ACROSS = 4.7
"""Standard deviations of a bump that a round dent of its width at half height is across, with a cosine's profile."""
COVERED = 0.6
"""Share of a bump's weight that must lie on what is known."""
WINDOW = 12.0
"""Standard deviations of a bump across the window that tells its errors, at least: most of it shows none."""
RING, LOBES = 3.0, 0.2
"""Standard deviations about a bump in which others are its ring; share of its z up to which those as far again are its
side lobes."""
SURELY = 3.0
"""Standard deviations above what is told at which nearly all dents are: no Gaussians, their middles between pixels."""
FINE_PX = 4.0
"""Standard deviation of a bump from which on it is looked for in a picture of half the size."""


class ChangedPlace(NamedTuple):
    """A part of the object that sank or rose; its middle is (u, v)."""

    u: float
    v: float
    height_mm: float
    """Along the normal, of its middle; negative: it sank. The lens's blur makes a narrow one look half as high."""
    across_mm: float
    across_px: float
    change_deg: float
    """The largest of its normals."""
    chance: float
    """Of one that is as clear on an unchanged object."""
    lit_share: float
    """Of its pixels: what every flash lights in both sessions. Elsewhere a shadow's error may pass for a change."""


class Bumps(NamedTuple):
    """(H, W): of the bump about each pixel that is the clearest; NaN where too little is known."""

    z: Array
    """Its height in the scatter of heights about the pixel."""
    height_mm: Array
    sigma_px: Array
    """It is a Gaussian."""


class Tested(NamedTuple):
    """Which pixels changed, and how clearly."""

    square: Array
    """(H, W): squared change over its variance along one tangent axis; NaN where unknown. Its root is z."""
    bumps: Bumps
    tried: int
    """Bumps that were tried, of all widths and about all pixels."""
    least_z: float
    """From which on a bump is told."""
    least_mm: float
    """Height of one of the narrowest that is surely told about the median pixel; NaN where too little is known."""
    over_stated: float
    """How many times the stated sigmas the changes scatter by."""


def common_turn(normals: Array, place: Array) -> Array:
    """Return (P, 3, 27): how normals (P, 3) at places (P, 2) in the picture, -1 to 1, turn with the lights' errors.

    Least-squares normals under wrong directions or intensities are (1 + E) n; E changes over the object as near lights'
    vectors do, to first order.
    """
    tangent = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    near = np.concatenate([np.ones((len(place), 1)), place], 1)
    return np.einsum("pci,pj,pk->pcijk", tangent, normals, near).reshape(len(normals), 3, -1)


def fit_common(turned: Array, variance: Array, columns: Array, prior: Array) -> Array:
    """Return the unknowns (K,) of columns (P, 3, K) that explain most normals' turns (P, 3), radians.

    variance (P,): of a turn along one tangent axis. prior (k,): standard deviations of the first k unknowns.
    """
    sigma = np.sqrt(variance)[:, None]
    columns, target = columns / sigma[..., None], turned / sigma
    held, found = np.zeros((columns.shape[-1],) * 2), np.zeros(columns.shape[-1])
    # Beyond noise, pixels of one window err alike.
    held[range(len(prior)), range(len(prior))] = max(1.0, len(turned) / LOCAL**2) / prior**2
    for _ in range(8):
        size = np.linalg.norm(target - columns @ found, axis=1)
        scale = np.sqrt(np.median(size**2) / MEDIAN)
        weighted = columns * (tukey(size, TUKEY * scale) / scale**2)[:, None, None]
        information = np.einsum("pck,pcl->kl", weighted, columns) + held
        found = np.linalg.pinv(information, rcond=1e-10, hermitian=True) @ np.einsum("pck,pc->k", weighted, target)
    return found


def tested(turned: Array, variance: Array, steps_mm: NDArray) -> Tested:
    """Test the turns (H, W, 3) of normals, radians, NaN where unknown; variance (H, W) is what is stated of them.

    steps_mm (H, W, 2, 3): along the surface, to what the next pixel to the right, and the next below, see.

    Notes
    -----
    Stated is what noise does. Gloss, shadows and bounced light do more where they fall otherwise in one of the two
    sessions. So the variance of a pixel is the stated one times what the changes about it exceed theirs by, on the mean
    over a window of the object's size over `LOCAL`.

    A surface that sinks or rises turns its normals by its height's slopes, all about one place; errors do not. Bumps of
    each width are fitted about each pixel by weighted least squares (a matched filter [Turin1960]). Neighbours err
    together: z is in the heights' own scatter.
    """
    import cv2
    from scipy.special import ndtri

    known = np.asarray(np.isfinite(turned).all(-1))
    inner = cv2.erode(known.astype(np.uint8), np.ones((2 * BORDER_PX + 1,) * 2)) > 0
    # Of an object of few pixels all is border. A pixel without a sigma has its neighbours'.
    variance = _mean(variance, np.isfinite(variance), MEAN_PX, filled=True)
    known = (inner if inner.any() else known) & np.isfinite(variance)
    rows, columns = (np.flatnonzero(known.any(axis)) for axis in (1, 0))
    side = max(MEAN_PX, int(max(np.ptp(rows), np.ptp(columns)) / LOCAL) | 1)
    square = np.where(known, np.sum(turned**2, -1) / variance, np.nan)
    usual = float(np.nanmedian(square))
    local = _mean(np.minimum(square, CLIPPED * usual), known, side) / 2
    # Where it rises, the normal turns back.
    slopes = [np.where(known, -np.sum(turned * steps_mm[:, :, k], -1), 0) for k in (0, 1)]
    weights = [np.where(known, 1 / (variance * np.sum(steps_mm[:, :, k] ** 2, -1)), 0) for k in (0, 1)]
    widths, finer = [FINEST_PX], 1
    while COARSER * widths[-1] < side:
        widths.append(COARSER * widths[-1])
    z, height_mm = _bumps(slopes, weights, FINEST_PX, side)
    size = np.abs(height_mm / z)[np.isfinite(z)]
    best = Bumps(z, height_mm, np.full(z.shape, FINEST_PX))
    for width in widths[1:]:
        while width > FINE_PX * finer:
            slopes, weights, finer = *_halved(slopes, weights), 2 * finer
        small = _bumps(slopes, weights, width / finer, side // finer)
        z, height_mm = (one.repeat(finer, 0).repeat(finer, 1)[: known.shape[0], : known.shape[1]] for one in small)
        clearer = np.nan_to_num(np.abs(z)) > np.nan_to_num(np.abs(best.z))
        for kept, new in zip(best, (z, height_mm, np.full(z.shape, width)), strict=True):
            kept[clearer] = new[clearer]
    tried = max(int(np.count_nonzero(known)) * len(widths), 1)
    # One of all that are tried (Bonferroni).
    least_z = float(-ndtri(STATED / 2 / tried))
    least_mm = (least_z + SURELY) * float(np.median(size)) if size.size else np.nan
    return Tested(square / local, best, tried, least_z, least_mm, float(np.sqrt(usual / MEDIAN)))


def _halved(slopes: list[Array], weights: list[Array]) -> tuple[list[Array], list[Array]]:
    """Return slopes and weights (H, W) of a picture of half the size: means, twice as much a pixel and as unsure."""
    from skimage.measure import block_reduce

    # An odd row or column more is filled with zeros.
    total = [block_reduce(w, 2, np.sum) for w in weights]
    moment = [block_reduce(w * s, 2, np.sum) for w, s in zip(weights, slopes, strict=True)]
    means = [m / np.where(t > 0, t, 1) for m, t in zip(moment, total, strict=True)]
    return [2 * mean for mean in means], [t / 4 for t in total]


def _bumps(slopes: list[Array], weights: list[Array], sigma_px: float, side: int) -> tuple[Array, Array]:
    """Return z and heights (H, W), see `Bumps`, of bumps of one width, fitted about each pixel.

    slopes (H, W): To the right and down, mm a pixel. weights (H, W): Inverse variances of them, 0 where unknown.
    """
    import cv2

    reach = int(np.ceil(3.5 * sigma_px))
    away = np.arange(-reach, reach + 1) / sigma_px
    bump = np.exp(-0.5 * away**2)
    slope = -away * bump / sigma_px

    def fit(values: Array, first: Array, second: Array) -> Array:
        return np.asarray(cv2.sepFilter2D(values, -1, first, second, borderType=cv2.BORDER_CONSTANT), np.float64)

    kernels = [(slope, bump), (bump, slope)]
    pull = sum(fit(w * s, *kernel) for w, s, kernel in zip(weights, slopes, kernels, strict=True))
    information = sum(fit(w, first**2, second**2) for w, (first, second) in zip(weights, kernels, strict=True))
    known = weights[0] > 0
    cover = sum(fit(known.astype(np.float64), first**2, second**2) for first, second in kernels)
    seen = known & (cover > COVERED * 2 * np.sum(slope**2) * np.sum(bump**2))
    information = np.where(seen, information, np.nan)
    z = pull / np.sqrt(information)
    usual = float(np.nanmedian(z**2)) if seen.any() else 1.0
    scatter = _mean(np.minimum(z**2, CLIPPED * usual), seen, max(side, int(WINDOW * sigma_px)) | 1)
    return z / np.sqrt(scatter), pull / information


def places(found: Tested, change_deg: NDArray, steps_mm: NDArray, lit: Mask) -> list[ChangedPlace]:
    """Return where the object changed, the highest first.

    (H, W): the changes, and whether every flash lights a pixel in both sessions; steps_mm: see `tested`.
    """
    from scipy.special import ndtr

    bumps, left, known = found.bumps, np.abs(np.nan_to_num(found.bumps.z)), np.isfinite(found.square)
    rows, columns = np.indices(left.shape, np.float32)
    out = []
    while left.max(initial=0) > found.least_z:
        at = np.unravel_index(np.argmax(left), left.shape)
        (v, u), sigma_px, height = map(float, at), bumps.sigma_px[at], float(bumps.height_mm[at])
        away, across = np.hypot(columns - u, rows - v), ACROSS * float(sigma_px)
        inside, chance = known & (away < across / 2), 2 * float(ndtr(-left[at])) * found.tried
        most, share = np.nanmax(change_deg[inside]), lit[inside].mean()
        wide = across * np.sqrt(np.linalg.norm(np.cross(*steps_mm[at])))
        out.append(ChangedPlace(u, v, height, float(wide), across, float(most), chance, float(share)))
        ring = RING * np.hypot(sigma_px, bumps.sigma_px)
        left[(away < ring) | ((away < 2 * ring) & (left < LOBES * left[at]))] = 0
    return sorted(out, key=lambda place: -abs(place.height_mm))


def _mean(values: NDArray, known: Mask, side: int, *, filled: bool = False) -> Array:
    """Return the mean of the known values (H, W) in the square window of `side` pixels about each known one, else NaN.

    filled: About the others, too.
    """
    import cv2

    both = np.stack([np.where(known, values, 0), known], -1).astype(np.float64)
    total, count = np.moveaxis(cv2.blur(both, (side, side), borderType=cv2.BORDER_CONSTANT), -1, 0)
    return np.divide(total, count, out=np.full(known.shape, np.nan), where=(count > 0) & (known | filled))
