"""A second opinion on points of rest: each row of their table against the laws of the model.

f = 0, b = 0,   F + B^T lambda = 0 with the inertial terms of positions that move with t,   R,   0 <= lambda, g >= 0
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli import doubles
from lagcli.auditing.checks.audit_report import Audit, Check, CheckedLaw, judge
from lagcli.auditing.evidence import table_input
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import LawValues, ModelLaws
from lagcli.model import model as nouns

POSITIONS = CheckedLaw("places", "D.2", "f(r, q, t) = 0, and b = 0 of rows at rest")
EQUILIBRIUM = CheckedLaw(
    "equilibrium", "D.25", "F + sum lambda_i B_i = 0 with zero velocities and accelerations"
)
REACTIONS = CheckedLaw("reactions", "D.22", "R = sum lambda_i B_i, and m a - F of dependent particles")
SIGNORINI = CheckedLaw("signorini", "", "g >= 0, lambda >= 0, lambda g = 0")
# The rounding of numbers that a table holds, as a part of them; the step of differences in t, as a part of the length
# of a run.
ROUNDED, STEP = 1e-11, 1e-3


def is_table(columns: Sequence[str]) -> bool:
    """True for a table of points of rest."""
    return "t" not in columns and {"potential", "residual", "unique_multipliers"} <= set(columns)


def wanted(model: nouns.Model, columns: Sequence[str]) -> tuple[str, ...]:
    """The columns that are read. Raises `table_input.TableError` with what is missing."""
    names = table_input.names(_laws(model))
    needed = (*names.q, *names.x, *names.lam, *names.R_q, *names.R_x)
    missing = [name for name in needed if name not in set(columns)]
    if missing:
        raise table_input.TableError(f"the table of points lacks the column `{missing[0]}`")
    return needed


def audit(model: nouns.Model, columns: Sequence[str], rows: Array, unread: Sequence[str] = ()) -> Audit:
    """The audit of points (T, columns). Raises `table_input.TableError`."""
    laws = _laws(model)
    wanted(model, columns)
    if not len(rows):
        raise table_input.TableError("the table has no rows")
    names, column = table_input.names(laws), {name: i for i, name in enumerate(columns)}
    q, lam, R_q, R_x, x = (
        rows[:, [column[name] for name in part]]
        for part in (names.q, names.lam, names.R_q, names.R_x, names.x)
    )
    with np.errstate(all="ignore"):
        points = _RestValues(laws, q, lam)
        checks = [points.positions(x, names), points.equilibrium(names), points.reactions(R_q, R_x, names)]
        if laws.contacts:
            checks.append(points.contacts())
    notes = ("the rows are points of rest; in the checks t is the number of a row",)
    end, checked = float(len(q) - 1), tuple(checks)
    return Audit(
        model.title,
        model.path,
        len(q),
        0.0,
        end,
        0.0,
        0.0,
        checked,
        (),
        notes,
        (),
        tuple(unread),
        of_rest=True,
    )


def _laws(model: nouns.Model) -> ModelLaws:
    return ModelLaws(model, closed=range(len(model.contact_names)))


class _RestValues:
    """The laws at points of rest, and at points beside them, which tell what rounding does.

    What moves with t is differentiated at fixed q by differences of order four: m d2x/dt2 of the dependent particles
    and the explicit rate of dL/dv of the `lagrangian`.
    """

    def __init__(self, laws: ModelLaws, q: Array, lam: Array) -> None:
        self._laws, self._q, self._lam = laws, q, lam
        self._rows, self._t = np.arange(len(q), dtype=float), np.full(len(q), laws.model.simulation.start)
        random = np.random.default_rng(0)
        sizes = _largest(q) + 1e-3
        beside = q + ROUNDED * np.maximum(np.abs(q), 1e-3 * sizes) * random.choice([-1.0, 1.0], q.shape)
        self._here, self._there = self._values(q), self._values(beside)
        (self._inertial, explicit), (inertial, moved_explicit) = self._rates(q), self._rates(beside)
        self._total, self._parts = self._balance(q, self._here, self._inertial, explicit)
        self._moved_total = self._balance(beside, self._there, inertial, moved_explicit)[0]
        self._driven = _largest(self._inertial) + _largest(explicit)

    def _values(self, q: Array, later: float = 0.0) -> LawValues:
        return self._laws.values(self._t + later, q, np.zeros(q.shape), self._lam)

    def _rates(self, q: Array) -> tuple[Array, Array]:
        h = STEP * (self._laws.model.simulation.duration or 1.0)
        at = [self._values(q, k * h) for k in (-2, -1, 1, 2)]
        u, L_v = (
            (y[0] - 8 * y[1] + 8 * y[2] - y[3]) / (12 * h)
            for y in ([values.u for values in at], [values.L_v for values in at])
        )
        return np.repeat(self._laws.index.masses[self._laws.index.dependent], 3) * u, L_v

    def _balance(self, q: Array, values: LawValues, inertial: Array, explicit: Array) -> tuple[Array, Array]:
        """F + B^T lambda (T, n), and the sum of the sizes of its terms at each row, (T, 1)."""
        index, laws = self._laws.index, self._laws
        direct = np.zeros(q.shape)
        direct[:, : index.first_generalized] = values.F[:, index.cartesian].reshape(len(q), -1)
        terms = [direct, values.Q, -values.V_q, values.L_q, values.pull]
        if index.dependent.size:
            onto = self._on_dependent(values) + values.L_x - inertial
            terms.append(laws.pushed(self._t, q, np.zeros(q.shape), onto))
        terms.append(-explicit)
        return np.asarray(sum(terms)), np.asarray(sum(map(_largest, terms)))

    def _on_dependent(self, values: LawValues) -> Array:
        """F of the dependent particles, (T, 3 Nd)."""
        return values.F[:, self._laws.index.dependent].reshape(len(values.F), -1) - values.V_x

    def positions(self, x: Array, names: table_input.TableNames) -> Check:
        """f = 0 and b = 0, and positions of dependent particles."""
        laws, here, there = self._laws, self._here, self._there
        equal = laws.s - len(laws.contacts)
        is_rest = np.ones(laws.C, dtype=bool)
        is_rest[equal : laws.s] = False
        f, b = here.f[:, :equal], here.b[:, is_rest]
        size = np.maximum(_largest(self._q), 1.0)
        limits = (
            4 * (np.abs(there.f[:, :equal] - f) + 1e-13 * size),
            4 * np.abs(there.b[:, is_rest] - b) + 1e-12,
            4 * np.abs(there.x - here.x) + 1e-12 * np.abs(here.x) + 1e-15,
        )
        rest = [name for name, own in zip(laws.rows, is_rest, strict=True) if own]
        labels = [*laws.holonomic[:equal], *(f"rate of {name}" for name in rest), *names.x]
        return self._judge(POSITIONS, labels, (f, b, here.x - x), limits)

    def equilibrium(self, names: table_input.TableNames) -> Check:
        """The forces along every coordinate."""
        limit = doubles.ZERO * self._parts + 4 * np.abs(self._moved_total - self._total)
        limit = limit + doubles.ROOT * self._driven * (self._parts > 0) + 1e-300
        return self._judge(EQUILIBRIUM, names.q, (self._total,), (limit,))

    def reactions(self, R_q: Array, R_x: Array, names: table_input.TableNames) -> Check:
        """R of coordinates and of dependent particles."""
        pull, F, inertial = self._here.pull, self._on_dependent(self._here), self._inertial
        beside = 4 * np.abs(self._on_dependent(self._there) - F) + doubles.ZERO * _largest(F)
        limits = (
            4 * np.abs(self._there.pull - pull) + doubles.ZERO * _largest(pull) + 1e-300,
            beside + doubles.ROOT * np.abs(inertial) + 1e-300,
        )
        return self._judge(REACTIONS, [*names.R_q, *names.R_x], (pull - R_q, inertial - F - R_x), limits)

    def contacts(self) -> Check:
        """Contacts push, and only where they touch."""
        laws = self._laws
        first = laws.s - len(laws.contacts)
        g, lam = self._here.f[:, first:], self._lam[:, first : laws.s]
        off = 4 * np.abs(self._there.f[:, first:] - g) + 1e-12
        push = doubles.ZERO * _largest(self._lam) + 0 * lam + 1e-300
        residuals = np.minimum(g, 0), np.minimum(lam, 0), np.minimum(np.abs(g), np.abs(lam))
        labels = [f"{word} {name}" for word in ("gap of", "force of", "either of") for name in laws.contacts]
        return self._judge(SIGNORINI, labels, residuals, (off, push, off))

    def _judge(
        self, law: CheckedLaw, names: Sequence[str], residuals: Sequence[Array], limits: Sequence[Array]
    ) -> Check:
        return judge(
            law, names, self._rows, np.concatenate(residuals, axis=1), np.concatenate(limits, axis=1)
        )


def _largest(y: Array) -> Array:
    """The largest entry of each row, (T, 1)."""
    return np.asarray(np.abs(y).max(axis=1, initial=0.0, keepdims=True))
