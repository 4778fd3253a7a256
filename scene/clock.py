"""Time spent: by the clock on the wall, and by processors, which bears other work on the machine."""

import os
import time


def now() -> tuple[float, float]:
    """Return wall seconds, and the processor seconds of this process and of the programs that it waited for."""
    return time.perf_counter(), time.process_time() + sum(os.times()[2:4])


def since(start: tuple[float, float]) -> dict[str, float]:
    """Return `seconds` (wall) and `processor_seconds` since `now` gave `start`; a cluster's processors do not count."""
    wall, processor = now()
    return {"seconds": wall - start[0], "processor_seconds": processor - start[1]}
