"""The one-sided constraints of a run where it stands: which are closed, and what the law of contacts says of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.linear import rank
from lagcli.memory import Memory
from lagcli.simulation.closed_contacts.contact_change import ContactsUndecided
from lagcli.simulation.closed_contacts.contact_instant import (
    ContactInstant,
    ContactParameters,
    ContactRowValues,
)
from lagcli.simulation.closed_contacts.contact_mode import MotionSeries
from lagcli.simulation.closed_contacts.impact_series import ClosedBefore
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme import step_end
from lagcli.simulation.singularity import singularity_step
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.singularity.singularity_monitor import SingularityMonitor
from lagcli.simulation.stepping.step_trial import BESIDE
from lagcli.simulation.stepping.stepper import Stepper

Found = TypeVar("Found")


class RunContacts:
    """All K contacts of a run. rows: C, the number of equality rows; count: K; open_: the selection without contacts;
    names: of all (K,)."""

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
        self._base, self._series = base, Memory()

    def series(self, contacts: Sequence[int]) -> MotionSeries:
        """The series of the motion with all contacts open, and the rows of some."""
        numbers = tuple(contacts)
        return self._series.answer(numbers, lambda: MotionSeries(self._base, numbers))

    @property
    def closed(self) -> tuple[int, ...]:
        """The contacts that press."""
        return tuple(i - self.rows for i in self.run.bound.numeric.closed_rows)

    @property
    def idle(self) -> tuple[int, ...]:
        """The contacts that lie closed on others and carry nothing."""
        return tuple(i - self.rows for i in self.run.bound.numeric.selection.idle_rows)

    @property
    def lying(self) -> set[int]:
        """The contacts that are closed, whether they press or not."""
        return {*self.closed, *self.idle}

    def here(self, span: float, across: float = 0.0, asked: Iterable[int] = ()) -> ContactInstant:
        """The contacts where the run stands, at one of the ends of a step of this span, a time across behind a switch;
        asked: as `ContactInstant` takes it, besides those that are closed or touch."""
        return self.at(self.run.t, self.run.bound.y, span, across, asked)

    def at(
        self,
        t: float,
        y: Floats,
        span: float,
        across: float = 0.0,
        asked: Iterable[int] = (),
        is_near: bool = True,
    ) -> ContactInstant:
        """The contacts at another state of the run (2n + 1,), likewise."""
        run = self.run
        given = float(run.tolerance[0]), span, run.contacts.size
        times = {"across": max(across, run.timetable.least), "ahead": run.control.step}
        chosen = ContactParameters(*given, since=t - run.grid.start, **times)
        numbers = sorted({*self.lying, *run.contacts.touching, *asked})
        state = run.state_at(t, y.copy())
        return ContactInstant(self._values, state, chosen, np.array(numbers, dtype=np.intp), is_near)

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
    rows = singularity_step.closest(run.bound.numeric, run.state_at(run.t, run.bound.y), False)
    system = run.bound.enforced.system
    names = ", ".join(f"`{system.multiplier_rows[i].name}`" for i in rows)
    return StepFailure(
        f"{what}: the rows {names} are within {run.rank_margin[0]:.1g} of dependent ones there, a singular"
        " configuration, at which rounding is amplified",
        run_stop.SINGULAR,
    )


# A contact, its impacts since the last of at most four times, the time of the last one, and the times.
Crowd = tuple[int, int, float, tuple[float, ...]]


# Impacts of a contact between two of these times: an impact costs what a few steps do, those between four times some
# seconds; and those of one contact that may be to come, some minutes.
MANY, MOST = 1_000, 1_000_000
# An elastic contact has no last rebound; of others it is lost in rounding after so many times 1/(1 - e).
LAST = -math.log(doubles.EPS)


def between(restitution: float) -> int:
    """The impacts of a contact between two of the four times by which it is asked how many are to come."""
    own = LAST / 3 / (1.0 - restitution) if restitution < 1.0 else math.inf
    return max(MANY, int(own)) if own <= MOST else MANY


def to_come(times: Sequence[float], count: int, end: float) -> float:
    """The impacts up to an end, after four times with so many between each two, if they go on as they did; infinite
    where they would be more than may be.

    A ball between a heavy body and a wall is struck ever faster, and ever more slowly once the heavy body has turned; a
    piston that closes in on it never turns. In both the intervals are 1/u^2 of a number of the impact with u'' = -k^2
    u: on a billiard table that is unfolded the ball goes straight on, and impacts lie at equal angles (G. Galperin,
    Playing pool with pi, 2003). Impacts at one pace, and on a parabola of times, are those with k = 0.

    As fast as they are now, or with u at the times: D_i = S/(u_i u_i+1) are the times between, and u_i+1 + u_i-1 =
    2 c u_i, so that c^2 = (D_1 + D_2)(D_2 + D_3)/(4 D_1 D_3).
    """
    most, (first, second, third) = MOST / count, (b - a for a, b in itertools.pairwise(times))
    if third > 0 and (end - times[-1]) / third <= most:
        return count * (end - times[-1]) / third
    if not min(first, second, third) > 0:
        return math.inf
    c = math.sqrt((first + second) * (second + third) / (4 * first * third))
    u = (1 + first / second) / (2 * c)
    total, before, now, t = first * u, first / second, u * second / third, times[-1]
    for windows in range(int(most)):
        before, now = now, 2 * c * now - before
        if now <= 0 or t >= end:
            return float(windows * count)
        t += total / (before * now)
    return math.inf


def counted(
    crowds: tuple[Crowd, ...], struck: Iterable[int], restitution: Sequence[float], t: float
) -> tuple[Crowd, ...]:
    """The crowds with one impact more at time t of each contact that is struck."""
    found = {crowd[0]: crowd for crowd in crowds}
    for j in struck:
        _, count, _, times = found.get(j, (j, 0, t, ()))
        is_next = not times or count + 1 >= between(restitution[j])
        found[j] = (j, 0, t, (*times[-3:], t)) if is_next else (j, count + 1, t, times)
    return tuple(found[j] for j in sorted(found))


def before(run: Stepper, pressed: Iterable[int], contacts: int) -> ClosedBefore:
    """The contacts, so many, of a run before an impact; pressed: those that press, or lie on them."""
    presses, touching, bouncing = np.zeros((3, contacts), dtype=bool)
    presses[list(pressed)], touching[list(run.contacts.touching)] = True, True
    bouncing[list(run.contacts.apart)] = True
    last = np.full(contacts, np.nan)
    late = run.t - (run.grid.end - run.grid.start) * MANY / MOST
    for j, _, t, _ in run.contacts.crowds:
        last[j] = t if t >= late else np.nan
    return ClosedBefore(presses, touching & ~bouncing, bouncing, last)


def count(run: Stepper, impacts: list[Flags], restitution: Floats, names: Sequence[str]) -> None:
    """Count impacts where the run stands, of contacts (K,) each. Raises `StepFailure` where they would have no end."""
    crowds, e = run.contacts.crowds, restitution.tolist()
    for struck in impacts:
        crowds = counted(crowds, np.flatnonzero(struck).tolist(), e, run.t)
    run.note(crowds=crowds)
    for j, since, t, times in crowds:
        if since or t < run.t or len(times) < 4:
            continue
        number = between(e[j])
        if to_come(times, number, run.grid.end) > MOST:
            named = (f"`{names[i]}`" for i, _, _, own in crowds if i == j or own[1:2] >= times[:1])
            raise StepFailure(
                f"impacts crowd without end, {3 * number} within {run.t - times[0]:.2g} of time, of {', '.join(named)}:"
                " they lose next to nothing between walls that close in, or on a contact that is met too slowly to tell"
                " it from rest (with a `restitution` below 1 they end; on a contact that is only touched begin with"
                " dg/dt = 0)",
                run_stop.CONTACT,
            )
