"""Time counts from the start: where nothing depends on t, the start is a label."""

import numpy as np
import pytest

import lagcli
from lagcli.api import prepare_run, run_settings
from lagcli.simulation.run_state import checkpoint
from tests.helpers.parallelogram import LINKAGE

PENDULUM = """\
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, -1], velocity: [1, 0, 0]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}}
holonomic: {rod: norm(a) = 1}
outputs: {clock: 2*t}
"""
SLEIGH = """\
lagcli: 1
coordinates: {x: {rate: 1}, y: {}, theta: {rate: 0.7}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(theta)**2)/2 - 3.8*x
differential: {edge: sin(theta)*d(x) - cos(theta)*d(y) = 0}
"""
# Its integral x - 2*t says when, and its row does not.
BELT = """\
lagcli: 1
coordinates: {x: {rate: 2}, y: {value: 1}}
lagrangian: (rate(x)**2 + rate(y)**2 - y**2)/2
differential: {belt: d(x) = 2*dt}
"""
DRIVEN = """\
lagcli: 1
parameters: {t0: 0}
particles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 3, 0]}}
holonomic: {ring: norm(a) = 1, plane: a.z = 0}
forces: {push: {to: a, force: "[0.7*cos(3*(t - t0)), 0, 0]"}}
"""


def table(text, **options):
    return lagcli.simulate(lagcli.loads(text), **options)


@pytest.mark.parametrize("start", [1.0, -2.5, 1e6, 1e8])
@pytest.mark.parametrize("text", [PENDULUM, SLEIGH, LINKAGE], ids=["pendulum", "sleigh", "four-bar"])
def test_an_autonomous_motion_is_the_same_at_every_start(text, start):
    options = {"duration": 3, "output_step": 0.07}
    here, there = table(text, **options), table(text, start=start, **options)
    n = 1 + here.columns.index("energy")
    assert (here.rows[:, 1:n] == there.rows[:, 1:n]).all()
    assert here.stats.steps == there.stats.steps
    step = [start + i * 0.07 for i in range(len(here.rows) - 1)]
    assert there.t.tolist() == [*step, start + 3]
    assert [start + t for t in here.stats.singular_times] == list(there.stats.singular_times)


def test_an_output_reads_the_time_of_the_model():
    run = table(PENDULUM, start=1e6, duration=1, samples=11)
    assert (run["clock"] == 2 * run.t).all()


def test_an_integral_that_says_when_keeps_the_time_of_the_model():
    run = table(BELT, start=5, duration=2, samples=5)
    assert run["x"] == pytest.approx(2 * (run.t - 5), abs=1e-12)
    assert run["y"] == pytest.approx(
        lagcli.simulate(lagcli.loads(BELT), duration=2, samples=5)["y"], abs=1e-12
    )


@pytest.mark.parametrize("start", [0, 1e8])
def test_a_run_goes_on_bit_for_bit_from_any_start(start):
    model = lagcli.loads(PENDULUM)
    whole = run_settings.chosen(model, {"start": start, "duration": 4, "samples": 41})
    straight = lagcli.simulate(model, start=start, duration=4, samples=41)
    half = prepare_run.start(
        model, run_settings.chosen(model, {"start": start, "duration": 2, "samples": 21})
    )
    rows = [block.copy() for block in half.blocks()]
    point = checkpoint.decoded(checkpoint.encoded(half.checkpoint()))
    rest = prepare_run.resume(model, whole, point)
    rows += list(rest.blocks())
    together = [row.tobytes() for block in rows for row in block]
    expected = [row.tobytes() for row in straight.rows]
    # The last row of the first half is that of a step cut to end there.
    assert together[:20] + together[21:] == expected[:20] + expected[21:]


def test_where_a_run_stops_is_reported_in_the_time_of_the_model():
    text = PENDULUM.replace("norm(a) = 1", "norm(a) = 1, cusp: (a.x - 0.1)**2 = 1e-2*(a.z + 1)")
    with pytest.raises((lagcli.SimulationStopped, lagcli.ModelError)):
        table(text)
    collision = """\
lagcli: 1
coordinates: {x: {value: 1, rate: -1}}
lagrangian: rate(x)**2/2 + 1/x
"""
    times = []
    for start in (0, 1e6):
        with pytest.raises(lagcli.SimulationStopped, match="stopped at t = ") as stopped:
            table(collision, start=start)
        times.append(stopped.value.t)
    assert times[1] == pytest.approx(1e6 + times[0], rel=1e-12)
    assert 1e6 < times[1] < 1e6 + 1


@pytest.mark.parametrize("rtol", [1e-11, 1e-12])
def test_steps_of_a_driven_motion_are_not_cut_by_the_rounding_of_the_time(rtol):
    options = {"duration": 10, "samples": 3, "rtol": rtol}
    here = table(DRIVEN, **options)
    there = lagcli.simulate(lagcli.loads(DRIVEN, {"t0": 1e6}), start=1e6, **options)
    assert there.stats.steps < 2 * here.stats.steps
    for column in ("a.x", "a.vy", "lambda.ring", "R.a.x"):
        # The doubles around 1e6 are 1.2e-10 apart.
        assert there[column] == pytest.approx(here[column], abs=1e-8)


def test_a_driven_coordinate_goes_on_at_late_times():
    """The rounding of the time moves the row by more than a step's tolerance: it is no jump, and no reason to stop."""
    text = """
lagcli: 1
coordinates: {x: {}}
lagrangian: rate(x)**2/2
holonomic: {drive: x = 2*sin(3*t)}
"""
    run = lagcli.simulate(lagcli.loads(text), start=11700, duration=30, samples=31, assemble=True)
    np.testing.assert_allclose(run["x"], 2 * np.sin(3 * run.t), rtol=0, atol=1e-11)
    np.testing.assert_allclose(run["lambda.drive"], -18 * np.sin(3 * run.t), rtol=0, atol=1e-9)
    assert run.stats.steps < 1000
    assert run.stats.energy_imbalance < 1e-8


DISK = """\
lagcli: 1
coordinates: {x: {rate: 2}, y: {}, phi: {rate: 1}, theta: {rate: 2}}
lagrangian: rate(x)**2/2 + rate(y)**2/2 + rate(phi)**2/8 + rate(theta)**2/4
differential: {x: d(x) = cos(phi)*d(theta), y: d(y) = sin(phi)*d(theta)}
"""


@pytest.mark.parametrize("start", [1e8, 1e10])
@pytest.mark.parametrize("samples", [101, 1001])
def test_a_right_table_passes_its_audit_where_its_times_are_rounded(start: float, samples: int) -> None:
    model = lagcli.loads(DISK)
    run = lagcli.simulate(model, start=start, duration=5, samples=samples)
    found = lagcli.audit(model, run)
    assert found.passed, [check.name for check in found.checks if check.verdict == "fail"]
    # What is said about it is not given up: a velocity that is wrong by a thousandth fails.
    rows = run.rows.copy()
    rows[:, run.columns.index("rate(x)")] *= 1.001
    assert not lagcli.audit(model, lagcli.Trajectory(run.columns, rows, run.stats)).passed
