"""Potentials, Lagrangians and places that jump in a coordinate: the run stops at the jump and names it."""

from __future__ import annotations

from unittest import mock

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.equations import branch_cuts
from lagcli.equations import system as mechanics
from lagcli.expression import intervals
from lagcli.simulation.events import impulse_event
from lagcli.smoothness import jump_search, operation_graph

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
        ("p.y/abs(p.y)/1e6", 1, "the divisor of a quotient goes through zero"),
        ("1e-6*p.y/(p.y**2)**0.5", 1, "the divisor of a quotient goes through zero"),
        ("1e-6*max(p.y, 0)/p.y", 1, "the divisor of a quotient goes through zero"),
        ("norm([0, p.y, 0])/p.y/1e6", 1, "the divisor of a quotient goes through zero"),
        ("1e-6*p.y*distance([0, p.y, 0], [0, 0, 0])**-1", 1, "the divisor of a quotient goes through zero"),
        ("p.y**2/abs(p.y)", None, ""),
        ("p.y**2/norm([0, p.y, 0])", None, ""),
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


def test_a_particle_whose_position_jumps_stops_a_run():
    text = """\
lagcli: 1
coordinates: {x: {value: 0.5, rate: 1}}
particles: {p: {mass: 1, position: [x, sign(x - 1), 0]}}
simulation: {duration: 5, samples: 11}
"""
    with pytest.raises(lagcli.SimulationStopped, match="the position of the particle `p` jumps there"):
        lagcli.simulate(lagcli.loads(text))


def test_kinks_are_no_jumps():
    law = "rate(x)**2/2 + rate(y)**2/2 - x*abs(x) - x**2*sign(x) - cos(2*atan2(y, x)) - y**2"
    model = lagcli.loads(LAGRANGIAN % law)
    assert jumps(model) == []
    assert lagcli.simulate(model).stats.energy_imbalance < 1e-10


FAMILY = """\
lagcli: 1
parameters: {N: %d, k: 0.3}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0.5, 1]", velocity: [0, 1, 0]}
forces:
  w[i]: {for: "i = 1..N", potential: "%s"}
simulation: {duration: 0.1, samples: 2}
"""


def family(count, potential):
    return lagcli.loads(FAMILY % (count, potential))


def sought(model):
    """How often a check evaluates something at places of a switch, and at how many coordinates of places."""
    looked = []
    plain = jump_search.Local.at

    def at(self, begin, x):
        looked.append(x.size)
        return plain(self, begin, x)

    with mock.patch.object(jump_search.Local, "at", at):
        lagcli.check(model)
    return len(looked), sum(looked)


@pytest.mark.parametrize(
    "potential",
    [
        "k*sqrt(3)/(p[i].x - 0.3*p[i].y**2 + k*p[i].z**2)",
        "k*atan2(p[i].y, p[i].x)**2",
        "k*abs(p[i].y)/(p[i].x - i + k)",
    ],
)
def test_members_of_a_family_stand_for_all_in_a_check(potential):
    few, many = (sought(family(count, potential)) for count in (40, 400))
    assert few[0] > 0
    assert many[0] <= 1.5 * few[0]
    assert many[1] <= 1.5 * few[1]


def test_a_family_that_jumps_is_found():
    model = family(400, "3*sign(p[i].y)")
    assert jumps(model) == [6]
    with pytest.raises(lagcli.SimulationStopped, match=r"the potential `w` jumps there"):
        lagcli.simulate(family(3, "3*sign(p[i].y - 0.55)"))


def test_terms_of_every_shape_are_looked_at_in_a_long_sum():
    """One term in a hundred jumps, and it is not the same text."""
    terms = "+".join(f"abs(x - {k})/(y + {k}.5)**3" for k in range(2, 102))
    model = lagcli.loads(LAGRANGIAN % f"rate(x)**2/2 + rate(y)**2/2 + 1e-9*({terms}) + sign(x*y - 2)")
    assert jumps(model) == [3]
    x = ca.SX.sym("q", 2)
    inputs = [ca.SX.sym("t"), x, ca.SX.sym("v", 2), ca.SX.sym("p", 0)]
    value = sum(1 / (x[0] - k) for k in range(90)) + 1 / (x[0] * x[1] - 2) + 1 / (ca.sin(x[1]) + x[0])
    found = jump_search.switches(value, inputs)
    chosen = jump_search.examples(found, 8)
    assert len(found) == 92
    assert len(chosen) == 8
    assert {switch.shape for switch in chosen} == {switch.shape for switch in found}


@pytest.mark.parametrize(
    ("divisor", "keeps"),
    [
        ("1 + abs(p.x)*p.y**2", True),
        ("1.5 + sin(p.x)", True),
        ("sqrt(p.x**2 + 1) + 2*p.y**2", True),
        ("-3 - exp(p.x)/(2 + tanh(p.y))", True),
        ("2 - cos(p.x)**2", True),
        ("max(p.x, 0.5)*min(2, 1 + p.y**4)", True),
        ("0.5 + sin(p.x)", False),
        ("1 - 2*cos(p.x)**2", False),
        ("p.x**3 + 1", False),
        ("k + p.x**2", False),
        ("max(p.x, -0.5)", False),
    ],
)
def test_a_divisor_that_keeps_its_sign_is_not_watched(divisor, keeps):
    text = POTENTIAL.replace("particles:", "parameters: {k: 2}\nparticles:") % f"1e-9*abs(p.x)/({divisor})"
    system = mechanics.build(lagcli.loads(text))
    assert (system.jumps.crossings is None) == keeps


@pytest.mark.parametrize("seed", range(40))
def test_values_lie_between_their_bounds(seed):
    random = np.random.default_rng(seed)
    x = ca.SX.sym("x", 2)
    unary = [
        ca.sin,
        ca.cos,
        ca.tanh,
        ca.exp,
        ca.fabs,
        lambda a: a * a,
        ca.sign,
        ca.cosh,
        lambda a: -a,
        lambda a: 2 * a,
    ]
    binary = [ca.plus, ca.minus, ca.times, ca.rdivide, ca.fmin, ca.fmax]
    known = [x[0], x[1], ca.SX(0.7), ca.SX(-2)]
    for _ in range(12):
        a, b = (known[i] for i in random.integers(len(known), size=2))
        known.append(random.choice(unary)(a) if random.random() < 0.5 else random.choice(binary)(a, b))
    value = ca.vertcat(*known)
    bounds = []

    def look(op, parts, expression):
        bounds.append((intervals.FLOATS.result(operation_graph.names()[op], *parts), expression()))
        return bounds[-1][0]

    operation_graph.folded(
        value, [x], lambda given, number: jump_search.ANY if given is not None else (number, number), look
    )
    seen = ca.Function("seen", [x], [ca.vertcat(*(expression for _, expression in bounds))])
    for place in random.standard_normal((50, 2)) * 3:
        for (low, high), number in zip((b for b, _ in bounds), np.array(seen(place)).ravel(), strict=True):
            assert not number < low - 1e-12 * abs(low)
            assert not number > high + 1e-12 * abs(high)


def compiled(model):
    """The names of the functions that a run compiles to look at its switches."""
    names = []
    plain = impulse_event.CurveFunctions._on_cubic

    def on_cubic(self, name, parts, combined):
        names.append((name, len(parts)))
        return plain(self, name, parts, combined)

    with mock.patch.object(impulse_event.CurveFunctions, "_on_cubic", on_cubic):
        lagcli.simulate(model)
    return names


def test_a_step_far_from_a_switch_is_looked_at_in_few_points():
    text = POTENTIAL % "1e-9*abs(p.x)/(p.y + 40)"
    assert compiled(lagcli.loads(text)) == [("margin", 5)]
    assert compiled(lagcli.loads(text.replace("p.y + 40", "40*p.y**2 + 1"))) == []
    near = text.replace("abs(p.x)/(p.y + 40)", "atan2(p.y, p.x - 40)**2")
    assert compiled(lagcli.loads(near)) == [("margin", 5), ("changes", 17)]
    # Here the cut is far, though the sign changes.
    assert compiled(lagcli.loads(near.replace("- 40", "+ 40"))) == [("margin", 5)]


def test_what_a_run_looks_at_grows_as_the_family():
    """Operations of the functions, where no switch shares anything with another."""
    sizes = []
    for count in (100, 200):
        system = mechanics.build(family(count, "k*abs(p[i].y)/(p[i].x + p[i].y + 40)"))
        crossings = system.jumps.crossings
        assert len(crossings.words) == count
        sizes.append(crossings.switches.n_instructions() + crossings.values.n_instructions())
    assert sizes[1] < 2.1 * sizes[0]


def test_angles_of_a_family_are_not_compared_with_each_other():
    """What is known of each angle is told in one walk over the operations."""
    system = mechanics.build(family(60, "k*atan2(p[i].y, p[i].x)**2"))
    with (
        mock.patch.object(ca, "depends_on", side_effect=ca.depends_on) as asked,
        mock.patch.object(ca, "substitute", side_effect=ca.substitute) as put,
    ):
        found = branch_cuts._opened(ca.densify(system.dynamics.h), system.symbols, system.p)
    assert len(found[2]) == 60
    assert asked.call_count + put.call_count == 0
