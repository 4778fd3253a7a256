"""Which of the listed diameters belongs to which ball: balls on one table have about one scale, mm per pixel.

Every way to give the found balls of each kind different ones of the diameters that are listed for it is a hypothesis;
its likelihood is that of the balls' log scales, normal about their mean. What several leave open is a diameter's doubt.
"""

from collections.abc import Mapping, Sequence
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
SAME_SCALE = 0.06  # standard deviation of log (mm / px) over the balls on one table (0.045 in path-traced scenes)
AS_FAR = 1.8  # ratio of the distances of two balls that nobody puts on one table
SURE = 0.95  # probability from which a diameter is taken as it is listed
MOST_LISTED = 5  # of one kind, up to which every order is tried


class Diameter(NamedTuple):
    """A ball's diameter and its relative sigma: 0 where it is as listed; None where nothing tells it."""

    mm: float | None
    sigma: float


def told_diameters(
    found: Mapping[Kind, list[Sphere]],
    listed: Mapping[Kind, list[float | None]],
    given: Sequence[Sphere],
    warnings: list[str],
) -> dict[Kind, list[Diameter]]:
    """Return each found ball's diameter, those of a kind the largest picture first, as `found` is.

    `given`: balls whose place the user gave; they tell the scale, too.
    """
    kinds = list(found)
    trials = list(product(*(_ways(listed[kind], len(found[kind])) for kind in kinds)))
    radii = np.array([s.radius_px for kind in kinds for s in found[kind]])
    tried = np.array([[d or np.nan for way in trial for d in way] for trial in trials]).reshape(len(trials), -1)
    known = np.array([s.diameter_mm / s.radius_px for s in given if s.diameter_mm])
    scales = np.concatenate([tried / radii, np.tile(known, (len(trials), 1))], 1)
    weight = _probabilities(np.log(scales))
    told = [_told(column, weight) for column in tried.T]
    likeliest = scales[int(np.argmax(weight))]
    agree = np.nanmax(likeliest) < AS_FAR * np.nanmin(likeliest) if np.isfinite(likeliest).any() else True
    out: dict[Kind, list[Diameter]] = {}
    for kind in kinds:
        out[kind], told = told[: len(found[kind])], told[len(found[kind]) :]
        if len({*listed[kind]}) > 1:
            _say(kind, found[kind], out[kind], listed[kind], warnings, bool(agree))
    return out


def doubted_diameters(spheres: Sequence[Sphere]) -> list[str]:
    """Name the ball whose diameter puts it nowhere near the others: in another unit, or the radius."""
    logs = np.log([(s.diameter_mm or np.nan) / s.radius_px for s in spheres])
    if len(logs) < 2 or np.ptp(logs) < np.log(AS_FAR):
        return []
    order = np.argsort(np.abs(logs - np.median(logs)), kind="stable")
    odd, usual = spheres[order[-1]], spheres[order[0]]
    (u, v), farther = odd.center_px, np.exp(logs[order[-1]] - logs[order[0]])
    return [
        f"the {odd.kind} ball at ({u:.0f}, {v:.0f}) px: with a diameter of {odd.diameter_mm:g} mm it would stand "
        f"{farther:.2g} times as far from the camera as the {usual.kind} ball of {usual.diameter_mm:g} mm (they are "
        f"{2 * odd.radius_px:.0f} and {2 * usual.radius_px:.0f} px wide). Check diameter_mm of both: millimetres "
        "(1 cm = 10 mm, 1 inch = 25.4 mm), and not the radius."
    ]


def _ways(listed: list[float | None], count: int) -> list[tuple[float | None, ...]]:
    """Return the ways to give `count` balls, the largest picture first, different ones of the listed diameters."""
    if len(listed) <= MOST_LISTED:
        return sorted(set(permutations(listed, count)), key=str)
    in_order = sorted((d for d in listed if d), reverse=True)
    return [tuple(in_order) if len(in_order) == count else (None,) * count]


def _probabilities(scales: Array) -> Array:
    """Return (T,) of trials with log scales (T, N), NaN where a diameter is not known."""
    known = np.isfinite(scales)
    mean = np.nansum(scales, 1) / np.maximum(known.sum(1), 1)
    chi2 = np.nansum(((scales - mean[:, None]) / SAME_SCALE) ** 2, 1)
    weight = np.exp((chi2.min() - chi2) / 2)
    return np.asarray(weight / weight.sum(), np.float64)


def _told(tried: Array, weight: Array) -> Diameter:
    """Return one ball's diameter by what the trials give it (T,) and their probabilities (T,)."""
    each = {value: float(weight[tried == value].sum()) for value in tried[np.isfinite(tried)].tolist()}
    if sum(each.values()) < SURE:
        return Diameter(None, 0.0)
    likeliest = max(each, key=lambda value: each[value])
    if each[likeliest] >= SURE:
        return Diameter(likeliest, 0.0)
    values, p = np.log(list(each)), np.array(list(each.values()))
    mean = np.average(values, weights=p)
    return Diameter(float(np.exp(mean)), float(np.sqrt(np.average((values - mean) ** 2, weights=p))))


def _say(
    kind: Kind, found: list[Sphere], told: list[Diameter], listed: list[float | None], warnings: list[str], agree: bool
) -> None:
    """Say what the balls' size in the picture decided, if all agree on the scale, and what it left open."""
    sure = [f"{one.mm:g}" for one in told if one.mm and not one.sigma]
    if sure and agree:
        warnings.append(f"{kind} balls of {', '.join(sure)} mm were told apart by their size in the picture.")
    names = ", ".join(f"{d:g}" for d in listed if d)
    vague = [
        "({:.0f}, {:.0f}) px ".format(*sphere.center_px)
        + (f"taken as {one.mm:.1f} mm, to {one.sigma:.0%}" if one.mm else "without one")
        for sphere, one in zip(found, told, strict=True)
        if one.sigma or not one.mm
    ]
    if vague:
        warnings.append(
            f"{kind} balls: which of {names} mm each is cannot be told: {'; '.join(vague)}. Give each its diameter_mm, "
            "and its center_px and radius_px."
        )
