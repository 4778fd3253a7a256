"""What was done and can be undone: a state, the ones before it and the ones that were taken back."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

State = TypeVar("State")
LONGEST = 200
TOGETHER_S = 1.0
"""Changes by one input that follow each other faster are undone together: digits typed, a slider or a knob drawn."""


@dataclass(frozen=True)
class History(Generic[State]):
    """A state with its past.

    past, future: The label is of the change that led away from the state (past), or to it (future).
    last: Of the last change, where an input made it.
    """

    state: State
    past: tuple[tuple[str, State], ...] = ()
    future: tuple[tuple[str, State], ...] = ()
    last: tuple[str, Any, float] | None = None

    def did(self, label: str, state: State, now_s: float, control: Any = None) -> "History[State]":
        """Return the history after a change.

        control: The input that made it; None: none did, and it is undone alone.
        """
        was = self.last if control is not None else None
        goes_on = was is not None and was[:2] == (label, control) and now_s - was[2] < TOGETHER_S and self.past
        past = self.past if goes_on else (*self.past, (label, self.state))[-LONGEST:]
        return History(state, past, (), None if control is None else (label, control, now_s))

    def undone(self) -> "History[State]":
        """Return the history before the last change; itself where there is none."""
        if not self.past:
            return self
        *past, (label, state) = self.past
        return History(state, tuple(past), ((label, self.state), *self.future))

    def redone(self) -> "History[State]":
        """Return the history with the change that was undone last; itself where there is none."""
        if not self.future:
            return self
        (label, state), *future = self.future
        return History(state, (*self.past, (label, self.state)), tuple(future))

    def changed(self, edit: Callable[[State], State]) -> "History[State]":
        """Return the history with another state in the place of this one: nothing to undo."""
        return History(edit(self.state), self.past, self.future)
