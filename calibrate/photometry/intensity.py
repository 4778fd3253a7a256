"""A matte ball as a photometer: how bright each flash was, per channel, and what light was left over."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.photometry.matte_shading import Surface
from calibrate.photometry.patches import Meter, cut
from calibrate.photometry.shading_model import DIM, Fit, ShadingModel

Array = NDArray[np.float64]
PARTLY, PARTLY_TIMES = 0.05, 3
"""Relative misfit of one frame from which something hides a part of the ball, or glares on it; and in the median's."""
SIDES = 8  # parts of a ball's outline whose errors are taken to agree
UNEVEN = 0.1  # share of a frame's bounce that an even, endless table misses: its edge, its pattern, others' shadows


class Photometry(NamedTuple):
    """What the ball measured."""

    intensities: Array  # (F, 3) pixel value of the ball facing each light at the reference point; NaN: unreadable
    sigma: Array  # (F,) relative to the others' mean, one frame, from the fit and from the error of the lights' places
    ambient: Array  # (3,) pixel value of light that is there in all frames alike, where the ball faces the camera
    misfit: Array  # (F,) relative rms of each frame's fit
    clipped: Array  # (F,) share of the ball's pixels that are clipped
    evidence: str  # what the ball showed beside the flashes

    @property
    def residual(self) -> float:
        """The median frame's misfit, 0 where none could be read."""
        return float(np.nanmedian(self.misfit)) if np.isfinite(self.misfit).any() else 0.0


def measure(surface: Surface, meter: Meter, *, misfit_alone: bool = False) -> Photometry:
    """Read each light's intensity from the ball's shading; `misfit_alone`: nothing of it but `misfit`.

    The model is `shading_model`'s, each channel has its own numbers. Ambient light and the table's albedo are shared
    by all frames: a free intercept in each frame would trade against its intensity, 1 % of error where this leaves
    0.1 %.
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
    rough = every.misfit(every.energies(every.ball.shading, 0.0, gray)[1])
    # What hides the flash from the ball in one frame must not bend what all frames share.
    sound = (every.level > DIM * np.median(every.level)) & (rough < max(PARTLY, PARTLY_TIMES * float(np.median(rough))))
    kept = np.flatnonzero(read)[sound]
    model = ShadingModel(ball.only(np.isin(np.arange(count), kept)))
    fit, ambient = model.fit(model.ball.values.mean(-1)), np.zeros(3)
    for c in range(0 if misfit_alone else 3):
        own = model.fit(model.ball.values[..., c])
        intensities[read, c] = every.energies(every.shape(own.table), own.ambient, every.ball.values[..., c])[0]
        ambient[c] = own.ambient
    _, residual = every.energies(every.shape(fit.table), fit.ambient, gray)
    misfit = np.full(count, np.nan)
    misfit[read] = every.misfit(residual)
    if misfit_alone:
        return Photometry(intensities, sigma, np.full(3, np.nan), misfit, clipped, "")
    # Half of the ball's sides agree by chance.
    sigma[read] = misfit[read] / np.sqrt(SIDES / 2)
    sigma[kept] = _sigma(model, fit, None if covariance is None else covariance[kept])
    text = (
        f"white ball: ambient light of {ambient.mean() / np.median(fit.energy):.1%} of the median flash, a table of "
        f"albedo {fit.table[0]:.2f} under it; residual {np.nanmedian(misfit):.1%}"
    )
    return Photometry(intensities, sigma, ambient, misfit, clipped, text)


def _sigma(model: ShadingModel, fit: Fit, covariance: Array | None) -> Array:
    """Return (F,) the relative sigma of each energy against the others' mean.

    Notes
    -----
    With J all derivatives of the model and W its weights, H = J'WJ. Patches on one side of the ball err alike, in
    one frame: a sandwich H^-1 (sum s s') H^-1 of those sides' summed scores s. A light in another place moves the
    energies by H^-1 J'W E dm/dq, with its covariance.
    """
    root, thrown = np.sqrt(model.weight), fit.energy[:, None] * (model.shape(fit.table) - model.ball.shading)
    count, blocks = root.shape
    # By the energies, the ambient light where there is any, and the table where it throws any.
    shared = [np.ones((count, blocks))] if fit.ambient else []
    shared += [fit.energy[:, None] * slope for slope in model.slopes(fit.table)] if fit.table[0] else []
    columns = np.zeros((count, blocks, count + len(shared)))
    columns[np.arange(count), :, np.arange(count)] = model.shape(fit.table)
    for i, column in enumerate(shared, count):
        columns[..., i] = column
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
        moved = (root**2 * fit.energy[:, None])[..., None] * model.ball.moved
        for f in range(count):
            pull = (inverse @ (columns[f].T @ moved[f]))[:, :3]
            spread = spread + pull @ np.nan_to_num(covariance[f]) @ pull.T
    for f in range(count):
        pull = inverse @ (columns[f].T @ (UNEVEN * root**2 * thrown)[f])
        spread = spread + np.outer(pull, pull)
    relative = np.eye(count) / fit.energy - 1 / fit.energy.sum()
    return np.sqrt(np.maximum(np.einsum("fi,ij,fj->f", relative, spread[:count, :count], relative), 0))
