"""The digits that the numbers of a table have: one that was rounded is known to its last digit, and no better.

A run writes numbers with all their digits, so that nearly all have 16 or 17. A spreadsheet keeps fewer, of each number
or behind its point, and then all numbers show it.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.auditing.evidence import differences
from lagcli.auditing.evidence.autodiff import Array


class DigitsParameters:
    """Limits of taking the numbers of a table for rounded ones.

    The tests are of `tests/unit/test_written_digits.py`.
    """

    __slots__ = ()

    most: int = 14
    """Digits of a rounded table: doubles with 15 cannot be told from those with all.
    `test_a_table_of_fourteen_digits_is_rounded_and_one_of_fifteen_is_not` fails at 1 and 140."""
    numbers: int = 4
    """Different numbers that end at the last place: a few may be short by chance, or as they were declared.
    `test_four_numbers_tell_the_digits` fails at 1 and 40."""
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
    the last place of the times, 0 where they have fewer digits."""

    digits: int = 0
    decimals: int = 0
    time: float = 0.0

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

    def of_times(self, t: Array) -> WrittenDigits:
        """Add the digits of times (T,), which may be fewer: those of a grid are exact."""
        if (
            not self.is_short
            or _is_whole(np.abs(t[t != 0]), self.digits + self.decimals - 1, self.digits > 0).all()
        ):
            return self
        half = self.part * float(np.abs(t).max(initial=0.0)) + self.unit
        return dataclasses.replace(self, time=max(self.time, half))

    def coarser(self, other: WrittenDigits) -> WrittenDigits:
        """The fewer digits of two tables."""
        digits = min((k for k in (self.digits, other.digits) if k), default=0)
        decimals = min((k for k in (self.decimals, other.decimals) if k), default=0)
        return WrittenDigits(digits, decimals, max(self.time, other.time))

    @property
    def sentence(self) -> str:
        """The sentence of a report."""
        counts = [
            f"{count} {word}"
            for count, word in ((self.digits, "digits"), (self.decimals, "decimals"))
            if count
        ]
        return f"The table has {' and '.join(counts)}: judged by them."

    def as_json(self) -> dict[str, int]:
        """The object of `lagcli audit --json`."""
        return {"digits": self.digits, "decimals": self.decimals}


ALL = WrittenDigits()


def of(rows: Array, t: Array) -> WrittenDigits:
    """The digits of the numbers of a table, with its times t (T,) among them or not."""
    numbers = np.abs(rows[np.isfinite(rows) & (rows != 0)])
    found = ALL
    for part in (numbers[:: max(1, len(numbers) // PARAMETERS.sample)], numbers):
        found = _of_numbers(np.unique(part))
        if not found.is_short:
            return ALL
    return found.of_times(t)


def _of_numbers(numbers: Array) -> WrittenDigits:
    """The digits of different numbers, or their decimals where more of them end at the last one."""
    is_short = _is_whole(numbers, PARAMETERS.most, significant=True)
    digits, ending = _ending(numbers, True) if is_short.all() else (0, 0)
    decimals, others = _ending(numbers, False, is_short) if is_short.any() else (0, 0)
    if max(ending, others) < PARAMETERS.numbers:
        return ALL
    return WrittenDigits(digits=digits) if ending >= others else WrittenDigits(decimals=decimals)


def _ending(numbers: Array, significant: bool, counted: Array | bool = True) -> tuple[int, int]:
    """The least count of digits, or of decimals, that all numbers have, and how many of those counted end there."""
    fewer = np.zeros(len(numbers), dtype=bool)
    for count in range(1, PARAMETERS.most + 1):
        enough = _is_whole(numbers, count, significant)
        if enough.all():
            return count, int((~fewer & counted).sum())
        fewer = enough
    return 0, 0


def _is_whole(numbers: Array, count: int, significant: bool) -> Array:
    """True for positive numbers that end at so many digits, or decimals."""
    power = count - 1 - np.floor(np.log10(numbers)) if significant else np.full(numbers.shape, float(count))
    power = np.clip(power, -300, 300)
    scaled = np.where(power >= 0, numbers * 10.0 ** np.abs(power), numbers / 10.0 ** np.abs(power))
    return np.asarray(np.abs(scaled - np.rint(scaled)) <= 4 * differences.EPS * scaled)
