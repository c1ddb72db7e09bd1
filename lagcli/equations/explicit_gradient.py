"""The gradient of a constraint along a dependent particle, as far as its equation names the particle.

r_k = x_k(q, t) has no coordinates of its own. An equation that names it acts on it with lambda_i df_i/dr_k, as on any
particle. One over the same coordinates that does not name it acts on it too, but how much of lambda_i falls to which
of the particles is not determined: that is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import rows
from lagcli.equations.environment import Environment
from lagcli.equations.family_columns import Triple
from lagcli.equations.symbols import FixedExponents
from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.model import model as nouns
from lagcli.model.family import Integers

if TYPE_CHECKING:
    from lagcli.equations.rigid import Geometry

Truths = npt.NDArray[np.bool_]


def entries(matrix: ca.SX, row: Integers, column: Integers) -> ca.SX:
    """Entries (K, 1) of a sparse matrix at rows and columns (K,)."""
    height = matrix.size1()
    rows_, columns_ = (np.asarray(part, dtype=np.int64) for part in matrix.sparsity().get_triplet())
    stored, wanted = columns_ * height + rows_, column * height + row  # ascending, as a matrix is stored
    index = np.minimum(np.searchsorted(stored, wanted), max(0, stored.size - 1))
    found = np.flatnonzero(stored[index] == wanted) if stored.size else np.zeros(0, dtype=np.int64)
    values = ca.SX.zeros(wanted.size)
    if found.size:
        values[found.tolist()] = ca.SX(matrix.nz[index[found].tolist()])
    return values


@frozen
class _Gradient:
    """df/dr of the rows of one law by the dependent particles, (rows, 3 D), x of all before y and z."""

    rows: dict[str, int]
    B: ca.SX


class DependentForces:
    """Gradients of constraints along dependent particles, each law differentiated when it is first asked for."""

    def __init__(
        self,
        model: nouns.Model,
        env: Environment,
        bodies: Sequence[Geometry],
        constants: Sequence[ca.SX],
    ) -> None:
        self._model, self._environment = model, env
        self._bodies = dict(
            zip((b.name for b in model.rigid), zip(bodies, constants, strict=True), strict=True)
        )
        self._known: dict[str, _Gradient] = {}

    def gradients(
        self, numbers: Integers, wanted: Sequence[rows.Row], node: tree.Name | tree.Member | tree.Index
    ) -> Triple:
        """df_i/dr_k of rows and dependent particles (K,). Raises `ExpressionError` where that is not determined."""
        base = node.name if isinstance(node, tree.Name) else node.owner
        gradient = self._of(base)
        rank = np.searchsorted(self._environment.dependent, numbers)
        row = np.array([gradient.rows[one.name] for one in wanted], dtype=np.int64)
        count = self._environment.dependent.size
        self._require_named(gradient, row, rank, node)
        x, y, z = (entries(gradient.B, row, rank + axis * count) for axis in range(3))
        return x, y, z

    def _require_named(
        self, gradient: _Gradient, row: Integers, rank: Integers, node: tree.Name | tree.Member | tree.Index
    ) -> None:
        base = node.name if isinstance(node, tree.Name) else node.owner
        count = self._environment.dependent.size
        named: Truths = np.any(_pattern(gradient.B).reshape(-1, 3, count), axis=1)
        unnamed = np.flatnonzero(~named[row, rank])
        coordinates = self._coordinates_of(base) if unnamed.size else named
        for i, k in zip(row[unnamed].tolist(), rank[unnamed].tolist(), strict=True):
            if (coordinates[i] & self._moving[k]).any():
                particle = self._environment.particles.names[int(self._environment.dependent[k])]
                message = (
                    f"`{base}` acts on coordinates that move `{particle}` but does not name `{particle}`: which part"
                    " of its force falls to this particle is not determined"
                )
                hint = f"write the constraint with `{particle}.x`, `{particle}.y`, `{particle}.z`, or record"
                hint += f" `multiplier({base})`"
                raise ExpressionError("share-not-determined", message, node.start, node.end, hint)

    def _coordinates_of(self, base: str) -> Truths:
        """True where a coordinate enters a row of a law by its differential, (rows, n)."""
        s = self._environment.symbols
        values = self._values(base, self._environment)
        return _pattern(ca.jacobian(values, s.v if self._is_differential(base) else s.q))

    @cached_property
    def _moving(self) -> Truths:
        """True where a coordinate moves a dependent particle, (D, n)."""
        env = self._environment
        parts = [_pattern(ca.jacobian(part, env.symbols.q)) for part in env.position(env.dependent)]
        return np.asarray(parts[0] | parts[1] | parts[2])

    def _of(self, base: str) -> _Gradient:
        if base not in self._known:
            env, s = self._environment, self._environment.symbols
            count = env.dependent.size
            r, v = ca.SX.sym("r free", 3 * count), ca.SX.sym("v free", 3 * count)
            free = Environment(self._model, s, FixedExponents(self._model), (_triple(r), _triple(v)))
            values = self._values(base, free)
            B = ca.jacobian(values, v if self._is_differential(base) else r)
            true = [ca.vertcat(*env.position(env.dependent)), ca.vertcat(*env.velocity(env.dependent))]
            B = ca.substitute([B], [r, v], true)[0]
            names = [name for law in self._laws(base) for name in law.rows]
            if base in self._bodies:
                names = [f"{base}.{i}" for i in range(1, values.numel() + 1)]
            self._known[base] = _Gradient({name: i for i, name in enumerate(names)}, B)
        return self._known[base]

    def _laws(self, base: str) -> list[nouns.Law]:
        return [law for law in self._model.laws if law.members.base == base and law.members.count]

    def _is_differential(self, base: str) -> bool:
        return any(law.members.base == base for law in self._model.differential)

    def _values(self, base: str, env: Environment) -> ca.SX:
        """left - right of all rows of a constraint."""
        if base in self._bodies:
            body = next(body for body in self._model.rigid if body.name == base)
            geometry, constants = self._bodies[base]
            return rows.of_body(body, env, geometry, ca.vertsplit(constants))
        return ca.vertcat(*(env.equation(law) for law in self._laws(base)))


def _triple(column: ca.SX) -> Triple:
    """A column (3 K, 1) as three of K."""
    x, y, z = ca.vertsplit(column, column.numel() // 3)
    return x, y, z


def _pattern(matrix: ca.SX) -> Truths:
    """True where a matrix has entries."""
    found = np.zeros(matrix.shape, dtype=bool)
    rows_, columns_ = matrix.sparsity().get_triplet()
    found[rows_, columns_] = True
    return found
