"""What the audit needs to know of each frame, gathered by whoever decodes it while it is in memory."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.photographs.photograph import BIN, CLIPPED_CODE, FLOAT16_MAX, SATURATION, piles
from scene.frames import PEDESTAL, WHITE, gray, shrunk

SMALL_PX = 768
"""Longer side of the reduced picture, at most."""


@dataclass(frozen=True)
class FrameFacts:
    """One frame in short; linear, before gain.

    Parameters
    ----------
    small : (h, w) float32
        Mean of the channels, averaged over boxes, at most SMALL_PX long.
    clipped_share : float
        Share of pixels with a clipped channel.
    blown_share : float
        The part of it in spots wider than a chrome ball's highlight (1 % of the picture's width).
    tops : list of int
        Bins of codes in which the channels' greatest values pile up; none of float frames.
    white : float
        Linear value at which this file's header says that the sensor clips; of floating point, see
        `capture.photographs.photograph.clip_level`.
    """

    small: NDArray[np.float32]
    clipped_share: float
    blown_share: float
    tops: list[int]
    white: float = 1.0
    is_mosaic: bool = False


def facts_of(codes: NDArray, *, white: float = 1.0, is_mosaic: bool = False) -> FrameFacts:
    """Return the facts of one frame's codes (H, W, 3)."""
    clipped_share, blown_share = _clipped(codes, white)
    tops = piles(codes) if codes.dtype == np.uint16 else []
    return FrameFacts(reduced(codes), clipped_share, blown_share, tops, white, is_mosaic)


def reduced(codes: NDArray) -> NDArray[np.float32]:
    """Return the linear mean of the channels (h, w), averaged over whole boxes of pixels."""
    return gray(shrunk(codes, max(1, min(-(-max(codes.shape[:2]) // SMALL_PX), *codes.shape[:2]))))


def _clipped(codes: NDArray, white: float) -> tuple[float, float]:
    """Return the share of clipped pixels, and the share of those in wide spots."""
    import cv2

    if codes.dtype == np.uint16:
        least, limit = 0, min(CLIPPED_CODE, round(SATURATION * white * (WHITE - PEDESTAL)) + PEDESTAL)
    else:
        # Half floats have the order of their bits, those below 0 among the negative numbers.
        limit = int(np.float16(min(SATURATION * white, FLOAT16_MAX)).view(np.int16))
        least, codes = -(2**15), codes.view(np.int16)
    unclipped = cv2.inRange(np.ascontiguousarray(codes), (least,) * 3, (limit - 1,) * 3)
    count = codes.shape[0] * codes.shape[1] - cv2.countNonZero(unclipped)
    if not count:
        return 0.0, 0.0
    step = max(1, max(codes.shape[:2]) // SMALL_PX)
    small = 255 - cv2.resize(unclipped, None, fx=1 / step, fy=1 / step, interpolation=cv2.INTER_AREA)
    width = max(3, round(small.shape[1] * 0.01) | 1)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    wide = cv2.morphologyEx((small > 127).astype(np.uint8), cv2.MORPH_OPEN, disc)
    return count / (codes.shape[0] * codes.shape[1]), float(wide.mean())


def sensor_ceiling(facts: list[FrameFacts]) -> float | None:
    """Return the linear value below white at which the sensor clips all the same, or None.

    White levels in headers are guesses at times, 12-bit values lie in 16-bit files, and a converter may cut off
    anywhere. A ceiling shows as a pile at the top of the histogram, at the same value in several frames: what is lit
    by another flash has another highest value in each.
    """
    tops = [top for fact in facts for top in fact.tops if top >= 36 + PEDESTAL // BIN // 2]
    if not tops:
        return None
    usual = int(np.median(tops))
    agreeing = sum(abs(top - usual) <= 1 for top in tops)
    level = ((usual + 1) * BIN - PEDESTAL) / (WHITE - PEDESTAL)
    return level if agreeing >= max(2, len(tops) / 2) and level < SATURATION else None


def saturation_of(facts: list[FrameFacts], dtype: np.dtype) -> tuple[list[FrameFacts], float, tuple[str, ...]]:
    """Return the facts; `Frames.saturation`, from the files' white levels or where the sensor is seen to clip; why.

    Floating-point frames have one clip level, the highest of their own, and so get other facts. It is infinite where a
    frame is brighter: then samples pile up for another reason, as on flat faces of a rendering.
    """
    if dtype != np.uint16:
        level = max((fact.white for fact in facts if np.isfinite(fact.white)), default=np.inf)
        if any(fact.small.max() > level for fact in facts):
            level = np.inf
        unclipped = [replace(fact, clipped_share=0.0, blown_share=0.0) for fact in facts]
        others = [fact.white < SATURATION * level for fact in facts]
        facts = [clean if other else fact for fact, clean, other in zip(facts, unclipped, others, strict=True)]
        return facts, min(SATURATION * level, FLOAT16_MAX), ()
    white, ceiling = min(fact.white for fact in facts), sensor_ceiling(facts)
    if ceiling is None or ceiling >= SATURATION * white:
        return facts, SATURATION * white, ()
    told = (
        f"frames: pixels pile up at {ceiling:.4f} of the stated white level, in several frames: the sensor clips "
        "there, and samples above are treated as saturated."
    )
    return facts, SATURATION * ceiling, (told,)
