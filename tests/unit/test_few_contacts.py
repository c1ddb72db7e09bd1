"""Few contacts by enumeration: the answers are those of the general law, and what it cannot do is left to that."""

import dataclasses

import casadi as ca
import numpy as np
import pytest

from lagcli.contact import impact_law
from lagcli.contact.impact_law import FewContacts, Response
from lagcli.linear.metric import Metric


def made(seed, contacts, equalities=2, n=7):
    """Masses, rows B and G, and the contacts with their responses."""
    random = np.random.default_rng(seed)
    m = random.uniform(0.5, 3, n)
    B, G = random.normal(size=(equalities, n)), random.normal(size=(contacts, n))
    lift = (B / m).T @ np.linalg.inv((B / m) @ B.T)
    P = np.diag(1 / m) - lift @ (B / m)
    responses = tuple(
        Response(P @ g, -lift.T @ g, float(g @ P @ g), float(g**2 @ (1 / m)), 0.0, 1.0) for g in G
    )
    return random, m, B, G, FewContacts(responses, G @ P @ G.T), P


@pytest.mark.parametrize("seed", range(60))
def test_impacts_are_those_of_the_general_law(seed):
    count = 1 + seed % 4
    random, m, B, G, few, P = made(seed, count)
    v = P @ (m * random.normal(size=m.size))
    e = np.full(count, random.uniform())
    # Of two thirds all contacts are struck.
    signs = -np.sign(G @ v) if seed % 3 else np.ones(count)
    G = G * signs[:, None]
    turned = (
        dataclasses.replace(r, x=s * r.x, of_equalities=s * r.of_equalities)
        for s, r in zip(signs, few.responses, strict=True)
    )
    few = FewContacts(tuple(turned), few.D * signs * signs[:, None])
    if not few.are_apart:
        pytest.skip("rows too near dependent ones")
    metric = Metric(ca.DM(np.diag(m)))
    rows = ca.DM(G), np.zeros(count), e
    try:
        wanted = impact_law.impact(metric, v, (ca.DM(B), np.zeros(2)), rows)
    except impact_law.EnergyCreated:
        with pytest.raises(impact_law.EnergyCreated):
            few.impact(v, G @ v, e, np.abs(G) @ np.abs(v))
        return
    found = few.impact(v, G @ v, e, np.abs(G) @ np.abs(v))
    for name in ("x", "of_equalities", "of_contacts", "slack"):
        assert np.abs(getattr(found, name) - getattr(wanted, name)).max() < 1e-11, name
    assert found.energy == pytest.approx(wanted.energy, abs=1e-11)


def test_rows_near_dependent_ones_are_left_to_the_general_law():
    _, _, _, _, few, _ = made(1, 2)
    twin = FewContacts((few.responses[0],) * 2, np.full((2, 2), few.D[0, 0]))
    assert few.are_apart
    assert not twin.are_apart


def test_a_set_that_pulls_is_no_answer():
    few = FewContacts(made(3, 2)[4].responses, np.array([[1.0, -0.6], [-0.6, 1.0]]))
    # Held alone the first would press the second in.
    assert few.solve(np.array([-1.0, 0.5]), np.zeros(2)) == pytest.approx([0.7 / 0.64, 0.1 / 0.64])
    other = FewContacts(few.responses, np.array([[1.0, 0.6], [0.6, 1.0]]))
    assert other.solve(np.array([-1.0, -0.5]), np.zeros(2)) == pytest.approx([1.0, 0.0])
    assert impact_law.PARAMETERS.most >= 2
