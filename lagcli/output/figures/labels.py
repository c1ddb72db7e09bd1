"""Texts in a figure: those of strangers without control characters and cut where they are very long; labels of units.

A figure of a label of thousands of letters would take minutes to be measured, or leave its axes no room.
"""

from __future__ import annotations

import dataclasses
from typing import Protocol

from lagcli.errors import diagnostics
from lagcli.model.dimension_facts import DimensionFacts

# Letters; the tests draw longer ones. A title of so many fills about three lines, a name about one, and a unit leaves
# the axis it labels its room.
TITLE, NAME, UNIT = 300, 100, 40
_RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹"


@dataclasses.dataclass(frozen=True, slots=True)
class ShortUnits:
    """Labels of the units of length, mass and time, none longer than UNIT."""

    length: str
    mass: str
    time: str


def shortened(text: str, most: int) -> str:
    """The text with at most so many letters: its beginning and its end, with an ellipsis between them."""
    plain = diagnostics.printable(text)
    if len(plain) <= most:
        return plain
    end = most // 4
    return f"{plain[: most - end - 1]}…{plain[-end:]}"


class UnitLabels(Protocol):
    """Labels of the units of length, mass and time."""

    @property
    def length(self) -> str: ...
    @property
    def mass(self) -> str: ...
    @property
    def time(self) -> str: ...


def force_unit(units: UnitLabels, length_power: int = 1) -> str:
    """The label of mass length^p / time^2: a force for ``length_power`` 1, a force times a length for 2.

    Newton and its multiples where the labels are kg, m, s; empty where all labels are empty or "1".
    """
    labels = [units.mass.strip(), units.length.strip(), units.time.strip()]
    if labels == ["kg", "m", "s"]:
        more = length_power - 1
        return f"N·{_power('m', more)}" if more > 0 else f"N/{_power('m', -more)}" if more else "N"
    # A label of more than one word is one unit here, so a power must not fall on its last letter only.
    mass, length, time = (label if label.isalnum() or not label else f"({label})" for label in labels)
    above = [mass] * (mass not in ("", "1"))
    below = [_power(time, 2)] * (time not in ("", "1"))
    if length_power and length not in ("", "1"):
        (above if length_power > 0 else below).append(_power(length, abs(length_power)))
    return " ".join(above) if not below else "/".join([" ".join(above) or "1", *below])


def _power(label: str, exponent: int) -> str:
    return label if exponent == 1 else label + "".join(_RAISED[int(digit)] for digit in str(exponent))


def with_unit(quantity: str, unit: str) -> str:
    """A label such as ``t  (s)``; the quantity alone where it has no unit."""
    return f"{quantity}  ({unit})" if unit not in ("", "1") else quantity


def multiplier_unit(column: str, units: UnitLabels, known: DimensionFacts) -> str:
    """The label of the unit of a column `lambda.NAME`: newton where f is a length, N·m where it is an angle or a
    number, else what its equation says."""
    power = known.length(column.removeprefix("lambda."))
    if power is not None and power == int(power):
        return force_unit(units, length_power=2 - int(power))
    return f"{force_unit(units, length_power=2) or '1'} / unit of fᵢ"
