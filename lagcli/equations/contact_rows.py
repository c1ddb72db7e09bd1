"""The rows of one-sided constraints, g(r, q, t) >= 0, in their order, each differentiated twice."""

from __future__ import annotations

import dataclasses

import casadi as ca

from lagcli.equations import rows
from lagcli.equations.environment import Environment
from lagcli.model import model as nouns


@dataclasses.dataclass(frozen=True, slots=True)
class ContactRows:
    """g (K,) with its gradient G (K, n), dg/dt = G v + g_t and d2g/dt2 = G a - gamma; g_t, gamma (K,)."""

    rows: tuple[rows.Row, ...]
    g: ca.SX
    G: ca.SX
    g_t: ca.SX
    gamma: ca.SX

    @property
    def count(self) -> int:
        """K."""
        return len(self.rows)


def lay_down(model: nouns.Model, environment: Environment) -> ContactRows:
    """The rows of all inequalities. Raises `diagnostics.ModelError` for one without coordinates."""
    found = rows.of_inequalities(model, environment)
    return ContactRows(found.rows, found.f, found.B, found.b, found.gamma)


def with_equalities(laid: rows.ConstraintRows, contacts: ContactRows) -> rows.ConstraintRows:
    """All rows in the order of the multipliers: the equality rows, then the contacts. f is that of the former."""
    if not contacts.count:
        return laid
    return rows.ConstraintRows(
        (*laid.rows, *contacts.rows),
        laid.f,
        ca.sparsify(ca.vertcat(laid.B, contacts.G)),
        ca.vertcat(laid.b, contacts.g_t),
        ca.vertcat(laid.gamma, contacts.gamma),
    )
