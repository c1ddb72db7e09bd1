"""SymPy's algorithms, with whatever they fail with as one exception: `SympyFailure`.

They give up on input with exceptions of their own, and break down on some with a bare TypeError or the like. A failure
is told from a slip of ours by the line where it was raised, in a file of SymPy or mpmath: a wrong call, or a slip in a
function of ours that SymPy calls back, passes as it is.
"""

import sys
from collections.abc import Callable
from functools import partial
from typing import ParamSpec, TypeVar

import sympy
from sympy.polys.polyerrors import BasePolynomialError

P = ParamSpec("P")
T = TypeVar("T")

_LIBRARIES = ("sympy", "mpmath")
# What was met, or stands in SymPy's files: NotImplementedError where no algorithm fits; BasePolynomialError, and
# ZeroDivisionError for a denominator that vanishes; TypeError for a comparison with nan or a complex number;
# AttributeError, IndexError for a special function at a pole; ValueError for a matrix without inverse.
_RAISED: tuple[type[Exception], ...] = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    BasePolynomialError,
    LookupError,
    NotImplementedError,
    TypeError,
    ValueError,
)


class NoAnswerError(Exception):
    """A proposal or a test has no answer for its input. That is "none found", never a verdict."""


class SympyFailure(NoAnswerError):
    """SymPy gave up, or broke down, on the input of one call."""


class TooDeep(SympyFailure):
    """An expression is nested too deeply for SymPy, which walks through it by recursion."""


def attempt(work: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
    """The value of a piece of work of ours. Raises `SympyFailure` for what SymPy documents for its polynomials, and for
    the depth of an expression; all else passes as it is, an endless recursion of ours too."""
    try:
        return work(*arguments, **options)
    except (BasePolynomialError, RecursionError) as error:
        if not is_from_sympy(error):
            raise
        kind = TooDeep if isinstance(error, RecursionError) else SympyFailure
        raise kind(f"SymPy failed ({type(error).__name__})") from error


def is_from_sympy(error: BaseException) -> bool:
    """True if an exception comes from SymPy, or from the standard library at its call."""
    trace, last = error.__traceback__, ""
    while trace is not None:
        name = str(trace.tb_frame.f_globals.get("__name__", "")).partition(".")[0]
        if name not in sys.stdlib_module_names:
            last = name
        trace = trace.tb_next
    return last in _LIBRARIES


def call(function: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
    """The value of a function or method of SymPy. Raises `SympyFailure`."""
    try:
        return function(*arguments, **options)
    except _RAISED as error:
        if not is_from_sympy(error):
            raise
        raise SympyFailure(f"{function.__name__} failed ({type(error).__name__})") from error


def subs(expression: sympy.Expr, *arguments: object, **options: object) -> sympy.Expr:
    """`expression.subs`, guarded."""
    return call(expression.subs, *arguments, **options)


def __getattr__(name: str) -> Callable[..., sympy.Basic]:
    """Any other function of SymPy, guarded: `guarded.expand` is `sympy.expand`."""
    if name.startswith("_"):
        raise AttributeError(name)
    return partial(call, getattr(sympy, name))
