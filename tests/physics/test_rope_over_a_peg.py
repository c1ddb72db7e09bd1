"""Two weights on a rope that goes slack, one of them on a floor: series of rebounds within a series, and an event that
falls together with impacts."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli

PEG = """\
lagcli: 1
parameters: {m1: 1, m2: 2, L: 3, g: 9.81, e: 0.5}
particles:
  a: {mass: m1, position: [-1, 0, -2]}
  b: {mass: m2, position: [1, 0, -1]}
forces: {weight: {to: all, force: [0, 0, -m*g]}}
holonomic: {a_line: a.x = -1, b_line: b.x = 1, ay: a.y = 0, by: b.y = 0}
inequality:
  rope: -a.z - b.z <= L
  floor: {condition: "b.z >= -2", restitution: e}
events: {apex: {when: a.vz, direction: down}}
simulation: {duration: 2.6, rtol: 1.0e-10, atol: 1.0e-12}
"""


@pytest.mark.parametrize("e", [0.5, 0.65, 0.7])
def test_rebounds_within_cycles_of_the_rope_pass_the_audit(e: float) -> None:
    """e = 0.5: a series ends at the instant of another impact, or just before it; 0.65: the floor is 5e-9 away where
    the rope is struck; 0.7: a rope that is struck together with the floor is lifted too slowly to be followed."""
    model = lagcli.loads(PEG).with_parameters(e=e)
    run = lagcli.simulate(model)
    failed = [
        check.name for check in lagcli.audit(model, run, events=run.events).checks if check.verdict == "fail"
    ]
    assert failed == []


# Values (e, m1, m2, L) at which rope and floor are struck together, or nearly, where rebounds end.
TOGETHER = (
    (0.5, 0.5, 2.0, 3.05),
    (0.452, 1.77, 2.79, 3.37),
    (0.548, 1.17, 2.57, 3.23),
    (0.682, 0.46, 1.93, 3.67),
    (0.639, 0.27, 0.97, 3.18),
)


@pytest.mark.parametrize(("e", "m1", "m2", "L"), TOGETHER)
def test_contacts_that_part_by_rebounds_that_are_left_out_are_reported(
    e: float, m1: float, m2: float, L: float
) -> None:
    """The rope is parted by the last rebound of the floor: without it, it stays taut, and its own flight is told."""
    model = lagcli.loads(PEG.replace("2.6", "3.0")).with_parameters(e=e, m1=m1, m2=m2, L=L)
    run = lagcli.simulate(model)
    failed = [
        check.name for check in lagcli.audit(model, run, events=run.events).checks if check.verdict == "fail"
    ]
    assert failed == []


@pytest.mark.parametrize("e", [0.3, 0.5])
def test_an_event_that_falls_together_with_an_impact_is_reported_once(e: float) -> None:
    """The light weight goes up v/g long while the heavy one bounces on the floor: with e = 1/2 an impact there falls
    together with the apex."""
    run = lagcli.simulate(lagcli.loads(PEG).with_parameters(e=e))
    table = run.events
    assert table is not None
    t = np.array([row[0] for row, kind in zip(table.numbers, table.kinds, strict=True) if kind == "event"])
    # The weights start at rest with (m2 - m1)/(m1 + m2) g; b is at the floor after falling by 1.
    g, a = 9.81, 9.81 / 3
    v, hit = np.sqrt(2 * a), np.sqrt(2 / a)
    assert t[0] == pytest.approx(hit + v / g, abs=1e-12)
    # Each time the rope is pulled taut it moves on with m1/(m1 + m2) of the speed.
    cycle = 2 * v / g
    lasts = [cycle * 3.0**-k + 2 * v * 3.0 ** -(k + 1) / a for k in range(4)]
    wanted = [hit + sum(lasts[:k]) + v * 3.0**-k / g for k in range(4)]
    assert t[:4] == pytest.approx(wanted, abs=1e-10)
    assert (np.diff(t) > 1e-7).all()
