"""Forces that switch in the velocities: where both sides push the motion onto the switch it sticks, and the run stops;
a switch that is crossed stops nothing."""

import json
import time

import numpy as np
import pytest

import lagcli
from tests.helpers import in_process

pytestmark = pytest.mark.numeric
SIDE = "lagcli: 1\nsimulation: {duration: 5, samples: 11}\n"


def slider(force, extra="", **start):
    """A coordinate of unit mass, and a force on it."""
    begin = ", ".join(f"{key}: {value}" for key, value in ({"value": 0, "rate": 2} | start).items())
    return (
        SIDE
        + f"coordinates: {{x: {{{begin}}}}}\nlagrangian: rate(x)**2/2{extra}\n"
        + f'forces: {{dry: {{to: x, force: "{force}"}}}}\n'
    )


def body(velocity, forces, extra="", position="[0, 0, 0]", mass=2):
    return (
        SIDE
        + f"particles: {{b: {{mass: {mass}, position: {position}, velocity: {velocity}}}}}\n"
        + f"forces:\n{forces}{extra}"
    )


def stopped(text, **changes):
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(lagcli.loads(text), **changes)
    found = caught.value
    assert found.code == "motion-sticks", str(found)
    assert "both sides push the motion onto the switch" in str(found)
    return found


# A force that opposes a velocity of 2 with 1 per unit of mass: rest at t = 2, x = 2.
OPPOSING = [
    "-sign(rate(x))",
    "sign(-rate(x))",
    "-abs(rate(x))/rate(x)",
    "-rate(x)/abs(rate(x))",
    "-rate(x)/sqrt(rate(x)**2)",
    "-rate(x)*(rate(x)**2)**(-0.5)",
    "-max(rate(x), 0)/abs(rate(x)) - min(rate(x), 0)/abs(rate(x))",
    "-max(sign(rate(x)), -1)",
    "-atan2(rate(x), 0)/(pi/2)",
    "-(atan(1/rate(x)) + atan(rate(x)))/(pi/2)",
]


@pytest.mark.parametrize("start", [0.0, 1e6])
@pytest.mark.parametrize("force", OPPOSING)
def test_friction_that_holds_stops_the_run_where_the_body_comes_to_rest(force, start):
    found = stopped(slider(force), start=start, duration=5.0, samples=51)
    assert found.t == pytest.approx(start + 2.0, abs=1e-6)
    assert "the force `dry` switches at x = 2, rate(x) = 0" in str(found)
    rows = found.trajectory
    assert rows.t[-1] == pytest.approx(start + 1.9, abs=1e-9)
    t = rows.t - start
    assert rows["x"] == pytest.approx(2 * t - t**2 / 2, abs=1e-9)
    assert rows["rate(x)"] == pytest.approx(2 - t, abs=1e-9)


@pytest.mark.parametrize(
    ("velocity", "force"),
    [
        ("[1.2, 0.9, 0]", "-3*m*v/norm(v)"),
        ("[1.2, 0.9, 0]", "-3*m*v/sqrt(dot(v, v))"),
        ("[0.9, 0, 1.2]", "-3*m*v*dot(v, v)**(-0.5)"),
        ("[1.5, 0, 0]", "[-3*m*sign(v.x), 0, 0]"),
        ("[0, -1.5, 0]", "[0, -3*m*sign(b.vy), 0]"),
    ],
)
def test_friction_in_space_stops_the_run_at_rest(velocity, force):
    found = stopped(body(velocity, f'  dry: {{to: b, force: "{force}"}}\n'), samples=51)
    assert found.t == pytest.approx(0.5, abs=1e-7)
    assert "the force `dry` switches at b." in str(found)


def test_friction_beside_other_forces_and_rows():
    """A block slides up a slope of 45 degrees and stays; its push on the slope is right up to there."""
    found = stopped(
        body(
            "[1, 0, 1]",
            '  w: {to: all, force: "[0, 0, -m*10]"}\n'
            "  grip: {to: b, force: -1.2*m*10*sqrt(0.5)*v/norm(v)}\n"
            "holonomic: {slope: b.z = b.x, side: b.y = 0}\n",
        ),
        samples=501,
    )
    rate = 10 * np.sqrt(0.5) * (1 + 1.2)
    assert found.t == pytest.approx(np.sqrt(2) / rate, abs=1e-7)
    assert "the force `grip` switches" in str(found)
    rows = found.trajectory
    assert rows["lambda.slope"] == pytest.approx(np.full(len(rows.t), 10.0), abs=1e-9)
    assert rows["R.b.z"] == pytest.approx(np.full(len(rows.t), 10.0), abs=1e-9)


def test_friction_on_a_closed_contact():
    found = stopped(
        body(
            "[3, 0, 0]",
            '  w: {to: all, force: "[0, 0, -m*10]"}\n'
            '  mu: {to: b, force: "[-0.2*m*10*sign(b.vx), 0, 0]"}\n'
            "inequality: {floor: b.z >= 0}\n",
        )
    )
    assert found.t == pytest.approx(1.5, abs=1e-7)
    assert found.trajectory["lambda.floor"] == pytest.approx(np.full(3, 20.0), abs=1e-9)


@pytest.mark.parametrize("second", ["sign(a.vx - b.vx)", "-sign(b.vx - a.vx)"])
def test_two_bodies_that_come_to_slide_no_longer_on_each_other(second):
    text = (
        SIDE
        + "particles:\n  a: {mass: 1, position: [0, 0, 0], velocity: [2, 0, 0]}\n"
        + "  b: {mass: 3, position: [0, 1, 0]}\nforces:\n"
        + '  down: {to: a, force: "[-sign(a.vx - b.vx), 0, 0]"}\n'
        + f'  up: {{to: b, force: "[{second}, 0, 0]"}}\n'
    )
    found = stopped(text)
    assert found.t == pytest.approx(1.5, abs=1e-7)
    assert "the forces `down` and `up` switch at a.x = 1.875, a.vx = 0.5, b.x = 0.375, b.vx = 0.5" in str(
        found
    )


@pytest.mark.parametrize("law", ["[-2*sign(v.x), 0, 0]", "-2*v/norm(v)"])
def test_of_a_family_the_first_member_to_rest_stops_the_run(law):
    text = (
        SIDE
        + "parameters: {N: 12}\nparticles:\n"
        + '  b[i]: {for: "i = 1..N", mass: i, position: [0, i, 0], velocity: [4 - 0.1*i, 0, 0]}\n'
        + f'forces:\n  mu: {{to: b, force: "{law}"}}\n'
    )
    found = stopped(text)
    assert found.t == pytest.approx(3.9 / 2, abs=1e-7)
    assert "the force `mu` switches at b[1].x = 3.8025, b[1].vx = 0" in str(found)


@pytest.mark.parametrize(
    ("text", "t", "place"),
    [
        # On a belt: the block is taken along from the instant at which it has its speed.
        (slider("-3*sign(rate(x) - 0.5)", " - 5*x**2", rate=0), None, "rate(x) = 0.5"),
        (slider("-3*sign(rate(x) - cos(t))", rate=0), None, "rate(x) = 0.9"),
        # A relay: x + rate(x) = 0 is a line on which the motion slides.
        (
            slider("-sign(x + rate(x))", value=0.5, rate=0),
            np.sqrt(2) - 1,
            "x = 0.414214, rate(x) = -0.414214",
        ),
        # Twice across the switch, and held in the third turning point.
        (slider("-2*sign(rate(x))", " - 5*x**2", value=1.1, rate=0), 3 * np.pi / np.sqrt(10), "x = 0.1, "),
        # From the start: pulled by less than holds it.
        (slider("0.5 - sign(rate(x))", rate=0), 0.0, "x = 0, rate(x) = 0"),
        (slider("0.5*cos(t) - sign(rate(x))", rate=0), 0.0, "x = 0, rate(x) = 0"),
    ],
)
def test_other_switches_on_which_a_motion_sticks(text, t, place):
    found = stopped(text)
    assert place in str(found)
    if t is not None:
        assert found.t == pytest.approx(t, abs=1e-6)


def test_a_dry_oscillator_turns_nine_times_and_stops():
    """Each turning point is nearer by 2 F/k, as the textbook has it."""
    text = slider("-0.5*sign(rate(x))", " - 5*x**2", value=1, rate=0)
    found = stopped(text, duration=20.0, samples=201)
    half = np.pi / np.sqrt(10)
    assert found.t == pytest.approx(10 * half, abs=1e-6)
    rows = found.trajectory
    turns = np.floor(rows.t / half)
    side = (-1.0) ** turns
    exact = side * (0.05 + (0.95 - 0.1 * turns) * np.cos(np.sqrt(10) * (rows.t - turns * half)))
    assert len(rows.t) == 100
    assert rows["x"] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_it_takes_few_steps(method):
    began = time.process_time()
    found = stopped(slider("-sign(rate(x))"), method=method)
    assert found.stats.steps + found.stats.rejected < 200
    assert time.process_time() - began < 5.0


@pytest.mark.parametrize(
    ("text", "x"),
    [
        # Crossed in the place, and in the velocity by a force that is too weak to hold.
        (slider("-0.1*sign(x - 0.1)", rate=1), 3.848515),
        (slider("-sign(x)", value=1, rate=0), None),
        (slider("0", " - abs(x)", value=1, rate=0), None),
        (slider("2 - sign(rate(x))", rate=-1), None),
        (slider("-rate(x)*abs(rate(x))"), np.log(11.0)),
        (slider("-tanh(rate(x)/1e-3)"), 2.0),
        (slider("-max(-1, min(1, 1000*rate(x)))"), 2.0),
        (slider("0.1*sign(rate(x))", " - 2*x**2", value=1, rate=0), None),
        (slider("-sign(rate(x))", rate=0), 0.0),
    ],
)
def test_a_switch_that_is_crossed_or_smooth_stops_no_run(text, x):
    found = lagcli.simulate(lagcli.loads(text))
    assert found.stats.stopped is None
    assert found.t[-1] == 5.0
    if x is not None:
        assert found["x"][-1] == pytest.approx(x, abs=5e-3)


def test_a_restoring_relay_swings_with_one_amplitude():
    found = lagcli.simulate(lagcli.loads(slider("-sign(x)", value=1, rate=0)), duration=200.0, samples=401)
    quarter = np.sqrt(2.0)
    phase = found.t % (4 * quarter)
    near = np.abs((phase + quarter) % (2 * quarter) - quarter)
    sign = np.where((phase > quarter) & (phase < 3 * quarter), -1.0, 1.0)
    assert found["x"] == pytest.approx(sign * (1 - near**2 / 2), abs=1e-8)


def test_a_ball_thrown_up_against_weak_friction_turns():
    text = body(
        "[0, 0, 3]", '  w: {to: all, force: "[0, 0, -m*10]"}\n  dry: {to: b, force: -m*2*v/norm(v)}\n'
    )
    found = lagcli.simulate(lagcli.loads(text), duration=1.0, samples=11)
    up = 3 / 12
    exact = np.where(found.t < up, 3 * found.t - 6 * found.t**2, 3 * up - 6 * up**2 - 4 * (found.t - up) ** 2)
    assert found["b.z"] == pytest.approx(exact, abs=1e-8)


def test_on_the_command_line_the_rows_are_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(slider("-sign(rate(x))"))
    _, error, code = in_process.run("simulate", "m.yaml", "-o", "run.csv", "--stats", "s.json")
    assert code == 3
    assert "the complete rows are in run.csv.partial" in error
    assert "the force `dry` switches at x = 2, rate(x) = 0" in error
    assert json.loads((tmp_path / "s.json").read_text())["stopped"]["code"] == "motion-sticks"
    assert len((tmp_path / "run.csv.partial").read_text().splitlines()) == 1 + 4


def test_no_hint_leads_to_a_law_that_sticks_without_saying_so():
    text = body("[1, 0, 0]", '  mu: {to: b, force: "[-0.3*multiplier(floor), 0, 0]"}\n') + (
        "holonomic: {floor: b.z = 0}\n"
    )
    with pytest.raises(lagcli.ModelError, match=r"tanh\(v/1e-3\).* a run stops where the body comes to rest"):
        lagcli.loads(text)
