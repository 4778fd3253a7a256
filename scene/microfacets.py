"""How rough facets reflect: the law that a metal's surface, a coat, and whatever fits them share.

Who calls it from a kernel compiles it: `numba.njit(**VECTORS)(facets)`.
"""

from typing import Any

import numpy as np

VECTORS: Any = {
    "nogil": True, "cache": True, "error_model": "numpy", "fastmath": {"reassoc", "contract", "arcp", "nsz"}
}  # fmt: skip
"""For numba: loops become vector instructions, with sums in any order and divisions without exceptions."""


def facets(squared, nl, nh, nv, out):
    """Fill `out` (F,) with D G of GGX's facets [Walter2007], G by Smith, each direction apart.

    squared: alpha squared; alpha is the facets' roughness.
    nl, nh (F,), nv: Cosines between the normal and the lights, the half vectors, the view; nl and nv above 0.
    """
    of_view = 1 + np.sqrt(1 + squared * (1 / (nv * nv) - 1))
    for f in range(len(out)):
        bottom = nh[f] * nh[f] * (squared - 1) + 1
        hidden = (1 + np.sqrt(1 + squared * (1 / (nl[f] * nl[f]) - 1))) * of_view
        out[f] = 4 * squared / (np.pi * bottom * bottom * hidden)
