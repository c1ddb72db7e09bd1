"""First integrals of differential rows: charts without poles and jumps, and runs that hold them."""

import dataclasses
import math
import re
from typing import Any

import numpy as np
import pytest
import sympy

import lagcli
from lagcli import memory
from lagcli.analysis.classification import classify, verdict
from lagcli.analysis.classification.case import Case
from lagcli.api import cache, prepare_run, run_settings
from lagcli.cli.commands import simulate_command as telling
from lagcli.compiled import NumericSystem, numeric
from lagcli.equations.system import System
from lagcli.model.invariant import FirstIntegral, LevelFunction
from lagcli.pfaffian import level_charts
from lagcli.running import run_request, simulation_run, written_run
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.scheme import invariants

x, y, z, th, u, t = sympy.symbols("x y z th u t", real=True)
a, b, k, R = CONSTANTS = sympy.symbols("a b k R", real=True)
sin, cos, tan, exp, log, sqrt, atan2 = (
    sympy.sin, sympy.cos, sympy.tan, sympy.exp, sympy.log, sympy.sqrt, sympy.atan2
)  # fmt: skip

TURNS = LevelFunction("y*cos(th) - x*sin(th)", "x*cos(th) + y*sin(th)")

# Charts.

CHARTS: list[tuple[Any, list[LevelFunction]]] = [
    (y / x, [LevelFunction("y", "x")]),
    (x * y**2 / z**3, [LevelFunction("x*y**2", "z**3")]),
    ((x * y) ** 2, [LevelFunction("x*y")]),
    (x**2 + 2 * x * y + y**2, [LevelFunction("x + y")]),
    (x / (x * y + x * z), [LevelFunction("1", "y + z")]),
    (1 / x + 1 / y, [LevelFunction("x + y", "x*y")]),
    (y**2 / x, [LevelFunction("y**2", "x"), LevelFunction("y", "sqrt(abs(x))")]),
    (sqrt(x) * y, [LevelFunction("x*y**2"), LevelFunction("y*sqrt(abs(x))")]),
    (y * exp(x), [LevelFunction("y*exp(x)"), LevelFunction("y", "exp(-x)")]),
    (exp(x + y), [LevelFunction("x + y")]),
    (log(x) + y, [LevelFunction("x*exp(y)"), LevelFunction("x", "exp(-y)")]),
    (x * (1 + t), [LevelFunction("x*(t + 1)")]),
    (tan(th / 2) * y, [LevelFunction("y*sin(th/2)", "cos(th/2)")]),
    (tan(th / 2) / sin(th) * y, [LevelFunction("y", "cos(th/2)**2")]),
    (x * sin(th) ** 2 / (1 - cos(th)), [LevelFunction("x*cos(th/2)**2")]),
    (abs(x) * y, [LevelFunction("x*y")]),
    (x**k * y, [LevelFunction("x**k*y")]),
    (b * th - a * u, [LevelFunction("b*th - a*u")]),
    (atan2(y, x), [LevelFunction("y", "x"), LevelFunction("atan2(y, x)", period="2*pi")]),
    (atan2(y, x) - th, [TURNS, LevelFunction("atan2(y, x) - th", period="2*pi")]),
    (sympy.atan(y / x) - th, [TURNS, LevelFunction("atan2(y, x) - th", period="2*pi")]),
    (R * atan2(y, x) - z, [
        LevelFunction("y*cos(z/R) - x*sin(z/R)", "x*cos(z/R) + y*sin(z/R)"),
        LevelFunction("R*atan2(y, x) - z", period="2*pi*R"),
    ]),
    (sqrt(x**2 + y**2) * exp(k * atan2(y, x)), [
        LevelFunction("k*atan2(y, x) + log(x**2 + y**2)/2", period="2*pi*k")
    ]),
    (a * atan2(y, x) - b * atan2(z, x), []),
    (x + sympy.sign(y) * y, []),
    (atan2(y, x) ** 2 + z**2, []),
]  # fmt: skip


@pytest.mark.parametrize(("phi", "expected"), CHARTS, ids=lambda value: str(value))
def test_an_integral_has_charts_without_poles_and_jumps(phi: Any, expected: list[LevelFunction]) -> None:
    found = level_charts.charts(phi, CONSTANTS)
    assert list(found[: len(expected)]) == expected
    assert bool(found) == bool(expected)


@pytest.mark.parametrize(
    "phi",
    [
        *(phi for phi, expected in CHARTS if expected),
        (x + cos(th)) / sin(th),
        2 * atan2(y, x) - 3 * atan2(z, x),
        atan2(y, x) / 2 - sin(th),
        log(y) - 2 * log(x) + sin(th),
        (sin(th) + y * sin(th / 2)) / cos(th),
        (exp(2 * x) - 1) / (exp(x) - 1) * y,
        x * sympy.tanh(y) + z,
    ],
    ids=str,
)
def test_a_chart_has_the_levels_of_its_integral(phi: Any) -> None:
    """The gradient of above/below is parallel to that of phi, and the period is that of the angles."""
    symbols = sorted(phi.free_symbols, key=str)
    moving = [s for s in symbols if s not in CONSTANTS]
    names = {s.name: s for s in symbols} | {"abs": sympy.Abs}
    random = np.random.default_rng(1)
    for chart in level_charts.charts(phi, CONSTANTS):
        form = sympy.sympify(chart.above, names) / sympy.sympify(chart.below, names)
        for _ in range(3):
            point = dict(zip(symbols, random.uniform(0.4, 1.3, len(symbols)), strict=True))
            gradients = [np.array([float(sympy.diff(f, s).subs(point)) for s in moving]) for f in (phi, form)]
            one, other = (g / np.linalg.norm(g) for g in gradients)
            assert min(np.abs(one - other).max(), np.abs(one + other).max()) < 1e-9, chart


# Runs.


def held(text: str, *forms: LevelFunction, rows: tuple[str, ...] = ("row",)) -> tuple[FirstIntegral, ...]:
    return (FirstIntegral(text, rows, forms),)


def ready(text: str, found: tuple[FirstIntegral, ...] = (), **options: Any) -> simulation_run.SimulationRun:
    model = lagcli.loads(text, options.pop("parameters", None))
    chosen = run_settings.chosen(model, options)
    return prepare_run.start(model, chosen, verdict.KnownIntegrals(found))


def run(text: str, found: tuple[FirstIntegral, ...] = (), **options: Any) -> tuple[Any, dict[str, Any]]:
    """The run when it is over, and its columns."""
    going = ready(text, found, **options)
    rows = np.concatenate(list(going.blocks()))
    return going, dict(zip(going.columns, rows.T, strict=True))


def smooth(*columns: np.ndarray) -> bool:
    """Whether no column jumps: each step is like the steps beside it."""
    third = [np.abs(np.diff(c, 3)).max() for c in columns]
    return all(d < 1e-3 * (1 + np.abs(c).max()) for d, c in zip(third, columns, strict=True))


FACTOR = """
lagcli: 1
coordinates: {x: {value: 0.2, rate: 1}, y: {value: 1, rate: -1}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - 5*(x**2 + (y - 2)**2)
differential: {row: exp(x)*(d(y) + y*d(x)) = 0}
"""
PRODUCT = """
lagcli: 1
coordinates: {x: {value: 1, rate: 0.1}, y: {value: 0.7, rate: 0.3}, z: {value: 1.2, rate: 0.1}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2 - 5*((x-1)**2 + (y-1)**2 + 2*(z-1)**2)
differential: {row: y*z*d(x) + 2*x*z*d(y) - 3*x*y*d(z) = 0}
simulation: {assemble: true}
"""
CYLINDER = """
lagcli: 1
parameters: {R: 0.5}
coordinates: {x: {value: 0.3}, phi: {}}
lagrangian: rate(x)**2 + 0.15*rate(phi)**2 - 20*x**2 - cos(phi)
differential: {row: d(x) - R*d(phi) = 0}
"""
AXLE = """
lagcli: 1
parameters: {a: 0.3, b: 0.8}
coordinates: {x: {rate: 0.5}, y: {}, theta: {rate: 0.3}, phi1: {}, phi2: {}}
lagrangian: >-
  1.5*(rate(x)**2 + rate(y)**2) + 0.2*rate(theta)**2 + 0.1*(rate(phi1)**2 + rate(phi2)**2)
  - (x**2 + y**2)/2 - 0.3*cos(phi1)
differential:
  side: sin(theta)*d(x) - cos(theta)*d(y) = 0
  left: cos(theta)*d(x) + sin(theta)*d(y) - b/2*d(theta) - a*d(phi1) = 0
  right: cos(theta)*d(x) + sin(theta)*d(y) + b/2*d(theta) - a*d(phi2) = 0
simulation: {assemble: true}
"""
TOGETHER = held(
    "b*theta - a*(phi2 - phi1)", LevelFunction("b*theta - a*(phi2 - phi1)"), rows=("left", "right")
)


def test_an_integral_stays_for_a_hundred_thousand_steps() -> None:
    found = held("y*exp(x)", LevelFunction("y*exp(x)"))
    options = {"samples": 501, "rtol": 1e-8, "atol": 1e-10}
    going, columns = run(FACTOR, found, duration=8000, **options)
    assert going.stats.steps > 100_000
    assert np.ptp(columns["y"] * np.exp(columns["x"])) < 1e-14
    assert 0 < going.stats.position_drift < 1e-14
    assert not going.notes
    # Without it a twentieth of the run shows the drift.
    _, columns = run(FACTOR, duration=400, **options)
    assert np.ptp(columns["y"] * np.exp(columns["x"])) > 1e-10


@pytest.mark.parametrize("rtol", [1e-11, 1e-6])
@pytest.mark.parametrize(
    ("text", "found", "phi"),
    [
        (
            PRODUCT,
            held("x*y**2/z**3", LevelFunction("x*y**2", "z**3")),
            lambda c: c["x"] * c["y"] ** 2 / c["z"] ** 3,
        ),
        (CYLINDER, held("x - R*phi", LevelFunction("x - R*phi")), lambda c: c["x"] - 0.5 * c["phi"]),
        (AXLE, TOGETHER, lambda c: 0.8 * c["theta"] - 0.3 * (c["phi2"] - c["phi1"])),
    ],
    ids=["product", "cylinder", "axle"],
)
def test_the_motion_is_that_of_the_rows(text: str, found: Any, phi: Any, rtol: float) -> None:
    """Multipliers and reactions too; to the tolerance, which the integral does not ask to be finer."""
    going, columns = run(text, found, duration=20, rtol=rtol)
    values = phi(columns)
    assert np.abs(values - values[0]).max() < 1e-14
    _, exact = run(text, duration=20, rtol=1e-12, atol=1e-14)
    for name, column in columns.items():
        assert np.abs(column - exact[name]).max() < 100 * rtol * (1 + np.abs(column).max()), name
    assert going.stats.energy_imbalance < 100 * rtol


WINDING = """
lagcli: 1
coordinates: {x: {value: 1, rate: 0.1}, y: {rate: 2}, th: {value: 0.3, rate: 2}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(th)**2)/2 - 2*(x**2 + y**2) - 0.3*x
differential: {row: x*d(y) - y*d(x) - (x**2 + y**2)*d(th) = 0}
"""


@pytest.mark.parametrize(
    "chart", [TURNS, LevelFunction("atan2(y, x) - th", period="2*pi")], ids=["regular", "angle"]
)
def test_an_angle_is_followed_through_ten_turns(chart: LevelFunction) -> None:
    going, columns = run(WINDING, held("atan2(y, x) - th", chart), duration=40, samples=4001)
    phi = np.unwrap(np.arctan2(columns["y"], columns["x"])) - columns["th"]
    assert columns["th"][-1] > 10 * 2 * math.pi
    assert np.abs(phi - phi[0]).max() < 1e-13
    assert going.stats.position_drift < 1e-13
    assert not going.notes
    assert smooth(*columns.values())


LINE = """
lagcli: 1
coordinates: {x: {value: %s, rate: %s}, y: {value: %s, rate: %s}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - 2*(x**2 + 3*y**2)
differential: {row: y*d(x) - x*d(y) = 0}
"""
ALONG = """
lagcli: 1
parameters: {c: %s, s: %s}
coordinates: {r: {value: %s, rate: %s}}
lagrangian: rate(r)**2/2 - 2*r**2*(c**2 + 3*s**2)
"""


@pytest.mark.parametrize("angle", [0.5, math.pi / 2, -math.pi / 2, math.pi, 2.5])
@pytest.mark.parametrize("phi", [y / x, atan2(y, x), x / y], ids=str)
def test_a_line_through_the_origin_is_passed_without_a_jump(phi: Any, angle: float) -> None:
    """At the origin y/x, its angle and the row itself have no value; the motion goes on, as in polar form."""
    c, s = math.cos(angle), math.sin(angle)
    if abs(c) < 1e-15:
        c = 0.0  # the start stands on x = 0
    found = held(str(phi), *level_charts.charts(phi))
    going, columns = run(LINE % (c, 0.4 * c, s, 0.4 * s), found, duration=6)
    _, along = run(ALONG % (c, s, 1, 0.4), duration=6)
    zeros = (np.diff(np.sign(along["r"])) != 0).sum()
    assert zeros > 3
    assert np.abs(columns["x"] - c * along["r"]).max() < 1e-9
    assert np.abs(columns["y"] - s * along["r"]).max() < 1e-9
    assert np.abs(columns["y"] * c - columns["x"] * s).max() < 1e-15
    # R is what keeps the force along the line: (4 - 12) x y/r across it, so that lambda is a constant.
    assert np.abs(columns["lambda.row"] + 8 * c * s).max() < 1e-9
    assert smooth(columns["R.x"], columns["R.y"])
    assert len(going.stats.singular_times) == zeros
    assert np.abs(np.interp(going.stats.singular_times, along["t"], along["r"])).max() < 1e-4
    assert len(going.notes) == 1  # of these configurations, and none of integrals


def test_a_rheonomic_row_is_enforced_too() -> None:
    text = """
lagcli: 1
coordinates: {x: {value: 2, rate: -2}, y: {value: 1}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - x*y
differential: {row: (1 + t)*d(x) + x*dt = 0}
"""
    going, columns = run(text, held("x*(1 + t)", LevelFunction("x*(1 + t)")), duration=10, rtol=1e-7)
    assert np.abs(columns["x"] * (1 + columns["t"]) - 2).max() < 1e-14
    assert going.stats.position_drift < 1e-14


def test_particles_of_families_and_parameters_are_found_in_charts() -> None:
    text = """
lagcli: 1
parameters: {k: [0, 2, 1]}
particles:
  p[i]: {for: "i = 1..2", mass: 1, position: ["i", 0.5, 0], velocity: [0, 0.2, -0.1]}
differential: {row: "k.y*p[2].z*d(p[1].y) + p[1].y*k.y*d(p[2].z) + k.z*d(p[1].x)= 0"}
simulation: {assemble: true}
"""
    chart = LevelFunction("k.y*p[1].y*p[2].z + k.z*p[1].x")
    going, columns = run(text, held("phi", chart), duration=3, rtol=1e-6)
    phi = 2 * columns["p[1].y"] * columns["p[2].z"] + columns["p[1].x"]
    assert np.abs(phi - phi[0]).max() < 1e-15
    assert going.stats.position_drift > 0


# The constants.


def test_the_constant_is_that_of_the_start_of_the_run() -> None:
    """Also of an assembled one, and of one that was set: no other build is needed for that."""
    found = held("y*exp(x)", LevelFunction("y*exp(x)"))
    text = FACTOR.replace("y: {value: 1, rate: -1}", "y: {value: 2, rate: 0.3}")
    going, columns = run(text, found, duration=5, assemble=True)
    assert going.assembly.moved_velocity > 0.1
    phi = columns["y"] * np.exp(columns["x"])
    assert np.abs(phi - 2 * math.exp(0.2)).max() < 1e-14
    numbers = {"x.value": 0.5, "y.value": 3, "y.rate": -3}
    model = lagcli.loads(FACTOR, numbers)
    first = integrals_of(lagcli.loads(FACTOR), found)
    levels = (invariants.InvariantValue(0, 1.0, 0.0),)
    again = integrals_of(model, found)
    assert again.functions(levels) is first.functions(levels)
    assert again.system.model is model  # a run reads its own start and values there
    _, columns = run(FACTOR, found, duration=5, parameters=numbers)
    phi = columns["y"] * np.exp(columns["x"])
    assert np.abs(phi - 3 * math.exp(0.5)).max() < 1e-13


POWER = """
lagcli: 1
parameters: {k: 2, c: 1}
coordinates: {x: {value: 1, rate: 0.5}, y: {value: 1, rate: -k/2}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - c*((x - 2)**2 + y**2)
differential: {row: k*y*d(x) + x*d(y) = 0}
"""


def test_a_parameter_in_an_exponent_may_change() -> None:
    found = held("x**k*y", LevelFunction("x**k*y"))
    for power, c in ((2, 1), (2, 3), (3, 1)):
        going, columns = run(POWER, found, duration=3, parameters={"k": power, "c": c})
        assert np.abs(columns["x"] ** power * columns["y"] - 1).max() < 1e-14
        assert not going.notes


# Where a chart does not serve.

CUSP = """
lagcli: 1
coordinates: {x: {value: 1, rate: 0.1}, y: {value: %s, rate: %s}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - (x - 1)**2 - 2*y**2
differential: {row: 2*x*d(y) - y*d(x) = 0}
"""
PARABOLA = held("y**2/x", LevelFunction("y**2", "x"), LevelFunction("y", "sqrt(abs(x))"))


def integrals_of(model: lagcli.Model, found: tuple[FirstIntegral, ...]) -> invariants.Integrals:
    """Integrals with the functions that runs of a model keep for one another."""
    compiled = cache.compiled(model)
    return compiled.cached.integrals(compiled.system, found)


def chart_of(going: simulation_run.SimulationRun) -> list[int | None]:
    return [level and level.chart for level in going.checkpoint().run_state.invariant_values]


def test_a_start_where_the_gradient_vanishes_takes_the_next_chart() -> None:
    for start, chart in (((0, 0), 1), ((1e-9, 0.5e-10), 1), ((1, 0.05), 0)):
        going, _ = run(CUSP % start, PARABOLA, duration=2)
        assert chart_of(going) == [chart]
        assert not [note for note in going.notes if "y**2/x" in note]


def test_an_integral_that_cannot_be_enforced_is_reported() -> None:
    one = dataclasses.replace(PARABOLA[0], charts=PARABOLA[0].charts[:1])
    none = dataclasses.replace(one, charts=())
    pole = dataclasses.replace(one, charts=(LevelFunction("1/y"),))
    text = CUSP % (0, 0)
    for integral, why in (
        (one, "its gradient vanishes at the start"),
        (none, "no form of it without poles or jumps is known"),
        (pole, "it has no finite form at the start"),
    ):
        going, _ = run(text, (integral,), duration=1)
        expected = (
            f"the integral y**2/x is not enforced: {why}; the velocity row `row` keeps it to the tolerance"
        )
        assert expected in going.notes
        assert chart_of(going) == [None]


ENDING = {
    "root": LevelFunction("sqrt(-x)", "sqrt(-y)"),
    "log": LevelFunction("log(-x) - log(-y)"),
    "angle": LevelFunction("atan2(y, x)", period="2*pi"),
    "good": LevelFunction("y", "x"),
}


@pytest.mark.parametrize("first", ["root", "log", "angle"])
@pytest.mark.parametrize("then", [[], ["good"], ["root", "good"]], ids="-".join)
def test_a_chart_that_ends_is_left_for_another_or_for_the_velocity_row(first: str, then: list[str]) -> None:
    names = [first, *(name for name in then if name != first)]
    found = held("y/x", *(ENDING[name] for name in names))
    going, columns = run(LINE % (-1, 1, -0.5, 0.5), found, duration=6)
    (note,) = (note for note in going.notes if "y/x" in note)
    assert 0.2 < float(re.match(r"from t = (\S+) ", note)[1]) < 0.5  # on the way to the origin
    off = np.abs(columns["y"] - columns["x"] / 2).max()
    if then:
        assert note.endswith("the integral y/x is enforced in another form")
        assert chart_of(going) == [names.index("good")]
        assert off < 1e-14
    else:
        assert "is enforced no longer; the velocity row `row` keeps it to the tolerance" in note
        assert chart_of(going) == [None]
        assert 1e-15 < off < 1e-10
    assert np.abs(columns["lambda.row"] + 8 * 0.4).max() < 1e-9
    assert smooth(*columns.values())


def test_an_integral_is_not_blamed_for_the_end_of_the_constraints() -> None:
    text = """
lagcli: 1
coordinates: {x: {value: 1, rate: -1}, y: {rate: 1}}
lagrangian: (rate(x)**2 + rate(y)**2)/2
differential: {row: sqrt(x)*d(x) + sqrt(x)*d(y) = 0}
"""
    going = ready(text, held("x + y", LevelFunction("x + y")), duration=3)
    with pytest.raises(run_stop.RunStop):
        list(going.blocks())
    # The rows vanish at the end, which is said; the integral is enforced up to there.
    assert not [note for note in going.notes if "x + y" in note]
    assert chart_of(going) == [0]


def test_integrals_that_follow_from_others_are_left_out_silently() -> None:
    going, columns = run(AXLE, (*TOGETHER, *TOGETHER), duration=5)
    assert chart_of(going) == [0, None]
    assert not going.notes
    phi = 0.8 * columns["theta"] - 0.3 * (columns["phi2"] - columns["phi1"])
    assert np.abs(phi - phi[0]).max() < 1e-14


SURFACE = """
lagcli: 1
coordinates: {x: {value: 1, rate: 0.5}, z: {value: 1, rate: 1}, w: {rate: 0.5}}
lagrangian: (rate(x)**2 + rate(z)**2 + rate(w)**2)/2 - (x - 1)**2 - 2*z**2
holonomic: {bowl: z = x**2}
differential: {row: d(w) - z*d(x) = 0}
"""


@pytest.mark.parametrize("expanded", [True, False])
def test_an_integral_on_the_surface_of_a_holonomic_row(
    expanded: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not expanded:
        monkeypatch.setattr(numeric, "EXPANDED_OPERATIONS", 0)
        memory.forget()
    found = (*held("w - x**3/3", LevelFunction("w - x**3/3")), *held("w - x*z/3", LevelFunction("w - x*z/3")))
    going, columns = run(SURFACE, found, duration=20, rtol=1e-7)
    memory.forget()
    assert chart_of(going) == [0, None]
    assert not going.notes
    phi = columns["w"] - columns["x"] ** 3 / 3
    assert np.abs(phi - phi[0]).max() < 1e-15
    assert np.abs(columns["z"] - columns["x"] ** 2).max() < 1e-14


def test_a_dependence_at_the_start_alone_is_reported() -> None:
    text = """
lagcli: 1
coordinates: {x: {value: 1}, y: {}, z: {rate: 1}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2 - z**2
differential: {one: d(x) = 0, two: d(y) = 0}
"""
    integrals = (
        FirstIntegral("x", ("one",), (LevelFunction("x"),)),
        FirstIntegral("x + y**2", ("one", "two"), (LevelFunction("x + y**2"),)),
        FirstIntegral("y", ("two",), (LevelFunction("y"),)),
    )
    going = ready(text, integrals[:2], duration=1)
    assert len(going.notes) == 1
    assert (
        "x + y**2 is not enforced: it depends on other constraints at the start; the velocity rows `one`, `two` keep"
        in (going.notes[0])
    )
    assert not ready(text, integrals, duration=1).notes


# Rows of the table.


def test_a_row_at_a_point_where_a_row_of_constraints_vanishes_is_a_limit() -> None:
    text = """
lagcli: 1
coordinates: {x: {rate: 1}, y: {rate: 1}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - %s
differential: {row: (t - 1)*(d(x) - d(y)) = 0}
"""
    for found in ((), held("x - y", LevelFunction("x - y"))):
        _, columns = run(text % "(t - 1)*x", found, duration=2, samples=5)
        assert np.abs(columns["lambda.row"] - 0.5).max() < 1e-11
        assert np.abs(columns["R.x"] - (columns["t"] - 1) / 2).max() < 1e-11
        assert np.abs(columns["x"] - columns["y"]).max() < 1e-15
        # lambda has a pole, or a jump, as R has then.
        _, columns = run(text % "x", found, duration=2, samples=5)
        assert np.abs(columns["lambda.row"] - [-0.5, -1, np.nan, 1, 0.5])[[0, 1, 3, 4]].max() < 1e-9
        assert np.abs(columns["R.x"] - 0.5).max() < 1e-9
        assert np.isnan(columns["lambda.row"]).tolist() == [False, False, True, False, False]
        _, columns = run(text % "abs(t - 1)*x", found, duration=2, samples=5)
        for name in ("lambda.row", "R.x"):
            assert np.isnan(columns[name]).tolist() == [False, False, True, False, False]


# What is said and what it costs.


def test_notes_stand_in_the_account(capsys: pytest.CaptureFixture[str]) -> None:
    found = held("y/x", ENDING["log"], ENDING["good"])
    for quiet in (False, True):
        going = ready(LINE % (-1, 1, -0.5, 0.5), found, duration=1, samples=3)
        request = run_request.RunRequest(quiet=quiet)
        telling.carry_out(written_run.WrittenRun(going, request), request)
        told = capsys.readouterr().err
        assert ("note: from t = 0." in told) == (not quiet)
        assert ("the integral y/x is enforced in another form\n" in told) == (not quiet)


def test_a_model_without_integrals_runs_on_the_functions_it_had() -> None:
    model = lagcli.loads(FACTOR)
    compiled = cache.compiled(model)
    assert integrals_of(model, ()).functions(()) is compiled.cached.plain
    plain = compiled.numeric
    found = integrals_of(model, held("y*exp(x)", LevelFunction("y*exp(x)")))
    assert found.functions((None,)) is compiled.cached.plain
    holding = found.functions((found.at(_start(model)).level(0, 0)._replace(),)).numeric
    assert holding.project.n_instructions() < 2 * plain.project.n_instructions()
    assert holding.rhs.n_instructions() == plain.rhs.n_instructions()


def _start(model: lagcli.Model) -> Any:
    from lagcli.start import initial

    return initial.declared(cache.compiled(model).system)


# The search.

NO_CLOSED_FORM = """
lagcli: 1
coordinates: {x: {value: 0.5, rate: 0.1}, y: {value: 1, rate: 0.1}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - x**2
differential: {row: d(y) - exp(-x**2)*d(x) = 0}
simulation: {assemble: true}
"""
TOLD = "integrals that are not known are enforced at velocity level only, to the integration tolerance"


def test_integrals_that_are_not_known_are_reported() -> None:
    for text, limit, expected in (
        (NO_CLOSED_FORM, 20.0, f"not all integrals of `row` were found: {TOLD}"),
        # Without time it is not even known what the motions from the start keep to.
        (FACTOR, 0.0, f"it is undecided whether `row` can be integrated: {TOLD}"),
        (AXLE, 0.0, f"it is undecided whether `side`, `left`, `right` can be integrated: {TOLD}"),
    ):
        model = lagcli.loads(text)
        going = prepare_run.prepare(model, run_settings.chosen(model, {"duration": 0.1}), None, limit)
        assert going.notes == (expected,)
        list(going.blocks())
        assert going.checkpoint().run_state.notes == (expected,)
    family = '{for: "i = 1..6", equation: "q[i]*d(q[i]) = dt"}'
    text = f"""
lagcli: 1
coordinates: {{"q[i]": {{for: "i = 1..6", value: 2, rate: 0.5}}}}
lagrangian: rate(q[1])**2 + rate(q[2])**2 + rate(q[3])**2 + rate(q[4])**2 + rate(q[5])**2 + rate(q[6])**2
differential: {{"row[i]": {family}}}
"""
    model = lagcli.loads(text)
    assert lagcli.simulate(model, duration=0.1, limit=0).notes == (
        f"it is undecided whether `row[1]`, `row[2]`, `row[3]`, `row[4]` and 2 more can be integrated: {TOLD}",
    )
    assert lagcli.simulate(model, duration=0.1).notes == ()


def test_where_nothing_is_integrable_there_is_nothing_to_tell() -> None:
    text = """
lagcli: 1
coordinates: {x: {}, y: {}, phi: {rate: 1}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(phi)**2)/2
differential: {edge: sin(phi)*d(x) - cos(phi)*d(y) = 0}
"""
    assert lagcli.simulate(lagcli.loads(text), duration=0.1, limit=0).notes == ()


def test_the_search_is_done_once_for_the_same_values(monkeypatch: pytest.MonkeyPatch) -> None:
    searches: list[float] = []

    def search(case: Case, built: System, numeric: NumericSystem, limit: float) -> verdict.KnownIntegrals:
        searches.append(limit)
        return verdict.KnownIntegrals()

    monkeypatch.setattr(classify, "_searched", search)
    memory.forget()
    for changes in ({}, {}, {"k": 3}, {"k": 3}, {"x.value": 2}, {"x.value": 2}, {}):
        lagcli.simulate(lagcli.loads(POWER, changes), duration=0.1, assemble=True)
    assert len(searches) == 3  # the last values are the first again
    lagcli.simulate(lagcli.loads(POWER), duration=0.1, limit=1)
    assert len(searches) == 4
    memory.forget()


@pytest.mark.parametrize("limit", [-1.0, math.nan])
def test_a_limit_is_a_number_of_seconds(limit: float) -> None:
    with pytest.raises(ValueError, match="limit: a number of seconds"):
        lagcli.simulate(lagcli.loads(FACTOR), duration=0.1, limit=limit)


def test_an_integral_is_enforced_where_functions_of_t_are_looked_through() -> None:
    """The constants of its level come behind the parameters, which not every function takes."""
    text = """
lagcli: 1
parameters: {k: 2.5}
coordinates: {q: {value: 1, rate: -1}, u: {rate: 0.5}}
lagrangian: k*rate(q)**2/2 + k*rate(u)**2/2 + rate(u)*sin(u + t)
differential: {row: d(q) + q*dt = 0}
"""
    run = lagcli.simulate(lagcli.loads(text), duration=2, rtol=1e-10)
    assert np.abs(run["q"] - np.exp(-run.t)).max() < 1e-9
