"""Did a chrome ball move, and all else stand still? By its own edges: what lies around it has no vote."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.audit.movement import MOST_TILES, CameraStep, find_step, static_tiles, votes
from capture.audit.static_edges import orientation
from scene.camera import Camera
from scene.frames import Frames, gray
from scene.reading import listed
from scene.spheres import Sphere

FEWEST_FRAMES = 8
SIDE_PX, TILE_PX = 128, 48
"""Longer side of a ball's picture; of its tiles."""
ENLARGED, REDUCED = 2, 4
"""How often larger a small ball's picture is at most; so many by so many pixels of a large ball are one of its."""
MARGIN = 0.3
"""Of a ball's size, around it, that is looked at: a step of a quarter of its size stays inside."""
GAIN = 0.4
"""By how much more of the votes a step must have than standing still. Sound real captures stay under 0.3; balls that
move by 3 % of their size reach 0.4 to 0.95."""
ALIKE_PX = 2.0
"""Balls that move by the same step, to so much, moved together."""


@dataclass(frozen=True, eq=False)
class Part:
    """What may move alone.

    Parameters
    ----------
    name : str
        As messages call it.
    mask : (h, w) bool
        Where it is.
    step : int
        Pixels of the frames in one of `mask`, along a side.
    """

    name: str
    mask: NDArray[np.bool_]
    step: int = 1


def parts_of(spheres: Sequence[Sphere], camera: Camera, step: int = 1) -> list[Part]:
    """Return the chrome balls that stand beside the object; a pixel of `camera` is `step` of the frames' wide."""
    balls = [ball for ball in spheres if ball.kind == "chrome" and not ball.apart]
    places = [step * np.asarray(ball.center_px) for ball in balls]
    return [
        Part(f"the chrome ball at ({u:.0f}, {v:.0f}) px", ball.mask(camera), step)
        for ball, (u, v) in zip(balls, places, strict=True)
    ]


def part_warnings(frames: Frames, parts: Sequence[Part]) -> list[str]:
    """Name the parts that lie elsewhere from some frame on; those that moved together in one warning.

    All together moved with the picture: that is `capture.audit.movement`'s to say.
    """
    if len(frames) < FEWEST_FRAMES:
        return []
    groups: list[tuple[CameraStep, list[str]]] = []
    for part in parts:
        step = part_step(frames, part)
        if step is None:
            continue
        alike = [
            names
            for other, names in groups
            if other.first == step.first and np.linalg.norm(other.shift_px - step.shift_px) < ALIKE_PX
        ]
        if alike:
            alike[0].append(part.name)
        else:
            groups.append((step, [part.name]))
    return [_told(frames.names, step, names) for step, names in groups if not 1 < len(names) == len(parts)]


def _told(names: tuple[str, ...], step: CameraStep, parts: list[str]) -> str:
    right, down = step.shift_px
    them, lie = ("it", "lies") if len(parts) == 1 else ("they", "lie")
    return (
        f"{names[step.first]}: from here on {listed(parts)} {lie} "
        f"{np.hypot(right, down):.1f} px off where {them} lay before (right {right:+.1f}, down {down:+.1f}): {them} "
        f"moved after {names[step.first - 1]}. Reshoot, or list the frames before or after under frames.skip."
    )


def part_step(frames: Frames, part: Part) -> CameraStep | None:
    """Return from which frame on a part lies elsewhere, in pixels of the frames; None where it stands still."""
    import cv2

    rows, columns = np.nonzero(part.mask)
    if not len(rows):
        return None
    margin = 1 + round(MARGIN * max(np.ptp(rows), np.ptp(columns)))
    window = tuple(slice(max(int(one.min()) - margin, 0), int(one.max()) + margin + 1) for one in (rows, columns))
    mask = part.mask[window].astype(np.uint8)
    across = max(mask.shape) * part.step
    scale = min(SIDE_PX / across, ENLARGED)
    size = tuple(round(scale * part.step * side) for side in mask.shape[::-1])
    every = max(1, across // (REDUCED * SIDE_PX))
    down, right = (slice(side.start * part.step, side.stop * part.step, every) for side in window)
    # Dilated as small as it is: the time goes by the mask's side to the fourth.
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * round(margin * part.step * scale) + 1,) * 2)
    near = cv2.dilate(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), disc)
    how = cv2.INTER_AREA if scale * every < 1 else cv2.INTER_CUBIC
    read = (gray(frames.read(down, [i], columns=right, subtract_ambient=False)[0]) for i in range(len(frames)))
    small = [cv2.resize(one, size, interpolation=how) for one in read]
    units = near * np.stack([orientation(one, 0.02 * float(np.quantile(one, 0.99)) + 1e-6) for one in small])
    places = static_tiles(units, TILE_PX, MOST_TILES)
    if not len(places):
        return None
    planes = np.stack([votes(units[:, y : y + TILE_PX, x : x + TILE_PX]) for x, y in places])
    found = find_step(planes[:, len(frames) :], places + (TILE_PX - np.array(near.shape[::-1])) / 2, GAIN)
    return found and replace(found, shift_px=found.shift_px / scale)
