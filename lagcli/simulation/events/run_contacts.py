"""The one-sided constraints of a run where it stands: which are closed, and what the law of contacts says of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lagcli.linear import rank
from lagcli.simulation.closed_contacts.contact_change import ContactsUndecided
from lagcli.simulation.closed_contacts.contact_instant import (
    ContactInstant,
    ContactParameters,
    ContactRowValues,
    Flags,
)
from lagcli.simulation.closed_contacts.contact_series import MotionSeries
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme import step_end
from lagcli.simulation.singularity import singular_point
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.singularity.singularity_monitor import SingularityMonitor
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]
Found = TypeVar("Found")


class RunContacts:
    """All K contacts of a run.

    rows: C, the number of equality rows; count: K; open_: the selection without contacts; series: of the motion with
    them open; names: of all (K,).
    """

    def __init__(self, run: Stepper) -> None:
        enforced = run.bound.enforced
        self.run, self.system = run, enforced.system
        self.rows, self.count = len(self.system.rows.rows), self.system.contacts.count
        self.names = self.system.model.contact_names
        self.open_ = enforced.selection.opened(self.rows)
        plain = enforced.plain.functions.numeric
        # A run that is resumed may stand with contacts closed.
        base = plain if plain.selection == self.open_ else plain.keeping(self.open_)
        self._values = ContactRowValues(base, self.rows)
        self.series = MotionSeries(base)

    @property
    def closed(self) -> tuple[int, ...]:
        """The contacts that press."""
        return tuple(i - self.rows for i in self.run.bound.numeric.closed_rows)

    @property
    def idle(self) -> tuple[int, ...]:
        """The contacts that lie closed on others and carry nothing."""
        return tuple(i - self.rows for i in self.run.bound.numeric.idle_rows)

    @property
    def lying(self) -> set[int]:
        """The contacts that are closed, whether they press or not."""
        return {*self.closed, *self.idle}

    def here(self, span: float, across: float = 0.0) -> ContactInstant:
        """The contacts where the run stands, at one of the ends of a step of this span, a time across behind a
        switch."""
        return self.at(self.run.t, self.run.bound.y, span, across)

    def at(self, t: float, y: Floats, span: float, across: float = 0.0) -> ContactInstant:
        """The contacts at another state of the run (2n + 1,), likewise."""
        run = self.run
        given = float(run.tolerance[0]), span, run.contacts.size
        times = {"across": max(across, run.timetable.least), "ahead": run.control.step}
        chosen = ContactParameters(*given, since=t - run.grid.start, **times)
        return ContactInstant(self._values, run.state_at(t, y.copy()), chosen)

    def sunk(self, here: ContactInstant) -> Flags:
        """Contacts that touch without a push worth mentioning and creep in all the same, (K,): as slowly as something
        that falls over."""
        touching = np.zeros(here.g.size, dtype=bool)
        touching[list(self.run.contacts.touching)] = True
        return np.asarray(touching & (here.g < -here.touching_gap) & (here.speeds < 0.0))

    def decided(self, law: Callable[[], Found]) -> Found:
        """What the law says. Raises `StepFailure` where it says nothing."""
        try:
            return law()
        except ContactsUndecided as error:
            names = ", ".join(f"`{self.names[j]}`" for j in error.contacts)
            raise StepFailure(f"{error}: {names}", run_stop.CONTACT) from None


# So close the law of impact may take them for dependent, and they then change the velocities that it gives by more
# than this part.
DEPENDENT, SATISFIED = 10 * rank.PARAMETERS.large, 1e-5
# By this part of a step ahead it is seen whether rows come closer to dependent ones.
BESIDE = 1e-4


def is_near(run: Stepper) -> bool:
    """True where rows are close to dependent ones."""
    return run.rank_margin[0] < step_end.PARAMETERS.close


def predict(run: Stepper) -> None:
    """Look at singular configurations ahead: what was seen before an incident belongs to another motion, and the first
    step from here may lead across one."""
    bound = run.bound
    run.watch = SingularityMonitor()
    if not bound.numeric.selection.independent:
        return
    status = bound.project.results[2]
    run.watch = run.watch.after(run.t, float(status[1]), float(status[2]))
    if not run.watch.rank_margin[0] < MONITOR.narrow:
        return
    offset = BESIDE * run.control.step
    _, _, status, *_ = bound.projected_at(run.t + offset, bound.y + offset * bound.k)
    run.count(1)
    watch = run.watch.after(run.t + offset, float(status[1]), float(status[2]))
    if watch.foreseen.is_any:
        watch = watch._replace(foreseen=watch.foreseen._replace(step=run.control.step))
    run.watch = watch


def require_projected(run: Stepper, wanted: Floats, before: Floats) -> None:
    """Raise `StepFailure` where the rows do not let the run go on with the velocities after an impact (n,)."""
    if not run.watch.rank_margin[0] < DEPENDENT:
        return
    n, y = wanted.size, run.bound.y
    sizes = run.bound.numeric.sizes(run.origin + run.t, y[:n], y[n : 2 * n], run.bound.enforced.p)
    units = np.array(sizes).ravel()[:n]
    off = float(np.abs((y[n : 2 * n] - wanted) / units).max(initial=0.0))
    size = float(np.abs(np.stack([wanted, before]) / units).max(initial=0.0))
    if off > SATISFIED * size:
        raise stop(run, "an impact of which the velocities are not determined")


def stop(run: Stepper, what: str) -> StepFailure:
    """The reason to stop where rows are so close to dependent ones that rounding is amplified."""
    rows = singular_point.closest(run.bound.numeric, run.state_at(run.t, run.bound.y), False)
    system = run.bound.enforced.system
    names = ", ".join(f"`{system.multiplier_rows[i].name}`" for i in rows)
    return StepFailure(
        f"{what}: the rows {names} are within {run.rank_margin[0]:.1g} of dependent ones there, a singular"
        " configuration, at which rounding is amplified",
        run_stop.SINGULAR,
    )
