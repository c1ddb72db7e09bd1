"""Expanded functions in many digits, with derivatives along directions that are functions themselves. A number is a
`Decimal`, or one that changes; so derivatives nest, and what does not change stays short."""

from __future__ import annotations

import decimal
import functools
import operator
from collections.abc import Callable, Sequence
from decimal import Decimal

from lagcli import memory
from lagcli.compiled.program import Program
from lagcli.expression import functions

ZERO, ONE = Decimal(0), Decimal(1)
# Numbers that were computed in doubles may be off by less than this.
PERTURBATION = Decimal("1e-13")


class Unknown(Exception):
    """A function that is not known in many digits."""


class NotFinite(Exception):
    """A value is not a finite real number."""


def decimal_of(value: float) -> Decimal:
    """The shortest decimal that stands for a double: the one a person wrote."""
    return Decimal(repr(value))


@memory.remembered(4096)
def perturbed(value: Decimal, least: Decimal = ZERO) -> Decimal:
    """A number moved by about PERTURBATION of its size or of `least`, each another way; an integer is unchanged."""
    if value == value.to_integral_value():
        return value
    import random  # here: `dof` and `check` load this module, and few of them perturb a number

    by = Decimal(random.Random(str(value)).uniform(0.5, 1.5))
    return value + PERTURBATION * max(abs(value), least) * by


def perturbed_constant(value: float) -> Decimal:
    """A constant of a program, perturbed; a small one may be all that is left of ones of size one."""
    return perturbed(decimal_of(value), ONE)


def require_known(program: Program) -> None:
    """Raise `Unknown` where a program holds a function that is not known here."""
    known = {*functions.OPERATIONS, *BINARY, "input", "output", "const"}
    for name, *_ in program.steps:
        if name not in known:
            raise Unknown(name)


class Changing:
    """A number value + change eps with eps**2 = 0, where eps belongs to the tag and both parts to lower ones."""

    __slots__ = ("change", "tag", "value")

    def __init__(self, tag: int, value: Number, change: Number) -> None:
        self.tag, self.value, self.change = tag, value, change

    def __add__(self, other: Number) -> Number:
        if isinstance(other, Changing) and other.tag >= self.tag:
            if other.tag == self.tag:
                return Changing(self.tag, self.value + other.value, self.change + other.change)
            self, other = other, self
        return Changing(self.tag, self.value + other, self.change)

    def __mul__(self, other: Number) -> Number:
        if isinstance(other, Changing) and other.tag >= self.tag:
            if other.tag == self.tag:
                change = self.value * other.change + self.change * other.value
                return Changing(self.tag, self.value * other.value, change)
            self, other = other, self
        if not other:
            return ZERO
        return Changing(self.tag, self.value * other, self.change * other)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Changing:
        return Changing(self.tag, -self.value, -self.change)

    def __sub__(self, other: Number) -> Number:
        return self + -other

    def __rsub__(self, other: Number) -> Number:
        return -self + other

    def __truediv__(self, other: Number) -> Number:
        return self * along("inv", other)

    def __rtruediv__(self, other: Number) -> Number:
        return along("inv", self) * other


Number = functions.Number  # Decimal or Changing


def moved(x: Sequence[Number], direction: Sequence[Number], tag: int) -> list[Number]:
    """x + eps direction, with eps of a tag above all others."""
    return [Changing(tag, a, b) if b else a for a, b in zip(x, direction, strict=True)]


def parts(values: Sequence[Number], tag: int) -> tuple[list[Number], list[Number]]:
    """The values, and their changes along eps of the highest tag."""
    found = [(a.value, a.change) if isinstance(a, Changing) and a.tag == tag else (a, ZERO) for a in values]
    return [value for value, _ in found], [change for _, change in found]


def run(
    program: Program, inputs: Sequence[Sequence[Number]], read: Callable[[float], Decimal]
) -> list[Number]:
    """The values of a program in the precision of the context; `read` makes a number of a constant. Raises `NotFinite`.
    All functions must be known."""
    try:
        return program.run(inputs, read, along)
    except (decimal.InvalidOperation, decimal.Overflow, ZeroDivisionError, OverflowError):
        raise NotFinite from None


def along(name: str, a: Number, b: Number = None) -> Number:
    """A function of one number, or of two."""
    if b is not None:
        return BINARY[name](a, b)
    if isinstance(a, Changing):
        found = along(name, a.value)
        changed = functions.OPERATIONS[name][1](_Functions, a.value, found) * a.change
        return Changing(a.tag, found, changed) if changed else found
    return PLAIN[name](a) if name in PLAIN else _real(name, a, decimal.getcontext().prec)


class _Functions:
    """The functions that slopes are made of."""

    sin, cos, sinh, cosh, sqrt = (
        functools.partial(along, name) for name in ("sin", "cos", "sinh", "cosh", "sqrt")
    )

    @staticmethod
    def sign(a: Number) -> Decimal:
        return Decimal(PLAIN["sign"](_first(a)))


@memory.remembered(4096)
def _real(name: str, a: Decimal, digits: int) -> Decimal:
    import mpmath  # here, as only such functions need it and every count would load it

    with mpmath.workdps(digits + 5):
        value = getattr(mpmath, name)(mpmath.mpf(str(a)))
        if not isinstance(value, mpmath.mpf):
            raise ZeroDivisionError
        return Decimal(mpmath.nstr(value, digits + 2))


def _first(a: Number) -> Decimal:
    """The number without its changes."""
    while isinstance(a, Changing):
        a = a.value
    assert isinstance(a, Decimal)
    return a


def _power(a: Number, b: Number) -> Number:
    if isinstance(b, Changing):
        return along("exp", b * along("log", a))
    if isinstance(a, Decimal):
        return ONE if b == 0 else a**b
    if b == b.to_integral_value() and 0 <= b <= 1:
        return a if b else ONE
    return Changing(a.tag, _power(a.value, b), b * _power(a.value, b - 1) * a.change)


def _angle(y: Number, x: Number) -> Number:
    if isinstance(y, Decimal) and isinstance(x, Decimal):
        import mpmath  # here, as for `_real`

        digits = decimal.getcontext().prec
        with mpmath.workdps(digits + 5):
            angle = mpmath.atan2(mpmath.mpf(str(y)), mpmath.mpf(str(x)))
            return Decimal(mpmath.nstr(angle, digits + 2))
    tag = max(a.tag for a in (y, x) if isinstance(a, Changing))
    ((y, x), (dy, dx)) = parts((y, x), tag)
    return Changing(tag, _angle(y, x), (x * dy - y * dx) / (x * x + y * y))


def _where(holds: Callable[[Decimal, Decimal], bool]) -> Callable[[Number, Number], Number]:
    return lambda a, b: Decimal(holds(_first(a), _first(b)))


PLAIN: dict[str, Callable[..., Number]] = {
    **{name: functions.OPERATIONS[name][0] for name in ("inv", "sq", "twice", "assign", "neg", "fabs")},
    "sqrt": Decimal.sqrt,
    "exp": Decimal.exp,
    "log": Decimal.ln,
    "sign": lambda a: Decimal((a > 0) - (a < 0)),
    "not": lambda a: Decimal(a == 0),
}

BINARY: dict[str, Callable[[Number, Number], Number]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "pow": _power,
    "constpow": _power,
    "atan2": _angle,
    "hypot": lambda a, b: along("sqrt", a * a + b * b),
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
