"""Files written whole or not at all.

A file is written under a temporary name beside its place and renamed, so that a killed run leaves no half file.
"""

import contextlib
import errno
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.output_folder import record_for
from scene.record import temporary_name


@contextlib.contextmanager
def write_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a binary file that appears at `path` only when the block ends well.

    Raises
    ------
    SceneError
        The disk is full, or the place cannot be written.
    """
    with in_place(path) as temporary, open(temporary, "wb") as file:
        yield file


@contextlib.contextmanager
def create_array(path: Path, shape: tuple[int, ...], dtype: Any) -> Iterator[np.memmap]:
    """Make a memory-mapped .npy that appears at `path` only when the block ends well.

    The disk's blocks are reserved first: a memory map on a full disk would end the process with SIGBUS.
    """
    with in_place(path) as temporary:
        array = np.lib.format.open_memmap(temporary, mode="w+", dtype=dtype, shape=shape)
        with open(temporary, "r+b") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        yield array
        array.flush()
        del array


@contextlib.contextmanager
def in_place(path: Path, source: Path | None = None) -> Iterator[Path]:
    """Give the name to write under, of the same suffix; put it at `path` when the block ends well, else remove it.

    In an output folder that is held (`scene.record`) only files that rgbn wrote are written over. `source`: what is
    finished already, to be put there; it is not removed.
    """
    record, temporary = record_for(path), source
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if record is not None:
            record.check_free(path)
            temporary = temporary or record.temporary(path)
        temporary = temporary or path.with_name(temporary_name(path))
        yield temporary
        (os.replace if record is None else record.put)(temporary, path)
    except OSError as error:
        message = _message(path, temporary, error)
        if message is None:
            raise
        raise SceneError(message) from error
    finally:
        if temporary is not None and source is None:
            with contextlib.suppress(OSError):
                temporary.unlink()


def move(source: Path, path: Path) -> None:
    """Move a finished file or folder, of the same file system, to its place; it counts as written there.

    A folder is moved at once where nothing is, else file by file.

    Raises
    ------
    SceneError
        As `write_whole`; or there is a file that rgbn did not write.
    """
    if source.is_dir() and os.path.lexists(path):
        for file in sorted(source.rglob("*")):
            if file.is_file():
                move(file, path / file.relative_to(source))
        shutil.rmtree(source)
        return
    with in_place(path, source):
        pass


def remove(path: Path) -> None:
    """Remove a file that rgbn wrote, if it is there.

    Raises
    ------
    SceneError
        In an output folder that is held: rgbn did not write it, or it was changed since.
    """
    record = record_for(path)
    if record is None:
        path.unlink(missing_ok=True)
    else:
        record.remove(path)


def _message(path: Path, temporary: Path | None, error: OSError) -> str | None:
    """Return what an error says of this place; None where the block failed to read something elsewhere."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{path}: the disk is full ({error.strerror}). Free some space and run again; what is done is kept."
    here = {path, temporary, *path.parents, *(temporary.parents if temporary else ())}
    named = [Path(name) for name in (error.filename, error.filename2) if isinstance(name, str)]
    if not (here & set(named)) and not (error.errno in (errno.EFBIG, errno.EIO) and not named):
        return None
    if isinstance(error, FileNotFoundError):
        return f"{path}: its folder was removed while rgbn was writing there. Run the same command again."
    return f"{path}: cannot be written ({error.strerror}). Choose another folder with --out."


def write_json(path: Path, data: Any) -> None:
    """Write arrays, paths, dataclasses and plain values as JSON; NaN and infinity become null."""
    with write_whole(path) as file:
        file.write(json.dumps(plain(data), indent=1, allow_nan=False).encode() + b"\n")


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text."""
    with write_whole(path) as file:
        file.write(text.encode())


def write_npy(path: Path, array: NDArray) -> None:
    """Write a .npy file; never pickled objects."""
    array = np.ascontiguousarray(array).reshape(np.shape(array))
    if array.dtype.hasobject:
        raise ValueError(f"{path}: {array.dtype} holds objects")
    with write_whole(path) as file:
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(array))
        # `write_array` hands the file to C: of a full disk it says nothing but how many bytes were written.
        file.write(array.reshape(-1).view(np.uint8).data)


def write_png(path: Path, image: NDArray) -> None:
    """Write an image; see `encoded`."""
    with write_whole(path) as file:
        file.write(encoded(image))


def encoded(image: NDArray, ending: str = ".png", *options: int) -> bytes:
    """Return an image, uint8 or uint16, (H, W) or (H, W, 3) RGB, as OpenCV writes it; bool becomes 0 and 255."""
    import cv2

    image = np.asarray(image)
    if image.dtype == bool:
        image = image.astype(np.uint8) * 255
    done, buffer = cv2.imencode(ending, image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1]), options)
    if not done:
        raise ValueError(f"{image.dtype} {image.shape} is not an image")
    return buffer.tobytes()


def plain(value: Any) -> Any:
    """Turn arrays, paths and dataclass values into JSON; NaN and infinity become null."""
    from pydantic import TypeAdapter

    return TypeAdapter(Any).dump_python(value, mode="json", fallback=lambda array: array.tolist())
