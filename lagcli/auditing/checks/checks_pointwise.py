"""Checks that each row of a table must stand alone: constraints, reactions, multipliers, virtual work, and the columns
that follow from the others, the energy and the outputs of the model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lagcli.auditing.checks import checks_motion
from lagcli.auditing.checks.audit_report import Check, Law, judge
from lagcli.auditing.evidence.autodiff import Array, Value
from lagcli.auditing.evidence.differences import CLOCK, widest, with_truncation
from lagcli.auditing.evidence.laws import LawValues, ModelLaws
from lagcli.auditing.evidence.model_values import ModelOnTable
from lagcli.auditing.evidence.table_input import ENERGY
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, tree
from lagcli.expression.tree import ExpressionError
from lagcli.model.family import Integers, MemberIndex
from lagcli.model.resolve import Reference

POSITIONS = Law("positions", "D.2", "f_i(r, t) = 0")
VELOCITIES = Law("velocities", "D.6", "sum_k B_ik . v_k + B_it = 0")
DEPENDENT = Law("dependent", "D.27", "r_k = x_k(q, t), v_k = dx_k/dt")
DEMAND = Law("accelerations", "D.24", "d/dt (B v + b) = 0 with a_k = (F_k + R_k)/m_k")
REACTIONS = Law("reactions", "D.22", "R_k = sum_i lambda_i B_ik")
MULTIPLIERS = Law("multipliers", "D.22", "lambda_i is that of R where it is unique")
IDEAL = Law("ideal", "D.11", "sum_k R_k . dr_k = 0 over virtual displacements")
CARRIED = Law("generalized", "D.30", "sum_k R_k . dr_k/dq_j = R_j + what acts on q_j itself")
POWER = Law("work", "D.6", "sum_k R_k . v_k = - sum_i lambda_i B_it")
COLUMNS = Law("columns", "D.10, D.35", "energy and outputs follow from t, r, v, lambda and R of the same row")
Results = tuple[Array, Array, Array]
"""The results that a run was solved for at T rows: lambda (T, C), R and a of all particles, (T, 3 N); a is nan where it
does not follow from the row: `lagrangian` of a velocity."""


def constraints(e: Evidence) -> list[Check]:
    """f and B v + b, and the positions and velocities of dependent particles."""
    r, values, names = e.record, e.values, e.names
    checks = [
        judge(POSITIONS, e.laws.holonomic, r.t, values.f, e.noise("f") + e.tolerance.atol),
        judge(VELOCITIES, e.laws.rows, r.t, values.w, e.noise("w") + e.tolerance.atol),
    ]
    if values.x.size:
        checks.append(judge(DEPENDENT, (*names.q[e.n :], *names.v[e.n :]), r.t, *dependent(e)))
    return checks


def dependent(e: Evidence) -> tuple[Array, Array]:
    """The positions and velocities of dependent particles beside those of the model, with limits, (T, 6 Nd) each."""
    apart = e.record.q[:, e.n :] - e.values.x, e.record.v[:, e.n :] - e.values.u
    noise = np.concatenate([e.noise("x"), e.noise("u")], axis=1)
    return np.concatenate(apart, axis=1), noise + e.tolerance.atol


def demand(e: Evidence) -> list[Check]:
    """The demand of the forces on B v + b, without any difference of rows; of models in Cartesian coordinates alone."""
    laws, rows, n = e.laws, e.looked_at, e.n
    r = e.record.part(rows)
    if not laws.C or len(laws.index.coordinates) or laws.model.lagrangian is not None:
        return []
    a = e.total_force[rows, :n] / e.masses[:n]

    def second(q: Array, v: Array, later: float = 0.0) -> Array:
        return laws.demanded(r.t + later, q, v, a)

    rates = second(r.q, r.v)
    limit = e.spread(rates, second(e.moved[0][rows], e.moved[1][rows])) + e.tolerance.atol
    # What bends at the time itself has the state after it where it is a contact; of an equation it is one in between.
    sides = np.stack([rates, *(second(r.q, r.v, side * e.clock) for side in (-1, 1))])
    bends = np.ptp(np.sign(sides), axis=0) > 1
    least = np.abs(np.nan_to_num(sides, nan=np.inf)).argmin(axis=0)
    nearest = np.take_along_axis(sides, least[None], axis=0)[0]
    rates = np.where(bends & ~np.isin(laws.rows, laws.contacts), 0.0, nearest)
    # F is known to its own noise, R to that of B^T lambda.
    off = e.force_noise[rows, :n] + e.reaction_limit[rows]
    off = off + e.recorded(np.abs(r.R[:, :n]).max(axis=1, initial=0.0))[:, None]
    limit = limit + np.einsum("mcn,mn->mc", np.abs(e.displacements.B), off / e.masses[:n])
    known = ~np.any(np.isnan(r.lam), axis=1, keepdims=True)
    return [judge(DEMAND, laws.rows, r.t, rates, widest(limit), known)]


def reactions(e: Evidence) -> list[Check]:
    """R = B^T lambda, and lambda from R."""
    r, R, names = e.record, e.record.R[:, : e.n], e.names.R[: e.n]
    if not e.laws.C:
        return [judge(REACTIONS, names, r.t, R, e.reaction_limit)]
    apart = R - e.values.pull
    known = np.isfinite(r.lam).all(axis=1)
    check = judge(REACTIONS, names, r.t[known], apart[known], e.reaction_limit[known])
    # lambda of the rows looked at, where it is unique; one that is no number must have a pole there
    rows, d = e.looked_at, e.displacements
    expected, spread = d.multipliers(R[rows], e.reaction_limit[rows])
    lam = r.lam[rows]
    limit = spread + d.condition[:, None] * e.recorded(expected) + e.tolerance.atol
    judged = d.is_unique & ~d.is_singular[:, None]
    missing = np.isnan(lam)
    apart = np.where(missing, np.inf, lam - np.nan_to_num(expected))
    judged |= missing & ~d.is_singular[:, None]
    limit = np.where(missing, e.tolerance.atol, limit)
    # A multiplier that is unique nowhere is not compared with R; that it is not is stated in words.
    compared = np.flatnonzero((d.is_unique | missing).any(axis=0) | d.is_singular.all())
    of_compared = (part[:, compared] for part in (apart, limit, judged))
    return [check, judge(MULTIPLIERS, [e.laws.rows[i] for i in compared], r.t[rows], *of_compared)]


def ideal(e: Evidence) -> list[Check]:
    """Virtual work (D.11) on an orthonormal basis, by the part of R along it, and the real power beside it."""
    rows, d, r = e.looked_at, e.displacements, e.record
    R, v, off_v = (y[..., : e.n] for y in (r.R, r.v, e.off_v))
    size = np.linalg.norm(R[rows], axis=1)[:, None]
    limit = np.linalg.norm(e.reaction_limit[rows], axis=1)[:, None] + 1e-14 * d.condition[:, None] * size
    along = d.virtual(R[rows])
    checks = [judge(IDEAL, e.names.R[: e.n], r.t[rows], along, limit, ~d.is_singular[:, None])]
    if e.laws.C:
        given = -(r.lam * e.values.b).sum(axis=1)
        limit = (e.reaction_limit * np.abs(v)).sum(axis=1) + (np.abs(R) * SAFETY * off_v).sum(axis=1)
        limit += np.nan_to_num(np.abs(r.lam) * (e.noise("b") + e.noise("w"))).sum(axis=1) + e.tolerance.atol
        known = np.isfinite(given)
        apart = ((R * v).sum(axis=1) - given)[known, None]
        checks.append(judge(POWER, ("all particles",), r.t[known], apart, limit[known, None]))
    return checks


def carried(e: Evidence) -> list[Check]:
    """The virtual work of R of the dependent particles: that of the multipliers and of what acts on q itself."""
    r, values, rate, own, n = e.record, e.values, e.momentum_rate, e.own, e.n
    if not values.x.size:
        return []
    R = r.R[:, n:]
    acting = (values.force() - rate.value)[:, own:n]
    carriers = e.pushed(R - (values.L_q - rate.value)[:, n:])[:, own:]
    residual = carriers - acting - r.R[:, own:n]
    moved = e.laws.pushed(r.t, *e.moved, R)
    # R of dependent particles is known to its rounding, and as F is
    noise = e.recorded(np.abs(R) + np.abs(R).max(axis=0, initial=0.0)) + e.force_noise[:, n:]
    limit = e.spread(e.pushed(R), moved)[:, own:] + e.pushed_limit(noise)[:, own:]
    limit += (e.total_noise + rate.noise)[:, own:n] + e.tolerance.atol
    truncation = rate.truncation[:, own:n] + e.pushed_limit(rate.truncation[:, n:])[:, own:]
    limit += e.pushed_limit((e.noise("L_q") + rate.noise)[:, n:])[:, own:]
    judged = truncation <= np.maximum(RESOLVED * np.abs(acting).max(axis=0), limit)
    return [judge(CARRIED, e.names.q[own:n], r.t, residual, with_truncation(limit, truncation), judged)]


def columns(e: Evidence) -> list[Check]:
    """`energy` and the outputs of a run's table, as far as it has them, against their definitions; `energy` is
    T + V + q' dL/dq' - L. What is off by no more than the tolerance of the run explains is right."""
    assert e.run is not None
    table, energy = e.run.table, e.once(checks_motion.energies)
    at = {name: k for k, name in enumerate(table.columns)}
    r, model, more = e.record, e.laws.model, 1 + e.tolerance.rtol
    names = [ENERGY, *(name for output in model.outputs for name in output.columns)]
    recorded_results = _results(e.laws, e.values, r.lam, r.R)
    moved = _results(e.laws, e.moved_values, r.lam * more, r.R * more)
    q, v = r.q[:, : e.n], r.v[:, : e.n]
    first, known = _evaluated(e.laws, r.t, q, v, recorded_results)
    expected_columns = [np.column_stack([energy.E, first])]
    clock = CLOCK * np.abs(r.t).max() + e.tolerance.written.time
    for sign in (1.0, -1.0):  # on both sides, so that what jumps there is seen
        pairs = zip(recorded_results, moved, strict=True)
        lam, R, a = (part + sign * (other - part) for part, other in pairs)
        q_there, v_there = (y + sign * (other - y) for y, other in zip((q, v), e.moved, strict=True))
        there, _ = _evaluated(e.laws, r.t + sign * clock, q_there, v_there, (lam, R, a))
        expected_columns.append(np.column_stack([energy.E_moved, there]))
    retained = [k for k, name in enumerate(names) if name in at]
    expected, *others = (part[:, retained] for part in expected_columns)
    recorded = table.rows[:, [at[names[k]] for k in retained]]
    limit = np.maximum(e.spread(expected, others[0]), e.spread(expected, others[1])) + e.tolerance.atol
    alike = (recorded == expected) | (np.isnan(recorded) & np.isnan(expected))
    if e.tolerance.written.is_short:
        limit = limit + e.recorded(recorded)
    apart = np.where(alike, 0.0, recorded - np.where(alike, 0.0, expected))
    judged = np.broadcast_to(np.array([True, *known])[retained], apart.shape)
    limit = np.where(np.isnan(limit), np.inf, limit)
    return [judge(COLUMNS, [names[k] for k in retained], r.t, apart, limit, judged)]


def _results(laws: ModelLaws, values: LawValues, lam: Array, R: Array) -> Results:
    """The results at rows with reactions R (T, n + 3 Nd): a_k = (F_k + R_k)/m_k (D.23)."""
    index, own = laws.index, laws.index.first_generalized
    with np.errstate(divide="ignore", invalid="ignore"):
        a = index.components(values.force(R)) / np.repeat(index.masses, 3)
    if np.any(values.L_v[:, :own]):
        a[:, np.repeat(~index.is_dependent, 3)] = np.nan
    return lam, index.components(R), a


def _evaluated(laws: ModelLaws, t: Array, q: Array, v: Array, results: Results) -> tuple[Array, list[bool]]:
    """All outputs at T rows, (T, columns), and which follow from the rows."""
    if not laws.model.outputs:
        return np.zeros((len(t), 0)), []
    parts = []
    for k in laws.chunks(len(t)):
        lam, R, a = (part[k] for part in results)
        outputs = _Outputs(laws, laws.free(t[k], q[k], v[k]), (lam, R, a))
        parts.append(outputs.values())
    return np.concatenate(parts), outputs.known


class _UnknownError(Exception):
    """A quantity that does not follow from the row."""


class _Outputs:
    """The outputs at the rows of a table, and what they may use: multipliers, reactions, accelerations, energies,
    earlier outputs. `known`: which columns follow from the rows."""

    def __init__(self, laws: ModelLaws, on_table: ModelOnTable, results: Results) -> None:
        self._laws, self._on_table, self._index = laws, on_table, laws.index
        self._lam, self._R, self._a = results
        self._rows = {name: i for i, name in enumerate(laws.rows)}
        self._member_index = MemberIndex([output.members for output in laws.model.outputs])
        self._known: list[tuple[Array, ...]] = [()] * len(self._member_index)
        self.known: list[bool] = []

    def values(self) -> Array:
        """The columns of all outputs, (T, columns)."""
        columns = [np.zeros((self._on_table.rows, 0))]
        for entry, output in enumerate(self._laws.model.outputs):
            count, width = output.members.count, len(output.columns)
            if not count:
                continue
            algebra = self._on_table.algebra(output.members.variables, results=self)
            try:
                value = evaluate.value(output.expression.tree, algebra)
            except ExpressionError as error:
                where = output.expression.origin.locate(error.start, error.end)
                raise diagnostics.error(error.code, error.message, where, error.hint) from None
            except _UnknownError:
                columns.append(np.full((self._on_table.rows, width), np.nan))
                self.known += [False] * width
                continue
            parts = value if isinstance(value, tuple) else (value,)
            wide = [self._on_table.wide(part, count) for part in parts]
            first = self._member_index.first(entry)
            for member in range(count):
                self._known[first + member] = tuple(x[:, member : member + 1] for x in wide)
            columns.append(np.stack(wide, axis=2).reshape(self._on_table.rows, -1))
            self.known += [True] * width
        return np.concatenate(columns, axis=1)

    def __call__(self, node: tree.Node, variables: Mapping[str, Integers]) -> Value:
        """The value of what stands in outputs alone; index vectors (K,) of a family give (T, K)."""
        index, table = self._index, self._on_table
        if not isinstance(node, tree.Call):
            assert isinstance(node, (tree.Name, tree.Member, tree.Index))
            if isinstance(node, tree.Name) and node.name == "kinetic":
                count = len(index.particles)
                v = np.concatenate([table.wide(x, count) for x in table.velocity(np.arange(count))], axis=1)
                energy: Array = (np.tile(index.masses, 3) * v**2 / 2).sum(axis=1, keepdims=True)
                return energy
            if isinstance(node, tree.Name) and node.name == "potential":
                return self._laws.potential(table)[:, None]
            if not isinstance(node, tree.Name) and node.owner in index.particles:
                return self._acceleration(node, node.member[1:], variables)
            known = [self._known[k] for k in index.names.numbers(node, self._member_index, variables)]
            if not all(known):
                raise _UnknownError
            columns = tuple(np.concatenate(part, axis=1) for part in zip(*known, strict=True))
            return columns if len(columns) == 3 else columns[0]
        argument = node.arguments[0]
        assert isinstance(argument, (tree.Name, tree.Member, tree.Index))
        member = "" if isinstance(argument, tree.Name) else argument.member
        if node.function == "multiplier":
            names = index.names.names(argument, variables)

            def of_rows(suffix: str) -> Array:
                return np.asarray(self._lam[:, [self._row(argument, name + suffix) for name in names]])

            if member or all(name in self._rows for name in names):
                return of_rows(f".{member}" if member else "")
            x, y, z = (of_rows(f".{axis}") for axis in "xyz")  # of vector equations
            return x, y, z
        if node.function == "rate":
            if (argument.name if isinstance(argument, tree.Name) else argument.owner) in index.coordinates:
                raise _UnknownError  # d/dt of dL/dq' would have to be solved for it
            return self._acceleration(argument, member, variables)
        numbers = index.names.numbers(argument, index.particles, variables)
        if len(node.arguments) == 1:
            return _triple(self._R, numbers)
        # lambda_i B_ik of a constraint on particles (K,), or of one for each of K constraints (D.22)
        law = node.arguments[1]
        assert isinstance(law, (tree.Name, tree.Member, tree.Index))
        member = "" if isinstance(law, tree.Name) else law.member
        parts = []
        for name in self._index.names.names(law, variables):
            lam = np.zeros(self._lam.shape)
            own = [i for row, i in self._rows.items() if row == name or row.startswith(f"{name}.")]
            rows = [self._row(law, f"{name}.{member}")] if member else own
            lam[:, rows] = self._lam[:, rows]
            parts.append(self._laws.parts_of_reactions(self._on_table, lam))
        if len(parts) == 1:
            return _triple(parts[0], numbers)
        numbers = np.broadcast_to(numbers, len(parts))
        each = [_triple(part, numbers[k : k + 1]) for k, part in enumerate(parts)]
        x, y, z = (np.concatenate(columns, axis=1) for columns in zip(*each, strict=True))
        return x, y, z

    def _acceleration(self, node: Reference, member: str, variables: Mapping[str, Integers]) -> Value:
        a = _triple(self._a, self._index.names.numbers(node, self._index.particles, variables))
        if np.isnan(a[0]).all():
            raise _UnknownError
        return a["xyz".index(member)] if member else a

    def _row(self, node: Reference, name: str) -> int:
        if name not in self._rows:
            raise ExpressionError("unknown-row", f"there is no multiplier `{name}`", node.start, node.end)
        return self._rows[name]


def _triple(y: Array, numbers: Integers) -> tuple[Array, Array, Array]:
    x, y, z = (y[:, 3 * numbers + axis] for axis in range(3))
    return x, y, z
