"""The flashes: which did not fire, and which fired twice from the same place."""

import numpy as np
from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts

MISFIRE = 0.04
"""Share of the other frames' light below which the flash did not fire."""
OUTSHINES, LARGE = 0.25, 0.01
"""By how much, relative, and in which share of the picture the frame without flash may be brighter than one with."""
SAME_LIGHT = 0.003
"""Relative difference of two pictures, after scaling, below which their lights cannot be told apart: about a degree."""


def misfires(names: tuple[str, ...], light: NDArray, ambient: NDArray | None) -> tuple[list[str], list[str]]:
    """Return lines that name frames without light of their own, and warnings that name those that are dark everywhere.

    `light` (F, h, w): reduced pictures at the reference exposure, `ambient` (h, w) taken off.
    """
    brightest = light.max(axis=0)
    lit = brightest > 0.1 * np.quantile(brightest, 0.99)
    level = light[:, lit].mean(axis=1)
    usual = float(np.median(level))
    if ambient is not None and (lines := _ambient_faults(light, ambient, usual, lit)):
        return lines, []
    share = level / max(usual, 1e-9)
    dead = np.flatnonzero(share < MISFIRE)
    if len(dead):
        lines = [
            f"{names[i]}: the flash did not fire (its light is {max(share[i], 0):.1%} of the other frames')."
            for i in dead
        ]
        do = "Reshoot, or list it under frames.skip; one that was shot without flash belongs under frames.ambient."
        return ([f"{lines[0]} {do}"] if len(lines) == 1 else [*lines, do]), []
    warnings = []
    least = light.min(axis=0)
    for i in np.flatnonzero(share < 0.5):
        # A misfire in a bright room has the room's light, and no more: darker than all others, everywhere.
        darker = np.mean(light[i][lit] <= least[lit] + 0.02 * usual)
        if len(names) >= 4 and darker > 0.98 and share[i] < 0.6 * np.partition(share, 1)[1]:
            warnings.append(
                f"{names[i]}: darker than every other frame all over the picture ({share[i]:.0%} of their light). "
                "If the flash did not fire, list it under frames.skip."
            )
    if np.quantile(brightest, 0.995) < 0.02:
        warnings.append(
            f"frames: underexposed, the brightest parts reach {np.quantile(brightest, 0.995):.2%} of white. Noise will "
            "rule: open the aperture or move the flash closer."
        )
    return [], warnings


def _ambient_faults(light: NDArray, ambient: NDArray, usual: float, lit: NDArray[np.bool_]) -> list[str]:
    if usual <= 0.02 * float(ambient[lit].mean()):
        return [
            f"frames.ambient: is as bright as the flash frames (mean {ambient.mean():.4f} of white, flash adds "
            f"{usual:.4f}). The flash fired there, or nowhere: shoot the ambient frame again without flash."
        ]
    # Light only adds: where the frame without flash is brighter, it had a light that the others had not.
    over = np.median([np.mean(one < -OUTSHINES * ambient - 0.02 * usual) for one in light])
    if over <= LARGE:
        return []
    return [
        f"frames.ambient: is brighter than the frames with flash in {over:.1%} of the picture (median frame; "
        "expected 0 %): the flash fired there, or the room was lit otherwise. Shoot the ambient frame again "
        "without flash, or leave it out."
    ]


def doubles(names: tuple[str, ...], facts: list[FrameFacts], light: NDArray) -> list[str]:
    """Name frames that are one picture, and frames whose lights are the same; `light` as in `misfires`."""
    import cv2

    # Further reduced: what is left of the noise must lie far below the threshold.
    scale = min(1.0, 64 / max(light.shape[1:]))
    tiny = [cv2.resize(one, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA).ravel() for one in light]
    rows = np.array([row / max(float(np.linalg.norm(row)), 1e-12) for row in tiny], np.float64)
    difference = np.sqrt(np.maximum(2 - 2 * rows @ rows.T, 0))
    left, warnings = list(range(len(names))), []
    while left:
        first = left.pop(0)
        same = [i for i in left if difference[first, i] < SAME_LIGHT]
        left = [i for i in left if i not in same]
        # Two exposures never agree in the noise of every box.
        twins = [i for i in same if np.array_equal(facts[first].small, facts[i].small)]
        warnings += [
            f"{names[first]} and {names[i]} are the same photograph. List one of them under frames.skip." for i in twins
        ]
        if others := [i for i in same if i not in twins]:
            warnings.append(
                f"{', '.join(names[i] for i in (first, *others))}: lit from the same place (the pictures differ by "
                f"{difference[first, others].max():.2%} after scaling). They count as one light."
            )
    return warnings
