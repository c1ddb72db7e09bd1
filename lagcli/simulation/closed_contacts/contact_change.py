"""Contacts at one instant: impacts, and those that press (theory of one-sided constraints)."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable

import numpy as np

from lagcli import doubles
from lagcli.contact import complementarity, few_contacts, impact_law
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, Flags, Floats, Numbers

# The tail of a series of rebounds is left out where its coefficient is below this.
ELASTIC = 1.0
NO_GRADIENT = (
    "there is no finite gradient where the contact closes (write the condition with a slope at its surface, as"
    " `x >= 0` in place of `sqrt(x) >= 0`)"
)
NOT_LINEAR = "momenta are not linear in the velocities, and the law of impact is for those that are"


class ContactsUndecided(Exception):
    """The law has no answer for some of the contacts, which are given by their numbers."""

    def __init__(self, text: str, contacts: Iterable[int]) -> None:
        super().__init__(text)
        self.contacts = tuple(sorted(int(j) for j in contacts))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ImpactResult:
    """An impact: the velocities after it (n,), impulses of the equality rows (C,) and of the contacts
    (K,).

    onward: the velocities with which the run goes on, without the rebounds that are left out (n,); impacting: contacts
    that approached, or take an impulse; ended: contacts whose rebounds end here, or that would rise no higher than
    those, with the time `lasting` that what is left out would have taken, (K,) each; shared: numbers of the rows among
    all C + K whose impulses are not unique; accumulated: contacts of which this is the limit of infinitely many
    impacts, (K,); apart: contacts that go on with a gap above zero, even where it is not told from it, (K,); way: the
    displacement (n,) since the first of impacts that follow each other at once.
    """

    v: Floats
    onward: Floats
    of_equalities: Floats
    of_contacts: Floats
    impacting: Flags
    ended: Flags
    lasting: Floats
    shared: tuple[int, ...]
    accumulated: Flags
    apart: Flags
    way: Floats | None = None


def impact(here: ContactInstant, restitution: Floats, among: Flags) -> ImpactResult | None:
    """The impact of the contacts `among` all, which are closed; None where none of them approaches.

    Rebounds that cannot be resolved, of contacts that are pressed, are left out: their series ends.
    Raises `ContactsUndecided`.
    """
    approaching = among & (here.speeds < -here.slow)
    if not approaching.any():
        return None
    if not here.has_linear_momenta:
        # The jump of M v is not that of dL/dq', and what half the sum of the speeds does is not the energy.
        raise ContactsUndecided(NOT_LINEAR, np.flatnonzero(approaching))
    e = restitution.copy()
    lasting, ended = np.zeros(e.size), np.zeros(e.size, dtype=bool)
    near = np.flatnonzero(among)
    _require_gradients(here, near)
    found = onward = law(here, near, e)
    # Each turn ends the series of some contact, so that there are few.
    for _ in near[(e[near] > 0) & (e[near] < ELASTIC)]:
        after = here.moved(onward.x)
        small, pull = _unresolved(after, near, e)
        if not small.size:
            break
        lasting[small] = 2 * after.speeds[small] / (pull * (ELASTIC - e[small]))
        ended[small] = approaching[small]
        e[small] = 0.0
        onward = law(here, near, e)
    # Those that the impact is none of, too: without the rebounds it may leave them closed.
    others = np.flatnonzero(here.near & ~ended)
    if here.near.sum() > 1 and others.size:
        after = here.moved(onward.x)
        reported = after if onward is found else here.moved(found.x)
        lifted, pull = _staying_closed(reported, after, others)
        # With e = 1 there is no end: of that one flight is reported.
        left = np.where(restitution[lifted] < ELASTIC, ELASTIC - restitution[lifted], 1.0)
        lasting[lifted], ended[lifted] = 2 * reported.speeds[lifted] / (pull * left), True
    impulses = np.zeros(e.size)
    impulses[near] = found.of_contacts
    impacting = approaching.copy()
    others = near[(found.of_contacts > 0) & ~impacting[near]]
    if others.size:
        # Less would take a speed away that counts as none.
        still = near[~approaching[near]]
        left = np.maximum(np.abs(here.speeds[still]), here.speed_roundoff[still])
        impacting[others] = impulses[others] > 2.0 * float((left / here.squares(still)).max())
    rows = np.concatenate([np.arange(found.of_equalities.size), found.of_equalities.size + near])
    shared = tuple(rows[~found.unique].tolist())
    none, apart = np.zeros(e.size, dtype=bool), approaching & (restitution > 0)
    return ImpactResult(
        found.x, onward.x, found.of_equalities, impulses, impacting, ended, lasting, shared, none, apart
    )


def law(here: ContactInstant, near: Numbers, e: Floats) -> impact_law.LawResult:
    """The impact of the contacts `near` with coefficients e (K,). Raises `ContactsUndecided`."""
    try:
        if near.size == 1 and here.has_independent_rows:
            j = int(near[0])
            single = few_contacts.single(here.state.v, float(here.speeds[j]), float(e[j]), here.response(j))
            if single is not None:
                return single
        few = here.few(near)
        if few is not None and near.size > 1:
            # The general law knows what energy is at hand, of which rounding is a part.
            with contextlib.suppress(impact_law.EnergyCreated):
                found = few.impact(here.state.v, here.speeds[near], e[near], here.terms(near))
                if found is not None:
                    return found
        B, b, _ = here.equalities
        contacts = here.gradients(near), here.g_t[near], e[near]
        return impact_law.impact(here.metric, here.state.v, (B, b), contacts)
    except impact_law.LawError as error:
        raise ContactsUndecided(str(error), near[list(error.contacts)]) from None


def _require_gradients(here: ContactInstant, contacts: Numbers) -> None:
    without = contacts[~here.has_gradient[contacts]]
    if without.size:
        raise ContactsUndecided(NO_GRADIENT, without)


def _unresolved(after: ContactInstant, near: Numbers, e: Floats) -> tuple[Numbers, Floats]:
    """Contacts that rebound and are pressed so that they rise no higher than rounding, and -d2g/dt2 of them."""
    speeds = after.speeds[near]
    bouncing = near[(speeds > 0) & (e[near] > 0) & (e[near] < ELASTIC)]
    if bouncing.size:
        # They rise at most as their largest acceleration lets them: most are decided at once.
        bouncing = bouncing[_is_low(after, bouncing, after.pull[bouncing])]
    if not bouncing.size:
        return bouncing, np.zeros(0)
    lying = after.at_rest
    lying[bouncing] = False
    pull = -contact_forces(after, lying).accelerations[bouncing]
    small = (pull > 0) & _is_low(after, bouncing, pull)
    return bouncing[small], pull[small]


def _staying_closed(
    reported: ContactInstant, after: ContactInstant, among: Numbers
) -> tuple[Numbers, Floats]:
    """Contacts that part by the law, `reported`, but stay closed without the rebounds that are left out, `after`, and
    -d2g/dt2 of them, which presses: those that an impact of others lifts too slowly, or by such a rebound."""
    speeds = reported.speeds[among]
    lifted = among[speeds > 0]
    if lifted.size:
        is_slow = np.abs(after.speeds[lifted]) <= after.slow[lifted]
        lifted = lifted[is_slow & (reported.speeds[lifted] > reported.speed_roundoff[lifted])]
    if not lifted.size:
        return lifted, np.zeros(0)
    rests = after.at_rest
    rests[lifted] = False
    pull = -contact_forces(after, rests).accelerations[lifted]
    return lifted[pull > 0], pull[pull > 0]


def _is_low(after: ContactInstant, bouncing: Numbers, pull: Floats) -> Flags:
    """Contacts that rise no higher than rounding under a pull (k,), or so slowly that they count as closed."""
    speeds = after.speeds[bouncing]
    return np.asarray((speeds**2 <= 2 * pull * after.lowest[bouncing]) | (speeds <= after.slow[bouncing]))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactForces:
    """Accelerations x (n,), d2g/dt2 of all contacts (K,), and those that are closed and press."""

    x: Floats
    accelerations: Floats
    closed: tuple[int, ...]


def contact_forces(here: ContactInstant, among: Flags, sunk: Flags | None = None) -> ContactForces:
    """The forces of contacts that are closed and neither approach nor part: 0 <= lambda ⊥ d2g/dt2 >= 0.

    sunk (K,): contacts that creep in: they press with any force, and where nothing takes them out.
    Raises `ContactsUndecided`.
    """
    numbers = np.flatnonzero(among)
    _require_gradients(here, numbers)
    few = _forces_of_few(here, numbers, sunk)
    if few is not None:
        return few
    B, _, gamma = here.equalities
    try:
        found = impact_law.forces(
            here.metric, here.force, (B, gamma), (here.gradients(numbers), here.gamma[numbers])
        )
    except impact_law.LawError as error:
        raise ContactsUndecided(str(error), numbers[list(error.contacts)]) from None
    return _carrying(here, numbers, (found.x, found.of_contacts), sunk)


def opening(here: ContactInstant, among: Flags) -> Flags:
    """Closed contacts `among` all that forces open, (K,)."""
    forces, numbers, opened = contact_forces(here, among), np.flatnonzero(among), np.zeros_like(among)
    none = here.least_forces(numbers, forces.x) * here.squares(numbers)
    opened[numbers] = forces.accelerations[numbers] > none
    return opened


def _forces_of_few(here: ContactInstant, numbers: Numbers, sunk: Flags | None) -> ContactForces | None:
    """The forces for few contacts, by formulas; None where rounding is too large for them."""
    few = here.few(numbers)
    if few is None:
        return None
    free = here.open_acceleration
    c = here.changes(free) - here.gamma
    rounding = (
        complementarity.PARAMETERS.safe * doubles.EPS * (here.sizes_of_changes(free) + np.abs(here.gamma))
    )
    z = few.solve(c[numbers], rounding[numbers])
    return None if z is None else _carrying(here, numbers, (few.moved(free, z), z), sunk)


def _carrying(
    here: ContactInstant, numbers: Numbers, found: tuple[Floats, Floats], sunk: Flags | None
) -> ContactForces:
    """The contacts that press, from accelerations (n,) and forces of contacts (k,)."""
    x, forces = found
    accelerations = here.changes(x) - here.gamma
    presses = forces > here.least_forces(numbers, x)
    if sunk is not None:
        # Within a step nothing takes it out again.
        none = accelerations * here.span**2 <= here.touching_gap
        presses |= sunk[numbers] & ((forces > 0.0) | none[numbers])
    return ContactForces(x, accelerations, tuple(numbers[presses].tolist()))
