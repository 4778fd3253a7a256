"""A Dask scheduler as an executor: its workers are checked before they work, arrays go as files, losses are told.

Workers see the output folder. An array that lies in a file there is sent as its place in it; another large one is
written once into a folder of the run. Results come back through the scheduler.
"""

import errno
import logging
import shutil
import threading
import time
import uuid
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, InvalidStateError
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from weakref import WeakSet

from lab.cluster_unit import AGAIN, HERE, pack
from lab.progress import say
from scene.current import blocks_digest, code_fingerprint, libraries
from scene.errors import ClusterError, SceneError

WAIT_FOR_WORKERS = "120 s"
"""How long a run waits for a worker where there is none; Dask's setting `rgbn.wait-for-workers` replaces it."""
TELL_S = 10
"""Seconds from one line that says so to the next."""
SILENCE_S = 60
"""Seconds that a scheduler, or a worker, may take to answer."""
LOOK_S = 0.5
UNIT = "__import__('lab.cluster_unit').cluster_unit"
"""What a worker evaluates: `eval` is known to a scheduler too that has no rgbn."""
REFUSE, SERVE = f"{UNIT}.refuse(run)", f"{UNIT}.serve(run, unit)"


class WorkerDied(ClusterError):
    """A unit's worker process was killed, or ended itself, every time."""


@contextmanager
def executor_of(address: str | None, folder: Path | None = None, files: Iterable[Path] = ()) -> Iterator[Any]:
    """Hold the executor of a Dask scheduler for a block; None for threads here.

    Parameters
    ----------
    address : str or None
        Of the scheduler.
    folder : Path or None
        OUT/.rgbn/NAME, which all workers see under the same path: for arrays, emptied before and after. None: the units
        write no files, and their arrays are small.
    files : iterable of Path
        What the workers must see besides.

    Raises
    ------
    ClusterError
        No scheduler answers; there is no worker for `WAIT_FOR_WORKERS`; a worker has other code or libraries, or does
        not see the files. From a unit within the block: the same, or the scheduler was lost; `WorkerDied`, where one
        worker after the other dies of it.
    """
    if address is None:
        yield None
        return
    from distributed import Client, KilledWorker, versions
    from distributed.comm.addressing import get_address_host

    # What Dask would say of a lost scheduler, and of versions, is said here, once.
    for name in ("distributed", "distributed.client", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", versions.VersionMismatchWarning)
        try:
            # Before there is a client: one without a place to go to cannot be closed in silence.
            get_address_host(address)
            client = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"--scheduler {address}: no Dask scheduler answers there ({error}). Start one with `dask scheduler`, "
                "or leave --scheduler out to work on this computer."
            ) from error
    with client, _emptied(folder) as shared:
        cluster = Cluster(client, address, shared, files)
        try:
            cluster.check_workers()
            yield cluster
        except KilledWorker as error:
            raise WorkerDied(f"--scheduler {address}: {death_of(error)} {AGAIN}") from error
        except ModuleNotFoundError as error:
            if not (error.name or "").startswith("lab"):
                raise
            raise cluster.told(f"a worker has no rgbn, or an old one ({error}).") from error
        except CancelledError as error:
            raise cluster.fault or cluster.lost() from error
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                raise
            full = f"{shared}: the disk is full ({error.strerror}). Free some space."
            raise ClusterError(f"{full} {AGAIN}") from error
        finally:
            cluster.shutdown()


def death_of(error: Any) -> str:
    """Return what a `distributed.KilledWorker` tells people."""
    return (
        f"{error.allowed_failures + 1} workers died, one after the other, of the same unit of work. Most often their "
        "memory ran out: see their logs; give them more memory, or fewer threads."
    )


@contextmanager
def _emptied(folder: Path | None) -> Iterator[Path | None]:
    """Make a folder for arrays, for a block: only one run at a time is at work in an output folder."""
    if folder is None:
        yield None
        return
    shutil.rmtree(folder, ignore_errors=True)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise SceneError(f"{folder}: cannot be written ({error.strerror}). Choose another with --out.") from error
    try:
        yield folder.resolve()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class Cluster(Executor):
    """The workers of a Dask scheduler; see `executor_of`."""

    def __init__(self, client: Any, address: str, shared: Path | None, files: Iterable[Path] = ()) -> None:
        from dask import config
        from dask.utils import parse_timedelta

        self._client, self._address, self._shared = client, address, shared
        self._workers = client.get_executor(pure=False)
        self._patience_s = parse_timedelta(config.get("rgbn.wait-for-workers", WAIT_FOR_WORKERS))
        seen = sorted({path.resolve() for path in files if path.is_file()}) if shared else ()
        self._run = {
            "id": uuid.uuid4().hex,
            "scheduler": address,
            "folder": shared,
            "code": code_fingerprint(),
            "libraries": libraries(),
            "files": {str(path): blocks_digest(path) for path in seen},
        }
        self._units: WeakSet[Future] = WeakSet()
        self._over = threading.Event()
        self.fault: ClusterError | None = None
        """Of the cluster as a whole: then no unit ends any more."""

    def check_workers(self) -> None:
        """Wait for workers, make sure that all are fit, and watch over them from then on; see `executor_of`."""
        next(count for count in self._worker_counts() if count)
        try:
            # `callback_timeout` is for the client.
            found = self._client.run(eval, REFUSE, {"run": self._run}, on_error="return", callback_timeout=SILENCE_S)
        except TimeoutError as error:
            raise self.told(f"a worker did not answer for {SILENCE_S} s. Start the workers again.") from error
        except OSError as error:
            raise self.lost() from error
        for address, answer in sorted(found.items()):
            if isinstance(answer, ClusterError):
                raise ClusterError(str(answer).replace(HERE, address, 1))
            if answer is not None:
                raise self.told(f"worker {address} cannot be asked what it has ({answer}). Start it again.")
        threading.Thread(target=self._watch, daemon=True).start()

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Give a unit to the cluster; see `Executor.submit`. One whose worker dies is tried again by another."""
        if self.fault is not None:
            raise self.fault
        future = self._workers.submit(eval, SERVE, {"run": self._run, "unit": pack((fn, args, kwargs), self._shared)})
        self._units.add(future)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Drop the units that are not done."""
        self._over.set()
        if self.fault is None:
            self._workers.shutdown(wait=False)

    def told(self, text: str) -> ClusterError:
        """Return what to tell of this cluster."""
        return ClusterError(f"--scheduler {self._address}: {text} {AGAIN}")

    def lost(self) -> ClusterError:
        """Return what to tell where the scheduler does not answer."""
        return self.told("the scheduler was lost: it was ended, or the network to it was. Start it again.")

    def _watch(self) -> None:
        """Give every unit, and those to come, the fault of the cluster as a whole, once there is one."""
        try:
            for _ in self._worker_counts():
                if self._over.is_set():
                    return
        except ClusterError as error:
            self.fault = error
            for unit in list(self._units):
                # It may be done meanwhile.
                with suppress(InvalidStateError):
                    unit.set_exception(error)

    def _worker_counts(self) -> Iterator[int]:
        """Yield how many workers there are, again and again; say so where there is none.

        Raises ClusterError: there was none for too long, or the scheduler does not answer.
        """
        missing_since, told = None, 0.0
        while True:
            try:
                count = len(self._client.sync(self._client.scheduler.ncores, callback_timeout=SILENCE_S))
            except Exception as error:
                raise self.lost() from error
            now = time.monotonic()
            missing_since = None if count else missing_since or now
            if missing_since is None:
                told = 0.0
            elif now - missing_since > self._patience_s:
                raise self.told(
                    f"it had no worker for {self._patience_s:.0f} s. Start some, each with `dask worker "
                    f"{self._address}`, or leave --scheduler out to work on this computer."
                )
            elif now - told > TELL_S:
                say(f"waiting for workers at {self._address}: none{'' if told else ' yet'}")
                told = now
            yield count
            self._over.wait(LOOK_S)
