"""Points that are drawn from distributions: quasi-random ones, or pseudo-random where that is wanted.

A Sobol sequence, scrambled by the seed, fills the cube evenly: quantiles are found with far fewer draws than by chance.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.api.sweeps.point_sources import BadPoints, TableOfPoints
from lagcli.errors import diagnostics
from lagcli.expression import parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import given_expression
from lagcli.model.model import Model

Floats = npt.NDArray[np.float64]

LABEL = "--uncertain"
# Draws at once: their numbers are held in memory, as many as a table may have.
MOST_DRAWS, MOST_NUMBERS = 1 << 24, 100_000_000
HALF_CELL = (
    2.0**-31
)  # half of the grain of a Sobol sequence of 30 bits: in place of 0, where a tail has no end
SAMPLINGS = ("sobol", "random")
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


def read(model: Model, text: str) -> Uncertain:
    """The distribution of `--uncertain 'L~normal(1, 0.01)'`; its numbers are expressions of the parameters.

    Raises `BadPoints`, and `diagnostics.ModelError`, located, for an expression that is none.
    """
    name, sign, written = (part.strip() for part in text.partition("~"))
    if not sign or not name or not written:
        raise BadPoints(f"{LABEL} {text}: write NAME~DISTRIBUTION, such as 'L~normal(1, 0.01)'")
    label = f"{LABEL} {name}"
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
    found = Uncertain(name, node.function, numbers)
    if fault := _fault(found):
        raise BadPoints(f"{label}~{written}: {fault}")
    return found


def _fault(found: Uncertain) -> str:
    match found.distribution, found.numbers:
        case (("normal" | "lognormal"), (_, sd)) if sd <= 0:
            return "the standard deviation is positive"
        case "uniform", (low, high) if low >= high:
            return "the first bound is the lower one"
        case "triangular", (low, mode, high) if not (low <= mode <= high and low < high):
            return "the mode is between the bounds, the first of which is the lower one"
    return ""


def draw(uncertain: Sequence[Uncertain], draws: int, seed: int, sampling: str = "sobol") -> TableOfPoints:
    """So many points of these distributions, the same for the same seed. Raises `BadPoints`."""
    if draws < 1 or draws != int(draws):
        raise BadPoints("--draws: a whole number, 1 or more, is needed")
    if draws > MOST_DRAWS or draws * len(uncertain) > MOST_NUMBERS:
        raise BadPoints(
            f"--draws {draws}: at most {min(MOST_DRAWS, MOST_NUMBERS // len(uncertain))} are drawn"
        )
    u = _cube(len(uncertain), int(draws), seed, sampling)
    values = [one.at(u[:, k]) for k, one in enumerate(uncertain)]
    return TableOfPoints([one.name for one in uncertain], np.column_stack(values), LABEL)


def _cube(size: int, draws: int, seed: int, sampling: str) -> Floats:
    """Points of the open unit cube (draws, size)."""
    if sampling == "random":
        found = np.random.default_rng(seed).random((draws, size))
    elif sampling == "sobol":
        from scipy.stats import qmc

        if size > qmc.Sobol.MAXDIM:
            raise BadPoints(f"{LABEL}: a Sobol sequence has at most {qmc.Sobol.MAXDIM} names")
        # A whole power of two is drawn: the first points of it are those of any smaller number.
        bits = max(0, (draws - 1).bit_length())
        found = qmc.Sobol(size, scramble=True, seed=seed).random_base2(bits)[:draws]
    else:
        raise BadPoints(f"--sampling {sampling}: choose from {', '.join(SAMPLINGS)}")
    return np.clip(found, HALF_CELL, 1.0 - HALF_CELL)
