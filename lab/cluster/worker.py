"""What a worker of a cluster does with a unit: it makes sure that it may have it, and works.

This file is sent to the workers as text, with every unit, since what a worker has installed under this name may be
another version: of the house it asks `scene.current` alone. Arrays do not go through the scheduler, but as files in a
folder that client and workers share.
"""

import hashlib
import mmap
import os
import pickle
import socket
import sys
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cloudpickle import CloudPickler

LARGE = 1 << 16
"""Bytes; what is larger goes as a file."""


def serve(run: dict[str, Any], unit: tuple | None = None) -> tuple[str, Any]:
    """Do a unit in this process, if it is fit for the run.

    Parameters
    ----------
    run : dict
        id: str. code, libraries: what `scene.current` finds where the run was started. folder: the shared one, or
        None; in its `files` stand the `blocks_digest` and the path of what a worker must see.
    unit : tuple or None
        What `pack` returned of (function, arguments, keyword arguments). None: only the question whether it is fit.

    Returns
    -------
    str, object
        "done" and what `pack` returned of the result; "unfit" and (worker, host, list of reasons); "fit" and None.
    """
    known = sys.__dict__.setdefault("_rgbn_worker", {})
    if run["id"] not in known:
        known[run["id"]] = _reasons(run, known)
    if known[run["id"]]:
        return "unfit", (_address(), socket.gethostname(), known[run["id"]])
    if unit is None:
        return "fit", None
    function, arguments, named = unpack(unit, run["folder"])
    return "done", pack(function(*arguments, **named), run["folder"], lambda _: uuid.uuid4().hex)


def _address() -> str:
    from distributed import get_worker

    try:
        return get_worker().address
    except ValueError:
        return "?"


def _reasons(run: dict[str, Any], known: dict[str, Any]) -> list[str]:
    """Return why this process would not give what the one that started the run gives."""
    if "own" not in known:
        try:
            from scene.current import ROOT, code_fingerprint
            from scene.current import libraries as versions
        except ImportError:
            return ["it has no rgbn, or a very old one"]
        # Once in a process: what it has imported stays as it was, whatever becomes of the files.
        known["own"] = ROOT, code_fingerprint(), versions()
    root, code, libraries = known["own"]
    reasons = []
    if code != run["code"]:
        reasons.append(f"the code of its rgbn in {root} is another: {code[:8]}, expected {run['code'][:8]}")
    for name, expected in run["libraries"].items():
        if (found := libraries.get(name)) != expected:
            reasons.append(f"its {name} is {found}, expected {expected}")
    return reasons or (_unseen(run) if run["folder"] else [])


def _unseen(run: dict[str, Any]) -> list[str]:
    """Return what this process does not see as the one that started the run does; the code is known to be the same."""
    from scene.current import blocks_digest

    folder = Path(run["folder"])
    try:
        listed = (folder / "files").read_text()
    except OSError as error:
        return [f"it does not see the output folder {folder.parent} ({error.strerror})"]
    for line in listed.splitlines():
        digest, _, path = line.partition(" ")
        found = blocks_digest(Path(path))
        if found != digest:
            return [f"it {'sees another file as' if found else 'does not see'} {path}"]
    try:
        trial = folder / uuid.uuid4().hex
        _write(trial, b"")
        trial.unlink()
    except OSError as error:
        return [f"it cannot write into the output folder {folder.parent} ({error.strerror})"]
    return []


def pack(value: Any, folder: str | None, name: Callable[[Any], str]) -> tuple[bytes | str, list[str]]:
    """Pickle a value; what of it is large becomes files.

    Parameters
    ----------
    value : object
    folder : str or None
        None: all is pickled.
    name : callable
        Gives the name of a file from its content.

    Returns
    -------
    bytes, list of str
        Pickled, and the names of the files of its arrays. A name in place of the bytes if these are many, too.
    """
    import io

    names: list[str] = []

    def put(content: Any) -> str:
        names.append(name(content))
        place = Path(folder or "", names[-1])
        if not place.exists():
            _write(place, content)
        return names[-1]

    def is_small(buffer: pickle.PickleBuffer) -> bool:
        content = buffer.raw()
        if content.nbytes > LARGE:
            put(content)
        return content.nbytes <= LARGE

    stream = io.BytesIO()
    _Pickler(stream, protocol=5, buffer_callback=is_small if folder else None).dump(value)
    body = stream.getvalue()
    return (body, names) if folder is None or len(body) <= LARGE else (put(body), names[:-1])


def content_name(content: Any) -> str:
    """Name a file after what is in it: sent with many units, it is written once."""
    return hashlib.sha256(content).hexdigest()


def unpack(packed: tuple[bytes | str, list[str]], folder: str | None, *, last: bool = False) -> Any:
    """Return what `pack` was given; its arrays are maps of the files, and what is written to them goes nowhere else.

    last : the files are removed; they live on as long as the arrays do.
    """

    def content(name: str) -> mmap.mmap:
        place = Path(folder or "", name)
        with open(place, "rb") as file:
            found = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
        if last:
            place.unlink()
        return found

    body, names = packed
    return pickle.loads(content(body) if isinstance(body, str) else body, buffers=map(content, names))


def _write(place: Path, content: Any) -> None:
    """Write a file whole, so that one that is there can be relied on."""
    unfinished = place.with_name(uuid.uuid4().hex)
    unfinished.write_bytes(content)
    os.replace(unfinished, place)


class _Pickler(CloudPickler):
    """Takes all arrays by their buffers, maps and windows too, and paths in full: a worker has a folder of its own."""

    def reducer_override(self, obj: Any) -> Any:
        import numpy as np

        if type(obj) in (np.ndarray, np.memmap) and not obj.dtype.hasobject:
            return np.asarray(obj if obj.flags.forc else obj.copy()).__reduce_ex__(5)
        if isinstance(obj, Path) and not obj.is_absolute():
            return type(obj), (os.path.abspath(obj),)
        return super().reducer_override(obj)
