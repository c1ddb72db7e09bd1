"""Values that outputs may read besides the motion: multipliers, reactions, accelerations, energies, earlier outputs.

a, lambda and R are those of (D.24) at the row; the part of one constraint in R_k is lambda_i times its row (D.22).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from lagcli.equations import energy, explicit_gradient, family_columns, rows
from lagcli.equations.environment import Environment
from lagcli.equations.family_columns import Columns, Triple, Value
from lagcli.equations.symbols import SymbolicAlgebra
from lagcli.errors import diagnostics
from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.model import model as nouns
from lagcli.model.family import Integers, MemberIndex
from lagcli.model.resolve import Reference, is_second


@frozen
class SolvedValues:
    """The rows of a system and what is solved for: lam (C + K,), a (n,), a_k and R_k of all particles."""

    rows: rows.ConstraintRows
    lam: ca.SX
    a: ca.SX
    accelerations: Columns
    R: Columns


class OutputValues:
    """The values of `multiplier`, `reaction`, accelerations, `kinetic`, `potential` and earlier outputs."""

    def __init__(
        self,
        env: Environment,
        dynamics: energy.Dynamics,
        solved: SolvedValues,
        forces: explicit_gradient.DependentForces,
    ) -> None:
        self._environment, self._solved, self._forces = env, solved, forces
        self._energies = {"kinetic": dynamics.kinetic, "potential": dynamics.potential}
        self._rows = {row.name: i for i, row in enumerate(solved.rows.rows)}
        self._of_constraint: dict[str, list[int]] = {}
        for i, row in enumerate(solved.rows.rows):
            self._of_constraint.setdefault(row.constraint, []).append(i)
        self._member_index = MemberIndex()
        self._outputs = Columns(0)

    def number(self, outputs: Sequence[nouns.Output]) -> None:
        """Number the outputs, which are kept one after another."""
        self._member_index = MemberIndex([output.members for output in outputs])
        self._outputs = Columns(len(self._member_index))

    def store(self, entry: int, count: int, parts: Sequence[ca.SX]) -> None:
        """An output that later outputs may use."""
        values = tuple(family_columns.column(part, count) for part in parts)
        self._outputs.fill(np.arange(count) + self._member_index.first(entry), values)

    def __call__(self, node: tree.Node, variables: Mapping[str, Integers]) -> Value:
        if isinstance(node, tree.Name) and node.name in self._energies:
            return self._energies[node.name]
        if isinstance(node, tree.Call):
            return self._called(node, variables)
        assert isinstance(node, (tree.Name, tree.Member, tree.Index))
        names = self._environment.names
        if not isinstance(node, tree.Name) and node.owner in self._environment.particles:
            numbers = names.numbers(node, self._environment.particles, variables)
            found = self._solved.accelerations.vectors(numbers)
            return found["xyz".index(node.member[1])] if len(node.member) == 2 else found
        parts = self._outputs.take(names.numbers(node, self._member_index, variables))
        return (parts[0], parts[1], parts[2]) if len(parts) == 3 else parts[0]

    def _called(self, node: tree.Call, variables: Mapping[str, Integers]) -> Value:
        env, argument = self._environment, node.arguments[0]
        assert isinstance(argument, (tree.Name, tree.Member, tree.Index))
        if is_second(node):
            return self._second(argument, variables)
        if node.function == "multiplier":
            return self._multipliers(argument, variables)
        numbers = env.names.numbers(argument, env.particles, variables)
        if len(node.arguments) == 1:
            return self._solved.R.vectors(numbers)
        law = node.arguments[1]
        assert isinstance(law, (tree.Name, tree.Member, tree.Index))
        return self._part(numbers, law, variables)

    def _second(self, argument: Reference, variables: Mapping[str, Integers]) -> Value:
        """`rate(x, 2)` of a coordinate, a particle or one of its components."""
        env = self._environment
        owner = argument.name if isinstance(argument, tree.Name) else argument.owner
        if owner in env.coordinates:
            numbers = env.names.numbers(argument, env.coordinates, variables)
            return family_columns.taken(self._solved.a, env.first_generalized + numbers)
        found = self._solved.accelerations.vectors(env.names.numbers(argument, env.particles, variables))
        member = "" if isinstance(argument, tree.Name) else argument.member
        return found["xyz".index(member)] if member else found

    def _part(self, numbers: Integers, law: Reference, variables: Mapping[str, Integers]) -> Triple:
        """sum_i lambda_i B_ik over the rows of a constraint, of particles (K,), or of one for each of K constraints."""
        wanted = [self._rows_of(law, name) for name in self._environment.names.names(law, variables)]
        count = max(len(wanted), numbers.size)
        numbers, wanted = np.broadcast_to(numbers, count), wanted if len(wanted) == count else wanted * count
        # One entry for each pair of a particle and a row that acts on it.
        member = np.repeat(np.arange(count), [len(found) for found in wanted])
        row = np.array([i for found in wanted for i in found], dtype=np.int64)
        x, y, z = self._gradients(numbers[member], row, law)
        lam = family_columns.taken(self._solved.lam, row)
        force = [family_columns.scattered(lam * part, member, count) for part in (x, y, z)]
        return force[0], force[1], force[2]

    def _gradients(self, numbers: Integers, row: Integers, law: Reference) -> Triple:
        """The components of B along particles (K,) in rows (K,)."""
        env = self._environment
        found = Columns(numbers.size)
        cartesian = np.flatnonzero(~env.is_dependent[numbers])
        if cartesian.size:
            B, first = self._solved.rows.B, env.rows_of(numbers[cartesian])
            parts = [explicit_gradient.entries(B, row[cartesian], first + axis) for axis in range(3)]
            found.fill(cartesian, tuple(parts))
        dependent = np.flatnonzero(env.is_dependent[numbers])
        if dependent.size:
            wanted = [self._solved.rows.rows[i] for i in row[dependent].tolist()]
            found.fill(dependent, self._forces.gradients(numbers[dependent], wanted, law))
        return found.vectors(np.arange(numbers.size))

    def _rows_of(self, node: Reference, name: str) -> list[int]:
        """All rows of a constraint, or the one that is named."""
        member = "" if isinstance(node, tree.Name) else node.member
        if not member:
            return self._of_constraint[name]
        self._require(node, f"{name}.{member}")
        return [self._rows[f"{name}.{member}"]]

    def _multipliers(self, node: Reference, variables: Mapping[str, Integers]) -> Value:
        """lambda of a row, or of the three of a vector equation."""
        member = "" if isinstance(node, tree.Name) else node.member
        names = self._environment.names.names(node, variables)
        if member:
            return self._lam_of(node, [f"{name}.{member}" for name in names])
        if all(name in self._rows for name in names):
            return self._lam_of(node, names)
        x, y, z = (self._lam_of(node, [f"{name}.{axis}" for name in names]) for axis in "xyz")
        return x, y, z

    def _lam_of(self, node: Reference, names: list[str]) -> ca.SX:
        for name in names:
            self._require(node, name)
        return family_columns.taken(
            self._solved.lam, np.array([self._rows[name] for name in names], dtype=np.int64)
        )

    def _require(self, node: Reference, name: str) -> None:
        if name not in self._rows:
            message = f"there is no multiplier `{name}`"
            known = [row for row in self._rows if row.startswith(name.rpartition(".")[0] + ".")]
            hint = f"the rows are `{known[0]}` to `{known[-1]}`" if known else ""
            raise ExpressionError("unknown-row", message, node.start, node.end, hint)


def outputs(model: nouns.Model, env: Environment, named: OutputValues) -> ca.SX:
    """All outputs, flattened. Raises `diagnostics.ModelError` for a row that does not exist."""
    values: list[ca.SX] = []
    named.number(model.outputs)
    for entry, output in enumerate(model.outputs):
        if not output.members.count:
            continue
        parts = _located(output.expression, env, env.algebra(output.members.variables, results=named))
        named.store(entry, output.members.count, parts)
        values.append(family_columns.interleaved(parts, output.members.count))
    return ca.densify(ca.vertcat(*values)) if values else ca.SX(0, 1)


def _located(expression: nouns.Expression, env: Environment, algebra: SymbolicAlgebra) -> list[ca.SX]:
    try:
        return env.either(expression, algebra)
    except ExpressionError as error:
        location = expression.origin.locate(error.start, error.end)
        found = diagnostics.Diagnostic(error.code, error.message, location, error.hint)
        raise diagnostics.ModelError([found]) from None


def events(model: nouns.Model, env: Environment, named: OutputValues) -> ca.SX:
    """`when` of all declared events, (E,); they may read outputs. Raises as `outputs`, which comes before."""
    values = [_located(event.when, env, env.algebra(results=named))[0] for event in model.events]
    return ca.densify(ca.vertcat(*values)) if values else ca.SX(0, 1)
