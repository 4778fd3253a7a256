"""How the steps of an output folder run: kept in its record, so that every later run goes on from it."""

from dataclasses import dataclass, replace
from pathlib import Path

from lab.options import AS_GIVEN, BY_DEFAULT, Solving, TwinSettings, said
from scene.files import plain
from scene.reading import reading
from scene.record import PLACE, Record

NOTE = "settings"
"""Of a record."""


@dataclass(frozen=True)
class Settings:
    """How the steps of an output folder run. Its record keeps them: what a later run does not say stays as it was.

    Parameters
    ----------
    solving : Solving
    twin : TwinSettings
    refine_lights : bool or None
        The registered scan's shading corrects the lights.
    truth : Path or None
        Folder of a known truth (truth.json, truth.npz) to judge the results by.
    """

    solving: Solving = BY_DEFAULT
    twin: TwinSettings = AS_GIVEN
    refine_lights: bool | None = None
    truth: Path | None = None

    @classmethod
    def of(cls, record: Record) -> "Settings":
        """Return those by which a folder was made; raise SceneError where its record is damaged."""
        note = record.notes.get(NOTE)
        if note is None:
            return cls()
        with reading(record.folder / PLACE, "does not say how the folder was made", do="Choose another with --out."):
            solving, truth = dict(note["solving"]), note["truth"]
            if solving["external"] is not None:
                solving["external"] = tuple(solving["external"])
            return cls(Solving(**solving), TwinSettings(**note["twin"]), note["refine_lights"], truth and Path(truth))

    def but(self, other: "Settings") -> "Settings":
        """Return these with what other ones say."""
        return Settings(
            replace(self.solving, **said(vars(other.solving))),
            replace(self.twin, **said(vars(other.twin))),
            self.refine_lights if other.refine_lights is None else other.refine_lights,
            other.truth or self.truth,
        )

    def keep(self, record: Record) -> None:
        """Note them in the record of a folder that is held."""
        record.note(NOTE, plain(self))
