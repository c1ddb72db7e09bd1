"""Forces between particles: F_ij = -F_ji along r_i - r_j, or not.

Forces that hold a rigid body together, the limit of stiff springs, do no virtual work because they are central. A law
is looked at in the state asked for and in others around it, with all particles free to stand anywhere.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.equations.environment import Environment, Triple, Value, column, taken
from lagcli.equations.symbols import FixedExponents
from lagcli.equations.system import System
from lagcli.expression import tree
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.start import initial
from lagcli.start.initial import State

# How far states around the one asked for are off it, as a part of the size of the configuration.
OFFSET = 0.1
SEED = 20062


@dataclasses.dataclass(frozen=True, slots=True)
class Internal:
    """The forces of laws between particles.

    force: sum of sizes in the state asked for; unbalanced: |sum of F| as a part of the forces, F_ij + F_ji of a pair;
    off_line: |sum of r x F| as a part of the forces and distances, the part of F_ij across r_i - r_j; both the largest
    over all states looked at. For more than two particles that no law tells apart: the same sums over all of them.
    """

    laws: tuple[str, ...]
    particles: tuple[str, ...]
    force: float
    unbalanced: float
    off_line: float

    @property
    def is_pair(self) -> bool:
        """True if it is a force between two particles."""
        return len(self.particles) == 2

    @property
    def is_central(self) -> bool:
        """True if F_ij = -F_ji along the line; of more particles, whether they do no work on a rigid body."""
        return self.unbalanced <= doubles.ZERO and self.off_line <= doubles.ZERO


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Term:
    """A law on some particles: the particles that it acts on with the entries of `_Laws.forces` that hold F, and all
    those that it depends on."""

    law: str
    on: tuple[int, ...]
    first: int
    touched: frozenset[int]
    is_complete: bool  # holds the forces on all particles it touches, as a potential does


def internal(system: System, state: State) -> tuple[Internal, ...]:
    """All forces between particles that a model declares."""
    laws = _Laws(system)
    if not laws.terms:
        return ()
    states = list(laws.states(state))
    groups: dict[tuple[str, frozenset[int]], list[_Term]] = {}
    for term in laws.terms:
        # Forces on single particles make a pair together; one that depends on several is not told apart.
        key = (term.law if term.is_complete else "", term.touched)
        if not term.is_complete and len(term.touched) > 2:
            key = ("several", frozenset())
        groups.setdefault(key, []).append(term)
    found = []
    for group in groups.values():
        particles = sorted(frozenset[int]().union(*(term.touched for term in group)))
        size, unbalanced, off_line = 0.0, 0.0, 0.0
        for number, (r, F) in enumerate(states):
            total, torque, forces = np.zeros(3), np.zeros(3), 0.0
            center = r[particles].mean(axis=0)
            for term in group:
                for index, k in enumerate(term.on):
                    force = F[term.first + 3 * index : term.first + 3 * index + 3]
                    total, torque = total + force, torque + np.cross(r[k] - center, force)
                    forces += float(np.linalg.norm(force))
            lever = float(np.linalg.norm(r[particles] - center, axis=1).max()) or 1.0
            size = forces if number == 0 else size
            if forces > 0:
                unbalanced = max(unbalanced, float(np.linalg.norm(total)) / forces)
                off_line = max(off_line, float(np.linalg.norm(torque)) / (forces * lever))
        names = tuple(system.model.particle_names[k] for k in particles)
        laws_of = tuple(dict.fromkeys(term.law for term in group))
        found.append(Internal(laws_of, names, size, unbalanced, off_line))
    return tuple(found)


class _Laws:
    """The laws between particles as a function of free positions and velocities."""

    def __init__(self, system: System) -> None:
        self._system, model, s = system, system.model, system.symbols
        self._count = len(model.particle_names)
        self.terms: list[_Term] = []
        if self._count < 2:
            return
        dependent = sum(p.members.count for p in model.particles if p.is_dependent)
        r, v = _triple("r", dependent), _triple("v", dependent)
        self._free = ca.vertcat(*r, *v)
        self._env = Environment(model, s, FixedExponents(model), (r, v) if dependent else None)
        everyone = np.arange(self._count)
        self._r = ca.vec(ca.horzcat(*self._env.position(everyone)).T)
        self._v = ca.vec(ca.horzcat(*self._env.velocity(everyone)).T)
        self._forces: list[ca.SX] = []
        self._size = 0
        for force in model.forces:
            if isinstance(force, nouns.Potential) and force.members.count:
                whole = frozenset(range(force.members.count))
                self._potential(force, 1, force.expression.tree, whole)
            elif isinstance(force, nouns.ParticleForce) and not force.constant and force.action.targets.size:
                self._on_particles(force, 1, force.force, frozenset(range(force.action.targets.size)))
        inputs = [s.t, s.q, s.v, s.p, self._free]
        values = ca.densify(ca.vertcat(ca.SX(0, 1), *self._forces))
        self._function = SizedFunction("laws", inputs, [self._r, values])
        self._true = SizedFunction("true", [s.t, s.q, s.v, system.p], [system.r, system.r_dot])

    def states(self, state: State) -> Iterator[tuple[Floats, Floats]]:
        """Positions (N, 3) and all forces, at a state and at others around it where they are finite."""
        model = self._system.model
        p = state.p[: self._system.symbols.p.numel()]
        flags = np.repeat(
            [q.is_dependent for q in model.particles], [q.members.count for q in model.particles]
        )
        random = np.random.default_rng(SEED)
        size, speed = initial.size(state.q), initial.size(state.v)
        r, v = (np.array(x).reshape(-1, 3)[flags] for x in self._true(state.t, state.q, state.v, state.p))
        for number in range(4):
            q, q_dot, free = state.q, state.v, np.concatenate([r.T.ravel(), v.T.ravel()])
            if number:
                q = q + OFFSET * size * random.standard_normal(q.size)
                q_dot = q_dot + OFFSET * speed * random.standard_normal(q.size)
                own = float(np.abs(r).max(initial=0.0)) or 1.0
                free = free + OFFSET * own * random.standard_normal(free.size)
            positions, forces = (np.array(x).ravel() for x in self._function(state.t, q, q_dot, p, free))
            if np.isfinite(forces).all():
                yield positions.reshape(-1, 3), forces

    def _potential(self, force: nouns.Potential, sign: int, node: tree.Node, only: frozenset[int]) -> None:
        """-grad_k of a potential, or of a term of it with a sign, for those of some members that touch several
        particles; where these are more than two the terms are taken one by one."""
        algebra = self._env.algebra(force.members.variables)
        expression = dataclasses.replace(force.expression, tree=node)
        slope = ca.jacobian(column(self._env.scalar(expression, algebra), force.members.count), self._r)
        divided = set()
        for member, touched in _touched(slope, self._count).items():
            if member not in only or len(touched) < 2:
                continue
            if len(touched) > 2 and isinstance(node, tree.Sum):
                divided.add(member)
                continue
            on = tuple(sorted(touched))
            entries = [3 * k + axis for k in on for axis in range(3)]
            F = -sign * ca.densify(slope[member, entries]).T
            self._add(force.members.names[member], on, F, frozenset(touched), True)
        if isinstance(node, tree.Sum) and divided:
            for own, term in node.terms:
                self._potential(force, sign * own, term, frozenset(divided))

    def _on_particles(
        self, force: nouns.ParticleForce, sign: int, vector: nouns.VectorExpression, only: frozenset[int]
    ) -> None:
        """Record a force, or a term of it, on those of some pairs of a target and what acts on it that
        depend on other particles."""
        env, targets = self._env, force.action.targets
        r, v = env.position(targets), env.velocity(targets)
        own: dict[str, Value] = {"m": taken(env.masses, targets), "r": r, "v": v}
        algebra = env.algebra(force.action.variables(force.members), own)
        parts = [column(part, targets.size) for part in env.vector(vector, algebra)]
        touched: dict[int, set[int]] = {}
        for part in parts:
            slope = ca.jacobian(part, ca.vertcat(self._r, self._v))
            for pair, particles in _touched(slope, self._count).items():
                touched.setdefault(pair, set()).update(particles)
        divided, whole = set(), vector.parts[0]
        for pair, particles in sorted(touched.items()):
            k = int(targets[pair])
            if pair not in only or not particles - {k}:
                continue
            is_sum = len(vector.parts) == 1 and isinstance(whole.tree, tree.Sum)
            if len(particles | {k}) > 2 and is_sum:
                divided.add(pair)
                continue
            F = sign * ca.vertcat(*(part[pair] for part in parts))
            name = force.members.names[int(force.action.acting[pair])]
            self._add(name, (k,), F, frozenset(particles | {k}), False)
        if isinstance(whole.tree, tree.Sum) and divided:
            for one, term in whole.tree.terms:
                piece = nouns.VectorExpression((dataclasses.replace(whole, tree=term),))
                self._on_particles(force, sign * one, piece, frozenset(divided))

    def _add(
        self, law: str, on: tuple[int, ...], F: ca.SX, touched: frozenset[int], is_complete: bool
    ) -> None:
        self.terms.append(_Term(law, on, self._size, touched, is_complete))
        self._forces.append(F)
        self._size += 3 * len(on)


def _triple(word: str, count: int) -> Triple:
    return ca.SX.sym(f"{word} x", count), ca.SX.sym(f"{word} y", count), ca.SX.sym(f"{word} z", count)


def _touched(slope: ca.SX, particles: int) -> dict[int, set[int]]:
    """Row -> the particles whose positions, or after all of these velocities, it depends on."""
    found: dict[int, set[int]] = {}
    rows, columns = (np.asarray(part, dtype=np.int64) for part in slope.sparsity().get_triplet())
    for row, entry in zip(rows.tolist(), columns.tolist(), strict=True):
        found.setdefault(row, set()).add(entry // 3 % particles)
    return found
