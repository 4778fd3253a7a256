"""How bright each flash was, by the object alone: directions are known, strengths are not, nothing white stands by.

Every matte pixel says I_f = e_f b.l_f with a vector b of its own: three unknowns a pixel, F - 1 in common.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.directions import two_across
from calibrate.without_balls.probe import FEWEST_PIXELS, Probe, by_channel, sectors
from scene.intensities import Eliminated
from scene.normals import unit
from scene.robust import spread

Array = NDArray[np.float64]
FEWEST_FRAMES = 5
"""Three frames fix a pixel's b, and the fourth says nothing of itself until there is a fifth to doubt it."""
LIT = 0.15
"""Share of a pixel's own brightness under which it is taken to stand in shadow."""
ROUNDS = 30


@dataclass(frozen=True)
class ObjectPhotometry:
    """What the object's own shading says of the flashes.

    Parameters
    ----------
    intensities : (F, 3) float64
        Relative, each channel's mean 1.
    sigma : (F,) float64
        Relative standard deviation, one frame.
    residual : float
        Relative misfit of the pixels that were believed, robust standard deviation.
    pixels : int
        How many pixels spoke.
    """

    intensities: Array
    sigma: Array
    residual: float
    pixels: int


def intensities_from_object(probe: Probe, toward: Array, sigma_deg: Array) -> ObjectPhotometry | None:
    """Read the flashes' intensities from matte pixels of unknown normal and albedo.

    Parameters
    ----------
    probe : Probe
        Pixels (P) of the object.
    toward : (F, P, 3) float
        Light vectors of intensity 1 at each pixel: unit, or with the fall-off of near lights.
    sigma_deg : (F,) float
        Standard deviation of the directions, degrees; NaN where unknown.

    Returns
    -------
    ObjectPhotometry or None
        None where the pixels do not determine the intensities: too few, or all facing one way.

    Notes
    -----
    Semi-calibrated photometric stereo [Cho2016]: I_pf / e_f = b_p.l_f is linear in 1 / e and in all b_p. With every
    b_p eliminated the smallest eigenvector of an F x F matrix gives 1 / e; from there, Gauss-Newton on log e
    minimises the relative misfit itself (the eigenvector's constraint pulls dim or noisy frames). Weights are
    Tukey's on the relative misfit: shadows and gloss leave. Sigma: how much pixels that face different ways differ,
    and what the directions' own error moves.
    """
    values = probe.values.mean(-1, dtype=np.float64).T
    light = np.moveaxis(np.asarray(toward, np.float64), 0, 1)
    bright = np.quantile(values, 0.9, axis=1)
    believable = ~probe.clipped.T & (values > LIT * bright[:, None])
    use = (believable.sum(1) >= FEWEST_FRAMES) & (bright > 0.05 * np.quantile(bright, 0.9))
    if use.sum() < FEWEST_PIXELS:
        return None
    values, light, believable = values[use] / bright[use, None], light[use], believable[use]
    colours = probe.values[:, use].astype(np.float64) / bright[use, None]
    count = values.shape[1]
    energy = np.ones(count)
    weight = believable.astype(np.float64)
    for turn in range(ROUNDS):
        scaled = values / energy
        pixels = Eliminated.of(light, weight, scaled)
        shading = np.einsum("pfi,pi->pf", light, pixels.b)
        length = np.maximum(np.linalg.norm(pixels.b, axis=1), 1e-9)[:, None]
        residual = (scaled - shading) / length
        if turn < ROUNDS // 3:
            # Globally right for these weights, whatever the start.
            part = scaled / length
            matrix = pixels.left_over(part, part)
            inverse = np.abs(np.linalg.eigh(matrix)[1][:, 0])
            step = -np.log(np.maximum(inverse, 1e-6))
        else:
            part = shading / length
            hessian = pixels.left_over(part, part)
            step = np.linalg.pinv(hessian, rcond=1e-9) @ np.sum(part * weight * residual, 0)
        energy = energy * np.exp(np.clip(step - step.mean(), -1, 1))
        energy /= energy.mean()
        scale = max(spread(residual[weight > 0]), 1e-4)
        # Wide at first: the start may be off by more than the misfit that is looked for.
        reach = 4.685 * scale * max(1.0, 3.0 - turn / 5)
        weight = np.where(believable, np.maximum(1 - (residual / reach) ** 2, 0) ** 2, 0)
        weight *= shading > LIT * length
        weight[np.count_nonzero(weight, axis=1) < FEWEST_FRAMES] = 0
        if np.count_nonzero(weight.any(1)) < FEWEST_PIXELS:
            return None
    pixels = Eliminated.of(light, weight, values / energy)
    shading = np.einsum("pfi,pi->pf", light, pixels.b)
    length = np.maximum(np.linalg.norm(pixels.b, axis=1), 1e-9)[:, None]
    part, residual = shading / length, (values / energy - shading) / length
    hessian = pixels.left_over(part, part)
    spectrum = np.linalg.eigvalsh(hessian)
    # The smallest belongs to the common scale and is zero; the next must not be.
    if spectrum[1] < 1e-5 * spectrum[-1]:
        return None
    inverse = np.asarray(np.linalg.pinv(hessian, rcond=1e-7), np.float64)
    facing = pixels.b / length
    covariance = _between_sectors(pixels, facing, part, residual)
    covariance += _of_directions(light.mean(0), sigma_deg, pixels, facing, part, inverse)
    each = by_channel(colours, energy, shading.T, weight.T)
    return ObjectPhotometry(
        each / each.mean(0), np.sqrt(np.diag(covariance)), scale, int(np.count_nonzero(weight.any(1)))
    )


def _between_sectors(pixels: Eliminated, facing: Array, part: Array, residual: Array) -> Array:
    """Return the covariance (F, F) of log e: how far apart the pixels that face different ways want it."""
    moves = []
    pull = part * pixels.weight * residual
    for here in sectors(facing):
        hessian = pixels.left_over(part, part, here)
        moves.append(np.linalg.pinv(hessian, rcond=1e-4, hermitian=True) @ np.sum(pull[here], 0))
    return np.array(moves).T @ np.array(moves) / len(moves)


def _of_directions(
    axis: Array, sigma_deg: Array, pixels: Eliminated, facing: Array, part: Array, inverse: Array
) -> Array:
    """Return the covariance (F, F) of log e that the directions' own errors make; `axis` (F, 3): those directions."""
    turn = np.deg2rad(np.nan_to_num(sigma_deg))
    out = np.zeros_like(inverse)
    for tangent in two_across(unit(axis)):
        # A light turned by t changes its own shading by b.t; through b, that of the others.
        turned: Array = facing @ (tangent * turn[:, None]).T
        moved = inverse @ pixels.left_over(part, turned)
        out += moved @ moved.T
    return out
