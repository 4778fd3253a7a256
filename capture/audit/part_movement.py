"""Did a chrome ball move, and all else stand still? By its own edges: what lies around it has no vote."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from capture.audit.movement import MOST_TILES, CameraStep, find_step, static_tiles, votes
from capture.audit.static_edges import orientation
from scene.frames import Frames, gray
from scene.spheres import Sphere

FEWEST_FRAMES = 8
SIDE_PX, TILE_PX = 128, 48
"""Longer side of a ball's picture; of its tiles."""
ENLARGED, REDUCED = 2, 4
"""How often larger a small ball's picture is at most; so many by so many pixels of a large ball are one of its."""
MARGIN = 0.6
"""Of a ball's radius, around it, that is looked at: a step of half of it stays inside."""
GAIN = 0.4
"""By how much more of the votes a step must have than standing still. Sound real captures stay under 0.3; balls that
move by 3 % of their size reach 0.4 to 0.95."""
ALIKE_PX = 2.0
"""Balls that move by the same step, to so much, moved together."""


def part_warnings(frames: Frames, spheres: Sequence[Sphere], step: int = 1) -> list[str]:
    """Name the chrome balls that lie elsewhere from some frame on.

    A pixel in which `spheres` are given is `step` of the frames' wide. All balls together moved with the picture: that
    is `capture.audit.movement`'s to say. Those shot apart are in no frame.
    """
    balls = [ball for ball in spheres if ball.kind == "chrome" and not ball.apart]
    places = [step * np.asarray(ball.center_px) for ball in balls if len(frames) >= FEWEST_FRAMES]
    found = [part_step(frames, place, step * ball.radius_px) for place, ball in zip(places, balls, strict=False)]
    steps = [one for one in found if one is not None]
    is_picture = len({one.first for one in steps}) == 1 and len(steps) == len(balls) > 1
    if is_picture and np.ptp([one.shift_px for one in steps], axis=0).max() < ALIKE_PX:
        return []
    names, warnings = frames.names, []
    for (u, v), one in zip(places, found, strict=True):
        if one is not None:
            right, down = one.shift_px
            warnings.append(
                f"{names[one.first]}: from here on the chrome ball at ({u:.0f}, {v:.0f}) px lies "
                f"{np.hypot(right, down):.1f} px off where it lay before (right {right:+.1f}, down {down:+.1f}): it "
                f"moved after {names[one.first - 1]}. Reshoot, or list the frames before or after under frames.skip."
            )
    return warnings


def part_step(frames: Frames, center_px: NDArray[np.float64], radius_px: float) -> CameraStep | None:
    """Return from which frame on a ball lies elsewhere, in pixels of the frames; None where it stands still."""
    import cv2

    reach = (1 + MARGIN) * radius_px
    low = np.maximum(center_px - reach, 0).astype(int)
    high = np.minimum(np.ceil(center_px + reach).astype(int) + 1, [frames.width, frames.height])
    if (high <= low).any():
        return None
    across = int(max(high - low))
    scale = min(SIDE_PX / across, ENLARGED)
    every = max(1, across // (REDUCED * SIDE_PX))
    width, height = (round(scale * int(side)) for side in high - low)
    rows, columns = np.mgrid[:height, :width]
    u, v = (center_px - low + 0.5) * scale - 0.5
    near = np.hypot(columns - u, rows - v) < scale * reach
    right, down = (slice(int(start), int(stop), every) for start, stop in zip(low, high, strict=True))
    how = cv2.INTER_AREA if scale * every < 1 else cv2.INTER_CUBIC
    read = (gray(frames.read(down, [i], columns=right, subtract_ambient=False)[0]) for i in range(len(frames)))
    small = [cv2.resize(one, (width, height), interpolation=how) for one in read]
    units = near * np.stack([orientation(one, 0.02 * float(np.quantile(one, 0.99)) + 1e-6) for one in small])
    places = static_tiles(units, TILE_PX, MOST_TILES)
    if not len(places):
        return None
    planes = np.stack([votes(units[:, y : y + TILE_PX, x : x + TILE_PX]) for x, y in places])
    found = find_step(planes[:, len(frames) :], places + (TILE_PX - np.array([width, height])) / 2, GAIN)
    return found and replace(found, shift_px=found.shift_px / scale)
