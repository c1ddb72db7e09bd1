"""Bounds of an expression over all real values of its symbols: what lies above or below zero never vanishes."""

from __future__ import annotations

import math

import sympy

from lagcli import doubles
from lagcli.expression import intervals
from lagcli.expression.intervals import Ends
from lagcli.pfaffian.exact import operations


def never_vanishes(expression: sympy.Expr) -> bool:
    """True if an expression of real symbols is certainly other than zero wherever it has a value."""
    if expression.is_positive or expression.is_negative or isinstance(expression, sympy.exp):
        return True
    low, high = operations.folded(expression, _leaf, intervals.FLOATS.result, {})
    return bool(low > doubles.ZERO or high < -doubles.ZERO)


def _leaf(e: sympy.Basic) -> Ends:
    number = float(e) if isinstance(e, (sympy.Number, sympy.NumberSymbol)) else None
    return (-math.inf, math.inf) if number is None else (number, number)
