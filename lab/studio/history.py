"""Undo: every scene that was, and those that were taken back."""

from dataclasses import dataclass

from twin.description import TwinScene

LONGEST = 200
TOGETHER_S = 1.0
"""Changes of one number that follow each other faster are undone together: digits typed, a slider drawn."""


@dataclass(frozen=True)
class History:
    """A scene with its past.

    Parameters
    ----------
    scene : TwinScene
    past, future : tuple of (label, TwinScene)
        The label is of the change that led away from the scene (past), or to it (future).
    """

    scene: TwinScene
    past: tuple[tuple[str, TwinScene], ...] = ()
    future: tuple[tuple[str, TwinScene], ...] = ()
    last: tuple[str, float] | None = None

    def did(self, label: str, scene: TwinScene, now_s: float) -> "History":
        """Return the history after a change, at a time in seconds."""
        goes_on = self.last is not None and self.last[0] == label and now_s - self.last[1] < TOGETHER_S
        past = self.past if goes_on and self.past else (*self.past, (label, self.scene))[-LONGEST:]
        return History(scene, past, (), (label, now_s))

    def undone(self) -> "History":
        """Return the history before the last change; itself where there is none."""
        if not self.past:
            return self
        *past, (label, scene) = self.past
        return History(scene, tuple(past), ((label, self.scene), *self.future))

    def redone(self) -> "History":
        """Return the history with the change that was undone last; itself where there is none."""
        if not self.future:
            return self
        (label, scene), *future = self.future
        return History(scene, (*self.past, (label, self.scene)), tuple(future))
