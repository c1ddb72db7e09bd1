"""All points of a problem with one coordinate and no rows, by intervals: each has one zero of the force, or none."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from mpmath import iv
from mpmath.libmp import ComplexResult

from lagcli.compiled.program import Program
from lagcli.statics import refine
from lagcli.statics.all_zeros import Completeness
from lagcli.statics.point_search import PointSearch


class BranchingParameters:
    """Numbers of the enclosure of all zeros of one unknown.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

    __slots__ = ()

    most_boxes: int = 4000
    """Intervals that are looked at; where more are left the answer is not known.
    `test_four_thousand_intervals_are_looked_at` fails at 400 and 40000."""
    far: float = 1e6
    """Sizes of things; beyond it the force must be seen to have one sign as far as infinity.
    `test_all_zeros_of_one_unknown_lie_within_a_million_sizes` fails at 100000 and 1e7."""
    digits: int = 20
    """Decimal digits of the intervals: more than a double has, so that roundings are no reason to halve one.
    `test_intervals_have_twenty_digits` fails at 2 and 200."""
    overlap: float = 1e-12
    """Of the two ends of a turn, rad: no zero is lost between them.
    `test_an_interval_of_a_turn_overlaps_itself` fails at 1e-13 and 1e-11."""


PARAMETERS = BranchingParameters()
_FAILURES = (ZeroDivisionError, OverflowError, ValueError, ComplexResult, NotImplementedError)


class NoBounds(Exception):
    """An operation has no bounds here."""


@dataclasses.dataclass(frozen=True, slots=True)
class _Force:
    """The force and its slope by intervals."""

    program: Program
    numbers: tuple[float, ...]

    def __call__(self, x: iv.mpf) -> tuple[iv.mpf, iv.mpf]:
        registers: dict[int, iv.mpf] = {}
        outputs = [iv.mpf(0), iv.mpf(0)]
        for name, out, ins, value in self.program.steps:
            if name == "output":
                if out[0] == 0:
                    outputs[out[1]] = registers[ins[0]]
            elif name == "input":
                registers[out[0]] = x if ins[0] == 0 else iv.mpf(self.numbers[ins[1]])
            elif name == "const":
                registers[out[0]] = iv.mpf(value)
            else:
                try:
                    registers[out[0]] = _bounds(name, [registers[i] for i in ins])
                except _FAILURES as error:
                    raise NoBounds(name) from error
        return outputs[0], outputs[1]


def _quotient(a: iv.mpf, b: iv.mpf) -> iv.mpf:
    if 0 in b:
        raise NoBounds("div")
    return a / b


def _root(a: iv.mpf) -> iv.mpf:
    if a.a < 0:
        raise NoBounds("sqrt")
    return iv.sqrt(a)


def _logarithm(a: iv.mpf) -> iv.mpf:
    if a.a <= 0:
        raise NoBounds("log")
    return iv.log(a)


def _power(a: iv.mpf, b: iv.mpf) -> iv.mpf:
    if b.a == b.b and float(b.a) == round(float(b.a)):
        exponent = int(float(b.a))
        return a**exponent if exponent >= 0 else _quotient(iv.mpf(1), a**-exponent)
    return iv.exp(b * _logarithm(a))


_ONE: dict[str, Callable[[iv.mpf], iv.mpf]] = {
    "neg": lambda a: -a,
    "sq": lambda a: a**2,
    "twice": lambda a: 2 * a,
    "assign": lambda a: a,
    "inv": lambda a: _quotient(iv.mpf(1), a),
    "sqrt": _root,
    "log": _logarithm,
    "exp": iv.exp,
    "sin": iv.sin,
    "cos": iv.cos,
    "tan": lambda a: _quotient(iv.sin(a), iv.cos(a)),
    "sinh": lambda a: (iv.exp(a) - iv.exp(-a)) / 2,
    "cosh": lambda a: (iv.exp(a) + iv.exp(-a)) / 2,
    "tanh": lambda a: 1 - 2 / (iv.exp(2 * a) + 1),
}
_TWO: dict[str, Callable[[iv.mpf, iv.mpf], iv.mpf]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": _quotient,
    "pow": _power,
    "constpow": _power,
}


def _bounds(name: str, given: list[iv.mpf]) -> iv.mpf:
    if name in _ONE:
        return _ONE[name](given[0])
    if name in _TWO:
        return _TWO[name](given[0], given[1])
    raise NoBounds(name)


def complete(search: PointSearch, is_angle: bool) -> Completeness:
    """Add the points that a search has missed to it, and return whether all are known."""
    problem = search.problem
    if len(problem.times) > 1:
        return Completeness(False, "the equations hold t")
    force = _Force(problem.slope_program(), (problem.t, *problem.p.tolist()))
    digits = iv.dps
    iv.dps = PARAMETERS.digits
    try:
        zeros = _isolated(force, search, is_angle)
    except NoBounds as why:
        return Completeness(False, f"there are no bounds of `{why}`")
    finally:
        iv.dps = digits
    if zeros is None:
        return Completeness(False, "intervals do not tell all zeros apart")
    for low, high in zeros:
        middle = np.array([(low + high) / 2])
        if not any(_inside(search, float(one.point.q[0]), low, high) for one in search.points):
            search.take(refine.reached(problem, middle, (), search.scales))
        if not any(_inside(search, float(one.point.q[0]), low, high) for one in search.points):
            return Completeness(False, "a zero could not be refined")
    return Completeness(len(zeros) == len(search.points), "intervals and the search disagree")


def _inside(search: PointSearch, x: float, low: float, high: float) -> bool:
    turns = (-2 * np.pi, 0.0, 2 * np.pi) if search.options.angles[0] else (0.0,)
    near = 1e-9 * (1 + abs(x))
    return any(low - near <= x + turn <= high + near for turn in turns)


def _isolated(force: _Force, search: PointSearch, is_angle: bool) -> list[tuple[float, float]] | None:
    """Intervals that hold one zero each, all together all of them; None where some cannot be told apart."""
    interval = _enclosing_interval(force, search, is_angle)
    if interval is None:
        return None
    waiting = [interval]
    found: list[tuple[float, float]] = []
    for _ in range(PARAMETERS.most_boxes):
        if not waiting:
            return found
        low, high = waiting.pop()
        value, slope = force(iv.mpf([low, high]))
        if 0 not in value:
            continue
        if 0 not in slope:
            ends = [force(iv.mpf(x))[0] for x in (low, high)]
            if any(0 in end for end in ends):
                return None
            if (ends[0].a > 0) != (ends[1].a > 0):
                found.append((low, high))
            continue
        middle = low + (high - low) * 0.4871
        if not low < middle < high or high - low < 1e-9 * (1 + abs(low)):
            return None
        waiting += [(low, middle), (middle, high)]
    return None


def _enclosing_interval(force: _Force, search: PointSearch, is_angle: bool) -> tuple[float, float] | None:
    """An interval that holds all zeros: a whole turn, or as far as the force has no zero beyond."""
    if is_angle:
        # The ends lie at no point where a zero is likely.
        return -np.pi + 0.0123 - PARAMETERS.overlap, np.pi + 0.0123 + PARAMETERS.overlap
    far = PARAMETERS.far * search.scales.length
    for end, tail in ((far, iv.mpf([far, "inf"])), (-far, iv.mpf(["-inf", -far]))):
        if not _has_no_zero(force, end, tail):
            return None
    return -far, far


def _has_no_zero(force: _Force, end: float, tail: iv.mpf) -> bool:
    """True if the force has one sign beyond an end: by its bounds, or as it grows away from zero there."""
    value, slope = force(tail)
    if _is_determined(value):
        return True
    at_end = force(iv.mpf(end))[0]
    if not _is_determined(at_end) or not _is_determined(slope):
        return False
    return bool((slope.a > 0) == ((at_end.a > 0) == (end > 0)))


def _is_determined(value: iv.mpf) -> bool:
    return bool(value.a == value.a and value.b == value.b and 0 not in value)
