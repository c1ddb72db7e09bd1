"""Newton's formulation of a model with dependent particles: they are freed, and tied to r_k = x_k(q, t) by rows.

    m_k a_k = F_k + lambda_k,    r_k - x_k(q, t) = 0        (D.10, D.24 with D.27 as constraints)

The multipliers of these rows are the forces of constraint themselves. The coordinates q keep no inertia of their
own, and M is singular; with W the masses of the freed particles and J the rows that tie them,

    (M + J^T W J) a = h + J^T W gamma + B^T lambda

has the same a and the same lambda, because J a = gamma holds, and a matrix that is positive definite wherever T is.
"""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.equations import energy, environment, family_rows, rows, system
from lagcli.equations.environment import Environment
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction


def model(built: system.System, t: float, q: Floats, v: Floats) -> nouns.Model:
    """The model with all particles Cartesian, which starts at the state t, q (n,), v (n,) of `built`. Particles and
    coordinates keep their names, and forces, potentials and rows their texts."""
    declared = built.model
    p = system.values(built)
    symbols = built.symbols
    where = SizedFunction("where", [symbols.t, symbols.q, symbols.v, built.p], [built.r, built.r_dot])
    r, r_dot = (np.array(part).reshape(-1, 3) for part in where(t, q, v, p))
    particles, first = [], 0
    for particle in declared.particles:
        block = slice(first, first + particle.members.count)
        particles.append(dataclasses.replace(particle, start=r[block], start_velocity=r_dot[block]))
        first = block.stop
    return dataclasses.replace(
        system.started_at(declared, q, v),
        fingerprint=f"{declared.fingerprint} freed",
        particles=tuple(particles),
        simulation=dataclasses.replace(declared.simulation, start=t, assemble=False, keep=()),
        warnings=(),
    )


def build(built: system.System, particle_model: nouns.Model) -> system.System:
    """The system of a model that `model` made of the one of `built`."""
    own = built.model
    is_dependent = np.repeat(
        [p.is_dependent for p in own.particles], [p.members.count for p in own.particles]
    )
    numbers = np.flatnonzero(is_dependent)
    indices = (3 * numbers[:, None] + np.arange(3)).ravel().tolist()
    # The rows that tie, `r(a).x`: no constraint of a file can have such a name.
    names = [
        rows.Row(f"r({name}).{axis}", f"r({name})", particle.location)
        for particle in own.particles
        if particle.is_dependent
        for name in particle.members.names
        for axis in "xyz"
    ]

    def tied(
        env: Environment, constraints: rows.ConstraintRows, dynamics: energy.Dynamics
    ) -> tuple[rows.ConstraintRows, energy.Dynamics]:
        # r_k - x_k(q, t) of the freed particles, (3 times their number, 1), over the symbols of `env`.
        everyone = np.arange(len(env.particles))
        r = environment.interleaved(env.position(everyone))
        coordinates = np.flatnonzero(np.repeat(~is_dependent, 3)).tolist()
        q = ca.vertcat(env.q[coordinates], env.q[3 * everyone.size :])
        old, new = [built.symbols.t, built.symbols.q, built.symbols.p], [env.t, q, env.symbols.p]
        x = ca.substitute([built.r[indices]], old, new)[0]
        block = family_rows.holonomic(ca.densify(r[indices] - x), env)
        masses = ca.repmat(environment.column(environment.taken(env.masses, numbers), numbers.size).T, 3, 1)
        weighted = ca.mtimes(block.B.T, ca.diag(ca.vec(masses)))
        augmented = dataclasses.replace(
            dynamics,
            M=ca.sparsify(dynamics.M + ca.mtimes(weighted, block.B)),
            h=ca.densify(dynamics.h + ca.mtimes(weighted, block.gamma)),
        )
        # Holonomic rows, those that tie after them, then the differential ones.
        s = constraints.f.numel()
        inserted = rows.ConstraintRows(
            (*constraints.rows[:s], *names, *constraints.rows[s:]),
            ca.vertcat(constraints.f, block.f),
            ca.sparsify(ca.vertcat(constraints.B[:s, :], block.B, constraints.B[s:, :])),
            ca.vertcat(constraints.b[:s, :], block.b, constraints.b[s:, :]),
            ca.vertcat(constraints.gamma[:s, :], block.gamma, constraints.gamma[s:, :]),
        )
        return inserted, augmented

    return system.build(particle_model, tied)
