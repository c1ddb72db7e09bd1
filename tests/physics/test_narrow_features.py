"""Walls, wells, steps and ranges of forces that are narrow in space: no step leads over what rows of the table can see,
and a run that has lost its energy says so."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import scipy.integrate

import lagcli
from lagcli.compiled import narrow_arguments
from lagcli.equations import narrow_functions, operation_rules
from lagcli.input import document
from tests.helpers import in_process

Floats = npt.NDArray[np.float64]
Slope = Callable[[float], float]

MODELS = Path(__file__).parents[2] / "models"


def sech2(u: float) -> float:
    return 1 / math.cosh(u) ** 2 if abs(u) < 300 else 0.0


# A potential of the distance u in widths, with its slope.
SHAPES: dict[str, tuple[str, Slope]] = {
    "gauss": ("exp(-(U)**2)", lambda u: -2 * u * math.exp(-u * u)),
    "step": ("(1 + tanh(U))/2", lambda u: sech2(u) / 2),
    "sech": ("1/cosh(U)**2", lambda u: -2 * math.tanh(u) * sech2(u)),
    "rational": ("1/(1 + (U)**2)**4", lambda u: -8 * u / (1 + u * u) ** 5),
    "lorentz": ("1/(1 + (U)**2)", lambda u: -2 * u / (1 + u * u) ** 2),
    "compact": ("max(0, 1 - (U)**2)**4", lambda u: -8 * u * max(0.0, 1 - u * u) ** 3),
    "flat": ("max(0, 1 - (U)**2)**2", lambda u: -4 * u * max(0.0, 1 - u * u)),
    "peaks": ("cos((U)/20)**400", lambda u: -20 * math.cos(u / 20) ** 399 * math.sin(u / 20)),
}
# The same as forces, -W dV/dx.
FORCES = {
    "gauss": "2*(U)*exp(-(U)**2)",
    "step": "-1/cosh(U)**2/2",
    "compact": "8*(U)*max(0, 1 - (U)**2)**3",
}


def motion(rate: Callable[[Floats], Floats], y: list[float], t: Floats, width: float) -> Floats:
    """y' = rate(y) at times, by SciPy in steps that see `width`."""
    found = scipy.integrate.solve_ivp(
        lambda _, y: rate(y), (t[0], t[-1]), y, "DOP853", t, rtol=1e-12, atol=1e-13, max_step=width
    )
    return np.asarray(found.y.T)


def particle(shape: str, height: float, width: float, at: float = 50.3, kind: str = "free") -> str:
    """A particle of mass 2 that comes along x with speed 1, and a potential of that height."""
    place = f"(a.x - {at})/{width}"
    force = f'p: {{potential: "{height}*{SHAPES[shape][0].replace("U", place)}"}}'
    if kind == "force":
        pushed = FORCES[shape].replace("U", place.replace("a.x", "r.x"))
        force = f'p: {{to: a, force: ["{height / width}*{pushed}", 0, 0]}}'
    weight = 'w: {to: a, force: "[0, 0, -9.81*m]"}, '
    more = {
        "wire": (weight, "holonomic: {wy: a.y = 0, wz: a.z = 0}"),
        "floor": (weight, "inequality: {wz: a.z >= 0}"),
    }.get(kind, ("", ""))
    return f"""\
lagcli: 1
particles: {{a: {{mass: 2, position: [0, 0, 0], velocity: [1, 0, 0]}}}}
forces: {{{more[0]}{force}}}
{more[1]}
simulation: {{duration: 100, samples: 1001}}
"""


FEATURES = [
    *itertools.product(["gauss", "rational", "compact"], [1.7], [0.1, 0.05], [50.3], ["free"]),
    ("gauss", 1.7, 0.3, 50.3, "free"),
    ("gauss", 1.7, 0.025, 50.3, "free"),
    ("gauss", 0.6, 0.1, 57.7, "free"),
    ("gauss", -1.5, 0.1, 43.4, "free"),
    ("compact", -1.5, 0.2, 61.9, "free"),
    ("flat", 0.6, 0.05, 50.3, "free"),
    ("sech", 1.7, 0.15, 50.3, "free"),
    ("step", 0.4, 0.16, 50.3, "free"),
    ("step", -0.4, 0.15, 47.5, "free"),
    ("step", 1.7, 0.16, 54.3, "free"),
    ("lorentz", 1.7, 0.1, 50.3, "free"),
    ("peaks", 0.5, 0.1, 52.1, "free"),
    ("gauss", 1.7, 0.3, 50.3, "wire"),
    ("compact", 1.7, 0.1, 50.3, "wire"),
    ("step", 0.4, 0.16, 50.3, "wire"),
    ("gauss", 1.7, 0.1, 50.3, "floor"),
    ("compact", 0.6, 0.2, 50.3, "floor"),
    ("gauss", 0.6, 0.1, 50.3, "force"),
    ("step", 0.4, 0.16, 50.3, "force"),
    ("compact", 1.7, 0.1, 50.3, "force"),
]


@pytest.mark.parametrize(("shape", "height", "width", "at", "kind"), FEATURES)
def test_a_particle_feels_what_is_narrow(
    shape: str, height: float, width: float, at: float, kind: str
) -> None:
    run = lagcli.simulate(lagcli.loads(particle(shape, height, width, at, kind)))
    slope = SHAPES[shape][1]
    # Far before it the motion is free.
    free = 0 if shape in ("lorentz", "peaks") else 350
    expected = motion(
        lambda y: np.array([y[1], -height / width / 2 * slope((y[0] - at) / width)]),
        [run.t[free], 1.0],
        run.t[free:],
        width / 3,
    )
    before = np.column_stack([run.t[:free], np.ones(free)])
    expected = np.concatenate([before, expected])
    # The fourth derivative of a compact bump jumps.
    assert np.abs(expected[:, 1] - 1).max() > 0.1  # it is met
    assert np.abs(run["a.x"] - expected[:, 0]).max() < (2e-7 if shape in ("compact", "flat") else 1e-8)
    # In the middle of a feature speeds change by 1 in its width.
    assert np.abs(run["a.vx"] - expected[:, 1]).max() < 1e-8 / width
    if kind != "force":
        assert np.abs(run["energy"] - run["energy"][0]).max() < (
            2e-8 if shape in ("compact", "flat") else 1e-10
        )
    if kind in ("wire", "floor"):
        assert np.abs(run["lambda.wz"] - 2 * 9.81).max() < 1e-12
        assert np.abs(run["R.a.z"] - 2 * 9.81).max() < 1e-12
    assert run.stats.warnings == ()


COORDINATE = """\
lagcli: 1
coordinates: {{q: {{value: 0, rate: {rate}}}}}
lagrangian: rate(q)**2/2 - ({potential})
simulation: {{duration: 60, samples: 601}}
"""
# The rate at the start, the potential, its slope, and a width.
COORDINATES: dict[str, tuple[float, str, Slope, float]] = {
    "wall": (1.0, "0.8*exp(-((q - 41.93)/0.1)**2)", lambda q: 8 * SHAPES["gauss"][1]((q - 41.93) / 0.1), 0.1),
    "step": (1.0, "0.2*tanh((q - 33.3)/0.1)", lambda q: 2 * sech2((q - 33.3) / 0.1), 0.1),
    "magnet of a rotor": (
        0.3,
        "-0.5*exp(-2000*(1 - cos(q - 1.1)))",
        lambda q: 1000 * math.sin(q - 1.1) * math.exp(-2000 * (1 - math.cos(q - 1.1))),
        0.02,
    ),
    "wall of a rotor": (
        0.3,
        "0.06*exp(-3000*(1 - cos(q - 2.5)))",
        lambda q: -180 * math.sin(q - 2.5) * math.exp(-3000 * (1 - math.cos(q - 2.5))),
        0.02,
    ),
    "bump in a wide valley": (
        1.0,
        "0.005*q**2 + 0.2*exp(-((q - 5.21)/0.05)**2)",
        lambda q: 0.01 * q + 4 * SHAPES["gauss"][1]((q - 5.21) / 0.05),
        0.05,
    ),
}


@pytest.mark.parametrize("name", COORDINATES)
def test_a_coordinate_feels_what_is_narrow(name: str) -> None:
    rate, potential, slope, width = COORDINATES[name]
    run = lagcli.simulate(lagcli.loads(COORDINATE.format(rate=rate, potential=potential)))
    expected = motion(lambda y: np.array([y[1], -slope(y[0])]), [0.0, rate], run.t, width / 2)
    assert np.abs(run["q"] - expected[:, 0]).max() < 1e-8
    assert np.abs(run["rate(q)"] - expected[:, 1]).max() < 1e-7


RANGES: dict[str, tuple[str, Slope, float]] = {
    "gauss": ("5*exp(-(D/0.3)**2)", lambda d: -10 * d / 0.09 * math.exp(-((d / 0.3) ** 2)), 31.3),
    "short gauss": ("5*exp(-(D/0.1)**2)", lambda d: -1000 * d * math.exp(-((d / 0.1) ** 2)), 31.7),
    "soft spheres": ("40*max(0, 0.4 - D)**3", lambda d: -120 * max(0.0, 0.4 - d) ** 2, 31.1),
    "power": ("(0.2/D)**12", lambda d: -60 * (0.2 / d) ** 13, 31.7),
    "Yukawa": ("exp(-D/0.1)/D", lambda d: -math.exp(-d / 0.1) * (10 / d + 1 / d**2), 31.3),
}


@pytest.mark.parametrize("name", RANGES)
def test_two_particles_meet_off_the_middle(name: str) -> None:
    potential, slope, begin = RANGES[name]
    text = f"""\
lagcli: 1
particles:
  a: {{mass: 1, position: [-25, 0, 0], velocity: [1, 0, 0]}}
  b: {{mass: 3, position: [{begin}, 0, 0], velocity: [-1, 0, 0]}}
forces: {{p: {{potential: "{potential.replace("D", "distance(a, b)")}"}}}}
simulation: {{duration: 60, samples: 601}}
"""
    run = lagcli.simulate(lagcli.loads(text))
    expected = motion(
        lambda y: np.array([y[1], -math.copysign(1.0, y[0]) * slope(abs(y[0])) / 0.75]),
        [begin + 25, -2.0],
        run.t,
        0.02,
    )
    assert np.abs(run["b.x"] - run["a.x"] - expected[:, 0]).max() < 1e-8
    assert np.abs(run["b.vx"] - run["a.vx"] - expected[:, 1]).max() < 1e-6
    assert np.abs(run["a.vx"] + 3 * run["b.vx"] + 2).max() < 1e-11


@pytest.mark.parametrize(("height", "width"), [(0.03, 0.3), (0.08, 0.2), (-0.02, 0.1)])
@pytest.mark.parametrize(
    ("row", "g"),
    [("holonomic: {wz: 'a.z = %s', wy: a.y = 0}", 9.81), ("inequality: {wz: 'a.z >= %s'}", 98.1)],
)
def test_a_bead_feels_a_narrow_hump_of_its_wire_or_floor(
    height: float, width: float, row: str, g: float
) -> None:
    text = f"""\
lagcli: 1
particles: {{a: {{mass: 2, position: [0, 0, 0], velocity: [1, 0, 0]}}}}
forces: {{w: {{to: a, force: "[0, 0, -{g}*m]"}}}}
{row % f"{height}*exp(-((a.x - 50.3)/{width})**2)"}
simulation: {{duration: 100, samples: 1001}}
"""
    run = lagcli.simulate(lagcli.loads(text))

    def shape(x: Floats) -> tuple[Floats, Floats]:
        u = (x - 50.3) / width
        value = height * np.exp(-u * u)
        return -2 * u / width * value, (4 * u * u - 2) / width**2 * value

    def rate(y: Floats) -> Floats:
        first, second = shape(y[0])
        return np.array([y[1], -first * (second * y[1] ** 2 + g) / (1 + first**2)])

    x, v = run.t.copy(), np.ones(run.t.size)
    x[400:], v[400:] = motion(rate, [run.t[400], 1.0], run.t[400:], width / 3).T
    assert np.abs(run["a.x"] - x).max() < 1e-8
    assert np.abs(run["a.vx"] - v).max() < 1e-7
    first, second = shape(x)
    pressed = 2 * (g + second * v**2) / (1 + first**2)
    assert np.abs(run["lambda.wz"] - pressed).max() < 1e-5
    assert np.abs(run["R.a.x"] + first * pressed).max() < 1e-5


def test_digits_of_a_narrow_wall_are_those_of_the_wall() -> None:
    run = lagcli.simulate(lagcli.loads(particle("gauss", 1.7, 0.05)), digits=True)
    assert run["a.vx"][-1] == pytest.approx(-1, abs=1e-11)
    digits = run.digits["r"]
    assert digits is not None
    assert 8 < digits < 13
    assert np.abs(run["err.v"][-1]) < 1e-9


def test_a_run_over_a_wall_goes_on_bit_for_bit(tmp_path: Path) -> None:
    model, file = lagcli.loads(particle("gauss", 0.6, 0.1)), tmp_path / "run.json"
    whole = lagcli.simulate(model, duration=100, output_step=0.1)
    for end in (10.0, 50.3, 50.4):
        lagcli.simulate(model, duration=end, output_step=0.1, checkpoint=file)
        rest = lagcli.simulate(model, duration=100, output_step=0.1, resume=file)
        assert rest.rows.tobytes() == whole.rows[-len(rest.t) :].tobytes()


# What is looked at for witnesses.
def model_of(potential: str, more: str = "") -> lagcli.Model:
    return document.read(
        "lagcli: 1\nparameters: {k: 2, c: [0, 0, 1]}\nparticles: {a: {mass: 1, position: [1, 0, 0]},"
        f" b: {{mass: 1, position: [3, 0, 0]}}}}\nforces: {{p: {{potential: '{potential}'}}}}\n{more}",
        "model.yaml",
    )


@pytest.mark.parametrize(
    "potential",
    [
        "-k/distance(a, b)",
        "k*(distance(a, b) - 1)**2",
        "k*norm(a)**4 - a.x**3",
        "k*cos(a.x)*sin(2*a.y)",
        "-k*a.z/norm(a)**2",
        "k/(1 + a.x**2)",
        "k*log(norm(a.r - c))",
        "exp(-k)*a.x**2",
        "(1 + a.x**2)/k**12",
    ],
)
def test_what_is_felt_from_afar_needs_no_witness(potential: str) -> None:
    assert not narrow_functions.are_any(model_of(potential.replace("a.r", "a")), False)


@pytest.mark.parametrize(
    "potential",
    [
        "exp(-a.x**2)",
        "k*a.x + tanh(a.y)",
        "max(0, 1 - norm(a))**2",
        "1/distance(a, b)**12",
        "a.x + (k/distance(a, b))**6",
        "1/(1 + a.x**2)**4",
        "1/cosh(a.x)",
        "abs(a.x)**3",
        "cos(a.x)**60",
        "norm(a)**(-k)",
        "(2 + cos(a.x))**(-3)",
        "sqrt(exp(a.x))",
        "hill",
    ],
)
def test_what_is_nothing_outside_its_range_has_witnesses(potential: str) -> None:
    assert narrow_functions.are_any(model_of(potential, "definitions: {hill: exp(-a.y**2)}\n"), False)


def test_a_floor_has_witnesses_where_it_is_closed() -> None:
    bumpy = model_of("k*a.x", "inequality: {floor: 'a.z >= exp(-a.x**2) - 5'}\n")
    assert not narrow_functions.are_any(bumpy, False)
    assert narrow_functions.are_any(bumpy, True)


def test_no_model_of_the_gallery_has_witnesses_by_its_forces() -> None:
    for file in sorted(MODELS.glob("*.yaml")):
        assert not narrow_functions.are_any(lagcli.load(file), False), file.stem


# The energy as a witness.
LOST = """\
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}
forces: {step: {potential: "0.1*tanh((a.x - 56.3)/0.1)"}}
simulation: {duration: 100, samples: 3}
"""


@pytest.fixture
def unseen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs in which no step looks for the places of narrow features."""
    monkeypatch.setattr(narrow_arguments, "find", lambda *_: None)


@pytest.mark.usefixtures("unseen")
def test_a_conservative_run_that_loses_its_energy_warns_and_claims_nothing() -> None:
    run = lagcli.simulate(lagcli.loads(LOST), digits=True)
    (warning,) = run.stats.warnings
    assert warning.code == "energy-not-kept"
    assert "--max-step" in warning.reason
    assert run.stats.energy_imbalance == pytest.approx(0.2 / 0.7, rel=1e-3)
    assert max(digits for digits in run.digits.values() if digits is not None) < 1
    assert lagcli.simulate(lagcli.loads(LOST), max_step=0.1).stats.warnings == ()


@pytest.mark.usefixtures("unseen")
def test_the_warning_stands_in_a_report(tmp_path: Path) -> None:
    model, page = tmp_path / "model.yaml", tmp_path / "page.md"
    model.write_text(LOST)
    _, err, code = in_process.run("report", model, "-o", page)
    assert not code, err
    assert "Warning: the energy should stay" in page.read_text()
    assert "energy-not-kept" in page.read_text()


@pytest.mark.usefixtures("unseen")
@pytest.mark.parametrize("option", ["--quiet", "--json"])
def test_the_warning_is_printed_and_in_the_account(option: str, tmp_path: Path) -> None:
    model, table, stats = (tmp_path / name for name in ("model.yaml", "run.csv", "stats.json"))
    model.write_text(LOST)
    out, err, code = in_process.run("simulate", model, "-o", table, "--stats", stats, option)
    assert not code
    assert "warning[energy-not-kept]: the energy should stay, and is off by 2.9e-01" in err
    (warning,) = json.loads(stats.read_text())["warnings"]
    assert warning["code"] == "energy-not-kept"
    if option == "--json":
        assert json.loads(out)["warnings"] == [warning]


@pytest.mark.parametrize(
    ("particle", "rest"),
    [
        ("position: [1e10, 0, 0]", "holonomic: {f: a.z = 0}\nforces: {w: {to: a, force: '[0, 0, -9.81*m]'}}"),
        ("position: [1, 0, 0], velocity: [0.04, 0, 0]", "forces: {w: {potential: '1e20 + a.x**2'}}"),
        (
            "position: [1, 0, 0], velocity: [0.04, 0, 0]",
            "forces: {w: {potential: '1e20*(1 + 1e-20*a.x**2) - 1e20 + a.x**2'}}",
        ),
        ("position: [1e10, 0, 0], velocity: [1, 0, 0]", "forces: {w: {potential: '(a.x - 1e10)**2'}}"),
        ("position: [1e15, 0, 0], velocity: [0, 1e-9, 0]", ""),
        ("position: [0, 0, 1], velocity: [1, 0, 0]", "forces: {drag: {to: a, force: -v}}"),
        ("position: [1, 0, 0]", "forces: {w: {potential: '-1/norm(a)'}, p: {potential: '0.1/norm(a)**2'}}"),
    ],
)
def test_rounding_of_energies_and_what_takes_energy_is_no_reason_for_a_warning(
    particle: str, rest: str
) -> None:
    run = lagcli.simulate(lagcli.loads(f"lagcli: 1\nparticles: {{a: {{mass: 1, {particle}}}}}\n{rest}\n"))
    assert run.stats.warnings == ()


# Beside a pole of velocities.
REACH = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0.5, 0, 0.8660254037844386]}
  b: {mass: 2, position: [1, 0, 0]}
forces: {w: {to: all, force: "[0, 0, -9.81*m]"}}
holonomic: {r1: norm(a) = 1, r2: "distance(a, b) = 1", p1: a.y = 0, p2: b.y = 0, p3: b.z = 0, dr: b.x = 1 + t}
simulation: {duration: %r, samples: 201, assemble: true}
"""


@pytest.mark.parametrize("left", [1e-8, 1e-10, 1e-12])
def test_the_digits_beside_a_pole_of_velocities_are_those_it_leaves(left: float) -> None:
    """Two rods whose tip is led to their reach: z = sqrt(1 - (1 + t)^2/4), and dz/dt without bound."""
    run = lagcli.simulate(lagcli.loads(REACH % (1 - left)), digits=True)
    x = (1 + run.t[-1]) / 2
    speed = -x / 2 / math.sqrt((1 - x) * (1 + x))
    off = abs(run["a.vz"][-1] / speed - 1)
    digits, accuracy = run.digits["v"], run.stats.accuracy
    assert digits is not None
    assert accuracy is not None
    assert off < 10 ** (1 - digits)
    assert "zero to rounding" not in accuracy.sentence
    assert "did not see a force" not in accuracy.sentence
    told = [note for note in run.notes if "dependent ones" in note]
    assert bool(told) == (left < 1e-9)
    if told:
        assert 0.01 * off < float(told[0].split(" by ")[1].split(" ")[0]) < 100 * off


@pytest.mark.parametrize("name", ["pendulum", "double-four-bar", "rolling-disk", "braced-square"])
def test_ordinary_ends_of_runs_are_not_said_to_be_beside_dependent_rows(name: str) -> None:
    run = lagcli.simulate(lagcli.load(MODELS / f"{name}.yaml"))
    assert not any("dependent ones" in note for note in run.notes)


def test_the_rounding_of_many_terms_of_an_energy_is_computed_only_where_it_decides(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It takes longer than the run of a long chain, whose energy is off by less than the rounding of its sum alone."""
    computed: list[int] = []
    roundings = operation_rules.roundings
    monkeypatch.setattr(operation_rules, "roundings", lambda *a: (computed.append(1), roundings(*a))[1])
    model = lagcli.loads(
        """
lagcli: 1
parameters: {N: 1000, ux: 0.47704624084763686, uy: 0.09950371902099893, uz: -0.8732272865606805}
particles: {"p[i]": {for: "i = 1..N", mass: 1, position: [i*ux, i*uy, i*uz]}}
forces: {w: {to: p, force: [0, 0, -9.81*m]}}
holonomic: {hook: "norm(p[1]) = 1", "link[i]": {for: "i = 2..N", equation: "distance(p[i], p[i-1]) = 1"}}
simulation: {duration: 0.001, samples: 2}
"""
    )
    assert not lagcli.simulate(model).stats.warnings
    assert not computed
