"""The points of a sweep: grids, tables, and products of them. A point is a tuple of numbers, one for each name.

Points are made when they are asked for: a grid of a billion points takes no memory.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lagcli.expression import parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import given_expression
from lagcli.model.model import Model

Floats = npt.NDArray[np.float64]
Point = tuple[float, ...]

MOST_IN_RANGE = 100_000_000  # numbers of one range, which are held in memory: 0.8 GB


class BadPoints(ValueError):
    """Points that are none; the message says which option and where."""


class SweepPoints(Protocol):
    """Points in their order."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names for `--set`."""

    @property
    def count(self) -> int:
        """The number of points."""

    @property
    def digest(self) -> str:
        """A text that tells them apart from other points."""

    def point(self, number: int) -> Point:
        """The numbers of a point, counted from 0."""


class TableOfPoints:
    """Points as rows of numbers (T, len(names)). Raises `BadPoints` for a number that is none."""

    def __init__(self, names: Sequence[str], rows: Floats, label: str) -> None:
        self.names, self._rows = tuple(names), np.ascontiguousarray(rows, dtype=np.float64)
        if not self.names:
            raise BadPoints(f"{label}: there is no column")
        twice = [name for name in self.names if self.names.count(name) > 1]
        if twice:
            raise BadPoints(f"{label}: there are two columns `{twice[0]}`")
        bad = np.argwhere(~np.isfinite(self._rows))
        if len(bad):
            row, column = bad[0]
            raise BadPoints(f"{label}: row {row + 1}: the column `{self.names[column]}` has no finite number")

    @property
    def count(self) -> int:
        """The number of rows."""
        return len(self._rows)

    @property
    def digest(self) -> str:
        """See `SweepPoints`."""
        found = hashlib.sha256("\0".join(self.names).encode())
        found.update(str(self._rows.shape).encode())
        found.update(self._rows.astype("<f8", copy=False).tobytes())
        return found.hexdigest()

    def point(self, number: int) -> Point:
        """See `SweepPoints`."""
        return tuple(self._rows[number].tolist())


class PointProduct:
    """Every point of the first with every one of the second, and so on; the last changes first."""

    def __init__(self, parts: Sequence[SweepPoints]) -> None:
        self._parts = tuple(parts)
        self.names = tuple(name for part in parts for name in part.names)
        twice = [name for name in self.names if self.names.count(name) > 1]
        if twice:
            raise BadPoints(f"`{twice[0]}` is given twice")

    @property
    def count(self) -> int:
        """The product of their counts."""
        return math.prod(part.count for part in self._parts)

    @property
    def digest(self) -> str:
        """See `SweepPoints`."""
        return " x ".join(part.digest for part in self._parts)

    def point(self, number: int) -> Point:
        """See `SweepPoints`."""
        found: list[Point] = []
        for part in reversed(self._parts):
            number, index = divmod(number, part.count)
            found.append(part.point(index))
        return tuple(value for values in reversed(found) for value in values)


def joined(parts: Sequence[SweepPoints]) -> SweepPoints:
    """The points of one source, or the product of several."""
    return parts[0] if len(parts) == 1 else PointProduct(parts)


def over(model: Model, text: str) -> TableOfPoints:
    """The values of `--over`: `L=0.5:2:16` from one end to the other by number, `m=[1, 2, 5]`, or one value.

    Ends and values are expressions of the parameters of the model. Raises `BadPoints`, and `ModelError`, located, for
    an expression that is none.
    """
    name, sign, written = (part.strip() for part in text.partition("="))
    if not sign or not name or not written:
        raise BadPoints(f"--over {text}: write NAME=LOW:HIGH:COUNT or NAME=[VALUE, ...]")
    label = f"--over {name}"
    if ":" in written:
        parts = [part.strip() for part in written.split(":")]
        if len(parts) != 3 or not all(parts):
            raise BadPoints(
                f"{label}={written}: a range is LOW:HIGH:COUNT, both ends counted, such as 0.5:2:16"
            )
        low, high, count = (given_expression.number(model, label, part) for part in parts)
        if count != int(count) or count < 1:
            raise BadPoints(
                f"{label}={written}: the count of a range is a whole number, 1 or more, not {parts[2]}"
            )
        if count == 1 and low != high:
            raise BadPoints(f"{label}={written}: a range has two ends, which one point cannot be")
        if count > MOST_IN_RANGE:
            raise BadPoints(f"{label}={written}: a range has at most {MOST_IN_RANGE} points")
        return TableOfPoints([name], np.linspace(low, high, int(count)).reshape(-1, 1), label)
    try:
        node = parser.parse(written)
    except ExpressionError:
        node = tree.Node(0, len(written))  # what is wrong is reported, located, where its value is asked for
    items = node.components if isinstance(node, tree.Vector) else (node,)
    if any(isinstance(item, tree.Vector) for item in items):
        raise BadPoints(f"{label}={written}: a point is made of numbers; set the components one by one")
    values = [given_expression.number(model, label, written[item.start : item.end]) for item in items]
    return TableOfPoints([name], np.array(values, dtype=float).reshape(-1, 1), label)
