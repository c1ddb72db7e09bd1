"""The rows of one-sided constraints, g(r, q, t) >= 0, in their order, each differentiated twice."""

from __future__ import annotations

import casadi as ca
import numpy as np

from lagcli.equations import rows
from lagcli.equations.environment import Environment
from lagcli.frozen import frozen
from lagcli.model import model as nouns


@frozen
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


def with_equalities(laid: rows.ConstraintRows, contacts: ContactRows, lam: ca.SX) -> rows.ConstraintRows:
    """All rows in the order of the multipliers lam (C + K,): the equality rows, then the contacts that act.

    f is that of the former. The row of an open contact is 0: its gradient may have no value where it is open, as that
    of a distance between particles that pass each other at one place.
    """
    if not contacts.count:
        return laid
    G = contacts.G
    acting = lam[(np.asarray(G.sparsity().row(), dtype=np.int64) + len(laid.rows)).tolist()]
    G = ca.SX(G.sparsity(), ca.if_else(ca.vec(acting) == 0, 0, ca.vec(G.nz[:])))
    return rows.ConstraintRows(
        (*laid.rows, *contacts.rows),
        laid.f,
        ca.sparsify(ca.vertcat(laid.B, G)),
        ca.vertcat(laid.b, contacts.g_t),
        ca.vertcat(laid.gamma, contacts.gamma),
    )
