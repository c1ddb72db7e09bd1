"""The motion that makes the action stationary: against equations written by hand, minimisation, and laws."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import numpy.typing as npt
import pytest
from scipy import integrate, optimize

import lagcli
from lagcli.formulations.comparison import Comparison
from tests.helpers import in_process

Floats = npt.NDArray[np.float64]

KNIFE = """
lagcli: 1
parameters: {m: 1.3, J: 0.4, g: 0, v0: 1.5, w0: 0.8, mu0: 0.6}
coordinates: {x: {rate: v0}, y: {}, th: {rate: w0}}
lagrangian: m/2*(rate(x)**2 + rate(y)**2) + J/2*rate(th)**2 + m*g*x
differential:
  blade: sin(th)*rate(x) - cos(th)*rate(y) = 0
simulation: {duration: 3, samples: 31}
"""
CONTACT = """
lagcli: 1
coordinates: {x: {rate: 0.9}, y: {rate: 0.7}, z: {}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2
differential:
  contact: rate(z) - y*rate(x) = 0
simulation: {duration: 2}
"""


def both(text: str, mu: dict[str, float | str] | None = None, **options: object) -> Comparison:
    """The two motions of a model."""
    return lagcli.compare(lagcli.loads(text), vakonomic=True, mu=mu, **options)  # type: ignore[arg-type]


def column(found: Comparison, name: str) -> Floats:
    """A column of the vakonomic motion."""
    run = found.formulations[-1]
    return run.table[:, run.columns.index(name)]


def test_knife_edge_is_that_of_its_reduced_equation() -> None:
    """px = m x' + mu sin th and py = m y' - mu cos th are kept, and th has an equation of its own."""
    found = both(KNIFE, {"blade": "mu0"})
    m, J, v0, w0, mu0 = 1.3, 0.4, 1.5, 0.8, 0.6
    px, py = m * v0, -mu0

    def rate(t: float, y: Floats) -> list[float]:
        s, c = np.sin(y[2]), np.cos(y[2])
        mu, along = px * s - py * c, (px * c + py * s) / m
        return [along * c, along * s, y[3], mu * along / J]

    times = np.linspace(0, 3, 101)
    want = integrate.solve_ivp(rate, (0, 3), [0, 0, 0, w0], "DOP853", times, rtol=1e-12, atol=1e-13).y
    for name, values in zip(("x", "y", "th", "rate(th)"), want, strict=True):
        assert np.abs(column(found, name) - values).max() < 1e-9
    mu = px * np.sin(want[2]) - py * np.cos(want[2])
    assert np.abs(column(found, "mu.blade") - mu).max() < 1e-9
    # R is m a - F, whatever carries it.
    R = column(found, "R.x") - m * np.gradient(column(found, "rate(x)"), times, edge_order=2)
    assert np.abs(R[1:-1]).max() < 0.05 * np.abs(column(found, "R.x")).max()
    assert found.principles is not None
    assert found.principles.nonholonomic == ("blade",)
    assert not found.principles.agree
    assert found.agree  # the formulations of d'Alembert's motion


def test_motion_with_time_in_everything_is_that_of_equations_written_out() -> None:
    """L = (x'^2 + y'^2 + z'^2)/2 - 2 z cos t, phi = z' - (y + t) x' + sin t, equations by hand."""
    text = """
lagcli: 1
coordinates: {x: {rate: 0.4}, y: {rate: 0.7}, z: {rate: 0}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2
forces: {lift: {potential: 2*z*cos(t)}}
differential:
  row: rate(z) - (y + t)*rate(x) + sin(t) = 0
simulation: {duration: 2}
"""
    found = both(text, {"row": -0.8})

    def rate(t: float, s: Floats) -> Floats:
        _, y, _, vx, vy, vz, mu = s
        c = y + t
        # x'' - (c mu)' = 0, y'' = -mu x', z'' + mu' = -2 cos t, z'' - c x'' - (y' + 1) x' + cos t = 0.
        A = np.array([[1, 0, 0, -c], [0, 1, 0, 0], [0, 0, 1, 1], [-c, 0, 1, 0.0]])
        right = [(vy + 1) * mu, -mu * vx, -2 * np.cos(t), (vy + 1) * vx - np.cos(t)]
        ax, ay, az, slope = np.linalg.solve(A, right)
        return np.array([vx, vy, vz, ax, ay, az, slope])

    begin = [0, 0, 0, 0.4, 0.7, 0, -0.8]
    times = np.linspace(0, 2, 101)
    want = integrate.solve_ivp(rate, (0, 2), begin, "DOP853", times, rtol=1e-12, atol=1e-13).y
    for name, values in zip(("x", "y", "z", "rate(x)", "rate(y)", "rate(z)", "mu.row"), want, strict=True):
        assert np.abs(column(found, name) - values).max() < 1e-9, name


def test_motion_has_the_least_action_among_paths_that_satisfy_the_row() -> None:
    """x and y as polynomials with the ends of the motion, z by the row: minimised, they are the motion."""
    found = both(CONTACT, {"contact": -0.5}, samples=3)
    end = {name: column(found, name)[-1] for name in "xyz"}
    nodes, weights = np.polynomial.legendre.leggauss(24)
    s, w, T = (nodes + 1) / 2, weights, 2.0
    powers = np.arange(6)
    bumps = s[:, None] * (1 - s[:, None]) * s[:, None] ** powers
    slopes = (powers + 1) * s[:, None] ** powers - (powers + 2) * s[:, None] ** (powers + 1)

    def path(c: Floats) -> tuple[Floats, Floats, Floats]:
        a, b = np.split(c, 2)
        y = end["y"] * s + bumps @ b
        return (end["x"] + slopes @ a) / T, y, (end["y"] + slopes @ b) / T

    def action(c: Floats) -> float:
        vx, y, vy = path(c)
        return float(T / 2 * np.sum(w * (vx**2 + vy**2 + (y * vx) ** 2)) / 2)

    def height(c: Floats) -> float:
        vx, y, _ = path(c)
        return float(T / 2 * np.sum(w * y * vx) - end["z"])

    least = optimize.minimize(
        action, np.zeros(12), constraints={"type": "eq", "fun": height}, method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 400},
    )  # fmt: skip
    a, b = np.split(least.x, 2)
    middle = 0.25 * 0.5**powers
    assert abs(end["x"] / 2 + middle @ a - column(found, "x")[1]) < 3e-4
    assert abs(end["y"] / 2 + middle @ b - column(found, "y")[1]) < 3e-4
    # d'Alembert's motion is nowhere near.
    assert abs(found.formulations[0].table[1, 1] - column(found, "x")[1]) > 0.1


def test_energy_is_constant_where_rows_rest_and_are_homogeneous() -> None:
    found = both(KNIFE.replace("g: 0", "g: 3"), {"blade": 0.6}, duration=20)
    energy = column(found, "energy")
    assert np.ptp(energy) < 1e-10 * np.abs(column(found, "x")).max() * 1.3 * 3
    # What is kept is the motion's own.
    assert found.principles is not None
    assert not found.principles.agree


@pytest.mark.parametrize("mu", [0.0, 1.7])
def test_integrable_rows_have_one_motion_whatever_mu_they_begin_with(mu: float) -> None:
    text = """
lagcli: 1
particles:
  a: {mass: 2, position: [1, 0, 0.5], velocity: [0, 1, 0.2]}
forces: {weight: {to: a, force: [0, 0, -m]}}
differential:
  turned: (a.x*d(a.x) + a.y*d(a.y) + a.z*d(a.z))*exp(a.x) = 0
simulation: {duration: 4, assemble: true}
"""
    found = both(text, {"turned": mu})
    assert found.principles is not None
    assert found.principles.integrable == ("turned",)
    assert found.principles.agree
    assert found.principles.digits is not None
    assert found.principles.digits > 9
    assert found.agreements[-1]["R"].digits > 8
    assert "as they must" in found.principles.sentence


def test_a_repeated_row_shares_mu_and_changes_nothing() -> None:
    once = both(KNIFE, {"blade": 0.6})
    text = KNIFE.replace("simulation", "  twice: 2*sin(th)*rate(x) - 2*cos(th)*rate(y) = 0\nsimulation")
    twice = both(text, {"blade": 0.2, "twice": 0.2})
    for name in ("x", "y", "th"):
        assert np.abs(column(once, name) - column(twice, name)).max() < 1e-9
    assert any("carried by those" in note for note in twice.notes)


def test_holonomic_rows_keep_their_multipliers() -> None:
    """Two masses on a rod with a blade at the first: the same as the knife edge with a moment of inertia."""
    rod = """
lagcli: 1
parameters: {L: 0.5, m: 1, w0: 0.8, v0: 1.5}
particles:
  a: {mass: m, position: [0, 0, 0], velocity: [v0, 0, 0]}
  b: {mass: m, position: [L, 0, 0], velocity: [v0, L*w0, 0]}
  c: {mass: m, position: [-L, 0, 0], velocity: [v0, -L*w0, 0]}
holonomic:
  front: distance(a, b) = L
  mid: a*2 = b + c
  flat: b.z = 0
  floor: a.z = 0
differential:
  blade: (b.y - a.y)/L*a.vx - (b.x - a.x)/L*a.vy = 0
simulation: {duration: 2}
"""
    found = both(rod.replace("  flat: b.z = 0\n", "  flat: b.z = 0\n"), {"blade": 0.6})
    knife = both(KNIFE.replace("m: 1.3, J: 0.4", "m: 3, J: 0.5"), {"blade": 0.6}, duration=2, samples=101)
    for one, other in (("a.x", "x"), ("a.y", "y")):
        assert np.abs(column(found, one) - column(knife, other)).max() < 1e-9
    assert np.abs(column(found, "mu.blade") - column(knife, "mu.blade")).max() < 1e-9
    names = found.formulations[-1].columns
    assert "lambda.front" in names
    assert "lambda.mid.x" in names
    assert "lambda.blade" not in names
    # All forces of constraint together are those of all masses: m sum a = sum R.
    total = sum(column(found, f"R.{p}.x") for p in "abc") - column(knife, "R.x")
    assert np.abs(total).max() < 1e-8


@pytest.mark.parametrize(
    ("force", "why"),
    [
        ("{to: a, force: -0.3*v}", "depends on velocities"),
        ("{to: a, force: '[-a.y, a.x, 0]'}", "has a curl"),
    ],
)
def test_forces_without_a_potential_are_refused_where_they_stand(force: str, why: str) -> None:
    text = f"""
lagcli: 1
particles: {{a: {{mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}}}}
forces:
  push: {force}
differential:
  row: a.vz = a.y*a.vx
"""
    with pytest.raises(lagcli.ModelError) as caught:
        both(text)
    (found,) = caught.value.diagnostics
    assert found.code == "not-of-an-action"
    assert why in found.message
    assert found.location.line == 5


@pytest.mark.parametrize("force", ["'[sin(3*t), 0, 0]'", "'[a.y*a.z, a.x*a.z, a.x*a.y]'"])
def test_a_force_with_a_potential_that_nobody_declared_is_taken(force: str) -> None:
    text = """
lagcli: 1
particles: {{a: {{mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}}}}
forces:
  push: {}
differential:
  row: a.vz = a.y*a.vx
simulation: {{duration: 1}}
"""
    potential = "-a.x*sin(3*t)" if "sin" in force else "-a.x*a.y*a.z"
    one = both(text.format(f"{{to: a, force: {force}}}"), {"row": 0.4})
    other = both(text.format(f"{{potential: {potential}}}"), {"row": 0.4})
    for name in ("a.x", "a.y", "a.z", "mu.row", "R.a.x"):
        assert np.abs(column(one, name) - column(other, name)).max() < 1e-10


def test_inequalities_are_refused_where_they_stand() -> None:
    with pytest.raises(lagcli.ModelError, match="one-sided constraint `floor`"):
        both(CONTACT + "inequality:\n  floor: z >= -100\n")


def test_hidden_conditions_are_refused() -> None:
    text = CONTACT.replace("{x: {rate: 0.9}", "{w: {}, x: {rate: 0.9}")
    text = text.replace("  contact:", "  held: w*dt = 0\n  contact:")
    text = text.replace("(rate(x)**2", "(rate(w)**2 + rate(x)**2")
    with pytest.raises(lagcli.ModelError, match="hidden condition `w = 0`"):
        both(text)


def test_a_motion_that_stops_leaves_what_there_is(tmp_path: pathlib.Path) -> None:
    """The gradient of the row vanishes at x = 0, where d'Alembert's motion goes on and the other does not."""
    path, table = tmp_path / "toggle.yaml", tmp_path / "v.csv"
    path.write_text(
        "lagcli: 1\ncoordinates: {x: {value: 1, rate: -1}, y: {value: 0.3, rate: 0.5}, z: {rate: 0.5}}\n"
        "lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2\n"
        "differential:\n  c: x*rate(y) - x**3*rate(z) = 0\nsimulation: {duration: 3, rtol: 1e-5}\n"
    )
    _, err, code = in_process.run(
        "compare", path, "--vakonomic", "--mu", "c=0.5", "-o", table, "--tolerance", 1e-3
    )
    assert code == 3
    assert "the vakonomic motion stopped at t = 0.85" in err
    assert not table.exists()
    assert len(table.with_name("v.csv.partial").read_text().splitlines()) > 5
    # At this tolerance of the runs d'Alembert's own formulations differ by more than 1e-8: these two are named.
    _, err, code = in_process.run("compare", path, "--vakonomic", "--mu", "c=0.5")
    assert code == 1
    assert "Lagrange with multipliers (D.53) and reduced by the null space (D.26, Maggi) disagree" in err


def test_without_differential_rows_the_two_are_the_same_equations() -> None:
    found = both("lagcli: 1\ncoordinates: {x: {rate: 1}}\nlagrangian: rate(x)**2 - x**2\n")
    assert found.principles is not None
    assert "same equations" in found.principles.sentence
    assert np.array_equal(found.formulations[0].table, found.formulations[-1].table)


def test_names_of_mu_are_differential_rows() -> None:
    with pytest.raises(lagcli.OverrideError, match="did you mean `blade`"):
        both(KNIFE, {"blad": 1.0})
    with pytest.raises(lagcli.ModelError) as caught:
        both(KNIFE, {"blade": "2*nu"})
    assert caught.value.diagnostics[0].location.path == "--mu blade"
    assert caught.value.diagnostics[0].location.column == 3
    with pytest.raises(ValueError, match="not asked for"):
        lagcli.compare(lagcli.loads(KNIFE), mu={"blade": 1.0})
    text = CONTACT.replace("simulation", "holonomic: {rail: x = 0.9*t}\nsimulation")
    with pytest.raises(lagcli.OverrideError, match="`rail` is holonomic"):
        both(text, {"rail": 1.0})


def test_outputs_that_read_lambda_of_a_differential_row_are_left_out() -> None:
    text = CONTACT + "outputs:\n  pull: multiplier(contact)\n  twice: 2*pull\n  fast: rate(x)**2\n"
    found = both(text, duration=1)
    assert found.principles is not None
    assert found.principles.left_out == ("pull", "twice")
    assert "fast" in found.formulations[-1].columns
    assert "pull" not in found.formulations[-1].columns


def test_command_writes_table_and_figure_and_says_where_they_part(tmp_path: pathlib.Path) -> None:
    path, table, figure = tmp_path / "knife.yaml", tmp_path / "v.csv", tmp_path / "v.png"
    path.write_text(KNIFE)
    more = ["--mu", "blade=mu0", "-o", str(table), "--plot", str(figure)]
    out, err, code = in_process.run("compare", path, "--vakonomic", *more)
    assert code == 0, err
    assert "the two principles part, for `blade` is not integrable" in out
    header, *rows = table.read_text().splitlines()
    assert header.split(",")[:8] == ["t", "x", "rate(x)", "y", "rate(y)", "th", "rate(th)", "mu.blade"]
    assert len(rows) == 101
    assert figure.read_bytes().startswith(b"\x89PNG")
    told = json.loads(in_process.run("compare", path, "--vakonomic", "--json")[0])
    assert told["formulations"][-1]["formulation"] == "vakonomic"
    assert told["principles"]["mu"] == {"blade": 0.0}
    assert told["principles"]["parting"]["t"] > 0
    wrong = [
        ["--mu", "blade=1"],
        *(["--vakonomic", *one] for one in (["--mu", "blade"], ["--mu", "blade=q"])),
    ]
    for options in [*wrong, ["--vakonomic", "-o", "v.doc"], ["--vakonomic", "--json", "-o", "-"]]:
        assert in_process.run("compare", path, *options)[2] == 2, options


def test_the_reduction_is_left_out_beside_the_vakonomic_motion_of_many_coordinates() -> None:
    """Nine particles with a row each: the reduction of so many coordinates takes longer than both motions."""
    text = """
lagcli: 1
particles:
  p[i]: {for: "i = 1..9", mass: 1, position: "[i, 0, 0]", velocity: "[1, 0, 0]"}
forces:
  well[i]: {for: "i = 1..9", potential: "p[i].y**2"}
differential:
  blade[i]: {for: "i = 1..9", equation: "p[i].vz = p[i].y*p[i].vx"}
simulation: {duration: 0.2, samples: 3}
"""
    found = both(text)
    assert [one.name for one in found.formulations] == ["newton", "vakonomic"]
    assert any("left out" in note and "24 coordinates" in note for note in found.notes)
    alone = lagcli.compare(lagcli.loads(KNIFE), vakonomic=True, duration=0.2)
    assert [one.name for one in alone.formulations] == ["lagrange-multipliers", "reduced", "vakonomic"]
