"""The impact of one contact takes its formula, and says what the law of all contacts says."""

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.compiled import NumericSystem, numeric
from lagcli.contact import impact_law
from lagcli.contact.impact_law import EnergyCreated, Response, TouchingRows
from lagcli.equations import system
from lagcli.linear.metric import Metric
from lagcli.simulation.closed_contacts.contact_instant import (
    ContactInstant,
    ContactParameters,
    ContactRowValues,
)
from lagcli.start.initial import State

DUMBBELL = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1]}
  b: {mass: 2, position: [0.6, 0, 1.8]}
forces: {weight: {to: [a, b], force: [0, 0, -m*9.81]}}
holonomic: {rod: 'distance(a, b) = 1'}
inequality:
  floor_a: {condition: a.z >= 0, restitution: 1}
  floor_b: {condition: b.z >= 0, restitution: 0.7}
"""


@pytest.mark.parametrize("limit", [0.0, numeric.EXPANDED_OPERATIONS])
def test_the_formula_is_the_law_of_all_contacts(limit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a rod, its factorization written out or not."""
    monkeypatch.setattr(numeric, "EXPANDED_OPERATIONS", limit)
    functions = NumericSystem(system.build(lagcli.loads(DUMBBELL)))
    random = np.random.default_rng(0)
    q, p = np.array([0.1, 0.2, 0.0, 0.7, 0.2, 0.8]), np.zeros(functions.contacts.numel_in(3))
    B = np.array(functions.rows(0, q, np.zeros(6), p)[0])
    v = random.standard_normal(6)
    v -= B.T @ np.linalg.solve(B @ B.T, B @ v)
    v *= -np.sign(v[2])
    f = np.eye(6)[2]
    x, lam, told = (np.array(each).ravel() for each in functions.response(0, q, v, p, f))
    response = Response(x, lam, *told.tolist(), terms=abs(v[2]))
    assert response.is_certain
    found = impact_law.single(v, v[2], 0.7, response)
    assert found is not None
    rows = ca.DM(B), np.zeros(1)
    metric = Metric(ca.diag(ca.DM([1, 1, 1, 2, 2, 2])))
    whole = impact_law.impact(metric, v, rows, (ca.DM(f).T, np.zeros(1), np.array([0.7])))
    assert found.x == pytest.approx(whole.x, rel=1e-13, abs=1e-14)
    assert found.of_contacts == pytest.approx(whole.of_contacts, rel=1e-13)
    assert found.of_equalities == pytest.approx(whole.of_equalities, rel=1e-12)
    assert found.energy == pytest.approx(whole.energy, rel=1e-12)


def test_impacts_of_one_contact_need_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("the law of all contacts was asked")

    monkeypatch.setattr(TouchingRows, "__init__", refused)
    run = lagcli.simulate(lagcli.loads(DUMBBELL), duration=1.0, samples=2)
    assert run.stats.impacts >= 2


def test_a_contact_that_hardly_moves_is_left_to_the_law_of_all() -> None:
    """Of its row the equality rows leave less than rounding needs."""
    held = Response(np.ones(1), np.zeros(0), square=1e-3, free=1.0, left=0.0, terms=1.0)
    broken = Response(np.ones(1), np.zeros(0), square=1.0, free=1.0, left=1e-9, terms=1.0)
    nothing = Response(np.zeros(1), np.zeros(0), square=0.0, free=0.0, left=0.0, terms=1.0)
    for response in (held, broken, nothing):
        assert impact_law.single(-np.ones(1), -1.0, 0.5, response) is None


def test_energy_that_would_be_made_is_seen() -> None:
    with pytest.raises(EnergyCreated):
        impact_law.certified(*(np.array([number]) for number in (1.0, 2.0, 3.0, 1.0)))


def test_contacts_are_not_looked_at_again_after_an_impact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Velocities far from none after it are told by those before it."""

    def refused(*_: object) -> None:
        raise LookupError("another look")

    monkeypatch.setattr(ContactInstant, "moved", refused)
    text = DUMBBELL.replace("0.7}", "1}")
    assert lagcli.simulate(lagcli.loads(text), duration=1.0, samples=2).stats.impacts >= 2
    with pytest.raises(LookupError):
        lagcli.simulate(
            lagcli.loads(text.replace("restitution: 1}", "restitution: 0}")), duration=1.0, samples=2
        )


def test_numbers_of_contacts_are_given_together_and_found_again() -> None:
    """However the function orders them: gaps, speeds and gradients are those that the contacts have."""
    functions = NumericSystem(system.build(lagcli.loads(DUMBBELL)))
    values = ContactRowValues(functions, [0])
    random = np.random.default_rng(1)
    state = State(0.0, random.random(6), random.standard_normal(6), np.zeros(functions.contacts.numel_in(3)))
    here = ContactInstant(values, state, ContactParameters(1e-9))
    g, G, g_t, *_ = (np.array(each) for each in functions.contacts(0.0, state.q, state.v, state.p))
    assert here.g == pytest.approx(g.ravel(), rel=1e-15)
    assert here.speeds == pytest.approx(G @ state.v + g_t.ravel(), rel=1e-15)
    assert np.array(here.gradients(np.arange(2))) == pytest.approx(G, rel=1e-15)
