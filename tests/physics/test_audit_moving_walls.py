"""The energy of impacts with what moves, and flights of models with rows: right runs pass, faults put in are found."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable

import numpy as np
import pytest

import lagcli
from lagcli.auditing import all_checks
from lagcli.auditing.checks.audit_report import Audit
from lagcli.auditing.evidence.table_input import AuditedTable, EventTable
from lagcli.auditing.evidence.tolerances import Tolerance

RTOL, ATOL = 1e-11, 1e-13
# A dumbbell that is led along x, thrown on a floor that goes up and down: walls, a row and Cartesian particles.
LED_DUMBBELL = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1], velocity: [0.3, 0, 0]}
  b: {mass: 0.5, position: [0.6, 0, 1], velocity: [0.3, 0, 0.4]}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
holonomic: {rod: "distance(a, b) = 0.6", rail: "a.x = 0.3*t + 0.2*t**2", plane: "a.y = 0", side: "b.y = 0"}
inequality: {floor: {condition: "a.z >= 0.05*sin(7*t)", restitution: 0.7}}
simulation: {duration: 0.7, samples: 141}
"""
# Places x(q, t) that move with t, a mass matrix of q and t, walls that move.
MOVING_PLACES = """\
lagcli: 1
coordinates: {s: {value: 1.2, rate: 0.1}, w: {value: 0.2, rate: -0.4}}
particles:
  p: {mass: 1, position: ["sin(s)*cos(2*t)", "sin(s)*sin(2*t)", "-cos(s) + 0.1*sin(5*t)"]}
  q: {mass: 0.7, position: ["w*cos(s)", "w*(1 + t)", "0.3*t**2"]}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
inequality: {stop: {condition: "s + 0.3*w >= 0.2 + 0.1*cos(3*t)", restitution: 0.6}}
simulation: {duration: 1.5, samples: 301}
"""
# A nonholonomic row, a Lagrangian with terms of second and first order in the rates, a wall that moves.
SKATE = """\
lagcli: 1
coordinates: {x: {value: 0, rate: 1}, y: {value: 0, rate: 0}, phi: {value: 0, rate: 0.7}}
lagrangian: >-
  rate(x)**2/2 + rate(y)**2/2 + (1 + x**2)*rate(phi)**2/8 + 0.2*cos(phi)*rate(x)*rate(phi) + 0.3*rate(phi)*t
differential: {blade: "rate(x)*sin(phi) = rate(y)*cos(phi)"}
inequality: {wall: {condition: "x <= 0.6 - 0.2*t", restitution: 0.5}}
simulation: {duration: 2, samples: 201}
"""
# Two particles on a rod, a blade at one of them, walls of which one moves: energy is changed by impacts alone.
BLADE = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}
  b: {mass: 0.5, position: [0.5, 0, 0], velocity: [1, 0.4, 0]}
holonomic: {rod: "distance(a, b) = 0.5", flat_a: a.z = 0, flat_b: b.z = 0}
differential: {blade: "(b.x - a.x)*a.vy = (b.y - a.y)*a.vx"}
inequality: {wall: {condition: "b.x <= 1.2 - 0.1*t", restitution: 0.5}}
simulation: {duration: 2, samples: 201}
"""
# A ball that falls into a bowl, slides in it, and leaves it at walls: contacts rest between the incidents.
BOWL = """\
lagcli: 1
particles:
  p: {mass: 1, position: [-1, 0, 1], velocity: [0, 0, 0]}
  q: {mass: 2, position: [3, 0, 1], velocity: [-1, 0, 0]}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
holonomic: {plane: "p.y = 0", other: "q.y = 0"}
inequality:
  bowl: "distance(p, [0, 0, 2]) <= 2"
  wall: {condition: "p.x <= 0.5", restitution: 0.5}
  floor: "q.z >= 0.9"
  door: {condition: "q.x >= 2.4", restitution: 0.5}
simulation: {duration: 1.2, samples: 121}
"""
MODELS = {"dumbbell": LED_DUMBBELL, "places": MOVING_PLACES, "skate": SKATE, "blade": BLADE}


class Tables:
    """The tables of a run, to be changed: rows (T, k) of `columns`, incidents (E, k) of `heads`."""

    def __init__(self, text: str) -> None:
        self.model = lagcli.loads(text)
        run = lagcli.simulate(self.model, rtol=RTOL, atol=ATOL)
        assert run.events is not None
        table = run.events
        self.columns, self.rows = tuple(run.columns), np.array(run.rows)
        self.heads, self.kinds, self.names = ("t", *table.columns[3:]), list(table.kinds), list(table.names)
        self.incidents = np.array(table.numbers)

    def audited(self) -> Audit:
        events = EventTable(tuple(self.kinds), tuple(self.names), self.heads, self.incidents)
        table = AuditedTable(self.columns, self.rows, (), events)
        return all_checks.audit(self.model, table, Tolerance(RTOL, ATOL))


@functools.cache
def _simulated(name: str) -> Tables:
    return Tables(MODELS[name])


def tables(name: str) -> Tables:
    found = copy.copy(_simulated(name))
    found.rows, found.incidents = found.rows.copy(), found.incidents.copy()
    found.kinds, found.names = list(found.kinds), list(found.names)
    assert "impact" in found.kinds
    return found


def fails(found: Audit) -> set[str]:
    return {check.name for check in found.checks if check.verdict == "fail"}


@pytest.mark.parametrize("name", MODELS)
def test_impacts_with_what_moves_pass(name: str) -> None:
    found = tables(name).audited()
    assert found.passed, fails(found)
    losses = found.check("losses")
    assert losses.verdict == "pass"
    assert losses.judged == losses.entries == 2 * len(tables(name).kinds)


@pytest.mark.parametrize("name", ["dumbbell", "blade"])
def test_flights_of_models_with_rows_are_judged(name: str) -> None:
    found = tables(name).audited().check("flights")
    assert found.verdict == "pass"
    assert found.judged == found.entries


def impulse_too_large(found: Tables) -> None:
    places = [k for k, name in enumerate(found.heads) if name.startswith("impulse.")]
    found.incidents[0, places] *= 1 + 1e-6


def velocity_after(found: Tables) -> None:
    place = next(k for k, name in enumerate(found.heads) if name.startswith("after."))
    found.incidents[0, place] += 1e-6


def energy_created(found: Tables) -> None:
    """The bodies leave as if more came back than has come, by impulses that fit."""
    heads = {name: k for k, name in enumerate(found.heads)}
    before = [heads[name] for name in heads if name.startswith("before.")]
    after = [heads["after." + name.removeprefix("before.")] for name in heads if name.startswith("before.")]
    line = found.incidents[0]
    line[after] += 0.8 * (line[after] - line[before])
    line[[k for name, k in heads.items() if name.startswith("impulse.")]] *= 1.8


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("fault", [impulse_too_large, velocity_after, energy_created])
def test_faults_of_an_impact_are_found(name: str, fault: Callable[[Tables], None]) -> None:
    found = tables(name)
    fault(found)
    told = found.audited()
    assert "losses" in fails(told)
    wrong = {place.name for place in told.check("losses").failing}
    assert ("energy created" in wrong) == (fault is energy_created)
    if fault is energy_created:
        # The impulses are those of the velocities, the law is another one.
        assert "impulses and velocities" not in wrong
        assert "jumps" not in fails(told)


def test_the_law_of_rows_that_move_written_out() -> None:
    """T(+) - T(-) = 1/2 impulse (dg(+) + dg(-)) + the work of the floor and of the rail, with numbers of the table."""
    found = tables("dumbbell")
    of = dict(zip(found.heads, found.incidents[0].tolist(), strict=True))
    T = {
        when: sum(m / 2 * of[f"{when}.{k}.v{axis}"] ** 2 for k, m in (("a", 1), ("b", 0.5)) for axis in "xyz")
        for when in ("before", "after")
    }
    floor, rail = 0.35 * np.cos(7 * of["t"]), 0.3 + 0.4 * of["t"]
    rates = of["before.a.vz"] + of["after.a.vz"] - 2 * floor
    works = (of["impulse.floor"] * rates / 2, of["impulse.floor"] * floor, of["impulse.rail"] * rail)
    assert T["after"] - T["before"] == pytest.approx(sum(works), abs=1e-9)
    assert min(map(abs, works)) > 1e-3


def test_the_law_of_positions_that_move_written_out() -> None:
    """Places x(q, t) that are led by t do work on their particles: m (u(+) - u(-)) . dx/dt."""
    found = tables("places")
    of = dict(zip(found.heads, found.incidents[0].tolist(), strict=True))
    t, s, w = of["t"], of["s"], of["w"]
    led = {
        "p": (-2 * np.sin(s) * np.sin(2 * t), 2 * np.sin(s) * np.cos(2 * t), 0.5 * np.cos(5 * t)),
        "q": (0.0, w, 0.6 * t),
    }
    change, work = 0.0, 0.0
    for name, m in (("p", 1), ("q", 0.7)):
        for axis, rate in zip("xyz", led[name], strict=True):
            one, other = of[f"before.{name}.v{axis}"], of[f"after.{name}.v{axis}"]
            change += m * (other**2 - one**2) / 2
            work += m * (other - one) * rate
    wall = 0.3 * np.sin(3 * t)
    mean = sum(of[f"{when}.rate(s)"] + 0.3 * of[f"{when}.rate(w)"] for when in ("before", "after")) / 2
    works = (of["impulse.stop"] * (mean + wall), -of["impulse.stop"] * wall, work)
    assert change == pytest.approx(sum(works), abs=1e-9)
    assert min(map(abs, works)) > 1e-3


@pytest.mark.parametrize("columns", [("p.x",), ("q.z",), ("before.p.vy", "after.p.vy"), ("before.q.vz",)])
def test_a_dependent_particle_that_is_elsewhere_at_an_incident_is_found(columns: tuple[str, ...]) -> None:
    """Moved alike before and after an impact it leaves the jump of the momenta as it is."""
    found = tables("places")
    found.incidents[0, [found.heads.index(name) for name in columns]] += 1e-6
    assert "kept" in fails(found.audited())


@pytest.mark.parametrize("name", MODELS)
def test_an_impact_left_out_is_found(name: str) -> None:
    found = tables(name)
    del found.kinds[0], found.names[0]
    found.incidents = np.delete(found.incidents, 0, axis=0)
    assert {"steps"} <= fails(found.audited())


def event_late(found: Tables) -> None:
    found.incidents[0, 0] += 1e-6


def flight_begins_elsewhere(found: Tables) -> None:
    """A velocity along what rows leave free, so that they do not tell."""
    place = found.heads.index("after.b.vz" if "after.b.vz" in found.heads else "after.b.vy")
    found.incidents[0, place] += 1e-6


@pytest.mark.parametrize("name", ["dumbbell", "blade"])
@pytest.mark.parametrize("fault", [event_late, flight_begins_elsewhere])
def test_faults_between_an_incident_and_the_rows_are_found(
    name: str, fault: Callable[[Tables], None]
) -> None:
    found = tables(name)
    fault(found)
    assert "flights" in fails(found.audited())


def test_energy_that_a_moving_wall_changes_is_balanced_over_the_run() -> None:
    found = tables("blade")
    assert found.audited().check("balance").verdict == "pass"
    found.incidents[0, [k for k, name in enumerate(found.heads) if name.startswith("after.")]] *= 1 + 1e-6
    assert "balance" in fails(found.audited())


def test_flights_with_rows_that_depend_on_each_other_are_not_judged() -> None:
    """Multipliers need not tell the motion there."""
    found = Tables(BLADE.replace("flat_a: a.z = 0", "flat_a: a.z = 0, twin: 2*a.z = 0"))
    told = found.audited()
    assert told.passed, fails(told)
    assert told.check("flights").verdict == "not judged"


QUARTIC = """\
lagcli: 1
coordinates: {x: {value: 1, rate: -1}}
lagrangian: rate(x)**2/2 + rate(x)**4/12
inequality: {floor: {condition: "x >= 0", restitution: 0.5}}
simulation: {duration: 2, samples: 101}
"""


def test_losses_are_not_judged_where_momenta_are_not_linear_in_the_rates() -> None:
    # Such an impact is refused by `simulate`. Between impacts the velocity is constant with either Lagrangian.
    found = Tables(QUARTIC.replace(" + rate(x)**4/12", ""))
    found.model = lagcli.loads(QUARTIC)
    # p = v + v**3/3, from -1 to 1/2
    found.incidents[0, found.heads.index("impulse.floor")] = 0.5 + 0.5**3 / 3 + 1 + 1 / 3
    told = found.audited()
    assert told.check("jumps").verdict == "pass"
    losses = told.check("losses")
    assert (losses.verdict, losses.note) == (
        "not judged",
        "momenta are not linear in the rates at 1 of 1 incidents",
    )


def test_the_energy_that_impacts_take_holds_that_of_a_lagrangian() -> None:
    found = tables("skate")
    lost = dict(found.audited().figures)["energy_lost_in_impacts"]
    of = dict(zip(found.heads, found.incidents[0].tolist(), strict=True))
    assert len(found.kinds) == 1

    def motion(when: str) -> float:
        x, y, phi = (of[f"{when}.rate({name})"] for name in ("x", "y", "phi"))
        return float(
            (x * x + y * y) / 2 + (1 + of["x"] ** 2) * phi**2 / 8 + 0.2 * np.cos(of["phi"]) * x * phi
        )

    assert lost == pytest.approx(motion("before") - motion("after"), rel=1e-9)


def test_flights_while_contacts_rest_are_judged() -> None:
    found = Tables(BOWL)
    told = found.audited().check("flights")
    assert told.verdict == "pass"
    assert told.judged >= 0.9 * told.entries


@pytest.mark.parametrize("name", ["wall", "door"])
def test_an_impact_that_is_late_while_contacts_rest_is_found(name: str) -> None:
    found = Tables(BOWL)
    rows = [k for k, each in enumerate(found.names) if each == name]
    found.incidents[found.incidents[:, 0] == found.incidents[rows[0], 0], 0] += 1e-6
    assert "flights" in fails(found.audited())


# A pendulum in its angle that strikes a wall.
PENDULUM = """\
lagcli: 1
coordinates: {th: {value: 1, rate: 0}}
particles: {a: {mass: 1, position: [sin(th), 0, -cos(th)]}}
forces: {weight: {to: a, force: [0, 0, -9.81*m]}}
inequality: {wall: {condition: a.x >= -0.2, restitution: 0.7}}
simulation: {duration: 3, samples: 301}
"""
GENERALIZED = {"places": MOVING_PLACES, "skate": SKATE, "pendulum": PENDULUM}


@pytest.mark.parametrize("name", GENERALIZED)
def test_coordinates_at_an_incident_follow_from_the_rates_of_rows(name: str) -> None:
    found = Tables(GENERALIZED[name])
    right = found.audited().check("flights")
    assert right.verdict == "pass"
    for shift in (1e-6, -1e-6):
        for k in range(min(3, len(found.kinds))):
            moved = copy.copy(found)
            moved.incidents = found.incidents.copy()
            moved.incidents[k, 0] += shift
            assert "flights" in fails(moved.audited())


def test_incidents_without_rows_around_them_are_not_judged() -> None:
    found = Tables(PENDULUM)
    found.rows = found.rows[::40]
    told = found.audited()
    assert told.check("flights").verdict == "not judged"
    assert "flights" in told.conclusion
