"""Independent rows for a run, and the multipliers of all rows from those of the independent ones.

Where rows are dependent, B^T lambda is unique and lambda is not (D.13 to D.22). Of all multipliers with the same
B^T lambda those are given that make the sum of lambda_i^2 B_i M^-1 B_i^T smallest: this split does not depend on how a
row is scaled. M^-1 and S^-1 = (B M^-1 B^T)^-1 are sparse L D L^T factors, written out operation by operation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.frozen import frozen_value
from lagcli.smoothness.sized_function import SizedFunction

Solve = Callable[[ca.SX], ca.SX]


def solver(matrix: ca.SX) -> Solve:
    """x -> matrix^-1 x for a symmetric positive definite matrix, by its sparse factors."""
    return watched(matrix)[0]


def watched(matrix: ca.SX) -> tuple[Solve, ca.SX | float]:
    """The `solver`, with the least pivot as a part of its diagonal entry, a squared sine of rows and those before."""
    n = matrix.shape[0]
    if n == 0:
        return (lambda right: right), 1.0
    if matrix.sparsity().is_diag():
        inverse = 1 / ca.diag(matrix)

        def scaled(right: ca.SX) -> ca.SX:
            if right.shape[1] == 1:
                return inverse * right
            rows = np.asarray(right.sparsity().row(), dtype=np.int64)
            if not rows.size:
                return right
            each = ca.vec(inverse[rows.tolist()])  # CasADi takes of a single factor a line, not a column
            return ca.SX(right.sparsity(), each * ca.vec(right.nz[:]))

        return scaled, 1.0
    D, LT, order = ca.ldl(matrix)
    parts = D / ca.diag(matrix)[order]
    return (lambda right: ca.ldl_solve(right, D, LT, order)), ca.mmin(parts)


def operations(S: ca.SX) -> float:
    """Multiplications that one factorization of S takes, counted from its fill."""
    pattern = S.sparsity()
    if pattern.size1() == 0:
        return 0.0
    LT, _ = pattern.ldl()
    # Row k of L has as many entries as column k of L^T; eliminating it touches their pairs.
    entries = np.diff(np.asarray(LT.T.colind(), dtype=float))
    return float(np.sum((entries + 1) ** 2))


# Larger dependencies are solved numerically: written out, their factors would take longer to build than a run takes.
WRITTEN_OUT = 40
SOLVER = "ldl"


@frozen_value
class Selection:
    """The rows a run is stepped with, `independent`, numbered as the multipliers: C equality rows, then K contacts.

    dependencies: each other row, followed by the independent rows it depends on; inactive: contacts that do not act;
    idle: those of them that are closed and carry nothing in the least split, each with the rows that it depends on.
    """

    independent: tuple[int, ...]
    dependencies: tuple[tuple[int, ...], ...] = ()
    inactive: tuple[int, ...] = ()
    idle: tuple[tuple[int, ...], ...] = ()

    @property
    def count(self) -> int:
        """All rows, C + K."""
        return len(self.independent) + len(self.dependencies) + len(self.inactive)

    @property
    def present(self) -> tuple[int, ...]:
        """The rows that act, in their order."""
        return tuple(sorted((*self.independent, *(dependency[0] for dependency in self.dependencies))))

    def opened(self, rows: int) -> Selection:
        """The selection of `rows` equality rows with all contacts open."""
        dependencies = tuple(dependency for dependency in self.dependencies if dependency[0] < rows)
        independent = tuple(i for i in self.independent if i < rows)
        return Selection(independent, dependencies, tuple(range(rows, self.count)))

    def switched(self, rows: int) -> Selection | None:
        """The selection with all contacts closed, None where all are open, or some depend on others."""
        open_ = self.opened(rows)
        if self.idle or self.dependencies != open_.dependencies or self.independent == open_.independent:
            return None
        return Selection((*open_.independent, *range(rows, self.count)), open_.dependencies)

    @property
    def indeterminate(self) -> frozenset[int]:
        """Rows whose multipliers are not unique: of dependencies, and of idle contacts."""
        return frozenset((*self.shared, *(row for dependency in self.idle for row in dependency)))

    @property
    def idle_rows(self) -> list[int]:
        """The contacts that are closed and carry nothing."""
        return [dependency[0] for dependency in self.idle]

    @property
    def shared(self) -> tuple[int, ...]:
        """All rows of dependencies, those that vanish too, in their order."""
        return tuple(sorted({row for dependency in self.dependencies for row in dependency}))

    def groups(self) -> Iterator[tuple[list[int], list[int]]]:
        """Rows left out and independent rows of dependencies that share rows, without rows that vanish."""
        head: dict[int, int] = {}  # of each independent row, one that stands for all of its group

        def top(row: int) -> int:
            while head.setdefault(row, row) != row:
                head[row] = head[head[row]]
                row = head[row]
            return row

        for _, *support in self.dependencies:
            for row in support:
                head[top(row)] = top(support[0])
        found: dict[int, tuple[list[int], set[int]]] = {}
        for first, *support in self.dependencies:
            if support:
                rest, independent = found.setdefault(top(support[0]), ([], set()))
                rest.append(first)
                independent.update(support)
        for rest, independent in found.values():
            yield sorted(rest), sorted(independent)


def split(selection: Selection, S: ca.MX, lam: ca.MX) -> ca.MX:
    """lambda of all rows (C + K,), 0 of inactive ones, from that of independent rows and S of the `shared` ones."""
    among = {row: i for i, row in enumerate(selection.shared)}
    index = {row: i for i, row in enumerate(selection.independent)}
    supports = {dependency[0]: frozenset(dependency[1:]) for dependency in selection.dependencies}
    values: dict[int, ca.MX | float] = {row: lam[i] for row, i in index.items()}
    values |= dict.fromkeys((*supports, *selection.inactive), 0.0)
    for rest, independent in selection.groups():
        here = [*rest, *independent]
        pattern = np.array([[k in supports[i] for k in independent] for i in rest])
        numbers = [among[row] for row in here]
        way = _solved if max(pattern.shape) <= WRITTEN_OUT else _projected
        shared = way(pattern, S[numbers, numbers], lam[[index[k] for k in independent]])
        for number, row in enumerate(here):
            values[row] = shared[number]
    return ca.vertcat(*(values[row] for row in range(len(values))))


def loads(selection: Selection, S: ca.MX, lam: ca.MX) -> ca.MX:
    """The load of each idle contact, to first order, if it took part in the split (I,): above 0 the least split
    loads it. S: of the rows `spread` in their order; lam: of all rows (C + K,).

    With mu_i = lambda_i |B_i| a split is the least where the unit rows have a w with mu_i = B_i w/|B_i| where they act
    and B_j w <= 0 where they only push and carry nothing; B_j w = T_j w over the rows that contact j depends on.
    """
    among = {row: i for i, row in enumerate(spread(selection))}
    found = []
    for row, *support in selection.idle:
        independent = [among[i] for i in support]
        here, given = ca.SX.sym("S", len(among), len(among)), ca.SX.sym("lam", len(support))
        T = solver(here[independent, independent])(here[independent, among[row]])
        load = ca.dot(T, ca.diag(here[independent, independent]) * given) / (
            here[among[row], among[row]] + doubles.TINY
        )
        found.append(SizedFunction("load", [here, given], [load])(S, lam[list(support)]))
    return ca.vertcat(*found)


def spread(selection: Selection) -> tuple[int, ...]:
    """All rows of idle contacts and those that they depend on, in their order."""
    return tuple(sorted({row for dependency in selection.idle for row in dependency}))


def _solved(pattern: npt.NDArray[np.bool_], S: ca.MX, lam: ca.MX) -> ca.MX:
    """S and lambda of the independent rows of one group -> lambda of all its rows, those left out first.

    With B_rest = T B_kept and D the diagonal of S: lambda_kept + T^T lambda_rest is given, and the smallest sum has

        (D_rest + T D_kept T^T) lambda_rest = T D_kept lambda_kept
    """
    k, r = pattern.shape
    among, given = ca.SX.sym("S", k + r, k + r), ca.SX.sym("lam", r)
    lines = []
    for i in range(k):
        # Row i of T, (1, r): S_iK S_KK^-1 over the independent rows K that row i depends on.
        support = np.flatnonzero(pattern[i])
        kept = (support + k).tolist()
        line = ca.SX(1, r)
        line[0, support.tolist()] = solver(among[kept, kept])(among[kept, i]).T
        lines.append(ca.densify(line))
    T = ca.vertcat(*lines)
    D = ca.diag(among)
    TD = T * ca.repmat(D[k:].T, k, 1)
    rest = solver(ca.diag(D[:k] + doubles.TINY) + TD @ T.T)(TD @ given)
    shared = SizedFunction("shared", [among, given], [ca.densify(ca.vertcat(rest, given - T.T @ rest))])
    return shared(S, lam)


def _projected(pattern: npt.NDArray[np.bool_], S: ca.MX, lam: ca.MX) -> ca.MX:
    """Solve as `_solved` does, for a larger group, without T. In unit rows, mu_i = lambda_i D_i^(1/2) and G = D^(-1/2)
    S D^(-1/2), the shortest mu with the same B^T lambda is the projection of any onto the range of G, which the columns
    of the independent rows span: G_K (G_K^T G_K)^-1 G_K^T mu."""
    k = pattern.shape[0]
    lengths = ca.sqrt(ca.diag(S) + doubles.TINY)
    unit = ca.diag(1 / lengths)
    G = unit @ S @ unit
    columns = G[:, k:]
    weights = ca.solve(columns.T @ columns, G[k:, k:] @ (lengths[k:] * lam), SOLVER)
    return ca.densify((columns @ weights) / lengths)
