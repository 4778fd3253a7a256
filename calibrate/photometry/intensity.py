"""A matte ball as a photometer: how bright each flash was, per channel, and what light was left over."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.photometry.matte_shading import Surface
from calibrate.photometry.patches import Meter, cut
from calibrate.photometry.shading_model import DIM, Fit, Parts, ShadingModel, choose

Array = NDArray[np.float64]
PARTLY, PARTLY_TIMES = 0.05, 3
"""Relative misfit of one frame from which something hides a part of the ball, or glares on it; and in the median's."""
SIDES = 8  # parts of a ball's outline whose errors are taken to agree
UNEVEN = 0.1  # share of a frame's bounce that an even, endless table misses: its edge, its pattern, others' shadows
AIM_DEG = 2.0  # how far a flash with a beam is taken to miss the reference point, standard deviation


class Photometry(NamedTuple):
    """What the ball measured."""

    intensities: Array  # (F, 3) pixel value of the ball facing each light at the reference point; NaN: unreadable
    sigma: Array  # (F,) relative to the others' mean, one frame, from the fit and from the error of the lights' places
    ambient: Array  # (3,) pixel value of light that is there in all frames alike, where the ball faces the camera
    misfit: Array  # (F,) relative rms of each frame's fit
    clipped: Array  # (F,) share of the ball's pixels that are clipped
    evidence: str  # which model the ball demanded

    @property
    def residual(self) -> float:
        """The median frame's misfit, 0 where none could be read."""
        return float(np.nanmedian(self.misfit)) if np.isfinite(self.misfit).any() else 0.0


def measure(surface: Surface, meter: Meter) -> Photometry:
    """Read each light's intensity from the ball's shading.

    The model is `shading_model`'s, chosen by BIC on the channels' mean. Its geometry is then held, and each channel
    has its own strengths. Ambient, bounce and gloss are shared by all frames: a free intercept in each frame would
    trade against its intensity, 1 % of error where this leaves 0.1 %.
    """
    count = len(surface.values)
    clipped = surface.clipped.mean(1) if surface.clipped.size else np.zeros(count)
    ball, covariance = cut(surface, meter), meter.covariance
    read = ball.readable
    intensities, sigma = np.full((count, 3), np.nan), np.full(count, np.nan)
    if not read.any():
        return Photometry(intensities, sigma, np.full(3, np.nan), sigma, clipped, "")
    every = ShadingModel(ball.only(read))
    gray = every.ball.values.mean(-1)
    rough = every.misfit(every.fit(Parts(), gray).residual)
    # What hides the flash from the ball in one frame must not bend what all frames share.
    sound = (every.level > DIM * np.median(every.level)) & (rough < max(PARTLY, PARTLY_TIMES * float(np.median(rough))))
    kept = np.flatnonzero(read)[sound]
    model = ShadingModel(ball.only(np.isin(np.arange(count), kept)))
    fit, gain = choose(model, model.ball.values.mean(-1))
    ambient = np.zeros(3)
    for c in range(3):
        parts = _held(model, fit.parts, model.ball.values[..., c])
        left = np.pad(model.linear(parts, model.ball.values[..., c])[1], (0, 4 - parts.ambient))
        intensities[read, c] = every.energies(parts, left, every.ball.values[..., c])[0]
        # As the surface that faces the camera shows it.
        ambient[c] = max(0.0, float(left[0] + left[3]))
    _, residual = every.energies(fit.parts, fit.ambient, gray)
    misfit = np.full(count, np.nan)
    misfit[read] = every.misfit(residual)
    # Half of the ball's sides agree by chance.
    sigma[read] = misfit[read] / np.sqrt(SIDES / 2)
    sigma[kept] = _sigma(model, fit, None if covariance is None else covariance[kept])
    text = f"white ball: {_said(fit, ambient.mean())} (dBIC {gain:.0f}), residual {np.nanmedian(misfit):.1%}"
    return Photometry(intensities, sigma, ambient, misfit, clipped, text)


def _held(model: ShadingModel, parts: Parts, values: Array) -> Parts:
    """Return the model with one channel's own strengths of bounce and gloss, its geometry held."""
    shapes = [] if parts.bounce is None else [model.bounce(parts)]
    shapes += [] if parts.gloss is None else [model.ball.gloss[parts.width]]
    for _ in range(4):
        energy, _, rest = model.linear(parts, values)
        if not shapes:
            break
        design = np.stack([energy[:, None] * shape for shape in shapes], -1)
        matrix = np.einsum("fb,fbi,fbj->ij", model.weight, design, design)
        step = np.linalg.lstsq(matrix, np.einsum("fb,fbi,fb->i", model.weight, design, rest), rcond=1e-9)[0]
        numbers = [x for x in (parts.bounce, parts.gloss) if x is not None] + step
        strengths = iter(np.maximum(numbers, 0))
        bounce, gloss = (None if x is None else float(next(strengths)) for x in (parts.bounce, parts.gloss))
        parts = replace(parts, bounce=bounce, gloss=gloss)
    return parts


def _sigma(model: ShadingModel, fit: Fit, covariance: Array | None) -> Array:
    """Return (F,) the relative sigma of each energy against the others' mean.

    Notes
    -----
    With J all derivatives of the model and W its weights, H = J'WJ. Patches on one side of the ball err alike, in
    one frame: a sandwich H^-1 (sum s s') H^-1 of those sides' summed scores s. A light in another place moves the
    energies by H^-1 J'W E dm/dq, with its covariance.
    """
    ball, parts, root = model.ball, fit.parts, np.sqrt(model.weight)
    count, blocks = root.shape
    slopes = model.slopes(parts)
    columns = np.zeros((count, blocks, count + parts.ambient + len(slopes)))
    columns[np.arange(count), :, np.arange(count)] = model.shape(parts)
    columns[..., count : count + parts.ambient] = model.around[:, : parts.ambient]
    for i, slope in enumerate(slopes, count + parts.ambient):
        columns[..., i] = fit.energy[:, None] * slope
    weighted = root[..., None] * columns
    flat = weighted.reshape(count * blocks, -1)
    scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    inverse = np.linalg.pinv((flat / scale).T @ (flat / scale), rcond=1e-10) / scale / scale[:, None]
    score = weighted * (root * fit.residual)[..., None]
    # A patch's place around the outline is in its number: see `read_surface`.
    side = np.arange(blocks) * SIDES // blocks
    sums = np.stack([score[:, side == k].sum(1) for k in range(SIDES)], 1).reshape(count * SIDES, -1)
    spread = inverse @ (sums.T @ sums) @ inverse * SIDES / (SIDES - 1)
    if covariance is not None:
        moved = (root**2 * fit.energy[:, None])[..., None] * ball.moved
        for f in range(count):
            pull = (inverse @ (columns[f].T @ moved[f]))[:, :3]
            spread = spread + pull @ np.nan_to_num(covariance[f]) @ pull.T
    if parts.bounce is not None:
        thrown = UNEVEN * parts.bounce * fit.energy[:, None] * model.bounce(parts) * root**2
        for f in range(count):
            pull = inverse @ (columns[f].T @ thrown[f])
            spread = spread + np.outer(pull, pull)
    if parts.beam is not None:
        # The shadows of others on the table look like a part of a beam, in all frames; each has its own aim.
        aside = ball.aside.mean(1)
        pull = fit.energy * parts.beam_sigma * aside
        aim = fit.energy * parts.beam * np.sqrt(np.expm1(2 * aside)) * np.deg2rad(AIM_DEG)
        spread[:count, :count] += np.outer(pull, pull) + np.diag(aim**2)
    relative = np.eye(count) / fit.energy - 1 / fit.energy.sum()
    return np.sqrt(np.maximum(np.einsum("fi,ij,fj->f", relative, spread[:count, :count], relative), 0))


def _said(fit: Fit, ambient: float) -> str:
    """Say what the model holds beside the flash."""
    parts, said = fit.parts, []
    if parts.ambient:
        said.append(f"ambient light left, {ambient / np.median(fit.energy):.1%} of the median flash")
    if parts.bounce is not None:
        turned = "" if parts.tilt is None else f", tilted {np.degrees(np.arctan(np.hypot(*parts.tilt))):.0f} degrees"
        said.append(f"the bounce of a table of albedo {parts.bounce:.2f}{turned}")
    if parts.gloss is not None:
        said.append("a gloss")
    if parts.beam is not None:
        said.append(f"flashes that aim at the object and fall off as cos^{parts.beam:.1f} beside their axis")
    return "; ".join(said) if said else "no ambient light left, no bounce, no gloss"
