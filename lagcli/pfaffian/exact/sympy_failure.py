"""Failures of SymPy, told from slips of ours by the file that raised them."""

import sys
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from sympy.polys.polyerrors import BasePolynomialError

P = ParamSpec("P")
T = TypeVar("T")

_LIBRARIES = ("sympy", "mpmath")


class NoAnswerError(Exception):
    """A proposal or a test has no answer for its input. That is "none found", never a verdict."""


class SympyFailure(NoAnswerError):
    """SymPy gave up, or broke down, on the input of one call."""


class TooDeep(SympyFailure):
    """An expression is nested too deeply for SymPy, which walks through it by recursion."""


def attempt(work: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
    """The value of a piece of work of ours, where its operators alone may fail with what SymPy documents for its
    polynomials, or with the depth of an expression: no guarded call could hold that. Raises `SympyFailure`.

    An endless recursion of ours passes as it is, and so does all else.
    """
    try:
        return work(*arguments, **options)
    except (BasePolynomialError, RecursionError) as error:
        if not is_theirs(error):
            raise
        kind = TooDeep if isinstance(error, RecursionError) else SympyFailure
        raise kind(f"SymPy failed ({type(error).__name__})") from error


def is_theirs(error: BaseException) -> bool:
    """True if an exception comes from SymPy, or from the standard library at its call."""
    trace, last = error.__traceback__, ""
    while trace is not None:
        name = str(trace.tb_frame.f_globals.get("__name__", "")).partition(".")[0]
        if name not in sys.stdlib_module_names:
            last = name
        trace = trace.tb_next
    return last in _LIBRARIES
