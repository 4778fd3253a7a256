"""Least squares with a constant shadow threshold: the baseline of photometric stereo."""

from typing import NamedTuple

import numpy as np

from solve.methods import Method
from solve.pixelwise.kernels import least_squares
from solve.samples import Samples


class LsSettings(NamedTuple):
    """Settings of `ls`.

    Parameters
    ----------
    shadow_threshold : float
        Samples under this share of the stack's 99th percentile are taken as shadowed; a constant, as the benchmark's
        text describes it [Berkiten2016].
    keep_clipped : bool
        Clipped samples count like any other.
    ceiling : float
        Gray ends here.
    """

    shadow_threshold: float = 0.02
    keep_clipped: bool = False
    ceiling: float = np.inf


def fit(samples: Samples, scale: float, settings: LsSettings):
    """Fit b = albedo x normal to each pixel by linear least squares; see `solve.methods.Method`.

    Where too few samples are lit, the shadowed ones still bound the normal; the clipped ones do not.

    Notes
    -----
    b = argmin sum_{f in V} (l_f . b - m_f)^2, V = {m_f > threshold, not clipped} [Woodham1980]. Prefer
    `iterative` where there is gloss or cast shadow: least squares has no defence against either
    but the threshold.
    """
    if np.isfinite(settings.ceiling):
        samples = samples._replace(gray=np.minimum(samples.gray, np.float32(settings.ceiling)))
    known = np.ones_like(samples.valid) if settings.keep_clipped else samples.valid
    used = known & (samples.gray > settings.shadow_threshold * scale)
    return least_squares(samples, used, known), used


METHOD = Method(
    "ls",
    {
        "default": LsSettings(),
        # A constant shadow threshold, and not a word of clipped samples.
        "seed": LsSettings(keep_clipped=True),
        # What DiLiGenT's published figures for least squares are [Shi2019]: no threshold, and gray, once divided by the
        # intensities that come with it, ends at 1 (`Lights` with those intensities as they are, not normalised).
        "published": LsSettings(-np.inf, keep_clipped=True, ceiling=1.0),
    },
    fit=fit,
    is_linear=True,
)
