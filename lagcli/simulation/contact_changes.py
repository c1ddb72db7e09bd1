"""Impacts and changes of closed contacts at an incident of a run, told with their impulses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lagcli.simulation import contact_change, contact_mode, line_functions, run_stop
from lagcli.simulation.contact_change import Blow, ContactsUndecided
from lagcli.simulation.contact_instant import ContactInstant, ContactParameters, ContactRowValues
from lagcli.simulation.incident import Incident, Kind
from lagcli.simulation.run_stop import StepFailure
from lagcli.simulation.singularity_monitor import NEVER, SingularityMonitor
from lagcli.simulation.singularity_step import SingularStep
from lagcli.simulation.state_ahead import Ahead
from lagcli.simulation.stepper import Stepper

Floats = npt.NDArray[np.float64]
Found = TypeVar("Found")

# Changes without a step between them, after which a run stops.
MOST_AGAIN = 64
# Places within the passing of a singular configuration at which gaps are looked at.
PASSING = np.linspace(0.0, 1.0, 33)


class ContactChanges:
    """The contacts of a run at its state."""

    def __init__(self, stepper: Stepper) -> None:
        self._run = stepper
        self._system = system = stepper.bound.held.integrals.system
        self._rows, self._count = len(system.rows.rows), system.contacts.count
        self._open = stepper.bound.held.integrals.selection.opened(self._rows)
        self._base = stepper.bound.held.plain.functions.numeric
        self._values = ContactRowValues(self._base, list(self._open.kept))
        e = [law.restitution for law in system.model.inequality if law.members.count]
        self._restitution = np.concatenate(e) if e else np.zeros(0)

    @property
    def closed(self) -> tuple[int, ...]:
        """The contacts that press."""
        return contact_mode.closed_in(self._run.bound.numeric, self._rows)

    def row_of(self, line: Floats) -> Floats:
        """The columns of the table, of a line."""
        return np.asarray(line[1 : -line_functions.BEYOND]) + 0.0

    def here(self) -> ContactInstant:
        """The contacts where the run stands."""
        return self._instant(self._run.t, self._run.bound.y)

    def _instant(self, t: float, y: Floats) -> ContactInstant:
        run = self._run
        chosen = ContactParameters(float(run.tolerance[0]), run.found.taken, run.contacts.size)
        return ContactInstant(self._values, run.state_at(t, y.copy()), chosen)

    def noises(self) -> tuple[Floats, Floats]:
        """Of gaps and of multipliers (K,) at the state: what is zero there."""
        here = self.here()
        gaps = here.noise.copy()
        touching = list(self._run.contacts.touching)
        gaps[touching] = here.nearness[touching]
        if self._run.contacts.again == 0:
            self._require_apart(here)
        forces = np.zeros(self._count)
        if self.closed:
            closed = np.array(self.closed, dtype=np.intp)
            forces[closed] = here.least_forces(closed)
        return gaps, forces

    def _require_apart(self, here: ContactInstant) -> None:
        deep = np.flatnonzero(here.g < -2 * here.nearness)
        if deep.size:
            worst = int(deep[np.argmin(here.g[deep])])
            name = self._system.contacts.rows[worst].name
            raise StepFailure(
                f"`{name}` is violated by {-here.g[worst]:.3g} without a contact: it jumps there",
                run_stop.CONTACT,
            )

    def unresolved(self) -> str:
        """The reason to stop where the zeros of a gap cannot be told apart."""
        return "a gap of an inequality, or a declared event, crosses zero so often that its zeros cannot be told apart"

    def require_clear(self, passage: SingularStep) -> None:
        """Raise `StepFailure` where a contact closes in the passing of a singular configuration."""
        step, here = passage.step, self.here()
        open_ = sorted(set(range(self._count)) - set(self.closed))
        for x in PASSING:
            g = np.array(
                self._base.gaps(self._run.origin + step.t + x * step.h, step.state(x), self._run.bound.held.p)
            )
            if (g.ravel()[open_] < -here.nearness[open_]).any():
                raise StepFailure(
                    "a contact closes while a singular configuration is passed", run_stop.CONTACT
                )

    def begin(self) -> None:
        """Decide the contacts at the start; an impact there is an incident."""
        here = self.here()
        if here.near.any():
            self._change(here, None, is_start=True)

    def at(self, hits: tuple[int, ...], ahead: Ahead | None) -> None:
        """Change what changes where watched functions cross zero, by the numbers of their rows."""
        run = self._run
        if run.contacts.again > MOST_AGAIN:
            names = ", ".join(
                f"`{self._system.multiplier_rows[i].name}`" for i in hits if i < self._rows + self._count
            )
            raise StepFailure(
                f"the contacts {names} open and close without end at one instant", run_stop.CONTACT
            )
        first = self._rows + self._count
        self._events([i - first for i in hits if i >= first])
        if any(i < first for i in hits):
            self._change(self.here(), ahead, hits=hits)
        else:
            run.contacts = dataclasses.replace(run.contacts, unarmed=hits, last=run.t)

    def _events(self, numbers: list[int]) -> None:
        run = self._run
        if not numbers:
            return
        line = self._line()
        impulses = np.zeros(self._rows + self._count)
        for number in numbers:
            event = self._system.model.events[number]
            run.account.add(Incident(float(run.origin + run.t), "event", event.name, impulses, line, line))
            if event.action == "stop":
                run.account.ended_by = event.name

    def _line(self) -> Floats:
        return self.row_of(self._whole_line())

    def _whole_line(self) -> Floats:
        rows = self._run.rows
        rows.at[0] = self._run.origin + self._run.t
        rows.begin.trigger()
        return rows.line.copy()

    def _change(
        self,
        here: ContactInstant,
        ahead: Ahead | None,
        is_start: bool = False,
        hits: tuple[int, ...] = (),
    ) -> None:
        run, before, closed_before = self._run, self._whole_line(), set(self.closed)
        blow = self._decided(lambda: contact_change.impact(here, self._restitution))
        after = here
        if blow is None:
            level = after.near & (np.abs(after.speeds) <= after.slow)
        elif here.parts(blow.onward):
            level = np.zeros(self._count, dtype=bool)
        else:
            after = here.moved(blow.onward)
            level = after.near & (np.abs(after.speeds) <= after.slow)
        look = after
        if blow is None and ahead is not None:
            level[[*closed_before, *run.contacts.touching]] = True
            look = self._instant(ahead.t, ahead.y)
        closed: set[int] = set()
        if level.any():
            closed.update(self._decided(lambda: contact_change.pressing(look, level)).closed)
        touching = tuple(j for j in np.flatnonzero(level).tolist() if j not in closed)
        line = None
        if blow is not None and blow.ended.any():
            # The impact is told as it is, with rebounds that are left out from here on.
            self._go_on(after, closed - set(np.flatnonzero(blow.ended).tolist()), blow.v)
            line = self._whole_line()
        self._go_on(after, closed, here.state.v if blow is None else blow.onward)
        now = self._whole_line()
        line = now if line is None else line
        if blow is not None:
            # What the impact takes away is work done there: the balance of the energy goes on.
            run.bound.y[-1] += now[line_functions.JACOBI] - before[line_functions.JACOBI]
        unarmed = tuple(i for i in hits if i >= self._rows and i - self._rows in closed & closed_before)
        fresh = set() if blow is None else set(np.flatnonzero(blow.ended).tolist()) & closed
        ending = [each for each in run.contacts.ending if each[0] in closed - fresh]
        if blow is not None:
            ending += [(j, run.t + float(blow.lasting[j])) for j in sorted(fresh)]
        run.contacts = dataclasses.replace(
            run.contacts, touching=touching, unarmed=unarmed, last=run.t, size=here.size, ending=tuple(ending)
        )
        self._tell(_Told(before, line, blow, closed_before, closed), is_start)
        self.end_series()

    def end_series(self) -> None:
        """Tell of series of rebounds that end at the state where the run stands."""
        run = self._run
        due = [j for j, t in run.contacts.ending if t <= run.t]
        if not due:
            return
        line, names = self._line(), [row.name for row in self._system.contacts.rows]
        impulses = np.zeros(self._rows + self._count)
        kinds: tuple[Kind, ...] = ("accumulation", "contact")
        for kind in kinds:
            for j in due:
                run.account.add(Incident(float(run.origin + run.t), kind, names[j], impulses, line, line))
        left = tuple(each for each in run.contacts.ending if each[0] not in due)
        run.contacts = dataclasses.replace(run.contacts, ending=left, last=run.t)

    def _go_on(self, here: ContactInstant, closed: set[int], v: Floats) -> None:
        """Go on with these contacts closed, from velocities v (n,)."""
        run = self._run
        if closed != set(self.closed):
            selection = contact_mode.selection(self._open, here, sorted(closed), self._rows)
            run.bind(run.bound.held.keeping(selection))
            run.watch, run.foreseen = SingularityMonitor(), NEVER
        self._land(v)

    def _land(self, v: Floats) -> None:
        bound = self._run.bound
        n = v.size
        bound.y[n : 2 * n] = v
        bound.land.trigger()
        bound.y[:], bound.k[:], *_ = bound.land.results
        self._run.account.evaluations += 1

    def _tell(self, told: _Told, is_start: bool) -> None:
        run, names, blow = self._run, [row.name for row in self._system.contacts.rows], told.blow
        before, after = self.row_of(told.before), self.row_of(told.after)
        impulses = np.zeros(self._rows + self._count)
        kinds: list[tuple[Kind, Iterable[int]]] = []
        if blow is not None:
            impulses[list(self._open.kept)] = blow.of_equalities
            impulses[self._rows :] = blow.of_contacts
            kinds.append(("impact", np.flatnonzero(blow.struck).tolist()))
        if not is_start or blow is not None:
            ending = {j for j, _ in run.contacts.ending}
            kinds.append(("contact", sorted(told.closed - told.closed_before - ending)))
            kinds.append(("release", sorted(told.closed_before - told.closed)))
        for kind, contacts in kinds:
            for j in contacts:
                run.account.add(Incident(float(run.origin + run.t), kind, names[j], impulses, before, after))

    def _decided(self, law: Callable[[], Found]) -> Found:
        try:
            return law()
        except ContactsUndecided as error:
            names = ", ".join(f"`{self._system.contacts.rows[j].name}`" for j in error.contacts)
            raise StepFailure(f"{error}: {names}", run_stop.CONTACT) from None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """Lines before and after a change, the impact, and contacts that pressed and press."""

    before: Floats
    after: Floats
    blow: Blow | None
    closed_before: set[int]
    closed: set[int]
