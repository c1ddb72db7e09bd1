"""Branch cuts of angles in rows: passed where the row goes on smoothly, named where it jumps, ends or has an edge."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import lagcli
from lagcli.api import prepare_run
from lagcli.api.find_modes import NoEquilibriumError
from lagcli.compiled import row_block
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.running.trajectory import Trajectory
from lagcli.simulation.run_state import checkpoint

HELIX = """\
lagcli: 1
parameters: {{m: 0.1, r: 0.5, h: 0.2, g: 9.81}}
particles:
  bead: {{mass: m, position: [r, 0, 0]}}
forces:
  gravity: {{to: bead, force: [0, 0, -m*g]}}
holonomic:
{rows}
simulation: {{duration: 3, samples: 31}}
"""
CYLINDER = "  cylinder: bead.x**2 + bead.y**2 = r**2\n  helix: "
SMOOTH = "  fx: bead.x = r*cos(bead.z/h)\n  fy: bead.y = r*sin(bead.z/h)"
R = ("R.bead.x", "R.bead.y", "R.bead.z")
STATE = ("bead.x", "bead.y", "bead.z", "bead.vx", "bead.vy", "bead.vz")


def helix(equation, **changes):
    return lagcli.simulate(lagcli.loads(HELIX.format(rows=CYLINDER + equation)), **changes)


@pytest.fixture(scope="module")
def smooth():
    return lagcli.simulate(lagcli.loads(HELIX.format(rows=SMOOTH)))


@pytest.mark.parametrize(
    ("equation", "lam"),
    [
        ("bead.z = h*atan2(bead.y, bead.x)", 1),
        ("5*bead.z + 1 = 1 + 5*h*atan2(bead.y, bead.x)", 1 / 5),
        ("atan2(bead.y, bead.x) = bead.z/h", -0.2),
        ("bead.z = h*atan(bead.y/bead.x)", 1),
        ("bead.z = h*atan2(bead.y, bead.x)/2 + h*atan(bead.y/bead.x)/2", 1),
        ("bead.z = h*(sqrt(2)*atan2(bead.y, bead.x) - (sqrt(2) - 1)*atan2(2*bead.y, 2*bead.x))", 1),
        ("bead.z = h*atan(tan(atan2(bead.y, bead.x)))", 1),
        ("bead.z = h*atan2(bead.x, -bead.y) - h*pi/2", 1),
    ],
)
def test_a_bead_on_a_helix_goes_through_the_cut_for_several_turns(smooth, equation, lam):
    run = helix(equation)
    assert run["bead.z"][-1] < -4 * 2 * np.pi * 0.2  # four turns and more
    for name in (*STATE, *R):
        np.testing.assert_allclose(run[name], smooth[name], rtol=0, atol=3e-8, err_msg=name)
    # lambda of z = h*theta is the force along z: the cylinder is upright.
    np.testing.assert_allclose(run["lambda.helix"], lam * smooth["R.bead.z"], rtol=0, atol=1e-8)
    assert run.stats.position_drift < 1e-13
    assert run.stats.energy_imbalance < 1e-11
    assert any("`helix` goes on smoothly" in note for note in run.notes)


SWINGING = """\
lagcli: 1
parameters: {r: 0.5, h: 0.2}
particles:
  bead: {mass: 1, position: [-r*cos(0.5), -r*sin(0.5), h*(0.5 - pi)]}
forces:
  spring: {potential: "20*(bead.z + h*pi)**2"}
holonomic:
  cylinder: bead.x**2 + bead.y**2 = r**2
  helix: bead.z = h*atan2(bead.y, bead.x)
simulation: {duration: 6, samples: 31}
"""


@pytest.mark.parametrize("at", [0.3, 1.0, 2.0, 3.0])
def test_an_angle_that_crosses_its_cut_again_is_reported_once_in_a_resumed_run_too(at, tmp_path):
    model = lagcli.loads(SWINGING)
    whole = lagcli.simulate(model)
    turns = np.unwrap(np.arctan2(whole["bead.y"], whole["bead.x"]))
    beyond = turns + np.pi < 2 * np.pi * np.round((turns[0] + np.pi) / (2 * np.pi))
    assert np.count_nonzero(np.diff(beyond)) >= 3  # there and back, and there again
    assert len(whole.notes) == 1
    lagcli.simulate(model, duration=at, checkpoint=tmp_path / "run.json")
    assert lagcli.simulate(model, resume=tmp_path / "run.json").notes == whole.notes


def test_what_is_periodic_in_an_angle_has_no_cut():
    run = helix("bead.z = h*sin(2*atan2(bead.y, bead.x)) + h*(bead.x - r)", duration=1)
    assert not run.notes
    model = lagcli.loads(HELIX.format(rows=CYLINDER + "bead.z = h*sin(2*atan2(bead.y, bead.x))"))
    assert "branch-cut" not in {d.code for d in lagcli.check(model).warnings}


GEARS = """\
lagcli: 1
particles:
  p[i]: {for: "i = 1..4", mass: i, position: "[3*i + cos(i), sin(i), 0]"}
holonomic:
  crank[i]: {for: "i = 1..4", equation: "(p[i].x - 3*i)**2 + p[i].y**2 = 1"}
  plane[i]: {for: "i = 1..4", equation: "p[i].z = 0"}
  gear: 1.37*(atan2(p[1].y, p[1].x - 3) - 1) = atan2(p[2].y, p[2].x - 6) - 2
  drive[i]: {for: "i = 3..4", equation: "atan2(p[i].y, p[i].x - 3*i) = atan2(sin(i + t**2), cos(i + t**2))"}
forces:
  push: {to: "p[1]", force: "2*[-p[1].y, p[1].x - 3, 0]"}
outputs:
  angle: atan2(p[1].y, p[1].x - 3)
simulation: {duration: 5, samples: 51}
"""


def test_several_angles_with_incommensurable_factors_and_families_of_them():
    run = lagcli.simulate(lagcli.loads(GEARS))
    t = run["t"]
    # Gear: theta_2 = 2 + 1.37 (theta_1 - 1), inertias 1 and 2, torque 2 on the first.
    turn = 2 / (1 + 2 * 1.37**2) * t**2 / 2
    np.testing.assert_allclose(run["p[2].x"], 6 + np.cos(2 + 1.37 * turn), rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["p[1].y"], np.sin(1 + turn), rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["lambda.gear"], -2 * 1.37 * 2 / (1 + 2 * 1.37**2), rtol=1e-8)
    assert turn[-1] > np.pi
    angle = (1 + turn + np.pi) % (2 * np.pi) - np.pi  # an output shows what it says
    np.testing.assert_allclose(run["angle"], angle, rtol=0, atol=1e-8)
    for i in (3, 4):
        np.testing.assert_allclose(run[f"p[{i}].x"], 3 * i + np.cos(i + t**2), rtol=0, atol=1e-8)
        np.testing.assert_allclose(run[f"lambda.drive[{i}]"], 2 * i, rtol=1e-7)  # the torque m r^2 theta''


ALONE = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0.5, 0], velocity: [-0.5, 1, 0]}
  b: {mass: 2, position: [2, 1, 0], velocity: [-1, 2, 0]}
holonomic:
  gear: atan2(a.y, a.x) = atan2(b.y, b.x)
simulation: {duration: 2, samples: 11}
"""


def test_a_row_that_stands_alone_may_hold_two_angles():
    """CasADi takes the entries of a single row as a row, and those behind the last of a single entry too."""
    model = lagcli.loads(ALONE)
    assert [d.code for d in lagcli.check(model).warnings] == ["branch-cut"]
    run = lagcli.simulate(model)
    angles = [np.arctan2(run[f"{name}.y"], run[f"{name}.x"]) for name in "ab"]
    np.testing.assert_allclose(angles[0], angles[1], rtol=0, atol=1e-12)
    rows, moved = row_block.coordinates(system.build(model))
    assert rows.tolist() == [0] * 4
    assert sorted(moved.tolist()) == [0, 1, 3, 4]


ANGLES = """\
lagcli: 1
coordinates: {q: {value: 0.3, rate: 2}, s: {value: 0.6, rate: 4}}
lagrangian: rate(q)**2/2 + rate(s)**2/2
forces: {push: {to: q, force: 1}}
holonomic:
  same: s = atan2(sin(2*q), cos(2*q))
simulation: {duration: 3, samples: 31}
"""


def test_generalized_coordinates_and_the_rows_they_stand_in():
    run = lagcli.simulate(lagcli.loads(ANGLES))
    q = 0.3 + 2 * run["t"] + 0.2 * run["t"] ** 2 / 2
    np.testing.assert_allclose(run["s"], 2 * q, rtol=1e-9)
    np.testing.assert_allclose(run["lambda.same"], 2 * 0.2, rtol=1e-9)


def test_a_run_goes_on_from_a_checkpoint_bit_for_bit_in_a_later_turn(tmp_path):
    model = lagcli.loads(HELIX.format(rows=CYLINDER + "bead.z = h*atan2(bead.y, bead.x)"))
    path = tmp_path / "c.json"
    lagcli.simulate(model, duration=2, samples=21, checkpoint=path)
    assert abs(checkpoint.read(path).run_state.turns[0]) > 3 * np.pi
    rest = lagcli.simulate(model, resume=path)
    whole = lagcli.simulate(model)
    assert np.array_equal(rest.rows, whole.rows[-len(rest.rows) :])
    assert len(rest.rows) == 10


def test_a_checkpoint_with_another_number_of_angles_is_damaged(tmp_path):
    model = lagcli.loads(HELIX.format(rows=CYLINDER + "bead.z = h*atan2(bead.y, bead.x)"))
    path = tmp_path / "c.json"
    lagcli.simulate(model, duration=0.5, samples=2, checkpoint=path)
    point = checkpoint.read(path)
    broken = dataclasses.replace(point, run_state=dataclasses.replace(point.run_state, turns=()))
    path.write_bytes(checkpoint.encoded(broken))
    with pytest.raises(ValueError, match="number of angles"):
        lagcli.simulate(model, resume=path)


def test_a_start_on_another_turn_is_refused_by_the_text_of_the_row():
    text = HELIX.format(rows=CYLINDER + "bead.z = h*atan2(bead.y, bead.x)")
    with pytest.raises(diagnostics.ModelError, match="violate `helix`"):
        lagcli.simulate(lagcli.loads(text.replace("[r, 0, 0]", "[r, 0, 2*pi*h]")))


@pytest.mark.parametrize("side", ["", "-"])
def test_a_start_on_the_cut_may_lie_on_either_side(side):
    text = HELIX.format(rows=CYLINDER + "bead.z = h*atan2(bead.y, bead.x)")
    run = lagcli.simulate(lagcli.loads(text.replace("[r, 0, 0]", f"[-r, 0, {side}pi*h]")), duration=2)
    fall = 0.5 * 9.81 * 0.2**2 / (0.2**2 + 0.5**2)
    np.testing.assert_allclose(
        run["bead.z"], float(f"{side}1") * np.pi * 0.2 - fall * run["t"] ** 2, atol=1e-9
    )


@pytest.mark.parametrize(
    ("equation", "reason"),
    [
        (
            "bead.z + h = h*exp(atan2(bead.y, bead.x))",
            "the row `helix` jumps there (`atan2` crosses its cut)",
        ),
        (
            "bead.z*(9 + atan2(bead.y, bead.x)) = h*9*atan2(bead.y, bead.x)",
            "row `helix` jumps there (`atan2` crosses its cut)",
        ),
        (
            "bead.z = 2*h*atan2(bead.y, r + bead.x)",
            "the row `helix` jumps there (both arguments of `atan2` go through zero)",
        ),
        (
            "bead.z = h*asin(sin(atan2(bead.y, bead.x)))",
            "the gradient of the row `helix` jumps there (`asin` comes to an end of its range)",
        ),
        ("bead.z = h*asin(bead.y/r)", "`helix` is not defined beyond (`asin` comes to an end of its range)"),
        (
            "bead.z = h*(cos(atan2(bead.y, bead.x)/2) - 1) - h*bead.y/5",
            "the gradient of the row `helix` jumps there (`atan2` crosses its cut)",
        ),
        (
            "bead.z = h*abs(bead.x) - h*r + h*bead.y",
            "the gradient of the row `helix` jumps there (the argument of `abs` changes its sign)",
        ),
        ("bead.z = h*sign(bead.x) - h + h*bead.y", "the row `helix` jumps there (`sign` switches)"),
    ],
)
def test_a_row_that_jumps_or_ends_is_named_with_its_function(equation, reason):
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        helix(equation)
    assert reason in str(stopped.value)
    assert len(stopped.value.trajectory.rows) > 3


def test_a_differential_row_that_jumps_is_named():
    text = """\
lagcli: 1
coordinates: {x: {value: -1}, y: {value: 0.5, rate: -1}, z: {rate: 1}, w: {rate: "atan2(0.5, -1)"}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2 + rate(w)**2)/2
differential: {drift: "d(w) - atan2(y, x)*d(z) = 0"}
simulation: {duration: 2}
"""
    with pytest.raises(
        lagcli.SimulationStopped, match=r"the row `drift` jumps there \(`atan2` crosses its cut\)"
    ):
        lagcli.simulate(lagcli.loads(text))


def codes(text):
    return [(d.code, d.location.line) for d in lagcli.check(lagcli.loads(text)).warnings]


def test_check_warns_of_cuts_in_rows_and_forces():
    assert codes(HELIX.format(rows=CYLINDER + "bead.z = h*atan2(bead.y, bead.x)")) == [("branch-cut", 9)]
    spring = """\
lagcli: 1
particles: {b: {mass: 1, position: [1, 0, 0]}}
forces:
  spring: {potential: "atan2(b.y, b.x)**2"}
"""
    assert codes(spring) == [("branch-cut", 4)]
    assert codes(spring.replace("**2", "")) == [("energy-jump", 4)]  # its force is smooth, but at the cut


def test_other_values_of_parameters_are_judged_anew():
    text = HELIX.format(rows=CYLINDER + "bead.z = h*sin(n*atan2(bead.y, bead.x))").replace(
        "g: 9.81", "g: 9.81, n: 2"
    )
    assert codes(text) == []
    lagcli.simulate(lagcli.loads(text), duration=1)
    half = lagcli.loads(text, parameters={"n": 0.5})
    assert [d.code for d in lagcli.check(half).warnings] == ["branch-cut"]


LAW = """\
lagcli: 1
coordinates: {{x: {{value: {x}}}, y: {{value: 1, rate: 0.3}}}}
lagrangian: (rate(x)**2 + rate(y)**2)/2
forces: {{push: {{to: x, force: "{force}"}}, spring: {{to: y, force: -100*y}}}}
simulation: {{duration: 0.1, samples: 2}}
"""


@pytest.mark.parametrize(
    ("force", "x", "warned"),
    [
        ("sqrt(abs(x))", 0, True),
        ("abs(x)**(1/3)", 0, True),
        ("x**(2/3)", 0, True),
        ("abs(x)**0.9", 0, True),
        ("-sqrt(abs(rate(x)))", 0, True),
        ("-sign(rate(x))", 0, True),
        ("sqrt(abs(x))", 1, False),
        ("sqrt(1 + x)", 0, False),
        ("-abs(rate(x))*rate(x)", 0, False),
        ("-abs(x)", 0, False),
        ("-rate(x)/sqrt(rate(x)**2 + 1e-8)", 0, False),
        ("sqrt(x**2 + rate(x)**2)*x", 0, False),
        ("max(x, 0)**1.5", 0, False),
        ("tanh(x/1e-9)", 0, False),
        ("sqrt(abs(t))", 0, False),
    ],
)
def test_a_start_at_which_a_force_is_not_lipschitz_is_warned_of(force, x, warned):
    model = lagcli.loads(LAW.format(force=force, x=x))
    for warnings in (lagcli.check(model).warnings, prepare_run.prepare(model, model.simulation).warnings):
        assert ["not-lipschitz"] * warned == [d.code for d in warnings]


def test_a_row_whose_gradient_is_not_lipschitz_is_warned_of():
    text = """\
lagcli: 1
particles: {b: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}
holonomic: {slide: "b.z = abs(b.x)**1.5", plane: "b.y = 0"}
"""
    found = [d for d in lagcli.check(lagcli.loads(text)).warnings if d.code == "not-lipschitz"]
    assert len(found) == 1
    assert "`slide`" in found[0].message


@pytest.mark.parametrize("text", [HELIX.format(rows=CYLINDER + "bead.z = h*atan2(bead.y, bead.x)"), GEARS])
def test_an_audit_judges_rows_beyond_the_cut(text):
    model = lagcli.loads(text)
    run = lagcli.simulate(model, samples=1001)
    found = {check.name: check for check in lagcli.audit(model, run).checks}
    assert found["positions"].verdict == "pass"
    wrong = Trajectory(run.columns, run.rows.copy(), run.stats)
    wrong.rows[-500:, 2] += 1e-3  # y of the first particle, in a later turn
    found = {check.name: check for check in lagcli.audit(model, wrong).checks}
    assert found["positions"].verdict == "fail"


def test_other_formulations_go_through_the_cut_too():
    found = lagcli.compare(lagcli.loads(HELIX.format(rows=CYLINDER + "bead.z = h*atan2(bead.y, bead.x)")))
    assert [one.stopped for one in found.formulations] == [""] * 2
    assert found.agree


def test_a_duration_without_end_is_no_scale_of_a_jump():
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [1, 0, 0]}}
forces: {weight: {to: a, force: [0, 0, -9.81*m]}}
holonomic: {rod: norm(a) = 1, plane: a.y = 0}
"""
    with pytest.raises(lagcli.SimulationStopped, match="the run is too long") as stopped:
        lagcli.simulate(lagcli.loads(text), duration=1e20)
    assert "sqrt" not in stopped.value.reason


def test_points_of_rest_beyond_a_cut_are_reported_to_be_out_of_sight():
    """A bead on a helix of pitch 2 pi / 2 that a spring pulls to a place one turn further."""
    text = """lagcli: 1
particles:
  bead: {mass: 1, position: [cos(2), sin(2), 1]}
forces: {spring: {potential: "5*(bead.z - 2.2)**2"}}
holonomic:
  pipe: bead.x**2 + bead.y**2 = 1
  helix: bead.z = atan2(bead.y, bead.x)/2
"""
    model = lagcli.loads(text)
    found = lagcli.equilibrium(model, starts=4)
    note = "points beyond the cut of `atan2` or `atan` in `helix` are not looked for"
    assert any(each.startswith(note) for each in found.notes)
    with pytest.raises(NoEquilibriumError, match="beyond the cut of `atan2` or `atan` in `helix`"):
        lagcli.modes(model)
    smooth = lagcli.loads(
        text.replace("bead.z = atan2(bead.y, bead.x)/2", "bead.y*cos(2*bead.z) = bead.x*sin(2*bead.z)")
    )
    found = lagcli.equilibrium(smooth, starts=4)
    assert not any("beyond the cut" in each for each in found.notes)
    assert min(abs(point.at["bead.z"] - 2.2) for point in found.points) < 1e-9
