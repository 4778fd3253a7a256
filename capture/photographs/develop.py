"""One photograph to one frame of the store: read, check, take off the dark frame, divide by the flat field."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts, facts_of, reduced
from capture.photographs.images import read_image
from capture.photographs.kept import Kept
from capture.photographs.photograph import SATURATION, Photograph, half_floats
from capture.photographs.raw import read_raw
from capture.session.globs import kind_of
from capture.session.session_types import Encoding
from scene.current import file_digest
from scene.errors import CaptureError
from scene.frames import PEDESTAL, WHITE, encode
from scene.frames import decode as linear_of


@dataclass(frozen=True)
class DevelopRecipe:
    """What is done alike to every photograph of a session.

    Parameters
    ----------
    like : Path
        The photograph whose size and kind all others must have.
    shape : (H, W) or None
        Size to expect; None: any.
    dtype : str
        "uint16" or "float16".
    sensor_range : float or None
        DN from black to white of the session's first RAW file, the power of two of its first float file.
    dark, flat : Path or None
        (H, W, 3) float32 .npy: subtracted; divided by.
    saturation : float
        Linear value from which a sample is clipped, where the sensor is known to end below the files' white.
    kept : Kept or None
        Photographs that were decoded before.
    is_first : bool
        It is the session's first photograph, which tells `sensor_range`.
    """

    encoding: Encoding
    half: bool
    like: Path
    shape: tuple[int, int] | None = None
    dtype: str = "uint16"
    sensor_range: float | None = None
    dark: Path | None = None
    flat: Path | None = None
    saturation: float = np.inf
    kept: Kept | None = None
    is_first: bool = False


def read_photograph(file: Path, recipe: DevelopRecipe) -> Photograph:
    """Read one file, uncorrected; CaptureError if unreadable, or of another size or kind than `recipe.like`."""
    known = None
    if recipe.kept and not recipe.is_first:
        known = recipe.kept.load(file_digest(file), sensor_range=recipe.sensor_range)
    if known is not None:
        photograph = known
    elif kind_of(file) == "raw":
        photograph = read_raw(file, sensor_range=recipe.sensor_range, half=recipe.half)
    else:
        scale = None if recipe.is_first else recipe.sensor_range or 1.0
        photograph = read_image(file, recipe.encoding, half=recipe.half, sensor_range=scale)
    height, width, _ = photograph.codes.shape
    if min(height, width) < 2:
        raise CaptureError(f"{file}: is {width} x {height} px{' after halving' if recipe.half else ''}, no photograph.")
    if recipe.shape and (height, width) != recipe.shape:
        raise CaptureError(
            f"{file}: is {width} x {height} px, {recipe.like.name} is {recipe.shape[1]} x {recipe.shape[0]}. "
            "One session has one size: reshoot, or list the odd one under frames.skip."
        )
    if recipe.shape and photograph.codes.dtype != recipe.dtype:
        raise CaptureError(
            f"{file}: holds {'float' if photograph.codes.dtype == np.float16 else 'integer'} pixels, "
            f"{recipe.like.name} does not. Export all frames alike."
        )
    return photograph


def develop(recipe: DevelopRecipe, out: Path, job: tuple[Path, int, Photograph | None]) -> FrameFacts:
    """Decode a photograph into the codes' file `out`; doing it twice gives the same file.

    `job`: its file, how many bytes after the start of `out` its place is, and the photograph, where it was read before.
    """
    file, offset, photograph = job
    photograph = photograph or read_photograph(file, recipe)
    codes = photograph.codes
    # Where the sensor ends shows only before each pixel is divided by a number of its own.
    facts = facts_of(codes, white=photograph.white, is_mosaic=photograph.is_mosaic)
    if recipe.dark or recipe.flat:
        limit = min(recipe.saturation, SATURATION * photograph.white)
        dark, flat = (path and np.load(path, mmap_mode="r") for path in (recipe.dark, recipe.flat))
        codes = corrected(codes, dark, flat, limit)
        facts = replace(facts, small=reduced(codes))
    # Written, not mapped: on a network's file system others see what was written when the file is closed.
    with open(out, "r+b") as place:
        place.seek(offset)
        place.write(np.ascontiguousarray(codes).data)
    return facts


def corrected(codes: NDArray, dark: NDArray | None, flat: NDArray | None, saturation: float) -> NDArray:
    """Return codes of (linear - dark) / flat; what was clipped, from `saturation` on, stays as it is.

    So a clipped sample stays one, and since a flat field only lowers values (see `flat_field`), no other becomes one.
    """
    limit = round(saturation * (WHITE - PEDESTAL)) + PEDESTAL if codes.dtype == np.uint16 else saturation
    out = np.zeros_like(codes)
    for start in range(0, len(codes), 256):
        rows = slice(start, start + 256)
        linear = linear_of(codes[rows])
        if dark is not None:
            linear -= dark[rows]
        if flat is not None:
            linear /= flat[rows]
        out[rows] = np.where(codes[rows] >= limit, codes[rows], recoded(linear, codes.dtype))
    return out


def recoded(linear: NDArray, dtype: np.dtype) -> NDArray:
    """Return codes of linear values in the stack's own type."""
    return encode(linear) if dtype == np.uint16 else half_floats(linear)


def mean_photograph(
    files: Sequence[Path], recipe: DevelopRecipe, done: Callable[[], None], gain: Sequence[float] | None = None
) -> NDArray[np.float32]:
    """Return the mean (H, W, 3) of photographs, linear float32, each times its gain, uncorrected; `done` after each."""
    total = np.zeros(0, np.float32)
    for file, factor in zip(files, gain or [1.0] * len(files), strict=True):
        linear = linear_of(read_photograph(file, recipe).codes)
        linear *= np.float32(factor / len(files))
        total = np.add(total, linear, out=total) if total.size else linear
        done()
    return total


def flat_field(mean: NDArray[np.float32], dark: NDArray | None, name: str) -> NDArray[np.float32]:
    """Return the divisor that evens out lens and sensor: the flat frame less dark, each channel by its own mean.

    All of it is scaled so that its darkest place (the 0.1 % quantile) is 1. A divisor below 1 would lift good samples
    above white, where neither a code nor `Frames.saturation` could tell them from clipped ones. CaptureError for a
    flat frame that is too dark somewhere, or clipped.
    """
    flat = mean if dark is None else mean - dark
    level = flat.mean(axis=(0, 1))
    relative = flat / level
    # By quantiles: one dead or hot pixel is no reason to refuse.
    low = float(np.quantile(relative[::4, ::4], 0.001))
    clipped = float(np.mean(mean >= 0.98))
    if level.min() < 0.02 or low < 0.05:
        raise CaptureError(
            f"frames.flat: {name} is too dark to divide by (channel means {np.round(level, 4).tolist()} of white, "
            f"darkest places {low:.3f} of the mean). Photograph an evenly lit white surface, brighter."
        )
    if clipped > 0.001:
        raise CaptureError(f"frames.flat: {name} is overexposed ({clipped:.1%} of it is clipped). Shoot it darker.")
    return (np.maximum(relative, 0.02) / low).astype(np.float32)
