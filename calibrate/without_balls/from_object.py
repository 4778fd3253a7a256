"""The last resort for the flashes' strengths: no white ball, no file has them, but something matte is seen.

Directions are known. Every matte pixel says I_f = e_f b.l_f with a vector b of its own: three unknowns a pixel, and
F - 1 in common.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Notes
from calibrate.lights.directions import two_across
from calibrate.without_balls.probe import FEWEST_PIXELS, Probe, by_channel, read_probe, sectors
from scene.camera import Camera
from scene.frames import Frames
from scene.intensities import Eliminated
from scene.lights import Lights
from scene.normals import unit
from scene.robust import TUKEY, spread, tukey
from scene.spheres import Sphere

Array = NDArray[np.float64]
FEWEST_FRAMES = 5
"""Three frames fix a pixel's b, and the fourth says nothing of itself until there is a fifth to doubt it."""
LIT = 0.15  # share of a pixel's own brightness under which it is taken to stand in shadow
ROUNDS = 30
CANDIDATES, MOST_PIXELS = 12000, 3000
USUALLY_LIT = 0.6  # share of the frames in which a pixel must be lit and unclipped to be asked
DARK = 0.01  # of white: what is darker in most frames is noise, or the sensor's pedestal
CELLS = 12  # normals are sorted into so many cells across the hemisphere, and each cell has the same say at most
RELIEF = 0.07  # how far, of its distance, a surface may lie off the reference point's plane
TOO_VAGUE = 0.25  # sigma of the strengths from which they are no better than taking all flashes for equally bright


def strengths_from_object(
    frames: Frames, camera: Camera, spheres: list[Sphere], lights: Lights, notes: Notes
) -> tuple[Array, Array] | None:
    """Read the flashes' strengths from whatever matte surfaces the frames show, with directions known.

    Returns intensities (F, 3), each channel's mean 1, and their relative sigma (F,); None where nothing matte is lit
    from enough sides, and the lights are distant. The balls are left out; the lights' intensities are not looked at.

    Notes
    -----
    A table fills the picture with one normal, which does not determine them [Cho2016]: so pixels are drawn evenly over
    the directions that they seem to face, not over the picture.
    """
    outside = np.ones((frames.height, frames.width), bool)
    for sphere in spheres:
        if not sphere.apart:
            outside &= ~sphere.mask(camera, grow_px=0.1 * sphere.radius_px + 2)
    probe = read_probe(frames, outside, most=CANDIDATES)
    depth = lights.reference_point_mm[2]

    def toward(stretch: float) -> Array:
        flat = camera.points_at_depth(probe.pixels, depth * stretch) if depth < 0 else np.zeros((len(probe.pixels), 3))
        return lights.toward(flat)

    chosen = varied(probe, toward(1.0))
    probe = probe.take(chosen)
    # Near flashes: the surface's height is unknown, and what is nearer to them is brighter.
    stretches = (1.0,) if lights.positions_mm is None or depth >= 0 else (1.0, 1 - RELIEF, 1 + RELIEF)
    read = [intensities_from_object(probe, toward(s), lights.direction_sigma_deg) for s in stretches if len(chosen)]
    good = [one for one in read if one is not None]
    equal = _of_equal_power(lights)
    sigma = np.full(len(lights), np.inf)
    if good and len(good) == len(stretches):
        strengths = np.stack([one.intensities.mean(1) for one in good])
        sigma = np.hypot(good[0].sigma, np.abs(strengths - strengths[0]).max(0) / strengths[0])
    if not np.median(sigma) < TOO_VAGUE:
        if lights.positions_mm is None:
            return None
        notes.warnings.append(
            "no white ball, and nothing matte that tells the flashes' strengths: all are taken as equally powerful, by "
            "their distances. 5 % of variation bends normals by 2 degrees."
        )
        return np.repeat(equal[:, None], 3, 1), np.full(len(lights), np.nan)
    intensities, sigma, scatter = _shrunk(good[0].intensities, sigma, equal)
    notes.evidence.append(
        f"no white ball: the flashes' strengths from {good[0].pixels} pixels of the object itself (misfit "
        f"{good[0].residual:.1%} of a flash); they vary in power by {scatter:.0%}, each to {np.median(sigma):.1%}; "
        "what is within their errors is drawn to equal power"
    )
    notes.warnings.append(
        "no white ball: the flashes' strengths are from the object's own shading, which supposes that it is matte; to "
        f"{np.median(sigma):.1%}, and errors that bend all normals alike. Put a white ball beside the object, or list "
        "the one that is there under [[spheres]]."
    )
    return intensities, sigma


def _of_equal_power(lights: Lights) -> Array:
    """Return (F,) what flashes of one power do at the reference point, mean 1."""
    if lights.positions_mm is None:
        return np.ones(len(lights))
    fall = 1 / np.sum((lights.positions_mm - lights.reference_point_mm) ** 2, 1)
    return fall / fall.mean()


def _shrunk(intensities: Array, sigma: Array, equal: Array) -> tuple[Array, Array, float]:
    """Draw the strengths to those of equal power as far as their scatter is no more than their errors.

    Notes
    -----
    Mostly one flash is carried around. With measured log powers p of errors sigma, and tau^2 what their variance
    exceeds the errors' by, the best guess is the mean and tau^2 / (tau^2 + sigma^2) of the rest.
    """
    power = np.log(intensities.mean(1) / equal)
    power -= power.mean()
    square = max(float(np.var(power) - np.mean(sigma**2)), 0.0)
    keep = square / (square + sigma**2)
    drawn = intensities * np.exp((keep - 1) * power)[:, None]
    # Flashes of one power that vary by nothing would have no error: leave them a third of what was measured.
    return drawn / drawn.mean(0), sigma * np.sqrt(np.maximum(keep, 1 / 9)), float(np.sqrt(square))


def varied(probe: Probe, toward: Array) -> NDArray[np.intp]:
    """Return the indices of pixels that are lit in most frames, drawn evenly over what they seem to face."""
    values = probe.values.mean(-1, dtype=np.float64)
    if values.shape[1] == 0:
        return np.zeros(0, np.intp)
    bright = np.quantile(values, 0.9, axis=0)
    lit = ~probe.clipped & (values > LIT * bright)
    good = np.flatnonzero((lit.mean(0) > USUALLY_LIT) & (bright > max(DARK, 0.1 * np.quantile(bright, 0.9))))
    if not len(good):
        return good
    light, weight = np.moveaxis(toward[:, good], 0, 1), lit[:, good].T[..., None]
    matrix = np.einsum("pfi,pfj->pij", light * weight, light) + 1e-6 * np.eye(3)
    # As if all flashes were equally bright: near enough to sort by.
    facing = np.linalg.solve(matrix, np.einsum("pfi,fp->pi", light * weight, values[:, good])[..., None])[..., 0]
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-12)
    cell = ((facing[:, :2] + 1) / 2 * CELLS).astype(np.intp) @ [1, CELLS]
    order = np.argsort(cell, kind="stable")
    _, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    most = next((m for m in range(10, len(good)) if np.minimum(count, m).sum() >= MOST_PIXELS), len(good))
    picks = [
        order[a : a + n][np.linspace(0, n - 1, min(n, most)).astype(np.intp)] for a, n in zip(first, count, strict=True)
    ]
    return good[np.sort(np.concatenate(picks))]


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
        reach = TUKEY * scale * max(1.0, 3.0 - turn / 5)
        weight = np.where(believable, tukey(residual, reach), 0)
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
