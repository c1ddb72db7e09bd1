"""Contacts at rest that another one's impact lifts by less than rounding can tell: told, and nothing is dropped."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import lagcli

RTOL, ATOL = 1e-10, 1e-13
# A rod that lies with one end on a floor; the other end comes down onto a lower one.
ROD = """\
lagcli: 1
particles:
  a: {{mass: 1, position: [0, 0, 0], velocity: [0, 0, 0]}}
  b: {{mass: {mass}, position: [1, 0, 0.3], velocity: [0, 0, 0]}}
forces: {{weight: {{to: all, force: [0, 0, -9.81*m]}}}}
holonomic: {{rod: "distance(a, b)**2 = 1.09", plane: "a.y = 0", side: "b.y = 0"}}
inequality:
  here: {{condition: "a.z >= 0", restitution: {e}}}
  there: {{condition: "b.z >= -{deep}", restitution: {e}}}
simulation: {{duration: 0.6, samples: 121}}
"""
EPS = float(np.finfo(float).eps)


def lifted(mass: float, deep: float, before: np.ndarray, e: float) -> tuple[float, float]:
    """The impulse at `there`, and the speed with which `here` is lifted: the law with the rod, by hand."""
    c, s = np.sqrt(1.09 - deep**2), -deep
    along = np.array([-c, -s, c, s])  # of a.x, a.z, b.x, b.z
    W = np.array([1, 1, 1 / mass, 1 / mass])
    push = np.array([0, 0, 0, 1.0])
    moved = W * (push - along * ((along * W) @ push) / ((along * W) @ along))
    P = -(1 + e) * before[3] / (push @ moved)
    return float(P), float(before[1] + P * moved[1])


@pytest.mark.parametrize(("e", "mass", "deep"), [(0.0, 1.0, 3e-4), (0.5, 2.5, 2e-4), (1.0, 0.7, 1e-4)])
def test_a_lift_below_what_can_be_followed_is_reported_with_its_end(
    e: float, mass: float, deep: float
) -> None:
    model = lagcli.loads(ROD.format(e=e, mass=mass, deep=deep))
    run = lagcli.simulate(model, rtol=RTOL, atol=ATOL)
    table = run.events
    assert table is not None
    at = {name: k for k, name in enumerate(("t", *table.columns[3:]))}
    first = next(
        k for k, (kind, name) in enumerate(zip(table.kinds, table.names, strict=True)) if name == "there"
    )
    row = table.numbers[first]
    before, after = (
        np.array([row[at[f"{head}.{name}"]] for name in ("a.vx", "a.vz", "b.vx", "b.vz")])
        for head in ("before", "after")
    )
    P, speed = lifted(mass, deep, before, e)
    assert 1e-9 < speed < 5e-7
    assert row[at["impulse.there"]] == pytest.approx(P, rel=1e-11)
    assert row[at["impulse.here"]] == 0.0
    assert after[1] == pytest.approx(speed, rel=1e-4)
    told = [
        (kind, t)
        for kind, name, t in zip(table.kinds, table.names, table.numbers[:, 0].tolist(), strict=True)
        if name == "here" and t >= row[0]
    ]
    assert [kind for kind, _ in told[:3]] == ["release", "accumulation", "contact"]
    assert told[0][1] == row[0]
    # It is pressed by less than its weight and the rod's, and by more than nothing.
    assert 0 < told[1][1] - row[0] < 1e-6
    assert told[2][1] == told[1][1]
    audit = lagcli.audit(model, run, events=table, rtol=RTOL, atol=ATOL)
    assert [check.name for check in audit.checks if check.verdict == "fail"] == []


def test_momenta_jump_by_the_impulses_at_every_impact_of_a_rod_that_comes_to_rest() -> None:
    run = lagcli.simulate(lagcli.loads(ROD.format(e=0.5, mass=2.5, deep=2e-4)), rtol=RTOL, atol=ATOL)
    table = run.events
    assert table is not None
    at = {name: k for k, name in enumerate(("t", *table.columns[3:]))}
    rows = table.numbers
    jump = rows[:, at["after.a.vz"]] - rows[:, at["before.a.vz"]]
    across = rows[:, at["a.z"]] - rows[:, at["b.z"]]
    wanted = rows[:, at["impulse.here"]] + 2 * rows[:, at["impulse.rod"]] * across
    assert np.abs(jump - wanted).max() < 1e-9
    ends = [t for t, kind in zip(rows[:, 0].tolist(), table.kinds, strict=True) if kind == "accumulation"]
    assert len(ends) > 1
    assert all(one <= other for one, other in itertools.pairwise(ends))
