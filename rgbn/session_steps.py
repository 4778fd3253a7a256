"""Which steps of an opened session are done and current, and by which methods they are gone on with."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from lab.options import Settings, Solving, TwinSettings
from lab.run import run_session
from lab.session_place import origin_of
from scene.output_folder import read_record
from scene.store import Store

Method = Solving | str | None


class SessionSteps:
    """A session, its output folder, and how its steps run: as that folder was made, unless something else is said.

    Parameters
    ----------
    path, out : Path
        The session and its output folder.
    scheduler : str, optional
        Address of a Dask scheduler.
    said : Settings
        What is said when the session is opened.
    """

    def __init__(self, path: Path, out: Path, scheduler: str | None, said: Settings) -> None:
        self.path, self.out = path, out
        self._scheduler, self._said = scheduler, said

    @property
    def session(self) -> Any:
        """The session as session.toml says it now."""
        from capture.session.session import load_session

        return load_session(self.path)

    @property
    def told(self) -> dict[str, Any]:
        """summary.json, empty where there is none."""
        return Store(self.out).read_json("summary.json") if (self.out / "summary.json").is_file() else {}

    @property
    def early(self) -> Store:
        """Camera and lights as they were before the later steps had their say."""
        return Store(self.out / "frames")

    def run(self, wanted: str, solving: Method = None, twin: TwinSettings | None = None) -> None:
        """Run a step with all that it needs, what is not done and current."""
        run_session(self.path, wanted, out=self.out, scheduler=self._scheduler, said=self._with(solving, twin))

    def need(self, wanted: str, solving: Method = None) -> None:
        """Run a step where it is not done and current."""
        if not self.is_current(wanted, solving):
            self.run(wanted, solving)

    def is_current(self, wanted: str, solving: Method = None) -> bool:
        """Whether a step, and all that it needs, is done and current."""
        from lab.job import Job
        from lab.plan import STEPS
        from scene.output_folder import open_record

        session = self.session
        with open_record(self.out, origin=origin_of(session, self.path), input_folders=[session.folder]) as record:
            settings = Settings.of(record).but(self._with(solving))
            return Job(session, record, settings).is_current(STEPS, wanted)

    def name_of(self, method: str) -> str:
        """Return a method's name as its files have it."""
        return method.strip() if method.strip() in self._kept.programs() else method.strip().casefold()

    @property
    def _kept(self) -> Settings:
        """The settings by which the folder was made."""
        record = read_record(self.out)
        return Settings() if record is None else Settings.of(record)

    def _with(self, given: Method, twin: TwinSettings | None = None) -> Settings:
        """Return what is said: methods beside those whose results are there."""
        kept, rows = self._kept, (self.told.get("solve") or {}).get("methods") or {}
        programs = kept.programs()
        # Another program stays with the session without being asked for again.
        asked = given if isinstance(given, Solving) else Solving(None if given in programs else given)
        if asked.external is not None:
            before = {text.partition("=")[0].strip(): text for text in (*(kept.external or ()), *asked.external)}
            asked = replace(asked, external=tuple(before.values()))
        if asked.method is not None:
            there = [name for name in rows if name not in programs and not name[:1].isupper()]
            asked = replace(asked, method=",".join(dict.fromkeys([*there, *asked.methods()])))
        return self._said.but(asked, twin)
