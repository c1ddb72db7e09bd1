"""The protocol of events that a run may meet."""

from __future__ import annotations

from lagcli.simulation.stepping.found_step import Cut, FoundStep


class Event:
    """A thing that ordinary steps do not lead over: it is asked, and the stepper acts on its answer. By default it has
    nothing to say."""

    # True where steps are looked at beyond the end of the run, so that what happens before it does not depend on it.
    looks_ahead: bool = False
    # True where the dense output of every step may be asked for, and not only that of one that holds rows.
    keeps_stages: bool = False

    def begin(self) -> None:
        """Act on the start of a run."""

    def leaves(self) -> FoundStep | None:
        """The step that leads from a start on a switch of the state to a side of it, where it stands on one."""
        return None

    def passes(self) -> FoundStep | None:
        """The step that leads over it where it is due; None where an ordinary step is to be found.

        Raises `StepFailure` where the motion does not go on.
        """
        return None

    def found(self, step: FoundStep) -> Cut | None:
        """What it makes of a step, whichever found it, as those asked before have left it; None where it is nothing to
        it.

        The earliest end so stays. Raises `StepFailure` where the motion does not go on in it.
        """
        return None
