"""The dependences among constraint rows: an independent set, and for each other row the rows it follows from. Together
they are a null vector of B^T with as few rows as can be: without any one of them the rest are independent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.compiled.selection import Selection
from lagcli.frozen import frozen
from lagcli.linear import decompositions, rank
from lagcli.linear.metric_rows import LocalRows, MetricRows


class IndependentRowsParameters:
    """The choice of independent rows. The tests are of `tests/unit/test_numbers_of_rows.py`."""

    __slots__ = ()

    early: float = 0.3
    """The next independent row is the first in the file's order that is this part as far from the others as the
    farthest. `test_the_next_row_is_the_first_that_is_a_third_as_far_as_the_farthest`."""
    better: float = 4.0
    """Other rows are taken where their angle is this many times as large, or, of many, where one that follows from the
    independent ones has a larger weight than this: each time the volume that they span grows by so much.
    `test_other_rows_are_taken_where_they_are_four_times_as_far_from_dependent_ones`."""


PARAMETERS = IndependentRowsParameters()


@frozen
class Dependence:
    """Independent rows, and the `rest`, whose unit rows have these `weights` of unit independent rows."""

    independent: tuple[int, ...]
    rest: tuple[int, ...]
    weights: tuple[Mapping[int, float], ...]

    @property
    def selection(self) -> Selection:
        """The rows to step with, and the dependencies."""
        dependencies = tuple(
            (row, *(i for i in sorted(of) if abs(of[i]) > rank.PARAMETERS.small))
            for row, of in zip(self.rest, self.weights, strict=True)
        )
        return Selection(self.independent, dependencies)

    def following(self) -> list[int]:
        """The rows that depend on rows before them: the last ones of null vectors that all end at another row."""
        ends: dict[int, dict[int, float]] = {}
        for row, of in zip(self.rest, self.weights, strict=True):
            vector = {row: -1.0} | dict(of)
            while True:
                least = rank.PARAMETERS.small * max(map(abs, vector.values()), default=0.0)
                vector = {i: weight for i, weight in vector.items() if abs(weight) > least}
                if not vector:
                    break
                last = max(vector)
                if last not in ends:
                    ends[last] = vector
                    break
                factor = vector.pop(last) / ends[last][last]
                for i, weight in ends[last].items():
                    if i != last:
                        vector[i] = vector.get(i, 0.0) - factor * weight
        return sorted(ends)


def dependence(rows: MetricRows, count: int, holonomic: int = 0) -> Dependence:
    """The dependence of rows of which `count` are independent; those are chosen far from dependent ones, and first
    among the first, `holonomic` ones: a differential row in place of one of them would not keep its coordinates."""
    if count == rows.count:
        return Dependence(tuple(range(count)), (), ())
    first: list[int] = []
    if 0 < holonomic < rows.count:
        part = rows.take(list(range(holonomic)))
        rank_there = rank.estimate(part).low
        first = list(range(holonomic)) if rank_there == holonomic else independent(part, rank_there)
    found = over(rows, tuple(independent(rows, count, first)))
    return _exchanged(found, holonomic) if rows.is_large else found


def _exchanged(found: Dependence, holonomic: int) -> Dependence:
    """The dependence with small weights: pivots tell that many rows are independent, and not how far. A row of more
    weight than `better` changes places with the one that depends on it."""
    vectors = {row: dict(of) for row, of in zip(found.rest, found.weights, strict=True)}
    waiting = list(found.rest)
    while waiting:
        row = waiting.pop()
        of = vectors.get(row, {})
        among = [i for i in of if (i < holonomic) == (row < holonomic)]
        heaviest = max(among, key=lambda i: (abs(of[i]), -i), default=None)
        if heaviest is None or abs(of[heaviest]) <= PARAMETERS.better:
            continue
        pivot = vectors.pop(row).pop(heaviest)
        other = {row: 1.0 / pivot} | {i: -w / pivot for i, w in of.items()}
        vectors[heaviest] = other
        waiting.append(heaviest)
        for one, its in vectors.items():
            factor = its.pop(heaviest, 0.0) if one != heaviest else 0.0
            if factor:
                for i, w in other.items():
                    its[i] = its.get(i, 0.0) + factor * w
                waiting.append(one)
    rest = tuple(sorted(vectors))
    staying = {*found.independent, *found.rest}.difference(rest)
    return Dependence(tuple(sorted(staying)), rest, tuple(vectors[row] for row in rest))


def elsewhere(selection: Selection, rows: MetricRows, holonomic: int) -> Selection | None:
    """Other independent rows, where those of a selection have come close to dependent ones; None where no others
    are much better, or where rows are too many to be looked at densely."""
    if not selection.dependencies or rows.is_large:
        return None
    independent = dependence(rows, len(selection.independent), holonomic).independent
    found, before = (
        float(decompositions.singular_values(rows.dense[list(chosen)]).min(initial=1.0))
        for chosen in (independent, selection.independent)
    )
    return None if found < PARAMETERS.better * before else rebased(selection, independent)


def rebased(selection: Selection, independent: tuple[int, ...]) -> Selection | None:
    """A selection that keeps other rows: dependencies that share rows are one set. None where the independent rows of
    such a set are more or fewer than before, for then one of the two is no choice."""
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


def independent(rows: MetricRows, count: int, first: Sequence[int] = ()) -> list[int]:
    """`count` independent rows, those in `first` among them."""
    if not rows.is_large:
        return sorted(farthest(rows.dense, count, first, PARAMETERS.early))
    if first:  # the choice of `farthest` in what is left of the other rows after the first ones
        others = sorted(set(range(rows.count)) - set(first))
        weights = _combinations(rows, list(first), others)
        unit = rows.unit
        left = np.array(ca.densify(unit[others, :])) - weights @ np.array(ca.densify(unit[first, :]))
        more = farthest(left, count - len(first), (), PARAMETERS.early)
        return sorted([*first, *(others[k] for k in more)])
    # Those with the largest pivots in the sparse factors of the Gram matrix: the others are left what is added to its
    # diagonal, times the squared length of their null vectors.
    D, _, order = ca.ldl(ca.mtimes(rows.unit, rows.unit.T) + doubles.SUM * ca.DM.eye(rows.count))
    largest = np.argsort(-np.array(D).ravel(), kind="stable")[:count]
    return sorted(np.asarray(order)[largest].tolist())


def over(rows: MetricRows, independent: tuple[int, ...]) -> Dependence:
    """The dependence of rows on those chosen, which are independent and span all of them."""
    rest = sorted(set(range(rows.count)) - set(independent))
    known = _near_weights(rows, independent, rest) if rows.is_large else {}
    far = [row for row in rest if row not in known]
    least = rank.PARAMETERS.small if rows.is_large else 0.0
    for some in (far[k : k + 40] for k in range(0, len(far), 40)):  # more take memory, fewer time
        for row, weights in zip(some, _combinations(rows, list(independent), some), strict=True):
            among = np.flatnonzero(np.abs(weights) > least).tolist()
            known[row] = {independent[k]: float(weights[k]) for k in among}
    return Dependence(independent, tuple(rest), tuple(known[row] for row in rest))


def follow_from_few(rows: MetricRows, independent: Sequence[int]) -> bool:
    """True if all other rows of many are combinations of a few independent ones near them."""
    rest = sorted(set(range(rows.count)) - set(independent))
    return len(_near_weights(rows, independent, rest)) == len(rest)


def _near_weights(
    rows: MetricRows, independent: Sequence[int], rest: Sequence[int]
) -> dict[int, Mapping[int, float]]:
    """The weights of those rows in `rest` that depend on a few independent ones, which share coordinates with them."""
    entries = LocalRows(rows.unit)
    by_row: list[dict[int, float]] = [{} for _ in range(rows.count)]
    there = np.flatnonzero(entries.values)
    parts = (each[there].tolist() for each in (entries.row, entries.column, entries.values))
    for i, j, value in zip(*parts, strict=True):
        by_row[i][j] = value
    holding: dict[int, list[int]] = {}
    for i in independent:
        for j in by_row[i]:
            holding.setdefault(j, []).append(i)
    found: dict[int, Mapping[int, float]] = {}
    for row in rest:
        near: dict[int, None] = {}
        columns = dict.fromkeys(by_row[row])
        while True:
            added = [i for j in columns for i in holding.get(j, ()) if i not in near]
            near |= dict.fromkeys(added)
            if not added or len(near) > 60:
                break  # to ask all rows costs less
            columns |= dict.fromkeys(j for i in added for j in by_row[i])
            at = {j: k for k, j in enumerate(columns)}
            B = np.zeros((len(near) + 1, len(columns)))
            for k, i in enumerate((*near, row)):
                B[k, [at[j] for j in by_row[i]]] = list(by_row[i].values())
            weights = decompositions.least_squares(B[:-1].T, B[-1])
            if np.linalg.norm(weights @ B[:-1] - B[-1]) <= doubles.VALUE:
                pairs = zip(near, weights.tolist(), strict=True)
                found[row] = {i: w for i, w in pairs if abs(w) > rank.PARAMETERS.small}
                break
    return found


def joined(first: Selection, others: Iterable[Selection]) -> Selection:
    """A selection with the dependencies of others too, which keep the same rows: at one point a weight may vanish."""
    dependencies = [set(dependency[1:]) for dependency in first.dependencies]
    for other in others:
        for dependency, more in zip(dependencies, other.dependencies, strict=True):
            dependency.update(more[1:])
    pairs = zip(first.dependencies, dependencies, strict=True)
    return Selection(first.independent, tuple((old[0], *sorted(new)) for old, new in pairs))


def shares(dependencies: Sequence[Sequence[str]]) -> list[str]:
    """The dependencies in words, by the names of their rows: six dependencies, and twenty rows of one."""
    shares = []
    for names in dependencies[:6]:
        quoted = [f"`{name}`" for name in names]
        if len(quoted) == 1:
            shares.append(f"{quoted[0]} makes no force, and any multiplier will do")
        elif len(quoted) == 2:
            shares.append(f"{quoted[0]} and {quoted[1]} share one force")
        else:
            shown = ", ".join([*quoted[:20], *["..."] * (len(quoted) > 20)])
            shares.append(f"{shown}: a force in one can be passed to the others")
    if len(dependencies) > 6:
        shares.append(f"and {len(dependencies) - 6} more")
    return shares


def _combinations(rows: MetricRows, independent: list[int], rest: list[int]) -> Floats:
    """The weights (k, r) of unit rows in `rest` over those in `independent`."""
    if not rows.is_large:
        return decompositions.least_squares(rows.dense[independent].T, rows.dense[rest].T).T
    among, others = rows.unit[independent, :], rows.unit[rest, :]
    gram = ca.mtimes(among, among.T)
    factors = ca.Linsol("among", "ldl", gram.sparsity())
    return np.array(factors.solve(gram, ca.densify(ca.mtimes(among, others.T)))).T


def redundant(rows: MetricRows) -> Flags:
    """The rows that depend on rows before them; of more rows than are looked at densely none is named."""
    flags = np.zeros(rows.count, dtype=bool)
    if rows.are_independent or rows.is_large or (count := rank.estimate(rows).low) == rows.count:
        return flags
    flags[:] = True
    first = leading(rows.dense, rank.PARAMETERS.large)
    if len(first) < count:  # some are nearly dependent, and known not to be
        sigma = [*decompositions.singular_values(rows.dense).tolist(), 0.0]
        first = leading(rows.dense, float(np.sqrt(sigma[count - 1] * max(sigma[count], doubles.EPS))))
    flags[first] = False
    return flags


def farthest(
    rows: Floats, count: int, first: Sequence[int] = (), nearly: float = 1.0, least: float = 0.0
) -> list[int]:
    """Numbers of `count` independent rows in order of choice, those in `first`, which are independent, before all.

    Each next one is the first that is `nearly` as far from those before it as the farthest: which of several alike is
    taken must not depend on rounding. It ends where all are nearer than `least`.
    """
    independent = list(first)
    basis = decompositions.orthonormal(rows[independent].T)[0]
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
