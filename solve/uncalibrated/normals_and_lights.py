"""From a member of the bas-relief family to normals and lights: convex or concave, and the scale."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from solve.methods import Whole
from solve.uncalibrated.front_end import Family, FrontEnd

Array = NDArray[np.float64]
RIM_PX = (1.5, 6.5)
"""Distance from the outline of the pixels that vote: the outermost are mixed with the background."""
CLEAR_VOTE = 0.75
STEEP = 0.4


def finish(
    found: Family, relief: tuple[float, float, float], mask: NDArray[np.bool_], settings: FrontEnd, *cautions: str
) -> Whole:
    """Return normals and lights for mu, nu and depth > 0 of the bas-relief transform; see `Family.relief`.

    Lights are relative to their mean length, which b takes. The cautions are added to the family's.
    """
    b, lights = found.relief(*relief)
    said = [*found.cautions, *cautions]
    if settings.sign == "outline":
        vote, steepness = outward_vote(b, mask)
        if np.isnan(vote):
            said.append("convex or concave is not known: the object's outline is not in the picture.")
        else:
            if vote < 0.5:
                b, lights = b * [-1, -1, 1], lights * [-1, -1, 1]
            if max(vote, 1 - vote) < CLEAR_VOTE:
                said.append(
                    f"convex or concave is uncertain: {max(vote, 1 - vote):.0%} of the outline votes for it, expected "
                    f"{CLEAR_VOTE:.0%} or more."
                )
            elif steepness < STEEP:
                said.append(
                    f"convex or concave is uncertain: normals at the outline face the camera (sine {steepness:.2f}, "
                    f"expected {STEEP} or more), so that it is no limb of the object."
                )
    behind = float(np.mean(lights[:, 2] <= 0))
    if behind > 0.1:
        said.append(f"{behind:.0%} of the lights would stand behind the object.")
    size = float(np.mean(np.linalg.norm(lights, axis=1)))
    return Whole(b * size, found.used, tuple(said), lights / size)


def outward_vote(b: Array, mask: NDArray[np.bool_]) -> tuple[float, float]:
    """Return which share of the outline says that b (P, 3) points out of the mask (H, W), and how steep it is.

    NaN without an outline: where the mask runs into the picture's edge the object goes on. Steepness: the median
    of the sine between the normals there and the line of sight.
    """
    padded = np.pad(mask, 1, mode="edge")
    inside = np.asarray(ndimage.distance_transform_edt(padded))[1:-1, 1:-1]
    smooth = ndimage.gaussian_filter(np.pad(mask, 8, mode="edge").astype(np.float32), 3.0)
    down, right = np.gradient(smooth)
    outward = np.stack([-right, down], -1)[8:-8, 8:-8][mask]
    rim = ((inside > RIM_PX[0]) & (inside < RIM_PX[1]))[mask]
    rim &= np.linalg.norm(outward, axis=1) > 1e-3
    if np.count_nonzero(rim) < 20:
        return np.nan, 0.0
    # Steep pixels say more than those that face the camera.
    pull = np.sum(b[rim, :2] * outward[rim], 1) / np.maximum(
        np.linalg.norm(b[rim], axis=1) * np.linalg.norm(outward[rim], axis=1), 1e-300
    )
    share = float(np.sum(np.maximum(pull, 0)) / max(float(np.sum(np.abs(pull))), 1e-300))
    sine = np.linalg.norm(b[rim, :2], axis=1) / np.maximum(np.linalg.norm(b[rim], axis=1), 1e-300)
    return share, float(np.median(sine))
