"""A process' own memory, watched: without the page cache, which holds the frames."""

import threading
from pathlib import Path


class OwnMemory(threading.Thread):
    """Looks every 20 ms at how much anonymous memory the process has; `peak` is the most since it was last set to 0."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.peak = 0.0
        self._done = threading.Event()
        self.start()

    def run(self) -> None:
        while not self._done.wait(0.02):
            self.peak = max(self.peak, self.now())

    def stop(self) -> None:
        self._done.set()
        self.join()

    @staticmethod
    def now() -> float:
        """Return it in GB (10^9 bytes)."""
        status = Path("/proc/self/status").read_text()
        return int(status.split("RssAnon:")[1].split()[0]) * 1024 / 1e9
