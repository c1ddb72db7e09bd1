"""Functions that all sets of closed contacts have in common give what those of each set give."""

import itertools

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.compiled import NumericSystem, numeric
from lagcli.compiled.selection import Selection
from lagcli.equations import system

# A chain of rods over a floor that moves, a redundant row, a differential one, and a cable whose row has no gradient
# where the particles are, for it starts at its centre.
CHAIN = """lagcli: 1
parameters: {N: 5}
particles:
  p[i]: {for: "i = 1..N", mass: "1 + 0.3*i", position: ["i", 0, "0.2*i"]}
  c: {mass: 2, position: [0, 0, 0]}
forces:
  weight: {to: all, force: "[0, 0.1*m, -m*9.81]"}
holonomic:
  rod[i]: {for: "i = 1..N-1", equation: "norm(p[i+1] - p[i]) = sqrt(1.04)"}
  side: p[1].y = 0
  again: 2*p[1].y = 0
differential:
  skate: d(p[5].y) - p[5].x*d(p[5].z) = 0
inequality:
  floor[i]: {for: "i = 1..N", condition: "p[i].z >= 0.1*sin(3*t) + 0.05*p[i].x**2"}
  cable: norm(c) <= 3
"""
# Rows beside which `again` stands: those without it.
C, K = 7, 6


def build(text: str) -> NumericSystem:
    return NumericSystem(system.build(lagcli.loads(text)))


def chosen(closed: tuple[int, ...]) -> Selection:
    open_ = (0, 1, 2, 3, 4, 6)
    independent = (*open_, *(C + j for j in closed))
    inactive = tuple(C + j for j in range(K) if j not in closed)
    return Selection(independent, ((5, 4),), inactive)


def values(function: ca.Function, *arguments: object) -> list[np.ndarray]:
    found = function(*arguments)
    return [np.array(each).ravel() for each in (found if isinstance(found, tuple) else (found,))]


@pytest.mark.parametrize("count", range(1, K))
def test_rates_and_multipliers_of_a_set_are_those_of_functions_of_its_own(count):
    plain = build(CHAIN)
    rng = np.random.default_rng(count)
    q = np.concatenate([[i, 0.0, 0.2 * i] for i in range(1, 6)] + [[0.0, 0.0, 0.0]])
    v = rng.standard_normal(q.size)
    shared = set()
    for closed in itertools.combinations(range(K - 1), count):
        one, other = plain.keeping(chosen(closed)), plain.switching(chosen(closed))
        shared.add(other.stepped)
        assert other.closed_rows == one.closed_rows == [C + j for j in closed]
        assert other.switches.tolist() == [float(j in closed) for j in range(K)]
        p = np.zeros(plain.rhs.size1_in(2))
        p[:1] = 5.0
        y = np.concatenate([q + 1e-3 * rng.standard_normal(q.size) * (np.arange(q.size) < 15), v, [0.0]])
        asked = 0.3, y, p
        switched = 0.3, y, np.concatenate([p, other.switches])
        # The projection, the state on the rows, its rate, lambda, and what the watch over the rank asks.
        for name in ("rhs", "stage", "project", "record", "solved"):
            pairs = zip(
                values(getattr(one, name), *asked), values(getattr(other, name), *switched), strict=True
            )
            for number, (expected, given) in enumerate(pairs):
                angle = {("stage", 1): 0, ("project", 2): 1}.get((name, number))
                if angle is not None:
                    # The least pivot, which depends on the order of the rows; all are well apart here.
                    assert min(expected[angle], given[angle]) > 0.01
                    expected[angle] = given[angle]
                size = np.abs(expected).max(initial=1.0)
                assert np.isfinite(expected).all()
                assert given == pytest.approx(expected, rel=1e-9, abs=1e-11 * size), (name, closed)
    # All of them are one system, whose functions are built once.
    assert len(shared) == 1


def test_a_set_whose_rows_depend_on_one_another_has_functions_of_its_own():
    plain = build(CHAIN)
    closed = chosen((0, 1))
    dependent = Selection(closed.independent[:-1], (*closed.dependencies, (C + 1, C)), closed.inactive)
    idle = Selection(closed.independent[:-1], closed.dependencies, (*closed.inactive, C + 1), ((C + 1, C),))
    for selection in (dependent, idle, chosen(())):
        found = plain.switching(selection)
        assert found.stepped is found
        assert found.switches.size == 0
        assert found.selection == selection


def free(N: int) -> str:
    lines = [
        "lagcli: 1",
        f"parameters: {{N: {N}}}",
        "particles:",
        '  p[i]: {for: "i = 1..N", mass: 1, position: [i, 0, 1]}',
    ]
    return "\n".join([*lines, "inequality:\n"])


def set_of(count: int, closed: int) -> Selection:
    return Selection(tuple(range(closed)), inactive=tuple(range(closed, count)))


@pytest.mark.parametrize(("N", "is_shared"), [(4, False), (5, True)])
def test_few_contacts_have_functions_for_each_set(N, is_shared):
    plain = build(free(N) + '  f[i]: {for: "i = 1..N", condition: "p[i].z >= 0"}\n')
    found = plain.switching(set_of(N, 2))
    assert (found.stepped is not found) is is_shared


@pytest.mark.parametrize(("N", "is_shared"), [(4, True), (7, False)])
def test_contacts_whose_factors_would_cost_more_than_a_step_have_functions_for_each_set(N, is_shared):
    pairs = [f'  "c{i}_{j}": "distance(p[{i}], p[{j}]) >= 1"' for i in range(1, N + 1) for j in range(1, i)]
    plain = build(free(N) + "\n".join(pairs) + "\n")
    found = plain.switching(set_of(len(pairs), 2))
    assert (found.stepped is not found) is is_shared


def test_factors_that_are_not_written_out_take_no_switches(monkeypatch):
    monkeypatch.setattr(numeric, "EXPANDED_OPERATIONS", -1.0)
    plain = build(free(6) + '  f[i]: {for: "i = 1..N", condition: "p[i].z >= 0"}\n')
    found = plain.switching(set_of(6, 2))
    assert found.stepped is found
