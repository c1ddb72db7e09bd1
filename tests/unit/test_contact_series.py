"""Power series of expressions along a motion, and the order that decides a contact."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import sympy

import lagcli
from lagcli import doubles
from lagcli.equations import power_series
from lagcli.equations.power_series import PowerSeries, SeriesFunction
from lagcli.simulation.closed_contacts import contact_mode
from lagcli.smoothness.sized_function import SizedFunction

pytestmark = pytest.mark.numeric

COUNT = 7
EXPRESSIONS = [
    "x + 2*y - x*y",
    "x/(1 + y)",
    "1/(2 + x)",
    "sqrt(1 + x)",
    "exp(x - y)",
    "log(2 + x)",
    "sin(x)*cos(y)",
    "tan(x)",
    "sinh(x) + cosh(y)",
    "tanh(x)",
    "asin(x/3)",
    "acos(y/3)",
    "atan(x + y)",
    "atan2(x + 1, y)",
    "atan2(y, x + 1)",
    "x**2",
    "(1 + x)**5",
    "(2 + x)**2.5",
    "(2 + x)**(-3)",
    "(1 + x)**20",
    "(x - 3)**20",
]


def series_of(
    expression: ca.SX, symbols: list[ca.SX], arguments: list[list[float]], rounding: float = 1e-14
) -> PowerSeries:
    function = SizedFunction("f", symbols, [ca.densify(expression)])
    given = [[PowerSeries(np.array(a), np.abs(a))] for a in arguments]
    return SeriesFunction(function).at(given, COUNT, rounding)[0][0]


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_coefficients_are_those_of_the_expansion(text: str) -> None:
    t, x, y = sympy.symbols("t x y")
    x_t, y_t = [0.3, -1.0, 0.5, 0.0, 0.25, 0.0, 0.0], [-0.2, 0.7, 0.0, -1.5, 0.0, 0.0, 0.0]
    whole = sympy.sympify(text).subs(
        {
            symbol: sum(sympy.Rational(str(c)) * t**k for k, c in enumerate(given))
            for symbol, given in ((x, x_t), (y, y_t))
        }
    )
    derivative, expected = whole, []
    for k in range(COUNT):
        expected.append(float(derivative.subs(t, 0).evalf(30) / sympy.factorial(k)))
        derivative = derivative.diff(t)
    names = {"x": ca.SX.sym("x"), "y": ca.SX.sym("y")}
    known = (
        "sqrt",
        "exp",
        "log",
        "sin",
        "cos",
        "tan",
        "sinh",
        "cosh",
        "tanh",
        "asin",
        "acos",
        "atan",
        "atan2",
    )
    functions = {name: getattr(ca, name) for name in known}
    value = eval(text, {**functions, **names})
    found = series_of(value, [*names.values()], [x_t, y_t])
    assert found.c == pytest.approx(expected, rel=1e-11, abs=1e-12 * max(map(abs, expected)))
    assert (found.size >= np.abs(found.c) * (1 - 1e-12)).all()


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (ca.fabs, [0, 0, 2, -1]),
        (ca.sign, [-1, 0, 0, 0]),
        (lambda x: ca.fmax(x, 0), [0, 0, 0, 0]),
        (lambda x: ca.fmin(x, 0), [0, 0, -2, 1]),
        (lambda x: ca.if_else(x < 0, 3, x), [3, 0, 0, 0]),
        (lambda x: ca.if_else(x >= 0, 3, x), [0, 0, -2, 1]),
        (lambda x: ca.if_else(ca.logic_and(x < 0, x != 0), 3, x), [3, 0, 0, 0]),
        (lambda x: ca.if_else(ca.logic_not(x <= 0), 3, x), [0, 0, -2, 1]),
    ],
)
def test_the_branch_is_that_of_the_time_just_after(make, expected) -> None:
    x = ca.SX.sym("x")
    found = series_of(make(x), [x], [[0.0, 0.0, -2.0, 1.0]])
    assert list(found.c[:4]) == expected


def test_what_is_not_known_says_nothing() -> None:
    x = ca.SX.sym("x")
    for value in (1 / x, ca.sqrt(x), ca.log(x), ca.asin(1 + x), x**0.5):
        assert series_of(value, [x], [[0.0, 1.0, 0.0]]).known <= 1
    assert series_of(ca.erf(x), [x], [[0.0, 1.0]]) is power_series.NOTHING
    assert series_of(x * x + ca.sin(x), [x], [[0.5, 1.0]]).known == 2


MODEL = """lagcli: 1
particles: {{a: {{mass: 1, position: [0, 0, 0]}}}}
forces: {{load: {{to: a, force: "[0, 0, {}]"}}}}
inequality: {{f: a.z >= 0}}
simulation: {{duration: 1, samples: 3}}
"""


def test_loads_of_a_high_power_decide() -> None:
    """The eleventh power is the last one that does: the twelfth opens the contact."""
    found = lagcli.simulate(lagcli.loads(MODEL.format("-t**11")))
    assert found["lambda.f"] == pytest.approx([0, 0.5**11, 1], abs=1e-12)
    assert not len(found.events["t"])
    try:
        later = lagcli.simulate(lagcli.loads(MODEL.format("-t**12")))
    except lagcli.SimulationStopped:
        return
    assert len(later.events["t"])


@pytest.mark.parametrize(("roundings", "is_none"), [(16, True), (64, False)])
def test_a_coefficient_of_a_few_roundings_is_none(roundings: int, is_none: bool) -> None:
    """Of terms that cancel up to so many roundings of the sum of their sizes."""
    t = ca.SX.sym("t")
    value = (t + 1) * (1 + 2 * roundings * doubles.EPS) - (t + 1)
    found = series_of(value, [t], [[0.0, 1.0, 0.0]])
    room = contact_mode.NONE * found.size
    assert bool(abs(found.c[0]) <= room[0]) == is_none
