"""Gradients of contacts: where one vanishes or jumps it tells no direction of the push."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.simulation.closed_contacts.contact_change import ContactsUndecided
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, Flags, Floats
from lagcli.smoothness import sides
from lagcli.start.initial import State


class GradientParameters:
    """Thresholds at which the gradient of a gap vanishes or jumps; distances are parts of the size of the
    motion.

    The tests are of `tests/unit/test_numbers_of_steps.py`.
    """

    __slots__ = ()

    fallen: float = 1e-3
    """A gradient that has fallen to this part of what it was a step before is looked at.
    `test_a_gradient_that_has_fallen_to_a_thousandth_is_looked_at` fails at 0.0001 and 0.01."""
    offset: float = 1e-10
    """How far aside is looked. `test_a_gradient_vanishes_where_it_does_not_tell_the_change_beside` fails at
    1e-11 and 1e-9."""
    times: float = 10.0
    """And as many times the way to the zero of the gap: the zero of a power of a distance is as far away as
    its root is known. `test_a_gradient_vanishes_where_it_does_not_tell_the_change_beside` fails at 1 and
    100."""
    off: float = 0.5
    """Of a gap whose gradient does not vanish the change there is known to this part.
    `test_a_gradient_vanishes_where_it_does_not_tell_the_change_beside` fails at 0.05 and 5."""
    closed: float = 10.0
    """Two sides of a jump are so many times what counts as closed apart.
    `test_sides_of_a_jump_are_ten_closed_gaps_apart` fails at 1 and 100."""
    farther: float = 100.0
    """They are looked at again this much farther off. `test_a_jump_stays_from_a_hundred_times_farther_off`
    fails at 10 and 1000."""
    pairs: int = 3
    """Pairs of points on both sides that are compared. `test_three_pairs_of_sides_are_compared` fails at 0
    and 30."""
    near: float = 1e-6
    """How far before and behind a state the edge is looked for that it could not pass.
    `test_an_edge_is_looked_for_a_little_before_and_behind_a_state` fails at 1e-7 and 1e-5."""
    far: float = 1e-4
    """The same, from farther off. `test_an_edge_is_looked_for_a_little_before_and_behind_a_state` fails at
    1e-5 and 0.001."""


PARAMETERS = GradientParameters()


def require(here: ContactInstant, fallen: Flags, kinked: Flags) -> None:
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

    jumps = sides.differ(change(PARAMETERS.near), change(PARAMETERS.far), np.array(doubles.ROOT))
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
    changes = [float(_displaced(here, part * way).g[contact] - here.g[contact]) for part in (offset, -offset)]
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
                _displaced(here, times * part * way).entries(contact) for times in (1.0, PARAMETERS.farther)
            )
            changes = [float(np.abs(side - own).max(initial=0.0)) for side in beside]
            near, far = max(near, changes[0]), max(far, changes[1])
    least = doubles.ROOT * (np.abs(own).max(initial=0.0) + far)
    return bool(sides.differ(np.array(near), np.array(far), least))


def _displaced(here: ContactInstant, way: Floats) -> ContactInstant:
    return here.at(dataclasses.replace(here.state, q=here.state.q + way))
