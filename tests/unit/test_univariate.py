"""Zeros of finite algebras by one unknown: told apart, isolated and with exact signs."""

import math
from fractions import Fraction

import pytest

from lagcli.statics import univariate
from lagcli.statics.univariate import RealRoot, Representation


def representation(*coefficients: int) -> Representation:
    """That of an algebra with one unknown, a root of a monic polynomial."""
    D = len(coefficients) - 1
    rows = [[int(j == i + 1) for j in range(D)] for i in range(D - 1)]
    rows.append([-x for x in coefficients[:0:-1]])
    powers = [[int(j == 0) for j in range(D)]]
    for _ in range(2 * D - 2):
        powers.append(univariate.combined(powers[-1], rows))
    single = []
    for k in range(2 * D - 1):
        M = [univariate.combined(powers[k], [powers[i + j] for j in range(D)]) for i in range(D)]
        single.append(sum(M[i][i] for i in range(D)))
    traces = [[single[i + j] for j in range(D)] for i in range(D)]
    return Representation([(rows, 1)], (traces, 1))


def test_roots_of_any_multiplicity_are_one_zero_each() -> None:
    found = representation(1, -4, 5, -2).roots()  # (t - 1)^2 (t - 2)
    assert len(found) == 2
    assert [root.sign([1, -1]) for root in found] == [0, 1]


def test_a_value_has_sixty_binary_digits_and_zero_is_zero() -> None:
    whole = representation(1, 0, -2, 0)  # t (t^2 - 2)
    roots = whole.roots()
    unknown = whole.of([0, 1, 0])
    low, high = roots[2].enclosure(unknown, 1, 60)
    assert low**2 < 2 < high**2
    assert low / 2**300 <= high - low <= low / 2**60
    assert roots[1].enclosure(unknown, 1, 60) == (0, 0)


@pytest.mark.parametrize(("bits", "is_decided"), [(4000, True), (20000, False)])
def test_a_sign_is_sought_to_sixteen_thousand_binary_digits(bits: int, is_decided: bool) -> None:
    whole = representation(1, 0, -2)
    root = RealRoot(whole, Fraction(1), Fraction(2))
    near = [1 << bits, -math.isqrt(2 << 2 * bits)]
    if is_decided:
        assert root.sign(near) == 1
    else:
        with pytest.raises(univariate.NotCounted):
            root.sign(near)
