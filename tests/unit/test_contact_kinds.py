"""Contacts of one kind: one function serves all of them, with the bits that each has by itself, and of many contacts
those that are near alone are asked for what is known of them."""

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.compiled import NumericSystem, contact_kinds
from lagcli.compiled.column_program import ColumnProgram
from lagcli.equations import system
from lagcli.simulation.closed_contacts import contact_instant
from lagcli.simulation.closed_contacts.contact_instant import (
    ContactInstant,
    ContactParameters,
    ContactRowValues,
)
from lagcli.simulation.closed_contacts.many_contacts import ManyContacts
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.start.initial import State
from tests.helpers import spent
from tests.helpers.recorded_runs import run_to_stop

# Balls that fall and roll on a floor, between walls that one of them moves, and strike each other.
BALLS = """lagcli: 1
parameters: {N: 6, D: 0.5}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0.1*i - 0.2, 0.5 + 0.2*sin(7*i)]",
         velocity: "[sin(129*i), sin(782*i), sin(251*i + 2)]"}
forces: {weight: {to: p, force: [0, 0, -9.81*m]}}
inequality:
  floor[i]: {for: "i = 1..N", condition: "p[i].z >= D/2"}
  left[i]: {for: "i = 1..N", condition: "p[i].x >= 0.1*t", restitution: 0.5}
  right[i]: {for: "i = 1..N", condition: "p[i].x <= 7", restitution: 0.5}
  hit[i][j]: {for: ["i = 1..N", "j = i+1..N"], condition: "distance(p[i], p[j]) >= D", restitution: 0.7}
simulation: {duration: 0.7, samples: 8}
"""


def numeric(text: str = BALLS) -> NumericSystem:
    return NumericSystem(system.build(lagcli.loads(text)))


def test_contacts_of_a_family_are_of_one_kind() -> None:
    kinds = numeric().contact_kinds
    assert sorted(kind.members.size for kind in kinds) == [6, 6, 6, 15]
    assert sorted(np.concatenate([kind.members for kind in kinds]).tolist()) == list(range(33))


def test_a_number_of_its_own_makes_a_kind_and_one_of_other_coordinates_does_not() -> None:
    text = BALLS.replace('"distance(p[i], p[j]) >= D"', '"distance(p[j], p[i]) >= D*(1 + 0.1*i)"')
    assert len(numeric(text).contact_kinds) > 4
    turned = BALLS.replace('"distance(p[i], p[j]) >= D"', '"distance(p[j], p[i]) >= D"')
    assert len(numeric(turned).contact_kinds) == 4


def test_many_contacts_have_the_bits_of_few(monkeypatch: pytest.MonkeyPatch) -> None:
    few = run_to_stop(BALLS)
    monkeypatch.setattr(contact_kinds.ContactKindParameters, "many", 0)
    many = run_to_stop(BALLS)
    assert len(few[2]) >= 5
    assert many[1].tobytes() == few[1].tobytes()
    for one, other in zip(many[2], few[2], strict=True):
        assert (one.t, one.kind, one.name) == (other.t, other.kind, other.name)
        assert one.after.tobytes() == other.after.tobytes()
        assert one.impulses.tobytes() == other.impulses.tobytes()


def test_contacts_that_are_near_have_all_their_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """And gaps, and what counts as closed, are those of all."""
    functions, random = numeric(), np.random.default_rng(2)
    few = ContactRowValues(functions, 0)
    monkeypatch.setattr(contact_kinds.ContactKindParameters, "many", 0)
    values = ContactRowValues(functions, 0)
    asked = np.array([3, 20], dtype=np.intp)
    for _ in range(5):
        q = np.array([[i, 0, 0.25] for i in range(6)]).ravel() + 1e-9 * random.random(18)
        p = system.values(system.build(lagcli.loads(BALLS)))
        state = State(0.0, q, random.standard_normal(18), np.array(p).ravel())
        chosen = ContactParameters(1e-6, 0.1)
        all_of, some = ContactInstant(few, state, chosen), ContactInstant(values, state, chosen, asked)
        assert (some.g == all_of.g).all()
        assert (some.touching_gap == all_of.touching_gap).all()
        assert (some.near == all_of.near).all()
        near = [*np.flatnonzero(all_of.near).tolist(), *asked.tolist()]
        for name in ("g_t", "gamma", "speeds", "noise", "slow", "lowest", "pull"):
            assert (getattr(some, name)[near] == getattr(all_of, name)[near]).all()
        assert (some.changes(state.v)[near] == all_of.changes(state.v)[near]).all()
        assert (some.whole.speeds == all_of.speeds).all()


@pytest.mark.parametrize("count", [6, 12])
def test_contacts_that_are_far_cost_their_gaps_alone(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """Of twice the bodies there are four times the pairs, and no more of them are looked at at one impact."""
    looked = []
    at = ManyContacts.at

    def counted(*arguments: object) -> object:
        found = at(*arguments)  # type: ignore[arg-type]
        looked.append(found[1].size)
        return found

    monkeypatch.setattr(contact_kinds.ContactKindParameters, "many", 0)
    monkeypatch.setattr(ManyContacts, "at", counted)
    text = (
        BALLS.replace("N: 6", f"N: {count}")
        .replace("<= 7", "<= 14")
        .replace('D/2"}', 'D/2", restitution: 0.8}')
    )
    run = lagcli.simulate(lagcli.loads(text), duration=0.7)
    assert run.stats.impacts >= 2
    assert np.median(looked) <= count


def test_a_program_of_columns_has_the_bits_of_the_function() -> None:
    x = ca.SX.sym("x", 3)
    a, b, c = ca.vertsplit(x)
    value = ca.vertcat(
        *(a + b, a - b, a * c, a / b, -a, ca.fabs(b), a * a, 2 * b, 1 / c, ca.sqrt(ca.fabs(a))),
        *(ca.fmin(a, b), ca.fmax(a, c), a < b, a <= c, ca.if_else(a < b, a, c)),
        *(ca.logic_and(a < b, b < c), ca.logic_or(a < b, b < c), ca.logic_not(a < b)),
    )
    function = SizedFunction("f", [x], [value])
    assert ColumnProgram(function).is_whole
    points = np.random.default_rng(3).standard_normal((3, 50))
    points[:, 0] = 0.0
    found = ColumnProgram(function).bound([points], range(value.numel())).run()
    assert np.array(function(points)).tobytes() == np.ascontiguousarray(found.T).T.tobytes()
    assert not ColumnProgram(SizedFunction("g", [x], [ca.sin(a)])).is_whole


def test_contacts_without_a_program_are_asked_all_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contact_kinds.ContactKindParameters, "many", 0)
    text = BALLS.replace('"p[i].z >= D/2"', '"p[i].z >= D/2 + 0.01*sin(p[i].x)"')
    many = run_to_stop(text)
    monkeypatch.undo()
    few = run_to_stop(text)
    assert many[1].tobytes() == few[1].tobytes()
    assert contact_instant.many_contacts.are_some(numeric().contact_values, 1000)


def test_a_contact_that_nothing_presses_is_decided_by_its_own_row() -> None:
    """Where it is decided by derivatives of its force, those of the 77 others are not made."""
    text = BALLS.replace("N: 6", "N: 12").replace("<= 7", "<= 14").replace("-9.81*m", "0")
    model = lagcli.loads(text)
    with spent.at_most_calls(1_000_000):
        run = lagcli.simulate(model, duration=0.7)
    assert run.stats.impacts >= 5
