"""A Dask cluster as an executor: its workers are checked before they work, arrays go as files, losses are told."""

import errno
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

from lab.cluster import worker
from lab.cluster.worker import content_name, pack, unpack
from lab.progress import say
from scene.current import code_fingerprint, libraries
from scene.errors import ClusterError

WAIT_FOR_WORKERS = "120 s"
"""How long a run waits for a worker where there is none; Dask's setting `rgbn.wait-for-workers` replaces it."""
TELL_S = 10
"""Seconds from one line that says so to the next."""
SILENCE_S = 60
"""Seconds that a scheduler may take to answer."""
LOOK_S = 0.5
SERVE = "exec(text, space := {'__name__': 'rgbn_worker'}) or space['serve'](run, unit)"
"""What a worker evaluates: `eval` is the same function everywhere, whatever else differs."""
AGAIN = "What is done is kept: run the same command again."


class WorkerDied(ClusterError):
    """A unit's worker process was killed, or ended itself, every time."""


class Cluster(Executor):
    """The workers of a Dask scheduler; see `lab.cluster.connect.executor_of`."""

    def __init__(self, client: Any, address: str, shared: Path | None) -> None:
        from dask import config
        from dask.utils import parse_timedelta

        self._client, self._address, self._shared = client, address, None if shared is None else str(shared)
        self._patience_s = parse_timedelta(config.get("rgbn.wait-for-workers", WAIT_FOR_WORKERS))
        run = {"id": uuid.uuid4().hex, "folder": self._shared, "code": code_fingerprint(), "libraries": libraries()}
        self._order = {"text": Path(worker.__file__).read_text(), "run": run}
        self._units: dict[Future, tuple[Any, set[str]]] = {}
        self._users: Counter[str] = Counter()
        self._lock, self._over = threading.RLock(), threading.Event()
        self._error: ClusterError | None = None

    def check_workers(self) -> None:
        """Wait for workers, make sure that all are fit, and watch over them from then on.

        Raises
        ------
        ClusterError
            As `lab.cluster.connect.executor_of` says.
        """
        next(count for count in self._worker_counts(lambda: True) if count)
        order = {**self._order, "unit": None}
        try:
            # `callback_timeout` is for the client, not for `eval`.
            found = self._client.run(eval, SERVE, order, on_error="return", callback_timeout=SILENCE_S)
        except TimeoutError as error:
            raise self._fault(f"a worker did not answer for {SILENCE_S} s. Start the workers again.") from error
        except OSError as error:
            raise self._scheduler_lost() from error
        for address, answer in sorted(found.items()):
            if isinstance(answer, BaseException):
                raise self._fault(f"worker {address} cannot be asked what it has ({answer}). Start it again.")
            outcome, value = answer
            if outcome == "unfit":
                raise self._unfit(address, *value[1:])
        threading.Thread(target=self._watch_workers, daemon=True).start()

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Give a unit to the cluster; see `Executor.submit`. One whose worker dies is tried again by another."""
        future: Future = Future()
        with self._lock:
            if self._error is not None:
                raise self._error
            try:
                unit = pack((fn, args, kwargs), self._shared, content_name)
            except OSError as error:
                raise self._of_disk(error) from error
            names = {name for name in (unit[0], *unit[1]) if isinstance(name, str)}
            self._users.update(names)
        key = f"{getattr(getattr(fn, 'func', fn), '__name__', 'unit')}-{uuid.uuid4().hex}"
        remote = self._client.submit(eval, SERVE, {**self._order, "unit": unit}, key=key, pure=False)
        future.add_done_callback(self._forget)
        with self._lock:
            self._units[future] = remote, names
            if self._error is not None:
                # The cluster was lost meanwhile.
                self._settle(future, error=self._error)
        # There, and in no thread: one that waits for a client that was closed would hold up the end of the program.
        self._client.loop.add_callback(self._finish, future, remote)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Drop the units that are not done."""
        self._over.set()
        for future in list(self._units):
            future.cancel()

    async def _finish(self, future: Future, remote: Any) -> None:
        """Wait for a unit on the cluster, and hand on what became of it."""
        from distributed import KilledWorker

        try:
            outcome, value = await remote
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
                self._settle(future, error=self._of_disk(error))
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

    def _of_disk(self, error: BaseException) -> BaseException:
        """Return what to tell of an error: of a full disk, the message."""
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return ClusterError(f"{self._shared}: the disk is full ({error.strerror}). Free some space. {AGAIN}")
        return error

    def _scheduler_lost(self) -> ClusterError:
        return self._fault("the scheduler was lost: it was ended, or the network to it was. Start it again.")

    def _unfit(self, address: str, host: str, reasons: list[str]) -> ClusterError:
        more = [f"{len(reasons) - 3} more"] if len(reasons) > 3 else []
        return self._fault(
            f"worker {address} on {host} would not do as this computer does: {'; '.join([*reasons[:3], *more])}. Give "
            "it the same rgbn, the same libraries (`make setup`) and the same folders under the same paths; start it "
            "again."
        )

    def _fault(self, text: str, kind: type[ClusterError] = ClusterError) -> ClusterError:
        return kind(f"--scheduler {self._address}: {text} {AGAIN}")
