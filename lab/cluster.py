"""A Dask cluster as an executor: its workers are checked before they work, arrays go as files, losses are told."""

import logging
import shutil
import tempfile
import threading
import time
import uuid
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from lab import cluster_worker
from lab.cluster_worker import content_name, pack, unpack
from lab.progress import say
from scene import current
from scene.errors import ClusterError, SceneError

WAIT_FOR_WORKERS = "120 s"
"""How long a run waits for a worker where there is none; Dask's setting `rgbn.wait-for-workers` replaces it."""
TELL_S = 10
"""Seconds from one line that says so to the next."""
SILENCE_S = 60
"""Seconds that a scheduler may take to answer."""
LOOK_S = 0.5
PREFIX = ".cluster-"
SERVE = "exec(text, space := {'__name__': 'rgbn_worker'}) or space['serve'](run, unit)"
"""What a worker evaluates: `eval` is the same function everywhere, whatever else differs."""
AGAIN = "What is done is kept: run the same command again."


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
        Output folder, which all workers see under the same path. None: the units write no files, and their arrays are
        small.
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
    from distributed import Client, versions

    # What Dask would say of a lost scheduler, and of versions, is said here, once.
    for name in ("distributed", "distributed.client", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", versions.VersionMismatchWarning)
        try:
            client = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"--scheduler {address}: no Dask scheduler answers there ({error}). Start one with `dask scheduler`, "
                "or leave --scheduler out to work on this computer."
            ) from error
    with client, _shared_folder(folder, files) as shared:
        cluster = Cluster(client, address, shared)
        try:
            cluster.check_workers()
            yield cluster
        finally:
            cluster.shutdown()


@contextmanager
def _shared_folder(folder: Path | None, files: Iterable[Path]) -> Iterator[Path | None]:
    """Make a folder for arrays within the output folder, for a block; list there what a worker must see."""
    if folder is None:
        yield None
        return
    for left in folder.glob(f"{PREFIX}*/files"):
        # Of a run that was killed: only one at a time is at work in an output folder.
        shutil.rmtree(left.parent, ignore_errors=True)
    try:
        shared = Path(tempfile.mkdtemp(prefix=PREFIX, dir=folder.resolve()))
    except OSError as error:
        raise SceneError(
            f"{folder}: cannot be written ({error.strerror}). Choose another folder with --out."
        ) from error
    try:
        seen = sorted({path.resolve() for path in files if path.is_file()})
        shared.joinpath("files").write_text("".join(f"{path.stat().st_size} {path}\n" for path in seen))
        yield shared
    finally:
        shutil.rmtree(shared, ignore_errors=True)


class Cluster(Executor):
    """The workers of a Dask scheduler; see `executor_of`."""

    def __init__(self, client: Any, address: str, shared: Path | None) -> None:
        from dask import config
        from dask.utils import parse_timedelta

        self._client, self._address, self._shared = client, address, None if shared is None else str(shared)
        self._patience_s = parse_timedelta(config.get("rgbn.wait-for-workers", WAIT_FOR_WORKERS))
        run = {"id": uuid.uuid4().hex, "folder": self._shared, "current": Path(current.__file__).read_text()}
        run |= {"code": current.code_fingerprint(), "libraries": current.libraries()}
        self._order = {"text": Path(cluster_worker.__file__).read_text(), "run": run}
        self._units: dict[Future, tuple[Any, set[str]]] = {}
        self._users: Counter[str] = Counter()
        self._lock, self._over = threading.RLock(), threading.Event()
        self._error: ClusterError | None = None

    def check_workers(self) -> None:
        """Wait for workers, make sure that all are fit, and watch over them from then on; see `executor_of`."""
        next(count for count in self._worker_counts(lambda: True) if count)
        found = self._client.run(eval, SERVE, {**self._order, "unit": None}, on_error="return")
        for worker, answer in sorted(found.items()):
            if isinstance(answer, BaseException):
                raise self._fault(f"worker {worker} cannot be asked what it has ({answer}). Start it again.")
            outcome, value = answer
            if outcome == "unfit":
                raise self._unfit(worker, *value[1:])
        threading.Thread(target=self._watch_workers, daemon=True).start()

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Give a unit to the cluster; see `Executor.submit`. One whose worker dies is tried again by another."""
        future: Future = Future()
        with self._lock:
            if self._error is not None:
                raise self._error
            unit = pack((fn, args, kwargs), self._shared, content_name)
            names = {name for name in (unit[0], *unit[1]) if isinstance(name, str)}
            self._users.update(names)
            key = f"{getattr(getattr(fn, 'func', fn), '__name__', 'unit')}-{uuid.uuid4().hex}"
            remote = self._client.submit(eval, SERVE, {**self._order, "unit": unit}, key=key, pure=False)
            self._units[future] = remote, names
        future.add_done_callback(self._forget)
        remote.add_done_callback(partial(self._finish, future))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Drop the units that are not done."""
        self._over.set()
        for future in list(self._units):
            future.cancel()

    def _finish(self, future: Future, remote: Any) -> None:
        """Hand on what became of a unit on the cluster."""
        from distributed import KilledWorker

        try:
            outcome, value = remote.result()
            if outcome == "unfit":
                self._end(self._unfit(*value))
            else:
                self._settle(future, unpack(value, self._shared, last=True))
        except KilledWorker as error:
            died = (
                f"{error.allowed_failures + 1} workers died, one after the other, of the same unit of work. Most often "
                "their memory ran out: see their logs; give them more memory, or fewer threads."
            )
            self._settle(future, error=self._fault(died, WorkerDied))
        except BaseException as error:
            if remote.status in ("finished", "error"):
                self._settle(future, error=error)
            elif future in self._units:
                self._end(self._scheduler_lost())

    def _settle(self, future: Future, result: Any = None, *, error: BaseException | None = None) -> None:
        """Give a unit its outcome, unless it has one or was cancelled."""
        with self._lock:
            if future not in self._units or not future.set_running_or_notify_cancel():
                return
            self._forget(future)
            if error is None:
                future.set_result(result)
            else:
                future.set_exception(error)

    def _forget(self, future: Future) -> None:
        """Have the cluster forget a unit that is done or cancelled; remove the files that no other unit needs."""
        with self._lock:
            if future not in self._units:
                return
            remote, names = self._units.pop(future)
            self._users.subtract(names)
            for name in names:
                if not self._users[name]:
                    Path(self._shared or "", name).unlink(missing_ok=True)
        remote.release()

    def _end(self, error: ClusterError) -> None:
        """Give this outcome to every unit, and to those to come."""
        with self._lock:
            self._error = self._error or error
            for future in list(self._units):
                self._settle(future, error=self._error)

    def _watch_workers(self) -> None:
        try:
            for _ in self._worker_counts(lambda: bool(self._units)):
                if self._over.is_set():
                    return
        except ClusterError as error:
            self._end(error)

    def _worker_counts(self, is_needed: Callable[[], bool]) -> Iterator[int]:
        """Yield how many workers there are, again and again; say so where one is needed and there is none.

        Raises
        ------
        ClusterError
            There was none for too long, or the scheduler does not answer.
        """
        missing_since, told = None, 0.0
        while True:
            try:
                count = len(self._client.sync(self._client.scheduler.ncores, callback_timeout=SILENCE_S))
            except Exception as error:
                raise self._scheduler_lost() from error
            now = time.monotonic()
            if count or not is_needed():
                missing_since, told = None, 0.0
            else:
                missing_since = missing_since or now
                if now - missing_since > self._patience_s:
                    raise self._fault(
                        f"it had no worker for {self._patience_s:.0f} s. Start some, each with `dask worker "
                        f"{self._address}`, or leave --scheduler out to work on this computer."
                    )
                if now - told > TELL_S:
                    say(f"waiting for workers at {self._address}: none{'' if told else ' yet'}")
                    told = now
            yield count
            self._over.wait(LOOK_S)

    def _scheduler_lost(self) -> ClusterError:
        return self._fault("the scheduler was lost: it was ended, or the network to it was. Start it again.")

    def _unfit(self, worker: str, host: str, reasons: list[str]) -> ClusterError:
        more = [f"{len(reasons) - 3} more"] if len(reasons) > 3 else []
        return self._fault(
            f"worker {worker} on {host} would not do as this computer does: {'; '.join([*reasons[:3], *more])}. Give "
            "it the same rgbn, the same libraries (`make setup`) and the same folders under the same paths; start it "
            "again."
        )

    def _fault(self, text: str, kind: type[ClusterError] = ClusterError) -> ClusterError:
        return kind(f"--scheduler {self._address}: {text} {AGAIN}")
