"""The numbers that dependent rows, switches and cuts are judged by: on either side of each another answer."""

import math
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from lagcli.equations import branch_cuts
from lagcli.equations.branch_cuts import Cuts
from lagcli.equations.kinks import Kinks
from lagcli.linear import decompositions, independent_rows, metric_rows, rank
from lagcli.linear.independent_rows import Dependence
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.smoothness import jump_search
from lagcli.smoothness.jump_search import Local, Starts
from lagcli.smoothness.sides import Sides, value_jumps

NOTHING = np.zeros(0)


def metric_rows_of(rows):
    rows = np.asarray(rows, dtype=float)
    return MetricRows(ca.DM(rows), Metric.unit(rows.shape[1]))


def two_rows(sigma):
    """Two rows of which this is the smaller singular value."""
    half = sigma / math.sqrt(2)
    return metric_rows_of([[1.0, half], [1.0, -half]])


# The rank of rows


@pytest.mark.parametrize(("sigma", "value"), [(1e-5, 2), (1e-6, None), (3e-7, None), (3e-8, 1)])
def test_singular_values_count_or_are_rounding_with_a_gap(sigma, value):
    assert rank.estimate(two_rows(sigma)).value == value


def test_rows_of_any_size_are_made_of_length_one():
    found = decompositions.unit(np.array([[3e200, 4e200], [0.0, 0.0], [0.0, 2e-200]]))
    assert found == pytest.approx(np.array([[0.6, 0.8], [0.0, 0.0], [0.0, 1.0]]))


@pytest.mark.parametrize(("part", "is_solved"), [(2e-13, False), (5e-12, True)])
def test_singular_values_of_rounding_are_not_solved_for(part, is_solved):
    A = np.diag([1.0, part])
    assert bool(decompositions.least_squares(A, A @ [1.0, 1.0])[1] > 0.9) is is_solved
    assert bool(decompositions.pseudo_inverse(A)[1, 1] > 0) is is_solved
    assert decompositions.range_basis(A).shape[1] == 1 + is_solved
    assert len(rank.space(A).exact_dependences) == 1 - is_solved


@pytest.mark.parametrize(("weight", "rows"), [(3e-7, [0]), (3e-6, [0, 1])])
def test_a_row_takes_part_in_a_dependence_with_six_digits(weight, rows):
    assert rank.participants(np.array([1.0, -weight])) == rows


@pytest.mark.parametrize(("sigma", "is_certain"), [(1e-4, True), (1e-5, False)])
def test_the_gram_matrix_tells_rows_that_are_clearly_independent(sigma, is_certain):
    assert two_rows(sigma).are_independent is is_certain


def test_the_smallest_singular_value_is_found_in_twelve_iterations(monkeypatch):
    solved = []
    monkeypatch.setattr(MetricRows, "_repeated_solver", lambda rows, shift: lambda x: solved.append(x) or x)
    assert two_rows(1e-5).weakest[0] == pytest.approx(1.0)
    assert len(solved) == 12


@pytest.mark.parametrize(("part", "is_rounding"), [(3e-13, True), (3e-12, False)])
def test_eigenvalues_of_the_gram_matrix_are_rounding_below_twelve_digits(part, is_rounding):
    rows = two_rows(math.sqrt(2 * part))
    step = rows.correction(np.array([1.0, -1.0]))
    assert bool(np.abs(step).max() < 1.0) is is_rounding


@pytest.mark.parametrize(("count", "are_many"), [(150, False), (151, True)])
def test_more_than_a_hundred_and_fifty_rows_are_many(count, are_many):
    assert metric_rows.are_many(count, 1000) is are_many
    assert metric_rows.are_many(1000, count) is are_many


@pytest.mark.parametrize(
    ("count", "part", "is_filled"),
    [(100, 0.2, True), (100, 0.05, False), (4000, 0.2, True), (4001, 0.2, False)],
)
def test_a_gram_matrix_of_which_a_tenth_is_filled_is_dense(count, part, is_filled):
    rows = MetricRows.__new__(MetricRows)
    rows.count = count
    rows.__dict__["_gram"] = SimpleNamespace(nnz=lambda: part * count**2)
    assert rows._is_filled is is_filled


@pytest.mark.parametrize(("count", "is_inverted"), [(40, True), (41, False)])
def test_the_gram_matrix_of_forty_rows_is_inverted(count, is_inverted, monkeypatch):
    asked = []
    monkeypatch.setattr(np.linalg, "inv", asked.append)
    metric_rows_of(np.eye(count))._repeated_solver(1e-14)
    assert bool(asked) is is_inverted


@pytest.mark.parametrize(("own", "hangs"), [(0.003, False), (0.03, True)])
def test_a_row_hangs_on_a_coordinate_of_its_own_by_a_hundredth(own, hangs):
    rows = metric_rows_of([[0.6, 0.8, 0.0], [math.sqrt(1 - own**2), 0.0, own]])
    # What hangs on so little bounds the smallest singular value from below by as little.
    assert bool(rows._least_with_hanging() < 0.1) is hangs


# The choice of independent rows


@pytest.mark.parametrize(("apart", "chosen"), [(0.4, [0, 1]), (0.2, [0, 2])])
def test_the_next_row_is_the_first_that_is_a_third_as_far_as_the_farthest(apart, chosen):
    rows = metric_rows_of([[1.0, 0.0], [math.sqrt(1 - apart**2), apart], [0.0, 1.0]])
    assert independent_rows.independent(rows, 2) == chosen


@pytest.mark.parametrize(("weight", "dependency"), [(3e-8, (2, 0)), (3e-7, (2, 0, 1))])
def test_a_row_takes_part_in_a_dependency_with_seven_digits(weight, dependency):
    found = Dependence((0, 1), (2,), ({0: 1.0, 1: weight},))
    assert found.selection.dependencies == (dependency,)


@pytest.mark.parametrize(("times", "are_taken"), [(3.0, False), (5.0, True)])
def test_other_rows_are_taken_where_they_are_four_times_as_far_from_dependent_ones(
    times, are_taken, monkeypatch
):
    monkeypatch.setattr(independent_rows, "dependence", lambda *_: SimpleNamespace(independent=(1,)))
    monkeypatch.setattr(independent_rows, "rebased", lambda *_: "others")
    selection = SimpleNamespace(dependencies=((1, 0),), independent=(0,))
    rows = SimpleNamespace(is_large=False, dense=np.array([[0.1], [0.1 * times]]))
    found = independent_rows.elsewhere(selection, rows, 0)
    assert (found == "others") is are_taken


def test_six_dependencies_are_listed_and_twenty_rows_of_one_are_named():
    assert len(independent_rows.shares([["a", "b"]] * 6)) == 6
    assert independent_rows.shares([["a", "b"]] * 8)[6:] == ["and 2 more"]
    for count, shown in ((20, 20), (21, 20)):
        (text,) = independent_rows.shares([[f"r{k}" for k in range(count)]])
        assert text.count("`r") == shown
        assert ("..." in text) is (count > shown)


# Switches at the start and on the way


def one_kink(slope):
    """A row of one coordinate with this slope."""
    entries = (np.zeros(1, dtype=int), np.zeros(1, dtype=int))
    return Kinks(("row",), lambda t, q, p: ca.DM([slope(float(q[0]))]), entries, lambda t, q, p: ca.DM(1.0))


# At 1 the sides are looked at so many times this way off.
WAY = np.random.default_rng(0).standard_normal(1)[0]


@pytest.mark.parametrize(("off", "jumps"), [(3e-10, True), (3e-9, False)])
def test_a_switch_is_looked_at_nine_digits_off(off, jumps):
    edge = 1.0 + off * WAY
    assert (one_kink(lambda x: 1.0 + (x > edge)).at(0.0, np.ones(1), NOTHING) is not None) is jumps


@pytest.mark.parametrize(("off", "jumps"), [(3e-6, False), (3e-5, True)])
def test_a_jump_is_compared_with_what_changes_farther_off(off, jumps):
    edge = 1.0 + off * WAY
    kink = one_kink(lambda x: 1.0 + 0.05 * (x > 1.0) + (x > edge))
    assert (kink.at(0.0, np.ones(1), NOTHING) is not None) is jumps


@pytest.mark.parametrize(("size", "jumps"), [(3e-7, False), (3e-6, True)])
def test_a_gradient_jumps_by_a_millionth(size, jumps):
    kink = one_kink(lambda x: 1.0 + size * (x > 1.0))
    assert (kink.at(0.0, np.ones(1), NOTHING) is not None) is jumps


# Values that jump at a switch


def sides(*values):
    return Sides(tuple(np.array([float(x)]) for x in values))


@pytest.mark.parametrize(("near", "jumps"), [(0.1, False), (0.5, True), (2.0, True), (20.0, False)])
def test_what_draws_near_as_the_distance_shrinks_is_no_jump(near, jumps):
    assert bool(sides(0, 0, near, 1).jumps()[0]) is jumps


@pytest.mark.parametrize(("factor", "grows"), [(3, False), (30, True)])
def test_a_pole_grows_by_more_than_ten(factor, grows):
    assert bool(sides(1, factor, factor, 1).grows()[0]) is grows


@pytest.mark.parametrize(("change", "is_jump"), [(3e-10, False), (3e-9, True)])
def test_a_change_of_nine_digits_less_is_rounding(change, is_jump):
    values = np.array([1.0, 1.0, 1.0 + change, 1.0 + change])
    assert bool(value_jumps(tuple(values[:, None]))[0]) is is_jump


T, Q, V, P = ca.SX.sym("t"), ca.SX.sym("q", 1), ca.SX.sym("v", 1), ca.SX.sym("p", 0)
INPUTS = [T, Q, V, P]
FROM_ONE = Starts(0.0, np.ones((1, 1)), np.zeros(1), ca.DM(0, 1), 1.0)


@pytest.mark.parametrize(("width", "jumps"), [(1e-14, True), (6e-13, False)])
def test_a_value_is_looked_at_beside_a_switch(width, jumps):
    value = Local(ca.tanh(Q / width), INPUTS)
    assert jump_search.jumps(value, Q, INPUTS, FROM_ONE) is jumps


def test_a_root_across_a_switch_is_no_jump():
    value = Local(ca.sign(Q) * ca.sqrt(ca.fabs(Q)), INPUTS)
    assert not jump_search.jumps(value, Q, INPUTS, FROM_ONE)


def test_a_small_jump_on_a_slope_is_one():
    value = Local(Q + 1e-11 * ca.sign(Q), INPUTS)
    assert jump_search.jumps(value, Q, INPUTS, FROM_ONE)


def test_a_switch_is_sought_from_twelve_starts_about_the_state():
    assert jump_search.starts((0.0, np.zeros(2), np.zeros(2)), NOTHING).q.shape == (2, 13)


def test_a_switch_is_found_to_rounding():
    # A value that turns within a hundredth of the switch is no jump at it.
    value = Local(ca.tanh(1e4 * (Q - 0.3)), INPUTS)
    assert not jump_search.jumps(value, Q - 0.3, INPUTS, FROM_ONE)


# Cuts of angles


class Change:
    """What one turn changes a row by: the change, its slope along the way and its scale; `places` are those asked."""

    def __init__(self, by, along, scale, n=1):
        self.found, self.n, self.places = [by, along, scale], n, []

    def size1_in(self, number):
        return 1 + self.n

    def size1_out(self, number):
        return 1

    def __call__(self, t, q, p, direction):
        self.places.append(np.array(q))
        return ca.DM([self.found])


@pytest.mark.parametrize(
    ("by", "along", "verdict"),
    [
        (1.0, 3e-10, branch_cuts.PASSED),
        (1.0, 3e-9, branch_cuts.JUMPS),
        (3e-10, 1.0, branch_cuts.SAME),
        (3e-9, 1.0, branch_cuts.JUMPS),
    ],
)
def test_one_turn_changes_a_row_by_a_constant_to_nine_digits(by, along, verdict):
    assert branch_cuts._verdicts(Change(by, along, 1.0), 0.0, np.ones(1), NOTHING) == (verdict,)


def test_a_turn_is_looked_at_in_three_places_beside_the_start():
    change = Change(1.0, 0.0, 1.0, 900)
    branch_cuts._verdicts(change, 0.0, np.ones(900), NOTHING)
    away = [np.linalg.norm(place - 1.0) / 30 for place in change.places]
    assert away == pytest.approx([0.0, 0.3, 0.3, 0.3], rel=0.1)


def cuts(**more):
    given = dict.fromkeys(("f", "references", "value", "angles", "change"))
    given |= {"periods": np.array([2 * np.pi]), "rows": (), "nodes": (), "verdicts": ()}
    return Cuts(**{**given, **more})


class OfAngle:
    def __init__(self, function):
        self.function = function

    def size1_in(self, number):
        return 1

    def __call__(self, t, q, p):
        return ca.DM([self.function(p)])


@pytest.mark.parametrize(("off", "is_turned"), [(3e-10, True), (3e-9, False)])
def test_an_angle_on_its_cut_lies_on_the_better_side(off, is_turned):
    angle = math.pi - off
    found = cuts(angles=OfAngle(lambda p: angle), value=OfAngle(lambda p: p[0] + 4.0))
    assert bool(found.begin(0.0, NOTHING, np.zeros(1))[0]) is is_turned


@pytest.mark.parametrize(("off", "count"), [(3e-10, 1), (3e-9, 2)])
def test_a_multiple_of_a_jump_is_none_of_its_own(off, count):
    class Changes:
        def size1_in(self, number):
            return 1

        def __call__(self, *_):
            return ca.DM([1.0, 2.0 + off])

    passed = (branch_cuts.PASSED,) * 2
    found = cuts(rows=(0, 0), nodes=(0, 1), verdicts=passed, angles=OfAngle(None), change=Changes())
    assert len(found.jumps(0.0, NOTHING, np.zeros(1))[0]) == count
