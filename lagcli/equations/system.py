"""The unified system (D.24) of a model: the last stage that is symbols, and the only room with a sign before lambda.

M a = h + B^T lambda                (D.23 with Cartesian particles, D.53 with generalized coordinates)
B v + b = 0,  f = 0                 (D.6, D.2)
R = + B^T lambda                    (D.22)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.equations import energy, environment, output_values, rows, symbols
from lagcli.equations.environment import Columns, Environment
from lagcli.equations.rows import ConstraintRows, ContactRows
from lagcli.equations.rows import Row as ConstraintRow
from lagcli.equations.symbols import FixedExponents, Symbols
from lagcli.errors import diagnostics
from lagcli.frozen import frozen
from lagcli.model import model as nouns
from lagcli.smoothness import named_functions
from lagcli.smoothness.sized_function import SizedFunction

if TYPE_CHECKING:  # loaded where the model names a function that they look for
    from lagcli.equations.branch_cuts import Cuts
    from lagcli.equations.energy_jumps import EnergyJumps
    from lagcli.equations.kinks import Kinks
    from lagcli.equations.rigid import Geometry


@frozen
class System:
    """Symbols and expressions, all CasADi SX.

    Inputs: `symbols` t, q (n), v (n); `p` parameters and constants of rigid bodies; lam (C + K), those of the K
    contacts last; a (n).
    M (n, n), h (n); f (s), B (C, n), b (C), gamma (C), the first s rows holonomic; contacts: g (K), G (K, n) and so
    on; R (N, 3) flattened, Q_R = B^T lambda + G^T lambda (n); event_values (E,): `when` of the declared events;
    T, V, energy, jacobi, power as in `energy.Dynamics`; outputs flattened.
    built_in: parameters that stand in exponents, with the values built into the expressions.
    columns: of the table after `t`, in the order of the specification.
    None where there are none: kinks, where the gradients of rows jump; cuts, f continued across the cuts of angles;
    jumps, where potentials, the Lagrangian or positions jump.
    """

    model: nouns.Model
    symbols: Symbols
    p: ca.SX
    lam: ca.SX
    a: ca.SX
    dynamics: energy.Dynamics
    rows: ConstraintRows
    contacts: ContactRows
    Q_R: ca.SX
    R: ca.SX
    r: ca.SX
    r_dot: ca.SX
    outputs: ca.SX
    event_values: ca.SX
    bodies: tuple[Geometry, ...]
    built_in: tuple[tuple[str, float], ...]
    kinks: Kinks | None
    cuts: Cuts | None
    jumps: EnergyJumps | None
    warnings: tuple[diagnostics.Diagnostic, ...]
    columns: tuple[str, ...]
    of_bodies: ca.SX

    @property
    def f(self) -> ca.SX:
        """f (s,), continued across the cuts of angles."""
        return self.rows.f if self.cuts is None else self.cuts.f

    @property
    def holonomic_count(self) -> int:
        """s, the number of rows with f."""
        return int(self.rows.f.numel())

    @property
    def multiplier_rows(self) -> tuple[ConstraintRow, ...]:
        """The rows of all multipliers in their order: equality rows, then contacts."""
        return (*self.rows.rows, *self.contacts.rows)


# Other rows and dynamics of the same coordinates, in place of those a model declares.
Restated = Callable[
    [Environment, rows.ConstraintRows, energy.Dynamics], tuple[rows.ConstraintRows, energy.Dynamics]
]


def build(model: nouns.Model, restated: Restated | None = None) -> System:
    """The system of a model. Raises `diagnostics.ModelError` for laws that cannot act and degenerate bodies."""
    s = symbols.fresh(model)
    fixed = FixedExponents(model)
    env = Environment(model, s, fixed)
    bodies = geometries(model, s, env)
    constants = [
        ca.SX.sym(f"body {body.name}", len(g.numbers)) for body, g in zip(model.rigid, bodies, strict=True)
    ]
    equalities = rows.equalities(
        model, env, [(g, ca.vertsplit(c)) for g, c in zip(bodies, constants, strict=True)]
    )
    dynamics = energy.dynamics(model, env)
    if restated is not None:
        equalities, dynamics = restated(env, equalities, dynamics)
    contacts = rows.contacts(model, env)
    lam, a = ca.SX.sym("lam", len(equalities.rows) + contacts.count), ca.SX.sym("a", s.q.numel())
    everything = rows.with_contacts(equalities, contacts, lam)
    Q_R = reaction(everything.B, lam)
    everyone = np.arange(len(env.particles))
    accelerations, R = _solved(env, dynamics, Q_R, a)
    solved = output_values.SolvedValues(everything, lam, a, accelerations, R)
    of_bodies = zip(model.rigid, bodies, constants, strict=True)
    named_bodies = {body.name: (body, geometry, own) for body, geometry, own in of_bodies}
    named = output_values.OutputValues(model, env, dynamics, solved, named_bodies)
    p = ca.vertcat(s.p, *constants)
    begin = _begin(model, bodies)
    kinks = cuts = jumps = None
    # Loaded where the model names a function that they look for.
    if named_functions.have_switches(model):
        from lagcli.equations import kinks as switching

        kinks = switching.find(s, p, equalities)
    if kinks is not None:
        kinks.require_smooth(*begin)
    if named_functions.have_angles(model):
        from lagcli.equations import branch_cuts

        cuts = branch_cuts.find(equalities.f, s, p, begin)
    numbers = p if cuts is None else ca.vertcat(p, cuts.references)
    if named_functions.may_jump(model):
        from lagcli.equations import energy_jumps

        jumps = energy_jumps.EnergyJumps(model, s, numbers, env)
    recorded = output_values.outputs(model, env, named)
    return System(
        model=model,
        symbols=s,
        p=numbers,
        lam=lam,
        a=a,
        dynamics=dynamics,
        rows=equalities,
        contacts=contacts,
        Q_R=Q_R,
        R=environment.interleaved(R.take(everyone)),
        r=environment.interleaved(env.position(everyone)),
        r_dot=environment.interleaved(env.velocity(everyone)),
        outputs=recorded,
        event_values=output_values.events(model, env, named),
        bodies=bodies,
        built_in=fixed.used(),
        kinks=kinks,
        cuts=cuts,
        jumps=jumps,
        warnings=_reaction_warnings(model, s, env, dynamics),
        columns=_columns(model, (*equalities.rows, *contacts.rows)),
        of_bodies=_of_bodies(model, env, everything, lam),
    )


def _of_bodies(model: nouns.Model, env: Environment, every: rows.ConstraintRows, lam: ca.SX) -> ca.SX:
    """See `body_values`. Bodies are Cartesian particles alone."""
    if not model.bodies:
        return ca.SX(0, 1)
    from lagcli.equations import body_values  # most models have none

    everyone = np.arange(len(env.particles))
    numbers = {row.name: i for i, row in enumerate(every.rows)}
    forces = {}
    for joint in model.joints:
        own = [numbers[row] for row in joint.rows]
        Q = reaction(every.B[own, :], lam[own])
        whole = ca.SX.zeros(3 * everyone.size)
        for particle in joint.body.particles:
            first = int(env.rows_of(np.array([particle]))[0])
            whole[3 * particle : 3 * particle + 3] = Q[first : first + 3]
        forces[joint.name] = whole
    r, v = (environment.interleaved(x) for x in (env.position(everyone), env.velocity(everyone)))
    return body_values.values(model, env, r, v, forces)


def _columns(model: nouns.Model, constraints: Sequence[ConstraintRow]) -> tuple[str, ...]:
    particles, generalized = model.particle_names, model.generalized_names
    names = [f"{name}.{part}" for name in particles for part in ("x", "y", "z", "vx", "vy", "vz")]
    names += [column for name in generalized for column in (name, f"rate({name})")]
    names += [f"lambda.{row.name}" for row in constraints]
    names += [f"R.{name}.{axis}" for name in particles for axis in "xyz"]
    names += [f"R.{name}" for name in generalized]
    names += (column for body in model.bodies for column in body.columns)
    names += (column for joint in model.joints for column in joint.columns)
    names += ["energy", *(column for output in model.outputs for column in output.columns)]
    return tuple(names)


def reaction(B: ca.SX, lam: ca.SX) -> ca.SX:
    """Q_R (n,) = + B^T lambda (D.22): the sign of lambda, here and nowhere else."""
    return ca.densify(B.T @ lam)


def with_values(built: System, model: nouns.Model) -> System | None:
    """The system with other values of parameters and start, or None where it must be built anew. `model` must be of the
    same text. A new build is needed where a built-in exponent changes, or a rigid body gets another base."""
    if model.structure != built.model.structure:
        return None
    fixed = FixedExponents(model)
    if any(fixed.value(name) != value for name, value in built.built_in):
        return None
    # An environment evaluates every position: only where a body asks for some.
    env = Environment(model, built.symbols, fixed) if model.rigid else None
    bodies = geometries(model, built.symbols, env) if env else ()
    if [body.shape for body in bodies] != [body.shape for body in built.bodies]:
        return None
    begin = _begin(model, bodies)
    if built.kinks is not None:
        built.kinks.require_smooth(*begin)
    if built.cuts is not None and not built.cuts.hold_for(*begin):
        return None
    return dataclasses.replace(built, model=model, bodies=bodies)


def _begin(model: nouns.Model, bodies: Sequence[Geometry]) -> tuple[float, Floats, Floats]:
    """t, q and p of the declared start."""
    return model.simulation.start, start(model)[0], parameter_values(model, bodies)


def start(model: nouns.Model) -> tuple[Floats, Floats]:
    """Initial q and v, shape (n,) each."""
    cartesian = [(p.start, p.start_velocity) for p in model.particles if p.start is not None]
    q = [start.ravel() for start, _ in cartesian] + [c.value for c in model.coordinates]
    v = [moving.ravel() for _, moving in cartesian] + [c.rate for c in model.coordinates]
    nothing = np.zeros(0)
    return np.concatenate([nothing, *q]), np.concatenate([nothing, *v])


def started_at(declared: nouns.Model, q: Floats, v: Floats) -> nouns.Model:
    """The model with the initial values q and v (n,), inverse of `start`."""
    particles, coordinates, first = [], [], 0
    for particle in declared.particles:
        if particle.start is None:
            particles.append(particle)
            continue
        part = slice(first, first + 3 * particle.members.count)
        start, velocity = q[part].reshape(-1, 3), v[part].reshape(-1, 3)
        particles.append(dataclasses.replace(particle, start=start, start_velocity=velocity))
        first = part.stop
    for coordinate in declared.coordinates:
        part = slice(first, first + coordinate.members.count)
        coordinates.append(dataclasses.replace(coordinate, value=q[part], rate=v[part]))
        first = part.stop
    return dataclasses.replace(
        declared, particles=tuple(particles), coordinates=tuple(coordinates), origin=None
    )


def values(built: System) -> Floats:
    """Numbers for `System.p` at the declared start."""
    p = parameter_values(built.model, built.bodies)
    if built.cuts is None:
        return p
    return built.cuts.begin(
        built.model.simulation.start, start(built.model)[0], np.concatenate([p, np.zeros(built.cuts.count)])
    )


def row_jumps(model: nouns.Model) -> dict[int, tuple[float, ...]]:
    """For each row that goes on beyond the cuts of its angles, by its number, the constants by which it jumps there."""
    if not named_functions.have_angles(model):
        return {}
    built = build(model)
    if built.cuts is None:
        return {}
    return built.cuts.jumps(model.simulation.start, start(model)[0], values(built))


def parameter_values(model: nouns.Model, bodies: Sequence[Geometry]) -> Floats:
    """Numbers for parameters and constants of rigid bodies."""
    numbers = symbols.parameter_values(model)
    for body in bodies:
        numbers += body.numbers
    return np.array(numbers, dtype=float)


def geometries(model: nouns.Model, s: Symbols, env: Environment) -> tuple[Geometry, ...]:
    """The geometry of each rigid body at the declared start."""
    if not model.rigid:
        return ()
    from lagcli.equations import rigid

    numbers = np.unique([number for body in model.rigid for number in body.particles])
    where = SizedFunction("where", [s.t, s.q, s.p], [environment.interleaved(env.position(numbers))])
    q, _ = start(model)
    p = symbols.parameter_values(model)
    points = np.array(where(model.simulation.start, q, p)).reshape(-1, 3)
    found = []
    for body in model.rigid:
        positions = points[np.searchsorted(numbers, body.particles)]
        if not np.abs(positions).max() < rigid.FAR:
            message = f"the particles of the body `{body.name}` do not start at finite positions"
            raise diagnostics.error("not-finite-at-start", message, body.location)
        try:
            found.append(rigid.geometry(positions))
        except rigid.DegenerateBody:
            message = f"all particles of the body `{body.name}` start at one point"
            raise diagnostics.error("rigid-degenerate", message, body.location) from None
    return tuple(found)


def _solved(env: Environment, dynamics: energy.Dynamics, Q_R: ca.SX, a: ca.SX) -> tuple[Columns, Columns]:
    """a_k of all particles: components of a, or of a dependent particle the second derivative of x(q, t); and R_k: the
    particle's part of B^T lambda, or of a dependent particle m a_k - F_k (D.10)."""
    accelerations, R = Columns(len(env.particles)), Columns(len(env.particles))
    if env.cartesian.size:
        for found, column in ((accelerations, a), (R, Q_R)):
            found.fill(env.cartesian, tuple(column[axis : env.first_generalized : 3] for axis in range(3)))
    if env.dependent.size:
        velocity = ca.vertcat(*env.velocity(env.dependent))
        acceleration = ca.densify(ca.jtimes(velocity, env.symbols.v, a) + env.rate(velocity))
        accelerations.fill(env.dependent, tuple(ca.vertsplit(acceleration, env.dependent.size)))
        m = environment.taken(env.masses, env.dependent)
        force = ca.densify(ca.vertcat(m, m, m) * acceleration - dynamics.applied)
        R.fill(env.dependent, tuple(ca.vertsplit(force, env.dependent.size)))
    return accelerations, R


def _reaction_warnings(
    model: nouns.Model, s: Symbols, env: Environment, dynamics: energy.Dynamics
) -> tuple[diagnostics.Diagnostic, ...]:
    """R = m a - F of a dependent particle also holds the unknown carriers of forces on its coordinates."""
    found = []
    first = 0
    for particle in model.particles:
        numbers = np.arange(particle.members.count) + first
        first += particle.members.count
        if not particle.is_dependent or not numbers.size:
            continue
        position = ca.vertcat(*env.position(numbers))
        own = frozenset(ca.jacobian(position, s.q).sparsity().get_col())
        carriers = [name for name, touched in dynamics.carriers.items() if touched & own]
        if carriers:
            name = particle.members.base
            message = f"R of `{name}` also holds what carries {', '.join(carriers)}"
            hint = "declare forces and potentials on particles to have R as the constraint force alone"
            found.append(
                diagnostics.Diagnostic("reaction-includes-drive", message, particle.location, hint, "warning")
            )
    return tuple(found)
