"""How the reflectance of a chrome ball rises from k, where it faces the camera, to 1 at its outline: two laws.

    R = k + (1 - k) g(cos)

cos: of the angle between the normal and the view. With one reflectance for all angles the outlines of metal balls come
out 0.1 to 0.3 px too small.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Law = Callable[[Array, float], Array]
"""Takes cosines and k, returns g."""
REFRACTION = 3.0
"""Real part of chromium's refractive index in visible light, within a tenth or two."""


def fresnel(cosine: Array, facing: float) -> Array:
    """Return g of a metal of reflectance k = `facing` under unpolarised light [Born1999].

    The more it reflects, the more it absorbs, and the deeper g dips before the last ten degrees, where it rises.
    """
    index = index_of(facing)
    start = _unpolarised(np.ones(1), index)
    return (_unpolarised(cosine, index) - start) / (1 - start)


def schlick(cosine: Array, facing: float) -> Array:
    """Return g as most programs that render have it: (1 - cos)^5, whatever k is [Schlick1994]."""
    return (1 - cosine) ** 5


def law_of(balls: Sequence[float]) -> Law:
    """Return the law that balls of one session have, by what each says for Fresnel's, a log ratio of misfits.

    Fresnel's is that of metals: the other must explain more beyond doubt.
    """
    return fresnel if sum(balls) > -1 else schlick


def index_of(facing: float) -> complex:
    """Return the refractive index n + i kappa of a metal that reflects so much of what meets it head on.

    k = ((n - 1)^2 + kappa^2) / ((n + 1)^2 + kappa^2), with n of chromium.
    """
    square = (facing * (REFRACTION + 1) ** 2 - (REFRACTION - 1) ** 2) / (1 - facing)
    return complex(REFRACTION, np.sqrt(max(square, 0.0)))


LAWS: tuple[Law, ...] = (fresnel, schlick)


def _unpolarised(cosine: Array, index: complex) -> Array:
    """Return the reflectance of a metal: the mean of both polarisations."""
    inside = np.sqrt(index**2 - 1 + cosine**2)
    across = (cosine - inside) / (cosine + inside)
    along = (index**2 * cosine - inside) / (index**2 * cosine + inside)
    return 0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2)
