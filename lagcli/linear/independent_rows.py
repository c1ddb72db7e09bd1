"""The dependences among constraint rows: an independent set, and for each other row the rows it follows from.

A row and the independent rows it is a combination of are a dependency: leave out any one of them and the rest are
independent. Dependencies are null vectors of B^T, each with as few rows as can be, so that they can be reported by
name. Dense rows are chosen by Gram-Schmidt (twice, for rounding).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compiled.selection import Selection
from lagcli.frozen import frozen
from lagcli.linear import rank
from lagcli.linear.metric_rows import MetricRows

Floats = npt.NDArray[np.float64]


class IndependentRowsParameters:
    """The choice of independent rows, and what the others follow from.

    The tests are of `tests/unit/test_numbers_of_rows.py`.
    """

    __slots__ = ()

    early: float = 0.3
    """The next independent row is the first in the file's order that is this part as far from the others as
    the farthest. `test_the_next_row_is_the_first_that_is_a_third_as_far_as_the_farthest` fails at 0.03 and
    3."""
    weight: float = 1e-7
    """A row takes part in a dependency if its weight is above this; of rows that are on the surface to
    rounding, and dependent on it alone, rounding leaves its square root.
    `test_a_row_takes_part_in_a_dependency_with_seven_digits` fails at 1e-8 and 1e-6."""
    shift: float = 1e-13
    """It is added to the diagonal of the Gram matrix of many rows, whose pivots decide.
    `test_pivots_of_many_rows_are_looked_at_with_thirteen_digits_added` fails at 1e-14 and 1e-12."""
    pivot: float = 1e-10
    """Pivots of many rows below this are rounding.
    `test_of_many_rows_those_are_independent_whose_pivot_has_ten_digits` fails at 1e-11 and 1e-9."""
    better: float = 4.0
    """Other rows are taken where their angle is this many times as large.
    `test_other_rows_are_taken_where_they_are_four_times_as_far_from_dependent_ones` fails at 0.4 and 40."""
    most_listed: int = 6
    """Dependencies that are reported one by one.
    `test_six_dependencies_are_listed_and_twenty_rows_of_one_are_named` fails at 0 and 60."""
    most_named: int = 20
    """Rows of a dependency that are named.
    `test_six_dependencies_are_listed_and_twenty_rows_of_one_are_named` fails at 2 and 200."""


PARAMETERS = IndependentRowsParameters()


@frozen
class Dependence:
    """Independent rows (r,) and the `rest` (k,), whose unit rows are `weights` (k, r) @ the unit independent rows."""

    independent: tuple[int, ...]
    rest: tuple[int, ...]
    weights: Floats

    @property
    def selection(self) -> Selection:
        """The rows to step with, and the dependencies."""
        supports = (np.flatnonzero(np.abs(row) > PARAMETERS.weight) for row in self.weights)
        dependencies = tuple(
            (row, *(self.independent[k] for k in support))
            for row, support in zip(self.rest, supports, strict=True)
        )
        return Selection(self.independent, dependencies)


def dependence(rows: MetricRows, count: int, holonomic: int = 0) -> Dependence:
    """The dependence of rows of which `count` are independent; those are chosen far from dependent ones.

    holonomic: how many rows, the first, are holonomic. As many of them as are independent come first: a differential
    row in place of one of them would not keep its coordinates.
    """
    if count == rows.count:
        return Dependence(tuple(range(count)), (), np.zeros((0, count)))
    first: list[int] = []
    if 0 < holonomic < rows.count:
        part = rows.take(list(range(holonomic)))
        rank_there = rank.estimate(part).low
        first = list(range(holonomic)) if rank_there == holonomic else _independent(part, rank_there, [])
    return over(rows, tuple(_independent(rows, count, first)))


def elsewhere(selection: Selection, rows: MetricRows, holonomic: int) -> Selection | None:
    """Other independent rows, where those of a selection have come close to dependent ones; None where no others
    are much better, or where rows are too many to be looked at densely."""
    if not selection.dependencies or rows.is_large:
        return None
    independent = dependence(rows, len(selection.independent), holonomic).independent
    if _smallest_singular_value(rows, independent) < PARAMETERS.better * _smallest_singular_value(
        rows, selection.independent
    ):
        return None
    return rebased(selection, independent)


def rebased(selection: Selection, independent: tuple[int, ...]) -> Selection | None:
    """A selection that keeps other rows: dependencies that share rows are one set, whichever of its rows are
    independent.

    None where the independent rows of such a set are more or fewer than before, for then one of the two is no choice.
    """
    dependencies: list[tuple[int, ...]] = [
        dependency for dependency in selection.dependencies if len(dependency) == 1
    ]
    for rest, support in selection.groups():
        together = {*rest, *support}
        staying = sorted(together.intersection(independent))
        if len(staying) != len(support):
            return None
        dependencies += [(row, *staying) for row in sorted(together.difference(independent))]
    found = Selection(independent, tuple(sorted(dependencies)), selection.inactive)
    return found if found.present == selection.present else None


def _smallest_singular_value(rows: MetricRows, independent: tuple[int, ...]) -> float:
    return float(np.linalg.svd(rows.dense[list(independent)], compute_uv=False).min(initial=1.0))


def _independent(rows: MetricRows, count: int, first: list[int]) -> list[int]:
    """`count` independent rows, those in `first` among them."""
    if not rows.is_large:
        return sorted(farthest(rows.dense, count, first, PARAMETERS.early))
    return _farther(rows, count, first) if first else _pivots(rows)


def over(rows: MetricRows, independent: tuple[int, ...]) -> Dependence:
    """The dependence of rows on those chosen, which are independent and span all of them."""
    rest = sorted(set(range(rows.count)) - set(independent))
    return Dependence(independent, tuple(rest), _combinations(rows, list(independent), rest))


def joined(first: Selection, others: Iterable[Selection]) -> Selection:
    """A selection with the dependencies of others too, which keep the same rows: at one point a weight may vanish."""
    dependencies = [set(dependency[1:]) for dependency in first.dependencies]
    for other in others:
        for dependency, more in zip(dependencies, other.dependencies, strict=True):
            dependency.update(more[1:])
    pairs = zip(first.dependencies, dependencies, strict=True)
    return Selection(first.independent, tuple((old[0], *sorted(new)) for old, new in pairs))


def shares(dependencies: Sequence[Sequence[str]]) -> list[str]:
    """The dependencies in words, by the names of their rows."""
    shares = [_share(names) for names in dependencies[: PARAMETERS.most_listed]]
    return (
        [*shares, f"and {len(dependencies) - PARAMETERS.most_listed} more"]
        if len(dependencies) > PARAMETERS.most_listed
        else shares
    )


def _share(names: Sequence[str]) -> str:
    quoted = [f"`{name}`" for name in names]
    if len(quoted) == 1:
        return f"{quoted[0]} makes no force, and any multiplier will do"
    if len(quoted) == 2:
        return f"{quoted[0]} and {quoted[1]} share one force"
    shown = quoted if len(quoted) <= PARAMETERS.most_named else [*quoted[: PARAMETERS.most_named], "..."]
    return f"{', '.join(shown)}: a force in one can be passed to the others"


def _combinations(rows: MetricRows, independent: list[int], rest: list[int]) -> Floats:
    """The weights (k, r) of unit rows in `rest` over those in `independent`."""
    if not rows.is_large:
        return np.asarray(np.linalg.lstsq(rows.dense[independent].T, rows.dense[rest].T, rcond=None)[0]).T
    among, others = rows.unit[independent, :], rows.unit[rest, :]
    gram = ca.mtimes(among, among.T)
    factors = ca.Linsol("among", "ldl", gram.sparsity())
    return np.array(factors.solve(gram, ca.densify(ca.mtimes(among, others.T)))).T


def _farther(rows: MetricRows, count: int, first: list[int]) -> list[int]:
    """The choice of `farthest` for many rows: what is left of the other rows after the first ones, by its Gram
    matrix."""
    others = sorted(set(range(rows.count)) - set(first))
    weights = _combinations(rows, first, others)
    unit = rows.unit
    left = np.array(ca.densify(unit[others, :])) - weights @ np.array(ca.densify(unit[first, :]))
    return sorted([*first, *(others[k] for k in farthest(left, count - len(first), (), PARAMETERS.early))])


def _pivots(rows: MetricRows) -> list[int]:
    """Independent rows of many: those whose pivot in the sparse factors of the Gram matrix is no rounding."""
    D, _, order = ca.ldl(ca.mtimes(rows.unit, rows.unit.T) + PARAMETERS.shift * ca.DM.eye(rows.count))
    large = np.array(D).ravel() > PARAMETERS.pivot
    return sorted(np.asarray(order)[large].tolist())


def redundant(rows: MetricRows) -> npt.NDArray[np.bool_]:
    """The rows that depend on rows before them in their order.

    Of more rows than are looked at densely none is named.
    """
    flags = np.zeros(rows.count, dtype=bool)
    if rows.are_independent or rows.is_large:
        return flags
    flags[:] = True
    flags[leading(rows.dense, rank.PARAMETERS.large)] = False
    return flags


def farthest(
    rows: Floats, count: int, first: Sequence[int] = (), nearly: float = 1.0, least: float = 0.0
) -> list[int]:
    """Numbers of `count` independent rows, those in `first`, which are independent, before all, in order of choice.

    Each next one is the first that is `nearly` as far from those before it as the farthest: which of several alike is
    taken must not depend on rounding, as it does with the pivots of LAPACK. It ends where all are nearer than `least`.
    """
    independent = list(first)
    basis = np.linalg.qr(rows[independent].T)[0]
    rest = rows - rows @ basis @ basis.T
    while len(independent) < count:
        lengths = np.linalg.norm(rest, axis=1)
        lengths[independent] = 0.0
        if lengths.max(initial=0.0) < least:
            break
        row = int(np.flatnonzero(lengths >= nearly * lengths.max())[0])
        direction = rest[row] / lengths[row]
        for _ in range(2):
            rest -= np.outer(rest @ direction, direction)
        independent.append(row)
    return independent


def leading(rows: Floats, least: float) -> list[int]:
    """Numbers of the rows that are farther than `least` from all combinations of rows before them."""
    independent: list[int] = []
    basis = np.zeros((0, rows.shape[1]))
    for i, row in enumerate(rows):
        rest = row.copy()
        for _ in range(2):
            rest -= basis.T @ (basis @ rest)
        length = float(np.linalg.norm(rest))
        if length > least:
            independent.append(i)
            basis = np.vstack([basis, rest / length])
    return independent
