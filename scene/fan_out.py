"""Work units on an executor: progress, the first error at once, and no orphan after Ctrl-C."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed, wait
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


def fan_out(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    *,
    executor: Executor | None = None,
    done: Callable[[], None] | None = None,
    threads: int | None = None,
) -> list[Result]:
    """Return [function(job) for job in jobs], computed side by side.

    Parameters
    ----------
    function : callable
        A work unit: idempotent; importable by name, where the executor's workers are processes.
    executor : Executor or None
        None: threads here.
    done : callable or None
        Called after each unit.
    threads : int or None
        How many there are, without an executor: no more than the cores. None: as many as there are cores.

    Raises
    ------
    BaseException
        What the first unit raised, or KeyboardInterrupt: units not begun are cancelled, those that run are
        waited for, since they write into files that the caller is about to remove. Not those of a cluster: they find
        their file gone.
    """
    cores = os.cpu_count() or 1
    pool = executor or ThreadPoolExecutor(max_workers=min(threads or cores, cores))
    futures = []
    try:
        futures += [pool.submit(function, job) for job in jobs]
        for future in as_completed(futures):
            future.result()
            if done:
                done()
        return [future.result() for future in futures]
    except BaseException:
        running = [future for future in futures if not future.cancel()]
        wait(running)
        raise
    finally:
        if executor is None:
            pool.shutdown(wait=True, cancel_futures=True)
