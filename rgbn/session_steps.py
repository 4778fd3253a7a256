"""Which steps of an opened session are done and current, and with which settings they are gone on with."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from lab.options import AS_GIVEN, Solving, TwinSettings
from lab.run import run_session
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
    truth : Path, optional
        Folder of a known truth. Default: as the output folder was made.
    refine_lights : bool, optional
        Let the registered scan correct the lights. Default: as the output folder was made.
    """

    def __init__(
        self,
        path: Path,
        out: Path,
        *,
        scheduler: str | None = None,
        truth: Path | None = None,
        refine_lights: bool | None = None,
    ) -> None:
        self.path, self.out = path, out
        before = self.told.get("arguments") or {}
        known = truth or before.get("truth")
        self._scheduler, self._truth = scheduler, None if known is None else Path(known)
        self._refine = bool(before.get("refine_lights")) if refine_lights is None else refine_lights
        self._twin = TwinSettings(**before.get("twin") or asdict(AS_GIVEN))
        self._external = {name: f"{name}={command}" for name, command in (before.get("external") or {}).items()}
        self._profile: str | None = None

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
        self._twin = twin or self._twin
        how = {"scheduler": self._scheduler, "truth": self._truth, "refine_lights": self._refine}
        run_session(self.path, wanted, out=self.out, solving=self._solving(solving), twin=self._twin, **how)

    def need(self, wanted: str, solving: Method = None) -> None:
        """Run a step where it is not done and current."""
        if not self.is_current(wanted, solving):
            self.run(wanted, solving)

    def is_current(self, wanted: str, solving: Method = None) -> bool:
        """Whether a step, and all that it needs, is done and current."""
        from lab.job import Job
        from lab.plan import STEPS
        from scene.output_folder import open_record

        how, session = self._solving(solving), self.session
        programs = how.programs()
        with open_record(self.out, input_folders=[session.folder]) as record:
            settings = (how.profile, programs, self._twin, self._refine, how.method is not None)
            job = Job(session, record, (*how.methods(), *programs), None, self._truth, *settings)
            return job.is_current(STEPS, wanted)

    def name_of(self, method: str) -> str:
        """Return a method's name as its files have it."""
        return method.strip() if method.strip() in self._external else method.strip().casefold()

    def _solving(self, given: Method) -> Solving:
        """Return how to solve: by the methods asked for, beside those that are there."""
        if isinstance(given, Solving):
            self._profile = given.profile
            self._external |= {text.partition("=")[0].strip(): text for text in given.external}
        # Another program stays with the session without being asked for again.
        asked = given if isinstance(given, Solving) else Solving(None if given in self._external else given)
        rows = (self.told.get("solve") or {}).get("methods") or {}
        names = [name for name in rows if name not in self._external and not name[:1].isupper()]
        names += [] if asked.method is None else asked.methods()
        profile = self._profile or next((row["profile"] for row in rows.values()), asked.profile)
        known = {"profile": profile, "external": tuple(self._external.values())}
        return replace(asked, method=",".join(dict.fromkeys(names)) or None, **known)
