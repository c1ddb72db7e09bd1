"""Zeros in many digits, where a curvature vanishes."""

from __future__ import annotations

import decimal
from decimal import Decimal

import casadi as ca
import numpy as np
import pytest

from lagcli.statics import precise_zeros
from lagcli.statics.rest_equations import RestEquations, Scales
from tests.unit.test_numbers_of_statics import Build, problem_of


def equations(build: Build, count: int = 1) -> RestEquations:
    units = np.ones(count)
    return RestEquations(problem_of(build, count), (), Scales(1.0, 1.0, np.ones(0), np.ones(0), units, units))


def test_a_sixth_power_vanishes_in_three_hundred_digits() -> None:
    found = precise_zeros.nearest(equations(lambda q: (q - 0.3) ** 6 / 3), np.array([0.301]))
    assert found is not None
    assert found[0] == 0.3


def test_a_thousand_steps_lead_to_where_a_twelfth_power_vanishes() -> None:
    found = precise_zeros.nearest(equations(lambda q: q**12), np.array([0.05]))
    assert found is not None
    assert abs(found[0]) < 1e-18


@pytest.mark.parametrize(("away", "is_found"), [(0.2, True), (2.0, False)])
def test_a_zero_far_away_is_another_one(away: float, is_found: bool) -> None:
    found = precise_zeros.nearest(equations(lambda q: (q - away) ** 2), np.zeros(1))
    assert (found is not None) == is_found


@pytest.mark.parametrize(("count", "is_found"), [(12, True), (13, False)])
def test_equations_of_twelve_unknowns_have_many_digits(count: int, is_found: bool) -> None:
    found = precise_zeros.nearest(equations(lambda q: ca.sum1(q**4), count), np.full(count, 1e-3))
    assert (found is not None) == is_found


@pytest.mark.parametrize(("curvature", "is_doubtful"), [(5e-4, True), (5e-3, False)])
def test_a_zero_is_doubtful_where_a_curvature_is_a_thousandth(curvature: float, is_doubtful: bool) -> None:
    of = equations(lambda q: q[0] ** 2 / 2 + curvature * q[1] ** 2 / 2, 2)
    assert precise_zeros.is_doubtful(of, np.zeros(2)) is is_doubtful


def test_what_comes_to_no_zero_has_none() -> None:
    assert precise_zeros.nearest(equations(lambda q: q**3 / 3 + 1e-18 * q), np.array([1e-3])) is None


def test_a_continuum_has_a_zero_at_each_of_its_points() -> None:
    at = np.array([0.3, 0.7])
    found = precise_zeros.nearest(equations(lambda q: (q[0] - 2 * q[1] + 1.1) ** 4, 2), at + 1e-4)
    assert found is not None
    assert np.abs(found - at).max() < 1e-3
    assert abs(found[0] - 2 * found[1] + 1.1) < 1e-15


@pytest.mark.parametrize(
    ("of", "expected"),
    [
        (lambda q: q[0] ** 2 - 1e-20 * q[1] ** 2 + 3 * q[0] * q[2], (1, 2, 0)),
        (lambda q: q[0] * q[1] - 2 * q[0] * q[2] + q[1] * q[2] * 1e-20, (2, 1, 0)),
        (lambda q: (q[0] - 2 * q[1]) ** 2 - q[2] ** 2, (1, 1, 1)),
        (lambda q: q[0] ** 2 - q[1] ** 2 + q[2] ** 4, (1, 1, 1)),
    ],
)
def test_a_curvature_of_twenty_digits_less_has_a_sign(of: Build, expected: tuple[int, int, int]) -> None:
    assert precise_zeros.signs(equations(of, 3), np.zeros(3)) == expected


def test_beside_a_degenerate_zero_no_sign_is_told() -> None:
    assert precise_zeros.signs(equations(lambda q: (q - 0.3) ** 4), np.array([0.3 + 1e-6])) is None


def test_a_number_that_nobody_wrote_gives_no_sign() -> None:
    of = lambda q: q**3 / 3 - np.sqrt(2) * q**2 + 2 * q  # noqa: E731
    assert precise_zeros.signs(equations(of), np.array([np.sqrt(2)])) is None


def test_a_quotient_has_the_digits_of_each_arithmetic() -> None:
    for digits in (60, 300):
        with decimal.localcontext(prec=digits):
            assert precise_zeros.number(1 / 3) * 3 == 1 - Decimal(10) ** -digits
