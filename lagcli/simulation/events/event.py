"""The protocol of events that a run may meet, and the log in which they report incidents."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.frozen import frozen
from lagcli.simulation.run_state.statistics import Incident, Kind
from lagcli.simulation.scheme import method
from lagcli.simulation.stepping.found_step import Cut, FoundStep
from lagcli.simulation.stepping.stepper import Stepper


class Screen(NamedTuple):
    """What tells that ordinary steps are nothing to an event, without asking it: nothing, where it foresees what it is
    for, or a function clear(t, h, y, k, new, k_new, p) -> a number above 0 for such a step, and maybe the largest -g_j
    at its end, as long as `holds` is true; t is the time of the model, and p may be as short as that of the model."""

    function: ca.Function | None = None
    holds: Callable[[], bool] = lambda: True


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
        """The step that leads over it where it is due; None where an ordinary step is to be found. Raises `StepFailure`
        where the motion does not go on."""
        return None

    def screen(self) -> Screen | None:
        """See `Screen`, with the functions that the run has now; None where it has to be asked about each step."""
        return None

    def found(self, step: FoundStep) -> Cut | None:
        """What it makes of a step, whichever found it, as those asked before have left it; None where it is nothing to
        it. The earliest end so stays. Raises `StepFailure` where the motion does not go on in it."""
        return None


@frozen
class InstantLines:
    """Lines of the table before and after an instant, and the impulses of all constraints at it (C + K,)."""

    before: Floats
    after: Floats
    impulses: Floats | None = None


class IncidentLog:
    """The incidents of one run; is_switched: it stands at its start, or has just been led across a switch, and the rows
    there are to come."""

    def __init__(self, stepper: Stepper) -> None:
        self._run = stepper
        self.is_switched = False
        self._rows = len(stepper.bound.enforced.system.multiplier_rows)

    def line(self) -> Floats:
        """The line of the state where the run stands, with time, figures and W."""
        return self.line_of(self._run.t, self._run.bound.y)

    def line_of(self, t: float, y: Floats) -> Floats:
        """The line of another state of the run (2n + 1,), at a time counted as its own."""
        rows = self._run.trial.rows
        rows.put(self._run.origin + t, y)
        return rows.line.copy()

    def incident(self, t: float, kind: Kind, name: str, sides: InstantLines) -> Incident:
        """An incident at a time of the run, from whole lines, of which it has the columns of the table."""
        impulses = np.zeros(self._rows) if sides.impulses is None else sides.impulses
        before, after = (line[1 : -method.BEYOND] + 0.0 for line in (sides.before, sides.after))
        return Incident(float(self._run.origin + t), kind, name, impulses, before, after)

    def report(self, kind: Kind, name: str, sides: InstantLines) -> None:
        """Tell of an incident where the run stands: behind a switch, at the time of the row there, if there is one."""
        run = self._run
        t = min(run.t, run.row_time) if self.is_switched else run.t
        run.statistics.add(self.incident(t, kind, name, sides))
