"""What a worker of a cluster does with a unit: it makes sure that it may have it, and works."""

import hashlib
import io
import mmap
import os
import pickle
import socket
import uuid
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from cloudpickle import CloudPickler
from numpy.typing import NDArray

from scene.current import ROOT, blocks_digest, code_fingerprint, libraries
from scene.errors import ClusterError

LARGE = 1 << 16
"""Bytes; a larger array goes as a file."""
AGAIN = "What is done is kept: run the same command again."
HERE = "at this address"
_fit: set[str] = set()
"""Of runs for which this process was found fit."""


def serve(run: dict[str, Any], unit: bytes) -> Any:
    """Do a unit in this process, if it is fit for the run, and return its result.

    Parameters
    ----------
    run : dict
        id, scheduler: str. code, libraries: what `scene.current` finds where the run was started. folder: the shared
        one, or None. files: the `blocks_digest` of what a worker must see, by its path.
    unit : bytes
        What `pack` returned of (function, arguments, keyword arguments).

    """
    refuse(run)
    function, arguments, named = pickle.loads(unit)
    return function(*arguments, **named)


def refuse(run: dict[str, Any]) -> None:
    """Raise ClusterError where this process would not give what the one that started the run gives."""
    if run["id"] in _fit:
        return
    (code, found), reasons = _own(), []
    if code != run["code"]:
        reasons = [f"the code of its rgbn in {ROOT} is another: {code[:8]}, expected {run['code'][:8]}"]
    reasons += [
        f"its {name} is {found.get(name)}, expected {expected}"
        for name, expected in run["libraries"].items()
        if found.get(name) != expected
    ]
    reasons = reasons or (_unseen(run) if run["folder"] else [])
    if not reasons:
        _fit.add(run["id"])
        return
    more = [f"{len(reasons) - 3} more"] if len(reasons) > 3 else []
    raise ClusterError(
        f"--scheduler {run['scheduler']}: worker {_address()} on {socket.gethostname()} would not do as this "
        f"computer does: {'; '.join([*reasons[:3], *more])}. Give it the same rgbn, the same libraries (`make setup`) "
        f"and the same folders under the same paths; start it again. {AGAIN}"
    )


def _address() -> str:
    """Return where this worker is; `HERE` where it is asked apart from its units: then the client knows it."""
    from distributed import get_worker

    try:
        return get_worker().address
    except ValueError:
        return HERE


@cache
def _own() -> tuple[str, dict[str, str]]:
    """Return what this process has, once: what it has imported stays as it was, whatever becomes of the files."""
    return code_fingerprint(), libraries()


def _unseen(run: dict[str, Any]) -> list[str]:
    """Return what this process does not see as the one that started the run does."""
    trial = run["folder"] / uuid.uuid4().hex
    try:
        trial.touch()
        trial.unlink()
    except OSError as error:
        does = "does not see" if not run["folder"].is_dir() else "cannot write into"
        return [f"it {does} the output folder {run['folder'].parents[1]} ({error.strerror})"]
    for path, digest in run["files"].items():
        found = blocks_digest(Path(path))
        if found != digest:
            return [f"it {'sees another file as' if found else 'does not see'} {path}"]
    return []


def pack(value: Any, folder: Path | None) -> bytes:
    """Pickle a value; its large arrays go as files. What is written to them when they are read goes nowhere else.

    Parameters
    ----------
    value : object
    folder : Path or None
        Where they are written, named by their content; in OUT/.rgbn/cluster. None: all is pickled.
    """
    stream = io.BytesIO()
    _Pickler(stream, folder).dump(value)
    return stream.getvalue()


class _Pickler(CloudPickler):
    """Takes large arrays as files, and paths in full: a worker has a folder of its own."""

    def __init__(self, stream: io.BytesIO, folder: Path | None) -> None:
        super().__init__(stream, protocol=5)
        self._folder = folder

    def reducer_override(self, obj: Any) -> Any:
        if type(obj) in (np.ndarray, np.memmap) and not obj.dtype.hasobject:
            if self._folder and obj.nbytes > LARGE:
                return _array, _place_of(obj, self._folder)
            return np.array(obj).__reduce_ex__(5)
        if isinstance(obj, Path) and not obj.is_absolute():
            return type(obj), (os.path.abspath(obj),)
        return super().reducer_override(obj)


def _array(path: Path, offset: int, shape: tuple[int, ...], strides: tuple[int, ...], dtype: np.dtype) -> NDArray:
    """Return an array that lies in a file."""
    with open(path, "rb") as file:
        content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
    return np.ndarray(shape, dtype, content, offset, strides)


def _place_of(array: NDArray, folder: Path) -> tuple[Path, int, tuple[int, ...], tuple[int, ...], np.dtype]:
    """Return where an array lies: in a file of the output folder, of which it may be a part; else in one of its own."""
    root = array
    while isinstance(root.base, np.ndarray):
        root = root.base
    if isinstance(root, np.memmap) and root.filename is not None:
        path = Path(root.filename).absolute()
        if path.is_relative_to(folder.parents[1]) and path.is_file():
            return path, root.offset + array.ctypes.data - root.ctypes.data, array.shape, array.strides, array.dtype
    whole = np.asarray(array if array.flags.forc else array.copy())
    content = whole.ravel("K").view(np.uint8).data
    path = folder / hashlib.sha256(content).hexdigest()
    if not path.exists():
        # Whole, so that one that is there can be relied on.
        unfinished = path.with_name(uuid.uuid4().hex)
        unfinished.write_bytes(content)
        os.replace(unfinished, path)
    return path, 0, whole.shape, whole.strides, whole.dtype
