"""A folder watched: events of the file system wake, listings tell, where no events come every second."""

import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from capture.hot_folder.tracker import Look, Tracker, Whole
from capture.session.globs import kind_of
from capture.survey.folder_files import files_below

EVERY_S = 1.0
"""A folder is listed so often, whether events come or not: of files on a network many systems tell none."""
SHARE = 0.004
"""Of the processor that listing may take while nothing happens: a folder that is slow to list is listed less often."""
CHANGES = ("created", "modified", "moved", "deleted", "closed")
"""Events that tell of a change; that a file was opened, which we do ourselves, is none."""


def list_photographs(folder: Path) -> dict[str, Look] | None:
    """Return how each photograph of a folder looks, by its name below it; None where the folder is not there.

    Raises
    ------
    SessionError
        The folder holds more files than a capture has.
    """
    found: dict[str, Look] = {}
    for path in files_below(folder):
        look = look_of(path) if kind_of(path) else None
        # Between the listing and this line it may be gone.
        if look is not None:
            found[path.relative_to(folder).as_posix()] = look
    return found if folder.is_dir() else None


def look_of(path: Path) -> Look | None:
    """Return how a file looks now; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return Look(status.st_size, status.st_mtime_ns, status.st_ino)


class HotFolder:
    """Waits for photographs.

    Parameters
    ----------
    folder : Path
    taken : iterable of Whole
        What was taken before.
    clock : callable
        Seconds, never backward.
    """

    def __init__(
        self, folder: Path, taken: Iterable[Whole] = (), *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.folder, self.clock = folder, clock
        self.tracker = Tracker(taken)
        self.is_there = True
        self._woken = threading.Event()
        self._observer: Any = None
        self._every_s = EVERY_S

    def __enter__(self) -> "HotFolder":
        self._observe()
        return self

    def __exit__(self, *_: object) -> None:
        self._forget_observer()

    def whole(self) -> list[Whole]:
        """List the folder, and return the photographs that are to be read now."""
        start = time.thread_time()
        listing = list_photographs(self.folder)
        self._every_s = max(EVERY_S, (time.thread_time() - start) / SHARE)
        if (listing is not None) != self.is_there:
            self.is_there = listing is not None
            # What was watched is gone with the folder.
            self._forget_observer()
            self._observe()
        now = self.clock()
        self.tracker.see(listing, now)
        return self.tracker.whole(now)

    def look_of(self, name: str) -> Look | None:
        """Return how a file looks now; None where there is none."""
        return look_of(self.folder / name)

    @property
    def is_waiting(self) -> bool:
        """Whether a file is there that is not whole yet."""
        return self.tracker.next_s(self.clock()) is not None

    def wait(self) -> None:
        """Sleep until a file may be whole, something has changed, or the folder is to be listed again."""
        soon = self.tracker.next_s(self.clock())
        if soon is None:
            self._woken.wait(self._every_s)
        else:
            # While a file grows, events come by the hundred: none of them makes it whole sooner.
            time.sleep(min(max(soon, 0.02), self._every_s))
        self._woken.clear()

    def _observe(self) -> None:
        from watchdog.events import FileSystemEvent, FileSystemEventHandler
        from watchdog.observers import Observer

        woken = self._woken

        class _Handler(FileSystemEventHandler):
            def on_any_event(self, event: FileSystemEvent) -> None:
                if event.event_type in CHANGES:
                    woken.set()

        # Where the system has no events for this folder, or no more of them, listing it is enough.
        with suppress(OSError):
            observer = Observer()
            observer.schedule(_Handler(), str(self.folder), recursive=True)
            observer.start()
            self._observer = observer

    def _forget_observer(self) -> None:
        observer, self._observer = self._observer, None
        if observer is not None:
            observer.stop()
            observer.join(5)
