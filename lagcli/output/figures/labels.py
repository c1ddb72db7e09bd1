"""Texts of strangers in a figure: without control characters, and cut where they are very long.

A figure of a label of thousands of letters would take minutes to be measured, or leave its axes no room.
"""

from __future__ import annotations

import dataclasses

from lagcli.errors import diagnostics

# Letters; the tests draw longer ones. A title of so many fills about three lines, a name about one, and a unit leaves
# the axis it labels its room.
TITLE, NAME, UNIT = 300, 100, 40


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
