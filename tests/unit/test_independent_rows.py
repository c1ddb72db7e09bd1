"""The choice of independent rows: which of several alike is taken does not depend on rounding."""

import warnings

import casadi as ca
import numpy as np
import pytest

from lagcli.linear import independent_rows
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows

ROOT = np.sqrt(0.5)
# The third is a combination of the first two, and the fourth is the first but for rounding.
ROWS = np.array([[1.0, 0, 0], [0, 1, 0], [ROOT, ROOT, 0], [1 - 1e-15, 0, 0], [0, 0, 0.5]])


def test_the_first_of_several_alike_is_taken():
    assert independent_rows.farthest(ROWS, 3) == [0, 1, 4]
    assert independent_rows.farthest(ROWS, 3, nearly=0.3) == [0, 1, 4]
    assert independent_rows.farthest(ROWS[::-1], 3, nearly=1 - 1e-9) == [1, 3, 0]


def test_given_rows_come_before_all():
    assert independent_rows.farthest(ROWS, 3, [2]) == [2, 0, 4]
    assert independent_rows.farthest(ROWS, 3, [4, 1]) == [4, 1, 0]


def test_it_ends_where_nothing_is_left():
    assert independent_rows.farthest(ROWS[:4], 3, least=1e-9) == [0, 1]
    assert independent_rows.farthest(np.zeros((0, 3)), 0) == []


@pytest.mark.parametrize("turn", range(5))
def test_leading_rows_depend_on_none_before_them(turn):
    rows = np.roll(ROWS, turn, axis=0)
    ranks = [np.linalg.matrix_rank(rows[: k + 1], tol=1e-9) for k in range(len(rows))]
    new = [k for k, rank in enumerate(ranks) if rank > (ranks[k - 1] if k else 0)]
    assert independent_rows.leading(rows, 1e-6) == new


@pytest.mark.parametrize("gain", [1e-310, 1e-300, 1e-200, 1.0, 1e200, 1e300])
@pytest.mark.parametrize("mass", [1e-300, 1e-100, 1.0, 1e100, 1e300])
def test_a_row_and_its_inertia_may_have_any_size(gain, mass):
    """The length of the row in the metric, gain / sqrt(mass), may be no number; the step is one."""
    rows = MetricRows(ca.DM([[gain, 0.0], [0.0, 1.0]]), Metric(ca.DM(np.diag([mass, 1.0]))))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        step = rows.take([0, 1]).correction(np.array([1e-3 * gain, 2.0]))
    np.testing.assert_allclose(step, [-1e-3, -2.0], rtol=1e-9)
    assert (rows.lengths > 0).all()
    assert np.isfinite(rows.lengths).all()
