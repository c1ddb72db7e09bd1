"""T, V, the Lagrangian, the inertia matrix M and the generalized force h (D.10, D.30, D.34-D.39)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import casadi as ca
import numpy as np

from lagcli.arrays import Integers
from lagcli.equations.environment import Environment, Triple, Value, column, interleaved, scattered, taken
from lagcli.frozen import frozen
from lagcli.model import model as nouns


@frozen
class Dynamics:
    """The terms of M a = h + B^T lambda, with the energies that certify it.

    M (n, n); h (n): all forces and inertial terms but the constraint's. T and V of particles and declared
    potentials, `energy` = T + V + qd . dL/dqd - L of the `lagrangian`; `jacobi` = v . dL/dv - L of the whole
    system, whose rate is `power` - lambda . b: the power of the forces without potential and of explicit time;
    `rest` is its part without velocities, V - L(q, v = 0, t) of what is not Cartesian.
    driving (n): the part of Q_j (D.30) that has no potential; the whole of Q_j is driving - dV/dq.
    applied: F_k on the dependent particles (the sum of forces and potentials declared on particles), x of all of
    them, then y, then z.
    carriers: what acts on generalized coordinates directly, by name, with the rows of q it touches.
    """

    M: ca.SX
    h: ca.SX
    kinetic: ca.SX
    potential: ca.SX
    energy: ca.SX
    jacobi: ca.SX
    rest: ca.SX
    power: ca.SX
    driving: ca.SX
    applied: ca.SX
    carriers: Mapping[str, frozenset[int]]


def dynamics(model: nouns.Model, environment: Environment) -> Dynamics:
    """The dynamics of a model without its constraints."""
    s = environment.symbols
    V = _potential(model.forces, environment)
    T_cartesian = T_dependent = ca.SX(0)
    if environment.cartesian.size:
        square = sum(part * part for part in environment.velocity(environment.cartesian))
        T_cartesian = ca.dot(taken(environment.masses, environment.cartesian) / 2, square)
    if environment.dependent.size:
        square = sum(part * part for part in environment.velocity(environment.dependent))
        T_dependent = ca.dot(taken(environment.masses, environment.dependent) / 2, square)
    extra = environment.scalar(model.lagrangian) if model.lagrangian is not None else ca.SX(0)
    # L = T + extra - V. Its Cartesian part is linear algebra known beforehand; the rest goes through AD.
    general = T_dependent + extra
    momentum = ca.gradient(general, s.v)
    # The masses on the diagonal of M, structurally zero at generalized coordinates.
    own = taken(environment.masses, environment.cartesian)
    generalized = s.q.numel() - 3 * environment.cartesian.size
    diagonal = ca.vertcat(interleaved([own, own, own], environment.cartesian.size), ca.SX(generalized, 1))
    M = ca.diag(diagonal) + ca.jacobian(momentum, s.v)
    Q = _generalized(model.forces, environment)
    inertial = ca.jtimes(momentum, s.q, s.v) + ca.jacobian(momentum, s.t)
    h = Q + ca.gradient(general - V, s.q) - inertial
    extra_energy = ca.dot(s.v, ca.gradient(extra, s.v)) - extra
    explicit_time = ca.jacobian(general - V, s.t)
    applied, carriers = ca.SX(0, 1), dict[str, frozenset[int]]()
    if environment.dependent.size:
        applied, carriers = _of_free_particles(model, environment)
    return Dynamics(
        M=ca.sparsify(M),
        h=ca.densify(h),
        kinetic=T_cartesian + T_dependent,
        potential=V,
        energy=T_cartesian + T_dependent + V + extra_energy,
        rest=V - ca.substitute(general, s.v, ca.SX.zeros(s.v.shape)),
        jacobi=T_cartesian + V + ca.dot(s.v, momentum) - general,
        power=ca.dot(Q, s.v) - explicit_time,
        driving=Q,
        applied=applied,
        carriers=carriers,
    )


def generalized(force: nouns.Force, environment: Environment) -> ca.SX:
    """Q_j (n,) of one of the forces that a model declares (D.30)."""
    V = _potential((force,), environment)
    return ca.densify(_generalized((force,), environment) - ca.gradient(V, environment.symbols.q))


def _on_particles(
    forces: Sequence[nouns.Force], environment: Environment, constant: bool
) -> Iterator[tuple[Integers, Triple]]:
    """Particles (P,) with the forces declared on them, those that count as potentials or the others, pair by pair."""
    for force in forces:
        if not isinstance(force, nouns.ParticleForce) or force.constant != constant:
            continue
        targets = force.action.targets
        if targets.size == 0:
            continue
        own: dict[str, Value] = {
            "m": taken(environment.masses, targets),
            "r": environment.position(targets),
            "v": environment.velocity(targets),
        }
        algebra = environment.algebra(force.action.variables(force.members), own)
        x, y, z = (column(part, targets.size) for part in environment.vector(force.force, algebra))
        yield targets, (x, y, z)


def _potential(forces: Sequence[nouns.Force], environment: Environment) -> ca.SX:
    """V: declared potentials, and -F.r of every constant force."""
    V = ca.SX(0)
    for force in forces:
        if isinstance(force, nouns.Potential) and force.members.count:
            value = environment.scalar(force.expression, environment.algebra(force.members.variables))
            V += ca.sum1(column(value, force.members.count))
    for targets, F in _on_particles(forces, environment, constant=True):
        r = environment.position(targets)
        V -= sum(ca.dot(a, x) for a, x in zip(F, r, strict=True))
    return V


def _generalized(forces: Sequence[nouns.Force], environment: Environment) -> ca.SX:
    """Q_j = sum_k F_k . dr_k/dq_j (D.30) of all forces without a potential."""
    n = environment.symbols.q.numel()
    Q = ca.SX.zeros(n)
    for targets, F in _on_particles(forces, environment, constant=False):
        dependent = environment.is_dependent[targets]
        if dependent.any():
            pairs = np.flatnonzero(dependent)
            r = ca.vertcat(*environment.position(targets[pairs]))
            F_pairs = ca.vertcat(*(taken(part, pairs) for part in F))
            Q += ca.jtimes(r, environment.symbols.q, F_pairs, True)
        pairs = np.flatnonzero(~dependent)
        rows = environment.rows_of(targets[pairs])
        for axis in range(3):
            Q += scattered(taken(F[axis], pairs), rows + axis, n)
    for force in forces:
        if isinstance(force, nouns.GeneralizedForce) and force.action.targets.size:
            targets = force.action.targets
            algebra = environment.algebra(force.action.variables(force.members))
            value = column(environment.scalar(force.force, algebra), targets.size)
            Q += scattered(value, environment.first_generalized + targets, n)
    return Q


def _of_free_particles(model: nouns.Model, true: Environment) -> tuple[ca.SX, dict[str, frozenset[int]]]:
    """`Dynamics.applied` and `carriers`, where the dependent particles are taken as free."""
    count, s = true.dependent.size, true.symbols
    environment, r, v = true.freed()
    index = np.cumsum(environment.is_dependent) - 1
    F_sum = ca.SX.zeros(3 * count)
    for targets, F in _on_particles(model.forces, environment, constant=False):
        pairs = np.flatnonzero(environment.is_dependent[targets])
        for axis in range(3):
            rows = axis * count + index[targets[pairs]]
            F_sum += scattered(taken(F[axis], pairs), rows, 3 * count)
    applied = true.bound(F_sum - ca.gradient(_potential(model.forces, environment), r), r, v)
    carriers: dict[str, frozenset[int]] = {}
    nothing = frozenset[int]()
    for force in model.forces:
        if isinstance(force, nouns.GeneralizedForce):
            name = f"the generalized force `{force.members.base}`"
            acted = environment.first_generalized + force.action.targets
            carriers[name] = carriers.get(name, nothing) | frozenset(acted.tolist())
        elif isinstance(force, nouns.Potential) and force.members.count:
            name = f"the potential `{force.members.base}`"
            value = environment.scalar(force.expression, environment.algebra(force.members.variables))
            carriers[name] = carriers.get(name, nothing) | _rows_of(ca.sum1(value), s.q)
    if model.lagrangian is not None:
        extra = environment.scalar(model.lagrangian)
        carriers["the `lagrangian`"] = _rows_of(extra, s.q) | _rows_of(extra, s.v)
    return applied, {name: touched for name, touched in carriers.items() if touched}


def _rows_of(value: ca.SX, vector: ca.SX) -> frozenset[int]:
    """The entries of a vector of symbols that an expression depends on."""
    return frozenset(ca.jacobian(value, vector).sparsity().get_triplet()[1])
