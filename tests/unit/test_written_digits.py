"""The digits of a table: how many all of its numbers have."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.auditing.evidence import table_input
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.table_input import ALL, WrittenDigits
from lagcli.auditing.evidence.tolerances import SAFETY, Tolerance

T = np.array([0.0, 0.5, 1.0])


def generic(count: int = 400) -> Array:
    return np.asarray(
        np.random.default_rng(2).standard_normal(count) * 10.0 ** np.arange(-2, 2).repeat(count // 4)
    )


def rounded(numbers: Array, digits: int) -> Array:
    return np.array([float(f"{x:.{digits}g}") for x in numbers])


def of(numbers: Array, t: Array = T) -> WrittenDigits:
    return table_input.digits_of(numbers[:, None], t)


@pytest.mark.parametrize("digits", [6, 8, 9, 10, 12])
def test_significant_digits_are_counted(digits: int) -> None:
    assert of(rounded(generic(), digits)) == WrittenDigits(digits=digits)


@pytest.mark.parametrize("decimals", [4, 6, 9])
def test_decimals_are_counted(decimals: int) -> None:
    assert of(np.round(generic(), decimals)) == WrittenDigits(decimals=decimals)


def test_numbers_with_all_digits_are_not_rounded() -> None:
    assert of(generic()) is ALL
    assert of(np.concatenate([rounded(generic(), 8), [np.pi]])) is ALL
    assert of(1e6 * (2 + generic())) is ALL


@pytest.mark.parametrize(("digits", "is_short"), [(14, True), (15, False)])
def test_a_table_of_fourteen_digits_is_rounded_and_one_of_fifteen_is_not(digits: int, is_short: bool) -> None:
    assert of(rounded(generic(), digits)).is_short == is_short


@pytest.mark.parametrize(("count", "is_told"), [(1, False), (5, False), (9, True), (50, True)])
def test_forty_digits_tell_that_numbers_are_rounded(count: int, is_told: bool) -> None:
    found = of(rounded(np.sqrt(10 * np.arange(count) + 2), 7))
    assert (found.digits, found.is_told) == (7, is_told)


@pytest.mark.parametrize(("others", "is_short"), [(8, True), (14, False)])
def test_of_rounded_numbers_most_end_at_the_last_place(others: int, is_short: bool) -> None:
    shorter = rounded(np.sqrt(10 * np.arange(others) + 3), 5)
    numbers = np.concatenate([rounded(np.sqrt(10 * np.arange(10) + 2), 7), shorter])
    assert of(numbers).is_short == is_short


def test_numbers_that_are_short_by_themselves_hide_no_rounding() -> None:
    """A coordinate that moves evenly has numbers as short as those of its times."""
    heavy = rounded(generic(), 8)
    assert of(np.concatenate([heavy, np.arange(1, 800) / 100])) == WrittenDigits(digits=8)


def test_no_more_than_two_thousand_numbers_are_looked_at_where_all_digits_are_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts: list[int] = []
    judged = table_input._of_numbers

    def counted(numbers: Array) -> WrittenDigits:
        counts.append(len(numbers))
        return judged(numbers)

    monkeypatch.setattr(table_input, "_of_numbers", counted)
    assert of(generic(100_000)) is ALL
    assert counts == [2000]
    # Of a table that is rounded all are looked at: one number that is not tells.
    counts.clear()
    numbers = rounded(generic(100_000), 8)
    numbers[1] = np.pi
    assert of(numbers) is ALL
    assert len(counts) == 2


def test_a_digit_is_compared_with_two_units_in_the_last_place() -> None:
    wide = Tolerance(1e-11, 1e-13).by(WrittenDigits(digits=8))
    assert SAFETY * wide.rtol == pytest.approx(2e-7, rel=0.01)
    wide = Tolerance(1e-11, 1e-13).by(WrittenDigits(decimals=8))
    assert SAFETY * wide.atol == pytest.approx(2e-8, rel=0.01)
    assert Tolerance(1e-11, 1e-13).by(ALL) == Tolerance(1e-11, 1e-13)


def test_times_of_a_grid_are_exact_and_others_are_rounded() -> None:
    assert of(rounded(generic(), 6)).time == 0
    thirds = rounded(np.arange(4) / 3, 6)
    assert of(rounded(generic(), 6), thirds).time == pytest.approx(5e-6)
