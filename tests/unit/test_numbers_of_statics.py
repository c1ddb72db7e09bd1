"""The numbers that points of rest are judged by: two inputs beside each, with different answers."""

import math
from collections.abc import Callable
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from sympy.polys.domains import QQ
from sympy.polys.orderings import grevlex
from sympy.polys.rings import PolyElement, PolyRing

from lagcli.compiled import program
from lagcli.statics import algebraic_zeros, newton, point_type, polynomial_equations
from lagcli.statics.polynomial_equations import NotPolynomial, PolynomialEquations

Build = Callable[[ca.SX], ca.SX]


def polynomials(build: Build, count: int) -> PolynomialEquations:
    """The equation build(x) = 0 of so many unknowns."""
    x, p = ca.SX.sym("x", count), ca.SX.sym("p", 0)
    function = ca.Function("exact", [x, p], [ca.densify(build(x))])
    order = polynomial_equations.CountedOrder(2_000_000)
    return polynomial_equations.equations(program.written_out(function), count, np.zeros(0), order)


def ring(count: int) -> PolyRing:
    return PolyRing([f"x{k}" for k in range(count)], QQ, grevlex)


def zeros(*equations: PolyElement) -> int:
    """The number of real zeros of equations in all unknowns of their ring."""
    own = equations[0].ring
    return len(algebraic_zeros.zeros(own, equations, range(len(own.gens))))


def test_twelve_digits_are_written_and_thirteen_are_not() -> None:
    assert polynomial_equations.exact(0.123456789012) == Fraction("0.123456789012")
    with pytest.raises(NotPolynomial):
        polynomial_equations.exact(0.1234567890123)


def test_quotients_are_exact_up_to_a_thousand() -> None:
    assert polynomial_equations.exact(-5 / 997) == Fraction(-5, 997)
    for inexact in (5 / 1009, math.sqrt(2), math.pi, math.exp(-1)):
        with pytest.raises(NotPolynomial):
            polynomial_equations.exact(inexact)


def test_a_rounding_of_a_sum_is_forgiven_and_four_are_not() -> None:
    assert float(polynomial_equations.exact(0.1 + 0.2)) == 0.3
    off = 0.3
    for _ in range(4):
        off = math.nextafter(off, 1.0)
    with pytest.raises(NotPolynomial):
        polynomial_equations.exact(off)


def test_six_turns_of_an_angle_are_a_polynomial_and_seven_are_not() -> None:
    assert polynomials(lambda x: ca.cos(6 * x), 1).equations
    with pytest.raises(NotPolynomial, match="whole angles"):
        polynomials(lambda x: ca.cos(7 * x), 1)


def test_polynomials_have_degree_fourteen_and_four_hundred_terms_at_most() -> None:
    def power(k: int) -> Build:
        def build(x: ca.SX) -> ca.SX:
            found = ca.SX(1)
            for _ in range(k):
                found = found * ca.sum1(x)
            return found

        return build

    assert polynomials(power(14), 1).equations
    assert polynomials(power(11), 4).equations  # 364 terms
    for too_large in ((15, 1), (12, 4)):  # the second has 455 terms
        with pytest.raises(NotPolynomial, match="too large"):
            polynomials(power(too_large[0]), too_large[1])


def test_an_algebra_of_thirty_six_dimensions_is_counted_and_one_of_forty_two_is_not() -> None:
    x, y = ring(2).gens
    assert zeros(x**6 - y, y**6 - 2) == 2
    with pytest.raises(algebraic_zeros.NotCounted, match="too many"):
        zeros(x**7 - y, y**6 - 2)


def test_four_thousand_zeros_are_listed_and_eight_thousand_are_not() -> None:
    assert zeros(*(x**2 - 1 for x in ring(12).gens)) == 4096
    with pytest.raises(algebraic_zeros.NotCounted, match="too many"):
        zeros(*(x**2 - 1 for x in ring(13).gens))


@pytest.mark.parametrize("apart", [3e-7, 3e-8, 1e-30])
def test_zeros_are_told_apart_however_close_they_are(apart: float) -> None:
    (x,) = ring(1).gens
    assert zeros(x * (x - QQ(*apart.as_integer_ratio()))) == 2


@pytest.mark.parametrize(("digits", "is_decided"), [(100, True), (1000, True), (3000, False)])
def test_a_sign_of_two_blocks_is_found_to_a_thousand_digits(digits: int, is_decided: bool) -> None:
    x, y = ring(2).gens
    near = QQ(math.isqrt(2 << 2 * digits), 1 << digits)  # the root of two to so many binary digits
    found = algebraic_zeros.zeros(x.ring, [x**2 - 2, y - near], [0, 1])
    assert len(found) == 2
    if is_decided:
        assert sorted(zero.sign(x - y) for zero in found) == [-1, 1]
    else:
        with pytest.raises(algebraic_zeros.NotCounted, match="sign"):
            [zero.sign(x - y) for zero in found]


def test_zeros_of_a_vanishing_denominator_are_taken_out() -> None:
    x, y = ring(2).gens
    with pytest.raises(algebraic_zeros.NotCounted, match="continuum"):
        algebraic_zeros.zeros(x.ring, [x * y, x * (y - 1) * (x - 3)], [0, 1])
    (left,) = algebraic_zeros.zeros(x.ring, [x * y, x * (y - 1) * (x - 3)], [0, 1], [x])
    assert (left.value(0), left.value(1)) == (3.0, 0.0)


@pytest.mark.parametrize(("angle", "rank"), [(3e-7, 2), (3e-8, 1)])
def test_rows_that_are_almost_parallel_have_rank_one(angle: float, rank: int) -> None:
    assert point_type.unit_rank(np.array([[2.0, 0.0], [1.0, angle]])) == rank


@pytest.mark.parametrize(("angle", "left"), [(1e-8, 0), (1e-10, 1)])
def test_directions_that_rows_leave_are_reported_to_nine_digits(angle: float, left: int) -> None:
    assert point_type.kernel(np.array([[1.0, 0.0], [1.0, angle]])).shape[1] == left


@pytest.mark.parametrize(("tilt", "is_allowed"), [(1e-10, True), (1e-8, False)])
def test_a_direction_on_the_surface_of_contacts_is_allowed_but_for_rounding(
    tilt: float, is_allowed: bool
) -> None:
    """Three walls between which only the direction of x is left, where they do not lean towards each other."""
    walls = np.array([[-tilt, 1.0], [tilt, 1.0], [0.0, -1.0]])
    found = point_type.extremes(np.diag([-1.0, 1.0]), walls)
    assert (found == (-1.0, -1.0)) == is_allowed
    assert (found is None) == (not is_allowed)


@pytest.mark.parametrize(("size", "moves"), [(1e-11, True), (1e-13, False)])
def test_a_slope_below_the_rank_of_rounding_moves_nothing(size: float, moves: bool) -> None:
    def residual(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([x[0] - 1.0, size * (x[1] - 1.0)]), np.diag([1.0, size])

    end = newton.refined(residual, np.zeros(2))
    assert (abs(end.x[1] - 1.0) < 1e-3) == moves
