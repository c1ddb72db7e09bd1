"""The first crossing of zero along a step: none is lost, touching is none, work is bounded."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.contact import zero_bounds, zero_search
from lagcli.contact.zero_search import BOTH, DOWN, UP, FirstCrossing

Floats = npt.NDArray[np.float64]
Function = Callable[[float], float]

NOISE = 1e-15


def search(*functions: tuple[Function, Function], noise: float = NOISE, **options: object) -> FirstCrossing:
    """The first crossing of functions given with their slopes."""

    def values(x: float) -> tuple[Floats, Floats]:
        return np.array([g(x) for g, _ in functions]), np.array([slope(x) for _, slope in functions])

    return zero_search.first_crossing(values, np.full(len(functions), noise), **options)  # type: ignore[arg-type]


def polynomial(*roots: float, scale: float = 1.0) -> tuple[Function, Function]:
    whole = scale * np.polynomial.Polynomial.fromroots(roots)
    return whole, whole.deriv()


def line(root: float, slope: float = -1.0) -> tuple[Function, Function]:
    return lambda x: slope * (x - root), lambda x: slope


def kink(place: float, depth: float) -> tuple[Function, Function]:
    return lambda x: abs(x - place) - depth, lambda x: float(np.sign(x - place))


def wave(omega: float, phase: float = 0.0, shift: float = 0.0) -> tuple[Function, Function]:
    return lambda x: np.sin(omega * x + phase) + shift, lambda x: omega * np.cos(omega * x + phase)


@pytest.mark.parametrize("root", [1e-9, 0.25, zero_search.GOLDEN, 0.5, 0.9999999])
def test_a_line_is_found_to_rounding(root: float) -> None:
    found = search(line(root))
    assert found.x == pytest.approx(root, abs=3e-16)
    assert found.rows == (0,)
    assert found.evaluations <= 6


def test_of_two_roots_in_one_step_the_first_is_found() -> None:
    """A particle passes through a small disk: g dips below zero, and both ends are clear."""
    for middle, depth in ((0.3, 1e-10), (0.7071, 1e-4), (0.5, 1e-12), (0.999, 1e-8)):
        found = search((lambda x, m=middle, d=depth: (x - m) ** 2 - d, lambda x, m=middle: 2 * (x - m)))
        # Rounding of g is felt as much more in x where the dip is shallow.
        assert found.x == pytest.approx(middle - depth**0.5, abs=1e-15 + NOISE / depth**0.5)
        assert found.evaluations < 40


def test_a_small_disk_is_not_passed_through() -> None:
    def distance(x: float) -> float:
        return float(np.hypot(10 * (x - 0.4), 1e-4))

    found = search((lambda x: distance(x) - 2e-4, lambda x: 100 * (x - 0.4) / distance(x)))
    assert found.x == pytest.approx(0.4 - 3**0.5 * 1e-5, abs=1e-15)
    assert found.evaluations < 80


@pytest.mark.parametrize("depth", [0.0, -1e-14, -1e-9, -1e-3])
def test_touching_and_nearly_touching_is_no_crossing(depth: float) -> None:
    for middle in (0.3, 0.62, 1.0, 0.0):
        found = search((lambda x, m=middle: (x - m) ** 2 - depth, lambda x, m=middle: 2 * (x - m)))
        assert found.x is None
        assert not found.unresolved
        round_one = (lambda x, m=middle: 1 - np.cos(x - m) - depth, lambda x, m=middle: np.sin(x - m))
        found = search(round_one)
        assert found.x is None
        assert not found.unresolved
        assert found.evaluations < 40


def test_tangential_crossings() -> None:
    """A triple root is felt in x as the third root of the noise."""
    found = search((lambda x: -((x - 0.4) ** 3), lambda x: -3 * (x - 0.4) ** 2))
    assert found.x == pytest.approx(0.4, abs=3 * NOISE ** (1 / 3))


def test_kinks() -> None:
    for place in (0.3, 0.5, 0.123456):
        found = search(kink(place, 1e-3))
        assert found.x == pytest.approx(place - 1e-3, abs=1e-15)
        assert search(kink(place, 0.0)).x is None
        found = search(kink(place, -1e-9))
        assert found.x is None
        assert not found.unresolved
        assert found.evaluations < 120


def test_jumps_are_found_at_their_point() -> None:
    found = search((lambda x: 0.5 - float(x > 0.3), lambda x: 0.0))
    assert found.x == pytest.approx(0.3, abs=1e-14)


def test_a_function_that_ends_inside_is_found_before() -> None:
    found = search((lambda x: 0.3 - x if x < 0.5 else np.nan, lambda x: -1.0))
    assert found.x == pytest.approx(0.3, abs=1e-15)
    found = search((lambda x: 0.6 - x if x < 0.5 else np.nan, lambda x: -1.0))
    assert found.x is None
    # Nothing is said of what is beyond the last place at which there are values.
    assert not found.ending


@pytest.mark.parametrize("omega", [50.0, 2 * np.pi, 8 * np.pi, 100 * np.pi, 333.3])
def test_waves_faster_than_the_samples(omega: float) -> None:
    found = search(wave(omega))
    assert found.x == pytest.approx(np.pi / omega, abs=1e-15)
    assert search(wave(omega, shift=1.001)).x is None
    deep = search(wave(omega, shift=1 - 1e-9))
    assert deep.x is not None
    assert abs(deep.x - 1.5 * np.pi / omega) * omega == pytest.approx((2e-9) ** 0.5, rel=1e-3)


def test_no_wave_hides_behind_the_samples() -> None:
    """Waves that have an extreme at both ends, of all lengths; the middle alone would be fooled by every other."""
    for waves in range(1, 200):
        omega = np.pi * waves
        found = search(wave(omega, np.pi / 2, 0.5), most=4000)
        assert found.x == pytest.approx(2 * np.pi / 3 / omega, abs=1e-15)


def test_a_wave_too_fast_to_resolve_is_reported() -> None:
    functions = (line(2.0), wave(1e7, shift=1.1))
    found = search(*functions, most=300)
    assert found.x is None
    assert found.unresolved == (1,)
    assert found.clear < 1e-2
    assert found.evaluations <= 300


def test_what_is_at_zero_at_the_start_counts_from_there() -> None:
    rises = (lambda x: x * (0.7 - x), lambda x: 0.7 - 2 * x)
    assert search(rises).x == pytest.approx(0.7, abs=1e-15)
    falls = (lambda x: -x, lambda x: -1.0)
    assert search(falls).x == 0.0
    assert search(falls, armed=False).x is None
    lifts_off = (lambda x: x, lambda x: 1.0)
    assert search(lifts_off).x is None
    rests = (lambda x: 0.3 * NOISE * np.sin(1e3 * x), lambda x: 0.0)
    assert search(rests).x is None


@pytest.mark.parametrize("rest", [-0.9, -0.3, 0.4, 0.9])
def test_a_hop_that_starts_with_rounding_ends_where_it_falls(rest: float) -> None:
    """The start lies on the wrong side of zero by rounding; a crossing there would be the same blow again."""
    for height in (1.0, 1e-3, 1e-6, 1e-9):
        hop = (lambda x, h=height: rest * NOISE + h * x * (0.4 - x), lambda x, h=height: h * (0.4 - 2 * x))
        assert search(hop).x == pytest.approx(0.4, abs=1e-15 + 6 * NOISE / height)


def test_what_arrives_at_zero_at_the_end_is_reported_and_crosses_in_the_next_step() -> None:
    found = search(line(1.0))
    assert (found.x, found.ending) == (None, (0,))
    assert search((lambda x: -x, lambda x: -1.0)).x == 0.0
    assert search(line(2.0)).ending == ()


def test_directions() -> None:
    up, down = line(0.3, 1.0), line(0.6, -1.0)
    assert search(up, down).x == pytest.approx(0.6, abs=1e-15)
    assert search(up, down, direction=UP).x == pytest.approx(0.3, abs=1e-15)
    assert search(up, down, direction=BOTH).rows == (0,)
    assert search(up, down, direction=[DOWN, BOTH]).rows == (1,)
    below = polynomial(0.2, 0.5)
    assert search(below, direction=UP).x == pytest.approx(0.5, abs=1e-15)
    assert search(wave(10.0), direction=BOTH, armed=False).x == pytest.approx(np.pi / 10, abs=1e-15)
    assert search(wave(10.0), direction=BOTH).x == 0.0
    assert search(wave(10.0, np.pi), direction=DOWN, armed=False).x == pytest.approx(0.2 * np.pi, abs=1e-15)


def test_functions_that_cross_together_are_all_named() -> None:
    found = search(line(0.4), line(0.7), line(0.4, -3.0), (lambda x: x, lambda x: 1.0))
    assert found.rows == (0, 2)
    assert search(line(0.4), line(0.4 + 1e-9)).rows == (0,)
    touches = ((lambda x: (x - 0.4) ** 2), (lambda x: 2 * (x - 0.4)))
    assert search(line(0.4), touches).rows == (0,)


def test_many_clear_functions_cost_three_evaluations() -> None:
    random = np.random.default_rng(0)
    a, b, c = random.standard_normal((3, 5000))

    def values(x: float) -> tuple[Floats, Floats]:
        return 20 + a * np.sin(b * x) + c * x, a * b * np.cos(b * x) + c

    found = zero_search.first_crossing(values, np.full(5000, NOISE))
    assert (found.x, found.evaluations) == (None, 3)


def test_of_many_that_cross_the_first_is_found_with_little_work() -> None:
    random = np.random.default_rng(1)
    roots, slopes = 0.1 + 0.8 * random.random(5000), -1 - 9 * random.random(5000)
    found = zero_search.first_crossing(lambda x: (slopes * (x - roots), slopes), np.full(5000, NOISE))
    assert found.x == pytest.approx(roots.min(), abs=1e-15)
    assert found.rows == (int(np.argmin(roots)),)
    assert found.evaluations < 20


def test_no_functions_need_no_search() -> None:
    assert search().x is None


@given(st.lists(st.floats(0.01, 1.2), min_size=1, max_size=5), st.booleans())
@settings(max_examples=100, deadline=None)
def test_first_roots_of_polynomials(roots: list[float], is_up: bool) -> None:
    """The function changes its sign at every root; of roots nearer than rounding tells none need be seen."""
    roots = sorted(roots)
    scale = (-1.0) ** len(roots) if is_up else -((-1.0) ** len(roots))
    found = search(polynomial(*roots, scale=scale))
    g, slope = polynomial(*roots, scale=scale)
    dense = np.linspace(0, 1, 2001)
    table = np.asarray(g(dense))
    was_up = np.maximum.accumulate(table > 1e-12) | (table[0] >= -NOISE)
    falls = dense[was_up & (table < -1e-12)]
    assert not found.unresolved
    if falls.size:
        assert found.x is not None
        assert found.x <= falls[0]
    if found.x is not None:
        assert abs(g(found.x)) <= 1e-14
        assert slope(found.x) <= 1e-6


@given(st.integers(0, 10**6), st.integers(1, 40), st.sampled_from([1.0, 5.0, 25.0, 100.0]))
@settings(max_examples=100, deadline=None)
def test_random_sums_of_waves_against_dense_samples(seed: int, count: int, fastest: float) -> None:
    random = np.random.default_rng(seed)
    size, phase = random.standard_normal((count, 3)), random.random((count, 3))
    omega = fastest * random.random((count, 3))
    shift = 3 * random.random(count)

    def values(x: float) -> tuple[Floats, Floats]:
        angle = omega * x + 7 * phase
        return (size * np.sin(angle)).sum(-1) + shift, (size * omega * np.cos(angle)).sum(-1)

    found = zero_search.first_crossing(values, np.full(count, 1e-14))
    assert not found.unresolved
    dense = np.linspace(0, 1, 1001)
    angles = omega * dense[:, None, None] + 7 * phase
    table = (size * np.sin(angles)).sum(-1) + shift
    was_up = np.maximum.accumulate(table > 1e-14, axis=0)
    falls = np.flatnonzero((was_up & (table < -1e-14)).any(axis=1))
    if found.x is None:
        assert not falls.size
        return
    assert not falls.size or found.x <= dense[falls[0]]
    g, slope = values(found.x)
    assert np.abs(g[list(found.rows)]).max() <= 1e-13
    assert (slope[list(found.rows)] < 0).all()


def test_one_function_in_floats_is_bounded_as_many_in_arrays() -> None:
    random = np.random.default_rng(3)
    a, b, c, d, value, slope = random.standard_normal((6, 50))
    many: zero_bounds.Cubic[Floats] = zero_bounds.cubic((a, b, c, d))
    doubt: Floats = zero_bounds.misfit((a, b, c, d), 0.3, (value, slope), np.full(50, 1e-15))
    low, high = zero_bounds.extent(many, doubt)
    for i in range(50):
        ends = float(a[i]), float(b[i]), float(c[i]), float(d[i])
        one: zero_bounds.Cubic[float] = zero_bounds.cubic(ends)
        assert zero_bounds.misfit(ends, 0.3, (float(value[i]), float(slope[i])), 1e-15) == doubt[i]
        assert zero_bounds.extent(one, float(doubt[i])) == (low[i], high[i])
