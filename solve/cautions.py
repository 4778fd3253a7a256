"""Why a result should not be believed, said before its error is known."""

import numpy as np
from numpy.typing import NDArray

ILL_CONDITIONED = 20.0
"""Condition number of a pixel's light vectors from which noise across their plane comes twentyfold."""


def cautions_of(
    mask: NDArray[np.bool_], normals: NDArray, samples: NDArray, condition: NDArray, dark: int
) -> tuple[str, ...]:
    """Return what is suspicious about the maps (H, W[, 3]) of an estimate.

    Parameters
    ----------
    mask : (H, W) bool
    normals, samples, condition
        See `scene.estimate.Estimate`.
    dark : int
        Pixels that were solved with fewer than three lit samples.
    """
    inside = int(mask.sum())
    unknown = np.count_nonzero(mask & ~np.isfinite(normals[..., 0])) / inside
    few = np.count_nonzero(mask & (samples == 3)) / inside
    away = np.count_nonzero(mask & (normals[..., 2] < 0)) / inside
    flat = np.count_nonzero(mask & (condition > ILL_CONDITIONED)) / inside
    said = []
    if unknown > 0.01:
        said.append(f"{unknown:.0%} of the object's pixels have no normal: their lit lights do not span space.")
    if dark > 0.01 * inside:
        said.append(
            f"{dark / inside:.0%} of the object's pixels have fewer than three lit samples: not to be believed."
        )
    if few > 0.05:
        said.append(f"{few:.0%} of the object's pixels rest on three samples: nothing there checks the fit.")
    if flat > 0.05:
        said.append(
            f"{flat:.0%} of the object's pixels are lit from nearly one plane (condition number above "
            f"{ILL_CONDITIONED:.0f}): noise is amplified there. Lights from more sides would help."
        )
    if away > 0.02:
        said.append(
            f"{away:.0%} of the normals point away from the camera: light directions, mask or linearity are in doubt."
        )
    return tuple(said)
