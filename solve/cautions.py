"""Why a result should not be believed, said before its error is known."""

import numpy as np
from numpy.typing import NDArray

ILL_CONDITIONED = 20.0
"""Condition number of a pixel's light vectors from which noise across their plane comes twentyfold."""


def cautions_of(
    mask: NDArray[np.bool_], normals: NDArray, samples: NDArray, condition: NDArray, dark: int
) -> tuple[str, ...]:
    """Return what is suspicious about the maps (H, W[, 3]) of an estimate.

    `dark` is how many pixels were solved with fewer than three lit samples; for the maps see `scene.estimate.Estimate`.
    """
    inside = int(mask.sum())
    unknown = np.count_nonzero(mask & ~np.isfinite(normals[..., 0])) / inside
    few = np.count_nonzero(mask & (samples == 3)) / inside
    away = np.count_nonzero(mask & (normals[..., 2] < 0)) / inside
    flat = np.count_nonzero(mask & (condition > ILL_CONDITIONED)) / inside
    shares = (
        (unknown, 0.01, "pixels have no normal: their lit lights do not span space."),
        (dark / inside, 0.01, "pixels have fewer than three lit samples: not to be believed."),
        (few, 0.05, "pixels rest on three samples: nothing there checks the fit."),
        (
            flat,
            0.05,
            f"pixels are lit from nearly one plane (condition number above {ILL_CONDITIONED:.0f}): noise is amplified "
            "there. Lights from more sides would help.",
        ),
    )
    said = [f"{share:.0%} of the object's {text}" for share, bar, text in shares if share > bar]
    if away > 0.02:
        said.append(
            f"{away:.0%} of the normals point away from the camera: light directions, mask or linearity are in doubt."
        )
    return tuple(said)
