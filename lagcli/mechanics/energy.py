"""T, V, the Lagrangian, the inertia matrix M and the generalized force h (D.10, D.30, D.34-D.39)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import casadi as ca

from lagcli import model as nouns
from lagcli.mechanics.environment import Environment, FixedExponents, Symbols, Triple


@dataclasses.dataclass(frozen=True, slots=True)
class Dynamics:
    """What stands in M a = h + B^T lambda, with the energies that certify it.

    M (n, n); h (n): all forces and inertial terms but the constraint's. T and V of particles and declared
    potentials, `energy` = T + V + qd . dL/dqd - L of the `lagrangian`; `jacobi` = v . dL/dv - L of the whole
    system, whose rate is `power` - lambda . b: the power of the forces without potential and of explicit time;
    `rest` is its part without velocities, V - L(q, v = 0, t) of what is not Cartesian.
    applied: F_k on each dependent particle (the sum of forces and potentials declared on particles).
    carriers: what acts on generalized coordinates directly, by name, with the rows of q it touches.
    """

    M: Any
    h: Any
    kinetic: Any
    potential: Any
    energy: Any
    jacobi: Any
    rest: Any
    power: Any
    applied: Mapping[str, Triple]
    carriers: Mapping[str, frozenset[int]]


def dynamics(model: nouns.Model, environment: Environment, fixed: FixedExponents) -> Dynamics:
    """The dynamics of a model without its constraints."""
    s = environment.symbols
    forces = _particle_forces(model, environment)
    V = _potential(model, environment)
    masses = {p.name: environment.scalar(p.mass) for p in model.particles}
    T_cartesian, T_dependent = _kinetic(model, environment, masses)
    extra = environment.scalar(model.lagrangian) if model.lagrangian is not None else ca.SX(0)
    # L = T + extra - V. Its Cartesian part is linear algebra known beforehand; the rest goes through AD.
    general = T_dependent + extra
    momentum = ca.gradient(general, s.v)
    M = ca.diag(_cartesian_masses(model, s, masses)) + ca.jacobian(momentum, s.v)
    Q = _generalized_forces(model, environment, forces)
    inertial = ca.jtimes(momentum, s.q, s.v) + ca.jacobian(momentum, s.t)
    h = Q + ca.gradient(general - V, s.q) - inertial
    extra_energy = ca.dot(s.v, ca.gradient(extra, s.v)) - extra
    explicit_time = ca.jacobian(general - V, s.t)
    return Dynamics(
        M=ca.sparsify(M),
        h=ca.densify(h),
        kinetic=T_cartesian + T_dependent,
        potential=V,
        energy=T_cartesian + T_dependent + V + extra_energy,
        rest=V - ca.substitute(general, s.v, ca.SX.zeros(s.v.shape)),
        jacobi=T_cartesian + V + ca.dot(s.v, momentum) - general,
        power=ca.dot(Q, s.v) - explicit_time,
        applied=_applied(model, s, fixed),
        carriers=_carriers(model, s, fixed),
    )


def _own(environment: Environment, particle: nouns.Particle) -> dict[str, Any]:
    """`m`, `r`, `v` in the force on a particle."""
    return {
        "m": environment.scalar(particle.mass),
        "r": environment.position(particle.name),
        "v": environment.velocity(particle.name),
    }


def _declared(
    model: nouns.Model, environment: Environment, constant: bool
) -> Iterator[tuple[nouns.Particle, Triple]]:
    """Particles with the forces declared on them, those that count as potentials or the others."""
    by_name = {p.name: p for p in model.particles}
    for force in model.forces:
        if isinstance(force, nouns.ParticleForce) and force.constant == constant:
            for target in force.targets:
                particle = by_name[target]
                algebra = environment.algebra(own=_own(environment, particle))
                yield particle, environment.vector(force.force, algebra)


def _particle_forces(model: nouns.Model, environment: Environment) -> list[tuple[nouns.Particle, Triple]]:
    return list(_declared(model, environment, constant=False))


def _potential(model: nouns.Model, environment: Environment) -> Any:
    """V: declared potentials, and -F.r of every constant force."""
    V = ca.SX(0)
    for force in model.forces:
        if isinstance(force, nouns.Potential):
            V += environment.scalar(force.expression)
    for particle, F in _declared(model, environment, constant=True):
        r = environment.position(particle.name)
        V -= sum(a * x for a, x in zip(F, r, strict=True))
    return V


def _kinetic(model: nouns.Model, environment: Environment, masses: Mapping[str, Any]) -> tuple[Any, Any]:
    parts = {False: ca.SX(0), True: ca.SX(0)}
    for particle in model.particles:
        v = environment.velocity(particle.name)
        parts[particle.is_dependent] += masses[particle.name] / 2 * sum(c * c for c in v)
    return parts[False], parts[True]


def _cartesian_masses(model: nouns.Model, s: Symbols, masses: Mapping[str, Any]) -> Any:
    """The masses on the diagonal of M, structurally zero at generalized coordinates."""
    entries = [ca.SX(1, 1)] * s.q.numel()
    for particle in model.particles:
        if not particle.is_dependent:
            for axis in "xyz":
                entries[s.index[f"{particle.name}.{axis}"]] = masses[particle.name]
    return ca.vertcat(*entries)


def _generalized_forces(
    model: nouns.Model, environment: Environment, forces: list[tuple[nouns.Particle, Triple]]
) -> Any:
    """Q_j = sum_k F_k . dr_k/dq_j (D.30) of all forces without a potential."""
    s = environment.symbols
    parts = [ca.SX(0)] * s.q.numel()
    Q = ca.SX.zeros(s.q.numel())
    for particle, F in forces:
        if particle.is_dependent:
            r = ca.vertcat(*environment.position(particle.name))
            Q += ca.jtimes(r, s.q, ca.vertcat(*F), True)
        else:
            first = s.index[f"{particle.name}.x"]
            for axis in range(3):
                parts[first + axis] = parts[first + axis] + F[axis]
    for force in model.forces:
        if isinstance(force, nouns.GeneralizedForce):
            for target in force.targets:
                row = s.index[target]
                parts[row] = parts[row] + environment.scalar(force.force)
    return Q + ca.vertcat(*parts)


def _free(model: nouns.Model) -> dict[str, tuple[Triple, Triple]]:
    """Symbols for the positions and velocities of dependent particles, as if they were free."""
    free = {}
    for particle in model.particles:
        if particle.is_dependent:
            r, v = ca.SX.sym(f"r {particle.name}", 3), ca.SX.sym(f"v {particle.name}", 3)
            free[particle.name] = ((r[0], r[1], r[2]), (v[0], v[1], v[2]))
    return free


def _applied(model: nouns.Model, s: Symbols, fixed: FixedExponents) -> dict[str, Triple]:
    """F_k on the dependent particles: declared forces, and -grad_k V with the particles taken as free."""
    free = _free(model)
    if not free:
        return {}
    environment = Environment(model, s, fixed, free)
    V = _potential(model, environment)
    F = {name: -ca.gradient(V, ca.vertcat(*r)) for name, (r, _) in free.items()}
    for particle, force in _particle_forces(model, environment):
        if particle.is_dependent:
            F[particle.name] += ca.vertcat(*force)
    true = Environment(model, s, fixed)
    symbols = [ca.vertcat(*part) for pair in free.values() for part in pair]
    values = [
        ca.densify(ca.vertcat(*part)) for name in free for part in (true.position(name), true.velocity(name))
    ]
    substituted = ca.substitute(list(F.values()), symbols, values)
    return {name: (f[0], f[1], f[2]) for name, f in zip(F, substituted, strict=True)}


def _carriers(model: nouns.Model, s: Symbols, fixed: FixedExponents) -> dict[str, frozenset[int]]:
    """Forces that act on coordinates without a particle that carries them."""
    environment = Environment(model, s, fixed, _free(model))
    found: dict[str, frozenset[int]] = {}
    for force in model.forces:
        if isinstance(force, nouns.GeneralizedForce):
            found[f"the generalized force `{force.name}`"] = frozenset(s.index[t] for t in force.targets)
        elif isinstance(force, nouns.Potential):
            touched = _rows_of(environment.scalar(force.expression), s.q)
            found[f"the potential `{force.name}`"] = touched
    if model.lagrangian is not None:
        extra = environment.scalar(model.lagrangian)
        found["the `lagrangian`"] = _rows_of(extra, s.q) | _rows_of(extra, s.v)
    return {name: touched for name, touched in found.items() if touched}


def _rows_of(value: Any, vector: Any) -> frozenset[int]:
    """The entries of a vector of symbols that an expression depends on."""
    return frozenset(ca.jacobian(value, vector).sparsity().get_triplet()[1])
