"""The one-sided constraints of a run where it stands: which are closed, and what the law of contacts says of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lagcli.simulation.closed_contacts import contact_mode
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
        return contact_mode.closed_in(self.run.bound.numeric, self.rows)

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
