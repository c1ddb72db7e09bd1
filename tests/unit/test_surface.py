"""The numbers of the road onto a surface: on either side of each another course.

Equations are given their distances one after the other, wherever they are asked for, so that each number decides alone.
"""

import itertools
from decimal import Decimal

import casadi as ca
import numpy as np
import pytest

from lagcli.linear import surface
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.linear.surface import PARAMETERS, InDigits, Linearized


class Given:
    """One equation at a point, so far off; its step is as long as that."""

    def __init__(self, distance, dampings):
        self.distance = self.norm = distance
        self.dampings = dampings

    @property
    def is_there(self):
        return self.distance <= PARAMETERS.arrived

    def norm_of(self, other):
        return other.distance

    def step(self):
        return np.array([-self.distance])

    def damped(self, damping):
        self.dampings.append(damping)
        return self.step()


class Course:
    """Equations with these distances; `asked`: the points, `dampings` those of the steps of a descent."""

    def __init__(self, distances):
        self.left, self.asked, self.dampings = iter(distances), [], []

    def __call__(self, x):
        self.asked.append(float(x[0]))
        return Given(next(self.left), self.dampings)


def descended(distances):
    course = Course(distances)
    surface.descend(course, np.zeros(1))
    return course


def approached(distances):
    course = Course(distances)
    return surface.approach(course, np.zeros(1)), course


def shrinking(ratio):
    return (ratio**k for k in itertools.count())


def test_forty_newton_steps_are_made():
    assert len(approached(shrinking(0.98))[1].asked) == 1 + 40


def test_newton_may_rise_far_off_and_not_at_rounding():
    end, course = approached([1.0, 0.5, 0.7, 1e-4, 1e-9, 3e-13, 4e-13, 0.0])
    assert (end.distance, len(course.asked)) == (3e-13, 7)
    end = surface.approach(Course([1.0, 0.5, 0.7, 1e-4]), np.zeros(1), may_rise=False)
    assert end.distance == 0.5


@pytest.mark.parametrize(("length", "steps"), [(3e-13, 1), (3e-12, 40)])
def test_small_steps_that_no_longer_halve_the_distance_are_rounding(length, steps, monkeypatch):
    monkeypatch.setattr(Given, "step", lambda self: np.array([length]))
    assert len(approached(shrinking(0.9))[1].asked) == 1 + steps


@pytest.mark.parametrize(("length", "steps"), [(2e-16, 1), (3e-16, 40)])
def test_steps_below_the_rounding_of_the_unknowns_are_the_last(length, steps, monkeypatch):
    monkeypatch.setattr(Given, "step", lambda self: np.array([length]))
    monkeypatch.setattr(Given, "is_there", False)
    assert len(approached(shrinking(0.1))[1].asked) == 1 + steps


@pytest.mark.parametrize(("distance", "steps"), [(3e-14, 0), (3e-13, 1)])
def test_newton_ends_at_thirteen_digits(distance, steps):
    assert len(approached([distance, 0.0])[1].asked) == 1 + steps


@pytest.mark.parametrize(("last", "is_met"), [(0.005, True), (0.05, False)])
def test_a_point_is_met_where_the_last_two_steps_square_the_distance(last, is_met):
    assert approached([1e-12, 5e-13, last * 1e-12])[0].is_met is is_met


@pytest.mark.parametrize(("distance", "creeps"), [(3e-10, True), (3e-9, False)])
def test_what_comes_near_a_surface_slowly_creeps(distance, creeps):
    assert approached([distance, 1.0, *[1.0] * 40])[0].creeps is creeps


@pytest.mark.parametrize(("roundings", "is_met"), [(50, True), (80, False)])
def test_values_may_hold_some_roundings(roundings, is_met):
    here = Linearized(np.array([roundings * 1e-9]), ca.DM([[1.0]]), Metric.unit(1), 1.0, 1e-9)
    assert here.is_there is is_met


@pytest.mark.parametrize(("off", "steps"), [(5e-13, 0), (5e-12, 1)])
def test_many_points_are_met_to_twelve_digits(off, steps):
    asked = []

    def at(points):
        asked.append(points)
        return points - 1.0, np.ones((2, 1, 1))

    met, _ = surface.nearby_all(at, np.array([[1.0], [1.0 + off]]), 1.0)
    assert len(asked) == 1 + steps
    assert met == pytest.approx(np.ones((2, 1)), abs=1e-11)


def test_points_that_come_nowhere_are_left_out():
    def at(points):
        return np.where(points > 0, points**2 + 1.0, points + 1.0), np.where(points > 0, 2 * points, 1.0)[
            ..., None
        ]

    met, _ = surface.nearby_all(at, np.array([[1.0], [-5.0], [np.nan]]), 1.0)
    assert met[1] == -1.0
    assert np.isnan(met[2])


def test_a_descent_has_two_hundred_steps():
    assert len(descended(shrinking(0.98)).asked) == 1 + 200


def test_a_step_of_a_descent_is_damped_thirty_times():
    course = descended(itertools.repeat(1.0))
    assert len(course.asked) == 1 + 30
    assert course.dampings[:4] == [0.0, 1e-3, 4e-3, 16e-3]


@pytest.mark.parametrize(("left", "steps"), [(0.7, 200), (0.9, 20)])
def test_a_descent_that_is_slow_for_twenty_steps_ends(left, steps):
    assert len(descended(shrinking(left ** (1 / 20))).asked) == 1 + steps


def test_damping_wanes_by_eight_down_to_nine_digits():
    dampings = descended([1.0, 1.0, *(0.5**k for k in range(1, 400))]).dampings
    assert dampings[1:8] == pytest.approx([1e-3 / 8**k for k in range(7)], rel=1e-9)
    assert dampings[8:10] == [pytest.approx(1e-3 / 8**7, rel=1e-9, abs=0.0), 0.0]


@pytest.mark.parametrize(("distance", "steps"), [(3e-15, 0), (3e-14, 1)])
def test_a_descent_ends_at_fourteen_digits(distance, steps):
    assert len(descended([distance, 0.0]).asked) == 1 + steps


def nearer(ways):
    """How many points, each so far from zero, are asked for on the way to the one nearest to it."""
    left, asked = iter(ways), []

    def toward(q):
        asked.append(q)
        return np.array([next(left)])

    surface.nearest(toward, lambda step: float(np.abs(step).max()), np.ones(1), np.zeros(1))
    return len(asked)


def test_sixty_steps_lead_to_the_nearest_point():
    assert nearer(0.9 * 0.9**k for k in itertools.count()) == 60


def test_a_step_along_a_surface_is_halved_down_to_four_digits():
    asked = []
    assert surface.walk(lambda x: asked.append(float(x[0])), np.zeros(1), np.array([0.1]), 2.0) is None
    assert asked == [0.1 / 2**k for k in range(8)]


@pytest.mark.parametrize(("bend", "length"), [(0.9, 1.0), (1.1, 0.5)])
def test_a_step_along_a_surface_ends_nearer_to_its_tangent_than_it_is_long(bend, length):
    asked = []

    def meet(x):
        asked.append(float(x[0]))
        return x + np.array([0.0, bend * x[0] ** 2])

    surface.walk(meet, np.zeros(2), np.array([1.0, 0.0]))
    assert asked[-1] == length


def test_a_point_is_met_in_many_digits_with_gradients_of_doubles():
    rows = MetricRows(ca.DM([[2 * 1.4142135, 0.0]]), Metric.unit(2))

    def at(x):
        return InDigits([x[0] * x[0] - 2], rows, [0], np.array([2.8]), Decimal("1e-25"))

    end = surface.nearby(at, np.array([Decimal("1.4142135"), Decimal(3)]))
    assert abs(end[0] - Decimal(2).sqrt()) <= Decimal("1e-25")
    assert end[1] == 3
