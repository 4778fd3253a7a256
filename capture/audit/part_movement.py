"""Did a ball or the object move, and all else stand still? Each part's static edges, frames before against after."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.audit.movement import Step, find_step, step_votes, tiles_of_either_half
from capture.audit.static_edges import orientation
from scene.camera import Camera
from scene.frames import Frames, gray
from scene.reading import listed
from scene.spheres import Sphere

SIDE_PX, TILE_PX = 128, 48
"""Longer side of a part's picture; of its tiles."""
ENLARGED, REDUCED = 2, 4
"""How often larger a small part's picture is at most; so many by so many pixels of a large part are one of its."""
MARGIN = 0.3
"""Of a part's size, around it, that is looked at: a step of a quarter of its size stays inside."""
FEWEST_FRAMES = 8
GAIN = 0.4
"""By how much more of the votes a step must have than standing still. Sound real captures stay under 0.3, smooth
rendered domes just under 0.4; balls and textured objects that move by 3 % of their size reach 0.4 to 0.95."""
ALIKE_PX = 2.0
"""Parts that move by the same step, to so much, moved together."""


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


def parts_of(spheres: Sequence[Sphere], camera: Camera, mask: NDArray[np.bool_] | None, step: int = 1) -> list[Part]:
    """Return the balls that stand beside the object, and the object by its mask (h, w), as parts.

    A pixel of `camera` and `mask` is `step` of the frames' wide.
    """
    named = [(f"the {ball.kind} ball at ({ball.center_px[0] * step:.0f}, {ball.center_px[1] * step:.0f}) px", ball)
             for ball in spheres if not ball.apart]  # fmt: skip
    parts = [Part(name, ball.mask(camera), step) for name, ball in named]
    return parts if mask is None else [*parts, Part("the object", mask, step)]


def part_warnings(frames: Frames, parts: Sequence[Part]) -> list[str]:
    """Name the parts that lie elsewhere from some frame on; those that moved together in one warning.

    All together moved with the picture: that is `capture.audit.movement`'s to say.
    """
    if len(frames) < FEWEST_FRAMES:
        return []
    groups: list[tuple[Step, list[str]]] = []
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


def _told(names: tuple[str, ...], step: Step, parts: list[str]) -> str:
    right, down = step.shift_px
    them, lie = ("it", "lies") if len(parts) == 1 else ("they", "lie")
    return (
        f"{names[step.first]}: from here on {listed(parts)} {lie} "
        f"{np.hypot(right, down):.1f} px off where {them} lay before (right {right:+.1f}, down {down:+.1f}): {them} "
        f"moved after {names[step.first - 1]}. Reshoot, or list the frames before or after under frames.skip."
    )


def part_step(frames: Frames, part: Part) -> Step | None:
    """Return from which frame on a part lies elsewhere, in pixels of the frames; None where it stands still.

    As `capture.audit.movement`, on the part alone: what lies around it has no vote.
    """
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
    full = tuple(slice(side.start * part.step, side.stop * part.step, every) for side in window)
    pictures = [_picture(frames, i, full, size) for i in range(len(frames))]
    units = np.stack([orientation(one, 0.02 * float(np.quantile(one, 0.99)) + 1e-6) for one in pictures])
    # Dilated as small as it is: the time goes by the mask's side to the fourth.
    reach = round(margin * part.step * scale)
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1,) * 2)
    units = units * cv2.dilate(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), around)
    corners = tiles_of_either_half(units, TILE_PX)
    if not corners:
        return None
    votes = [step_votes(units[:, y : y + TILE_PX, x : x + TILE_PX]) for y, x in corners]
    found = find_step(votes, np.array(corners)[:, ::-1] + TILE_PX / 2 - np.array(size) / 2, GAIN)
    return None if found is None else Step(found.first, found.shift_px / scale, found.turn_deg)


def _picture(frames: Frames, index: int, window: tuple[slice, ...], size: tuple[int, ...]) -> NDArray[np.float32]:
    """Return a window (rows, columns) of one frame, gray, resized to (width, height)."""
    import cv2

    rows, columns = window
    pixels = gray(frames.read(rows, [index], columns=columns, subtract_ambient=False)[0])
    shrinks = size[0] < pixels.shape[1]
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
