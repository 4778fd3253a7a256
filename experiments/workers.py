"""Cells or datasets on this machine's cores or a Dask cluster; a worker that dies costs only the cell that it had."""

import os
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from typing import Any, TypeVar

from lab.cluster import WorkerDied, death_of, executor_of
from lab.progress import end_with_parent

Unit = TypeVar("Unit")
Work = Callable[[Any], Any]
ATTEMPTS = 3
"""How often a cell may be in work when its worker dies."""
CLUSTER_WINDOW = 256
"""Cells that a cluster is given at a time: so few that a stopped run leaves little behind."""
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def run_all(
    cells: Sequence[Unit], work: Work, *, processes: int | None = None, scheduler: str | None = None
) -> Iterator[tuple[Unit, Any]]:
    """Yield each cell and what `work`, a function of a module, returned of it, or a `WorkerDied`; as they are done.

    On the Dask cluster of that address, or in processes of this machine, one thread each; default: one a core.
    """
    if scheduler is None:
        yield from _run_here(cells, work, min(processes or os.cpu_count() or 1, len(cells)))
        return
    from distributed import KilledWorker

    with executor_of(scheduler) as executor:
        # A cluster itself gives the cells of a dead worker to another.
        for cell, future in _run_through(deque(cells), work, executor, CLUSTER_WINDOW):
            died = isinstance(error := future.exception(), KilledWorker)
            yield cell, WorkerDied(death_of(error)) if died else future.result()


def _run_here(cells: Sequence[Unit], work: Work, processes: int) -> Iterator[tuple[Unit, Any]]:
    """Run cells in processes of this machine.

    When a process dies nobody can tell which of the cells in work it had. All of them are run again, one at a time, so
    that one that kills its worker takes no other along; the third time it counts as failed.
    """
    waiting, suspects = deque(cells), deque[Unit]()
    attempts: Counter[Unit] = Counter()
    while queue := waiting or suspects:
        with _pool(abreast := processes if waiting else 1) as pool:
            try:
                for cell, future in _run_through(queue, work, pool, abreast):
                    attempts[cell] += 1
                    if not isinstance(future.exception(), BrokenExecutor):
                        yield cell, future.result()
                    elif attempts[cell] < ATTEMPTS:
                        suspects.append(cell)
                    else:
                        yield cell, WorkerDied(f"its worker process died {ATTEMPTS} times")
            except BaseException:
                for process in (pool._processes or {}).values():
                    process.kill()
                raise


def _run_through(queue: deque[Unit], work: Work, pool: Executor, abreast: int) -> Iterator[tuple[Unit, Future]]:
    """Yield cells of a queue with their futures as they are done; none is begun any more once the pool is broken."""
    running: dict[Future, Unit] = {}
    broken = False
    while running or (queue and not broken):
        while queue and len(running) < abreast and not broken:
            try:
                running[pool.submit(work, queue[0])] = queue[0]
                queue.popleft()
            except BrokenExecutor:
                # It broke a moment ago.
                broken = True
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            broken = broken or isinstance(future.exception(), BrokenExecutor)
            yield running.pop(future), future


def _pool(processes: int) -> ProcessPoolExecutor:
    # Inherited by what is started from here, and read there when the libraries load.
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=end_with_parent)
