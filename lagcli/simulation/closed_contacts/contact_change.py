"""Contacts at one instant: impacts, and those that press (theory of one-sided constraints)."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats, Indices
from lagcli.compiled import NumericSystem
from lagcli.contact import complementarity, impact_law
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant
from lagcli.smoothness import sides
from lagcli.start.initial import State

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
    """An impact: the velocities after it (n,), impulses of the equality rows (C,) and of the contacts (K,).

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
    """The impact of the contacts `among` all, which are closed; None where none of them approaches. Rebounds that
    cannot be resolved, of contacts that are pressed, are left out: their series ends. Raises `ContactsUndecided`."""
    approaching = among & (here.speeds < -here.slow)
    if not approaching.any():
        return None
    if not here.values.numeric.has_linear_momenta:
        # The jump of M v is not that of dL/dq', and what half the sum of the speeds does is not the energy.
        raise ContactsUndecided(NOT_LINEAR, np.flatnonzero(approaching))
    e = restitution.copy()
    lasting, ended = np.zeros(e.size), np.zeros(e.size, dtype=bool)
    near = np.flatnonzero(among)
    _require_gradients(here, near)
    found = onward = law(here, near, e)
    # Each turn ends the series of some contact, so that there are few: of those that rebound, and are pressed so that
    # they rise no higher than rounding.
    for _ in near[(e[near] > 0) & (e[near] < 1.0)]:
        after = here.moved(onward.x)
        bouncing = near[(after.speeds[near] > 0) & (e[near] > 0) & (e[near] < 1.0)]
        # They rise at most as their largest acceleration lets them: most are decided at once.
        bouncing = bouncing[_is_low(after, bouncing, after.pull[bouncing])]
        if not bouncing.size:
            break
        small, pull = _pressed(after, bouncing, is_low=True)
        if not small.size:
            break
        lasting[small] = 2 * after.speeds[small] / (pull * (1.0 - e[small]))
        ended[small] = approaching[small]
        e[small] = 0.0
        onward = law(here, near, e)
    # Those that the impact is none of, too: without the rebounds it may leave them closed. They part by the law, but an
    # impact of others lifts them too slowly, or by such a rebound.
    others = np.flatnonzero(here.near & ~ended)
    if here.near.sum() > 1 and others.size:
        after = here.moved(onward.x)
        reported = after if onward is found else here.moved(found.x)
        lifted = others[reported.speeds[others] > 0]
        is_slow = np.abs(after.speeds[lifted]) <= after.slow[lifted]
        lifted = lifted[is_slow & (reported.speeds[lifted] > reported.speed_roundoff[lifted])]
        if lifted.size:
            lifted, pull = _pressed(after, lifted)
            # With e = 1 there is no end: of that one flight is reported.
            left = np.where(restitution[lifted] < 1.0, 1.0 - restitution[lifted], 1.0)
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


def _pressed(after: ContactInstant, lifted: Indices, is_low: bool = False) -> tuple[Indices, Floats]:
    """Contacts among some that part, which the others that are at rest press, and -d2g/dt2 of them."""
    rests = after.at_rest
    rests[lifted] = False
    pull = -contact_forces(after, rests).accelerations[lifted]
    are_pressed = pull > 0
    if is_low:
        are_pressed &= _is_low(after, lifted, pull)
    return lifted[are_pressed], pull[are_pressed]


def law(here: ContactInstant, near: Indices, e: Floats) -> impact_law.LawResult:
    """The impact of the contacts `near` with coefficients e (K,). Raises `ContactsUndecided`."""
    try:
        if near.size == 1 and here.values.has_independent_rows:
            j = int(near[0])
            single = impact_law.single(here.state.v, float(here.speeds[j]), float(e[j]), here.response(j))
            if single is not None:
                return single
        few = here.few(near)
        if few is not None and near.size > 1:
            # The general law knows what energy is at hand, of which rounding is a part.
            with contextlib.suppress(impact_law.EnergyCreated):
                terms = here.sizes_of_changes(here.state.v) + np.abs(here.g_t)
                found = few.impact(here.state.v, here.speeds[near], e[near], terms[near])
                if found is not None:
                    return found
        B, b, _ = here.equalities
        contacts = here.gradients(near), here.g_t[near], e[near]
        return impact_law.impact(here.metric, here.state.v, (B, b), contacts)
    except impact_law.LawError as error:
        raise ContactsUndecided(str(error), near[list(error.contacts)]) from None


def _require_gradients(here: ContactInstant, contacts: Indices) -> None:
    without = contacts[~here.has_gradient[contacts]]
    if without.size:
        raise ContactsUndecided(NO_GRADIENT, without)


def _is_low(after: ContactInstant, bouncing: Indices, pull: Floats) -> Flags:
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
    """The forces of contacts that are closed and neither approach nor part: 0 <= lambda ⊥ d2g/dt2 >= 0. sunk (K,):
    contacts that creep in: they press with any force, and where nothing takes them out. Raises `ContactsUndecided`."""
    numbers = np.flatnonzero(among)
    _require_gradients(here, numbers)
    few, forces = here.few(numbers), None
    if few is not None:
        # By formulas, where rounding is not too large for them.
        free = here.values.open_acceleration(here.state)
        c = here.changes(free) - here.gamma
        sizes = here.sizes_of_changes(free) + np.abs(here.gamma)
        rounding = complementarity.PARAMETERS.safe * doubles.EPS * sizes
        forces = few.solve(c[numbers], rounding[numbers])
        x = free if forces is None else few.moved(free, forces)
    if forces is None:
        B, _, gamma = here.equalities
        contacts = here.gradients(numbers), here.gamma[numbers]
        try:
            found = impact_law.forces(here.metric, here.forces[0], (B, gamma), contacts)
        except impact_law.LawError as error:
            raise ContactsUndecided(str(error), numbers[list(error.contacts)]) from None
        x, forces = found.x, found.of_contacts
    accelerations = here.changes(x) - here.gamma
    presses = forces > here.least_forces(numbers, x)
    if sunk is not None:
        # Within a step nothing takes it out again.
        none = accelerations * here.chosen.span**2 <= here.touching_gap
        presses |= sunk[numbers] & ((forces > 0.0) | none[numbers])
    return ContactForces(x, accelerations, tuple(numbers[presses].tolist()))


def opening(here: ContactInstant, among: Flags) -> Flags:
    """Closed contacts `among` all that forces open, (K,)."""
    forces, numbers, opened = contact_forces(here, among), np.flatnonzero(among), np.zeros_like(among)
    none = here.least_forces(numbers, forces.x) * here.squares(numbers)
    opened[numbers] = forces.accelerations[numbers] > none
    return opened


class GradientParameters:
    """Thresholds at which the gradient of a gap vanishes or jumps; distances are parts of the size of the motion. The
    tests are of `tests/unit/test_numbers_of_steps.py`."""

    __slots__ = ()

    fallen: float = 1e-3
    """A gradient that has fallen to this part of that a step before is looked at.
    `test_a_fallen_gradient_is_looked_at`."""
    offset: float = 1e-10
    """How far aside is looked. `test_a_gradient_that_tells_no_change_vanishes`."""
    times: float = 10.0
    """And as many times the way to the zero of the gap, which is as far as its root is known.
    `test_a_gradient_that_tells_no_change_vanishes`."""
    off: float = 0.5
    """To this part a gradient that does not vanish tells the change.
    `test_a_gradient_that_tells_no_change_vanishes`."""
    closed: float = 10.0
    """Two sides of a jump are so many closed gaps apart. `test_sides_of_a_jump_are_ten_closed_gaps_apart`."""
    farther: float = 100.0
    """They, and the two sides of an edge that a motion could not pass, are looked at again this much farther off.
    `test_a_jump_stays_from_a_hundred_times_farther_off`,
    `test_an_edge_is_looked_for_a_little_before_and_behind_a_state`."""
    pairs: int = 3
    """Pairs of points on both sides that are compared. `test_three_pairs_of_sides_are_compared`."""


PARAMETERS = GradientParameters()


def require_directions(here: ContactInstant, fallen: Flags, kinked: Flags) -> None:
    """Raise `ContactsUndecided` for a contact that is closed and has no gradient to push along, (K,): one of those
    that have `fallen`, which vanishes, or one that is `kinked` by its expression, and jumps."""
    vanishing = [j for j in np.flatnonzero(fallen & here.has_gradient).tolist() if _vanishes(here, j)]
    if vanishing:
        raise ContactsUndecided(
            "the gradient vanishes where the contact closes, so that it tells no direction of the push (write the"
            " condition with a slope at its surface, as `x >= 0` in place of `x**3 >= 0`)",
            vanishing,
        )
    jumping = [j for j in np.flatnonzero(here.near & kinked & here.has_gradient).tolist() if _jumps(here, j)]
    if jumping:
        raise ContactsUndecided(
            "the gradient jumps where the contact closes: at an edge or in a corner one condition has no single"
            " direction of the push (declare each side as an inequality of its own)",
            jumping,
        )


def edges(numeric: NumericSystem, state: State, kinked: Flags, span: float) -> tuple[int, ...]:
    """The rows of closed contacts whose gradients jump a little before or after a state, on the way of its motion;
    span: the time that the motion has gone on."""
    first = numeric.selection.count - kinked.size
    closed = [i for i in numeric.closed_rows if kinked[i - first]]
    speed = float(np.abs(state.v).max(initial=0.0))
    if not closed or not speed > 0:
        return ()
    step = max(float(np.abs(state.q).max(initial=0.0)) / speed, span)

    def change(part: float) -> Floats:
        both = (
            np.array(numeric.contacts(state.t + h, state.q + h * state.v, state.v, state.p)[1])
            for h in (-part * step, part * step)
        )
        one, other = (G[[i - first for i in closed]] for G in both)
        return np.asarray(np.abs(other - one).max(axis=1) / (1e-300 + np.abs(one).max(axis=1)))

    jumps = sides.differ(
        change(doubles.ROOT), change(PARAMETERS.farther * doubles.ROOT), np.array(doubles.ROOT)
    )
    return tuple(i for i, is_edge in zip(closed, jumps, strict=True) if is_edge)


def fallen(here: ContactInstant, extents: Floats, contacts: Iterable[int]) -> Flags:
    """The contacts among some whose gradients are far smaller than they were, (K,); extents (K,): as `lowest`, of the
    step before; zero where nothing is known of it."""
    found = np.zeros(here.g.size, dtype=bool)
    found[list(contacts)] = True
    return np.asarray(found & (here.lowest <= PARAMETERS.fallen * extents))


def _vanishes(here: ContactInstant, contact: int) -> bool:
    """True if a gap changes far from its gradient where its zero may be."""
    way, slope = here.direction(contact)
    if not slope > 0:
        return True
    size = here.size or 1.0
    offset = max(PARAMETERS.times * abs(float(here.g[contact])) / slope, PARAMETERS.offset * size)
    changes = [float(here.displaced(part * way).g[contact] - here.g[contact]) for part in (offset, -offset)]
    told = offset * slope, -offset * slope
    return any(
        not abs(change - by) <= PARAMETERS.off * abs(by) for change, by in zip(changes, told, strict=True)
    )


def _jumps(here: ContactInstant, contact: int) -> bool:
    """True if a gradient has another value on another side of the point, however near."""
    slope, own = here.direction(contact)[1], here.entries(contact)
    if not slope > 0:
        return False
    random, offset = np.random.default_rng(0), PARAMETERS.closed * float(here.touching_gap[contact]) / slope
    near = far = 0.0
    for _ in range(PARAMETERS.pairs):
        way = random.standard_normal(here.units.size) * here.units
        for part in (offset, -offset):
            beside = (
                here.displaced(times * part * way).entries(contact) for times in (1.0, PARAMETERS.farther)
            )
            changes = [float(np.abs(side - own).max(initial=0.0)) for side in beside]
            near, far = max(near, changes[0]), max(far, changes[1])
    least = doubles.ROOT * (np.abs(own).max(initial=0.0) + far)
    return bool(sides.differ(np.array(near), np.array(far), least))
