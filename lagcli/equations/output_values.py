"""Values that outputs may read besides the motion: multipliers, reactions, accelerations, energies, earlier outputs.

a, lambda and R are those of (D.24); the part of one constraint in R_k is lambda_i times its row (D.22). An equation
that names a dependent particle r_k = x_k(q, t) acts on it with lambda_i df_i/dr_k, as on any. One over the same
coordinates that does not name it acts on it too, but how much of lambda_i falls to it is not determined: refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.arrays import Integers
from lagcli.equations import energy, environment, rows
from lagcli.equations.environment import Columns, Environment, Triple, Value
from lagcli.equations.symbols import SymbolicAlgebra
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.model import model as nouns
from lagcli.model.family import MemberIndex
from lagcli.model.resolve import Reference, is_second

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


def _pattern(matrix: ca.SX) -> Truths:
    found = np.zeros(matrix.shape, dtype=bool)
    found[matrix.sparsity().get_triplet()] = True
    return found


@frozen
class SolvedValues:
    """The rows of a system and what is solved for: lam (C + K,), a (n,), a_k and R_k of all particles."""

    rows: rows.ConstraintRows
    lam: ca.SX
    a: ca.SX
    accelerations: Columns
    R: Columns


class OutputValues:
    """The values of `multiplier`, `reaction`, accelerations, energies, earlier outputs. bodies: by their names."""

    def __init__(
        self,
        model: nouns.Model,
        env: Environment,
        dynamics: energy.Dynamics,
        solved: SolvedValues,
        bodies: Mapping[str, tuple[nouns.RigidBody, Geometry, ca.SX]],
    ) -> None:
        self._model, self._environment, self._solved, self._bodies = model, env, solved, bodies
        self._energies = {"kinetic": dynamics.kinetic, "potential": dynamics.potential}
        self._rows = {row.name: i for i, row in enumerate(solved.rows.rows)}
        self._of_constraint: dict[str, list[int]] = {}
        for i, row in enumerate(solved.rows.rows):
            self._of_constraint.setdefault(row.constraint, []).append(i)
        # Of a law the numbers of its rows by their names, and their gradients; it is differentiated once.
        self._gradients: dict[str, tuple[dict[str, int], ca.SX]] = {}
        self._member_index = MemberIndex([output.members for output in model.outputs])
        self._outputs = Columns(len(self._member_index))

    def store(self, entry: int, count: int, parts: Sequence[ca.SX]) -> None:
        """Keep the values of an output, which those after it may read."""
        values = tuple(environment.column(part, count) for part in parts)
        self._outputs.fill(np.arange(count) + self._member_index.first(entry), values)

    def __call__(self, node: tree.Node, variables: Mapping[str, Integers]) -> Value:
        if isinstance(node, tree.Name) and node.name in self._energies:
            return self._energies[node.name]
        env = self._environment
        names, particles, accelerations = env.names, env.particles, self._solved.accelerations
        if not isinstance(node, tree.Call):
            assert isinstance(node, tree.Reference)
            if not isinstance(node, tree.Name) and node.owner in particles:
                found = accelerations.vectors(names.numbers(node, particles, variables))
                return found["xyz".index(node.member[1])] if len(node.member) == 2 else found
            parts = self._outputs.take(names.numbers(node, self._member_index, variables))
            return (parts[0], parts[1], parts[2]) if len(parts) == 3 else parts[0]
        argument = node.arguments[0]
        assert isinstance(argument, tree.Reference)
        owner, member = argument.owner, argument.member
        if node.function == "multiplier":
            # lambda of a row, or of the three of a vector equation.
            laws = names.names(argument, variables)
            if member or all(name in self._rows for name in laws):
                return self._lam_of(argument, [f"{name}.{member}" if member else name for name in laws])
            x, y, z = (self._lam_of(argument, [f"{name}.{axis}" for name in laws]) for axis in "xyz")
            return x, y, z
        if is_second(node) and owner in env.coordinates:
            numbers = names.numbers(argument, env.coordinates, variables)
            return environment.taken(self._solved.a, env.first_generalized + numbers)
        numbers = names.numbers(argument, particles, variables)
        if is_second(node):
            found = accelerations.vectors(numbers)
            return found["xyz".index(member)] if member else found
        if len(node.arguments) == 1:
            return self._solved.R.vectors(numbers)
        law = node.arguments[1]
        assert isinstance(law, tree.Reference)
        return self._part(numbers, law, variables)

    def _part(self, numbers: Integers, law: Reference, variables: Mapping[str, Integers]) -> Triple:
        """sum_i lambda_i B_ik over the rows of a constraint, of particles (K,), or of one for each of K constraints."""
        names = self._environment.names.names(law, variables)
        suffix = f".{law.member}" if law.member else ""
        # All rows of a constraint, or the one that is named.
        wanted = [[self._row(law, name + suffix)] if suffix else self._of_constraint[name] for name in names]
        count = max(len(wanted), numbers.size)
        numbers, wanted = np.broadcast_to(numbers, count), wanted if len(wanted) == count else wanted * count
        # One entry for each pair of a particle and a row that acts on it.
        member = np.repeat(np.arange(count), [len(found) for found in wanted])
        row = np.array([i for found in wanted for i in found], dtype=np.int64)
        env, acted = self._environment, numbers[member]
        gradients = Columns(acted.size)
        cartesian = np.flatnonzero(~env.is_dependent[acted])
        if cartesian.size:
            B, first = self._solved.rows.B, env.rows_of(acted[cartesian])
            parts = [entries(B, row[cartesian], first + axis) for axis in range(3)]
            gradients.fill(cartesian, tuple(parts))
        dependent = np.flatnonzero(env.is_dependent[acted])
        if dependent.size:
            declared = [self._solved.rows.rows[i] for i in row[dependent].tolist()]
            gradients.fill(dependent, self._on_dependent(acted[dependent], declared, law))
        lam = environment.taken(self._solved.lam, row)
        every = gradients.vectors(np.arange(acted.size))
        x, y, z = (environment.scattered(lam * part, member, count) for part in every)
        return x, y, z

    def _on_dependent(self, numbers: Integers, wanted: Sequence[rows.Row], node: Reference) -> Triple:
        """df_i/dr_k of rows and dependent particles (K,). Raises `ExpressionError` where that is not determined."""
        env, base = self._environment, node.owner
        s, count = env.symbols, env.dependent.size
        laws = [law for law in self._model.laws if law.members.base == base and law.members.count]
        is_differential = any(isinstance(law, nouns.Differential) for law in laws)

        def values(over: Environment) -> ca.SX:
            if base in self._bodies:
                body, geometry, constants = self._bodies[base]
                return rows.of_body(body, over, geometry, ca.vertsplit(constants))
            return ca.vertcat(*(over.equation(law) for law in laws))

        if base not in self._gradients:
            # By the dependent particles as if they were free, (rows, 3 D), x of all before y, z.
            free, r, v = env.freed()
            f = values(free)
            B = ca.jacobian(f, v if is_differential else r)
            names = [name for law in laws for name in law.rows]
            names = names or [f"{base}.{i}" for i in range(1, f.numel() + 1)]
            self._gradients[base] = {name: i for i, name in enumerate(names)}, env.bound(B, r, v)
        known, B = self._gradients[base]
        rank = np.searchsorted(env.dependent, numbers)
        row = np.array([known[one.name] for one in wanted], dtype=np.int64)
        named: Truths = np.any(_pattern(B).reshape(-1, 3, count), axis=1)
        unnamed = np.flatnonzero(~named[row, rank])
        if unnamed.size:
            # A coordinate enters a row of a law by its differential, (rows, n), and moves a particle, (D, n).
            coordinates = _pattern(ca.jacobian(values(env), s.v if is_differential else s.q))
            parts = [_pattern(ca.jacobian(part, s.q)) for part in env.position(env.dependent)]
            moving = parts[0] | parts[1] | parts[2]
        for i, k in zip(row[unnamed].tolist(), rank[unnamed].tolist(), strict=True):
            if (coordinates[i] & moving[k]).any():
                particle = env.particles.names[int(env.dependent[k])]
                message = (
                    f"`{base}` acts on coordinates that move `{particle}` but does not name `{particle}`: which part"
                    " of its force falls to this particle is not determined"
                )
                hint = f"write the constraint with `{particle}.x`, `{particle}.y`, `{particle}.z`, or record"
                hint += f" `multiplier({base})`"
                raise ExpressionError("share-not-determined", message, node.start, node.end, hint)
        x, y, z = (entries(B, row, rank + axis * count) for axis in range(3))
        return x, y, z

    def _lam_of(self, node: Reference, names: list[str]) -> ca.SX:
        numbers = np.array([self._row(node, name) for name in names], dtype=np.int64)
        return environment.taken(self._solved.lam, numbers)

    def _row(self, node: Reference, name: str) -> int:
        if name not in self._rows:
            message = f"there is no multiplier `{name}`"
            known = [row for row in self._rows if row.startswith(name.rpartition(".")[0] + ".")]
            hint = f"the rows are `{known[0]}` to `{known[-1]}`" if known else ""
            raise ExpressionError("unknown-row", message, node.start, node.end, hint)
        return self._rows[name]


def outputs(model: nouns.Model, env: Environment, named: OutputValues) -> ca.SX:
    """All outputs, flattened. Raises `diagnostics.ModelError` for a row that does not exist."""
    values: list[ca.SX] = []
    for entry, output in enumerate(model.outputs):
        if not output.members.count:
            continue
        parts = _located(output.expression, env.algebra(output.members.variables, results=named))
        named.store(entry, output.members.count, parts)
        values.append(environment.interleaved(parts, output.members.count))
    return ca.densify(ca.vertcat(ca.SX(0, 1), *values))


def _located(expression: nouns.Expression, algebra: SymbolicAlgebra) -> list[ca.SX]:
    """The SX of a scalar, or three of a vector; errors have their location."""
    try:
        value = evaluate.value(expression.tree, algebra)
        return list(value) if isinstance(value, tuple) else [value]
    except ExpressionError as error:
        location = expression.origin.locate(error.start, error.end)
        raise diagnostics.error(error.code, error.message, location, error.hint) from None


def events(model: nouns.Model, env: Environment, named: OutputValues) -> ca.SX:
    """`when` of all declared events, (E,); they may read outputs. Raises as `outputs`, which comes before."""
    values = [_located(event.when, env.algebra(results=named))[0] for event in model.events]
    return ca.densify(ca.vertcat(ca.SX(0, 1), *values))
