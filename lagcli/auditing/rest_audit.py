"""A second opinion on points of rest: each row of their table against the laws of the model.

f = 0, b = 0,   F + B^T lambda = 0 with the inertial terms of positions that move with t,   R,   0 <= lambda, g >= 0
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli import doubles
from lagcli.auditing.checks.audit_report import Audit, Law, judge_parts
from lagcli.auditing.evidence import table_input
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import LawValues, ModelLaws
from lagcli.auditing.evidence.tolerances import RESOLVED
from lagcli.model import model as nouns

POSITIONS = Law("places", "D.2", "f(r, q, t) = 0, and b = 0 of rows at rest")
EQUILIBRIUM = Law("equilibrium", "D.25", "F + sum lambda_i B_i = 0 with zero velocities and accelerations")
REACTIONS = Law("reactions", "D.22", "R = sum lambda_i B_i, and m a - F of dependent particles")
SIGNORINI = Law("signorini", "", "g >= 0, lambda >= 0, lambda g = 0")
ROUNDED = 1e-11  # the rounding of numbers that a table holds, as a part of them


def is_table(columns: Sequence[str]) -> bool:
    """True for a table of points of rest."""
    return "t" not in columns and {"potential", "residual", "unique_multipliers"} <= set(columns)


def wanted(model: nouns.Model, columns: Sequence[str]) -> tuple[str, ...]:
    """The columns that are read. Raises `table_input.TableError` with what is missing."""
    names = table_input.names(ModelLaws(model))
    needed = (*names.q, *names.lam, *names.R)
    missing = [name for name in needed if name not in set(columns)]
    if missing:
        raise table_input.TableError(f"the table of points lacks the column `{missing[0]}`")
    return needed


def audit(model: nouns.Model, columns: Sequence[str], rows: Array, unread: Sequence[str] = ()) -> Audit:
    """The audit of points (T, columns). Raises `table_input.TableError`."""
    laws = ModelLaws(model)
    wanted(model, columns)
    if not len(rows):
        raise table_input.TableError("the table has no rows")
    names, column, n = table_input.names(laws), {name: i for i, name in enumerate(columns)}, laws.index.n
    whole, lam, R = (rows[:, [column[name] for name in part]] for part in (names.q, names.lam, names.R))
    q, x, numbers = whole[:, :n], whole[:, n:], np.arange(len(whole), dtype=float)
    with np.errstate(all="ignore"):
        # What rounding does is told by points beside these
        signs = np.random.default_rng(0).choice([-1.0, 1.0], q.shape)
        here, moving, total, size = _point(laws, q, lam)
        beside = q + ROUNDED * np.maximum(np.abs(q), 1e-3 * (_largest(q) + 1e-3)) * signs
        there, _, total_there, _ = _point(laws, beside, lam)
        contacts = laws.of_contacts
        first, rest = contacts.start, np.delete(np.arange(laws.C), contacts)
        f, b, g, push = here.f[:, :first], here.b[:, rest], here.f[:, contacts], lam[:, contacts]
        F_x, F_x_there = (values.force()[:, n:] for values in (here, there))
        driven = _largest(moving[:, n:]) + _largest(moving[:, :n])
        of_balance = doubles.ZERO * size + 4 * np.abs(total_there - total)
        of_F = 4 * np.abs(F_x_there - F_x) + doubles.ZERO * _largest(F_x)
        of_pull = 4 * np.abs(there.pull - here.pull) + doubles.ZERO * _largest(here.pull)
        off = 4 * np.abs(there.f[:, contacts] - g) + 1e-12
        checks = [
            judge_parts(
                POSITIONS,
                [*laws.holonomic[:first], *(f"rate of {laws.rows[i]}" for i in rest), *names.q[n:]],
                numbers,
                (f, 4 * (np.abs(there.f[:, :first] - f) + 1e-13 * np.maximum(_largest(q), 1.0))),
                (b, 4 * np.abs(there.b[:, rest] - b) + 1e-12),
                (here.x - x, 4 * np.abs(there.x - here.x) + 1e-12 * np.abs(here.x) + 1e-15),
            ),
            judge_parts(
                EQUILIBRIUM,
                names.q[:n],
                numbers,
                (total, of_balance + doubles.ROOT * driven * (size > 0) + 1e-300),
            ),
            judge_parts(
                REACTIONS,
                names.R,
                numbers,
                (here.pull - R[:, :n], of_pull + 1e-300),
                (moving[:, n:] - F_x - R[:, n:], of_F + doubles.ROOT * np.abs(moving[:, n:]) + 1e-300),
            ),
        ]
        if laws.contacts:  # they push, and only where they touch
            words = "gap of", "force of", "either of"
            labels = [f"{word} {name}" for word in words for name in laws.contacts]
            pulls = np.minimum(push, 0), doubles.ZERO * _largest(lam) + 0 * push + 1e-300
            either = np.minimum(np.abs(g), np.abs(push)), off
            checks.append(judge_parts(SIGNORINI, labels, numbers, (np.minimum(g, 0), off), pulls, either))
    return Audit(
        model.title,
        model.path,
        rows=len(q),
        start=0.0,
        end=float(len(q) - 1),
        rtol=0.0,
        atol=0.0,
        checks=tuple(checks),
        sentences=(),
        notes=("the rows are points of rest; in the checks t is the number of a row",),
        figures=(),
        unread=tuple(unread),
        of_rest=True,
    )


def _point(laws: ModelLaws, q: Array, lam: Array) -> tuple[LawValues, Array, Array, Array]:
    """The laws at points of rest q (T, n): their values; what the inertia of all that moves with t takes, (T, n + 3
    Nd); F + B^T lambda less that, (T, n), and the sum of the sizes of its terms at each row, (T, 1)."""
    n, t, still = laws.index.n, np.full(len(q), laws.model.simulation.start), np.zeros(q.shape)
    values = laws.values(t, q, still, lam)
    # What moves with t is differentiated by differences of order four.
    h, momenta = RESOLVED * (laws.model.simulation.duration or 1.0), []
    for k in (-2, -1, 1, 2):
        at = laws.values(t + k * h, q, still, lam)
        momenta.append(np.concatenate([at.L_v[:, :n], laws.index.masses_along[n:] * at.u], axis=1))
    y = momenta
    moving = (y[0] - 8 * y[1] + 8 * y[2] - y[3]) / (12 * h)
    carried = (values.F - values.V_q + values.L_q - moving)[:, n:]
    terms = [part[:, :n] for part in (values.F, -values.V_q, values.L_q, values.pull, -moving)]
    terms.append(laws.pushed(t, q, still, carried))
    return values, moving, np.asarray(sum(terms)), np.asarray(sum(map(_largest, terms)))


def _largest(y: Array) -> Array:
    """The largest entry of each row, (T, 1)."""
    return np.asarray(np.abs(y).max(axis=1, initial=0.0, keepdims=True))
