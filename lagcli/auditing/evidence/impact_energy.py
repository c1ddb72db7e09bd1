"""The energy at an impact, of rows and places that may move with t.

With H = q' . p - L of the whole system, quadratic in q', the jump of p at one place gives exactly

    H(+) - H(-) = (p(+) - p(-)) . (q'(+) + q'(-))/2,    p(+) - p(-) = sum_i impulse_i B_i,    B_i . q' = df_i/dt - b_i

so that H(+) - H(-) + sum_i impulse_i b_i = 1/2 sum_i impulse_i (df_i/dt(+) + df_i/dt(-)): the work of a row that moves
is -impulse_i b_i, b_i its rate where only t moves. Dependent particles x(q, t) have u = dx/dq . q' + dx/dt, and

    T + V = H + sum_k m_k u_k . dx_k/dt

without what is in `lagrangian`: places that move with t do the work m_k (u_k(+) - u_k(-)) . dx_k/dt on T. The mass
matrix may depend on q and t; it is the same on both sides.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import LawValues
from lagcli.auditing.evidence.table_input import Record
from lagcli.auditing.evidence.tolerances import Evidence


def moved(e: Evidence) -> Record:
    """The record at the states that are each moved by its tolerance."""
    return dataclasses.replace(e.record, q=e.moved[0], v=e.moved[1], u=e.moved_values.u)


def energy_of_motion(e: Evidence, r: Record, values: LawValues) -> Array:
    """T (E,) of the particles with q' . dL/dq' - L of the `lagrangian`: the energy less the declared potentials."""
    T = (e.masses * r.v**2).sum(axis=1) / 2 + (e.masses_x * r.u**2).sum(axis=1) / 2
    own = (r.v * values.L_v).sum(axis=1) + ((r.u - values.x_t) * values.L_u).sum(axis=1)
    return np.asarray(T + own - values.L)


def hamiltonian(e: Evidence) -> tuple[Array, Array]:
    """H - V (E,) at the states of a record, and by how much it may be off."""

    def at(r: Record, values: LawValues) -> Array:
        return np.asarray(energy_of_motion(e, r, values) - (e.masses_x * r.u * values.x_t).sum(axis=1))

    # The recorded u is what is judged: the limit is made of that of the model alone.
    own = at(dataclasses.replace(e.record, u=e.values.u), e.values)
    return at(e.record, e.values), e.spread(own[:, None], at(moved(e), e.moved_values)[:, None])[:, 0]


def is_quadratic(before: Evidence, after: Evidence) -> Array:
    """True where momenta are linear in the rates between the states before and after, (E,).

    Those of the particles always are; those of a `lagrangian` at the mean rates are compared with the mean momenta.
    """
    laws, r = before.laws, before.record
    if laws.model.lagrangian is None:
        return np.ones(len(r.t), dtype=bool)

    def momenta(q: Array, v: Array, values: LawValues) -> Array:
        return np.asarray(values.L_v + laws.pushed(r.t, q, v, values.L_u))

    def known(e: Evidence) -> tuple[Array, Array]:
        p = momenta(e.record.q, e.record.v, e.values)
        return p, e.spread(p, momenta(*e.moved, e.moved_values)) + e.tolerance.atol

    (one, off), (other, off_other) = known(before), known(after)
    mean = (r.v + after.record.v) / 2
    middle = momenta(r.q, mean, laws.values(r.t, r.q, mean, r.lam))
    return np.asarray((np.abs(middle - (one + other) / 2) <= off + off_other).all(axis=1))
