"""What the mirrored table explains of the profiles across a chrome ball's outline, and how its metal reflects.

The reflectance rises from k, where the ball faces the camera, to 1 at its outline, by one of two laws:

    R = k + (1 - k) g(cos)

cos: of the angle between the normal and the view. With one reflectance for all angles the outlines of metal balls come
out 0.1 to 0.3 px too small.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.silhouette.mirrored_surroundings import MirroredView
from scene.robust import MAD

Array = NDArray[np.float64]
Values = NDArray[np.floating]
LEAST_SEEN, KNOWN_BLURS = 0.25, 2.5
"""Share of the profiles to go on with a plane, in which the table is known down to so many blurs inside the outline."""
HOPELESS = 0.8  # share explained under which a start leads nowhere
REFLECTS = 0.2, 0.93  # reflectance of a mirror: what shows the table as bright as it is may be the table itself
CAUCHY = 3.0  # noises at which a sample counts half: a highlight or another ball may be mirrored, too
Law = Callable[[Array, float, float], Array]
"""Takes cosines, k, and the real part n of the refractive index, returns g."""
REFRACTION, REFRACTIONS = 3.0, (0.1, 8.0)
"""Real part n of chromium's refractive index in visible light, and between which metals' lie."""
CHROMIUM_SIGMA, METALS_SIGMA = 1e-3, 1.0  # of log n: where the metal is taken for chromium, and where it may be any


class ExplainedProfiles(NamedTuple):
    """What the mirrored table explains of profiles (F, BINS, M)."""

    share: float  # of the variance
    mirror: float  # the reflectance where it faces the camera
    residual: Values  # (F, BINS, M) in noises
    weight: Values  # (F, BINS, M) 0 where nothing is known
    noise: Values  # (F, 1, 1)

    @property
    def hopeful(self) -> bool:
        return self.share > HOPELESS and REFLECTS[0] < self.mirror < REFLECTS[1]


def explain(
    profiles: Values, shown: MirroredView, grazing: Array, offsets: Array, blur_px: float
) -> ExplainedProfiles | None:
    """Fit d, e, f of each profile and the common reflectance, robustly; None where too little is seen.

    grazing: g of the law at the cosines where the mirror is looked at.
    """
    basis = shown.basis(offsets, blur_px)
    mirrored, given = (shown.blurred(offsets, blur_px, part) for part in (1 - grazing, grazing))
    known = (np.isfinite(profiles) & np.isfinite(mirrored)).astype(np.float32)
    if np.mean((known.sum(-1) > 8) & (shown.until > KNOWN_BLURS * blur_px)) < LEAST_SEEN:
        return None
    profiles, mirrored, given = map(np.nan_to_num, (profiles, mirrored, given))
    weight, noise = known, np.ones((len(known), 1, 1), np.float32)
    together = np.stack([profiles, profiles - given, mirrored])
    for _ in range(3):
        whole, y, x = without(together, basis, weight)
        scale = weight / noise**2
        mirror = float((scale * x * y).sum() / max(float((scale * x * x).sum()), 1e-12))
        residual = y - np.float32(mirror) * x
        level = [np.median(np.abs(r[k])) if k.any() else 0.0 for r, k in zip(residual, known > 0, strict=True)]
        noise = (MAD * np.array(level) + 1e-5).astype(np.float32)[:, None, None]
        residual = residual / noise
        weight = known / (1 + (residual / CAUCHY) ** 2)
    left, total = (weight * residual**2).sum(), (weight * (whole / noise) ** 2).sum()
    return ExplainedProfiles(float(1 - left / max(float(total), 1e-12)), mirror, residual, weight, noise)


def coefficients(values: Values, basis: Values, weight: Values) -> Values:
    """Return (..., F, BINS, 3): what of the basis (BINS, M, 3) each profile holds, by weighted least squares."""
    products = (basis[..., :, None] * basis[..., None, :]).reshape(*basis.shape[:2], -1)
    # In 64 bits: where a profile shows little, the products are almost the same number.
    sums = (weight.swapaxes(0, 1) @ products).astype(np.float64)
    inverse = np.linalg.inv(sums.reshape(*sums.shape[:2], 3, 3) + 1e-6 * np.eye(3))
    held = (weight * values).swapaxes(-3, -2) @ basis
    return (inverse @ held[..., None])[..., 0].astype(np.float32).swapaxes(-3, -2)


def combined(held: Values, basis: Values) -> Values:
    """Return the profiles (..., F, BINS, M) that hold so much (..., F, BINS, 3) of the basis (BINS, M, 3)."""
    return (held.swapaxes(-3, -2) @ basis.swapaxes(-2, -1)).swapaxes(-3, -2)


def without(values: Values, basis: Values, weight: Values) -> Values:
    """Return the profiles without what the basis explains of them."""
    return np.asarray(values - combined(coefficients(values, basis, weight), basis), np.float32)


def fresnel(cosine: Array, facing: float, refraction: float) -> Array:
    """Return g of a metal of reflectance k = `facing` under unpolarised light [Born1999].

    The more it reflects, the more it absorbs, and the deeper g dips before the last ten degrees, where it rises.
    """
    index = index_of(facing, refraction)
    start = _unpolarised(np.ones(1), index)
    return (_unpolarised(cosine, index) - start) / (1 - start)


def schlick(cosine: Array, facing: float, refraction: float) -> Array:
    """Return g as most programs that render have it: (1 - cos)^5, whatever the metal is [Schlick1994]."""
    return (1 - cosine) ** 5


def laws_of(balls: Sequence[float]) -> Sequence[Law]:
    """Return the laws that balls of one session may have, by what each says for Fresnel's, a log ratio of misfits.

    Fresnel's is that of metals: the other must explain more beyond doubt. Both where that is open, or nothing is said.
    """
    total = sum(balls)
    if total > 0:
        return [fresnel]
    return [schlick] if total < -1 else LAWS


def index_of(facing: float, refraction: float) -> complex:
    """Return the refractive index n + i kappa of a metal that reflects so much of what meets it head on.

    k = ((n - 1)^2 + kappa^2) / ((n + 1)^2 + kappa^2).
    """
    square = (facing * (refraction + 1) ** 2 - (refraction - 1) ** 2) / (1 - facing)
    return complex(refraction, np.sqrt(max(square, 0.0)))


LAWS: tuple[Law, ...] = (fresnel, schlick)


def _unpolarised(cosine: Array, index: complex) -> Array:
    """Return the reflectance of a metal: the mean of both polarisations."""
    inside = np.sqrt(index**2 - 1 + cosine**2)
    across = (cosine - inside) / (cosine + inside)
    along = (index**2 * cosine - inside) / (index**2 * cosine + inside)
    return 0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2)
