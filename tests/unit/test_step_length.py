"""The length of steps on both sides of the numbers that decide about it."""

import numpy as np
import pytest

from lagcli.simulation.scheme import controller
from lagcli.simulation.scheme.controller import StepController

ORDER = 8
TOLERANCE = np.array([1e-9, 0.0, 1e-13, 1e-17, 0.0, 0.0])


class ConstantRate:
    """y' of one coordinate that is the same everywhere, in place of a compiled function."""

    def __init__(self, t: float, k: np.ndarray) -> None:
        self.arguments = [np.array([t]), np.zeros(k.size), np.zeros(0)]
        self.results = [k]

    def trigger(self) -> None:
        """Nothing changes."""


def first(t: float = 0.0, *, q: float = 0.0, v: float = 0.0, a: float = 0.0, forced: float = 0.0) -> float:
    """The first step from a size, a speed, an acceleration and that of the forces alone."""
    k = np.array([v, a, 0.0])
    sizes = np.array([1.0, q, v, forced])
    return controller.first_step(ConstantRate(t, k), k, sizes, TOLERANCE, ORDER)


def test_speeds_of_rounding_shorten_no_first_step() -> None:
    at_rest = first(q=1.0, a=1.0)
    assert first(q=1.0, v=1e-9, a=1.0) == at_rest
    assert first(q=1.0, v=1e-7, a=1.0) < at_rest / 100


def test_balanced_forces_give_the_scale_of_time() -> None:
    of_forces = first(q=1.0, a=1.0, forced=1.0)
    assert first(q=1.0, a=1e-14, forced=1.0) == of_forces
    assert first(q=1.0, a=1e-12, forced=1.0) > 1e5 * of_forces


def test_where_nothing_moves_time_is_a_scale() -> None:
    assert first(1e3) == first(0.0)
    assert first(1e6) > 20 * first(0.0)


def test_a_long_step_is_shortened_little_by_little() -> None:
    control = StepController(ORDER, 1.0, 0.0)
    assert control.smaller(1.0, 1e30, True) > 0.1
    assert control.smaller(1.0, 1e4, True) < control.smaller(1.0, 1e2, True)


@pytest.mark.parametrize(("end", "is_slow"), [(1e6, False), (1e7, True)])
def test_a_run_that_would_take_days_is_too_slow(end: float, is_slow: bool) -> None:
    found = StepController(ORDER, 1.0, 0.0).is_too_slow(1.0, end, 0.0)
    assert (found is not None) == is_slow


@pytest.mark.parametrize(("row", "is_slow"), [(1e4, False), (1e5, True), (1e6, True)])
def test_a_row_that_is_hours_away_is_too_slow(row: float, is_slow: bool) -> None:
    found = StepController(ORDER, 1.0, 0.0).is_too_slow(1.0, 1e6, row)
    assert (found is not None) == is_slow


def test_a_tenth_of_the_step_is_left() -> None:
    assert StepController(ORDER, 1.0, 0.0).grown(1.0, 1.0, 10.0) == pytest.approx(0.9)
    assert StepController(ORDER, 1.0, 0.0).smaller(1.0, 1.0, True) == pytest.approx(0.9)


def test_a_step_is_hundreds_of_roundings_of_the_time() -> None:
    assert first(1.0, q=1e-20, v=1.0) == 256 * 2.0**-52


def test_the_first_step_is_as_exact_as_asked() -> None:
    assert first(q=1.0, a=1.0) == pytest.approx((0.01 * TOLERANCE[0]) ** (1 / ORDER))


@pytest.mark.parametrize(("instant", "is_seen"), [(3e-4, True), (3e-3, False)])
def test_forces_are_looked_at_a_thousandth_ahead(instant: float, is_seen: bool) -> None:
    class Switched(ConstantRate):
        def trigger(self) -> None:
            self.results = [k * (1.0 + 1e9 * (self.arguments[0][0] > instant))]

    k = np.array([0.0, 1.0, 0.0])
    step = controller.first_step(Switched(0.0, k), k, np.array([1.0, 1.0, 0.0, 0.0]), TOLERANCE, ORDER)
    assert (step < 0.1 * first(q=1.0, a=1.0)) is is_seen
