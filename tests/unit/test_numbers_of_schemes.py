"""The numbers that schemes of one step and their timetable are judged by: on either side another answer."""

import math

import casadi as ca
import numpy as np
import pytest

from lagcli.compiled import dop853_tableau
from lagcli.memory import Memory
from lagcli.simulation.scheme import collocation, dop853, work_integral
from lagcli.simulation.scheme.collocation import Step
from lagcli.simulation.scheme.work_integral import WorkIntegral
from lagcli.simulation.stepping import timetable
from lagcli.simulation.stepping.timetable import SwitchSpan, Timetable

# The work of a step


def panel(slopes, t=0.0, h=1.0, error=math.inf):
    """A panel whose power has these values at its nodes."""
    return work_integral._Panel(-error, t, Step(t, h, np.zeros(1), np.asarray(slopes)[:, None]))


def nodes():
    return collocation.gauss(12)[0]


def is_down_to_rounding(off, whole, of=lambda times: np.ones(times.size)):
    """Whether the halves of a panel, whose powers are off by so much from it, are done."""
    integral = WorkIntegral(lambda times: (of(times) + off, 1.0), 1e-14)
    return [is_done for _, is_done in integral._halved(whole)] == [True, True]


def test_a_panel_has_twelve_nodes():
    asked = []

    def powers(times):
        asked.append(times.size)
        return 12 * times**11, 1.0

    work = WorkIntegral(powers, 1e-10).over(0.0, 1.0, 0.0)
    assert work.end == pytest.approx(1.0, rel=1e-13)
    assert asked == [12, 12, 12]


def test_a_power_of_noise_is_given_up():
    asked = []

    def powers(times):
        asked.append(times[0])
        return np.full(times.size, len(asked) * 0.7 % 1.0), 1.0

    assert WorkIntegral(powers, 1e-14).over(0.0, 1.0, 0.0) is None
    assert len(asked) == 1 + 2 * 2047


@pytest.mark.parametrize(
    ("off", "factor", "is_rounding"),
    [(1e-8, 2.0, True), (1e-8, 8.0, False), (3e-7, 1.0, True), (3e-6, 1.0, False)],
)
def test_an_error_that_stays_and_is_small_is_rounding(off, factor, is_rounding):
    assert is_down_to_rounding(off, panel(np.ones(12), error=factor * off / 2)) is is_rounding


@pytest.mark.parametrize(("part", "is_rounding"), [(3e-16, True), (3e-15, False)])
def test_the_rounding_of_the_time_is_seen_in_a_power_that_rises(part, is_rounding):
    t = 2.0**20

    def rising(times):
        return times - t

    whole = panel(rising(t + nodes()), t=t)
    assert is_down_to_rounding(2 * part * t, whole, rising) is is_rounding


@pytest.mark.parametrize(("off", "is_rounding"), [(4.5e-16, True), (3e-15, False)])
def test_an_error_of_a_few_roundings_of_the_power_is_none(off, is_rounding):
    assert is_down_to_rounding(off, panel(np.ones(12))) is is_rounding


class Projecting:
    """What `projected` asks of a function that projects: y' is `rate` of t and y, and `off` how far it landed."""

    def __init__(self, rate, size, off=0.0):
        self.rate, self.used, self.asked = rate, 0, []
        self.arguments = [np.zeros(1), np.zeros(size)]
        n = size // 2
        self.results = [np.zeros(size), np.zeros(size), np.array([off, 1.0]), np.array([1.0] * n + [0.0] * 3)]

    def trigger(self):
        self.asked.append(self.arguments[1].copy())
        self.results[1] = self.rate(self.arguments[0][0], self.arguments[1])


def test_states_are_moved_by_two_roundings():
    project = Projecting(lambda t, y: np.ones(3), 3)
    work_integral.within(project, (0.0, 1.0, 1e-9), np.zeros(3), lambda x: np.ones((x.size, 3)))
    moved = max(float(np.abs(state - 1.0).max()) for state in project.asked)
    assert 1 < moved / 2**-52 < 4


@pytest.mark.parametrize(
    ("part", "rtol", "is_known"),
    [(3e-7, 1e-14, True), (3e-6, 1e-14, False), (3e-6, 1e-7, True), (3e-5, 1e-7, False)],
)
def test_work_is_known_to_six_digits(part, rtol, is_known):
    off = 1e-7  # and not less when a panel is halved once more, so that it is taken for rounding

    def powers(times):
        level = round(-math.log2((times[-1] - times[0]) / np.ptp(nodes())))
        return np.full(times.size, 1 + off * (level % 2)), off / 2 / part

    work = WorkIntegral(powers, rtol).over(0.0, 1.0, 0.0)
    assert (work is not None) is is_known


# Collocation


def iterated(monkeypatch, slope, rtol):
    """A step whose iteration is not accelerated, and how many it took; slope(k): y' in the iteration k."""
    monkeypatch.setattr(collocation._Mixing, "next", lambda self, x, g: g)
    project = Projecting(lambda t, y: np.full(3, slope((len(project.asked) - 2) // 2)), 3)
    guess = collocation.rising(0.0, np.zeros(3), 1.0, np.zeros(3))
    step = collocation.improved(project, guess, 1.0, 2, rtol)
    return step, (len(project.asked) - 1) // 2


# The last node of two lies there: states there change by so much where slopes change by one.
LAST = (1 + 3**-0.5) / 2


def test_an_iteration_ends_at_a_thousandth_of_the_tolerance(monkeypatch):
    step, count = iterated(monkeypatch, lambda k: 3 * 10.0**-k / LAST, 1e-6)
    assert step is not None
    assert count == 12  # changes are 2.7e-9 in the iteration before


def test_an_iteration_ends_at_rounding(monkeypatch):
    step, count = iterated(monkeypatch, lambda k: 10.0**-k / LAST, 1e-15)
    assert step is not None
    assert count == 18  # changes are 9e-16 in the iteration before


@pytest.mark.parametrize(("change", "is_step"), [(3e-12, True), (3e-11, False)])
def test_an_iteration_that_stalls_ends_at_eleven_digits(change, is_step, monkeypatch):
    step, _ = iterated(monkeypatch, lambda k: change / 2 / LAST * (-1) ** k, 1e-14)
    assert (step is not None) is is_step


def test_an_iteration_is_given_up_after_eighty(monkeypatch):
    step, count = iterated(monkeypatch, lambda k: (-1) ** k, 1e-14)
    assert step is None
    assert count == 80


def mixed(values):
    """What is mixed of iterates, given as pairs of g(x) and g(x) - x, the last one first to be asked."""
    mixing = collocation._Mixing(np.ones(2))
    for g, change in values:
        found = mixing.next(np.array(g) - np.array(change), np.array(g))
    return mixing, found


def test_ten_differences_of_iterates_are_mixed():
    mixing, _ = mixed([((0.0, 0.0), (1.0 / (k + 1), 1.0)) for k in range(20)])
    assert len(mixing._changes) == 1 + 10


@pytest.mark.parametrize(("off", "is_projected"), [(3e-10, True), (3e-9, False)])
def test_a_state_that_is_off_by_nine_digits_is_not_projected(off, is_projected):
    found = collocation.projected(Projecting(lambda t, y: y, 3, off), 0.0, np.zeros(3))
    assert (found is not None) is is_projected


# Stages of a step


@pytest.mark.parametrize(("part", "was_zero"), [(0.28, False), (0.32, True)])
def test_an_angle_that_went_to_zero_is_seen_by_a_third_of_it_on_the_other_side(part, was_zero):
    zero = 0.957  # between the last two of the watched stages: a line through two before it leads below zero
    times = np.array([*(dop853_tableau.C[s] for s in dop853.WATCHED), 1.0])
    angles = zero - times
    angles[-1] = (1.0 - zero) / part
    gap = dop853._hidden()(ca.DM(np.array([angles**2, np.ones(angles.size)])))
    assert (float(gap) < 0) is was_zero


# The timetable


class OfTime:
    """Functions of t, as a timetable asks for them: `of` a cell gives the bounds; `cells` are those asked for."""

    def __init__(self, of, size=1, waves=False):
        self.of, self.size, self.cached, self.cells = of, size, Memory(), []
        self.switches, self.oscillations = ((), (0,)) if waves else ((0,), ())

    def values(self, span, which):
        left, right = span
        if not np.isinf(left).any():
            self.cells.append((left, right))
        return [self.of(left, right)]

    @property
    def narrowest(self):
        return min(float((right - left).min()) for left, right in self.cells if left.size)


def everywhere(left, right):
    """A function that may be zero at any time."""
    return -np.ones(left.size), np.ones(left.size)


def never(left, right):
    return np.ones(left.size), np.ones(left.size)


def between(low, high):
    """A function that may be zero between two times alone."""
    return lambda left, right: (np.where((left <= high) & (right >= low), -1.0, 1.0), np.ones(left.size))


def test_a_piece_of_time_holds_a_thousand_rows():
    functions = OfTime(never)
    Timetable(functions, 0.0, 1.0).shortened(0.0, 0.5)
    assert float(functions.cells[0][1][0]) == 1024.0


def test_a_piece_with_too_much_is_halved():
    functions = OfTime(everywhere)
    Timetable(functions, 0.0, 1.0).shortened(0.0, 0.01)
    shortest = min(float(right[0] - left[0]) for left, right in functions.cells if left.size == 1)
    assert shortest == 1024.0 / 2**13


def test_no_more_than_four_thousand_cells_are_halved():
    functions = OfTime(everywhere)
    assert timetable._switches(functions, (1.0, 2.0), 0.0) is None
    assert max(left.size for left, _ in functions.cells) == 2 * 4096


def test_no_more_than_two_million_values_are_made_at_once():
    functions = OfTime(everywhere, size=2**10)
    assert timetable._switches(functions, (1.0, 2.0), 0.0) is None
    assert max(left.size for left, _ in functions.cells) == 2**11


@pytest.mark.parametrize(("width", "narrowest"), [(10, 2.0**-31), (100, 2.0**-30)])
def test_cells_in_a_long_row_have_nine_digits(width, narrowest):
    functions = OfTime(between(1.0 + 2**-32, 1.0 + width * 2.0**-30))
    timetable._switches(functions, (0.5, 1.5), 0.0)
    assert functions.narrowest == narrowest


def test_steps_keep_four_roundings_of_the_time_from_a_switch():
    ulp = 2.0**-52
    assert timetable._joined([(1.0, 1.0 + ulp)], 1e-30) == [SwitchSpan(1.0 - 4 * ulp, 1.0 + 5 * ulp)]


@pytest.mark.parametrize(("roundings", "stands"), [(200, True), (300, False)])
def test_states_stand_still_across_hundreds_of_roundings(roundings, stands):
    table = Timetable(OfTime(never), 0.0, 1.0)
    table._known = math.inf
    table._add([SwitchSpan(1.0, 1.0 + roundings * 2.0**-52)], [])
    assert (table.switch(1.0) is not None) is stands


def test_near_zero_there_is_another_rounding():
    table = Timetable(OfTime(between(0.0, 0.0)), -1.0, 1.0)
    _, after = table.switch(0.0)
    assert 4 <= after / (1024 * 2.0**-62) <= 6


def test_cells_are_halved_until_functions_change_by_a_quarter():
    functions = OfTime(lambda left, right: (np.maximum(left, 0.0), np.minimum(right, 1.0)), waves=True)
    timetable._stationary_times(functions, (0,), (0.0, 1.0))
    assert functions.narrowest == 0.25


def test_cells_of_a_jump_are_halved_thirty_six_times():
    functions = OfTime(lambda left, right: (1.0 * (left > 0.3), 1.0 * (right > 0.3)), waves=True)
    timetable._stationary_times(functions, (0,), (0.0, 1.0))
    assert functions.narrowest == 2.0**-36


def test_between_stations_functions_change_by_half_their_range():
    assert timetable._spaced(np.arange(1.0, 7.0), np.full(6, 0.2)) == [3.0, 6.0]
