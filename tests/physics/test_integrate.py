"""The scheme, its dense output, the grid of rows, and runs that cannot go on."""

import numpy as np
import pytest

import lagcli
from lagcli.api import run_settings
from lagcli.compiled import dop853_tableau
from lagcli.model.settings import Simulation
from lagcli.simulation.scheme import dop853, step_tolerance
from lagcli.simulation.stepping import stepper


def driven(force, value=0, rate=0):
    """x'' = force."""
    start = f"{{value: {value}, rate: {rate}}}"
    return (
        f"lagcli: 1\ncoordinates: {{x: {start}}}\nlagrangian: rate(x)**2/2\n"
        f"forces:\n  f: {{to: x, force: {force}}}\n"
    )


OSCILLATOR = "lagcli: 1\ncoordinates: {x: {value: 1}}\nlagrangian: rate(x)**2/2 - x**2/2\n"


def square(rows, size):
    """Rows left of the diagonal as a full matrix."""
    A = np.zeros((len(rows), size))
    for i, row in enumerate(rows):
        A[i, : len(row)] = row
    return A


A = square(dop853_tableau.A, dop853_tableau.STAGES)
B = np.array(dop853_tableau.B)
C = np.array(dop853_tableau.C)
c = C[: dop853_tableau.STAGES]


# Coefficients.


@pytest.mark.parametrize("k", range(8))
def test_weights_integrate_powers_up_to_the_seventh(k):
    assert B @ c**k == pytest.approx(1 / (k + 1), rel=0, abs=1e-14)


def test_weights_do_not_integrate_the_eighth_power():
    assert abs(B @ c**8 - 1 / 9) > 1e-5


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (B @ A @ c, 1 / 6),
        (B * c @ A @ c, 1 / 8),
        (B @ A @ c**2, 1 / 12),
        (B @ A @ A @ c, 1 / 24),
        (B @ A @ c**3, 1 / 20),
        (B * c**2 @ A @ c**2, 1 / 18),
        (B @ A @ A @ A @ c, 1 / 120),
        (B @ A @ c**5, 1 / 42),
        (B * c @ A @ c**5, 1 / 48),
        (B @ A @ A @ c**5, 1 / 336),
        (B @ A @ A @ A @ A @ A @ A @ c, 1 / 40320),
    ],
)
def test_conditions_of_trees_up_to_order_eight(value, expected):
    assert value == pytest.approx(expected, rel=0, abs=1e-13)


def test_rows_of_the_table_sum_to_their_nodes():
    assert np.allclose(A.sum(axis=1), c, rtol=0, atol=1e-13)
    for row, node in zip(dop853_tableau.A_DENSE, C[dop853_tableau.STAGES + 1 :], strict=True):
        assert sum(row) == pytest.approx(node, rel=0, abs=1e-13)


@pytest.mark.parametrize(("weights", "order"), [("E5", 5), ("E3", 3)])
def test_error_weights_vanish_up_to_their_order(weights, order):
    E = np.array(getattr(dop853_tableau, weights))[: dop853_tableau.STAGES]
    for k in range(order):
        assert E @ c**k == pytest.approx(0, rel=0, abs=1e-13)
    assert abs(E @ c**order) > 1e-6


def test_order_of_the_step_is_eight():
    """The error of one step of y' = y falls as h**9."""

    def error(h):
        k = np.zeros(dop853_tableau.STAGES)
        for s in range(dop853_tableau.STAGES):
            k[s] = 1 + h * A[s] @ k
        return abs(1 + h * B @ k - np.exp(h))

    assert np.log2(error(0.5) / error(0.25)) == pytest.approx(9, abs=0.4)


# Dense output.


def test_interpolation_meets_both_ends_of_a_step():
    rng = np.random.default_rng(5)
    y, rows = rng.normal(size=4), rng.normal(size=(4, dop853.DENSE_ROWS))
    ends = [dop853.DormandPrince853().interpolated(y, rows, x) for x in (0.0, 1.0)]
    assert np.allclose(ends[0], y)
    assert np.allclose(ends[1], y + rows[:, 0])


def test_rows_between_steps_are_as_good_as_the_steps():
    table = lagcli.simulate(lagcli.loads(OSCILLATOR), duration=20, samples=4001)
    assert table.stats.steps < 1000
    assert np.abs(table["x"] - np.cos(table.t)).max() <= 1e-10
    assert np.abs(table["rate(x)"] + np.sin(table.t)).max() <= 1e-10


def test_multipliers_and_constraints_between_steps():
    text = """
lagcli: 1
particles:
  a: {mass: 2, position: [1.5, 0, 0], velocity: [0, 3, 0]}
holonomic:
  rod: norm(a) = 1.5
"""
    table = lagcli.simulate(lagcli.loads(text), duration=5, samples=5001)
    assert table.stats.steps < 1000
    assert np.abs(table["lambda.rod"] + 12).max() <= 1e-12 * 12
    radius = np.hypot(table["a.x"], table["a.y"])
    assert np.abs(radius - 1.5).max() <= 1e-14
    radial = table["a.x"] * table["a.vx"] + table["a.y"] * table["a.vy"]
    assert np.abs(radial).max() <= 1e-13
    assert np.abs(table["a.x"] - 1.5 * np.cos(2 * table.t)).max() <= 1e-10


def test_more_rows_do_not_change_the_motion():
    few, many = (lagcli.simulate(lagcli.loads(OSCILLATOR), duration=3, samples=n) for n in (4, 301))
    assert few.stats.steps == many.stats.steps
    assert np.array_equal(few.rows, many.rows[::100]) or np.abs(few.rows - many.rows[::100]).max() <= 1e-15


def test_tighter_tolerance_gives_a_smaller_error():
    def error(rtol):
        table = lagcli.simulate(lagcli.loads(OSCILLATOR), duration=50, samples=51, rtol=rtol, atol=rtol / 100)
        return np.abs(table["x"] - np.cos(table.t)).max()

    coarse, middle, fine = error(1e-3), error(1e-6), error(1e-9)
    assert coarse > 30 * middle
    assert middle > 30 * fine
    assert coarse <= 1e-2


def test_step_tolerance_is_tighter_than_the_asked_but_not_below_rounding():
    given = step_tolerance.of_steps(Simulation(rtol=1e-8, atol=1e-10))
    assert given == pytest.approx([1e-10, 1e-12, 0, 1e-17, 0, 0, 0, 0], rel=1e-12, abs=0)
    assert step_tolerance.of_steps(Simulation(rtol=1e-13, atol=1e-15)) == pytest.approx(
        [1e-14, 1e-16, 0, 1e-17, 0, 0, 0, 0], abs=0
    )


CHAIN = """lagcli: 1
parameters: {N: 1000, ux: 0.47704624084763686, uy: 0.09950371902099893, uz: -0.8732272865606805}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: [i*ux, i*uy, i*uz]}
forces: {w: {to: p, force: [0, 0, -9.81*m]}}
holonomic:
  hook: "norm(p[1]) = 1"
  link[i]: {for: "i = 2..N", equation: "distance(p[i], p[i-1]) = 1"}
"""


def test_an_absolute_tolerance_below_rounding_counts_as_rounding(monkeypatch):
    """Of a thousand links some entries are the rounding of others: they took steps of 1e-8 s, forever."""
    advance = stepper.Stepper.advance

    def counted(run, beyond=False):
        assert run.statistics.steps + run.statistics.rejected < 1000
        advance(run, beyond)

    monkeypatch.setattr(stepper.Stepper, "advance", counted)
    model = lagcli.loads(CHAIN)
    run, own = (
        lagcli.simulate(model, duration=0.001, samples=2, rtol=1e-15, atol=atol) for atol in (1e-17, None)
    )
    assert run.stats.steps < 100
    assert run["p[1000].z"] == pytest.approx(own["p[1000].z"], rel=1e-14)
    assert run["lambda.hook"] == pytest.approx(own["lambda.hook"], rel=1e-9)
    # While the chain is straight it hangs on the hook with all of its weight along itself, and falls freely across.
    assert run["lambda.hook"][0] == pytest.approx(-1000 * 9.81 * 0.8732272865606805, rel=1e-9)
    fallen = run["p[1].z"][1] - run["p[1].z"][0]
    assert fallen == pytest.approx(-9.81 / 2 * 0.001**2 * (1 - 0.8732272865606805**2), rel=0.01)


def test_without_atol_a_part_of_the_sizes_takes_its_place():
    assert step_tolerance.of_steps(Simulation()) == pytest.approx(
        [1e-13, 0, 1e-15, 1e-17, 0, 0, 0, 0], rel=1e-12, abs=0
    )
    assert step_tolerance.of_steps(Simulation(rtol=1e-4)) == pytest.approx(
        [1e-6, 0, 1e-15, 1e-17, 0, 0, 0, 0], rel=1e-12, abs=0
    )
    assert step_tolerance.of_steps(Simulation(rtol=1e-15))[2] == 1e-16
    assert [step_tolerance.absolute(Simulation(), size) for size in (1.0, 1e-9)] == [
        1e-13,
        pytest.approx(1e-22),
    ]
    assert step_tolerance.absolute(Simulation(atol=1e-10), 1e-9) == 1e-10


# Where the rows stand.


@pytest.mark.parametrize(
    ("start", "duration", "step", "expected"),
    [
        (0.0, 1.0, 0.25, [0, 0.25, 0.5, 0.75, 1]),
        (0.0, 1.0, 0.3, [0, 0.3, 0.6, 0.9, 1]),
        (2.0, 1.0, 0.4, [2, 2.4, 2.8, 3]),
        (-1.0, 0.5, 0.7, [-1, -0.5]),
        (0.0, 0.7, 0.1, [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),
        (0.0, 0.5, 0.5, [0, 0.5]),
    ],
)
def test_rows_stand_at_the_output_step_and_the_last_at_the_end(start, duration, step, expected):
    table = lagcli.simulate(lagcli.loads(OSCILLATOR), start=start, duration=duration, output_step=step)
    assert table.t == pytest.approx(expected, rel=1e-15, abs=1e-16)
    assert table.t[-1] == start + duration
    assert np.abs(table["x"] - np.cos(table.t - start)).max() <= 1e-12


@pytest.mark.parametrize(("start", "duration"), [(0.0, 0.1), (0.1, 0.2), (1e3, 1 / 3), (-0.7, 2.3)])
@pytest.mark.parametrize("samples", [2, 3, 7, 1001])
def test_last_row_stands_at_start_plus_duration_exactly(start, duration, samples):
    table = lagcli.simulate(lagcli.loads(OSCILLATOR), start=start, duration=duration, samples=samples)
    assert table.t[0] == start
    assert table.t[-1] == start + duration
    assert table.t.size == samples
    assert np.all(np.diff(table.t) > 0)


def test_start_may_be_a_whole_number():
    text = driven("6*t")
    model = lagcli.loads(text)
    # Looked at first: a clock of whole numbers would never advance, and the run never end.
    assert isinstance(run_settings.chosen(model, {"start": 2}).start, float)
    table = lagcli.simulate(model, start=2, duration=1, samples=2)
    assert table["rate(x)"][-1] == pytest.approx(3 * (3**2 - 2**2), rel=1e-12)


def test_duration_of_zero_is_the_start_alone():
    table = lagcli.simulate(lagcli.loads(OSCILLATOR), duration=0)
    assert table.rows.shape == (1, len(table.columns))
    assert (table.t[0], table["x"][0], table.stats.steps) == (0, 1, 0)


def test_model_without_coordinates_that_move_stays():
    text = 'lagcli: 1\nparticles:\n  a: {mass: 1, position: [1, 2, 3]}\nholonomic:\n  pin: "a = [1, 2, 3]"\n'
    table = lagcli.simulate(lagcli.loads(text), duration=100, samples=3)
    assert np.array_equal(table["a.z"], [3, 3, 3])
    assert not table.multiplier("pin").any()


@pytest.mark.parametrize(
    "options",
    [
        {"duration": -1},
        {"duration": float("nan")},
        {"samples": 1},
        {"output_step": 0},
        {"output_step": 1e-300},
        {"rtol": 0},
        {"atol": 0},
        {"atol": float("inf")},
        {"method": "euler"},
        {"samples": 3, "output_step": 0.1},
    ],
    ids=str,
)
def test_settings_out_of_bounds_are_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        lagcli.simulate(lagcli.loads(OSCILLATOR), **options)


# Runs that cannot go on.


def stopped(text, **options):
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(lagcli.loads(text), **options)
    stop = caught.value
    assert np.isfinite(stop.trajectory.rows).all()
    assert f"{stop.t:.9g}" in str(stop)
    return stop


def test_fall_into_a_centre_stops_with_the_rows_so_far():
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
forces:
  pull: {to: a, force: -r/norm(r)**3}
"""
    stop = stopped(text, duration=5, samples=501)
    # Free fall from rest at 1 under 1/x^2 takes pi/(2 sqrt(2)).
    assert stop.t == pytest.approx(np.pi / np.sqrt(8), abs=1e-6)
    table = stop.trajectory
    assert table.t.size == 112
    assert table.t[-1] <= stop.t
    assert np.abs(table["a.vx"] ** 2 / 2 - 1 / table["a.x"] + 1).max() <= 1e-6 * (1 / table["a.x"]).max()
    assert "after row 112 of 501" in str(stop)


def test_pole_of_a_force_in_time_stops_before_it():
    text = driven("1/(1 - t)")
    stop = stopped(text, duration=2, samples=21)
    assert 0.99 < stop.t <= 1
    assert stop.trajectory.t[-1] < 1
    # Promptly: rounding of the time does not make it creep.
    assert stop.trajectory.stats.steps < 20000
    t = stop.trajectory.t
    assert np.abs(stop.trajectory["rate(x)"] + np.log(1 - t)).max() <= 1e-8


def test_domain_of_a_function_that_ends_stops_the_run():
    text = driven("0.1*log(x)", value=1, rate=-1)
    stop = stopped(text, duration=2.0, samples=21)
    x, v = stop.trajectory["x"], stop.trajectory["rate(x)"]
    assert 0 < x[-1] < 0.15
    # v^2/2 - 0.1 (x log x - x) stays.
    assert np.abs(v**2 / 2 - 0.1 * (x * np.log(x) - x) - 0.6).max() <= 1e-10


def test_constraints_that_become_dependent_stop_the_run():
    # Two rods of length one from a to hooks that part: at t = 1 they lie on one line.
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [0.5, sqrt(3)/2, 0], velocity: [0.5, -1/(2*sqrt(3)), 0]}
holonomic:
  fixed: norm(a) = 1
  moving: distance(a, [1 + t, 0, 0]) = 1
"""
    stop = stopped(text, duration=2.0, samples=201)
    assert stop.t == pytest.approx(1, abs=0.01)
    table = stop.trajectory
    assert table.t[-1] == pytest.approx(0.99, abs=0.011)
    assert np.abs(table["a.x"] - (1 + table.t) / 2).max() <= 1e-12
    late = table["lambda.fixed"][table.t > 0.9]
    assert np.abs(late).max() > 10 * abs(table["lambda.fixed"][0])


def test_surface_that_ends_stops_the_run():
    # A ring that shrinks to a point at t = 1.
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0], velocity: [-0.5, 1, 0]}
holonomic:
  ring: dot(a, a) = 1 - t
  flat: a.z = 0
"""
    stop = stopped(text, duration=2, samples=21)
    assert 0.9 < stop.t <= 1
    assert stop.trajectory.t[-1] <= 1


def test_output_that_is_not_finite_stops_instead_of_writing_nan():
    stop = stopped(OSCILLATOR + "outputs: {bad: sqrt(0.5 - t)}\n", duration=1, samples=11)
    assert stop.trajectory.t[-1] == 0.5
    assert stop.trajectory["bad"][-1] == 0
    assert "not finite" in str(stop)


def test_acceleration_that_is_not_finite_at_the_start_is_refused():
    text = driven("1/x")
    with pytest.raises(lagcli.ModelError) as caught:
        lagcli.simulate(lagcli.loads(text), duration=1)
    assert [d.code for d in caught.value.diagnostics] == ["not-finite-at-start"]


def test_escape_in_finite_time_ends_promptly():
    text = driven("2*x**3", value=1, rate=1)
    # x = 1/(1 - t).
    stop = stopped(text, duration=3, samples=31)
    assert stop.t == pytest.approx(1, abs=1e-6)
    before = stop.trajectory.t < 0.95
    assert np.abs(stop.trajectory["x"] * (1 - stop.trajectory.t) - 1)[before].max() <= 1e-8
    assert stop.trajectory.stats.steps < 20000
