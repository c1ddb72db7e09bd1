"""What exact algebra reads of a model, and what it refuses because no time limit would hold in it."""

from __future__ import annotations

import pytest
import sympy

import lagcli
from lagcli.expression import evaluate, parser
from lagcli.pfaffian.forms import notation
from lagcli.pfaffian.forms.notation import SympyAlgebra, TooLarge

HEAD = """\
lagcli: 1
coordinates:
  x: {value: 1}
  y: {value: 1}
  z: {value: 0.5}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2
differential:
"""
x = sympy.Symbol("x", real=True)


def value(text: str) -> sympy.Expr:
    """A formula of numbers in exact algebra."""
    return evaluate.scalar(parser.parse(text), SympyAlgebra())


def verdict(row: str, limit: float = 60.0) -> str:
    """That of one differential row."""
    found = lagcli.check(lagcli.loads(f'{HEAD}  row: "{row}"\n'), limit=limit)
    return found.constraints[0].verdict.kind


def test_a_formula_of_many_terms_is_refused():
    notation.require_short(parser.parse(" + ".join(["1"] * 1000)))
    with pytest.raises(TooLarge, match="terms"):
        notation.require_short(parser.parse(" + ".join(["1"] * 5000)))


def test_a_number_of_many_digits_is_refused():
    assert value("1." + "3" * 290) > 1
    with pytest.raises(TooLarge, match="digits"):
        value("1." + "3" * 310)


def test_a_large_power_is_refused():
    assert value("2**190") == 2**190
    assert notation.require_small(x**190, 10) == x**190
    with pytest.raises(TooLarge, match="exponent"):
        value("2**210")
    with pytest.raises(TooLarge, match="exponent"):
        notation.require_small(x**210, 10)


def test_a_power_of_a_long_number_is_refused():
    """10^11/10^5 has 12 digits and 6: its powers up to 66 have 1200."""
    assert value("100001.00001**60") > 1
    with pytest.raises(TooLarge, match="digits"):
        value("100001.00001**90")


def test_numbers_that_grow_in_a_sum_or_product_are_refused():
    long = sympy.Rational(10) ** 1100 + 1
    assert notation.require_small(long * x, 10) == long * x
    with pytest.raises(TooLarge, match="digits"):
        notation.require_small(long**2 * x, 10)


def test_powers_of_powers_of_numbers_end_in_a_verdict():
    """Exactly the first has twenty million digits, with which nothing can be interrupted; the others have some
    thousands, of which Python writes none and SymPy seeks prime factors."""
    assert verdict("((1.00001**200)**200)**200*d(x) + y*d(z) = 0") == "nonholonomic"
    assert verdict("(1.00001**200)**10*d(x) + y*d(z) = 0") == "nonholonomic"
    assert verdict("(1.00001**200)**10*d(x) + y*d(y) = 0") != "nonholonomic"
