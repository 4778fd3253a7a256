"""In which convention lights, normals and photographs agree: axes, how the map lies, which row is whose light."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solve.plausible_axes import AXES, plausible_axes

Array = NDArray[np.float64]
CLIPPED = 0.98
"""Pixel value from which a sample is clipped."""
FLOOR = 0.5
"""Agreement under which the photographs are not explained at all."""
DISAGREES = 0.02
"""Share of the mask that may lack normals, at its border."""
_GOOD = 0.9
_BETTER, _HALF = 0.05, 0.5
"""Another convention is taken when it agrees by so much more, and leaves at most this share of the disagreement."""
_ALIKE = 0.02
_ROW_GAP = 0.2
_FEW = 0.2
_HIGHLIGHT = 3.0
"""Times a pixel's median above which its samples are cut: gloss."""
_LIT = 0.25


@dataclass(frozen=True)
class Claim:
    """What a dataset says of its P samples of N photographs, in whatever convention."""

    mask: NDArray[np.bool_]  # (H, W)
    normals: Array  # (H, W, 3), NaN where there is none
    directions: Array  # (N, 3)
    intensities: Array  # (N, 3)
    places: NDArray[np.intp]  # (P,) the samples' pixels, row by row
    values: NDArray[np.float32]  # (P, N, 3) 0 to 1, as photographed


@dataclass(frozen=True)
class Convention:
    """What the photographs prove of a `Claim`."""

    agreement: float  # median correlation of the photographs with Lambert's law, as claimed
    best: float  # in the best convention
    explained: bool  # False: there is none, or the lights are in another order; then only `rows` says more
    rows: Array  # (N, N) correlation of each photograph with the shading by each row of the lights
    normals: Array  # (H, W, 3) as the photographs lie, in their own axes
    lies: str = ""  # what was done to the map, against the photographs; empty: nothing
    turned: bool = False  # it is the photographs to which it was done
    hollow: bool = False  # the normals point inward at the rim, which is right for a hollow alone
    certain: bool = False  # the normals' own axes are told from all others
    of_lights: Array = field(default_factory=lambda: AXES[0])  # (3, 3) what mends the lights
    of_normals: Array = field(default_factory=lambda: AXES[0])  # (3, 3) what mends the normals
    intensities: Array | None = None  # (N, 3) as seen, up to one factor a channel

    @property
    def gaps(self) -> Array:
        """How much better than its own row the best row explains each photograph (N,)."""
        return self.rows.max(1) - np.diag(self.rows)

    @property
    def misplaced(self) -> NDArray[np.intp]:
        """The photographs that show another light than their row."""
        return np.flatnonzero(self.gaps > _ROW_GAP)

    @property
    def in_other_order(self) -> bool:
        """Whether most photographs are explained by other rows than their own."""
        return bool(np.median(self.rows.max(1)) > FLOOR and np.median(self.gaps) > _ROW_GAP)


def infer_convention(claim: Claim) -> Convention:
    """Return the convention in which a dataset's photographs follow Lambert's law best.

    Parameters
    ----------
    claim : Claim
        Of three lights or more.

    Notes
    -----
    Tried are the 48 ways to swap and flip axes, and the ways to mirror, turn and transpose the map; of those that agree
    alike, the one that changes least. The photographs tell only how lights and normals differ; which of the two is
    wrong, the normals' own slopes tell, and the rim where normals point out of it.
    """
    evidence = ConventionEvidence(claim.values, claim.intensities)
    ways = arrangements(*claim.mask.shape)
    maps = [claim.normals.reshape(-1, 3)[places] for _, places in ways]
    at = [one.reshape(-1, 3)[claim.places] for one in maps]
    scores = np.array([evidence.all_axes(one, claim.directions) for one in at])
    if scores.max() < _GOOD:
        # Wrong intensities hide the axes: without any, they may show.
        plain = ConventionEvidence(claim.values, np.ones_like(claim.intensities))
        others = np.array([plain.all_axes(one, claim.directions) for one in at])
        if others.max() > scores.max() + _BETTER:
            evidence, scores = plain, others
    covers = [float((claim.mask & ~np.isfinite(one[..., 0])).sum() / claim.mask.sum()) <= DISAGREES for one in maps]
    way, axes = _simplest(scores, covers)
    given, best = float(scores[0, 0]), float(scores[way, axes])
    wrong = best - given > _BETTER and 1 - best < _HALF * (1 - given)
    if not wrong:
        way = axes = 0
    rows = evidence.rows_of(at[0], claim.directions)
    if best < FLOOR or (wrong and _is_other_order(rows, best)):
        return Convention(given, best, False, rows, claim.normals)
    found = Convention(
        given, best, True, rows, maps[way], ways[way][0], **_whose_axes(claim, maps[way], way, axes, wrong)
    )
    at_best, directions = at[way] @ found.of_normals.T, claim.directions @ found.of_lights.T
    seen = fitted_intensities(claim.values, claim.intensities, at_best, directions)
    # An intensity that is wrong makes a photograph look like another: rows are at fault only where neither will do.
    by_both = [
        replace(found, intensities=seen, rows=ConventionEvidence(claim.values, each).rows_of(at_best, directions))
        for each in (claim.intensities, seen)
    ]
    return min(by_both, key=lambda one: len(one.misplaced))


def _whose_axes(claim: Claim, normals: Array, way: int, axes: int, wrong: bool) -> dict[str, Any]:
    """Return the fields of a `Convention` that say what mends lights, normals and photographs.

    normals: the map as the photographs lie. way, axes: numbers of the best. wrong: they are not those as given.
    """
    relation = AXES[axes]
    alone = plausible_axes(normals, claim.mask)
    # Of a hollow the rim misleads: it counts only where it leaves nothing for the lights to be wrong in.
    by_rim = wrong and (alone.plain or np.array_equal(AXES[alone.by_rim], relation))
    own = alone.by_rim if by_rim else alone.plain
    hollow = bool(not wrong and not own and alone.by_rim)
    as_it_lies = np.isfinite(claim.normals[..., 0])
    if way and own and not axes and not plausible_axes(claim.normals, as_it_lies).by_rim:
        return {"turned": True, "hollow": hollow}
    mended = AXES[own]
    return {"hollow": hollow, "certain": alone.is_unique, "of_lights": mended @ relation.T, "of_normals": mended}


def _simplest(scores: Array, covers: list[bool]) -> tuple[int, int]:
    """Return the way to lie and the axes, of scores (W, 48), that agree best; of those alike, what changes least.

    covers: lying so, the map has normals all over the mask.
    """
    changed = [int(np.count_nonzero(axes != AXES[0])) for axes in AXES]
    most = float(scores.max())
    alike = np.argwhere(scores >= most - min(_ALIKE, max(0.002, _HALF * (1 - most))))

    def cost(pair):
        return not covers[pair[0]], pair[0] > 0, changed[pair[1]], pair[0], -scores[tuple(pair)]

    way, axes = min(alike, key=cost)
    return int(way), int(axes)


def _is_other_order(rows: Array, best: float) -> bool:
    """Whether the lights' rows in another order, each used about once, explain more than any axes do."""
    used = len(set(rows.argmax(1).tolist()))
    return used >= (1 - _FEW) * len(rows) and float(np.median(rows.max(1))) > best + _BETTER


def arrangements(height: int, width: int) -> list[tuple[str, NDArray[np.intp]]]:
    """Return the ways in which a map may have been stored, in words, with the place (H, W) of each pixel's normal.

    The first changes nothing.
    """
    grid = np.arange(height * width).reshape(height, width)
    found = [
        ("", grid),
        ("mirrored left to right", grid[:, ::-1]),
        ("mirrored top to bottom", grid[::-1]),
        ("turned by 180 degrees", grid[::-1, ::-1]),
        ("stored column by column (transposed)", grid.reshape(width, height).T),
    ]
    if height == width:
        found += [
            ("transposed about the other diagonal", grid[::-1, ::-1].T),
            ("turned by 90 degrees", np.rot90(grid)),
            ("turned by 90 degrees", np.rot90(grid, 3)),
        ]
    return found


class ConventionEvidence:
    """The samples (P, N, 3) of a dataset, divided by the intensities (N, 3), against which conventions are tried."""

    def __init__(self, values: NDArray[np.float32], intensities: Array) -> None:
        gray = np.maximum((values / intensities.astype(np.float32)).mean(-1), 0).astype(np.float64)
        self.known = values.max(-1) < CLIPPED
        self._cut = np.minimum(gray, _HIGHLIGHT * np.maximum(np.median(gray, axis=1, keepdims=True), 1e-9) + 1e-12)
        self._centred = self._centre(self._cut)

    def _centre(self, values: Array) -> Array:
        count = np.maximum(self.known.sum(1, keepdims=True), 1)
        return self.known * (values - (values * self.known).sum(1, keepdims=True) / count)

    def agreement(self, normals: Array, lights: Array) -> float:
        """Return the median over pixels of the correlation, over lights (N, 3), of samples with max(0, l . n).

        Pixels whose normal (P, 3) is NaN do not count.
        """
        known = np.isfinite(normals[:, 0])
        if known.sum() < 0.2 * len(known):
            return 0.0
        shade = self._centre(np.maximum(np.where(known[:, None], normals, 0) @ lights.T, 0))
        power = np.sqrt((shade**2).sum(1) * (self._centred**2).sum(1))
        inner = (shade * self._centred).sum(1)
        correlation = np.divide(inner, power, out=np.zeros_like(inner), where=power > 1e-12)
        return float(np.median(correlation[known]))

    def all_axes(self, normals: Array, lights: Array) -> Array:
        """Return the agreement (48,) in each of `AXES`, applied to the normals."""
        return np.array([self.agreement(normals @ axes.T, lights) for axes in AXES])

    def rows_of(self, normals: Array, lights: Array) -> Array:
        """Return (N, N) correlation, over pixels, of each photograph with the shading by each row of the lights.

        Both less what all lights have in common, and by the pixel's albedo.
        """
        known = np.isfinite(normals[:, 0])
        shade = np.maximum(normals[known] @ lights.T, 0)
        mean = shade.mean(1, keepdims=True)
        seen = self._cut[known]
        albedo = seen.mean(1, keepdims=True) / np.maximum(mean, 1e-3)
        seen, shade = seen / np.maximum(albedo, 1e-9) - mean, shade - mean
        seen, shade = (part - part.mean(0) for part in (seen, shade))
        power = np.sqrt((seen**2).sum(0)[:, None] * (shade**2).sum(0)[None])
        return seen.T @ shade / np.maximum(power, 1e-12)


def fitted_intensities(values: NDArray, intensities: Array, normals: Array, lights: Array) -> Array:
    """Return each light's intensity (N, 3) as samples (P, N, 3) have it, up to one factor a channel.

    value = albedo * intensity * max(0, l . n), normals (P, 3) and lights (N, 3) in one frame: medians over pixels and
    lights in turn, of logarithms, over lit samples, from the intensities given on.
    """
    known = np.isfinite(normals[:, 0])
    shade = (normals[known] @ lights.T)[..., None]
    seen = values[known].astype(np.float64)
    lit = (shade > _LIT) & (seen > 0.002) & (seen < CLIPPED)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(lit, np.log(seen) - np.log(np.where(shade > _LIT, shade, 1)), np.nan)
    found = np.log(intensities) - np.log(intensities).mean(0)
    for _ in range(20):
        albedo = _median(ratio - found, 1)
        found = np.nan_to_num(_median(ratio - albedo[:, None], 0), nan=0.0)
        found -= found.mean(0)
    return np.exp(found)


def _median(values: Array, axis: int) -> Array:
    """Return medians without NaN; NaN where there is nothing."""
    return np.ma.median(np.ma.masked_invalid(values), axis=axis).filled(np.nan)
