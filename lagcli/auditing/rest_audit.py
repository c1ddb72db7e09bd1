"""A second opinion on points of rest: each row of their table against the laws of the model.

f = 0, b = 0,   F + B^T lambda = 0 with the inertial terms of positions that move with t,   R,   0 <= lambda, g >= 0
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
# The rounding of numbers that a table holds, and of forces, as parts of the terms; the step of differences in t, as a
# part of the length of a run, with what they can tell.
ROUNDED, BALANCED, STEP, DIFFERENCED = 1e-11, 1e-9, 1e-3, 1e-6


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
    names, column = table_input.names(laws), {name: i for i, name in enumerate(columns)}
    if not len(rows):
        raise table_input.TableError("the table has no rows")
    q, lam, R_q, R_x, x = (
        rows[:, [column[name] for name in part]]
        for part in (names.q, names.lam, names.R_q, names.R_x, names.x)
    )
    start = model.simulation.start
    with np.errstate(all="ignore"):
        found = _RestValues(laws, np.full(len(q), start), q, lam)
        t = np.arange(len(q), dtype=float)
        checks = [
            found.positions(t, x, names),
            found.equilibrium(t, names),
            found.reactions(t, R_q, R_x, names),
        ]
        if laws.contacts:
            checks.append(found.contacts(t))
    notes = ("the rows are points of rest; in the checks t is the number of a row",)
    return Audit(
        model.title,
        model.path,
        len(q),
        0.0,
        float(len(q) - 1),
        0.0,
        0.0,
        tuple(checks),
        (),
        notes,
        (),
        tuple(unread),
        of_rest=True,
    )


def _laws(model: nouns.Model) -> ModelLaws:
    return ModelLaws(model, closed=range(len(model.contact_names)))


class _RestValues:
    """The laws at points of rest, and at points beside them, which tell what rounding does."""

    def __init__(self, laws: ModelLaws, t: Array, q: Array, lam: Array) -> None:
        self._laws, self._t, self._q, self._lam = laws, t, q, lam
        self._still = np.zeros(q.shape)
        self._here = laws.values(t, q, self._still, lam)
        random = np.random.default_rng(0)
        sizes = np.abs(q).max(axis=1, initial=0.0, keepdims=True) + 1e-3
        self._beside = q + ROUNDED * np.maximum(np.abs(q), 1e-3 * sizes) * random.choice([-1.0, 1.0], q.shape)
        self._there = laws.values(t, self._beside, self._still, lam)
        self._later = STEP * (laws.model.simulation.duration or 1.0)

    def positions(self, t: Array, x: Array, names: table_input.TableNames) -> Check:
        """f = 0 and b = 0, and positions of dependent particles."""
        laws, here, there = self._laws, self._here, self._there
        count = len(laws.contacts)
        equal = laws.s - count
        moving = np.delete(here.b, range(equal, laws.s), axis=1)
        rest = [name for i, name in enumerate(laws.rows) if not equal <= i < laws.s]
        f, b_limit = here.f[:, :equal], np.abs(np.delete(there.b, range(equal, laws.s), axis=1) - moving)
        f_limit = np.abs(there.f[:, :equal] - f) + 1e-13 * np.abs(self._q).max(
            axis=1, initial=1.0, keepdims=True
        )
        residual = np.concatenate([f, moving, here.x - x], axis=1)
        limit = np.concatenate(
            [4 * f_limit, 4 * b_limit + 1e-12, 4 * np.abs(there.x - here.x) + 1e-12 * np.abs(here.x) + 1e-15],
            axis=1,
        )
        labels = [*laws.holonomic[:equal], *(f"rate of {name}" for name in rest), *names.x]
        return judge(POSITIONS, labels, t, residual, limit)

    def equilibrium(self, t: Array, names: table_input.TableNames) -> Check:
        """The forces along every coordinate."""
        total, parts = self._total(self._q, self._here)
        moved, _ = self._total(self._beside, self._there)
        limit = BALANCED * parts + 4 * np.abs(moved - total) + DIFFERENCED * self._driven * (parts > 0)
        return judge(EQUILIBRIUM, names.q, t, total, limit + 1e-300)

    def reactions(self, t: Array, R_q: Array, R_x: Array, names: table_input.TableNames) -> Check:
        """R of coordinates and of dependent particles."""
        here = self._here
        own = here.pull - R_q
        size = np.abs(here.pull).max(axis=1, initial=0.0, keepdims=True)
        F = self._onto(here.F, self._laws.index.dependent) - here.V_x
        other = self._inertial(self._q) - F - R_x
        beside = self._onto(self._there.F, self._laws.index.dependent) - self._there.V_x
        largest = np.abs(F).max(axis=1, initial=0.0, keepdims=True)
        residual = np.concatenate([own, other], axis=1)
        limits = [
            4 * np.abs(self._there.pull - here.pull) + BALANCED * size + 1e-300,
            4 * np.abs(beside - F)
            + BALANCED * largest
            + DIFFERENCED * np.abs(self._inertial(self._q))
            + 1e-300,
        ]
        shape = [np.broadcast_to(limit, part.shape) for limit, part in zip(limits, (own, other), strict=True)]
        return judge(REACTIONS, [*names.R_q, *names.R_x], t, residual, np.concatenate(shape, axis=1))

    def contacts(self, t: Array) -> Check:
        """Contacts push, and only where they touch."""
        laws = self._laws
        first = laws.s - len(laws.contacts)
        g, lam = self._here.f[:, first:], self._lam[:, first : laws.s]
        off = 4 * np.abs(self._there.f[:, first:] - g) + 1e-12
        push = np.abs(self._lam).max(axis=1, initial=0.0, keepdims=True)
        residual = np.concatenate(
            [np.minimum(g, 0), np.minimum(lam, 0), np.minimum(np.abs(g), np.abs(lam))], axis=1
        )
        limit = np.concatenate([off, BALANCED * push + 0 * lam + 1e-300, np.maximum(off, 1e-12)], axis=1)
        labels = [f"{word} {name}" for word in ("gap of", "force of", "either of") for name in laws.contacts]
        return judge(SIGNORINI, labels, t, residual, limit)

    def _total(self, q: Array, values: LawValues) -> tuple[Array, Array]:
        """F + B^T lambda (T, n), and the sum of the sizes of its terms, a row at a time."""
        index, laws = self._laws.index, self._laws
        direct = np.zeros(q.shape)
        own = self._onto(values.F, index.cartesian)
        direct[:, : own.shape[1]] = own
        terms = [direct, values.Q, -values.V_q, values.L_q, values.pull]
        if index.dependent.size:
            onto = self._onto(values.F, index.dependent) - values.V_x + values.L_x - self._inertial(q)
            terms.append(laws.pushed(self._t, q, self._still, onto))
        terms.append(-self._explicit(q))
        sizes = sum(
            (np.abs(term).max(axis=1, initial=0.0, keepdims=True) for term in terms), np.zeros((len(q), 1))
        )
        return np.asarray(sum(terms, np.zeros(q.shape))), sizes + np.zeros(q.shape)

    @property
    def _driven(self) -> Array:
        """The size of what moves with t alone, (T, 1)."""
        moving = np.abs(self._inertial(self._q)).max(axis=1, initial=0.0, keepdims=True)
        return np.asarray(moving + np.abs(self._explicit(self._q)).max(axis=1, initial=0.0, keepdims=True))

    def _inertial(self, q: Array) -> Array:
        """m d2x/dt2 of the dependent particles at rest, (T, 3 Nd)."""
        index = self._laws.index
        masses = np.repeat(index.masses[index.dependent], 3)
        return np.asarray(masses * self._rate(q, "u"))

    def _explicit(self, q: Array) -> Array:
        """The explicit rate of dL/dv of the `lagrangian`, (T, n)."""
        return self._rate(q, "L_v")

    def _rate(self, q: Array, name: str) -> Array:
        """The derivative by t of a value at fixed q, by differences of order four."""
        h = self._later
        at = [
            np.asarray(getattr(self._laws.values(self._t + k * h, q, self._still, self._lam), name))
            for k in (-2, -1, 1, 2)
        ]
        return np.asarray((at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * h))

    @staticmethod
    def _onto(F: Array, numbers: Array) -> Array:
        """Forces (T, N, 3) on some particles, (T, 3 of each)."""
        return F[:, numbers].reshape(len(F), -1)
