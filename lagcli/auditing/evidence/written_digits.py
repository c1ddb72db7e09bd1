"""The digits that the numbers of a table have: one that was rounded is known to its last digit, and no better.

A run writes numbers with all their digits, so that nearly all have 16 or 17. A spreadsheet keeps fewer, of each number
or behind its point, and then all numbers show it. Numbers of a simple motion may be short by themselves: they have many
lengths, where those of a rounded table nearly all end at one place.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence.autodiff import Array


class DigitsParameters:
    """Limits of taking the numbers of a table for rounded ones.

    The tests are of `tests/unit/test_written_digits.py`.
    """

    __slots__ = ()

    most: int = 14
    """Digits of a rounded table: doubles with 15 cannot be told from those with all.
    `test_a_table_of_fourteen_digits_is_rounded_and_one_of_fifteen_is_not` fails at 1 and 140."""
    together: int = 40
    """Digits of the different numbers that end at the last place, together: a few may be short by chance, or as they
    were declared. `test_forty_digits_tell_that_numbers_are_rounded` fails at 4 and 400."""
    ending: float = 0.5
    """Part of the different numbers that end at the last place: of rounded ones nine in ten do.
    `test_of_rounded_numbers_most_end_at_the_last_place` fails at 0.05 and 5."""
    own: int = 3
    """Digits less than the others by which a number is short by itself, as one that was declared or moves evenly:
    rounding leaves so few of one in a thousand.
    `test_numbers_that_are_short_by_themselves_hide_no_rounding` fails at 30."""
    certain: int = 8
    """Digits that are rounded ones for certain: no simple numbers have so many. With fewer, most of the rows must be
    off by the rounding. `test_a_wrong_row_of_short_numbers_is_no_rounding` of `tests/physics/test_audit_tables.py`
    fails at 0.8, `test_a_table_rounded_by_a_spreadsheet_is_judged_by_its_digits` at 80."""
    everywhere: float = 0.5
    """Part of the rows that a table of fewer digits is wrong at: an error spoils its neighbours alone.
    `test_a_wrong_row_of_short_numbers_is_no_rounding` of `tests/physics/test_audit_tables.py` fails at 0.05,
    `test_a_table_rounded_by_a_spreadsheet_is_judged_by_its_digits` at 5."""
    halves: float = 4.0
    """Halves of a unit in the last place that a limit has for each number: several are rounded in a sum.
    `test_a_digit_is_compared_with_two_units_in_the_last_place` fails at 0.4 and 40."""
    sample: int = 2000
    """Numbers that are looked at first: of a table with all digits no more.
    `test_no_more_than_two_thousand_numbers_are_looked_at_where_all_digits_are_there` fails at 200 and 20000."""


PARAMETERS = DigitsParameters()


@dataclasses.dataclass(frozen=True, slots=True)
class WrittenDigits:
    """The rounding of numbers: to a count of digits, or of decimals; 0 where they were not. time: half of a unit in
    the last place of the times, 0 where they have fewer digits. is_told: False where there are too few numbers to tell
    whether they were rounded so, or are short by themselves."""

    digits: int = 0
    decimals: int = 0
    time: float = 0.0
    is_told: bool = True

    @property
    def part(self) -> float:
        """Half of a unit in the last place, as the largest part of a number."""
        return 0.5 * 10.0 ** (1 - self.digits) if self.digits else 0.0

    @property
    def unit(self) -> float:
        """Half of a unit of the last decimal."""
        return 0.5 * 10.0**-self.decimals if self.decimals else 0.0

    @property
    def is_short(self) -> bool:
        """True for a table that was rounded."""
        return self.part + self.unit > 0

    @property
    def is_certain(self) -> bool:
        """True for so many digits that they are short by rounding alone."""
        return max(self.digits, self.decimals) >= PARAMETERS.certain

    def sentence(self, table: str = "table") -> str:
        """The sentence of a report on a table."""
        count = f"{self.digits} digits" if self.digits else f"{self.decimals} decimals"
        return f"The {table} has {count}: judged by them."

    def as_json(self) -> dict[str, int]:
        """The object of `lagcli audit --json`."""
        return {"digits": self.digits, "decimals": self.decimals}


ALL = WrittenDigits()


def of(rows: Array, t: Array) -> WrittenDigits:
    """The digits of the numbers of a table, with its times t (T,) among them or not."""
    numbers = np.abs(rows[np.isfinite(rows) & (rows != 0)])
    digits = ALL
    for part in (numbers[:: max(1, len(numbers) // PARAMETERS.sample)], numbers):
        digits = _of_numbers(np.unique(part))
        # A column that moves would tell its digits in so many rows.
        enough = len(t) * max(digits.digits, digits.decimals) >= PARAMETERS.together
        if not digits.is_short or (enough and not digits.is_told):
            return ALL
    # Times may have fewer: those of a grid are exact.
    if _is_whole(np.abs(t[t != 0]), digits.digits + digits.decimals - 1, digits.digits > 0).all():
        return digits
    return dataclasses.replace(digits, time=digits.part * float(np.abs(t).max(initial=0.0)) + digits.unit)


def _of_numbers(numbers: Array) -> WrittenDigits:
    """The digits of different numbers, or their decimals where more of them end at the last one."""
    is_short = _is_whole(numbers, PARAMETERS.most, significant=True)
    digits, ending = _ending(numbers, True) if is_short.all() else (0, ~is_short)
    decimals, others = _ending(numbers, False) if is_short.any() else (0, ~is_short)
    others &= is_short
    if np.sum(ending) >= np.sum(others):
        is_own = _is_whole(numbers, digits - PARAMETERS.own, significant=True)
        return _rounding(WrittenDigits(digits=digits), ending, digits, ~is_own)
    counts = decimals + np.maximum(1.0 + np.floor(np.log10(numbers)), 0)
    looked = is_short & ~_is_whole(numbers, decimals - PARAMETERS.own, significant=False)
    return _rounding(WrittenDigits(decimals=decimals), others, counts, looked)


def _rounding(written: WrittenDigits, ending: Array, counts: Array | int, looked: Array) -> WrittenDigits:
    """The digits where most numbers end at the last place, with so many digits each, else all; looked: those of which a
    part must, as the others are short by themselves."""
    if np.sum(ending) < PARAMETERS.ending * np.sum(looked):
        return ALL
    together = float(np.sum(ending * counts))
    return dataclasses.replace(written, is_told=together >= PARAMETERS.together)


def _ending(numbers: Array, significant: bool) -> tuple[int, Array]:
    """The least count of digits, or of decimals, that all numbers have, and which end there."""
    fewer = np.zeros(len(numbers), dtype=bool)
    for count in range(1, PARAMETERS.most + 1):
        enough = _is_whole(numbers, count, significant)
        if enough.all():
            return count, ~fewer
        fewer = enough
    return 0, np.zeros(len(numbers), dtype=bool)


def _is_whole(numbers: Array, count: int, significant: bool) -> Array:
    """True for positive numbers that end at so many digits, or decimals."""
    power = count - 1 - np.floor(np.log10(numbers)) if significant else np.full(numbers.shape, float(count))
    power = np.clip(power, -300, 300)
    scaled = np.where(power >= 0, numbers * 10.0 ** np.abs(power), numbers / 10.0 ** np.abs(power))
    return np.asarray(np.abs(scaled - np.rint(scaled)) <= 4 * doubles.EPS * scaled)
