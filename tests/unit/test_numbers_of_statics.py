"""The numbers that points of rest are judged by: two inputs beside each, with different answers."""

import math
from collections.abc import Callable
from fractions import Fraction
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from sympy.polys.domains import QQ
from sympy.polys.orderings import grevlex
from sympy.polys.rings import PolyElement, PolyRing

from lagcli.compiled import program
from lagcli.equations.power_series import PowerSeries, SeriesFunction, UnderflowError
from lagcli.statics import (
    algebraic_zeros,
    flat_directions,
    kink_points,
    point_type,
    polynomial_equations,
    power_signs,
    precise_zeros,
)
from lagcli.statics.flat_directions import FlatEquations, FlatVerdict
from lagcli.statics.polynomial_equations import NotPolynomial, PolynomialEquations
from lagcli.statics.rest_equations import EquilibriumPoint, RestEquations, Scales
from lagcli.statics.static_problem import StaticLaws, StaticProblem

Build = Callable[[ca.SX], ca.SX]


def polynomials(build: Build, count: int) -> PolynomialEquations:
    """The equation build(x) = 0 of so many unknowns."""
    x, p = ca.SX.sym("x", count), ca.SX.sym("p", 0)
    function = ca.Function("exact", [x, p], [ca.densify(build(x))])
    order = polynomial_equations.CountedOrder(2_000_000)
    return polynomial_equations.equations(program.written_out(function), count, [], order)


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


@pytest.mark.parametrize(("tilt", "is_allowed"), [(3e-8, True), (3e-7, False)])
def test_a_direction_on_the_surface_of_contacts_is_allowed_but_for_rounding(
    tilt: float, is_allowed: bool
) -> None:
    """Three walls between which only the direction of x is left, where they do not lean towards each other."""
    walls = np.array([[-tilt, 1.0], [tilt, 1.0], [0.0, -1.0]])
    found = point_type.kind_on_cone(np.diag([-1.0, 1.0]), walls, (1, 1), (False, False))
    assert found == (("maximum", 1) if is_allowed else ("isolated", 0))


# Flat directions, and kinks


def problem_of(build: Build, count: int, forces: Build | None = None) -> StaticProblem:
    """The points of build(q) where no row is; forces: instead of its gradient."""
    q, t, p = ca.SX.sym("q", count), ca.SX.sym("t"), ca.SX.sym("p", 0)
    f = ca.SX(build(q))
    F = -ca.gradient(f, q) if forces is None else ca.SX(forces(q))
    nothing, no_rows = ca.SX(0, 1), ca.SX(0, count)
    laws = StaticLaws(
        t, q, p, ca.densify(F), no_rows, nothing, nothing, no_rows, f, ca.SX.zeros(count), nothing, ""
    )
    return StaticProblem(laws, np.zeros(0), (0.0, np.ones(count)), 1.0)


UNITS = Scales(1.0, 1.0, np.ones(0), np.ones(0), np.ones(1), np.ones(1))


def flat_verdict(
    build: Build, *at: float, forces: Build | None = None, is_exact: bool = False
) -> FlatVerdict:
    equations, n = RestEquations(problem_of(build, len(at), forces), (), UNITS), len(at)
    point = EquilibriumPoint(np.array(at), np.zeros(0), (), 0.0)
    return flat_directions.judged(equations, point, (np.eye(n), np.zeros((n, 0))), is_exact)


def test_a_power_of_sixteen_decides_and_one_of_seventeen_does_not() -> None:
    assert flat_verdict(lambda q: q**16, 0.0).order == 16
    assert flat_verdict(lambda q: q**17, 0.0).order == 0


@pytest.mark.parametrize(("part", "flat"), [(2e-13, 0), (6e-15, 1)])
def test_a_coefficient_of_sixty_roundings_is_none(part: float, flat: int) -> None:
    assert flat_verdict(lambda q: q**2, 0.0, forces=lambda q: q - (1 - part) * q).flat == flat


def test_a_point_is_moved_to_where_derivatives_vanish() -> None:
    assert abs(flat_verdict(lambda q: (q - 1) ** 3, 1 + 1e-6).point.q[0] - 1) < 1e-15


@pytest.mark.parametrize(("off", "order"), [(5e-3, 3), (0.05, 0)])
def test_a_point_is_not_moved_by_more_than_a_hundredth(off: float, order: int) -> None:
    assert flat_verdict(lambda q: q**3, off).order == order


@pytest.mark.parametrize(("power", "order"), [(8, 8), (10, 0)])
def test_an_eighth_power_of_four_is_told_and_a_tenth_is_not(power: int, order: int) -> None:
    found = flat_verdict(lambda q: ca.sum1(q**power), *np.zeros(4), is_exact=True)
    assert (found.order, found.is_strict) == (order, order > 0)


@pytest.mark.parametrize(("mixed", "is_strict"), [(-1.99999, True), (-2.0, False)])
def test_a_form_of_three_is_definite_where_its_least_is_a_part_of_its_largest(
    mixed: float, is_strict: bool
) -> None:
    x, y, z = rays = np.random.default_rng(1).standard_normal((3, 40))
    form = x**4 + y**4 + z**4 + mixed * (x * y) ** 2
    found = power_signs.of_powers(rays.T, np.column_stack([0 * form] * 3 + [form]), np.zeros((40, 4)), 4)[0]
    assert (found.rises, found.falls, found.is_decided) == (True, False, is_strict)


@pytest.mark.parametrize("offset", [0.0, 5e-5, 2e-4, 1e-3, 0.02])
def test_the_power_of_a_line_that_lies_on_no_ray_loses_no_sign_to_rounding(offset: float) -> None:
    """(u - s**2)**4 + s**6 with u and s turned against the rays: its small terms beside s = 0 are not its signs."""
    angles = np.pi * np.arange(32) / 32
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    turned = angles[9] + offset
    u, s = rays @ [np.cos(turned), np.sin(turned)], rays @ [-np.sin(turned), np.cos(turned)]
    powers = [u**4, -4 * u**3 * s**2, 6 * u**2 * s**4 + s**6, -4 * u * s**6, s**8]
    forms = np.column_stack([0 * u, 0 * u, 0 * u, *powers])
    noise = 1e-13 * np.random.default_rng(0).standard_normal(forms.shape)
    for side in power_signs.of_powers(rays, forms + noise, np.full(forms.shape, 1e-12), 4):
        assert (side.rises, side.falls, side.is_decided) == (True, False, True)


@pytest.mark.parametrize(("part", "is_clear"), [(1e-14, False), (2e-13, True)])
def test_a_branch_is_zero_within_sixty_roundings(part: float, is_clear: bool) -> None:
    square = {(0, 2): 1.0, (1, 1): -2.0, (2, 0): 1.0 + part}  # (b - a)^2 with b = a + b'
    terms = {(Fraction(i), j): (value, 0.0) for (i, j), value in square.items()}
    value, rounding = power_signs._shifted(terms, 1.0, Fraction(1))[Fraction(2), 0]
    assert (abs(value) > rounding) is is_clear


@pytest.mark.parametrize(("part", "is_kept"), [(0.05, True), (0.3, False)])
def test_a_curvature_beside_a_double_zero_is_none(part: float, is_kept: bool) -> None:
    verdict = flat_verdict(lambda q: part / 1.5 * q + q**2 + q**3, 0.0)
    assert (verdict.up, verdict.flat) == ((1, 0) if is_kept else (0, 1))


@pytest.mark.parametrize(("stiffness", "orders"), [((1.0, -2.0, 3.0), 3), ((0.0, -2.0, 3.0), 8)])
def test_directions_that_have_curvatures_are_not_asked_for_higher_powers(
    stiffness: tuple[float, ...], orders: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor are those beside one that has none: this alone is looked at with all powers."""
    asked: list[tuple[int, int]] = []
    expanded = FlatEquations.expanded

    def counted(self: FlatEquations, x: np.ndarray, rays: np.ndarray, orders: int):
        asked.append((orders, rays.shape[1]))
        return expanded(self, x, rays, orders)

    monkeypatch.setattr(FlatEquations, "expanded", counted)
    verdict = flat_verdict(
        lambda q: sum(k * q[i] ** 2 for i, k in enumerate(stiffness)) + q[0] ** 4, 0.0, 0.0, 0.0
    )
    assert (verdict.up, verdict.down) == (sum(k > 0 for k in stiffness), 1)
    assert max(asked)[0] == orders
    assert {k for orders, k in asked if orders > 3} <= {1}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("part", "is_decided"), [(0.0, False), (1e-14, False), (1.0, True)])
def test_a_form_of_three_that_rounding_alone_holds_one_of_is_not_definite(
    seed: int, part: float, is_decided: bool
) -> None:
    """x^4 + y^4 + part z^4: where z is rounding the form is zero along it, and the next one decides."""
    rays = np.random.default_rng(seed).standard_normal((64, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    forms = np.zeros((64, 4))
    forms[:, 3] = rays[:, 0] ** 4 + rays[:, 1] ** 4 + part * rays[:, 2] ** 4
    above, below = power_signs.of_powers(rays, forms, np.full((64, 4), 1e-13), 4)
    assert (above.rises, above.falls, above.is_decided) == (True, False, is_decided)
    assert below == above


@pytest.fixture
def doubted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many directions are looked at again, for each point."""
    counts: list[int] = []

    def judged(
        equations: RestEquations,
        point: EquilibriumPoint,
        directions: tuple[np.ndarray, np.ndarray],
        is_exact: bool,
    ) -> FlatVerdict:
        counts.append(directions[0].shape[1])
        return FlatVerdict(point, directions[0].shape[1], 0)

    monkeypatch.setattr(flat_directions, "judged", judged)
    monkeypatch.setattr(precise_zeros, "signs", lambda *_: None)  # many digits would decide before
    return counts


@pytest.mark.parametrize(("curvature", "count"), [(3e-6, 1), (3e-5, 0)])
def test_a_curvature_below_five_digits_of_its_terms_is_looked_at_again(
    curvature: float, count: int, doubted: list[int]
) -> None:
    problem = problem_of(lambda q: q[0] ** 2 / 2 + curvature * q[1] ** 2 / 2, 2)
    point = EquilibriumPoint(np.zeros(2), np.zeros(0), (), 0.0)
    units = Scales(1e-9, 1.0, np.ones(0), np.ones(0), np.ones(1), np.ones(1))
    point_type.classify(RestEquations(problem, (), units), point, True)
    assert sum(doubted) == count


@pytest.mark.parametrize(("curvature", "count"), [(3e-4, 1), (3e-3, 0)])
def test_a_curvature_is_looked_at_again_below_a_part_of_force_over_length(
    curvature: float, count: int, doubted: list[int]
) -> None:
    point = EquilibriumPoint(np.zeros(1), np.zeros(0), (), 0.0)
    problem = problem_of(lambda q: curvature * q**2 / 2, 1)
    point_type.classify(RestEquations(problem, (), UNITS), point, True)
    assert sum(doubted) == count


def search_at_kinks(build: Build, count: int = 1) -> SimpleNamespace:
    return SimpleNamespace(
        problem=problem_of(build, count),
        scales=UNITS,
        points=[],
        options=SimpleNamespace(seed=0, has_potential=True),
        apart=lambda a, b: float(np.abs(a - b).max()),
        others=lambda tries: [np.full(count, 1.0 + k) for k in range(tries)],
    )


def beside(build: Build) -> str:
    """What is said of a function beside zero."""
    search = search_at_kinks(build)
    kink = kink_points.kinks(search.problem.laws)[0]
    on_pole = kink_points.on_kinks(search.problem, (kink,))
    return kink_points._beside(search, on_pole, np.zeros(1), "value")


@pytest.mark.parametrize(("width", "is_bounded"), [(3e-5, True), (3e-6, False)])
def test_a_step_that_is_wide_is_no_pole(width: float, is_bounded: bool) -> None:
    assert ("without bound" not in beside(lambda q: ca.log(ca.fabs(q) + width))) is is_bounded


def test_a_value_that_grows_less_and_less_is_bounded() -> None:
    assert "may sit" in beside(lambda q: ca.fabs(q) ** 0.25)
    assert "falls without bound" in beside(lambda q: ca.log(ca.fabs(q)))


@pytest.mark.parametrize(("power", "kind"), [(1 / 50, "minimum"), (1 / 500, None)])
def test_a_power_of_a_fiftieth_is_a_kink_and_one_of_a_five_hundredth_is_none(
    power: float, kind: str | None
) -> None:
    search = search_at_kinks(lambda q: ca.fabs(q) ** power)
    kink = kink_points.kinks(search.problem.laws)[-1]
    on_kink = kink_points.on_kinks(search.problem, (kink,))
    assert kink_points.kind_at(search, on_kink, np.zeros(1)) == kind


@pytest.mark.parametrize(("count", "is_refused"), [(3, False), (4, True)])
def test_kinks_are_looked_at_among_three_contacts(
    count: int, is_refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kink_points, "extremes", lambda *_: [])
    search = search_at_kinks(ca.fabs)
    monkeypatch.setattr(search.problem, "K", count)
    assert (
        any("among so many inequalities" in note for note in kink_points.notes(search, ["x"], ""))
        is is_refused
    )


@pytest.mark.parametrize(("count", "sentences"), [(12, 0), (13, 1)])
def test_twelve_kinks_are_looked_at(count: int, sentences: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kink_points, "extremes", lambda *_: [])
    search = search_at_kinks(lambda q: sum((ca.fabs(q - k) for k in range(count)), ca.SX(0)))
    assert len(kink_points.notes(search, ["x"], "value")) == sentences


@pytest.mark.parametrize(("count", "sentences"), [(12, 0), (13, 1)])
def test_kinks_are_looked_at_among_twelve_coordinates(
    count: int, sentences: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kink_points, "extremes", lambda *_: [])
    search = search_at_kinks(lambda q: ca.fabs(q[0]), count)
    assert len(kink_points.notes(search, ["x"] * count, "value")) == sentences


@pytest.mark.parametrize(("width", "kind"), [(3e-6, "minimum"), (3e-7, "maximum")])
def test_slopes_are_looked_at_six_digits_off_a_kink(width: float, kind: str) -> None:
    search = search_at_kinks(lambda q: ca.fabs(q) - q**2 / width)
    (kink,) = kink_points.kinks(search.problem.laws)
    on_kink = kink_points.on_kinks(search.problem, (kink,))
    assert kink_points.kind_at(search, on_kink, np.zeros(1)) == kind


@pytest.mark.parametrize(("slope", "kind"), [(3e-6, "minimum"), (3e-7, None)])
def test_a_slope_of_six_digits_less_is_none(slope: float, kind: str | None) -> None:
    search = search_at_kinks(lambda q: slope * ca.fabs(q))
    (kink,) = kink_points.kinks(search.problem.laws)
    on_kink = kink_points.on_kinks(search.problem, (kink,))
    assert kink_points.kind_at(search, on_kink, np.zeros(1)) == kind


def is_lost(build: Build, value: float) -> bool:
    """True if a function of a value that varies has left the doubles."""
    x = ca.SX.sym("x")
    function = SeriesFunction(ca.Function("f", [x], [build(x)]), is_strict=True)
    try:
        function.at([[PowerSeries(np.array([value, 1.0]), np.array([abs(value), 1.0]))]], 2, 1e-15)
    except UnderflowError:
        return True
    return False


@pytest.mark.parametrize(("size", "lost"), [(3e-293, True), (3e-292, False)])
def test_a_result_below_the_doubles_is_lost(size: float, lost: bool) -> None:
    assert is_lost(ca.exp, math.log(size)) is lost


@pytest.mark.parametrize(("left", "lost"), [(3e-13, True), (3e-12, False)])
def test_a_tanh_near_its_limit_is_lost(left: float, lost: bool) -> None:
    assert is_lost(ca.tanh, math.atanh(1 - left)) is lost
