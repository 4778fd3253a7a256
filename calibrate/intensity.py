"""A matte ball as a photometer: how bright each flash was, per channel, and what light was left over."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrate.skin import FEWEST_PIXELS, LIT, Skin, tukey_weights

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Photometry:
    """What the ball measured.

    Parameters
    ----------
    intensities : (F, 3) float64
        Pixel value of the ball's skin facing each light at the reference point. NaN where it could not be read.
    sigma : (F,) float64
        Relative, one frame's mean over channels, from the scatter between patches of the ball.
    ambient : (3,) float64
        Pixel value of light that is there in all frames alike, on the ball's skin.
    residual : float
        Relative rms of the fit, all frames.
    clipped : (F,) float64
        Share of the ball's pixels that are clipped.
    evidence : str
        Which model the ball demanded.
    """

    intensities: Array
    sigma: Array
    ambient: Array
    residual: float
    clipped: Array
    evidence: str


def measure(skin: Skin, directions: Array, positions: Array | None, reference: Array) -> Photometry:
    """Read each light's intensity from the ball's shading.

    Parameters
    ----------
    skin : Skin
    directions : (F, 3) float
        Unit, for distant lights.
    positions : (F, 3) float or None
        mm, for near lights.
    reference : (3,) float
        Where the intensities hold, mm.

    Notes
    -----
    I = E_f (m + k h) + a. m = max(0, n.(q - x)) |q - ref|^2 / |q - x|^3, or max(0, n.l) for distant lights;
    h = (1 - n_z) / 2, how much of a table that faces the camera a normal sees; the bounce k and the ambient a
    are the same in all frames, and each is there only if the ball's patches demand it (BIC). A free intercept
    in each frame would trade against E: 1 % of error where this leaves 0.3 %.
    """
    count = len(skin.values)
    blocks = int(skin.block.max(initial=-1)) + 1
    data = [_patches(skin, f, directions, positions, reference, blocks) for f in range(count)]
    seen = np.array([d is not None for d in data])
    intensities = np.full((count, 3), np.nan)
    sigma = np.full(count, np.nan)
    clipped = skin.clipped.mean(1) if skin.clipped.size else np.zeros(count)
    if not seen.any():
        return Photometry(intensities, sigma, np.full(3, np.nan), np.nan, clipped, "")
    weight, shading, bounce, values = (np.stack([d[i] for d in data if d is not None]) for i in range(4))
    gray = values.mean(-1)
    # Relative errors: a bright flash's patches scatter in proportion.
    level = np.abs(np.sum(weight * shading * gray, 1) / np.maximum(np.sum(weight * shading**2, 1), 1e-12))
    weight = weight / np.maximum(level, 1e-9)[:, None] ** 2 / np.maximum(weight.sum(1, keepdims=True), 1e-12)
    models = [(False, False), (True, False), (False, True), (True, True)]
    fits = {m: _shared_fit(weight, shading, bounce, gray, *m) for m in models}
    patches = int(np.count_nonzero(weight))
    evidence = {m: patches * np.log(fits[m][3] / patches) + sum(m) * np.log(patches) for m in models}
    best = min(models, key=lambda m: evidence[m])
    # The bounce is geometry: one number for all channels. The ambient has a colour.
    k = fits[best][1]
    ambient = np.zeros(3)
    energy = np.empty((int(seen.sum()), 3))
    for c in range(3):
        energy[:, c], _, ambient[c], _ = _shared_fit(
            weight, shading + k * bounce, bounce, values[..., c], best[0], False
        )
    intensities[seen] = energy
    mean, shape = energy.mean(1), shading + k * bounce
    residual = gray - mean[:, None] * shape - ambient.mean()
    sums = np.sum((weight * shape * residual) ** 2, 1)
    number = np.count_nonzero(weight, axis=1)
    spread = np.sqrt(sums * number / np.maximum(number - 1, 1)) / np.sum(weight * shape**2, 1)
    sigma[seen] = spread / np.maximum(np.abs(mean), 1e-12)
    relative = np.sqrt(np.average((residual / np.maximum(np.abs(mean), 1e-12)[:, None]) ** 2, weights=weight))
    told = {
        (False, False): "no ambient light left, no bounce",
        (True, False): f"ambient light left: {ambient.mean() / np.median(mean):.1%} of the median flash",
        (False, True): f"the table's bounce: {k:.1%} of the flash",
        (
            True,
            True,
        ): f"ambient light left: {ambient.mean() / np.median(mean):.1%} of the median flash, and a bounce of {k:.1%}",
    }[best]
    text = f"white ball: {told} (dBIC {evidence[(False, False)] - evidence[best]:.0f}), residual {relative:.1%}"
    return Photometry(intensities, sigma, ambient, float(relative), clipped, text)


def _patches(
    skin: Skin, f: int, directions: Array, positions: Array | None, reference: Array, blocks: int
) -> tuple[Array, Array, Array, Array] | None:
    """Average one frame over patches: weight (B,), shading (B,), bounce (B,), values (B, 3). None if too few pixels."""
    if positions is None:
        shading = skin.normals @ directions[f]
    else:
        toward = positions[f] - skin.points
        distance = np.linalg.norm(toward, axis=1)
        shading = np.sum(skin.normals * toward, 1) * np.sum((positions[f] - reference) ** 2) / distance**3
    top = shading.max(initial=0)
    lit = (shading > LIT * top) & ~skin.clipped[f]
    if lit.sum() < FEWEST_PIXELS or not np.isfinite(top):
        return None
    # The dark side tells ambient and bounce; between, a large flash is half set.
    use = lit | (shading < -0.5 * LIT * top)
    shading = np.maximum(shading[use], 0)
    bounce = (1 - skin.normals[use, 2]) / 2
    values = skin.values[f][use].astype(np.float64)
    weight = tukey_weights(np.column_stack([shading, bounce, np.ones(len(bounce))]), values.mean(1))
    block = skin.block[use]
    total = np.bincount(block, weight, blocks)
    some = np.maximum(total, 1e-12)

    def mean(x: Array) -> Array:
        return np.bincount(block, weight * x, blocks) / some

    return (
        np.asarray(total, np.float64),
        mean(shading),
        mean(bounce),
        np.stack([mean(values[:, c]) for c in range(3)], -1),
    )


def _shared_fit(
    weight: Array, shading: Array, bounce: Array, values: Array, has_ambient: bool, has_bounce: bool
) -> tuple[Array, float, float, float]:
    """Fit values (F, B) = E_f (shading + k bounce) + a; return E (F,), k, a and the weighted sum of squares."""
    k = a = 0.0
    energy = np.zeros(len(values))
    for _ in range(30 if has_bounce else 1):
        shape = shading + k * bounce
        square = np.maximum(np.sum(weight * shape**2, 1), 1e-30)
        if has_ambient:
            # a with every E_f eliminated: project values and 1 off the frame's shape.
            ones = 1 - shape * (np.sum(weight * shape, 1) / square)[:, None]
            rest = values - shape * (np.sum(weight * shape * values, 1) / square)[:, None]
            a = max(0.0, float(np.sum(weight * ones * rest) / max(np.sum(weight * ones**2), 1e-30)))
        energy = np.sum(weight * shape * (values - a), 1) / square
        if has_bounce:
            part = energy[:, None] * bounce
            rest = values - a - energy[:, None] * shading
            previous, k = k, max(0.0, float(np.sum(weight * part * rest) / max(np.sum(weight * part**2), 1e-30)))
            if abs(k - previous) < 1e-6:
                break
    residual = values - a - energy[:, None] * (shading + k * bounce)
    return energy, k, a, float(np.sum(weight * residual**2))


def propagate(
    skin: Skin, directions: Array, positions: Array | None, reference: Array, sigma_deg: Array, range_sigma: Array
) -> Array:
    """Return (F,) the relative error of an intensity that its light's own error causes.

    Notes
    -----
    The light is moved by one sigma along each tangent axis and along its range; what the lit skin's mean
    shading, weighted by itself, changes by, the intensity changes by with the other sign.
    """
    out = np.zeros(len(directions))
    for f, direction in enumerate(directions):
        distance = 1.0 if positions is None else float(np.linalg.norm(positions[f] - reference))
        side = np.cross(direction, [1.0, 0.0, 0.0] if abs(direction[0]) < 0.7 else [0.0, 1.0, 0.0])
        side /= np.linalg.norm(side)
        turn = np.deg2rad(np.nan_to_num(sigma_deg[f]))

        def shading(toward: Array, distance: float, f: int = f) -> Array:
            if positions is None:
                return skin.normals @ (toward / np.linalg.norm(toward))
            ray = reference + distance * toward / np.linalg.norm(toward) - skin.points
            return np.sum(skin.normals * ray, 1) * distance**2 / np.linalg.norm(ray, axis=1) ** 3

        here = np.maximum(shading(direction, distance), 0)
        square = np.sum(here**2)
        if square <= 0:
            continue
        moves = [
            shading(direction + turn * side, distance),
            shading(direction + turn * np.cross(direction, side), distance),
        ]
        if positions is not None:
            moves.append(shading(direction, distance * (1 + np.nan_to_num(range_sigma[f]))))
        changes = [np.sum(here * np.maximum(move, 0)) / square - 1 for move in moves]
        out[f] = np.sqrt(np.sum(np.square(changes)))
    return out
