"""One model in several formulations: they agree, and what does not agree is found."""

import json
import pathlib

import numpy as np
import pytest

import lagcli
from lagcli.equations import system
from lagcli.formulations import comparison
from tests.helpers.in_process import command  # noqa: F401 - a fixture

MODELS = pathlib.Path(__file__).parents[2] / "models"
PAIRS = (
    ("pendulum", "pendulum-angle"),
    ("double-pendulum", "double-pendulum-angles"),
    ("bead-on-rotating-hoop-cartesian", "bead-on-rotating-hoop"),
    ("rolling-disk", "rolling-disk-particles"),
    ("ramp-stick", "ramp-stick-coordinates"),
)
ALONE = {  # neither rows nor dependent particles
    "bicycle",
    "buckling-column",
    "co2-vibrations",
    "solar-system",
    "spring-lattice",
    "spring-triangle",
    "water-vibrations",
}
SHORT = {"chain": 0.02, "cloth": 0.1, "spring-stiff-limit": 0.2}

# A disk of four particles in four coordinates: dependent particles, and differential rows.
MIXED_DISK = """
lagcli: 1
parameters: {M: 2, a: 0.5, s: a/sqrt(2), spin: 4, turn: 1.25, beta: 0.3, g: 9.81}
coordinates:
  x: {value: 0, rate: 0}
  y: {value: 0, rate: -a*spin}
  theta: {value: 0, rate: turn}
  phi: {value: 0, rate: spin}
particles:
  p[i]:
    for: i = 0..3
    mass: M/4
    position:
      - x + s*sin(phi + i*pi/2)*sin(theta)
      - y - s*sin(phi + i*pi/2)*cos(theta)
      - a + s*cos(phi + i*pi/2)
forces:
  weight: {to: all, force: [m*g*sin(beta), 0, -m*g*cos(beta)]}
  drag: {to: "p[1]", force: -0.2*v}
differential:
  roll_x: d(x) - a*sin(theta)*d(phi) = 0
  roll_y: d(y) + a*cos(theta)*d(phi) = 0
simulation: {duration: 2}
"""

PENDULUM = """
lagcli: 1
parameters: {m: 1, L: 1, g: 9.81}
coordinates:
  theta: {value: 1, rate: 0}
particles:
  a: {mass: m, position: [L*sin(theta), 0, -L*cos(theta)]}
forces:
  weight: {to: all, force: [0, 0, -m*g]}
"""


def load(name, **parameters):
    return lagcli.load(MODELS / f"{name}.yaml", parameters)


@pytest.mark.parametrize("pair", PAIRS, ids=[a for a, _ in PAIRS])
def test_the_pairs_of_the_gallery_agree(pair):
    found = lagcli.compare(*map(load, pair))
    assert found.agree
    assert not found.stopped
    (kinds,) = found.agreements
    assert {"r", "energy"} <= kinds.keys()
    assert {"R", "lambda"} & kinds.keys(), "forces are compared too"
    assert all(one.error <= 1e-8 for one in kinds.values())


@pytest.mark.parametrize("name", sorted(path.stem for path in MODELS.glob("*.yaml")))
def test_every_formulation_of_a_model_of_the_gallery_agrees(name):
    model = load(name)
    duration = min(model.simulation.duration, SHORT.get(name, 1.0))
    found = lagcli.compare(model, duration=duration, samples=5 if name in SHORT else 21)
    names = [one.name for one in found.formulations]
    changes = model.inequality or any(event.action == "stop" for event in model.events)
    if name in ALONE or (changes and not any(particle.is_dependent for particle in model.particles)):
        assert len(names) == 1
        assert found.agree is None
        assert "only one formulation" in found.notes[0] or "is left out" in found.notes[0]
        return
    assert found.agree, found.agreements
    assert not found.stopped
    rows = found.formulations[0].rows
    assert ("reduced" in names) == (rows > 0)
    assert ("freed" in names) == any(particle.is_dependent for particle in model.particles)
    assert all({"r", "v", "R", "energy"} <= each.keys() for each in found.agreements)
    if rows:
        assert "lambda" in found.agreements[-1]


def test_dependent_particles_with_nonholonomic_rows_agree_in_three_formulations():
    found = lagcli.compare(lagcli.loads(MIXED_DISK))
    assert [one.name for one in found.formulations] == ["lagrange-multipliers", "freed", "reduced"]
    assert [(one.coordinates, one.freedoms, one.rows) for one in found.formulations] == [
        (4, 2, 2),
        (16, 2, 14),
        (4, 2, 0),
    ]
    for each in found.agreements:
        assert all(each[kind].error < 1e-10 for kind in ("r", "v", "lambda", "R"))


@pytest.mark.parametrize(
    "name", ["double-pendulum-angles", "bead-on-rotating-hoop", "ramp-stick-coordinates"]
)
def test_multipliers_of_freed_particles_are_the_reactions(name):
    model = load(name)
    declared, freed = lagcli.compare(model, duration=1).formulations
    for particle in model.particle_names:
        for axis in "xyz":
            R = declared.table[:, declared.columns.index(f"R.{particle}.{axis}")]
            lam = freed.table[:, freed.columns.index(f"lambda.r({particle}).{axis}")]
            assert np.abs(R - lam).max() < 1e-10 * max(1.0, np.abs(R).max())


def test_a_reaction_includes_the_drive_in_both_formulations():
    text = PENDULUM + "  motor: {to: theta, force: 2}\nsimulation: {duration: 1}\n"
    model = lagcli.loads(text)
    assert [w.code for w in lagcli.check(model).warnings] == ["reaction-includes-drive"]
    found = lagcli.compare(model)
    assert found.agree
    # At the start m L^2 theta'' = tau - m g L sin(theta): along the circle R carries tau / L.
    R = np.array(
        [found.formulations[1].table[0, found.formulations[1].columns.index(f"R.a.{x}")] for x in "xz"]
    )
    assert R @ [np.cos(1), np.sin(1)] == pytest.approx(2.0, abs=1e-11)


@pytest.mark.parametrize("formulation", ["freed", "reduced"])
def test_no_freedom_left(formulation):
    driven = {
        "freed": "coordinates:\n  s: {value: 0, rate: 1}\nparticles:\n  a: {mass: 2, position: [s, s**2, t]}\n"
        "holonomic:\n  drive: s = sin(t)\n",
        "reduced": "particles:\n  a: {mass: 2, position: [0, 0, 0], velocity: [1, 0, 1]}\n"
        "holonomic:\n  x: a.x = sin(t)\n  y: a.y = a.x**2\n  z: a.z = t\n",
    }[formulation]
    found = lagcli.compare(lagcli.loads(f"lagcli: 1\n{driven}simulation: {{duration: 2}}\n"))
    assert found.agree
    other = next(one for one in found.formulations if one.name == formulation)
    assert other.freedoms == 0
    t = other.table[:, 0]
    # R = m a of a particle without other forces.
    np.testing.assert_allclose(other.table[:, other.columns.index("R.a.x")], -2 * np.sin(t), atol=1e-9)
    np.testing.assert_allclose(other.table[:, other.columns.index("R.a.y")], 4 * np.cos(2 * t), atol=1e-9)


def test_redundant_rows_share_by_the_same_rule():
    found = lagcli.compare(load("twin-rod"), duration=2)
    reduced = found.formulations[-1]
    rod, twin = (reduced.table[:, reduced.columns.index(f"lambda.{name}")] for name in ("rod", "twin"))
    assert rod[0] == pytest.approx(4.905 / 2, abs=1e-9), "half of m g cos(theta0)"
    np.testing.assert_allclose(twin, rod / 4, rtol=1e-9)  # |grad| of the twin is four times that of the rod
    assert found.agreements[-1]["lambda"].error < 1e-10


def test_crossings_are_passed_and_reported():
    found = lagcli.compare(load("double-four-bar"), duration=4, samples=41)
    assert found.agree
    assert found.formulations[-1].reached == 4.0
    instant = lagcli.simulate(load("double-four-bar"), duration=1).stats.singular_times[0]
    found = lagcli.compare(load("double-four-bar"), duration=instant, samples=3)
    assert found.agree
    assert any("singular configuration" in note for note in found.notes)


def test_reduction_does_not_lean_on_the_multipliers(monkeypatch):
    """With B^T lambda a little wrong in the engine the reduced motion and R stay right, and the comparison tells."""
    monkeypatch.setattr(system, "reaction", lambda B, lam: (1 + 1e-6) * (B.T @ lam))
    text = (MODELS / "spherical-pendulum.yaml").read_text(encoding="utf-8") + "# another text, not kept\n"
    found = lagcli.compare(lagcli.loads(text), duration=0.5)
    assert found.agree is False
    assert found.agreements[0]["R"].error > 1e-7
    monkeypatch.undo()
    true = lagcli.simulate(load("spherical-pendulum"), duration=0.5, samples=101)
    reduced = found.formulations[-1]
    for name in ("a.x", "a.y", "a.z", "lambda.rod", "R.a.x", "R.a.z"):
        place = reduced.columns.index(name)
        np.testing.assert_allclose(reduced.table[:, place], true[name], rtol=0, atol=1e-9)


@pytest.mark.parametrize("part", ["m", "theta0", "g"])
def test_a_small_difference_is_found_and_named(part):
    value = {"m": 1 + 1e-6, "theta0": np.pi / 3 + 1e-6, "g": 9.81 + 1e-5}[part]
    found = lagcli.compare(load("pendulum"), load("pendulum-angle", **{part: value}), duration=2)
    assert found.agree is False
    worst = max(found.agreements[0].values(), key=lambda one: one.error)
    assert 1e-7 < worst.error < 1e-3
    assert found.agreements[0]["R"].error > 1e-7
    if part == "m":  # the motion does not depend on it
        assert found.agreements[0]["r"].error < 1e-10


def test_columns_choose_what_is_compared():
    found = lagcli.compare(load("pendulum"), load("pendulum-angle", m=2), columns="a.*", duration=1)
    assert found.agree
    assert set(found.agreements[0]) == {"r", "v"}
    assert not lagcli.compare(load("pendulum"), load("pendulum-angle", m=2), columns="R.*", duration=1).agree


def test_what_has_no_value_agrees_with_nothing():
    base = {
        "name": "newton",
        "path": "",
        "coordinates": 3,
        "freedoms": 1,
        "rows": 1,
        "steps": 1,
        "seconds": 0.0,
    }
    columns = ("t", "a.x", "lambda.rod")
    good = np.array([[0.0, 1.0, 2.0], [1.0, 2.0, 3.0]])
    bad = good.copy()
    bad[1, 1] = np.nan
    pole = good.copy()
    pole[1, 2] = np.nan
    of = {"a.x": "r", "lambda.rod": "lambda"}
    runs = [
        comparison.Formulation(**base, columns=columns, table=t, exchanged=1.0) for t in (good, bad, pole)
    ]
    near = np.zeros(2, dtype=bool)
    assert comparison.compare(of, runs[0], runs[1], near)["r"].digits == 0
    assert comparison.compare(of, runs[0], runs[2], near)["lambda"].error == 0
    wrong = good + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    other = comparison.Formulation(**base, columns=columns, table=wrong, exchanged=1.0)
    assert comparison.compare(of, runs[0], other, near)["lambda"].error == pytest.approx(1 / 3)
    assert comparison.compare(of, runs[0], other, np.array([False, True]))["lambda"].error == 0


def test_the_command_prints_a_table_and_json(command):  # noqa: F811
    out, err, code = command("compare", MODELS / "pendulum-angle.yaml", "--duration", "1")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].split() == [
        "formulation",
        "dof",
        "rows",
        "steps",
        "seconds",
        "r",
        "v",
        "R",
        "energy",
        "outputs",
    ]
    assert lines[1].startswith("Lagrange (D.39)")
    assert lines[2].startswith("Newton, dependent particles freed (D.24)")
    assert "all within 1e-08" in out
    out, _, code = command(
        "compare", MODELS / "ramp-stick.yaml", MODELS / "ramp-stick-coordinates.yaml", "--json"
    )
    assert code == 0
    told = json.loads(out)
    assert told["agree"] is True
    assert [one["formulation"] for one in told["formulations"]] == ["newton", "lagrange"]
    assert told["formulations"][0]["agreement"] == {}
    assert told["formulations"][1]["agreement"]["R"]["digits"] > 10
    assert told["formulations"][1]["velocity_dof"] == 3


def test_exit_codes(command, tmp_path):  # noqa: F811
    pendulum, angle = MODELS / "pendulum.yaml", MODELS / "pendulum-angle.yaml"
    out, err, code = command("compare", pendulum, MODELS / "spherical-pendulum.yaml", "--duration", "1")
    assert code == 1
    assert "disagree: `" in err
    assert "not all within" in out
    assert command("compare", pendulum, "none.yaml")[2] == 2
    assert command("compare", "-", "-")[2] == 2
    assert command("compare", pendulum, angle, "--tolerance", "0")[2] == 2
    assert command("compare", pendulum, "--columns", "no.such")[2] == 2
    assert command("compare", pendulum, "--set", "nosuch=1")[2] == 2
    out, err, code = command("compare", MODELS / "spring-triangle.yaml")
    assert code == 0
    assert "only one formulation fits" in err
    ends = tmp_path / "ends.yaml"
    ends.write_text(PENDULUM + "  pole: {to: a, force: [1/(1 - t), 0, 0]}\nsimulation: {duration: 2}\n")
    out, err, code = command("compare", ends)
    assert code == 3
    assert "stopped at t = " in err
    broken = tmp_path / "broken.yaml"
    broken.write_text(PENDULUM + "holonomic:\n  low: theta = 0\nsimulation: {duration: 1}\n")
    out, _, code = command("compare", broken, "--json")
    assert code == 1
    assert json.loads(out)["errors"][0]["code"] == "inconsistent-start"
    assert command("compare", broken, "--assemble")[2] == 0


def test_the_reduction_of_a_large_model_is_left_out():
    model = lagcli.loads(
        "lagcli: 1\nparameters: {N: 201}\nparticles:\n  p[i]: {for: 'i = 1..N', mass: 1, position: '[i, 0, 0]'}\n"
        "holonomic:\n  hook: norm(p[1]) = 1\nsimulation: {duration: 0.1}\n"
    )
    found = lagcli.compare(model, samples=3)
    assert [one.name for one in found.formulations] == ["newton"]
    assert "600 coordinates or fewer" in found.notes[0]


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(ValueError, match="share none"):
        lagcli.compare(load("pendulum"), load("rolling-disk"), columns="a.*")
    late = lagcli.loads(PENDULUM + "simulation: {start: 1}\n")
    with pytest.raises(ValueError, match="different times"):
        lagcli.compare(load("pendulum"), late)
    with pytest.raises(ValueError, match="tolerance"):
        lagcli.compare(load("pendulum"), tolerance=float("nan"))


class TestGeneralizedForces:
    """The columns Q.theta, Q_j of (D.30)."""

    def test_double_pendulum(self):
        run = lagcli.simulate(load("double-pendulum-angles"), columns="t,theta*,Q.*", duration=2)
        assert run.columns == ("t", "theta1", "theta2", "Q.theta1", "Q.theta2")
        np.testing.assert_allclose(run["Q.theta1"], -3 * 9.81 * np.sin(run["theta1"]), rtol=1e-13)
        np.testing.assert_allclose(run["Q.theta2"], -9.81 * 0.75 * np.sin(run["theta2"]), rtol=1e-13)

    def test_bead(self):
        run = lagcli.simulate(load("bead-on-rotating-hoop"), columns="*,Q.theta", duration=2)
        np.testing.assert_allclose(run["Q.theta"], -9.81 * np.sin(run["theta"]), rtol=1e-13)

    def test_forces_potentials_and_generalized_forces_add(self):
        text = (
            PENDULUM + "  drag: {to: a, force: -0.5*v}\n  motor: {to: theta, force: 2*t}\n"
            "  spring: {potential: 3*theta**2/2}\nsimulation: {duration: 2}\n"
        )
        run = lagcli.simulate(lagcli.loads(text), columns="*,Q.*")
        theta, rate = run["theta"], run["rate(theta)"]
        expected = -9.81 * np.sin(theta) - 0.5 * rate + 2 * run.t - 3 * theta
        np.testing.assert_allclose(run["Q.theta"], expected, atol=1e-12)

    def test_constraints_add_the_rest_of_the_motion(self):
        """d/dt dT/dq' - dT/dq = Q + Q' (D.53), of two masses in a slot that a row holds together."""
        text = (
            "lagcli: 1\ncoordinates:\n  u: {value: 0}\n  w: {value: 0}\nparticles:\n"
            "  a: {mass: 2, position: [u, 0, 0]}\n  b: {mass: 3, position: [w, 0, 0]}\n"
            "forces:\n  pull: {to: a, force: [10*t, 0, 0]}\nholonomic:\n  tie: u = w\nsimulation: {duration: 1}\n"
        )
        run = lagcli.simulate(lagcli.loads(text), columns="*,Q.*")
        np.testing.assert_allclose(run["Q.u"], 10 * run.t)
        np.testing.assert_allclose(run["Q.w"], 0, atol=1e-15)
        np.testing.assert_allclose(run["Q.u"] + run["R.u"], 2 * 2 * run.t, atol=1e-12)
        np.testing.assert_allclose(run["Q.w"] + run["R.w"], 3 * 2 * run.t, atol=1e-12)

    def test_the_default_columns_stay(self):
        model = load("pendulum-angle")
        plain, starred = (lagcli.simulate(model, duration=1, columns=c) for c in ("*", "*,Q.*"))
        assert not [name for name in plain.columns if name.startswith("Q.")]
        assert starred.columns == (*plain.columns, "Q.theta")
        np.testing.assert_array_equal(starred.rows[:, :-1], plain.rows)
        with pytest.raises(ValueError, match="no column matches"):
            lagcli.simulate(load("pendulum"), duration=1, columns="Q.*")

    def test_a_particle_may_be_called_Q(self):
        text = (
            PENDULUM.replace("theta", "x").replace("  a:", "  Q:") + "simulation: {duration: 1, samples: 3}\n"
        )
        run = lagcli.simulate(lagcli.loads(text), columns="*,Q.*")
        np.testing.assert_allclose(run["Q.x"], np.sin(run["x"]))
        assert len(set(run.columns)) == len(run.columns)

    def test_the_command_writes_them(self, command):  # noqa: F811
        out, _, code = command(
            "simulate", MODELS / "pendulum-angle.yaml", "--columns", "t,Q.*", "--samples", "3", "-q"
        )
        assert code == 0
        assert out.splitlines()[0] == "t,Q.theta"
        assert float(out.splitlines()[1].split(",")[1]) == pytest.approx(-9.81 * np.sin(np.pi / 3), abs=1e-12)


def test_multipliers_that_are_not_unique_are_not_compared_between_models() -> None:
    """One rod, and the same declared twice: R and the motion agree, the multiplier of the rod does not."""
    rod = "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0]}}\nforces: {w: {to: a, force: [0, 0, -9.81]}}\n"
    rod += "simulation: {duration: 1}\nholonomic:\n  plane: a.y = 0\n  rod: norm(a) = 1\n"
    one, two = lagcli.loads(rod), lagcli.loads(rod + "  twin: dot(a, a) = 1\n")
    found = lagcli.compare(one, two)
    assert found.agree
    assert any("lambda.rod" in note and "not unique" in note for note in found.notes)
    assert not any("lambda.plane" in note for note in found.notes)


FOLDING = """lagcli: 1
particles:
  a: {mass: 1.552, position: [-0.107, -0.343, 0], velocity: [-0.966, 0.424, 0]}
  b: {mass: 1.49, position: [0.836, -0.444, 0], velocity: [-1.057, -0.428, 0]}
  c: {mass: 1.657, position: [1.818, -0.117, 0], velocity: [-0.762, -1.315, 0]}
  d: {mass: 0.526, position: [3.014, 0.348, 0], velocity: [-0.342, -2.395, 0]}
forces:
  push: {to: c, force: [0.914, "2.426*cos(2*t)", 0]}
  spring: {potential: "3.151*(distance(a, d) - 1.734)**2"}
holonomic:
  flat_a: a.z = 0
  flat_b: b.z = 0
  flat_c: c.z = 0
  flat_d: d.z = 0
  first: distance(a, b) = sqrt(0.943**2 + 0.101**2)
  second: distance(b, c) = sqrt(0.982**2 + 0.327**2)
  third: distance(c, d) = sqrt(1.196**2 + 0.465**2)
differential:
  knife: (b.x - a.x)*a.vy - (b.y - a.y)*a.vx = 0
simulation: {duration: 1.2, samples: 13, assemble: true}
"""


def test_a_reduced_run_stays_on_its_branch_where_a_chart_of_positions_ends():
    """The knife holds back what turns the chart of the rods: it has to be left all the same, and a trial step that was
    given up must not lead to the other branch of the rods."""
    found = lagcli.compare(lagcli.loads(FOLDING))
    assert not any(each.stopped for each in found.formulations)
    assert found.agree
