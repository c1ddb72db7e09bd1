"""Potentials, Lagrangians and places that jump in a coordinate: the run stops at the jump and names it."""

from __future__ import annotations

import pytest

import lagcli

POTENTIAL = """\
lagcli: 1
particles:
  p: {mass: 1, position: [-1, 1, 0], velocity: [0.5, -1, 0]}
forces:
  w: {potential: "%s"}
simulation: {duration: 5, samples: 11}
"""
LAGRANGIAN = """\
lagcli: 1
coordinates: {x: {value: 0.5, rate: 1}, y: {value: 0.5, rate: 0.5}}
lagrangian: %s
simulation: {duration: 5, samples: 11}
"""


def jumps(model):
    return [d.location.line for d in lagcli.check(model).warnings if d.code == "energy-jump"]


@pytest.mark.parametrize(
    ("potential", "t", "told"),
    [
        ("3*sign(p.y)", 1, "the potential `w` jumps there (`sign` switches)"),
        ("atan2(p.y, p.x)/1e6", 1, "the potential `w` jumps there (`atan2` crosses its cut)"),
        ("1e-6*atan(1/p.y)", 1, "(the divisor of a quotient goes through zero)"),
        ("1e-6*abs(p.y)/p.y", 1, "the divisor of a quotient goes through zero"),
        ("sign(p.y - 0.49)*sign(p.y - 0.51)", 0.49, "`sign` switches"),
        ("3*sign(p.x - t)", None, ""),
        ("p.y*sign(p.y)", None, ""),
        ("atan2(p.y, p.x)**2/1e6", None, ""),
        ("cos(2*atan2(p.y, p.x))/1e6", None, ""),
        ("atan2(p.y, p.x + 2)/10", None, ""),
    ],
)
def test_a_run_stops_where_a_potential_jumps(potential, t, told):
    model = lagcli.loads(POTENTIAL % potential)
    if t is None:
        run = lagcli.simulate(model)
        assert run.stats.energy_imbalance < 1e-9
        return
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(model)
    assert told in str(caught.value)
    assert "impulse" in str(caught.value)
    assert caught.value.t == pytest.approx(t, abs=1e-5)
    assert caught.value.trajectory["t"][-1] <= t
    assert len(caught.value.trajectory.rows) == int((caught.value.t) / 0.5) + 1
    assert jumps(model) == [5]


def test_a_jump_of_which_the_other_side_lies_within_one_step_is_seen():
    law = "rate(x)**2/2 + rate(y)**2/2 + sign(x - 2)/2 - sign(x - 2.1)/2"
    model = lagcli.loads(LAGRANGIAN % law)
    with pytest.raises(lagcli.SimulationStopped, match="the Lagrangian jumps there") as caught:
        lagcli.simulate(model)
    assert caught.value.t == pytest.approx(1.5, abs=1e-9)
    assert jumps(model) == [3]


def test_an_inertia_that_jumps_stops_a_run_too():
    model = lagcli.loads(LAGRANGIAN % "(1.5 + 0.5*sign(sin(x)))*rate(x)**2/2 + rate(y)**2/2")
    with pytest.raises(lagcli.SimulationStopped, match="the Lagrangian jumps there"):
        lagcli.simulate(model)


def test_a_particle_whose_place_jumps_stops_a_run():
    text = """\
lagcli: 1
coordinates: {x: {value: 0.5, rate: 1}}
particles: {p: {mass: 1, position: [x, sign(x - 1), 0]}}
simulation: {duration: 5, samples: 11}
"""
    with pytest.raises(lagcli.SimulationStopped, match="the place of the particle `p` jumps there"):
        lagcli.simulate(lagcli.loads(text))


def test_kinks_are_no_jumps():
    law = "rate(x)**2/2 + rate(y)**2/2 - x*abs(x) - x**2*sign(x) - cos(2*atan2(y, x)) - y**2"
    model = lagcli.loads(LAGRANGIAN % law)
    assert jumps(model) == []
    assert lagcli.simulate(model).stats.energy_imbalance < 1e-10
