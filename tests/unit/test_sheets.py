"""Verdicts and counts for the motions from the start: sheets, places that rows keep to, kinks, hidden conditions."""

import random

import numpy as np
import pytest

import lagcli


def text(values, holonomic=(), differential=(), extra=""):
    lines = ["lagcli: 1", extra, "coordinates:"]
    lines += [f"  {name}: {{value: {value}}}" for name, value in values.items()]
    lines += ["lagrangian: " + " + ".join(f"rate({name})**2/2" for name in values)]
    for key, laws in (("holonomic", holonomic), ("differential", differential)):
        lines += [f"{key}:"] * bool(laws) + [f"  {key[0]}{i}: {law}" for i, law in enumerate(laws)]
    return "\n".join([*lines, "simulation: {duration: 1, samples: 3}", ""])


def count(*model, **more):
    return lagcli.dof(lagcli.loads(text(*model, **more)))


START = {"x": 1, "y": 0, "z": 0.2, "w": 0.1}
LIFT = "d(w) - ({0})*d(z) = 0"


@pytest.mark.parametrize(
    ("values", "surface", "coefficient", "truth"),
    [
        ({}, "y*(y - 1 - x**2) = 0", "y", 2),
        ({"y": 2}, "y*(y - 1 - x**2) = 0", "y", 3),
        ({"y": 1}, "y**2 = 1", "(y - 1)*x", 2),
        ({"y": -1}, "y**2 = 1", "(y - 1)*x", 3),
        ({}, "sin(y) = 0", "y*x", 2),
        ({"y": "pi"}, "sin(y) = 0", "(y - pi)*x", 2),
        ({"y": "2*pi"}, "sin(y) = 0", "y*x", 3),
        ({}, "tan(y) = 0", "y*x", 2),
        ({}, "atan(y)*(3 - y) = 0", "y*x", 2),
        ({"y": 3}, "atan(y)*(3 - y) = 0", "y*x", 3),
        ({"x": 0.6, "y": 0.8}, "(x**2 + y**2 - 1)*(x**2 + y**2 - 4) = 0", "x**2 + y**2 - 1", 2),
        ({"x": 1.2, "y": 1.6}, "(x**2 + y**2 - 1)*(x**2 + y**2 - 4) = 0", "(x**2 + y**2 - 1)*x", 3),
    ],
)
def test_the_sheet_of_the_start_counts(values, surface, coefficient, truth):
    found = count(START | values, [surface], [LIFT.format(coefficient)])
    assert found.configuration_dof == truth
    if truth == 2 and "x**2 + y**2" not in surface:
        assert found.proof == "numeric"
        assert "motions from the start" in found.as_json()["notes"][0]


@pytest.mark.parametrize(("constant", "x"), [("atan2(sin(x), cos(x)) - x", -3), ("atan(tan(x)) - x", -1)])
def test_ranks_are_those_of_the_branch_of_the_start(constant, x):
    rows = ["d(z) - d(w) = 0", f"d(z) - exp({constant})*d(w) = 0"]
    assert count({"x": x, "y": 0.3, "z": 0.2, "w": 0.1}, (), rows).configuration_dof == 3


def test_the_mode_of_a_four_bar_counts_and_its_integral_is_reported():
    values = {"a": 1, "b": 1, "c": 0, "u": 0.3, "s": 0.2}
    bars = ["cos(a) + 3*cos(c) = 3 + cos(b)", "sin(a) + 3*sin(c) = sin(b)"]
    found = count(values, bars, ["d(s) - sin(c)*d(u) = 0"])
    assert found.configuration_dof == 2
    assert "which keep to sin(" in found.notes[0]
    # Where the modes touch the answer is open.
    assert count(values | {"a": 0, "b": 0}, bars, ["d(s) - sin(c)*d(u) = 0"]).configuration_dof is None


@pytest.mark.parametrize(
    ("values", "rows", "truth"),
    [
        ({}, ["d(y) = 0", LIFT.format("y*x")], 2),
        ({"y": 0.5}, ["d(y) = 0", LIFT.format("y*x")], 3),
        ({}, ["d(y) - y*d(x) = 0", LIFT.format("y*x")], 2),
        ({}, ["y*d(x) = 0", "d(y) = 0"], 3),
        ({}, ["d(y) - y*d(x) + y*(d(w) - y*x*d(z)) = 0", LIFT.format("y*x")], 2),
        (
            {"x": 0.6, "y": 0.8},
            ["2*x*d(x) + 2*y*d(y) = (x**2 + y**2 - 1)*d(z)", LIFT.format("x*(x**2 + y**2 - 1)")],
            2,
        ),
        ({"y": 1}, ["d(y) = x*dt + t*d(x) + (y - 1 - x*t)*dt", LIFT.format("(y - 1 - x*t)*x")], 2),
        ({"x": 0}, ["d(y) - y*d(x) = 0", "d(x) - (x + y)*d(z) = 0", LIFT.format("x*y")], 1),
        ({"y": "pi"}, ["d(sin(y)) = 0", LIFT.format("sin(y)*x")], 2),
    ],
)
def test_a_set_that_the_rows_keep_to_is_judged_by_itself(values, rows, truth):
    found = count(START | values, [], rows)
    assert found.configuration_dof == truth
    assert found.velocity_dof is not None


@pytest.mark.parametrize("power", [1, 2, 3])
def test_a_point_that_the_rows_lead_away_from_takes_nothing(power):
    found = count(START, [], [LIFT.format(f"y**{power}")])
    assert (found.configuration_dof, found.proof) == (4, "symbolic")
    assert power == 1 or "lead away" in found.notes[0]


def test_a_row_that_holds_on_the_sheet_has_its_integral_there():
    report = lagcli.check(lagcli.loads(text(START, ["y*(y - 1 - x**2) = 0"], [LIFT.format("y")])))
    assert report.constraints[1].verdict.kind == "jointly-integrable"
    assert report.constraints[1].verdict.integral == "w"
    assert report["dof"]["notes"]


def test_an_integral_of_a_sheet_is_not_enforced_by_a_run():
    run = lagcli.simulate(lagcli.loads(text(START, ["y*(y - 1 - x**2) = 0"], [LIFT.format("y")])))
    assert np.abs(run["w"] - 0.1).max() < 1e-12
    assert np.abs(run["lambda.d0"]).max() < 1e-12


@pytest.mark.parametrize(
    ("x", "coefficient", "truth"),
    [
        (1, "abs(x) - x", 3),
        (-1, "abs(x) - x", 4),
        (2, "max(x, 0) - x", 3),
    ],
)
def test_the_side_of_a_kink_is_reported(x, coefficient, truth):
    found = count(START | {"x": x, "u": 0.4}, [], [LIFT.format(coefficient)])
    assert found.configuration_dof == truth + 1
    if truth == 3:
        assert found.proof == "symbolic"
        assert "x > 0" in found.notes[0]


HOLD = {"x": 0.3, "y": 0, "z": 0, "u": 0.5}


@pytest.mark.parametrize(
    ("values", "holonomic", "rows", "truth", "named"),
    [
        ({}, ["x = 0.3"], ["d(x) = y*dt"], 2, ["y"]),
        ({}, ["x = 0.3"], ["d(x) = y*dt", "d(y) = z*dt"], 1, ["y", "z"]),
        ({"y": 0.5, "z": 0.5}, [], ["d(x) = y*dt", "d(x) = z*dt"], 3, ["y - z"]),
        ({"y": 0.6, "z": 0.8}, ["x = 0.3"], ["d(x) = (y**2 + z**2 - 1)*dt"], 2, ["y**2 + z**2 - 1"]),
        ({}, ["x = 0.3"], ["d(x) = (y - t)*dt"], 2, ["t - y"]),
        ({"z": 1}, ["x = 0.3"], ["d(x) = y*(z - 2)*dt"], 2, ["y"]),
        ({"y": 0.5, "z": 0.5}, ["x = 0.3"], ["d(x) = (y - z)*dt", "d(u) - (y - z)*d(y) = 0"], 1, ["y - z"]),
        ({"y": "pi"}, ["x = 0.3"], ["d(x) = sin(y)*dt"], 2, ["sin(y)"]),
    ],
)
def test_a_multiple_of_dt_demands_a_hidden_condition(values, holonomic, rows, truth, named):
    model = lagcli.loads(text(HOLD | values, holonomic, rows))
    found = lagcli.dof(model)
    assert found.configuration_dof == truth
    told = [note for note in found.notes if note.startswith("hidden condition")]
    assert [note.split(": ")[0] for note in told] == [f"hidden condition {g} = 0" for g in named]
    assert lagcli.check(model).initial.position_residual < 1e-12


BOAT = """
lagcli: 1
parameters: {v: 2, w: 1}
coordinates:
  x: {value: 0, rate: w}
  y: {value: 0, rate: v*sin(pi/3)}
  th: {value: pi/3}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(th)**2)/2
differential:
  side: sin(th)*d(x) - cos(th)*d(y) = 0
  speed: cos(th)*d(x) + sin(th)*d(y) = v*dt
  east: d(x) = w*dt
simulation: {duration: 1, samples: 3}
"""


def test_a_boat_that_satisfies_its_hidden_condition_is_counted_and_runs():
    model = lagcli.loads(BOAT)
    assert lagcli.dof(model).configuration_dof == 0
    run = lagcli.simulate(model)
    np.testing.assert_allclose(run["y"], np.sqrt(3) * run.t, atol=1e-12)
    np.testing.assert_allclose(run["th"], np.pi / 3, rtol=1e-14)
    for name in ("lambda.side", "lambda.speed", "lambda.east", "R.x", "R.y", "R.th"):
        np.testing.assert_allclose(run[name], 0.0, atol=1e-12)


def test_a_start_off_a_hidden_condition_is_inconsistent_by_its_residual():
    model = lagcli.loads(text(HOLD | {"y": 0.1}, ["x = 0.3"], ["d(x) = y*dt"]))
    assert lagcli.dof(model).configuration_dof == 2
    report = lagcli.check(model)
    assert not report.initial.consistent
    assert any("violate `y = 0` by 0.1" in warning.message for warning in report.warnings)
    with pytest.raises(lagcli.ModelError, match=r"violate `y = 0` by 0\.1"):
        lagcli.simulate(model)
    assert lagcli.simulate(model, assemble=True)["y"].tolist() == [0, 0, 0]


@pytest.mark.parametrize("factor", ["1 + y**2", "2 + sin(y)", "exp(y)", "t - 1", "3 + cos(y)*sin(z)"])
def test_what_never_vanishes_for_some_time_can_never_hold(factor):
    with pytest.raises(lagcli.ModelError, match="can never hold"):
        count(HOLD, ["x = 0.3"], [f"d(x) = ({factor})*dt"])


SHAPES = (("y", {"y": 0}), ("(x**2 + y**2 - 1)", {"x": 0.6, "y": 0.8}), ("(x - y**2)", {"x": 0.25, "y": 0.5}))
OTHERS = ("(y - 5)", "(x + y - 7)", "(x**2 + y**2 - 16)", "atan(x - 6)")


@pytest.mark.parametrize("seed", range(8))
def test_random_sheets_and_special_points_have_the_count_they_were_made_with(seed):
    r = random.Random(seed)
    own, values = r.choice(SHAPES)
    is_kept, on_sheet = r.random() < 0.6, seed % 2 == 0
    coefficient = f"{own}*({r.randint(1, 3)} + x*u)" if is_kept else f"u + {own}"
    lift = LIFT.format(coefficient)
    start = START | {"u": 0.7} | values
    if on_sheet:
        found = count(start, [f"{own}*{r.choice(OTHERS)} = 0"], [lift])
    else:
        found = count(start, [], [f"d({own}) - {own}*u*d(u) = 0", lift])
    assert found.configuration_dof == 4 - is_kept


@pytest.mark.parametrize(
    ("values", "rows", "truth", "named"),
    [
        ({}, ["(x - 0.3)*dt = 0"], 3, "10*x - 3"),
        ({"y": 0.6, "z": 0.8}, ["(y**2 + z**2 - 1)*dt = 0"], 3, "y**2 + z**2 - 1"),
        ({"y": 0.6, "z": 0.8}, ["(y**2 + z**2 - 1)*dt = 0", "d(z) - u*d(x) = 0"], 3, "y**2 + z**2 - 1"),
        ({}, ["(x - 0.3)*dt = 0", "d(x) = y*dt"], 2, "10*x - 3"),
    ],
)
def test_a_row_without_velocities_demands_its_factor(values, rows, truth, named):
    model = lagcli.loads(text(HOLD | values, [], rows))
    found = lagcli.dof(model)
    assert found.configuration_dof == truth
    assert found.notes[0].startswith(f"hidden condition {named} = 0")
    assert lagcli.simulate(model).stats.velocity_drift < 1e-12
    with pytest.raises(lagcli.ModelError, match="initial positions violate"):
        lagcli.simulate(lagcli.loads(text(HOLD | values | {"x": 0.4, "y": 0.5}, [], rows)))


@pytest.mark.parametrize("row", ["(1 + x**2)*dt = 0", "0*dt = 0", "t*dt = 0"])
def test_a_row_without_velocities_that_never_holds_is_refused(row):
    with pytest.raises(lagcli.ModelError, match=r"can never hold|gradient vanishes everywhere"):
        count(HOLD, [], [row])


@pytest.mark.parametrize(
    ("holonomic", "rows", "named"),
    [
        (["x = 0.3"], ["d(x) = y*dt"], "`y = 0`, which `d0`"),
        ([], ["y*dt = 0"], "`y = 0`, which `d0`"),
        (["x = 0.3"], ["d(x) = (y + z)*dt", "d(x) = z*dt"], "`y = 0`, which `d0`, `d1`"),
    ],
)
@pytest.mark.parametrize("force", ["1", "t", "max(t - 0.5, 0)"])
def test_forces_that_lead_off_a_hidden_condition_are_reported_with_it(holonomic, rows, named, force):
    extra = f"forces:\n  push: {{to: y, force: '{force}'}}"
    with pytest.raises(lagcli.SimulationStopped, match="lead off the hidden condition") as stopped:
        lagcli.simulate(lagcli.loads(text(HOLD, holonomic, rows, extra)))
    assert named in str(stopped.value)
    assert stopped.value.trajectory.stats.stopped.code == "no-solution-beyond"


def test_of_a_chain_of_hidden_conditions_the_one_without_a_force_is_reported():
    chain = text(
        {"x": 0, "y": 1, "z": "0, rate: -1", "u": -1},
        ["x = sin(t)"],
        [f"d({a}) = {b}*dt" for a, b in ("xy", "yz", "zu")],
    )
    with pytest.raises(
        lagcli.SimulationStopped, match=r"condition `u \+ cos\(t\) = 0`, which `d2` demands and no"
    ):
        lagcli.simulate(lagcli.loads(chain), assemble=True)


CIRCLING = {"x": "0.3", "y": "0.6, rate: -0.8", "z": "0.8, rate: 0.6", "u": "0"}


@pytest.mark.parametrize(
    ("holonomic", "rows"),
    [(["x = 0.3"], ["d(x) = (y**2 + z**2 - 1)*dt"]), ([], ["(y**2 + z**2 - 1)*dt = 0"])],
)
def test_a_motion_that_forces_keep_on_a_hidden_condition_runs(holonomic, rows):
    extra = "forces:\n  spring: {potential: (y**2 + z**2)/2}"
    run = lagcli.simulate(lagcli.loads(text(CIRCLING, holonomic, rows, extra)), duration=10, samples=11)
    np.testing.assert_allclose(run["y"], np.cos(run.t + np.arctan2(4, 3)), atol=1e-9)
    assert run.stats.velocity_drift < 1e-9


def test_a_hidden_condition_that_holds_to_rounding_alone_does_not_stop_a_run():
    model = lagcli.loads(text({"x": 0.3, "th": "pi"}, ["x = 0.3"], ["d(x) = sin(th)*dt"]))
    assert lagcli.simulate(model)["th"].tolist() == [np.pi] * 3


@pytest.mark.parametrize(
    ("values", "rows"),
    [
        ({}, ["d(y) = 0", "y*d(x) = 0"]),
        ({}, ["d(y) = y*d(z)", "d(w) - y*d(x) = 0", "d(w) + y*d(x) = 0"]),
        (
            {"x": "0.6, rate: -0.8", "y": "0.8, rate: 0.6"},
            ["2*x*d(x) + 2*y*d(y) = (x**2 + y**2 - 1)*d(z)", "(x**2 + y**2 - 1)*d(w) = 0"],
        ),
    ],
)
def test_a_motion_runs_on_a_set_that_the_rows_keep_to(values, rows):
    model = lagcli.loads(text(START | {"z": "0.2, rate: 1"} | values, [], rows))
    run = lagcli.simulate(model)
    np.testing.assert_allclose(run["z"], 0.2 + run.t, atol=1e-10)
    if values:
        np.testing.assert_allclose(np.hypot(run["x"], run["y"]), 1.0, atol=1e-10)
        np.testing.assert_allclose(np.hypot(run["R.x"], run["R.y"]), 1.0, atol=1e-9)


def test_a_point_that_the_rows_lead_away_from_is_a_singular_start():
    rows = ["d(w) - y*d(x) = 0", "d(w) + y*d(x) = 0"]
    with pytest.raises(lagcli.ModelError, match="singular configuration"):
        lagcli.simulate(lagcli.loads(text(START | {"z": "0.2, rate: 1"}, [], rows)))


@pytest.mark.parametrize("surface", ["y**2*(y - 1) = 0", "y**2 = 0"])
@pytest.mark.parametrize("coefficient", ["y", "x*y"])
def test_rows_beside_a_gradient_that_vanishes_are_open_and_nothing_else_is_said(surface, coefficient):
    """The gradient leaves the direction of y, which the surface y = 0 does not have: there 2 freedoms are left."""
    report = lagcli.check(lagcli.loads(text(START, [surface], [LIFT.format(coefficient)])))
    assert (report.dof.configuration_dof, report.dof.bounds) == (None, (2, 3))
    assert not any("lead away" in note or "the count is" in note for note in report.dof.notes)
    assert [one.verdict.kind for one in report.constraints] == ["holonomic", "undecided"]
    assert "whose gradients leave more directions" in report.dof.reason
    assert report.joint.remarks == ()
