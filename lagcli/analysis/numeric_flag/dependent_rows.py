"""Rows that depend on others: that they do, and by which weights.

Doubles name the rows that seem to depend on rows before them. Along a field of the kernel of the others such a row
vanishes in all digits; along a field on which one of the others is one it shows that other's weight.
"""

from __future__ import annotations

from decimal import Decimal

import numpy as np

from lagcli.analysis.numeric_flag import span, undecided
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.analysis.numeric_flag.precise_brackets import Exact

# Constants of the rows are doubles: what is smaller is their rounding.
ROUNDING = Decimal("1e-13")
# The same for weights that come from doubles, with all that nearly dependent rows lose.
ROUGH_ROUNDING, ROUGH_SURE = Decimal("1e-13"), Decimal("1e-5")
SEED = 20063
NEARLY = "whether rows depend on each other or only nearly do is not certain"


def weights(place: EvaluationPoint, exact: Exact | None) -> list[list[Decimal]]:
    """The differential rows (m,) at a place as combinations of the independent ones among them.

    What holonomic rows add does not matter. Raises `undecided.Undecided` where a row only nearly depends on others.
    """
    kept, s = place.kept, len(place.block.holonomic)
    m = len(place.block.differential)
    found = {row: span.unit(len(kept), k) for k, row in enumerate(kept)}
    others = [i for i in range(s + m) if i not in set(place.independent)]
    if others and exact is not None:
        _require_dependence(exact, others, place)
        found |= {i - s: [] for i in others if i >= s}
        for k in range(len(kept)):
            along = exact.rows_along([0] * place.block.size, span.unit(len(kept), k))
            for i in others:
                weight = Decimal(0) if along.relative[i] <= ROUNDING else along.values[i]
                if i >= s:
                    found[i - s].append(weight)
                elif weight:
                    raise undecided.Undecided(NEARLY)
    elif others:
        found |= {i - s: _by_doubles(place, i) for i in others if i >= s}
    return [found[i] for i in range(m)]


def _require_dependence(exact: Exact, others: list[int], place: EvaluationPoint) -> None:
    """Raise `undecided.Undecided` where a row does not vanish on the kernel of the independent ones."""
    u = np.random.default_rng(SEED).integers(-(10**6), 10**6, place.block.size).tolist()
    along = exact.rows_along(u, [Decimal(0)] * len(place.kept))
    if any(along.relative[i] > ROUNDING for i in others):
        raise undecided.Undecided(NEARLY)


def _by_doubles(place: EvaluationPoint, row: int) -> list[Decimal]:
    """The weights of a row by least squares."""
    dense, kept = place.rows.dense, len(place.kept)
    lengths = place.rows.lengths
    found = np.linalg.lstsq(dense[place.independent].T, dense[row], rcond=None)[0]
    scale = Decimal(float(np.abs(found).max(initial=0.0)))
    weights = []
    for k, value in zip(place.independent[-kept:] if kept else [], found[-kept:].tolist(), strict=False):
        weight = Decimal(value)
        if ROUGH_ROUNDING * scale < abs(weight) < ROUGH_SURE * scale:
            raise undecided.Undecided(NEARLY)
        is_zero = abs(weight) <= ROUGH_ROUNDING * scale
        weights.append(Decimal(0) if is_zero else weight * Decimal(lengths[row] / lengths[k]))
    return weights
