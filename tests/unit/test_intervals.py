"""Ranges of operations hold the truth, in every kind of numbers: that of random trees in fifty digits."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import casadi as ca
import mpmath
import numpy as np
import pytest
from mpmath import iv

from lagcli.compiled import contact_values
from lagcli.expression import enclosures, functions, intervals
from lagcli.expression.enclosures import NoBounds
from lagcli.smoothness.sized_function import SizedFunction

Step = tuple[str, tuple[int, ...]]
ONE = ("neg sq twice inv assign sqrt exp log sin cos tan asin acos atan sinh cosh tanh fabs sign").split()
TWO = "add sub mul div fmin fmax atan2 pow".split()
TRUTH: dict[str, Callable[..., mpmath.mpf]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "sq": lambda a: a * a,
    "twice": lambda a: 2 * a,
    "inv": lambda a: 1 / a,
    "assign": lambda a: a,
    "fabs": abs,
    "fmin": min,
    "fmax": max,
    "pow": lambda a, b: a**b,
}
# Parts of a box, the two constants that a tree may hold, and the box itself.
PARTS = [0.0, 0.25, 0.5, 0.8125, 1.0]


def tree(seed: int) -> list[Step]:
    """Steps on two values of a box and four constants, each on those before it."""
    choice = random.Random(seed)
    steps: list[Step] = []
    for count in range(6, 16):
        names = ONE if choice.random() < 0.5 else TWO
        name = choice.choice(names)
        of = tuple(choice.randrange(count) for _ in range(1 if names is ONE else 2))
        if name == "pow" and choice.random() < 0.8:
            of = of[0], choice.randrange(2, 6)
        steps.append((name, of))
    return steps


CONSTANTS = (2.0, 3.0, 0.5, -1.0)


def box(seed: int) -> list[tuple[float, float]]:
    choice = random.Random(seed + 1000)
    ends = [sorted(choice.choice([0.0, 1.0, -1.0, choice.uniform(-4, 4)]) for _ in "ab") for _ in "xy"]
    return [(low, high) for low, high in ends]


def truth(steps: list[Step], x: list[mpmath.mpf]) -> list[mpmath.mpf | None]:
    """The values of all steps, None where there is none."""
    values: list[mpmath.mpf | None] = [*x, *map(mpmath.mpf, CONSTANTS)]
    for name, of in steps:
        parts = [values[k] for k in of]
        try:
            value = None if None in parts else TRUTH.get(name, getattr(mpmath, name, None))(*parts)
        except (ZeroDivisionError, OverflowError, ValueError):
            value = None
        values.append(value if isinstance(value, mpmath.mpf) and mpmath.isfinite(value) else None)
    return values


def points(seed: int) -> list[list[mpmath.mpf | None]]:
    """The truth of a tree at points of its box."""
    with mpmath.workdps(50):
        (a, b), (c, d) = ((mpmath.mpf(low), mpmath.mpf(high)) for low, high in box(seed))
        places = [[a + (b - a) * s, c + (d - c) * r] for s in PARTS for r in PARTS]
        return [truth(tree(seed), x) for x in places]


def floats(seed: int) -> list[tuple[float, float]]:
    known = [*box(seed), *((c, c) for c in CONSTANTS)]
    for name, of in tree(seed):
        known.append(intervals.FLOATS.result(name, *(known[k] for k in of)))
    return known


def arrays(seed: int) -> list[tuple[float, float]]:
    known = [(np.array([[low]]), np.array([[high]])) for low, high in box(seed)]
    known += [intervals.constant(c) for c in CONSTANTS]
    for name, of in tree(seed):
        known.append(intervals.ARRAYS.result(name, *(known[k] for k in of)))
    return [(float(np.ravel(low)[0]), float(np.ravel(high)[0])) for low, high in known]


def expressions(seed: int) -> list[tuple[float, float]]:
    given = ca.SX.sym("x", 4)
    graph, known = contact_values._GraphIntervals(), [(given[0], given[1]), (given[2], given[3])]
    known += [(ca.SX(c), ca.SX(c)) for c in CONSTANTS]
    for name, of in tree(seed):
        known.append(graph.result(name, *(known[k] for k in of)))
    column = ca.vertcat(*(ca.densify(end) for ends in known for end in ends))
    found = np.array(SizedFunction("ranges", [given], [column])(np.ravel(box(seed)))).reshape(-1, 2)
    return [(low, high) for low, high in found.tolist()]


@pytest.mark.parametrize("kind", [floats, arrays, expressions])
def test_ranges_hold_the_truth(kind: Callable[[int], list[tuple[float, float]]]) -> None:
    """Those of expressions are not rounded outwards: their roundings are counted elsewhere."""
    off = 1e-12 if kind is expressions else 0.0
    for seed in range(60):
        ranges = kind(seed)
        for values in points(seed):
            for (low, high), value in zip(ranges, values, strict=True):
                if value is not None:
                    assert not value < low - off * max(1, abs(low)), (seed, value, low)
                    assert not value > high + off * max(1, abs(high)), (seed, value, high)


def test_enclosures_hold_the_truth_or_say_that_they_know_none() -> None:
    known_ones = 0
    for seed in range(60):
        known: list[object] = [iv.mpf(list(ends)) for ends in box(seed)] + [iv.mpf(c) for c in CONSTANTS]
        for name, of in tree(seed):
            try:
                known.append(enclosures.result(iv, name, *(known[k] for k in of)))
            except NoBounds:
                break
        known_ones += len(known)
        for values in points(seed):
            for interval, value in zip(known, values, strict=False):
                assert value is None or value in interval, seed
    assert known_ones > 600


@pytest.mark.parametrize("name", functions.BY_OPERATION)
def test_every_function_of_the_language_has_a_rule(name: str) -> None:
    row = functions.BY_OPERATION[name]
    parts = [(0.25, 0.5)] * (row.arguments or 2)
    low, high = intervals.FLOATS.result(name, *parts)
    assert -math.inf < low <= row.value(*(0.375 for _ in parts)) <= high < math.inf


def test_what_is_not_known_has_any_value() -> None:
    assert intervals.FLOATS.result("erf", (0.0, 1.0)) == (-math.inf, math.inf)


@pytest.mark.parametrize(
    ("name", "parts", "wanted"),
    [
        ("div", [(1.0, 1.0), (0.0, 2.0)], (0.5, math.inf)),
        ("div", [(1.0, 1.0), (-2.0, 0.0)], (-math.inf, -0.5)),
        ("mul", [(0.0, 0.0), (-math.inf, math.inf)], (0.0, 0.0)),
        ("sq", [(-3.0, 2.0)], (0.0, 9.0)),
        ("fmin", [(-math.inf, math.inf), (0.0, 3.0)], (-math.inf, 3.0)),
    ],
)
def test_ranges_of_floats_are_as_narrow_as_can_be(
    name: str, parts: list[tuple[float, float]], wanted: tuple[float, float]
) -> None:
    np.testing.assert_allclose(intervals.FLOATS.result(name, *parts), wanted, rtol=1e-14)


def test_of_a_gap_beside_a_pole_nothing_is_known() -> None:
    """Whatever else stands in the least of several."""
    graph, x = contact_values._GraphIntervals(), ca.SX.sym("x", 2)
    inverse = graph.result("inv", (x[0], x[1]))
    least = graph.result("fmin", inverse, (ca.SX(3), ca.SX(3)))
    bounds = SizedFunction("least", [x], [ca.densify(ca.vertcat(*least))])
    assert float(np.array(bounds([-1.0, 1.0])).ravel()[0]) < -1e9


def test_of_two_enclosures_the_least_is_chosen_in_any_order() -> None:
    two, three = iv.mpf(2), iv.mpf(3)
    for parts in ([two, three], [three, two]):
        assert 2 in enclosures.result(iv, "fmin", *parts)
        assert 3 in enclosures.result(iv, "fmax", *parts)
