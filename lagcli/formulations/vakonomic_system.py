"""Lagrange's equations of L + sum_i mu_i (A_i v + b_i) as a system that is integrated like any other.

With J the holonomic rows and A, b the differential ones,

    M a + A^T mu' = h + G + J^T lambda,    G = d(mu . (A v + b))/dq - (dA/dt)^T mu
    J a = gamma,  A a = gamma                (the rows, differentiated: the index is reduced)

is (D.24) with the further force G, in which -mu' takes the place of lambda of the differential rows. Each mu_i is the
rate of a further coordinate sigma_i, which nothing else reads: L + sum_i sigma_i' (A_i v + b_i) is an ordinary
Lagrangian, sigma_i is cyclic in it, and its momentum A_i v + b_i stays zero. So mu is carried along with the
velocities, and rows, projections and steps are those of any run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled import selection
from lagcli.equations import energy, rows, system
from lagcli.equations.environment import Environment
from lagcli.equations.rows import ConstraintRows
from lagcli.errors import diagnostics
from lagcli.expression import tree
from lagcli.linear import decompositions
from lagcli.model import family
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction

# No name of a file has blanks: the further coordinates clash with none.
FURTHER = "carriers of mu"
# Multiplications of one factorization of B M^-1 B^T that are written out.
MOST_OPERATIONS = 3e5
# The curl of a force is looked for at this many points, and how far from the start, in parts of its size.
SAMPLES, WIDTH = 12, 0.3


class TooLargeError(ValueError):
    """The rows are too many and too entangled for equations that are written out."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class VakonomicStart:
    """t, q and v (n,) of a consistent start, mu (C - s,) of the differential rows, and the independent rows there."""

    t: float
    q: Floats
    v: Floats
    mu: Floats
    independent: tuple[int, ...]


def column(row: str) -> str:
    """The name of the column of mu of a row."""
    return f"mu.{row}"


def model(built: system.System, start: VakonomicStart) -> tuple[nouns.Model, tuple[str, ...]]:
    """The model with a further coordinate for each differential row, and the outputs and events that are left out."""
    declared = system.started_at(built.model, start.q, start.v)
    names = tuple(column(row.name) for row in built.rows.rows[built.holonomic_count :])
    numbers = np.arange(len(names), dtype=np.int64)
    members = family.Family(FURTHER, names, tuple((i,) for i in numbers.tolist()), {"i": numbers})
    where = built.rows.rows[-1].location
    carriers = nouns.Coordinate(members, np.zeros(len(names)), start.mu, where)
    # Differential rows have no lambda, and the whole reaction of a Cartesian particle is no output here.
    without = {law.members.base for law in declared.differential}
    unavailable: dict[str, None] = {}

    def has_value(name: str, expression: nouns.Expression) -> bool:
        is_lost = any(read in unavailable for read in tree.names(expression.tree))
        for call in tree.walk(expression.tree):
            if isinstance(call, tree.Call) and call.function in ("multiplier", "reaction"):
                is_lost |= call.function == "reaction" and len(call.arguments) == 1
                is_lost |= not without.isdisjoint(tree.names(call.arguments[-1]))
        if is_lost:
            unavailable[name] = None
        return not is_lost

    outputs = tuple(each for each in declared.outputs if has_value(each.members.base, each.expression))
    events = tuple(each for each in declared.events if has_value(each.name, each.when))
    extended = dataclasses.replace(
        declared,
        fingerprint=f"{declared.fingerprint} vakonomic",
        coordinates=(*declared.coordinates, carriers),
        outputs=outputs,
        events=events,
        simulation=dataclasses.replace(declared.simulation, start=start.t, assemble=False, keep=()),
        warnings=(),
    )
    return extended, tuple(unavailable)


def build(built: system.System, extended: nouns.Model, start: VakonomicStart) -> system.System:
    """The system of a model that `model` made of the one of `built`. Raises `TooLargeError`."""
    s, symbols, n = built.holonomic_count, built.symbols, built.symbols.q.numel()
    count, chosen = len(built.rows.rows) - s, list(start.independent)
    assert count > 0
    # B_i M^-1 B_i^T of the differential rows at the start: an inertia that measures mu as the speeds it changes. It
    # weighs the errors of mu against those of velocities, and cancels from the equations.
    A = built.rows.B[s:, :]
    sizes = ca.sum2(A.T.T * selection.solver(built.dynamics.M)(A.T).T)
    at = SizedFunction("sizes", [symbols.t, symbols.q, built.p], [ca.densify(sizes)])
    found = np.array(at(start.t, start.q, system.values(built))).ravel()
    inertia = ca.DM(np.where(np.isfinite(found) & (found > 0), found, 1.0))
    further: list[ca.SX] = []

    def restated(
        env: Environment, constraints: ConstraintRows, dynamics: energy.Dynamics
    ) -> tuple[ConstraintRows, energy.Dynamics]:
        # G (n + k,), zero at the further coordinates; the rows that follow from others have no part in it.
        own = np.zeros(count)
        own[[i - s for i in chosen if i >= s]] = 1.0
        mu = env.v[n:] * ca.DM(own)
        A, b = constraints.B[s:, :], constraints.b[s:]
        momentum = A.T @ mu
        # d/dt of A^T mu with mu fixed: mu is a part of v, which is fixed here too.
        turned = ca.jtimes(momentum, env.q, env.v) + ca.jacobian(momentum, env.t)
        G = ca.densify(ca.gradient(ca.dot(mu, A @ env.v + b), env.q) - turned)
        further.append(G)
        # S = B M^-1 B^T of the independent rows, and mu' = -lambda of the differential ones
        B, gamma = constraints.B[chosen, :n], constraints.gamma[chosen, :]
        solve = selection.solver(dynamics.M[:n, :n])
        S = B @ solve(B.T)
        lam = selection.solver(S)(ca.densify(gamma - B @ solve((dynamics.h + G)[:n])))
        mu_rate = ca.SX.zeros(count)
        for index, row in enumerate(chosen):
            if row >= s:
                mu_rate[row - s] = -lam[index]
        if selection.operations(S) > MOST_OPERATIONS:
            raise TooLargeError
        M = ca.sparsify(dynamics.M + ca.diagcat(ca.SX(n, n), ca.diag(ca.SX(inertia))))
        h = ca.densify(dynamics.h + G + ca.vertcat(ca.SX.zeros(n), inertia * mu_rate))
        power = dynamics.power + ca.dot(env.v[:n], G[:n])
        return constraints, dataclasses.replace(dynamics, M=M, h=h, power=power)

    whole = system.build(extended, restated)
    # R = m a - F, the force of both lambda and mu, in place of the part of lambda alone
    Q_R, R, first, offset = ca.densify(whole.Q_R + further[0]), ca.SX(whole.R), 0, 0
    for particle in whole.model.particles:
        size = 3 * particle.members.count
        if not particle.is_dependent:
            R[first : first + size] = Q_R[offset : offset + size]
            offset += size
        first += size
    return dataclasses.replace(whole, bodies=built.bodies, Q_R=Q_R, R=R)


def effective(built: system.System, start: VakonomicStart) -> Floats:
    """mu of the independent differential rows with the same mu . A at the start, and zero for the others (k,): what of
    a row follows from holonomic ones changes their lambda and nothing else."""
    s, count = built.holonomic_count, len(built.rows.rows)
    is_independent = np.isin(np.arange(s, count), start.independent)
    if not start.mu[~is_independent].any():
        return np.where(is_independent, start.mu, 0.0)
    symbols = built.symbols
    at = SizedFunction("rows", [symbols.t, symbols.q, built.p], [ca.densify(built.rows.B)])
    B = np.array(at(start.t, start.q, system.values(built))).reshape(count, -1)
    shares = decompositions.least_squares(B[list(start.independent)].T, B[s:].T @ start.mu)
    found = np.zeros(count)
    found[list(start.independent)] = shares
    return found[s:]


def table(
    columns: Sequence[str], declared: nouns.Model, differential: Sequence[rows.Row]
) -> tuple[list[str], list[int]]:
    """The columns of the table of the motion and their indices in that of the run with further coordinates."""
    names = [row.name for row in differential]
    own = {f"lambda.{name}" for name in names}
    own |= {part for name in names for part in (column(name), f"rate({column(name)})", f"R.{column(name)}")}
    indices = {name: i for i, name in enumerate(columns)}
    mu = [indices[f"rate({column(name)})"] for name in names]
    independent = [i for i, name in enumerate(columns) if name not in own]
    first = next(
        (k for k, i in enumerate(independent) if columns[i].startswith("R.") or columns[i] == "energy"),
        len(independent),
    )
    found = [*independent[:first], *mu, *independent[first:]]
    at = {i: column(name) for i, name in zip(mu, names, strict=True)}
    return [at.get(i, columns[i]) for i in found], found


# The forces that an action can hold: those with a potential, declared as one or not


def require_action(built: system.System, t: float, q: Floats, p: Floats) -> None:
    """Raise `diagnostics.ModelError`, located, for one-sided rows and for a force without a potential; one that depends
    on no velocity and has no curl is a gradient, and is taken. t, q (n,), p: the start."""
    found = [
        diagnostics.Diagnostic(
            "not-of-an-action",
            f"the one-sided constraint `{law.members.base}` has no place in an action that is stationary: the paths"
            " beside the motion would have to be on one side of it",
            law.equation.location,
            "take it out, or write the rows that are closed as equations",
        )
        for law in built.model.inequality
        if law.members.count
    ]
    if found:
        raise diagnostics.ModelError(found)
    symbols = built.symbols
    is_fast, has_curl = ca.depends_on(built.dynamics.driving, symbols.v), False
    slope = ca.jacobian(built.dynamics.driving, symbols.q)
    if not is_fast and slope.nnz():
        # dQ_i/dq_j and dQ_j/dq_i near the start
        slopes = SizedFunction("slopes", [symbols.t, symbols.q, built.p], [ca.densify(slope)])
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        draws = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, q.size))
        values = (np.array(slopes(t + 0.1 * k, q + WIDTH * size * draw, p)) for k, draw in enumerate(draws))
        has_curl = any(np.isfinite(each).all() and not decompositions.is_symmetric(each) for each in values)
    if not is_fast and not has_curl:
        return
    # The texts of the forces that act and have no declared potential: the first of them is named.
    texts: list[nouns.Expression] = []
    for force in built.model.forces:
        if isinstance(force, nouns.Potential) or not force.action.targets.size:
            continue
        if isinstance(force, nouns.GeneralizedForce):
            texts.append(force.force)
        elif not force.constant:
            texts.append(force.force.parts[0])
    together = len(texts) > 1
    reason = f"{'they have' if together else 'it has'} a curl: the work it does depends on the path"
    if is_fast:
        reason = "they depend on velocities" if together else "it depends on velocities"
    subject = "the forces without a declared potential have" if together else "this force has"
    message = f"{subject} no potential, and so no place in an action: {reason}"
    hint = "vakonomic motion is that of a Lagrangian; leave the force out, or write its potential"
    raise diagnostics.error("not-of-an-action", message, texts[0].location, hint)
