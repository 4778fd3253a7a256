"""Files written whole or not at all.

A file is written under a temporary name beside its place and renamed, so that a killed run leaves no half file.
"""

import contextlib
import errno
import json
import os
import re
from collections.abc import Iterator
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError


@contextlib.contextmanager
def write_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a binary file that appears at `path` only when the block ends well.

    Raises
    ------
    SceneError
        The disk is full, or the place cannot be written.
    """
    with _put_in_place(path) as temporary, open(temporary, "wb") as file:
        yield file


@contextlib.contextmanager
def create_array(path: Path, shape: tuple[int, ...], dtype: Any) -> Iterator[np.memmap]:
    """Make a memory-mapped .npy that appears at `path` only when the block ends well.

    The disk's blocks are reserved first: a memory map on a full disk would end the process with SIGBUS.
    """
    with _put_in_place(path) as temporary:
        array = np.lib.format.open_memmap(temporary, mode="w+", dtype=dtype, shape=shape)
        with open(temporary, "r+b") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        yield array
        array.flush()
        del array


@contextlib.contextmanager
def _put_in_place(path: Path) -> Iterator[Path]:
    """Give the name to write under; rename it to `path` when the block ends well, remove it otherwise."""
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise _disk_error(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


TEMPORARY = re.compile(r"^\..+\.\d+\.tmp$")
"""Names of unfinished files: a dot, the name, the writer's process number, .tmp."""


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


def _disk_error(path: Path, error: OSError) -> Exception:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return SceneError(
            f"{path}: the disk is full ({error.strerror}). Free some space and run again; what is done is kept."
        )
    # Only what concerns this place: the block may also have failed to read something elsewhere.
    is_here = error.filename is not None and Path(error.filename) in {path, _temporary(path), *path.parents}
    refused = (errno.EACCES, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.EPERM, errno.EEXIST)
    if is_here and error.errno in refused:
        return SceneError(f"{path}: cannot be written ({error.strerror}). Choose another folder with --out.")
    return error


def write_json(path: Path, data: Any) -> None:
    """Write arrays, paths, dataclasses and plain values as JSON; NaN and infinity become null."""
    with write_whole(path) as file:
        file.write(json.dumps(_plain(data), indent=1, allow_nan=False).encode() + b"\n")


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text."""
    with write_whole(path) as file:
        file.write(text.encode())


def write_npy(path: Path, array: NDArray) -> None:
    """Write a .npy file; never pickled objects."""
    with write_whole(path) as file:
        np.lib.format.write_array(file, np.asarray(array), allow_pickle=False)


def write_png(path: Path, image: NDArray) -> None:
    """Write an image, uint8 or uint16, (H, W) or (H, W, 3) RGB; bool becomes 0 and 255."""
    import cv2

    image = np.asarray(image)
    if image.dtype == bool:
        image = image.astype(np.uint8) * 255
    if image.ndim == 3:
        image = image[..., ::-1]
    done, buffer = cv2.imencode(".png", image)
    if not done:
        raise ValueError(f"{path}: {image.dtype} {image.shape} is not an image")
    with write_whole(path) as file:
        file.write(buffer.tobytes())


def _plain(value: Any) -> Any:
    """Turn arrays, paths and dataclass values into JSON; NaN and infinity become null."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value
