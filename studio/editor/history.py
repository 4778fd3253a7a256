"""Undo: every scene that was, and those that were taken back."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from twin.description.description import TwinScene

LONGEST = 200
TOGETHER_S = 1.0
"""Changes by one input that follow each other faster are undone together: digits typed, a slider drawn."""


@dataclass(eq=False)
class Document:
    """What is saved as one: the scenes that were made of each other by changes share it.

    name: What the browser calls the folder that it is to be saved to.
    folder: Where it was opened from, or saved to last; None: nowhere yet.
    """

    name: str = "scene"
    folder: Path | None = None


Step = tuple[str, TwinScene, Document]


@dataclass(frozen=True)
class History:
    """A scene with its past.

    past, future: The label is of the change that led away from the scene (past), or to it (future).
    last: Of the last change, where an input made it.
    document: Of the scene.
    """

    scene: TwinScene
    past: tuple[Step, ...] = ()
    future: tuple[Step, ...] = ()
    last: tuple[str, Any, float] | None = None
    document: Document = field(default_factory=Document)

    def did(
        self, label: str, scene: TwinScene, now_s: float, control: Any = None, *, document: Document | None = None
    ) -> "History":
        """Return the history after a change.

        control: The input that made it; None: none did, and it is undone alone. document: None: the scene's so far.
        """
        was = self.last if control is not None else None
        goes_on = was is not None and was[:2] == (label, control) and now_s - was[2] < TOGETHER_S and self.past
        past = self.past if goes_on else (*self.past, self._left(label, scene))[-LONGEST:]
        last = None if control is None else (label, control, now_s)
        return History(scene, past, (), last, document or self.document)

    def undone(self) -> "History":
        """Return the history before the last change; itself where there is none."""
        if not self.past:
            return self
        *past, (label, scene, document) = self.past
        return History(scene, tuple(past), (self._left(label, scene), *self.future), document=document)

    def redone(self) -> "History":
        """Return the history with the change that was undone last; itself where there is none."""
        if not self.future:
            return self
        (label, scene, document), *future = self.future
        return History(scene, (*self.past, self._left(label, scene)), tuple(future), document=document)

    def _left(self, label: str, now: TwinScene) -> Step:
        """Return the scene as it is kept when another takes its place: without what it has worked out of itself.

        Two hundred scenes would each keep their vertices in the camera frame.
        """
        vars(self.scene).pop("points", None)
        shared = {id(one) for one in now.objects}
        for one in self.scene.objects:
            if id(one) not in shared:
                vars(one).pop("placed", None)
        return label, self.scene, self.document
