"""Cells on this machine's cores or on a Dask cluster; a worker that dies costs only the cell that it had."""

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context, parent_process
from typing import Any

from experiments.sweeps.recipe import Cell
from lab.cluster.executor import WorkerDied

Work = Callable[[Cell], Any]
ATTEMPTS = 3
"""How often a cell may be in work when its worker dies."""
CLUSTER_WINDOW = 256
"""Cells that a cluster is given at a time: so few that a stopped run leaves little behind."""
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def run_here(cells: Sequence[Cell], work: Work, *, processes: int) -> Iterator[tuple[Cell, Any]]:
    """Run cells in processes of this machine, one thread each.

    Parameters
    ----------
    cells : sequence of Cell
    work : callable
        A function of a module, of one cell.
    processes : int

    Yields
    ------
    cell, what `work` returned, or a `WorkerDied`
        In the order in which they are done.

    Notes
    -----
    When a process dies nobody can tell which of the cells in work it had. All of them are run again, one at a time, so
    that one that kills its worker takes no other along; the third time it counts as failed.
    """
    waiting, suspects = deque(cells), deque[Cell]()
    attempts: dict[Cell, int] = {}
    while waiting or suspects:
        queue, abreast = (waiting, processes) if waiting else (suspects, 1)
        running: dict[Future, Cell] = {}
        with _pool(abreast) as pool:
            try:
                while queue or running:
                    while queue and len(running) < abreast:
                        cell = queue.popleft()
                        # Before it is handed over: a pool that is broken already refuses it.
                        attempts[cell] = attempts.get(cell, 0) + 1
                        running[_submitted(pool, work, cell)] = cell
                    done, _ = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        result = future.result()
                        yield running.pop(future), result
            except BrokenExecutor:
                for future, cell in running.items():
                    if future.done() and future.exception() is None:
                        yield cell, future.result()
                    elif attempts[cell] < ATTEMPTS:
                        suspects.append(cell)
                    else:
                        yield cell, WorkerDied(f"its worker process died {ATTEMPTS} times")
            except BaseException:
                for process in (pool._processes or {}).values():
                    process.kill()
                raise


def run_there(cells: Sequence[Cell], work: Work, executor: Executor) -> Iterator[tuple[Cell, Any]]:
    """Run cells on a cluster, which itself gives those of a dead worker to another; see `run_here`."""
    waiting = deque(cells)
    running: dict[Future, Cell] = {}
    while waiting or running:
        while waiting and len(running) < CLUSTER_WINDOW:
            cell = waiting.popleft()
            running[executor.submit(work, cell)] = cell
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            cell, error = running.pop(future), future.exception()
            if error is not None and not isinstance(error, WorkerDied):
                raise error
            yield cell, error or future.result()


def _submitted(pool: Executor, work: Work, cell: Cell) -> Future:
    try:
        return pool.submit(work, cell)
    except BrokenExecutor as error:
        refused: Future = Future()
        refused.set_exception(error)
        return refused


def _pool(processes: int) -> ProcessPoolExecutor:
    # Inherited by what is started from here, and read there when the libraries load.
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=_serve_parent)


def _serve_parent() -> None:
    """End this process when the one that started it is gone, killed perhaps: nobody else would tell it."""
    # Ctrl-C reaches the whole group; the parent sees to it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
