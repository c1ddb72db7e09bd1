"""Bounds of an expression over all real values of its symbols: what lies above or below zero never vanishes."""

from __future__ import annotations

import math

import sympy

from lagcli.expression import intervals
from lagcli.expression.intervals import Ends
from lagcli.pfaffian.exact import operations

# A sum of doubles of size 1 is off by less than this.
# `tests/unit/test_special_points.py::test_what_keeps_off_zero_by_more_than_round_off_never_vanishes` fails at 1e-10 and
# at 1e-8.
MARGIN = 1e-9


def never_vanishes(expression: sympy.Expr) -> bool:
    """True if an expression of real symbols is certainly other than zero wherever it has a value."""
    if expression.is_positive or expression.is_negative or isinstance(expression, sympy.exp):
        return True
    low, high = operations.folded(expression, _leaf, intervals.FLOATS.result, {})
    return bool(low > MARGIN or high < -MARGIN)


def _leaf(e: sympy.Basic) -> Ends:
    number = float(e) if isinstance(e, (sympy.Number, sympy.NumberSymbol)) else None
    return (-math.inf, math.inf) if number is None else (number, number)
