"""The points of a sweep: grids, tables, draws, and products of them. A point is a tuple of numbers, one for each name.

Points are made when they are asked for: a grid of a billion points takes no memory.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.expression import parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import given_expression
from lagcli.model.model import Model

Point = tuple[float, ...]

UNCERTAIN = "--uncertain"
# Numbers of one range or of all draws, which are held in memory: 0.8 GB; and draws at once.
MOST_NUMBERS, MOST_DRAWS = 100_000_000, 1 << 24
# Half of the grain of a Sobol sequence of 30 bits: in place of 0, where a tail has no end.
HALF_CELL = 2.0**-31
SAMPLINGS = ("sobol", "random")


class BadPoints(ValueError):
    """Points that are none; the message says which option and where."""


class SweepPoints(Protocol):
    """Points in their order."""

    names: tuple[str, ...]  # for `--set`
    count: int

    @property
    def digest(self) -> str:
        """A text that tells them apart from other points."""

    def point(self, number: int) -> Point:
        """The numbers of a point, counted from 0."""


class TableOfPoints:
    """Points as rows of numbers (T, len(names)). Raises `BadPoints` for a number that is none."""

    def __init__(self, names: Sequence[str], rows: Floats, label: str) -> None:
        self.names, self._rows = tuple(names), np.ascontiguousarray(rows, dtype=np.float64)
        self.count = len(self._rows)
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
        self._parts, self.count = tuple(parts), math.prod(part.count for part in parts)
        self.names = tuple(name for part in parts for name in part.names)
        twice = [name for name in self.names if self.names.count(name) > 1]
        if twice:
            raise BadPoints(f"`{twice[0]}` is given twice")

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
        if count > MOST_NUMBERS:
            raise BadPoints(f"{label}={written}: a range has at most {MOST_NUMBERS} points")
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


# Names with their numbers, in words.
DISTRIBUTIONS = {
    "normal": ("MEAN", "SD"),
    "uniform": ("LOW", "HIGH"),
    "lognormal": ("MEAN", "SD"),
    "triangular": ("LOW", "MODE", "HIGH"),
}


@dataclasses.dataclass(frozen=True, slots=True)
class Uncertain:
    """A name with its distribution: `lognormal` has the mean and the standard deviation of the logarithm."""

    name: str
    distribution: str
    numbers: tuple[float, ...]

    def at(self, u: Floats) -> Floats:
        """The values at these probabilities, 0 < u < 1, any shape."""
        # scipy.stats takes half a second to load: no other command needs it.
        from scipy import stats

        match self.distribution, self.numbers:
            case "normal", (mean, sd):
                law = stats.norm(mean, sd)
            case "uniform", (low, high):
                law = stats.uniform(low, high - low)
            case "lognormal", (mean, sd):
                law = stats.lognorm(sd, scale=np.exp(mean))
            case _, (low, mode, high):
                law = stats.triang((mode - low) / (high - low), low, high - low)
        return np.asarray(law.ppf(u), dtype=np.float64)


def read_law(model: Model, text: str) -> Uncertain:
    """The distribution of `--uncertain 'L~normal(1, 0.01)'`; its numbers are expressions of the parameters.

    Raises `BadPoints`, and `diagnostics.ModelError`, located, for an expression that is none.
    """
    name, sign, written = (part.strip() for part in text.partition("~"))
    if not sign or not name or not written:
        raise BadPoints(f"{UNCERTAIN} {text}: write NAME~DISTRIBUTION, such as 'L~normal(1, 0.01)'")
    label = f"{UNCERTAIN} {name}"
    try:
        node = parser.parse(written)
    except ExpressionError as error:
        raise BadPoints(f"{label}~{written}: {error.message}") from None
    if not isinstance(node, tree.Call) or node.function not in DISTRIBUTIONS:
        hint = diagnostics.nearest(node.function, DISTRIBUTIONS) if isinstance(node, tree.Call) else ""
        known = ", ".join(f"{one}({', '.join(words)})" for one, words in DISTRIBUTIONS.items())
        raise BadPoints(f"{label}~{written}: the distributions are {known}" + (f"; {hint}" if hint else ""))
    words = DISTRIBUTIONS[node.function]
    if len(node.arguments) != len(words):
        raise BadPoints(f"{label}~{written}: write {node.function}({', '.join(words)})")
    numbers = tuple(
        given_expression.number(model, label, written[one.start : one.end]) for one in node.arguments
    )
    fault = ""
    match node.function, numbers:
        case (("normal" | "lognormal"), (_, sd)) if sd <= 0:
            fault = "the standard deviation is positive"
        case "uniform", (low, high) if low >= high:
            fault = "the first bound is the lower one"
        case "triangular", (low, mode, high) if not (low <= mode <= high and low < high):
            fault = "the mode is between the bounds, the first of which is the lower one"
    if fault:
        raise BadPoints(f"{label}~{written}: {fault}")
    return Uncertain(name, node.function, numbers)


def draw(uncertain: Sequence[Uncertain], draws: int, seed: int, sampling: str = "sobol") -> TableOfPoints:
    """So many points of these distributions, the same for the same seed. Raises `BadPoints`.

    A Sobol sequence, scrambled by the seed, fills the unit cube evenly: quantiles are found with far fewer draws than
    by chance.
    """
    if draws < 1 or draws != int(draws):
        raise BadPoints("--draws: a whole number, 1 or more, is needed")
    draws, size = int(draws), len(uncertain)
    if draws > MOST_DRAWS or draws * size > MOST_NUMBERS:
        raise BadPoints(f"--draws {draws}: at most {min(MOST_DRAWS, MOST_NUMBERS // size)} are drawn")
    if sampling == "random":
        u = np.random.default_rng(seed).random((draws, size))
    elif sampling == "sobol":
        from scipy.stats import qmc

        if size > qmc.Sobol.MAXDIM:
            raise BadPoints(f"{UNCERTAIN}: a Sobol sequence has at most {qmc.Sobol.MAXDIM} names")
        # A whole power of two is drawn: the first points of it are those of any smaller number.
        bits = max(0, (draws - 1).bit_length())
        u = qmc.Sobol(size, scramble=True, seed=seed).random_base2(bits)[:draws]
    else:
        raise BadPoints(f"--sampling {sampling}: choose from {', '.join(SAMPLINGS)}")
    u = np.clip(u, HALF_CELL, 1.0 - HALF_CELL)
    values = [one.at(u[:, k]) for k, one in enumerate(uncertain)]
    return TableOfPoints([one.name for one in uncertain], np.column_stack(values), UNCERTAIN)
