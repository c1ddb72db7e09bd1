"""The columns that follow from the others of the same row: the energy and the outputs of the model."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from lagcli.auditing.checks import checks_motion
from lagcli.auditing.checks.audit_report import Check, CheckedLaw, judge
from lagcli.auditing.evidence.autodiff import Array, Scalar, Value
from lagcli.auditing.evidence.differences import CLOCK
from lagcli.auditing.evidence.laws import LawValues, ModelLaws
from lagcli.auditing.evidence.model_values import ModelOnTable
from lagcli.auditing.evidence.table_input import ENERGY
from lagcli.auditing.evidence.tolerances import Evidence
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, tree
from lagcli.expression.tree import ExpressionError
from lagcli.model.family import Integers, MemberIndex
from lagcli.model.resolve import Reference

COLUMNS = CheckedLaw(
    "columns", "D.10, D.35", "energy and outputs follow from t, r, v, lambda and R of the same row"
)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RecomputedResults:
    """The results a run was solved for at T rows: lambda (T, C), R and a of all particles, (T, 3 N); a is nan where
    it does not follow from the row: `lagrangian` of a velocity."""

    lam: Array
    R: Array
    a: Array

    def part(self, rows: slice) -> RecomputedResults:
        """The part for some of the rows."""
        return RecomputedResults(self.lam[rows], self.R[rows], self.a[rows])


def columns(e: Evidence) -> list[Check]:
    """`energy` and the outputs of a run's table, as far as it has them, against their definitions; `energy` is
    T + V + q' dL/dq' - L. What is off by no more than the tolerance of the run explains is right."""
    assert e.run is not None
    table, energy = e.run.table, e.once(checks_motion.energies)
    at = {name: k for k, name in enumerate(table.columns)}
    r, model = e.record, e.laws.model
    names = [ENERGY, *(name for output in model.outputs for name in output.columns)]
    here, moved = _results(e)
    first, known = evaluated(e.laws, r.t, r.q, r.v, here)
    found = [np.column_stack([energy.E, first])]
    q, v = e.moved
    clock = CLOCK * np.abs(r.t).max() + e.tolerance.written.time
    for sign in (1.0, -1.0):  # on both sides, so that what jumps there is seen
        there = r.t + sign * clock, r.q + sign * (q - r.q), r.v + sign * (v - r.v)
        parts = (
            (one, one + sign * (other - one))
            for one, other in zip(_fields(here), _fields(moved), strict=True)
        )
        results = RecomputedResults(*(beside for _, beside in parts))
        found.append(np.column_stack([energy.E_moved, evaluated(e.laws, *there, results)[0]]))
    retained = [k for k, name in enumerate(names) if name in at]
    one, *others = (part[:, retained] for part in found)
    recorded = table.rows[:, [at[names[k]] for k in retained]]
    limit = np.maximum(e.spread(one, others[0]), e.spread(one, others[1])) + e.tolerance.atol
    alike = (recorded == one) | (np.isnan(recorded) & np.isnan(one))
    if e.tolerance.written.is_short:
        limit = limit + e.recorded(recorded)
    apart = np.where(alike, 0.0, recorded - np.where(alike, 0.0, one))
    judged = np.broadcast_to(np.array([True, *known])[retained], apart.shape)
    limit = np.where(np.isnan(limit), np.inf, limit)
    return [judge(COLUMNS, [names[k] for k in retained], r.t, apart, limit, judged)]


def _fields(results: RecomputedResults) -> tuple[Array, Array, Array]:
    return results.lam, results.R, results.a


def _results(e: Evidence) -> tuple[RecomputedResults, RecomputedResults]:
    """The results at the rows, and at the moved states with lambda and R off by the tolerance."""
    r, more = e.record, 1 + e.tolerance.rtol
    return (
        RecomputedResults(r.lam, _of_all(e.laws, r.R_q, r.R_x), _accelerations(e, e.values, r.R_q, r.R_x)),
        RecomputedResults(
            r.lam * more,
            _of_all(e.laws, r.R_q, r.R_x) * more,
            _accelerations(e, e.moved_values, r.R_q * more, r.R_x * more),
        ),
    )


def _of_all(laws: ModelLaws, own: Array, dependent: Array) -> Array:
    """Components of the particles in their order, (T, 3 N), from those of coordinates and of dependent particles."""
    found = np.zeros((len(own), 3 * len(laws.index.particles)))
    for numbers, part in ((laws.index.cartesian, own), (laws.index.dependent, dependent)):
        columns = (3 * numbers[:, None] + np.arange(3)).ravel()
        found[:, columns] = part[:, : columns.size]
    return found


def _accelerations(e: Evidence, values: LawValues, R_q: Array, R_x: Array) -> Array:
    """(F_k + R_k)/m_k (D.23), (T, 3 N)."""
    index, own = e.laws.index, e.laws.index.first_generalized
    force = _of_all(e.laws, R_q - values.V_q + values.L_q, R_x - values.V_x) + values.F.reshape(len(R_q), -1)
    moving = np.zeros(3 * len(index.particles), dtype=bool)
    moving[(3 * index.cartesian[:, None] + np.arange(3)).ravel()] = np.any(values.L_v[:, :own])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(moving, np.nan, force / np.repeat(index.masses, 3)))


def evaluated(
    laws: ModelLaws, t: Array, q: Array, v: Array, results: RecomputedResults
) -> tuple[Array, list[bool]]:
    """All outputs at T rows, (T, columns), and which follow from the rows."""
    if not laws.model.outputs:
        return np.zeros((len(t), 0)), []
    parts, known = [], []
    for k in laws.chunks(len(t)):
        found = _Outputs(laws, laws.free(t[k], q[k], v[k]), results.part(k))
        parts.append(found.values())
        known = found.known
    return np.concatenate(parts), known


class _UnknownError(Exception):
    """A quantity that does not follow from the row."""


class _Outputs:
    """The outputs at the rows of a table, and what they may use: multipliers, reactions, accelerations, energies,
    earlier outputs. `known`: which columns follow from the rows."""

    def __init__(self, laws: ModelLaws, on_table: ModelOnTable, results: RecomputedResults) -> None:
        self._laws, self._on_table, self._results = laws, on_table, results
        self._rows = {name: i for i, name in enumerate(laws.rows)}
        self._member_index = MemberIndex([output.members for output in laws.model.outputs])
        self._known: list[tuple[Array, ...]] = [()] * len(self._member_index)
        self.known: list[bool] = []

    def values(self) -> Array:
        """The columns of all outputs, (T, columns)."""
        found = [np.zeros((self._on_table.rows, 0))]
        for entry, output in enumerate(self._laws.model.outputs):
            count, width = output.members.count, len(output.columns)
            if not count:
                continue
            algebra = self._on_table.algebra(output.members.variables, results=self)
            try:
                value = evaluate.value(output.expression.tree, algebra)
            except ExpressionError as error:
                raise _located(error, output.expression.origin.locate(error.start, error.end)) from None
            except _UnknownError:
                found.append(np.full((self._on_table.rows, width), np.nan))
                self.known += [False] * width
                continue
            parts = value if isinstance(value, tuple) else (value,)
            wide = [self._on_table.wide(part, count) for part in parts]
            for member in range(count):
                self._known[self._member_index.first(entry) + member] = tuple(
                    x[:, member : member + 1] for x in wide
                )
            found.append(np.stack(wide, axis=2).reshape(self._on_table.rows, -1))
            self.known += [True] * width
        return np.concatenate(found, axis=1)

    def __call__(self, node: tree.Node, variables: Mapping[str, Integers]) -> Value:
        """The value of what stands in outputs alone; index vectors (K,) of a family give (T, K)."""
        if isinstance(node, tree.Call):
            return self._called(node, variables)
        assert isinstance(node, (tree.Name, tree.Member, tree.Index))
        if isinstance(node, tree.Name) and node.name == "kinetic":
            v = np.concatenate([self._wide(part) for part in self._on_table.velocity(self._all)], axis=1)
            energy: Array = (np.tile(self._laws.index.masses, 3) * v**2 / 2).sum(axis=1, keepdims=True)
            return energy
        if isinstance(node, tree.Name) and node.name == "potential":
            return self._laws.potential(self._on_table)[:, None]
        if not isinstance(node, tree.Name) and node.owner in self._laws.index.particles:
            return self._acceleration(node, node.member[1:], variables)
        known = [
            self._known[number]
            for number in self._laws.index.names.numbers(node, self._member_index, variables)
        ]
        if not all(known):
            raise _UnknownError
        parts = tuple(np.concatenate(part, axis=1) for part in zip(*known, strict=True))
        return parts if len(parts) == 3 else parts[0]

    def _called(self, node: tree.Call, variables: Mapping[str, Integers]) -> Value:
        index, argument = self._laws.index, node.arguments[0]
        assert isinstance(argument, (tree.Name, tree.Member, tree.Index))
        if node.function == "multiplier":
            return self._multipliers(argument, variables)
        if node.function == "rate":
            if (argument.name if isinstance(argument, tree.Name) else argument.owner) in index.coordinates:
                raise _UnknownError  # d/dt of dL/dq' would have to be solved for it
            member = "" if isinstance(argument, tree.Name) else argument.member
            return self._acceleration(argument, member, variables)
        numbers = self._laws.index.names.numbers(argument, index.particles, variables)
        if len(node.arguments) == 1:
            return _triple(self._results.R, numbers)
        law = node.arguments[1]
        assert isinstance(law, (tree.Name, tree.Member, tree.Index))
        return self._part(numbers, law, variables)

    def _part(self, numbers: Integers, law: Reference, variables: Mapping[str, Integers]) -> Value:
        """lambda_i B_ik of a constraint on particles (K,), or of one for each of K constraints (D.22)."""
        names = self._laws.index.names.names(law, variables)
        member = "" if isinstance(law, tree.Name) else law.member
        parts = []
        for name in names:
            lam = np.zeros(self._results.lam.shape)
            own = [i for row, i in self._rows.items() if row == name or row.startswith(f"{name}.")]
            rows = [self._row(law, f"{name}.{member}")] if member else own
            lam[:, rows] = self._results.lam[:, rows]
            parts.append(self._laws.parts_of_reactions(self._on_table, lam))
        if len(parts) == 1:
            return _triple(parts[0], numbers)
        numbers = np.broadcast_to(numbers, len(parts))
        each = [_triple(part, numbers[k : k + 1]) for k, part in enumerate(parts)]
        x, y, z = (np.concatenate([one[axis] for one in each], axis=1) for axis in range(3))
        return x, y, z

    def _acceleration(self, node: Reference, member: str, variables: Mapping[str, Integers]) -> Value:
        found = _triple(
            self._results.a, self._laws.index.names.numbers(node, self._laws.index.particles, variables)
        )
        if np.isnan(found[0]).all():
            raise _UnknownError
        return found["xyz".index(member)] if member else found

    @property
    def _all(self) -> Integers:
        return np.arange(len(self._laws.index.particles))

    def _wide(self, x: Scalar) -> Array:
        return self._on_table.wide(x, len(self._laws.index.particles))

    def _multipliers(self, node: Reference, variables: Mapping[str, Integers]) -> Value:
        """lambda of a row, or of the three of a vector equation."""
        member = "" if isinstance(node, tree.Name) else node.member
        names = self._laws.index.names.names(node, variables)
        if member:
            return self._lambda(node, [f"{name}.{member}" for name in names])
        if all(name in self._rows for name in names):
            return self._lambda(node, names)
        x, y, z = (self._lambda(node, [f"{name}.{axis}" for name in names]) for axis in "xyz")
        return x, y, z

    def _lambda(self, node: Reference, names: list[str]) -> Array:
        return np.asarray(self._results.lam[:, [self._row(node, name) for name in names]])

    def _row(self, node: Reference, name: str) -> int:
        if name not in self._rows:
            raise ExpressionError("unknown-row", f"there is no multiplier `{name}`", node.start, node.end)
        return self._rows[name]


def _triple(y: Array, numbers: Integers) -> tuple[Array, Array, Array]:
    x, y, z = (y[:, 3 * numbers + axis] for axis in range(3))
    return x, y, z


def _located(error: ExpressionError, location: diagnostics.Location) -> diagnostics.ModelError:
    return diagnostics.ModelError([diagnostics.Diagnostic(error.code, error.message, location, error.hint)])
