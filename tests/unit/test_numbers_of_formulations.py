"""The numbers that formulations are compared by: two inputs beside each, with different answers."""

import dataclasses

import numpy as np
import pytest

from lagcli.formulations import comparison, stiff_ladder
from lagcli.formulations.comparison import Formulation, RunEvent


def run(values: list[float]) -> Formulation:
    """A run with a large column and one of these values."""
    rows = np.array([[t, 5.0, value] for t, value in enumerate(values)])
    return Formulation("newton", "", 1, 1, 0, 1, 0.0, ("t", "a.x", "a.vx"), rows, 1.0)


@pytest.mark.parametrize(("size", "error"), [(1e-11, 1.0), (1e-13, 0.0)])
def test_columns_that_are_rounding_beside_the_table_have_no_error(size: float, error: float) -> None:
    kinds = {"a.x": "r", "a.vx": "v"}
    found = comparison.compare(kinds, run([size, 0.0]), run([0.0, 0.0]), np.zeros(2, dtype=bool))
    assert found["v"].error == error


@pytest.mark.parametrize(("before_end", "alone"), [(1e-5, True), (1e-7, False)])
def test_an_incident_at_the_very_end_may_be_of_one_run_alone(before_end: float, alone: bool) -> None:
    event = RunEvent(10.0 - before_end * 10.0, "impact", "floor")
    found = comparison.matched([event], [], end=10.0, span=10.0)
    assert (found.alone is not None) == alone


@pytest.mark.parametrize(("error", "digits"), [(0.0, 16.0), (1e-15, 15.0), (1e-20, 16.0)])
def test_no_more_digits_are_reported_than_a_double_has(error: float, digits: float) -> None:
    assert comparison.Agreement(1, error, "", 0.0).digits == pytest.approx(digits)


def test_a_ladder_has_two_rungs_a_decade_and_two_hundred_at_most() -> None:
    assert len(stiff_ladder.rungs("1e3:1e6")) == 7
    assert len(stiff_ladder.rungs("1e3:1e6:200")) == 200
    with pytest.raises(ValueError, match="from 2 to 200"):
        stiff_ladder.rungs("1e3:1e6:201")


def test_parting_is_told_from_the_first_row_beyond_the_tolerance() -> None:
    first = run([0.0, 0.0, 0.0])
    rows = first.table.copy()
    rows[1:, 1] += [4e-8, 6e-8]
    found = comparison.parting({"a.x": "r"}, first, dataclasses.replace(first, table=rows), 1e-8)
    assert found is not None
    assert (found.t, found.column, found.t_largest) == (2.0, "a.x", 2.0)
