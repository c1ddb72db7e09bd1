"""The numbers of slopes and integrals that an audit takes of a table: on either side of each another bound."""

import numpy as np
import pytest

from lagcli.auditing.evidence import differences
from lagcli.auditing.evidence.differences import DifferenceGrid

NOTHING = np.zeros(1)


def column(values):
    return np.asarray(values, dtype=float)[:, None]


def grid(count, step=1.0):
    return DifferenceGrid(step * np.arange(count))


def test_slopes_are_taken_over_five_to_thirteen_rows():
    widths = [places.shape[1] for places, _ in grid(40)._stencils]
    assert widths == [5, 7, 9, 11, 13]
    t = 0.1 * np.arange(40)
    found = grid(40, 0.1).derivative(column(np.sin(t)), NOTHING)
    assert np.abs(found.value[6:-6, 0] - np.cos(t[6:-6])).max() < 1e-13
    assert np.isinf(grid(6).derivative(column(np.zeros(6)), NOTHING).truncation).all()  # of one width


def test_an_integral_is_exact_for_polynomials_through_twelve_rows():
    found = grid(12)
    assert found.integral(column(np.arange(12.0) ** 11), NOTHING).value[-1, 0] == pytest.approx(11**12 / 12)
    assert grid(40)._quadrature[0][0].shape[1] == 12


def test_rows_are_combined_sixty_four_at_a_time():
    asked = []

    class Column:
        shape = (200, 1)

        def __getitem__(self, rows):
            asked.append(rows)
            return np.ones((rows.stop - rows.start, 1))

    places = np.arange(200)[:, None]
    differences.combined(places, np.ones((200, 1)), Column())
    assert len(asked) == 4


def test_a_truncation_counts_four_rows_around():
    spike = np.zeros(100)
    spike[50] = 1.0
    bounds = np.diff(grid(100).integral(column(spike), NOTHING).truncation[:, 0])
    # Second differences around the spike bound the steps from row 44 on and up to row 56.
    assert np.flatnonzero(bounds).tolist() == list(range(44 - 4, 55 + 4 + 1))


def narrow_slopes(t, y, width):
    """Slopes at each row by polynomials through rows around it."""
    found = []
    for row in range(len(t)):
        first = min(max(row - width // 2, 0), len(t) - width)
        taken = slice(first, first + width)
        found.append(np.polyval(np.polyder(np.polyfit(t[taken] - t[row], y[taken], width - 1)), 0.0))
    return np.array(found)


def test_the_bound_of_a_slope_is_eight_differences_of_two_stencils_and_more_at_ends():
    t = 0.1 * np.arange(7)
    found = grid(7, 0.1).derivative(column(t**6), NOTHING).truncation[:, 0]
    apart = np.abs(narrow_slopes(t, t**6, 5) - 6 * t**5)
    assert found[3] == pytest.approx(8 * apart.max(), rel=1e-3)
    assert found[0] == pytest.approx(6 * 8 * apart[:5].max(), rel=1e-3)


def test_a_difference_that_vanishes_by_chance_counts_by_a_tenth_of_the_one_before():
    t = 0.1 * np.arange(9)
    found = grid(9, 0.1).derivative(column(t**6), NOTHING).truncation[:, 0]
    apart = np.abs(narrow_slopes(t, t**6, 5) - 6 * t**5)  # and 7 rows differ from 9 by nothing
    assert found[4] == pytest.approx(0.1 * 8 * apart.max(), rel=1e-3)


@pytest.mark.parametrize(("turn", "is_resolved"), [(1.0, True), (1.6, True), (1.8, False), (2.5, False)])
def test_rows_resolve_what_wider_stencils_come_closer_together_for(turn, is_resolved):
    found = grid(60).resolved(column(np.sin(turn * np.arange(60))), NOTHING)
    assert bool(found[30, 0]) is is_resolved


@pytest.mark.parametrize(("size", "is_resolved"), [(3e-7, True), (3e-6, False)])
def test_differences_of_a_millionth_of_the_slopes_are_resolved(size, is_resolved):
    t = np.arange(60.0)
    # Wider stencils of this wave come no closer together: they differ by 0.157.
    found = grid(60).resolved(column(t + size / 0.157 * np.sin(2.5 * t)), NOTHING)
    assert bool(found[30, 0]) is is_resolved


def roughness(kink):
    """Of a column that has a kink at this time."""
    t = np.arange(60.0)
    return grid(60).roughness(column(np.maximum(t - kink, 0.0)), column(t > kink))[:, 0]


def test_a_kink_is_felt_six_rows_around_its_differences_of_order_eight():
    found = roughness(30.5)
    assert found.max() == pytest.approx(0.7)
    assert np.flatnonzero(found).tolist() == list(range(21, 41))


def test_a_kink_at_the_end_of_a_table_weighs_more():
    assert roughness(0.5).max() == pytest.approx(0.75)
