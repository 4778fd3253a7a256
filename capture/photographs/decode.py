"""A session's photographs to `Frames`: decoded once, in parallel, into a memory-mapped store."""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.audit.audit import at_a_glance, movement_warnings
from capture.audit.camera_settings import exposure_gains
from capture.audit.encoding_check import encoding_warnings
from capture.audit.frame_facts import reduced, saturation_of
from capture.camera.exif import Exif, read_exif
from capture.camera.session_camera import fitted
from capture.photographs.develop import DevelopRecipe, develop, flat_field, mean_photograph, read_photograph, recoded
from capture.photographs.kept import Kept, kept_folder
from capture.session.session_types import CaptureSession
from scene.camera import Camera
from scene.errors import CaptureError
from scene.fan_out import fan_out
from scene.files import create_array, remove, write_npy
from scene.frames import Frames
from scene.store import Store

Progress = Callable[[int, int], None]

DECODING_BYTES = 1 << 30
"""Of all photographs that are decoded at a time: on a machine of many cores memory, not they, decides how many."""


@dataclass(frozen=True)
class CaptureReport:
    """What the photographs turned out to be.

    Parameters
    ----------
    frames_table : list of dict
        One row a frame, for summary and report: name; brightness, the mean linear value at the reference exposure,
        ambient not subtracted; saturated_share of its pixels, small highlights included; gain, which brings it to the
        reference exposure; what its EXIF says.
    warnings : tuple of str
        Suspicious but usable.
    """

    exif: tuple[Exif, ...]
    frames_table: list[dict[str, Any]]
    warnings: tuple[str, ...] = ()


def decode(
    session: CaptureSession, store: Store, *, executor: Executor | None = None, progress: Progress | None = None
) -> tuple[Frames, CaptureReport]:
    """Decode a session into `frames/` of its output folder, and audit it.

    Parameters
    ----------
    store : Store
        Gets frames/codes.npy, frames/ambient.npy and, last, frames/frames.json: all of them or none.
    executor : Executor or None
        Where frames are decoded; None: a thread a core (LibRaw and OpenCV let go of the interpreter). Any
        executor will do whose workers see the same files.
    progress : callable or None
        Called with (done, total) files.

    Returns
    -------
    frames : Frames
        Memory-mapped from the store.
    report : CaptureReport

    Raises
    ------
    CaptureError
        A photograph is corrupt, missing, of another size or kind, or its flash did not fire.
    SessionError
        [camera] is of another size than the first photograph; told before the others are decoded.
    """
    exif, ambient_exif = ([read_exif(path) for path in files] for files in (session.flash, session.ambient))
    _, ambient_gain = exposure_gains(exif, ambient_exif)
    count, total = itertools.count(1), sum(map(len, (session.flash, session.ambient, session.dark, session.flat)))

    def done() -> None:
        if progress:
            progress(next(count), total)

    scratch = {key: store.path("frames", f".{key}.npy.{os.getpid()}.tmp") for key in ("dark", "flat")}
    try:
        kept = Kept(kept_folder(store.folder), session.encoding, session.half)
        recipe = DevelopRecipe(
            session.encoding, session.half, session.flash[0], kept=kept if kept.folder.is_dir() else None
        )
        first = read_photograph(session.flash[0], replace(recipe, is_first=True))
        height, width, _ = first.codes.shape
        if isinstance(session.camera, Camera):
            # Now, and not after minutes of decoding.
            fitted(session.camera, session, width, height)
        recipe = replace(recipe, shape=(height, width), dtype=str(first.codes.dtype), sensor_range=first.sensor_range)
        recipe = _with_corrections(session, recipe, scratch, done)
        ambient = _ambient(session, recipe, ambient_gain, done)
        # From here on an older header would speak of frames that are gone.
        remove(store.path("frames", "frames.json"))
        shape = (len(session.flash), height, width, 3)
        with create_array(store.path("frames", "codes.npy"), shape, first.codes.dtype) as codes:
            frame_bytes = codes.nbytes // len(codes)
            out = Path(str(codes.filename))
            jobs = [
                (path, codes.offset + i * frame_bytes, None if i else first) for i, path in enumerate(session.flash)
            ]
            # A unit holds its file, its codes, and the decoder's own copies.
            threads = max(1, DECODING_BYTES // (2 * frame_bytes))
            facts = fan_out(partial(develop, recipe, out), jobs, executor=executor, done=done, threads=threads)
            facts, saturation, told = saturation_of(facts, first.codes.dtype)
            if told and (recipe.dark or recipe.flat):
                # Divided by the flat field, what clips at that ceiling is not to be found any more: once more.
                total += len(jobs)
                again = partial(develop, replace(recipe, saturation=saturation), out)
                facts = fan_out(again, jobs, executor=executor, done=done, threads=threads)
            is_mosaic = any(fact.is_mosaic for fact in facts)
            small = None if ambient is None else reduced(ambient)
            gain, missing, found = at_a_glance(session, exif, ambient_exif, facts, small)
            if missing:
                raise CaptureError("\n".join(missing))
            frames = Frames(session.names, codes, gain, ambient, saturation, is_mosaic)
            warnings = (*told, *found, *movement_warnings(frames, facts), *encoding_warnings(session, frames))
            del frames, codes
        saved = np.load(store.path("frames", "codes.npy"), mmap_mode="r")
        store.save_frames_header(Frames(session.names, saved, gain, ambient, saturation, is_mosaic))
    finally:
        for path in scratch.values():
            remove(path)
    table = [
        {"name": name, "brightness": float(fact.small.mean()) * factor, "saturated_share": fact.clipped_share}
        | {"gain": factor}
        | {key: value for key, value in asdict(written).items() if value is not None}
        for name, fact, factor, written in zip(session.names, facts, gain.tolist(), exif, strict=True)
    ]
    return store.load_frames(), CaptureReport(tuple(exif), table, warnings)


def _with_corrections(
    session: CaptureSession, recipe: DevelopRecipe, scratch: dict[str, Path], done: Callable[[], None]
) -> DevelopRecipe:
    """Return the recipe with the dark frame and the flat field, if there are any, as files for every worker."""
    dark = None
    if session.dark:
        dark = mean_photograph(session.dark, recipe, done)
        write_npy(scratch["dark"], dark)
    if session.flat:
        flat = mean_photograph(session.flat, recipe, done)
        write_npy(scratch["flat"], flat_field(flat, dark, session.flat[0].name))
    return replace(recipe, **{key: path for key, path in scratch.items() if getattr(session, key)})


def _ambient(
    session: CaptureSession, recipe: DevelopRecipe, gain: list[float], done: Callable[[], None]
) -> NDArray | None:
    """Return the mean ambient frame as codes at the reference exposure, corrected as the flash frames are."""
    if not session.ambient:
        return None
    mean = mean_photograph(session.ambient, recipe, done, gain)
    if recipe.dark:
        # Each ambient frame holds the dark frame once, before its gain.
        mean -= np.load(recipe.dark, mmap_mode="r") * np.float32(np.mean(gain))
    if recipe.flat:
        mean /= np.load(recipe.flat, mmap_mode="r")
    return recoded(mean, np.dtype(recipe.dtype))
