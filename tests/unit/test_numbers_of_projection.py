"""The numbers of the way onto the constraints: on either side of each another course.

The surface is given residuals one after the other, wherever they are asked for, so that each number decides alone.
"""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from lagcli.start import projection
from lagcli.start.projection import Reached, Surface

METRIC = SimpleNamespace(length=lambda step: float(np.abs(step).max()))


class Rows:
    """One row of length one, whose step is the residual; `dampings` are those asked for."""

    lengths = values = divisors = np.ones(1)

    def __init__(self, dampings):
        self.dampings = dampings

    def correction(self, f, damping=0.0):
        self.dampings.append(damping)
        return -np.asarray(f)

    def times(self, step):
        return np.zeros(1)


class GivenResiduals(Surface):
    """One coordinate and one row, with these residuals."""

    def __init__(self, residuals):
        super().__init__(None, 0.0, np.zeros(0), METRIC)
        self.left, self.asked = iter(residuals), []

    def values(self, q):
        self.asked.append(float(q[0]))
        return np.array([next(self.left)]), np.ones(1)

    def matrix(self, entries):
        return None


@pytest.fixture
def dampings(monkeypatch):
    """The dampings of the steps of descents."""
    found = []
    monkeypatch.setattr(projection, "MetricRows", lambda B, metric: Rows(found))
    monkeypatch.setattr(projection, "LocalRows", lambda B: Rows(found))
    return found


@pytest.fixture
def descent(dampings):
    """The surface after a descent along some residuals."""

    def made(residuals):
        surface = GivenResiduals(residuals)
        surface.reached = surface.descend(np.zeros(1))
        return surface

    return made


def shrinking(ratio):
    return (ratio**k for k in itertools.count())


def test_a_descent_has_two_hundred_steps(descent):
    assert len(descent(shrinking(0.98)).asked) == 1 + 200


def test_a_step_of_a_descent_is_damped_thirty_times(descent, dampings):
    assert len(descent(itertools.repeat(1.0)).asked) == 1 + 30
    assert dampings[:4] == [0.0, 1e-3, 4e-3, 16e-3]


@pytest.mark.parametrize(("left", "steps"), [(0.7, 200), (0.9, 20)])
def test_a_descent_that_is_slow_for_twenty_steps_ends(left, steps, descent):
    assert len(descent(shrinking(left ** (1 / 20))).asked) == 1 + steps


def test_damping_wanes_by_eight_down_to_nine_digits(descent, dampings):
    descent([1.0, 1.0, *(0.5**k for k in range(1, 400))])
    assert dampings[1:8] == pytest.approx([1e-3 / 8**k for k in range(7)], rel=1e-9)
    assert dampings[8:10] == [pytest.approx(1e-3 / 8**7, rel=1e-9, abs=0.0), 0.0]


@pytest.mark.parametrize(("residual", "steps"), [(3e-15, 0), (3e-14, 1)])
def test_a_descent_ends_at_fourteen_digits(residual, steps, descent):
    assert len(descent([residual, 0.0]).asked) == 1 + steps


class Nearer(Surface):
    """A surface of which each point that is reached is nearer to the first than the last, by these ways."""

    def __init__(self, ways):
        super().__init__(None, 0.0, np.zeros(0), METRIC)
        self.left, self.count = iter(ways), 0

    def rows(self, q):
        return np.zeros(1), None

    def descend(self, q, to_the_end=False):
        self.count += 1
        return Reached(np.array([next(self.left)]), np.zeros(1), True)


def test_sixty_steps_lead_to_the_nearest_point(dampings):
    surface = Nearer(shrinking(0.9))
    surface.refined(np.ones(1) * 2, np.zeros(1))
    assert surface.count == 60


@pytest.mark.parametrize(("moved", "count"), [(3e-13, 1), (3e-12, 2)])
def test_the_nearest_point_is_found_to_twelve_digits(moved, count, dampings):
    surface = Nearer([1.0 - moved, 1.0 - moved])
    surface.refined(np.ones(1), np.zeros(1))
    assert surface.count == count
