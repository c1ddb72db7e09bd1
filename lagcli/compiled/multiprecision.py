"""Expanded functions in many digits, with derivatives along directions that are functions themselves.

A number is a `Decimal`, or (tag, value, change): value + change * eps with eps**2 = 0, where eps belongs to the
tag and both parts are numbers of lower tags. So derivatives nest, and what does not change stays short.
"""

from __future__ import annotations

import decimal
import random
from collections.abc import Callable, Sequence
from decimal import Decimal
from functools import lru_cache
from typing import Any

from lagcli.compiled.program import Program

Number = Any  # Decimal or (int, Number, Number)

ZERO, ONE, TWO = Decimal(0), Decimal(1), Decimal(2)
# Numbers that were computed in doubles may be off by less than this.
PERTURBATION = Decimal("1e-13")


class Unknown(Exception):
    """A function that is not known in many digits."""


class NotFinite(Exception):
    """A value is not a finite real number."""


def decimal_of(value: float) -> Decimal:
    """The shortest decimal that stands for a double: the one a person wrote."""
    return Decimal(repr(value))


@lru_cache(maxsize=4096)
def perturbed(value: Decimal, least: Decimal = ZERO) -> Decimal:
    """A number moved by about PERTURBATION of its size or of `least`, each another way; an integer is unchanged."""
    if value == value.to_integral_value():
        return value
    return value + PERTURBATION * max(abs(value), least) * Decimal(
        random.Random(str(value)).uniform(0.5, 1.5)
    )


def perturbed_constant(value: float) -> Decimal:
    """A constant of a program, perturbed; a small one may be all that is left of ones of size one."""
    return perturbed(decimal_of(value), ONE)


def require_known(program: Program) -> None:
    """Raise `Unknown` where a program holds a function that is not known here."""
    for name, *_ in program.steps:
        if name not in SLOPES and name not in BINARY and name not in ("input", "output", "const"):
            raise Unknown(name)


def moved(x: Sequence[Number], direction: Sequence[Number], tag: int) -> list[Number]:
    """x + eps direction, with eps of a tag above all others."""
    return [(tag, a, b) if type(b) is tuple or b else a for a, b in zip(x, direction, strict=True)]


def parts(values: Sequence[Number], tag: int) -> tuple[list[Number], list[Number]]:
    """The values, and their changes along eps of the highest tag."""
    found = [a[1:] if type(a) is tuple and a[0] == tag else (a, ZERO) for a in values]
    return [value for value, _ in found], [change for _, change in found]


def run(
    program: Program, inputs: Sequence[Sequence[Number]], read: Callable[[float], Decimal]
) -> list[Number]:
    """The values of a program in the precision of the context; `read` makes a number of a constant.

    Raises `NotFinite`. All functions must be known.
    """
    registers: list[Number] = [ZERO] * program.registers
    results: list[Number] = [ZERO] * program.results
    try:
        for name, out, of, constant in program.steps:
            if name == "input":
                registers[out[0]] = inputs[of[0]][of[1]]
            elif name == "const":
                registers[out[0]] = read(constant)
            elif name == "output":
                if out[0] == 0:
                    results[out[1]] = registers[of[0]]
            elif name in BINARY:
                registers[out[0]] = BINARY[name](registers[of[0]], registers[of[1]])
            else:
                registers[out[0]] = along(name, registers[of[0]])
    except (decimal.InvalidOperation, decimal.Overflow, ZeroDivisionError, OverflowError):
        raise NotFinite from None
    return results


def add(a: Number, b: Number) -> Number:
    """a + b."""
    if type(a) is Decimal:
        if type(b) is Decimal:
            return a + b
        return (b[0], add(a, b[1]), b[2]) if a else b
    if type(b) is Decimal:
        return (a[0], add(a[1], b), a[2]) if b else a
    if a[0] == b[0]:
        return (a[0], add(a[1], b[1]), add(a[2], b[2]))
    if a[0] < b[0]:
        a, b = b, a
    return (a[0], add(a[1], b), a[2])


def negative(a: Number) -> Number:
    """-a."""
    return -a if type(a) is Decimal else (a[0], negative(a[1]), negative(a[2]))


def subtract(a: Number, b: Number) -> Number:
    """a - b."""
    if type(a) is Decimal and type(b) is Decimal:
        return a - b
    return add(a, negative(b))


def multiply(a: Number, b: Number) -> Number:
    """a b."""
    if type(a) is Decimal:
        if type(b) is Decimal:
            return a * b
        return (b[0], multiply(a, b[1]), multiply(a, b[2])) if a else ZERO
    if type(b) is Decimal:
        return (a[0], multiply(a[1], b), multiply(a[2], b)) if b else ZERO
    if a[0] == b[0]:
        return (a[0], multiply(a[1], b[1]), add(multiply(a[1], b[2]), multiply(a[2], b[1])))
    if a[0] < b[0]:
        a, b = b, a
    return (a[0], multiply(a[1], b), multiply(a[2], b))


def along(name: str, a: Number) -> Number:
    """A function of one number."""
    if type(a) is Decimal:
        return PLAIN[name](a) if name in PLAIN else _real(name, a, decimal.getcontext().prec)
    tag, value, change = a
    found = along(name, value)
    changed = multiply(SLOPES[name](value, found), change)
    return (tag, found, changed) if type(changed) is tuple or changed else found


@lru_cache(maxsize=4096)
def _real(name: str, a: Decimal, digits: int) -> Decimal:
    import mpmath  # here, as only such functions need it and every count would load it

    with mpmath.workdps(digits + 5):
        value = getattr(mpmath, name)(mpmath.mpf(str(a)))
        if not isinstance(value, mpmath.mpf):
            raise ZeroDivisionError
        return Decimal(mpmath.nstr(value, digits + 2))


def _real_angle(y: Decimal, x: Decimal, digits: int) -> Decimal:
    import mpmath

    with mpmath.workdps(digits + 5):
        return Decimal(mpmath.nstr(mpmath.atan2(mpmath.mpf(str(y)), mpmath.mpf(str(x))), digits + 2))


def _inverse_root(a: Number) -> Number:
    return along("inv", along("sqrt", a))


def _first(a: Number) -> Decimal:
    """The number without its changes."""
    while type(a) is tuple:
        a = a[1]
    assert isinstance(a, Decimal)
    return a


def _power(a: Number, b: Number) -> Number:
    if type(b) is tuple:
        return along("exp", multiply(b, along("log", a)))
    if type(a) is Decimal:
        return ONE if b == 0 else a**b
    if b == b.to_integral_value() and 0 <= b <= 1:
        return a if b else ONE
    tag, value, change = a
    return (tag, _power(value, b), multiply(multiply(b, _power(value, b - 1)), change))


def _angle(y: Number, x: Number) -> Number:
    if type(y) is Decimal and type(x) is Decimal:
        return _real_angle(y, x, decimal.getcontext().prec)
    tag = max(a[0] for a in (y, x) if type(a) is tuple)
    ((y, x), (dy, dx)) = parts((y, x), tag)
    square = add(multiply(x, x), multiply(y, y))
    change = multiply(subtract(multiply(x, dy), multiply(y, dx)), along("inv", square))
    return (tag, _angle(y, x), change)


def _length(a: Number, b: Number) -> Number:
    return along("sqrt", add(multiply(a, a), multiply(b, b)))


def _where(holds: Callable[[Decimal, Decimal], bool]) -> Callable[[Number, Number], Number]:
    return lambda a, b: Decimal(holds(_first(a), _first(b)))


PLAIN: dict[str, Callable[[Decimal], Decimal]] = {
    "inv": lambda a: ONE / a,
    "sq": lambda a: a * a,
    "twice": lambda a: a + a,
    "assign": lambda a: a,
    "neg": lambda a: -a,
    "sqrt": Decimal.sqrt,
    "exp": Decimal.exp,
    "log": Decimal.ln,
    "fabs": abs,
    "sign": lambda a: Decimal((a > 0) - (a < 0)),
    "not": lambda a: Decimal(a == 0),
}

# The derivative of each function from its argument and its value.
SLOPES: dict[str, Callable[[Number, Number], Number]] = {
    "inv": lambda a, f: negative(multiply(f, f)),
    "sq": lambda a, f: multiply(TWO, a),
    "twice": lambda a, f: TWO,
    "assign": lambda a, f: ONE,
    "neg": lambda a, f: -ONE,
    "sqrt": lambda a, f: along("inv", multiply(TWO, f)),
    "exp": lambda a, f: f,
    "log": lambda a, f: along("inv", a),
    "fabs": lambda a, f: PLAIN["sign"](_first(a)),
    "sign": lambda a, f: ZERO,
    "not": lambda a, f: ZERO,
    "floor": lambda a, f: ZERO,
    "ceil": lambda a, f: ZERO,
    "sin": lambda a, f: along("cos", a),
    "cos": lambda a, f: negative(along("sin", a)),
    "tan": lambda a, f: add(ONE, multiply(f, f)),
    "asin": lambda a, f: _inverse_root(subtract(ONE, multiply(a, a))),
    "acos": lambda a, f: negative(_inverse_root(subtract(ONE, multiply(a, a)))),
    "atan": lambda a, f: along("inv", add(ONE, multiply(a, a))),
    "sinh": lambda a, f: along("cosh", a),
    "cosh": lambda a, f: along("sinh", a),
    "tanh": lambda a, f: subtract(ONE, multiply(f, f)),
    "asinh": lambda a, f: _inverse_root(add(multiply(a, a), ONE)),
    "acosh": lambda a, f: _inverse_root(subtract(multiply(a, a), ONE)),
    "atanh": lambda a, f: along("inv", subtract(ONE, multiply(a, a))),
    "log1p": lambda a, f: along("inv", add(ONE, a)),
    "expm1": lambda a, f: add(f, ONE),
}
BINARY: dict[str, Callable[[Number, Number], Number]] = {
    "add": add,
    "sub": subtract,
    "mul": multiply,
    "div": lambda a, b: multiply(a, along("inv", b)),
    "pow": _power,
    "constpow": _power,
    "atan2": _angle,
    "hypot": _length,
    "fmin": lambda a, b: a if _first(a) <= _first(b) else b,
    "fmax": lambda a, b: a if _first(a) >= _first(b) else b,
    "lt": _where(lambda a, b: a < b),
    "le": _where(lambda a, b: a <= b),
    "eq": _where(lambda a, b: a == b),
    "ne": _where(lambda a, b: a != b),
    "and": _where(lambda a, b: bool(a) and bool(b)),
    "or": _where(lambda a, b: bool(a) or bool(b)),
    "if_else_zero": lambda a, b: b if _first(a) else ZERO,
}
