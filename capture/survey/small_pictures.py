"""The photographs of a folder decoded small, and what their light tells of their role."""

import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.photographs.develop import DevelopRecipe, read_photograph
from capture.photographs.photograph import Photograph
from capture.session.globs import kind_of
from capture.session.session_types import Encoding
from scene.errors import SceneError
from scene.fan_out import fan_out
from scene.frames import PEDESTAL, WHITE, Frames, decode, gray

LONGEST_PX = 1000
"""Of a small picture's longer side: balls of the usual size keep some 40 px of radius."""
BLACK = 0.004
"""Mean of white under which a photograph shows nothing."""
UNLIT = 0.6
"""Of the median frame's mean: an ambient frame is darker than this."""
SHOWS_NOTHING = 0.2
"""Of the brightest unlit frame's mean, under which one shows nothing beside it."""
BOX = 8
"""Pixels along a side of the boxes whose means are compared."""
FEWEST_FLASHES, FAR_BRIGHTER, OVER_ALL = 6, 1.7, 0.5
"""Of a picture in another light: how many there must be to tell it, its mean in that of the next brightest, and the
share of it that is brighter than all others. In real captures it is 2 to 7 times as bright, in 0.56 to 0.75 of it; a
flash frame is so in less than 0.02."""
DARKEST = 0.05
"""Share of a picture that is its darkest part: with a flash it lies in shadow, however strong that is."""
AS_DARK = 0.02
"""Share of its pixels that may be darker in another frame than in the ambient one: noise, movement."""


@dataclass(frozen=True)
class Small:
    """A photograph, reduced.

    Parameters
    ----------
    codes : (h, w, 3) uint16 or float16
        As `scene.frames.Frames` has them.
    width, height : int
        Of the file, full size.
    step : int
        Pixels of the file in one of `codes`, along a side.
    is_mosaic : bool
    """

    path: Path
    codes: NDArray
    width: int
    height: int
    step: int
    is_mosaic: bool

    @property
    def light(self) -> NDArray[np.float32]:
        """Mean of the channels, linear, (h, w)."""
        return gray(decode(self.codes))

    @cached_property
    def boxes(self) -> NDArray[np.float32]:
        """`light` in boxes: single pixels are noise in the dark."""
        return _reduced(self.light, BOX)


def read_small(
    files: Sequence[Path], encoding: Encoding, tell: Callable[[int, int], None] = lambda done, total: None
) -> tuple[list[Small], list[str]]:
    """Return the photographs, reduced to `LONGEST_PX`; and a sentence for each that cannot be read.

    tell: Called with how many are read, and of how many.
    """
    count, recipe = itertools.count(1), DevelopRecipe(encoding, False, files[0], is_first=True)
    with suppress(SceneError):
        first = read_photograph(files[0], recipe)
        # Superpixels are faster, and enough where there are many.
        half = max(first.codes.shape) > 2 * LONGEST_PX
        recipe = replace(recipe, half=half, sensor_range=first.sensor_range, is_first=False)

    def read(path: Path) -> Small | str:
        half = recipe.half and kind_of(path) == "raw"
        try:
            return small_of(path, read_photograph(path, replace(recipe, half=half)), full=2 if half else 1)
        except SceneError as error:
            return str(error)

    found = fan_out(read, files, done=lambda: tell(next(count), len(files)), threads=4)
    return [one for one in found if isinstance(one, Small)], [one for one in found if isinstance(one, str)]


def small_of(path: Path, photograph: Photograph, *, full: int = 1) -> Small:
    """Return a photograph reduced; `full`: pixels of the file in one of its own, along a side."""
    height, width, _ = photograph.codes.shape
    step = max(1, -(-max(height, width) // LONGEST_PX))
    return Small(path, _reduced(photograph.codes, step), width * full, height * full, step * full, photograph.is_mosaic)


def _reduced(codes: NDArray, step: int) -> NDArray:
    """Return means of whole boxes, in codes or light."""
    import cv2

    height, width = codes.shape[0] // step, codes.shape[1] // step
    whole = codes[: height * step, : width * step]
    whole = whole if codes.dtype == np.uint16 else whole.astype(np.float32)
    return cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA).astype(codes.dtype)


def of_one_size(pictures: list[Small]) -> tuple[list[Small], list[Small]]:
    """Return the pictures of the commonest size, and the others."""
    ((size, _),) = Counter((one.width, one.height) for one in pictures).most_common(1)
    same = [one for one in pictures if (one.width, one.height) == size]
    return same, [one for one in pictures if one not in same]


def by_light(pictures: list[Small]) -> dict[str, list[Small]]:
    """Sort photographs of one scene whose names tell nothing: flash, ambient, dark.

    A flash adds light: nowhere is a flash frame darker than the ambient one. An ambient frame is darker than most, and
    no other frame is darker than it anywhere. A dark frame shows nothing at all.
    """
    light = [one.boxes for one in pictures]
    mean = np.array([float(one.mean()) for one in light])
    usual = float(np.median(mean))
    unlit = [n for n in np.argsort(mean) if mean[n] < UNLIT * usual]
    unlit = [n for n in unlit if _is_unlit(light[n], [light[m] for m in range(len(light)) if m not in unlit], usual)]
    # Two kinds of unlit frames: what shows nothing beside what shows the room.
    room = max((mean[n] for n in unlit), default=0.0)
    dark = [n for n in unlit if mean[n] < min(BLACK, SHOWS_NOTHING * room)]
    found = {"dark": dark, "ambient": [n for n in unlit if n not in dark]}
    found["flash"] = [n for n in range(len(light)) if n not in unlit]
    return {role: [pictures[n] for n in sorted(places)] for role, places in found.items() if places}


def _is_unlit(own: NDArray, others: list[NDArray], usual: float) -> bool:
    """Whether no other frame is darker anywhere, but for noise, and every one much brighter somewhere."""
    noise = 0.005 * usual + 0.1 * own
    not_darker = all(np.mean(other < own - noise) < AS_DARK for other in others)
    return not_darker and all(np.quantile(other - own, 0.99) > 2 * max(np.quantile(own, 0.5), 1e-4) for other in others)


def otherwise_lit(flash: list[Small]) -> Small | None:
    """Return the picture that is lit by more than a flash, as by the room's lamps; None where none is.

    It is brighter than every other one in most of the picture, and nothing in it lies in shadow.
    """
    if len(flash) < FEWEST_FLASHES:
        return None
    light = np.stack([one.boxes for one in flash])
    first, second = np.argsort(light.mean((1, 2)))[:-3:-1]
    others = np.delete(light, first, axis=0)
    is_brighter = light[first].mean() > FAR_BRIGHTER * light[second].mean()
    is_over = np.mean(light[first] > others.max(axis=0)) > OVER_ALL
    darkest, usual = np.quantile(light[first], DARKEST), np.quantile(np.median(others, axis=0), DARKEST)
    return flash[first] if is_brighter and is_over and darkest > FAR_BRIGHTER * usual else None


def frames_of(flash: list[Small], ambient: list[Small]) -> Frames:
    """Return small pictures as frames."""
    codes = np.stack([one.codes for one in flash])
    base = np.mean([one.codes.astype(np.float32) for one in ambient], axis=0).astype(codes.dtype) if ambient else None
    # In the mean of a box a clipped sample is hidden among others.
    saturation = (0.9 * WHITE - PEDESTAL) / (WHITE - PEDESTAL) if flash[0].step > 1 else 0.98
    if codes.dtype != np.uint16:
        saturation = np.inf
    names = tuple(one.path.stem for one in flash)
    return Frames(names, codes, np.ones(len(flash)), base, saturation, flash[0].is_mosaic)
