"""One session on its way through the steps: what is done and current is not done again."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from lab.options import DEFAULT_PROFILE, Settings, TwinSettings
from lab.progress import alive, log, say
from scene.clock import now, since
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import plain
from scene.mesh import Mesh
from scene.method_names import UNCALIBRATED
from scene.record import Record
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
    parts : tuple of str
        What else is made from its results, not by a step: forgotten with them, so that no old result lies beside new
        ones.
    """

    name: str
    work: Callable[["Job"], Outcome]
    needs: tuple[str, ...]
    inputs: Callable[["Job"], Iterable[Any]]
    parts: tuple[str, ...] = ()


@dataclass
class Job:
    """A session, its output folder's record, and how to run.

    `session` is capture's Session; `executor` what fans out the work, None for threads here.
    """

    session: Any
    record: Record
    settings: Settings = field(default_factory=Settings)
    executor: Any = None

    @cached_property
    def externals(self) -> dict[str, Any]:
        """Other programs as methods, by name."""
        return self.settings.programs()

    @property
    def profile(self) -> str:
        """Of the methods' settings."""
        return self.settings.profile or DEFAULT_PROFILE

    @property
    def twin(self) -> TwinSettings:
        """How the twin is rendered."""
        said = self.settings
        held_out = said.held_out is not False
        return TwinSettings(said.engine, said.error, bool(said.layers), bool(said.photograph), held_out)

    @property
    def tolerances_deg(self) -> dict[str, float]:
        """The error of normals that is allowed, by who said it; the first one holds."""
        said = {"--tolerance": self.settings.tolerance_deg, "session.toml": self.session.tolerance_deg}
        return {by: value for by, value in said.items() if value}

    @property
    def tolerance_deg(self) -> float | None:
        """That one; None: no error is too large."""
        return next(iter(self.tolerances_deg.values()), None)

    @property
    def methods(self) -> tuple[str, ...]:
        """The solvers: those asked for; where none was named and the lights are unknown, those that need none.

        Raises SceneError: the lights are unknown, and a solver was named that needs them.
        """
        model = self.done.get("calibrate", {}).get("result", {}).get("model")
        own = self.settings.methods()
        calibrated = [name for name in own if name not in UNCALIBRATED]
        # With a scan it is `align` that finds them.
        if model != "unknown" or self.session.scan or not calibrated:
            return (*own, *self.externals)
        if self.settings.method is not None:
            raise SceneError(
                f"--method {','.join(calibrated)}: the lights are unknown (no ball was found, and no file gives them), "
                f"and {'these need' if len(calibrated) > 1 else 'it needs'} them. Take --method "
                f"{','.join(UNCALIBRATED)}; or list the balls under [[spheres]], or give lights.file."
            )
        return (*UNCALIBRATED, *self.externals)

    def wanted(self, last: str) -> tuple[str, ...]:
        """Return the steps to run, with what they need, for a verb: what was asked for, the last one, files."""
        has_truth, trust = self.session.normals or self.session.scan, self.settings.trust
        asked = last == "compare" and not has_truth if trust is None else trust
        trusted = ("trust",) if asked and last in ("solve", "twin", "compare") else ()
        return (*trusted, last, *(("results",) if last == "compare" else ()))

    @cached_property
    def store(self) -> Store:
        """The output folder."""
        return Store(self.record.folder)

    @property
    def done(self) -> dict[str, dict[str, Any]]:
        """Of each step that is done: fingerprint, seconds, result, warnings."""
        return self.record.done

    @property
    def frame_files(self) -> tuple[str, ...]:
        """Names of the flash photographs' files."""
        return tuple(path.name for path in self.session.flash)

    def load_scan(self) -> Mesh:
        """Return the session's scan; see `scan_of`."""
        return scan_of(self.session, self.store)

    def run(self, steps: dict[str, Step], wanted: str) -> None:
        """Run a step, after the steps that it needs, unless they are current."""
        step = steps[wanted]
        for need in step.needs:
            self.run(steps, need)
        mark = self.fingerprint(step)
        if self.record.is_current(wanted, mark):
            return
        say(f"{wanted} ...")
        start, stale = now(), _made_from(steps, wanted)
        # What earlier runs have left, and this step does not make anew.
        former = self.done.get(wanted, {}).get("result", {}).get("methods", ()) if wanted == "solve" else ()
        gone = [*sorted(set(former) - set(self.methods)), *(name for name in stale if self.record.files_of(name))]
        if gone:
            say(f"{wanted}: is made anew; removed with what was there before: {', '.join(gone)}")
        with alive(wanted), self.record.making(wanted, mark, stale) as entry:
            outcome = step.work(self)
            spent = since(start)
            entry |= plain({**spent, "result": outcome.result, "warnings": outcome.warnings})
        warned = f", {len(outcome.warnings)} warnings" if outcome.warnings else ""
        say(f"{wanted}: {spent['seconds']:.1f} s{warned}")
        for text in outcome.warnings:
            log(f"warning ({wanted}): {text}")

    def is_current(self, steps: dict[str, Step], wanted: str) -> bool:
        """Whether a step, and all that it needs, is done and current."""
        step = steps[wanted]
        needed = all(self.is_current(steps, need) for need in step.needs)
        return needed and self.record.is_current(wanted, self.fingerprint(step))

    def fingerprint(self, step: Step) -> str:
        """Return the hash of all that goes into a step."""
        before = [self.done[need]["fingerprint"] for need in step.needs]
        inputs = tuple(step.inputs(self))
        return fingerprint(step.name, inputs, before, code=code_fingerprint(), digest=self.record.digest)


def scan_of(session: Any, store: Store) -> Mesh:
    """Return a session's scan, mended; in millimetres where its unit is known, or a ball or a pose told it."""
    from align.scan.mended_scan import load_scan

    mesh = load_scan(session.scan, session.scan_unit, ball_diameter_mm=session.scan_ball_diameter_mm)
    scale = store.load_scan_scale() if scale_unknown(session) else 1.0
    return mesh if scale == 1 else replace(mesh, vertices=scale * mesh.vertices)


def scale_unknown(session: Any) -> bool:
    """Whether neither a unit nor a ball tells the scan's scale."""
    return session.scan_unit == "unknown" and session.scan_ball_diameter_mm is None


def _made_from(steps: dict[str, Step], wanted: str) -> list[str]:
    """Return the steps that need a step, directly or not, in their order, and the parts of them all."""
    stale = {wanted}
    while more := {name for name, step in steps.items() if stale & set(step.needs)} - stale:
        stale |= more
    after = [name for name in steps if name in stale and name != wanted]
    return [*after, *dict.fromkeys(part for name in (wanted, *after) for part in steps[name].parts)]
