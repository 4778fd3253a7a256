"""Did a ball or the object move, and all else stand still? By a mirror's edges, by the shading of what is matte."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.audit.movement import Step, find_step, step_votes, tiles_of_either_half
from capture.audit.shading_step import FEWEST_FRAMES, FEWEST_PX, MattePart
from capture.audit.static_edges import orientation
from scene.camera import Camera
from scene.frames import Frames, decode, gray
from scene.lights import Lights
from scene.reading import listed
from scene.spheres import Sphere

SIDE_PX, TILE_PX = 128, 48
"""Longer side of a part's picture; of its tiles."""
ENLARGED, REDUCED = 2, 4
"""How often larger a small part's picture is at most; so many by so many pixels of a large part are one of its."""
MARGIN = 0.3
"""Of a part's size, around it, that is looked at: a step of a quarter of its size stays inside."""
GAIN = 0.4
"""By how much more of the votes a step must have than standing still. Sound real captures stay under 0.3, smooth
rendered domes just under 0.4; balls and textured objects that move by 3 % of their size reach 0.4 to 0.95."""
WITHIN_PX = 3
"""So far within a matte part's outline, in its picture, it is looked at."""
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
    is_mirror : bool
        It has no shading of its own.
    camera : Camera or None
        Of `mask`.
    z_mm : float or None
        How far it stands, camera frame; None: as far as the point that the lights are told for.
    """

    name: str
    mask: NDArray[np.bool_]
    step: int = 1
    is_mirror: bool = False
    camera: Camera | None = None
    z_mm: float | None = None

    def toward(self, lights: Lights, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the light vectors (F, N, 3) at pixels (N, 2) of `mask`, times the intensities."""
        z_mm = lights.reference_point_mm[2] if self.z_mm is None else self.z_mm
        points = np.zeros((len(places), 3)) if self.camera is None else self.camera.points_at_depth(places, z_mm)
        return lights.toward(points) * lights.intensities.mean(1)[:, None, None]


def parts_of(spheres: Sequence[Sphere], camera: Camera, mask: NDArray[np.bool_] | None, step: int = 1) -> list[Part]:
    """Return the balls that stand beside the object, and the object by its mask (h, w), as parts.

    A pixel of `camera` and `mask` is `step` of the frames' wide.
    """
    named = [(f"the {ball.kind} ball at ({ball.center_px[0] * step:.0f}, {ball.center_px[1] * step:.0f}) px", ball)
             for ball in spheres if not ball.apart]  # fmt: skip
    parts = []
    for name, ball in named:
        z_mm = float(ball.center_mm(camera)[2]) if ball.diameter_mm and not camera.is_orthographic else None
        parts.append(Part(name, ball.mask(camera), step, ball.kind == "chrome", camera, z_mm))
    return parts if mask is None else [*parts, Part("the object", mask, step, camera=camera)]


def part_warnings(frames: Frames, parts: Sequence[Part], lights: Lights | None = None) -> list[str]:
    """Name the parts that lie elsewhere from some frame on; those that moved together in one warning.

    All together moved with the picture: that is `capture.audit.movement`'s to say. `lights`: of the frames, or of some
    of them, where they are known.
    """
    if len(frames) < FEWEST_FRAMES:
        return []
    groups: list[tuple[Step, list[str]]] = []
    for part in parts:
        step = part_step(frames, part, lights)
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


def part_step(frames: Frames, part: Part, lights: Lights | None = None) -> Step | None:
    """Return from which frame on a part lies elsewhere, in pixels of the frames; None where it stands still.

    A mirror tells by its edges, as `capture.audit.movement`: what lies around it has no vote. What is matte tells by
    its shading, see `capture.audit.shading_step`, once the lights are known; or by edges that its shading bears out:
    where a flash is carried around, shadows stand long enough to look like edges.
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
    down, right = (slice(side.start * part.step, side.stop * part.step, every) for side in window)
    mask = cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST)

    def pictures(which: Sequence[int]) -> NDArray[np.float32]:
        read = (frames.read(down, [i], columns=right, subtract_ambient=False)[0] for i in which)
        return np.array([_resized(gray(pixels), size) for pixels in read])

    # Dilated as small as it is: the time goes by the mask's side to the fourth.
    near = cv2.dilate(mask, _disc(round(margin * part.step * scale)))
    if part.is_mirror:
        found = _edges_step(pictures(range(len(frames))), near)
    else:
        numbers = {} if lights is None else {name: i for i, name in enumerate(lights.names)}
        known = [i for i, name in enumerate(frames.names) if name in numbers]
        inside = cv2.erode(mask, _disc(WITHIN_PX))
        is_enough = len(known) >= FEWEST_FRAMES and np.count_nonzero(inside) >= FEWEST_PX**2
        if lights is None or lights.is_unknown or not is_enough:
            return None
        places = (np.argwhere(inside)[:, ::-1] + 0.5) / (scale * part.step) - 0.5 + [window[1].start, window[0].start]
        toward = part.toward(lights.only([numbers[frames.names[i]] for i in known]), places)
        lit = pictures(known)
        unlit = 0 if frames.ambient is None else _resized(gray(decode(frames.ambient[down, right])), size)
        matte = MattePart(lit - unlit, inside > 0, toward)
        found = matte.step() or matte.confirmed(_edges_step(lit, inside)) or matte.agreed(_edges_step(lit, near))
        found = found and replace(found, first=known[found.first])
    return found and replace(found, shift_px=found.shift_px / scale)


def _edges_step(pictures: NDArray[np.float32], near: NDArray) -> Step | None:
    """Return the step that the edges of pictures (F, h, w) show, where `near` (h, w) is 1; in their pixels."""
    units = near * np.stack([orientation(one, 0.02 * float(np.quantile(one, 0.99)) + 1e-6) for one in pictures])
    corners = tiles_of_either_half(units, TILE_PX)
    if not corners:
        return None
    votes = [step_votes(units[:, y : y + TILE_PX, x : x + TILE_PX]) for y, x in corners]
    return find_step(votes, np.array(corners)[:, ::-1] + (TILE_PX - np.array(near.shape[::-1])) / 2, GAIN)


def _disc(radius: int) -> Any:
    import cv2

    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2)


def _resized(picture: NDArray[np.float32], size: tuple[int, ...]) -> NDArray[np.float32]:
    """Return a picture of size (width, height)."""
    import cv2

    shrinks = size[0] < picture.shape[1]
    how = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=how), np.float32)
