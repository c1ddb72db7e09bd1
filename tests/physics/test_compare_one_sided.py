"""`compare` and `--digits` of models with contacts: event times agree, and rows beside an impact are not counted."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.formulations import comparison
from lagcli.formulations.comparison import RunEvent
from lagcli.simulation import error_estimate
from lagcli.simulation.error_estimate import Accuracy, ImpactGrowth, IncidentSides
from lagcli.simulation.run_state.statistics import Incident, Kind

BOX = """\
lagcli: 1
parameters: {m: 2, g: 9.81, W: 1, e: 0.7}
coordinates: {x: {value: 0.3, rate: 1.1}, z: {value: 0.8, rate: 0.2}, s: {value: 0.2, rate: 0.3}}
particles:
  a: {mass: m, position: "[x, 0, z]"}
  b: {mass: 1, position: "[x + 0.3*cos(s), 0, z + 0.3*sin(s)]"}
forces: {weight: {to: a, force: [0, 0, -m*g]}, other: {to: b, force: [0, 0, -g]}}
inequality:
  left: {condition: "a.x >= 0", restitution: e}
  right: {condition: "b.x <= W", restitution: e}
  floor: {condition: "z >= 0", restitution: e}
  under: {condition: "b.z >= 0", restitution: e}
simulation: {duration: 1}
"""
PARTICLES = """\
lagcli: 1
parameters: {m: 2, g: 9.81, W: 1, e: 0.7}
particles:
  a: {mass: m, position: [0.3, 0, 0.8], velocity: [1.1, 0, 0.2]}
  b:
    mass: 1
    position: ["0.3 + 0.3*cos(0.2)", 0, "0.8 + 0.3*sin(0.2)"]
    velocity: ["1.1 - 0.09*sin(0.2)", 0, "0.2 + 0.09*cos(0.2)"]
forces: {weight: {to: a, force: [0, 0, -m*g]}, other: {to: b, force: [0, 0, -g]}}
holonomic: {rod: "distance(a, b) = 0.3"}
inequality:
  left: {condition: "a.x >= 0", restitution: e}
  right: {condition: "b.x <= W", restitution: e}
  floor: {condition: "a.z >= 0", restitution: e}
  under: {condition: "b.z >= 0", restitution: e}
simulation: {duration: 1}
"""
BILLIARD = """\
lagcli: 1
particles: {a: {mass: 1, position: [1.9, 0.3, 0], velocity: [1, 0.61, 0]}}
inequality:
  left: {condition: "a.x >= 0", restitution: 1}
  right: {condition: "a.x <= 4", restitution: 1}
  low: {condition: "a.y >= 0", restitution: 1}
  high: {condition: "a.y <= 4", restitution: 1}
  disk: {condition: "norm(a - [2, 2, 0]) >= 1", restitution: 1}
simulation: {duration: 30, samples: 61}
"""


def test_a_box_agrees_in_coordinates_and_in_particles() -> None:
    found = lagcli.compare(lagcli.loads(BOX))
    assert [one.name for one in found.formulations] == ["lagrange", "freed"]
    assert found.agree
    events = found.agreements[0]["events"]
    assert events.columns == len(found.formulations[0].events) >= 4
    assert events.digits > 11


def test_two_models_of_one_box_agree() -> None:
    found = lagcli.compare(lagcli.loads(BOX), lagcli.loads(PARTICLES))
    assert found.agree
    assert found.agreements[0]["events"].columns >= 4
    assert found.agreements[0]["v"].digits > 10


def test_another_restitution_disagrees_by_its_events() -> None:
    found = lagcli.compare(lagcli.loads(BOX), lagcli.loads(PARTICLES, parameters={"e": 0.700001}))
    assert found.agree is False
    assert found.agreements[0]["events"].error > 1e-8


def test_a_restitution_that_is_set_is_that_of_the_run() -> None:
    """Functions are kept between runs of one text; coefficients of restitution are values of the model."""
    last = [lagcli.simulate(lagcli.loads(PARTICLES, parameters={"e": e}))["a.z"][-1] for e in (0.7, 0.5, 0.7)]
    assert last[0] == last[2] != last[1]


def test_no_reduction_with_contacts() -> None:
    found = lagcli.compare(lagcli.loads(PARTICLES))
    assert [one.name for one in found.formulations] == ["newton"]
    assert "impacts and events that end a run would change it" in found.notes[0]


def test_rows_between_the_times_of_an_incident_and_incidents_that_are_alone() -> None:
    one = (RunEvent(1.0, "impact", "floor"), RunEvent(2.0, "impact", "floor"))
    other = (RunEvent(1.1, "impact", "floor"), RunEvent(1.9, "impact", "floor"))
    found = comparison.matched(one, other, 3.0, 3.0)
    assert found.alone is None
    assert found.parts(np.array([0.9, 1.0, 1.05, 1.1, 1.89, 1.95, 2.0, 2.1])).tolist() == [
        False, True, True, False, False, True, False, False,
    ]  # fmt: skip
    alone = comparison.matched(one, other[:1], 3.0, 3.0).alone
    assert alone is not None
    assert (alone.t, alone.label) == (2.0, "impact of floor")
    assert comparison.matched(one, other[:1], 2.0, 2.0).alone is None  # at the very end of both
    ended = (
        (*one, RunEvent(2.5, "accumulation", "floor")),
        (*other[:1], RunEvent(2.5, "accumulation", "floor")),
    )
    assert comparison.matched(*ended, 3.0, 3.0).alone is None


def incident(t: float, kind: Kind = "impact", name: str = "floor") -> Incident:
    return Incident(t, kind, name, np.zeros(1), np.zeros(1), np.zeros(1))


def test_sides_of_an_incident_are_reported_as_its_times_become_known() -> None:
    sides = IncidentSides()
    sides.add(0, [incident(1.0)])
    assert sides.between(np.array([0.0, 0.5, 1.0, 1.00005])).tolist() == [False, False, True, True]
    sides.add(1, [incident(1.00008)])
    assert sides.between(np.array([1.00007, 1.0001, 2.0])).tolist() == [True, False, False]
    assert sides.rows == 3
    assert sides.first == 1.0
    sides.add(0, [incident(3.0)])  # of which the other run knows nothing
    assert not sides.between(np.array([3.5, 4.0])).any()
    sides.add(0, [incident(5.0)])
    sides.add(1, [incident(5.0001)])
    assert sides.between(np.array([5.00005])).all()


@pytest.mark.parametrize(("powers", "wanted"), [(3.0 ** np.arange(12), 3.0), (np.arange(1.0, 13) ** 4, None)])
def test_growth_at_impacts_is_told_from_growth_with_time(powers: np.ndarray, wanted: float | None) -> None:
    growth = ImpactGrowth()
    t = np.arange(12.0)
    growth.take(t, 1e-12 * powers, [incident(time) for time in t])
    found = growth.factor(1e-13)
    assert found == (None if wanted is None else pytest.approx(wanted))


def test_digits_of_a_billiard_tell_how_errors_grow() -> None:
    found = lagcli.simulate(lagcli.loads(BILLIARD), digits=True).stats.accuracy
    assert found is not None
    assert found.growth is not None
    assert 1.5 < found.growth < 10
    assert "times at each impact" in found.sentence


def test_a_row_at_an_impact_does_not_lose_all_digits_of_velocities() -> None:
    """A ball that meets a wall at t = 1: one run is before the impact there, and the other behind it."""
    rows = np.array([[0.0, 1.0, 1.0], [1.0, 2.0, 1.0], [2.0, 1.0, -1.0]])
    others = rows + np.array([0.0, 1e-9, 1e-9])
    others[1, 2] = -1.0
    errors = error_estimate.Errors(([1], [2], [], []), 1.0)
    errors.sides.add(0, [incident(1 + 1e-9)])
    errors.sides.add(1, [incident(1 - 1e-9)])
    found = errors.take(rows, others, [incident(1 + 1e-9)])
    assert found[:, 1] == pytest.approx(1e-9)
    assert (errors.sides.rows, errors.sides.first) == (1, 1.0)
    missed = error_estimate.Errors(([1], [2], [], []), 1.0)
    assert missed.take(rows, others)[-1, 1] == 2.0  # without incidents it is an error


def test_what_is_not_counted_is_reported() -> None:
    known = (1e-9,) * 4, (1.0,) * 4, (2.0,) * 4
    found = Accuracy(2.0, *known, 1e-13, 10, 0, 100, between=(1, 1.0))
    assert "1 row stands between the times that an incident has in both runs (at t = 1)" in found.sentence
    assert found.as_json()["repeated"]["rows_between"] == 1
    assert "rows_between" not in Accuracy(2.0, *known, 1e-13, 10, 0, 100).as_json()["repeated"]
