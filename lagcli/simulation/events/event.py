"""The protocol of events that a run may meet."""

from __future__ import annotations


class Event:
    """A thing that ordinary steps do not lead over. It is asked before each step and after it; by default it has
    nothing to say."""

    # True where steps are looked at beyond the end of the run, so that what happens before it does not depend on it.
    looks_ahead: bool = False

    def passes(self) -> bool:
        """Find a step that leads over it where it is due; False where an ordinary step is to be found.

        Raises `StepFailure` where the motion does not go on.
        """
        return False

    def cut(self) -> None:
        """End the step just found, whichever found it, where the motion does not go on in it."""

    def begin(self) -> None:
        """Act on the start of a run."""

    def leaves(self) -> bool:
        """Find the step that leads from a start on a switch of the state to a side of it, where it stands on one."""
        return False

    def end(self) -> None:
        """Tell of what the last step holds, where the run ends with it."""

    def act(self) -> None:
        """Act on the state that a step has led to, once it is accepted."""
