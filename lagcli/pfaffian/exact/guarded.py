"""SymPy's algorithms, with whatever they fail with as one exception: `SympyFailure`.

They give up on input they cannot treat with exceptions of their own, and break down on some with a bare TypeError,
AttributeError or the like from deep inside. Such a failure is told from a slip of ours by the place where it was
raised: in a file of SymPy or mpmath. A wrong call, or a slip in a function of ours that SymPy calls back, passes
as it is.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import sympy
from sympy.polys.polyerrors import BasePolynomialError

from lagcli.pfaffian.exact import sympy_failure
from lagcli.pfaffian.exact.sympy_failure import SympyFailure

P = ParamSpec("P")
T = TypeVar("T")

# What was met, or stands in SymPy's files:
#   solve, integrate, Matrix.exp   NotImplementedError where no algorithm fits (documented)
#   factor_list, Poly, degree,     PolynomialError, PolificationFailed, CoercionFailed, HeuristicGCDFailed
#   gcd, cancel, rem, groebner     (`BasePolynomialError`); ZeroDivisionError for a denominator that vanishes
#   subs, powsimp, integrate       TypeError for a comparison with nan or a complex number; AttributeError, IndexError
#                                  for a special function at a pole
#   Matrix.inv, eigenvects         ValueError for a matrix without inverse (documented), NotImplementedError
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


def call(function: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
    """The value of a function or method of SymPy. Raises `SympyFailure`."""
    try:
        return function(*arguments, **options)
    except _RAISED as error:
        if not sympy_failure.is_theirs(error):
            raise
        raise SympyFailure(f"{function.__name__} failed ({type(error).__name__})") from error


def subs(expression: sympy.Expr, *arguments: object, **options: object) -> sympy.Expr:
    """`expression.subs`, guarded."""
    return call(expression.subs, *arguments, **options)


def _guarded(function: Callable[P, T]) -> Callable[P, T]:
    def guarded(*arguments: P.args, **options: P.kwargs) -> T:
        return call(function, *arguments, **options)

    guarded.__name__ = function.__name__
    return guarded


cancel = _guarded(sympy.cancel)
collect = _guarded(sympy.collect)
degree = _guarded(sympy.degree)
expand = _guarded(sympy.expand)
expand_log = _guarded(sympy.expand_log)
expand_trig = _guarded(sympy.expand_trig)
factor = _guarded(sympy.factor)
factor_list = _guarded(sympy.factor_list)
factor_terms = _guarded(sympy.factor_terms)
gcd = _guarded(sympy.gcd)
groebner = _guarded(sympy.groebner)
integrate = _guarded(sympy.integrate)
lcm = _guarded(sympy.lcm)
lcm_list = _guarded(sympy.lcm_list)
piecewise_fold = _guarded(sympy.piecewise_fold)
poly = _guarded(sympy.Poly)
powdenest = _guarded(sympy.powdenest)
powsimp = _guarded(sympy.powsimp)
radsimp = _guarded(sympy.radsimp)
rem = _guarded(sympy.rem)
simplify = _guarded(sympy.simplify)
solve = _guarded(sympy.solve)
together = _guarded(sympy.together)
trigsimp = _guarded(sympy.trigsimp)
