"""A Dask scheduler as an executor: its workers are checked before they work, arrays go as files, losses are told.

Workers see the output folder. An array that lies in a file there is sent as its place in it; another large one is
written once into a folder of the run. Results come back through the scheduler.
"""

import hashlib
import io
import logging
import os
import pickle
import shutil
import socket
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from cloudpickle import CloudPickler
from numpy.typing import NDArray

from lab.progress import say
from scene.current import ROOT, code_fingerprint, libraries
from scene.errors import ClusterError
from scene.files import write_whole
from scene.record import PLACE

WAIT_S = 120
"""Seconds that a run waits for a first worker."""
LARGE = 1 << 16
"""Bytes; a larger array goes as a file."""
SENT = Path(PLACE) / "cluster"
"""Where such arrays lie in the output folder, while the run lasts."""
AGAIN = "What is done is kept: run the same command again."


class WorkerDied(ClusterError):
    """A unit's worker process was killed, or ended itself, every time."""


@contextmanager
def executor_of(address: str | None, folder: Path | None = None) -> Iterator[Any]:
    """Hold the executor of a Dask scheduler for a block; None for threads here.

    Parameters
    ----------
    address : str or None
        Of the scheduler.
    folder : Path or None
        The output folder, which all workers see under the same path. None: the units write no files, and their arrays
        are small.

    Raises
    ------
    ClusterError
        No scheduler answers, or it has no worker for `WAIT_S`. From a unit within the block: a worker has other code or
        libraries, or does not see the folder; the scheduler was lost; `WorkerDied`, where one worker after the other
        dies of it.
    """
    if address is None:
        yield None
        return
    from distributed import Client, KilledWorker, versions
    from distributed.comm.addressing import get_address_host

    # What Dask would say of a lost scheduler, and of versions, is said here, once.
    for name in ("distributed", "distributed.client", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    where = f"--scheduler {address}:"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", versions.VersionMismatchWarning)
            # Before there is a client: one without a place to go to cannot be closed in silence.
            get_address_host(address)
            client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"{where} no Dask scheduler answers there ({error}). Start one with `dask scheduler`, or leave --scheduler "
            "out to work on this computer."
        ) from error
    with client:
        try:
            if not client.ncores():
                say(f"waiting for workers at {address}")
            try:
                client.wait_for_workers(1, timeout=WAIT_S)
            except TimeoutError as error:
                raise ClusterError(
                    f"{where} it had no worker for {WAIT_S} s. Start some, each with `dask worker {address}`, or leave "
                    f"--scheduler out to work on this computer. {AGAIN}"
                ) from error
            yield Cluster(client, address, folder and folder.resolve())
        except KilledWorker as error:
            raise WorkerDied(f"{where} {death_of(error)} {AGAIN}") from error
        except ModuleNotFoundError as error:
            if not (error.name or "").startswith("lab"):
                raise
            raise ClusterError(f"{where} a worker has no rgbn, or an old one ({error}). {AGAIN}") from error
        except CancelledError as error:
            raise ClusterError(
                f"{where} the scheduler was lost: it was ended, or the network to it was. Start it again. {AGAIN}"
            ) from error
        finally:
            if folder:
                shutil.rmtree(folder / SENT, ignore_errors=True)


def death_of(error: Any) -> str:
    """Return what a `distributed.KilledWorker` tells people."""
    return (
        f"{error.allowed_failures + 1} workers died, one after the other, of the same unit of work. Most often their "
        "memory ran out: see their logs; give them more memory, or fewer threads."
    )


class Cluster(Executor):
    """The workers of a Dask scheduler; see `executor_of`."""

    def __init__(self, client: Any, address: str, folder: Path | None) -> None:
        self._workers = client.get_executor(pure=False)
        self._run = {"scheduler": address, "folder": folder, "code": code_fingerprint(), "libraries": libraries()}

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Give a unit to the cluster; see `Executor.submit`. One whose worker dies is tried again by another."""
        unit = pack((fn, args, kwargs), self._run["folder"])
        # `eval` is known to a scheduler too that has no rgbn.
        work = "__import__('lab.cluster').cluster.serve(run, unit)"
        return self._workers.submit(eval, work, {"run": self._run, "unit": unit})


def serve(run: dict[str, Any], unit: bytes) -> Any:
    """Do a unit in this process, a worker's, and return its result.

    Parameters
    ----------
    run : dict
        scheduler: str. code, libraries: what `scene.current` finds where the run was started. folder: the shared one,
        or None.
    unit : bytes
        What `pack` returned of (function, arguments, keyword arguments).

    Raises
    ------
    ClusterError
        This process would not give what the one that started the run gives: what it has loaded, whatever became of the
        files since, is other code or another library, or it does not see the folder.
    """
    code, reasons = code_fingerprint(), []
    if code != run["code"]:
        reasons = [f"the code of its rgbn in {ROOT} is another: {code[:8]}, expected {run['code'][:8]}"]
    reasons += [
        f"its {name} is {libraries().get(name)}, expected {expected}"
        for name, expected in run["libraries"].items()
        if libraries().get(name) != expected
    ]
    if run["folder"] and not run["folder"].is_dir():
        reasons.append(f"it does not see the output folder {run['folder']}")
    if reasons:
        raise ClusterError(
            f"--scheduler {run['scheduler']}: a worker on {socket.gethostname()} would not do as this computer does: "
            f"{'; '.join(reasons)}. Give it the same rgbn, the same libraries (`make setup`) and the same folders "
            f"under the same paths; start it again. {AGAIN}"
        )
    function, arguments, named = pickle.loads(unit)
    return function(*arguments, **named)


def pack(value: Any, folder: Path | None) -> bytes:
    """Pickle a value; its large arrays go as files. What is written to them when they are read goes nowhere else.

    Parameters
    ----------
    value : object
    folder : Path or None
        The output folder. None: all is pickled.
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
    return np.ndarray(shape, dtype, np.memmap(path, np.uint8, "c"), offset, strides)


def _place_of(array: NDArray, folder: Path) -> tuple[Path, int, tuple[int, ...], tuple[int, ...], np.dtype]:
    """Return where an array lies: in a file of the output folder, of which it may be a part; else in one of its own."""
    root = array
    while isinstance(root.base, np.ndarray):
        root = root.base
    if isinstance(root, np.memmap) and root.filename is not None:
        path = Path(root.filename).absolute()
        if path.is_relative_to(folder) and path.is_file():
            return path, root.offset + array.ctypes.data - root.ctypes.data, array.shape, array.strides, array.dtype
    whole = np.asarray(array if array.flags.forc else array.copy())
    content = whole.ravel("K").view(np.uint8).data
    path = folder / SENT / hashlib.sha256(content).hexdigest()
    if not path.exists():
        with write_whole(path) as file:
            file.write(content)
    return path, 0, whole.shape, whole.strides, whole.dtype
