"""One session on its way through the steps: what is done and current is not done again.

`steps.json` in the output folder holds, for each finished step, a fingerprint of all that went into it, its
result, its warnings and its seconds.
"""

import fcntl
import hashlib
import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from lab.progress import say
from lab.rooms import ROOMS, ROOT
from lab.twin_settings import AS_GIVEN, TwinSettings
from scene.errors import SceneError
from scene.files import TEMPORARY, write_json
from scene.mesh import Mesh
from scene.store import Store


@dataclass
class Outcome:
    """What a step hands back: its part of the summary, and what is suspicious."""

    result: dict[str, Any]
    warnings: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Step:
    """A verb of the command line.

    Parameters
    ----------
    name : str
    work : callable
        Takes the job, writes its files, returns an `Outcome`.
    needs : tuple of str
        Steps whose results it reads.
    inputs : callable
        Takes the job; returns what goes into the step beside `needs`: paths and plain values.
    outputs : callable
        Takes the job; returns the files that must be there for the step to count as done.
    owns : tuple of str
        Files, folders and glob patterns below the output folder that are the step's results: removed before it runs
        again, or when what it was made from is, so that no old result lies beside new ones.
    """

    name: str
    work: Callable[["Job"], Outcome]
    needs: tuple[str, ...]
    inputs: Callable[["Job"], Iterable[Any]]
    outputs: Callable[["Job"], Iterable[Path]]
    owns: tuple[str, ...] = ()


@dataclass
class Job:
    """A session, its output folder, and how to run.

    `session` is capture's Session; `methods` the solvers asked for, `profile` that of their settings, `externals` those
    of them that are other programs, by name; `executor` what fans out the work, None for threads here; `twin` how the
    twin is rendered.
    """

    session: Any
    store: Store
    methods: tuple[str, ...]
    executor: Any = None
    truth: Path | None = None
    profile: str = "default"
    externals: dict[str, Any] = field(default_factory=dict)
    twin: TwinSettings = AS_GIVEN
    done: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        path = self.store.path("steps.json")
        if path.exists():
            try:
                self.done = json.loads(path.read_text())
            except ValueError as error:
                raise SceneError(f"{path}: not JSON ({error}). Remove it to start this output anew.") from error

    def load_scan(self) -> Mesh:
        """Return the session's scan, mended; in millimetres where its unit is known, or a ball or a pose told it."""
        from align.scan import load_scan

        session = self.session
        mesh = load_scan(session.scan, session.scan_unit, ball_diameter_mm=session.scan_ball_diameter_mm)
        scale = self.store.load_scan_scale() if self.scan_scale_unknown else 1.0
        return mesh if scale == 1 else replace(mesh, vertices=scale * mesh.vertices)

    @property
    def scan_scale_unknown(self) -> bool:
        """Neither a unit nor a ball tells the scan's scale."""
        return self.session.scan_unit == "unknown" and self.session.scan_ball_diameter_mm is None

    def run(self, steps: dict[str, Step], wanted: str) -> None:
        """Run a step, after the steps that it needs, unless they are current."""
        step = steps[wanted]
        for need in step.needs:
            self.run(steps, need)
        mark = self._fingerprint(step)
        before = self.done.get(wanted)
        if before and before["fingerprint"] == mark and all(path.exists() for path in step.outputs(self)):
            return
        say(f"{wanted} ...")
        start = time.perf_counter()
        # Forgotten first, with all that was made from it: a run that is killed in the middle, or that stops after
        # this step, must find neither the old mark on new files nor old results beside new ones.
        self._forget(steps, wanted)
        outcome = step.work(self)
        seconds = time.perf_counter() - start
        self._record(
            wanted,
            {"fingerprint": mark, "seconds": seconds, "result": outcome.result, "warnings": outcome.warnings},
        )
        warned = f", {len(outcome.warnings)} warnings" if outcome.warnings else ""
        say(f"{wanted}: {seconds:.1f} s{warned}")

    def _record(self, step: str, entry: dict[str, Any]) -> None:
        self.done[step] = entry
        self._save()

    def _forget(self, steps: dict[str, Step], wanted: str) -> None:
        """Drop a step and every step that needs it, directly or not."""
        stale = {wanted}
        while more := {name for name, step in steps.items() if stale & set(step.needs)} - stale:
            stale |= more
        if stale & set(self.done):
            self.done = {name: entry for name, entry in self.done.items() if name not in stale}
            self._save()
        for pattern in (pattern for name in stale for pattern in steps[name].owns):
            for path in self.store.folder.glob(pattern):
                shutil.rmtree(path) if path.is_dir() else path.unlink()

    def _save(self) -> None:
        write_json(self.store.path("steps.json"), self.done)
        # What is kept in memory must be what a later run reads.
        self.done = self.store.read_json("steps.json")

    def _fingerprint(self, step: Step) -> str:
        parts = [step.name, _code(), *(_identity(item) for item in step.inputs(self))]
        parts += [self.done[need]["fingerprint"] for need in step.needs]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold an output folder for one run.

    Raises
    ------
    SceneError
        Another run is at work there, or the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = open(folder / ".lock", "w")  # noqa: SIM115 (held for the whole block)
    except OSError as error:
        raise SceneError(
            f"{folder}: cannot be used for output ({error.strerror}). Choose another with --out."
        ) from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SceneError(f"{folder}: another run is writing here. Wait for it, or choose another --out.") from None
        # What a killed run left behind: nobody else is writing now.
        for path in folder.rglob(".*.tmp"):
            if TEMPORARY.match(path.name) and path.is_file():
                path.unlink()
        yield


def _identity(item: Any) -> Any:
    """Return what tells whether an input changed: a file's path, size and time, a value itself."""
    if isinstance(item, Path):
        if not item.exists():
            return [str(item), None]
        status = item.stat()
        return [str(item.resolve()), status.st_size, status.st_mtime_ns]
    if isinstance(item, list | tuple):
        return [_identity(part) for part in item]
    if is_dataclass(item):
        return [_identity(getattr(item, part.name)) for part in fields(item)]
    return repr(item)


@cache
def _code() -> str:
    """Return a hash of the rooms' sources: after an update, results are made anew."""
    digest = hashlib.sha256()
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()
