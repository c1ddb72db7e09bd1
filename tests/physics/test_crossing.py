"""Singular configurations on the way: passed where the motion is well defined, with their times; else told.

The truth of the linkages is one pendulum-like equation of their one degree of freedom, solved by SciPy.
"""

import dataclasses
import functools
import pathlib

import numpy as np
import pytest
import scipy.integrate

import lagcli
from lagcli.api import cache, prepare_run, run_settings
from lagcli.compiled import dop853_tableau, numeric
from lagcli.simulation import loop
from lagcli.simulation.run_state import checkpoint, run_stop
from lagcli.simulation.scheme import collocation, dop853
from lagcli.simulation.singularity import singularity_monitor, singularity_step
from lagcli.simulation.stepping import interpolate_rows
from lagcli.start import initial

pytestmark = pytest.mark.numeric

MODELS = pathlib.Path(__file__).parents[2] / "models"
FOUR_BAR = (MODELS / "double-four-bar.yaml").read_text(encoding="utf-8")
# The same, begun with all rods in one line, t = 0 a crossing: cranks point to the right and turn downwards.
LEVEL = FOUR_BAR
for old, new in (
    ('position: "[i, 0, 1]", velocity: [1, 0, 0]', 'position: "[i + 1, 0, 0]", velocity: [0, 0, -4]'),
    ('position: "[i, 0, 1/2]", velocity: [1/2, 0, 0]', 'position: "[i + 1/2, 0, 0]", velocity: [0, 0, -2]'),
    ('position: "[i - 1/2, 0, 1]", velocity: [1, 0, 0]', 'position: "[i + 1/2, 0, 0]", velocity: [0, 0, -4]'),
):
    assert LEVEL.count(old) == 1
    LEVEL = LEVEL.replace(old, new)

# Of the double four-bar: phi at t = 1, 4, 10 to 113 bits.
REFERENCE = {1: 3.337870803105097731817957, 4: 12.68425959351397191786348, 10: 31.75059718698610181708135}


def solution_of(stiffness, duration, begin, **options):
    """phi'' = stiffness sin(phi) by SciPy, to rounding."""
    return scipy.integrate.solve_ivp(
        lambda _, y: [y[1], stiffness * np.sin(y[0])],
        (0, duration),
        begin,
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
        **options,
    )


@functools.cache
def angle(N, phi=0.0, rate=1.0):
    """phi(t) of L = ((N + 1)/3 + N) phi'^2/2 - g ((N + 1)/2 + N) cos(phi), up to t = 10."""
    stiffness = 9.81 * ((N + 1) / 2 + N) / ((N + 1) / 3 + N)
    return solution_of(stiffness, 10, [phi, rate], dense_output=True)


def level_times(solution, end=10.0):
    """When the cranks lie level: cos(phi) = 0."""
    t = np.linspace(0, end, 200001)
    cosines = np.cos(solution.sol(t)[0])
    return t[:-1][np.diff(np.sign(cosines)) != 0]


def off(run, solution, name="p[0]"):
    phi = solution.sol(run.t)[0]
    return max(np.abs(run[f"{name}.x"] - np.sin(phi)).max(), np.abs(run[f"{name}.z"] - np.cos(phi)).max())


@pytest.mark.parametrize("digits", range(4, 13))
def test_the_double_four_bar_goes_through_ten_crossings_at_every_tolerance(digits):
    run = lagcli.simulate(lagcli.loads(FOUR_BAR), rtol=10.0**-digits)
    for t, phi in REFERENCE.items():
        row = int(np.flatnonzero(run.t == t)[0])
        at = np.array([run["p[0].x"][row], run["p[0].z"][row]])
        assert np.abs(at - [np.sin(phi), np.cos(phi)]).max() < max(10 * 10.0**-digits, 1e-10)
    assert off(run, angle(2)) < max(10 * 10.0**-digits, 1e-9)
    assert len(run.stats.singular_times) == 10
    assert (
        np.abs(np.array(run.stats.singular_times) - level_times(angle(2))).max() < 1e-4 + 10 * 10.0**-digits
    )
    assert run.stats.position_drift < 1e-12
    for column in run.columns:
        if not column.startswith("lambda."):
            assert np.isfinite(run[column]).all(), column


def test_forty_windows():
    run = lagcli.simulate(lagcli.loads(FOUR_BAR.replace("{N: 2,", "{N: 40,")), samples=101)
    assert off(run, angle(40)) < 1e-6
    assert off(run, angle(40), "p[0]") < 1e-8
    assert len(run.stats.singular_times) == 10


def test_crossings_of_a_system_whose_factors_are_too_large_to_be_written_out(monkeypatch):
    monkeypatch.setattr(numeric, "EXPANDED_OPERATIONS", -1)
    text = FOUR_BAR.replace("{N: 2,", "{N: 3,")
    run = lagcli.simulate(lagcli.loads(text), samples=101)
    assert off(run, angle(3)) < 1e-8
    assert len(run.stats.singular_times) == 10


@pytest.mark.parametrize("digits", [4, 6, 9, 12])
def test_a_start_at_a_crossing_goes_on_along_the_branch_of_its_velocities(digits):
    run = lagcli.simulate(lagcli.loads(LEVEL), rtol=10.0**-digits)
    truth = angle(2, np.pi / 2, 4.0)
    assert off(run, truth) < max(10 * 10.0**-digits, 1e-9)
    assert run.stats.singular_times[0] == 0
    assert len(run.stats.singular_times) == len(level_times(truth))
    # R and the energy have their limits in the first row; the forces in the rods have a pole.
    later = lagcli.simulate(lagcli.loads(LEVEL), rtol=1e-12, duration=1e-6, samples=3)
    for column in run.columns:
        if column.startswith("lambda.") and "rod" in column:
            assert np.isnan(run[column][0])
        else:
            assert abs(run[column][0] - later[column][2]) < 1e-4, column


def test_a_row_exactly_at_a_crossing():
    """Rows are asked for at the very times that were found, and close by."""
    times = lagcli.simulate(lagcli.loads(FOUR_BAR), rtol=1e-11).stats.singular_times
    for crossed in times[:3]:
        run = lagcli.simulate(lagcli.loads(FOUR_BAR), rtol=1e-11, duration=2 * crossed, samples=3)
        assert run.t[1] == crossed
        assert off(run, angle(2)) < 1e-9
        assert np.isfinite(run["R.p[0].x"]).all()
        beside = lagcli.simulate(lagcli.loads(FOUR_BAR), rtol=1e-11, duration=2 * crossed + 2e-5, samples=3)
        for column in run.columns:
            if "rod" in column:
                assert not abs(run[column][1]) < 1e4  # nan, or close to the pole
            elif column != "t":
                assert abs(run[column][1] - beside[column][1]) < 2e-3, column


def test_a_run_that_ends_at_a_crossing():
    crossed = lagcli.simulate(lagcli.loads(FOUR_BAR), rtol=1e-11).stats.singular_times[0]
    run = lagcli.simulate(lagcli.loads(FOUR_BAR), rtol=1e-11, duration=crossed, samples=11)
    assert run.t[-1] == crossed
    assert off(run, angle(2)) < 1e-9


def test_poles_of_multipliers_are_right_close_to_the_crossing():
    """Of all rows within a step across, those that are interpolated too: lambda tau is smooth."""
    crossed = lagcli.simulate(lagcli.loads(FOUR_BAR), rtol=1e-12).stats.singular_times[0]
    start = f"{{start: 0, duration: {crossed + 0.002}, samples: 100001}}"
    text = FOUR_BAR.replace("{duration: 10, samples: 1001}", start)
    run = lagcli.simulate(lagcli.loads(text), rtol=1e-12)
    near = np.abs(run.t - crossed) < 1e-3
    tau, force = run.t[near] - crossed, run["lambda.crank_rod[1]"][near]
    residue = tau * force
    fit = np.polynomial.Polynomial.fit(tau, residue, 4)
    assert np.abs(residue - fit(tau)).max() < 1e-6 * np.abs(residue).max()


# Where rows left out could take the place of rows that become dependent, nothing is singular.

CRANKS = """
lagcli: 1
particles:
  a: {mass: 1, position: [0, 1, 0], velocity: [2, 0, 0]}
  b: {mass: 1, position: [1, 1, 0], velocity: [2, 0, 0]}
  c: {mass: 1, position: [0.5, 1.5, 0], velocity: [2, 0, 0]}
forces: {weight: {to: all, force: [0, -9.81*m, 0]}}
simulation: {duration: 10, samples: 101}
holonomic:
"""
CRANK_ROWS = """\
  za: a.z = 0
  zb: b.z = 0
  zc: c.z = 0
  ab: distance(a, b) = 1
  ac: distance(a, c) = sqrt(0.5)
  bc: distance(b, c) = sqrt(0.5)
  ra: distance(a, [0, 0, 0]) = 1
  rb: distance(b, [1, 0, 0]) = 1
  rc: distance(c, [0.5, 0.5, 0]) = 1
""".splitlines()


@pytest.mark.parametrize("order", range(3))
@pytest.mark.parametrize("digits", [5, 9, 12])
def test_a_third_crank_leads_a_parallelogram_through(order, digits):
    """Any two of three parallel cranks have a crossing; all three have none, whichever row is left out."""
    rows = CRANK_ROWS[3 * order :] + CRANK_ROWS[: 3 * order]
    text = CRANKS + "\n".join(rows)
    run = lagcli.simulate(lagcli.loads(text), rtol=10.0**-digits)
    truth = solution_of(9.81, 10, [0, 2], t_eval=run.t).y[0]
    assert np.abs(run["a.x"] - np.sin(truth)).max() < max(10 * 10.0**-digits, 1e-9)
    assert run.stats.singular_times == ()
    assert set(run.stats.indeterminate) == {"ab", "ac", "bc", "ra", "rb", "rc"}
    largest = np.abs(run["lambda.ra"]).max()
    # Three equal particles bear three equal forces.
    for name in ("rb", "rc"):
        np.testing.assert_allclose(run[f"lambda.{name}"], run["lambda.ra"], rtol=0, atol=1e-9 * largest)


# Rows that vanish, toggle positions, cusps, and branches that do not quite meet.

PLANE = """
lagcli: 1
coordinates: {{x: {{value: {}, rate: {}}}, y: {{value: {}, rate: {}}}}}
lagrangian: (rate(x)**2 + rate(y)**2)/2
holonomic: {{row: {}}}
simulation: {{duration: 2, samples: 21}}
"""


def test_two_lines_that_cross_are_gone_along_and_the_time_is_reported():
    model = lagcli.loads(PLANE.format(1, -1, 0, 0, "x*y = 0"))
    run = lagcli.simulate(model)
    assert run.stats.singular_times == pytest.approx((1,), abs=1e-12)
    np.testing.assert_allclose(run["x"], 1 - run.t, rtol=0, atol=1e-12)
    assert np.abs(run["y"]).max() < 1e-15
    running = prepare_run.start(model, model.simulation)
    list(running.blocks())
    (note,) = running.notes
    assert "at t = 1: there the row `row` has no direction" in note


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize("digits", [5, 9])
def test_branches_that_do_not_meet_are_not_jumped_between(gap, digits):
    """x y = gap is a hyperbola: from (1, gap) towards the origin the bead turns up along y."""
    model = lagcli.loads(PLANE.format(1, -1, gap, gap, f"x*y = {gap!r}"))
    run = lagcli.simulate(model, rtol=10.0**-digits)
    assert (run["x"] > 0).all()
    assert run["y"][-1] > 0.9
    assert run.stats.singular_times == ()
    np.testing.assert_allclose(run["x"] * run["y"], gap, rtol=1e-9)
    speed = np.hypot(run["rate(x)"], run["rate(y)"])
    np.testing.assert_allclose(speed, speed[0], rtol=10 * 10.0**-digits)


def test_a_nearly_parallel_linkage_does_not_cross():
    """A coupler a little too short: no branches meet, and the cranks swing back."""
    text = FOUR_BAR.replace(
        'equation: "1 = distance(p[i-1], p[i])"', 'equation: "1 - 1e-3 = distance(p[i-1], p[i])"'
    )
    assert text != FOUR_BAR
    run = lagcli.simulate(lagcli.loads(text), assemble=True, rtol=1e-9)
    assert run.stats.singular_times == ()
    assert run.stats.position_drift < 1e-12
    assert run.stats.energy_imbalance < 1e-7


DRIVEN = """
lagcli: 1
particles: {a: {mass: 1, position: [0, 1, 0], velocity: [1, 0, 0]}}
holonomic:
  plane: a.z = 0
  rod: distance(a, [0, 0, 0]) = 1
  drive: a.x = t
simulation: {duration: 2, samples: 21}
"""


def test_a_toggle_position_stops_the_run_with_its_rows_and_their_names():
    """The drive wants the rod to reach beyond its length: its velocity grows without bound before t = 1."""
    model = lagcli.loads(DRIVEN)
    running = prepare_run.start(model, model.simulation)
    blocks = []
    with pytest.raises(run_stop.RunStop, match=r"`rod`, `drive` become dependent .* toggle") as stopped:
        blocks.extend(running.blocks())
    assert stopped.value.stop.t == pytest.approx(1, abs=1e-9)
    rows = np.concatenate(blocks)
    assert rows[-1, 0] == 0.9
    np.testing.assert_allclose(rows[:, 2], np.sqrt(1 - rows[:, 0] ** 2), rtol=0, atol=1e-9)


def test_a_cusp_stops_the_run():
    model = lagcli.loads(PLANE.format(1, -1, 1, -1.5, "x**3 = y**2"))
    running = prepare_run.start(model, model.simulation)
    with pytest.raises(run_stop.RunStop, match="the gradient of `row` vanishes there"):
        list(running.blocks())


def test_slider_crank_with_equal_rods_goes_on_along_its_smooth_branch():
    """Where the slider comes to the pivot it could stay and let the rods turn together; it slides on."""
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [0.6, 0.8, 0], velocity: [0.8, -0.6, 0]}
  b: {mass: 1, position: [1.2, 0, 0], velocity: [1.6, 0, 0]}
holonomic:
  pa: a.z = 0
  pb: b.z = 0
  rail: b.y = 0
  crank: distance(a, [0, 0, 0]) = 1
  rod: distance(a, b) = 1
simulation: {duration: 5, samples: 51}
"""
    run = lagcli.simulate(lagcli.loads(text))
    assert len(run.stats.singular_times) == 2
    np.testing.assert_allclose(run["b.x"], 2 * run["a.x"], rtol=0, atol=1e-9)
    energy = (run["a.vx"] ** 2 + run["a.vy"] ** 2 + run["b.vx"] ** 2) / 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


# Breaking off and going on.


@pytest.mark.parametrize(
    "text", [FOUR_BAR, LEVEL, CRANKS + "\n".join(CRANK_ROWS)], ids=["passing", "standing", "rows"]
)
def test_a_run_goes_on_bit_for_bit_across_crossings(text, monkeypatch):
    model = lagcli.loads(text)
    options = run_settings.chosen(model, {"duration": 3, "samples": 301})
    uncut = lagcli.simulate(model, duration=3, samples=301)
    monkeypatch.setattr(loop, "BLOCK_VALUES", 60)
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    for rows in (1, 40, 118, 123, 124, 127, 140, 299):
        running = prepare_run.start(model, options)
        blocks = []
        for block in running.blocks():
            blocks.append(block)
            if sum(map(len, blocks)) >= rows:
                break
        point = checkpoint.decoded(checkpoint.encoded(running.checkpoint()))
        again = prepare_run.resume(model, options, point)
        found = np.concatenate([*blocks, *again.blocks()])
        assert found.tobytes() == uncut.rows.tobytes()
        assert again.stats.singular_times == uncut.stats.singular_times
        assert again.stats.indeterminate == uncut.stats.indeterminate
        assert again.notes == running.notes or len(running.notes) <= len(again.notes)


# Parts.


@pytest.mark.parametrize("slope", [0.3, 2.0])
def test_the_instant_is_foreseen_where_the_clearance_goes_to_zero_in_a_line(slope):
    monitor, found = singularity_monitor.SingularityMonitor(), []
    for t in (1.0, 1.3, 1.6, 1.8):
        monitor = monitor.after(t, min(1.0, slope * (2 - t)) ** 2, 1.0)
        found.append(monitor.foreseen)
    assert found[0] == singularity_monitor.NEVER
    assert abs(found[-1].instant - 2) < 0.05
    assert found[-1].is_near(1.8, 0.15, 1e-8, 8)
    assert not found[-1].is_near(1.8, 0.05, 1e-6, 8)
    assert singularity_monitor.SingularityMonitor.of(monitor.state) == monitor
    # Going apart, or too far to be seen.
    assert monitor.after(1.9, 0.5, 1.0).foreseen == singularity_monitor.NEVER


def test_interpolation_finds_poles_limits_and_what_is_not_smooth():
    taus = np.array([-0.3, -0.2, -0.12, -0.06, 0.06, 0.12, 0.2, 0.3])
    smooth, pole, jump, kink = np.cos(taus), np.exp(taus) / taus, np.sign(taus), np.abs(taus)
    lines = np.stack([smooth, pole, jump, kink, 1e-17 * np.sin(1e3 * taus)], axis=1)
    at = interpolate_rows.interpolated(taus, lines, 0.0)
    assert abs(at[0] - 1) < 1e-9
    assert np.isnan(at[1:4]).all()
    assert abs(at[4]) < 1e-15
    beside = interpolate_rows.interpolated(taus, lines, 0.01)
    assert abs(beside[0] - np.cos(0.01)) < 1e-9
    assert abs(beside[1] - np.exp(0.01) / 0.01) < 1e-6


def test_gauss_nodes_have_their_order():
    """Integrals over polynomials of degree 2s - 1 are exact, and the middle is no node of an even number."""
    for count in (8, 10):
        nodes, A = collocation.gauss(count)
        assert np.abs(collocation.gauss(count)[0] - 0.5).min() > 0.01
        weights = collocation._weights(count, 1.0)
        for degree in range(2 * count):
            assert abs(weights @ nodes**degree - 1 / (degree + 1)) < 1e-14
        for degree in range(count):
            np.testing.assert_allclose(A @ nodes**degree, nodes ** (degree + 1) / (degree + 1), atol=1e-14)


# Linkages of other shapes, at tolerances where rounding and the tolerance meet.

PARALLELOGRAM = """
lagcli: 1
particles:
  a: {mass: 1, position: [0.6, 0.8, 0], velocity: [0.8, -0.6, 0]}
  b: {mass: 2, position: [2.6, 0.8, 0], velocity: [0.8, -0.6, 0]}
forces: {weight: {to: all, force: [0, -9.81*m, 0]}}
holonomic:
  pa: a.z = 0
  pb: b.z = 0
  ca: norm(a) = 1
  cb: distance(b, [2, 0, 0]) = 1
  ab: distance(a, b) = 2
simulation: {duration: 3, samples: 31}
"""


@pytest.mark.parametrize("digits", [4, 5, 6, 7, 8, 9, 10, 11, 12])
def test_unequal_masses_at_every_tolerance(digits):
    run = lagcli.simulate(lagcli.loads(PARALLELOGRAM), rtol=10.0**-digits)
    truth = solution_of(9.81, 3, [np.arcsin(0.6), 1.0], t_eval=run.t, events=lambda _, y: np.cos(y[0]))
    assert np.abs(run["a.x"] - np.sin(truth.y[0])).max() < max(10 * 10.0**-digits, 1e-9)
    assert len(run.stats.singular_times) == len(truth.t_events[0])
    assert np.abs(np.array(run.stats.singular_times) - truth.t_events[0]).max() < max(
        10 * 10.0**-digits, 1e-6
    )


FREE = """
lagcli: 1
coordinates: {p: {rate: 1}, q: {rate: 1}}
lagrangian: rate(p)**2/2 + 3*rate(q)**2/2
holonomic: {ab: "(2 + sin(q) - sin(p))**2 + (cos(q) - cos(p))**2 = 4"}
simulation: {duration: 2*pi, samples: 401}
"""


@pytest.mark.parametrize("digits", range(3, 12))
def test_a_crossing_is_not_stepped_over_where_nothing_else_limits_the_step(digits):
    """Both angles are t: without forces the scheme has no error, and a step could be longer than a turn."""
    run = lagcli.simulate(lagcli.loads(FREE), rtol=10.0**-digits)
    assert run.stats.singular_times == pytest.approx((np.pi / 2, 3 * np.pi / 2), abs=1e-6)
    np.testing.assert_allclose(run["p"], run.t, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["R.p"], 0, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run["energy"], 2, rtol=1e-8)


def near_the_crossing(early):
    """A parallelogram linkage that turns with rate 1, an angle `early` before its rods are in line."""
    phi, rate = np.pi / 2 - early, 1.0
    x, z, u, w = np.sin(phi), np.cos(phi), rate * np.cos(phi), -rate * np.sin(phi)
    return f"""
lagcli: 1
particles:
  a: {{mass: 1, position: [{x}, 0, {z}], velocity: [{u}, 0, {w}]}}
  b: {{mass: 3, position: [2 + {x}, 0, {z}], velocity: [{u}, 0, {w}]}}
forces: {{weight: {{to: all, force: [0, 0, -9.81*m]}}}}
holonomic:
  pa: a.y = 0
  pb: b.y = 0
  ca: norm(a) = 1
  cb: distance(b, [2, 0, 0]) = 1
  ab: distance(a, b) = 2
simulation: {{duration: 0.3, samples: 31}}
"""


@pytest.mark.parametrize("early", [1e-1, 3e-2, 1e-2])
@pytest.mark.parametrize("digits", [4, 6, 8, 11])
def test_a_crossing_soon_after_the_start(early, digits):
    phi, rate = np.pi / 2 - early, 1.0
    run = lagcli.simulate(lagcli.loads(near_the_crossing(early)), rtol=10.0**-digits)
    truth = solution_of(9.81, 0.3, [phi, rate], t_eval=run.t, events=lambda _, y: np.cos(y[0]))
    assert np.abs(run["a.x"] - np.sin(truth.y[0])).max() < max(10 * 10.0**-digits, 1e-9)
    assert np.abs(np.array(run.stats.singular_times) - truth.t_events[0]).max(initial=0) < 1e-6
    assert len(run.stats.singular_times) == len(truth.t_events[0])


def test_a_crossing_beyond_the_end_is_not_reported():
    crossed = lagcli.simulate(lagcli.loads(FOUR_BAR)).stats.singular_times[0]
    run = lagcli.simulate(lagcli.loads(FOUR_BAR), duration=crossed - 1e-3, samples=11)
    assert run.stats.singular_times == ()


@pytest.mark.parametrize("gap", [0.0, 1e-11, 1e-9])
def test_rank_is_lost_only_where_branches_meet(gap):
    """At the origin the gradient of x y - gap vanishes; the lines meet there, the branches of a hyperbola do not."""
    ready = cache.compiled(lagcli.loads(PLANE.format(1, -1, gap, gap, f"x*y = {gap!r}")))
    before = initial.declared(ready.system)
    there = dataclasses.replace(before, t=1.0, q=np.zeros(2))
    found = singularity_step.loss(ready.numeric, before, there, 1e-13)
    assert (found is None) == (gap > 0)
    assert found is None or (found.t, found.number, found.participants) == (1.0, 1, (0,))


@pytest.mark.parametrize("turn", [0.1, 0.3, 1.0, 2.0, 2.4])
def test_a_zero_within_a_step_is_seen_wherever_it_lies(turn):
    """A root like |sin|, of an angle that turns by so much in a step; beside it a row that stays."""
    at = np.array([*(dop853_tableau.C[s] for s in dop853.WATCHED), 1.0])
    hidden = dop853._hidden()
    for place in np.linspace(0.03, 0.97, 95):
        squares = np.sin(turn * (at - place)) ** 2
        assert float(hidden(np.stack([squares, np.full(8, 3.0)]))) < 0, place
        assert float(hidden(np.stack([np.full(8, 0.7), squares]))) < 0, place
    for begin in np.linspace(0.05, max(0.06, 3.0 - turn), 20):  # the same angle without a zero
        squares = np.sin(begin + turn * at) ** 2
        if begin + turn < 3.0 and turn <= 1.0:
            assert float(hidden(np.stack([squares, np.full(8, 3.0)]))) > 0, begin


# A light rod hangs on a pin, a weight on the light rod.
WEIGHTED = """\
lagcli: 1
parameters: {heavy: 1}
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: heavy, position: [1, 0, -1]}
forces: {w: {to: all, force: [0, 0, -9.81*m]}}
holonomic: {r1: norm(a) = 1, r2: "distance(a, b) = 1", ya: a.y = 0, yb: b.y = 0}
simulation: {duration: 0.5, samples: 6}
"""
# A crank and its rod, which a slider pulls straight.
STRAIGHT = """\
lagcli: 1
parameters: {heavy: 1}
particles:
  a: {mass: 1, position: [0.6, 0, 0.8], velocity: [0.8, 0, -0.6]}
  b: {mass: heavy, position: [1.2, 0, 0], velocity: [1.6, 0, 0]}
holonomic:
  r1: norm(a) = 1
  r2: distance(a, b) = 1
  out: b.x = 1.2 + 1.6*t
  yb: b.y = 0
  zb: b.z = 0
  ya: a.y = 0
simulation: {duration: 2, samples: 6}
"""


@pytest.mark.parametrize("heavy", [1e4, 1e6, 1e8])
def test_a_mass_ratio_does_not_stop_a_run(heavy):
    run = lagcli.simulate(lagcli.loads(WEIGHTED, parameters={"heavy": heavy}))
    assert run.stats.stopped is None
    assert run.t[-1] == 0.5


@pytest.mark.parametrize("heavy", [1e11, 1e12, 1e14])
def test_independent_rows_are_not_called_dependent_for_a_mass_ratio(heavy):
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        lagcli.simulate(lagcli.loads(WEIGHTED, parameters={"heavy": heavy}))
    assert stopped.value.code == run_stop.TOO_SMALL
    assert "dependent" not in str(stopped.value)
    assert f"inertias that differ by a factor of {heavy:.0e} amplify rounding" in str(stopped.value)


@pytest.mark.parametrize("heavy", [1, 1e4, 1e10])
def test_a_toggle_is_called_singular_whatever_the_masses(heavy):
    with pytest.raises(lagcli.SimulationStopped, match=r"`r1`, `r2`.* become dependent .* toggle") as stopped:
        lagcli.simulate(lagcli.loads(STRAIGHT, parameters={"heavy": heavy}))
    assert "inertias" not in str(stopped.value)
    assert stopped.value.code == run_stop.SINGULAR
