"""Declared events and crossings at awkward places: the end of a run, impacts, switches and singular configurations."""

import math

import numpy as np
import pytest

import lagcli
from lagcli.simulation import loop
from tests.helpers.parallelogram import LINKAGE

pytestmark = pytest.mark.numeric

THROW = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 10]}
forces: {weight: {to: all, force: "[0, 0, -m*10]"}}
events:
  apex: {when: a.vz, direction: down}
  rise: {when: a.vz, direction: up}
  half: {when: a.x - 0.5}
  late: {when: t - 1}
  near: {when: a.x - 0.9999}
"""

BALL = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1], velocity: [1, 0, 0]}
forces: {weight: {to: all, force: "[0, 0, -m*10]"}}
inequality: {floor: {condition: a.z >= 0, restitution: 0.5}}
events:
  turn: {when: a.vz, direction: up}
  force: {when: multiplier(floor) - 5, direction: up}
"""

WALLED = f"""{LINKAGE}\
inequality: {{wall: {{condition: "a.y >= WALL", restitution: 0.5}}}}
events: {{nine: {{when: a.x - 0.999, direction: up}}, level: {{when: a.y}}}}
"""


def told(found, *kinds):
    """(kind, name) of incidents, in their order."""
    pairs = zip(found.events["kind"], found.events["name"], strict=True)
    return [(str(kind), str(name)) for kind, name in pairs if not kinds or kind in kinds]


def test_events_at_the_very_end_of_a_run_are_reported_once():
    model = lagcli.loads(THROW)
    found = lagcli.simulate(model, duration=1.0, samples=3)
    assert {name for _, name in told(found)[2:]} == {"apex", "late"}
    assert list(found.events["t"][2:]) == [1.0, 1.0]
    longer = lagcli.simulate(model, duration=1.5, samples=4)
    assert sorted(told(longer)) == sorted(told(found))


def test_an_impact_and_a_stop_at_the_very_end_of_a_run_are_reported():
    text = BALL.replace("position: [0, 0, 1]", "position: [0, 0, 0]").replace("[1, 0, 0]", "[1, 0, 1]")
    found = lagcli.simulate(lagcli.loads(text), duration=0.2, samples=3)
    assert ("impact", "floor") in told(found)
    assert found["a.vz"][-1] == pytest.approx(0.5, abs=1e-12)
    stop = THROW.replace("when: t - 1}", "when: t - 1, action: stop}")
    assert lagcli.simulate(lagcli.loads(stop), duration=1.0, samples=3).stats.ended_by == "late"


@pytest.mark.parametrize(("pause", "values"), [(0.0, 2**16), (math.inf, 2**16), (0.0, 1), (math.inf, 1)])
@pytest.mark.parametrize(
    ("start", "when", "times"),
    [
        # The row of the grid at 0.5 is a rounding before the event, and in the same step.
        (0, "a.x - 0.5000000000000002", [0.4, 0.5]),
        (0, "t - 0.5000000000000002", [0.4, 0.5]),
        # There the rounding is below that of the times as the table shows them.
        (1000, "a.x - 0.5000000000000002", [1000.4, 1000.5]),
        # A row far enough away stays, however near.
        (0, "a.x - 0.500001", [0.5, 0.500001]),
        (0, "a.x - 0.55", [0.5, 0.55]),
        # The row that an event a rounding behind it finds at the begin of its step stays alone.
        (0, "a.x - 1e-16", [0.0]),
    ],
)
def test_a_run_that_an_event_ends_has_one_row_there_however_its_rows_leave(
    monkeypatch: pytest.MonkeyPatch, start: float, when: str, times: list[float], pause: float, values: int
):
    """Rows leave at once, when the block is full, or at the end; the table is the same."""
    monkeypatch.setattr(loop, "PAUSE", pause)
    monkeypatch.setattr(loop, "BLOCK_VALUES", values)
    text = f"""lagcli: 1
particles: {{a: {{mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}}}
events: {{halt: {{when: "{when}", action: stop}}}}
simulation: {{start: {start}, duration: 2, output_step: 0.1}}
"""
    found = lagcli.simulate(lagcli.loads(text))
    assert found.stats.ended_by == "halt"
    assert found["t"][-len(times) :] == pytest.approx(times, rel=1e-15, abs=1e-15)
    assert len(found["t"]) == math.ceil(round(10 * (times[-1] - start), 6)) + 1
    if len(times) > 1:
        assert found["t"][-1] == found.events["t"][-1]


def test_the_row_of_an_event_that_ends_a_run_is_the_state_after_an_impact_there(
    monkeypatch: pytest.MonkeyPatch,
):
    """The floor is met a rounding after the row of the grid at 0.5, where the event is too."""
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    text = """lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 0.5000000000000002], velocity: [0, 0, -1]}}
inequality: {floor: {condition: a.z >= 0, restitution: 0.5}}
events: {halt: {when: "t - 0.5000000000000002", action: stop}}
simulation: {duration: 2, output_step: 0.1}
"""
    found = lagcli.simulate(lagcli.loads(text))
    assert len(found["t"]) == 6
    assert found["a.vz"][-1] == 0.5


def test_recorded_events_have_the_accuracy_of_the_state():
    model = """lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}
forces: {pull: {potential: "(a.x**2 + a.y**2)/2"}}
events: {e: {when: a.y - 0.3*a.x}}
"""
    found = lagcli.simulate(lagcli.loads(model), duration=12, samples=3, rtol=1e-13)
    times = np.arctan(0.3) + np.pi * np.arange(4)
    assert np.abs(found.events["t"] - times).max() < 1e-12
    assert np.abs(found.events["a.x"] - np.cos(times)).max() < 1e-12
    assert np.abs(found.events["after.a.vy"] - np.cos(times)).max() < 1e-12


def test_events_that_jump_over_zero_at_an_impact_or_where_a_contact_closes_are_reported():
    found = lagcli.simulate(lagcli.loads(BALL), duration=2.0, samples=3)
    turns = found.events.of("event", "turn")
    impacts = found.events.of("impact")
    assert np.array_equal(turns.t, impacts.t)
    assert turns["before.a.vz"][0] < 0 < turns["after.a.vz"][0]
    force = found.events.of("event", "force")
    assert len(force) == 1
    assert found.stats.accumulations == 1
    end = (1 / 5) ** 0.5 * 3
    assert abs(force.t[0] - end) < 1e-6


def test_an_event_that_jumps_at_a_switch_is_reported():
    model = THROW.partition("events:")[0] + "events: {on: {when: sign(t - 0.3), direction: up}}\n"
    found = lagcli.simulate(lagcli.loads(model), duration=1.0, samples=3)
    assert told(found) == [("event", "on")]
    assert abs(found.events["t"][0] - 0.3) < 1e-12


def test_a_singular_configuration_that_is_passed_is_reported_in_the_order_of_time():
    model = lagcli.loads(WALLED.replace("WALL", "-2"))
    found = lagcli.simulate(model, duration=2.0, samples=3)
    assert sorted(told(found, "crossing")) == [
        ("crossing", "bar"),
        ("crossing", "left"),
        ("crossing", "right"),
    ]
    assert np.abs(found.events.of("crossing").t - np.pi / 2).max() < 1e-9
    assert np.abs(found.events.of("event", "level").t - np.pi / 2).max() < 1e-9
    assert np.abs(found.events.of("event", "nine").t - np.arcsin(0.999)).max() < 1e-11
    assert np.all(np.diff(found.events.t) >= 0)


@pytest.mark.parametrize("wall", [0.01, 0.001, -0.1])
def test_a_contact_closes_beside_a_singular_configuration(wall):
    found = lagcli.simulate(lagcli.loads(WALLED.replace("WALL", str(wall))), duration=1.75, samples=3)
    hit = found.events.of("impact")
    assert np.abs(hit.t - np.arccos(wall)).max() < 1e-10
    # Both masses go round together: an impulse on one stops both.
    assert hit["after.b.vy"][0] == pytest.approx(-hit["before.b.vy"][0] / 2, rel=1e-9)
    assert ("crossing", "bar") in told(found) or wall > 0
    assert bool(found.events.of("crossing")) == (wall < 0)


def test_a_wall_that_jumps_onto_a_particle_ends_the_run_at_its_time():
    above = BALL.replace("a.z >= 0", "a.z >= 2*sign(t - 0.3)")
    with pytest.raises(lagcli.SimulationStopped, match=r"the wall of .*`floor` jumps there") as stop:
        lagcli.simulate(lagcli.loads(above), duration=1.0, samples=3)
    assert stop.value.t == pytest.approx(0.3, abs=1e-9)


def test_a_wall_that_jumps_from_under_a_particle_lets_it_fall():
    lies = BALL.replace("[0, 0, 1]", "[0, 0, 0]").replace("a.z >= 0", "a.z >= -0.2 - 0.2*sign(t - 0.5)")
    found = lagcli.simulate(lagcli.loads(lies), duration=0.9, samples=3)
    assert found.events.of("release").t == pytest.approx([0.5], abs=1e-12)
    assert found.events.of("impact").t == pytest.approx([0.5 + 0.08**0.5], abs=1e-12)


@pytest.mark.parametrize("x", [0.1, 0.13])
def test_a_wall_that_jumps_over_a_particle_by_sign_is_no_impact(x):
    text = f"""lagcli: 1
particles:
  a: {{mass: 1, position: [{x}, 0, 0.3], velocity: [-1, 0, 0]}}
inequality:
  floor: a.z + 0.5*sign(a.x) >= 0
"""
    high = lagcli.simulate(lagcli.loads(text.replace("0.3]", "0.7]")), duration=1.0, samples=2)
    assert len(high.events) == 0
    with pytest.raises(lagcli.SimulationStopped, match=r"wall of `floor` jumps there, by 0\.2 onto") as stop:
        lagcli.simulate(lagcli.loads(text), duration=1.0, samples=2)
    assert stop.value.t == pytest.approx(x, abs=1e-12)


TRUSS = """lagcli: 1
parameters: {one: [0.75, 0, 0], two: "[-0.375, 0.375*sqrt(3), 0]", three: "[-0.375, -0.375*sqrt(3), 0]"}
particles:
  joint: {mass: 2, position: [0, 0, -1]}
forces: {weight: {to: all, force: "[0, 0, -m*9.81]"}}
holonomic:
  bar1: distance(joint, one) = 1.25
  bar2: distance(joint, two) = 1.25
  bar3: distance(joint, three) = 1.25
simulation: {duration: 1, samples: 3, atol: 1e-12}
events: {e: {when: "WHEN"}}
"""


@pytest.mark.parametrize(
    "when",
    [
        "joint.z + 1",
        "joint.y",
        "joint.vz",
        "joint.az",
        "norm(joint) - 1",
        "multiplier(bar1) - multiplier(bar2)",
        "sin(joint.z)**2 + cos(joint.z)**2 - 1",
    ],
)
def test_what_is_zero_to_rounding_all_along_has_no_crossings(when):
    # Rounding crosses zero so often that such a run did not end.
    found = lagcli.simulate(lagcli.loads(TRUSS.replace("WHEN", when)))
    assert told(found) == []
    assert found.stats.steps < 10


@pytest.mark.parametrize(
    ("when", "times"),
    [
        ("sin(20*t)", [np.pi / 20 * k for k in range(1, 7)]),
        ("multiplier(bar1) + 8.175*(1 + sin(9*t))", [np.pi / 9, 2 * np.pi / 9]),
        ("norm(joint.a) + t - 0.25", [0.25]),
        ("exp(-1e6*(t - 0.3)**2) - 0.5", [0.3 - 1e-3 * np.log(2) ** 0.5, 0.3 + 1e-3 * np.log(2) ** 0.5]),
        ("1/(t - 0.7) - 10", [0.7, 0.8]),
    ],
)
def test_functions_of_time_alone_are_watched_where_nothing_moves(when, times):
    # One step leads over the whole run, and far beyond it.
    found = lagcli.simulate(lagcli.loads(TRUSS.replace("WHEN", when)))
    assert list(found.events["t"]) == pytest.approx(times, abs=1e-12)


@pytest.mark.parametrize(
    ("when", "times"),
    [
        ("abs(t - 0.7)", []),
        ("abs(t - 0.7) - 0.1", [0.6, 0.8]),
        ("sign(t - 0.7)", [0.7]),
        ("(t - 0.7)*abs(t - 0.7)", [0.7]),
        ("t - 0.7 + 0*abs(t - 0.7)", [0.7]),
        ("1/(t - 0.7)", [0.7]),
    ],
)
@pytest.mark.parametrize("is_moving", [False, True])
def test_events_cross_or_touch_zero_at_their_own_switches(when, times, is_moving):
    text = THROW.split("events:")[0] + 'events: {e: {when: "WHEN"}}\n' if is_moving else TRUSS
    found = lagcli.simulate(lagcli.loads(text.replace("WHEN", when)), duration=1.0, samples=3)
    assert list(found.events["t"]) == pytest.approx(times, abs=1e-12)


def test_an_event_of_a_coordinate_alone_needs_no_contact():
    run = lagcli.simulate(
        lagcli.loads(
            "lagcli: 1\ncoordinates: {x: {value: 1.1, rate: 1}}\nlagrangian: rate(x)**2/2 - x**2/2\n"
            "events: {o: {when: x - 1}}\nsimulation: {duration: 3}\n"
        )
    )
    assert run.events["t"] == pytest.approx([math.pi / 2], abs=1e-9)


@pytest.mark.parametrize("at", [0.0185, 0.019, 0.0195])
def test_an_event_before_a_contact_that_soon_lets_go_is_told_once(at):
    """The step is taken again, shorter, and what was met in the longer one is forgotten."""
    model = lagcli.loads(
        """lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 0]}}
forces: {up: {to: a, force: "[0, 0, t - 0.02]"}, aside: {to: a, force: [1e-6, 0, 0]}}
inequality: {floor: {condition: a.z >= 0, restitution: 0}}
events: {seen: {when: t - AT}}
""".replace("AT", str(at))
    )
    events = lagcli.simulate(model, duration=40, samples=5).events
    assert [(one.kind, one.name) for one in events] == [("event", "seen"), ("release", "floor")]
    assert [one.t for one in events] == pytest.approx([at, 0.02], rel=1e-9)


def test_an_event_before_a_jump_that_ends_the_run_is_told():
    model = lagcli.loads(
        """lagcli: 1
coordinates: {x: {value: 0, rate: 1}}
lagrangian: rate(x)**2/2 - 3*sign(x - 1.005)
events: {seen: {when: "x - 0.995"}}
"""
    )
    with pytest.raises(lagcli.SimulationStopped, match="the Lagrangian jumps there") as stopped:
        lagcli.simulate(model, duration=2, samples=5)
    assert [one.t for one in stopped.value.trajectory.events] == pytest.approx([0.995], rel=1e-12)
