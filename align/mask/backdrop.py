"""The backdrop: one smooth surface of whatever print, and the pixels that contradict it.

A surface of albedo a(p) under flash f shows I_f(p) = a(p) e_f(p), and e_f, what the flash gives it there, is smooth: so
log I_f - log e_f is the same in every frame that lights the pixel, whatever is printed there. What is inclined
otherwise, or shines, follows another e_f. Neither the lights nor the surface's place need be known.
"""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.scan_view import box_of
from scene.fan_out import fan_out
from scene.frames import Frames, gray
from scene.robust import MAD, spread

Array = NDArray[np.float64]
FLOOR = 0.005
"""Of the scene's bright parts, added before the logarithm: what is darker is noise."""
BORDER = 0.15
"""Share of the image, at each side, where the backdrop is looked for at first."""
DEGREES = 2, 2, 3, 4, 4, 4, 4
"""Of the polynomials of the pixel, turn by turn: few terms reach from the border into the middle without swinging."""
FITTED = 5000
"""Pixels, at least, to which a frame's light is fitted, where there are so many."""
SHADOW = np.log(4.0)
"""A frame that shows less than a quarter of the pixel's upper quartile is in shadow, and has no vote."""
FEWEST_VOTES = 2
ABOVE = 2.0
"""A frame that shows more than the print speaks twice against the backdrop; one that shows less may be in penumbra."""
DARKEST = 0.01
"""Share of the print that is darker still. A frame that shows less than a quarter of the darkest print is in shadow."""
SPECK = 5
"""Pixels across: what is smaller does not contradict the backdrop."""
LEAST_AGREEING = 0.5
"""Share of the other votes that agree with one's albedo, at least, where the backdrop is seen."""
SLACK, LEAST_SLACK = 3.0, 0.05
"""Spreads of the backdrop's frames, and relative brightness at least, to which two frames agree."""
TEXTURE, STANDS_OUT, NINETY = 0.12, 4.0, 1.64
"""An even backdrop's own unevenness, relative, at least; and how many times its unevenness another's albedo differs."""


@dataclass(frozen=True)
class Contradiction:
    """How each pixel contradicts the backdrop."""

    object_likely: NDArray[np.bool_]
    """(h, w)."""
    backdrop: NDArray[np.float32]
    """(h, w): the backdrop's mean over the frames, had it neither shadows nor print."""
    backdrop_noise: float
    """Relative spread of the backdrop's frames about it."""


def contradict_backdrop(stack: NDArray[np.float32], ignore: NDArray[np.bool_]) -> Contradiction:
    """Fit the backdrop to a stack of gray frames (F, h, w), and say where it cannot be; `ignore` (h, w): balls.

    The light of each frame is a polynomial of the pixel, fitted robustly, at first to the image's border, then to all
    that agreed. Where the backdrop is even, what is much brighter or darker than it contradicts it, too.
    """
    import cv2

    count, height, width = stack.shape
    v, u = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    edge = (np.abs(u) > 1 - 2 * BORDER) | (np.abs(v) > 1 - 2 * BORDER)
    member = (edge & ~ignore).ravel()
    # Eight-bit black is constant, and still no surface.
    floor = max(FLOOR * float(np.percentile(stack, 99)), 1e-6)
    logs = np.log(np.maximum(stack.reshape(count, -1), 0) + floor).astype(np.float32)
    light, albedo = np.zeros_like(logs), np.median(logs, 0)
    even = np.zeros(height * width, np.float32)
    likely, noise, darkest = np.zeros(height * width, bool), 1.0, -np.inf
    for degree in DEGREES:
        basis = np.stack([u**i * v**j for i in range(degree + 1) for j in range(degree + 1 - i)], -1)
        basis = basis.reshape(-1, basis.shape[-1])
        chosen = np.flatnonzero(member)
        if len(chosen) < 10 * basis.shape[1]:
            break
        chosen = chosen[:: max(1, len(chosen) // FITTED)]
        fitted = [_smooth(basis, chosen, frame - albedo) for frame in logs]
        light = np.stack(fitted) - np.mean(fitted, 0)
        albedo, agreeing, against = _albedo(logs - light, darkest, max(SLACK * noise, LEAST_SLACK))
        voted = agreeing + against >= FEWEST_VOTES
        seen = member & voted
        noise = float(np.median(np.abs((logs - light - albedo)[:, seen])) * MAD) if seen.any() else 1.0
        even = _smooth(basis, chosen, albedo)
        unlike = np.abs(albedo - even)
        texture = max(TEXTURE, float(np.quantile(unlike[chosen], 0.9)) / NINETY)
        likely = voted & (agreeing - 1 < LEAST_AGREEING * (agreeing - 1 + against))
        likely |= unlike > STANDS_OUT * texture
        likely = cv2.medianBlur(likely.reshape(height, width).astype(np.uint8), SPECK).ravel() > 0
        member = ~likely & ~ignore.ravel()
        darkest = float(np.quantile(albedo[member & voted], DARKEST)) if (member & voted).any() else -np.inf
    mean = np.exp(even + np.log(np.exp(light).mean(0)))
    return Contradiction(likely.reshape(height, width) & ~ignore, mean.reshape(height, width).astype(np.float32), noise)


def _smooth(basis: Array, chosen: NDArray[np.intp], values: NDArray) -> NDArray[np.float32]:
    """Return the polynomial (h w,) through most of the values (h w,) at the chosen pixels."""
    some, there = basis[chosen], values[chosen].astype(np.float64)
    weight = np.ones(len(chosen))
    solution = np.zeros(basis.shape[1])
    for _ in range(6):
        weighted = some * weight[:, None]
        solution = np.linalg.lstsq(weighted.T @ some, weighted.T @ there, rcond=None)[0]
        residual = there - some @ solution
        weight = 1 / (1 + (residual / max(2 * spread(residual), 0.02)) ** 2) ** 2
    return (basis @ solution).astype(np.float32)


def _albedo(
    levels: NDArray[np.float32], darkest: float, slack: float
) -> tuple[NDArray[np.float32], NDArray[np.intp], Array]:
    """Return each pixel's log albedo (N,), how many frames agree with it, and the weight of those that do not.

    The albedo is the one that most of the lit frames (F, N) agree with.
    """
    quartile = np.partition(levels, (3 * len(levels)) // 4, axis=0)[(3 * len(levels)) // 4]
    lit = levels > np.maximum(quartile, darkest) - SHADOW
    voted = np.where(lit, levels, np.inf)

    def votes(one: NDArray[np.float32]) -> NDArray[np.intp]:
        return (np.abs(voted - one) <= slack).sum(0)

    counts = np.stack(fan_out(votes, list(levels))) * lit
    best = counts.argmax(0)
    agreeing = np.take_along_axis(counts, best[None], 0)[0]
    mine = np.take_along_axis(levels, best[None], 0)[0]
    near = np.abs(voted - mine) <= slack
    mean = np.where(near, levels, 0).sum(0) / np.maximum(near.sum(0), 1)
    brighter, darker = (lit & (levels > mine + slack)).sum(0), (lit & (levels < mine - slack)).sum(0)
    return mean.astype(np.float32), agreeing, ABOVE * brighter + darker


def bright_mean(stack: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (h, w, ...), the mean of each pixel's brightest quarter of frames (F, h, w, ...).

    Cast shadows vanish from the backdrop, and the object's edge counts where it is lit: it is steeper than in the mean.
    """
    keep = max(1, len(stack) // 4)
    return np.partition(stack, len(stack) - keep, axis=0)[-keep:].mean(0)


def bright_picture(frames: Frames, near: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (H, W) float32, `bright_mean` of the gray frames around the pixels of `near`; 0 elsewhere."""
    down, columns = box_of(near, margin=32)
    out = np.zeros(near.shape, np.float32)

    def fill(band: slice) -> None:
        rows = slice(max(band.start, down.start), min(band.stop, down.stop))
        if rows.start < rows.stop:
            out[rows, columns] = bright_mean(gray(frames.read(rows, columns=columns)))

    fan_out(fill, list(frames.bands((128 << 20) // (os.cpu_count() or 1))))
    return out
