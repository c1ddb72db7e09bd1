"""The unified system (D.24) of a model: the last stage that is symbols, and the only room with a sign before lambda.

M a = h + B^T lambda                (D.23 with Cartesian particles, D.53 with generalized coordinates)
B v + b = 0,  f = 0                 (D.6, D.2)
R = + B^T lambda                    (D.22)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import diagnostics
from lagcli import model as nouns
from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError
from lagcli.mechanics import energy, environment, rigid, rows
from lagcli.mechanics.environment import Environment, FixedExponents, Symbols, Triple

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class System:
    """Symbols and expressions, all CasADi SX.

    Inputs: `symbols` t, q (n), v (n); `p` parameters and constants of rigid bodies; lam (C); a (n).
    M (n, n), h (n); f (s), B (C, n), b (C), gamma (C), the first s rows holonomic; R (N, 3) flattened,
    Q_R = B^T lambda (n); T, V, energy, jacobi, power as in `energy.Dynamics`; outputs flattened.
    built_in: parameters that stand in exponents, with the values built into the expressions.
    """

    model: nouns.Model
    symbols: Symbols
    p: Any
    lam: Any
    a: Any
    dynamics: energy.Dynamics
    rows: rows.Rows
    Q_R: Any
    R: Any
    r: Any
    r_dot: Any
    outputs: Any
    bodies: tuple[rigid.Geometry, ...]
    built_in: tuple[tuple[str, float], ...]
    warnings: tuple[diagnostics.Diagnostic, ...]

    @property
    def holonomic_count(self) -> int:
        """s, the number of rows with f."""
        return int(self.rows.f.numel())

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of the table after `t`, in the order of the specification."""
        model = self.model
        names: list[str] = []
        for particle in model.particles:
            names += [f"{particle.name}.{part}" for part in ("x", "y", "z", "vx", "vy", "vz")]
        for q in model.coordinates:
            names += [q.name, f"rate({q.name})"]
        names += [f"lambda.{row.name}" for row in self.rows.rows]
        names += [f"R.{particle.name}.{axis}" for particle in model.particles for axis in "xyz"]
        names += [f"R.{q.name}" for q in model.coordinates]
        names += ["energy", *(column for output in model.outputs for column in output.columns)]
        return tuple(names)


def build(model: nouns.Model) -> System:
    """The system of a model. Raises `diagnostics.ModelError` for laws that cannot act and degenerate bodies."""
    s = environment.symbols(model)
    fixed = FixedExponents(model)
    env = Environment(model, s, fixed)
    bodies = geometries(model, s, env)
    constants = [
        ca.SX.sym(f"body {body.name}", g.row_constants) for body, g in zip(model.rigid, bodies, strict=True)
    ]
    laid = rows.lay_down(model, env, [(g, ca.vertsplit(c)) for g, c in zip(bodies, constants, strict=True)])
    dynamics = energy.dynamics(model, env, fixed)
    lam, a = ca.SX.sym("lam", len(laid.rows)), ca.SX.sym("a", s.q.numel())
    Q_R = ca.densify(laid.B.T @ lam)  # R = + B^T lambda: the sign of lambda, here and nowhere else
    r = [env.position(p.name) for p in model.particles]
    r_dot = [env.velocity(p.name) for p in model.particles]
    R = [_reaction(p, env, dynamics, Q_R, a) for p in model.particles]
    results = _Results(model, laid, lam, R, dynamics)
    return System(
        model=model,
        symbols=s,
        p=ca.vertcat(s.p, *constants),
        lam=lam,
        a=a,
        dynamics=dynamics,
        rows=laid,
        Q_R=Q_R,
        R=_flat(R),
        r=_flat(r),
        r_dot=_flat(r_dot),
        outputs=_outputs(model, env, results),
        bodies=bodies,
        built_in=fixed.used(),
        warnings=_reaction_warnings(model, s, env, dynamics),
    )


def with_values(built: System, model: nouns.Model) -> System | None:
    """The same system for other values of parameters and start, or None where it must be built anew.

    `model` must be of the same text. A new build is needed where a built-in exponent changes, or a rigid body
    gets another base.
    """
    fixed = FixedExponents(model)
    if any(fixed.value(name) != value for name, value in built.built_in):
        return None
    bodies = geometries(model, built.symbols, Environment(model, built.symbols, fixed))
    if [body.shape for body in bodies] != [body.shape for body in built.bodies]:
        return None
    return dataclasses.replace(built, model=model, bodies=bodies)


def _flat(triples: Sequence[Triple]) -> Any:
    return (
        ca.densify(ca.vertcat(*(part for triple in triples for part in triple))) if triples else ca.SX(0, 1)
    )


def start(model: nouns.Model) -> tuple[Floats, Floats]:
    """Initial q and v, shape (n,) each."""
    q: list[float] = []
    v: list[float] = []
    for particle in model.particles:
        if particle.start is not None:
            q += particle.start
            v += particle.start_velocity
    q += [c.value for c in model.coordinates]
    v += [c.rate for c in model.coordinates]
    return np.array(q, dtype=float), np.array(v, dtype=float)


def parameter_values(model: nouns.Model, bodies: Sequence[rigid.Geometry]) -> Floats:
    """Numbers for `System.p`."""
    numbers = environment.parameter_values(model)
    for body in bodies:
        numbers += body.numbers
    return np.array(numbers, dtype=float)


def geometries(model: nouns.Model, s: Symbols, env: Environment) -> tuple[rigid.Geometry, ...]:
    """The geometry of each rigid body at the declared start."""
    if not model.rigid:
        return ()
    names = list(dict.fromkeys(name for body in model.rigid for name in body.particles))
    where = ca.Function("where", [s.t, s.q, s.p], [_flat([env.position(name) for name in names])])
    q, _ = start(model)
    p = environment.parameter_values(model)
    points = np.array(where(model.simulation.start, q, p)).reshape(-1, 3)
    found = []
    for body in model.rigid:
        try:
            found.append(rigid.geometry(points[[names.index(name) for name in body.particles]]))
        except rigid.DegenerateBody:
            message = f"all particles of the body `{body.name}` start at one point"
            raise diagnostics.ModelError(
                [diagnostics.Diagnostic("rigid-degenerate", message, body.location)]
            ) from None
    return tuple(found)


def _reaction(
    particle: nouns.Particle, env: Environment, dynamics: energy.Dynamics, Q_R: Any, a: Any
) -> Triple:
    """R_k: the particle's part of B^T lambda; of a dependent particle m a_k - F_k (D.10)."""
    s = env.symbols
    if not particle.is_dependent:
        first = s.index[f"{particle.name}.x"]
        return Q_R[first], Q_R[first + 1], Q_R[first + 2]
    mass = env.scalar(particle.mass)
    velocity = ca.vertcat(*env.velocity(particle.name))
    acceleration = ca.jtimes(velocity, s.v, a) + env.rate(velocity)
    R = mass * acceleration - ca.vertcat(*dynamics.applied[particle.name])
    return R[0], R[1], R[2]


class _Results:
    """What `multiplier`, `reaction`, `kinetic` and `potential` stand for in outputs."""

    def __init__(
        self, model: nouns.Model, laid: rows.Rows, lam: Any, R: Sequence[Triple], dynamics: energy.Dynamics
    ) -> None:
        self._values: dict[str, Any] = {"kinetic": dynamics.kinetic, "potential": dynamics.potential}
        self._multipliers = {row.name: lam[i] for i, row in enumerate(laid.rows)}
        self._reactions = {p.name: triple for p, triple in zip(model.particles, R, strict=True)}

    def keep(self, name: str, value: Any) -> None:
        """An output that later outputs may use."""
        self._values[name] = value

    def __call__(self, node: tree.Node) -> Any:
        if isinstance(node, tree.Name):
            return self._values[node.name]
        assert isinstance(node, tree.Call)
        argument = node.arguments[0]
        if node.function == "reaction":
            assert isinstance(argument, tree.Name)
            return self._reactions[argument.name]
        if isinstance(argument, tree.Member):
            name = f"{argument.owner}.{argument.member}"
            if name not in self._multipliers:
                message = f"there is no multiplier `{name}`"
                rows = [row for row in self._multipliers if row.startswith(argument.owner + ".")]
                hint = f"the rows are `{rows[0]}` to `{rows[-1]}`" if rows else ""
                raise ExpressionError("unknown-row", message, argument.start, argument.end, hint)
            return self._multipliers[name]
        assert isinstance(argument, tree.Name)
        if argument.name in self._multipliers:
            return self._multipliers[argument.name]
        return tuple(self._multipliers[f"{argument.name}.{axis}"] for axis in "xyz")


def _outputs(model: nouns.Model, env: Environment, results: _Results) -> Any:
    values: list[Any] = []
    algebra = env.algebra(results=results)
    for output in model.outputs:
        origin = output.expression.origin
        try:
            parts = env.either(output.expression, algebra)
        except ExpressionError as error:
            location = origin.locate(error.start, error.end)
            found = diagnostics.Diagnostic(error.code, error.message, location, error.hint)
            raise diagnostics.ModelError([found]) from None
        results.keep(output.name, tuple(parts) if output.is_vector else parts[0])
        values += parts
    return ca.densify(ca.vertcat(*values)) if values else ca.SX(0, 1)


def _reaction_warnings(
    model: nouns.Model, s: Symbols, env: Environment, dynamics: energy.Dynamics
) -> tuple[diagnostics.Diagnostic, ...]:
    """R = m a - F of a dependent particle also holds the unknown carriers of forces on its coordinates."""
    found = []
    for particle in model.particles:
        if not particle.is_dependent:
            continue
        position = ca.vertcat(*env.position(particle.name))
        own = frozenset(ca.jacobian(position, s.q).sparsity().get_triplet()[1])
        carriers = [name for name, touched in dynamics.carriers.items() if touched & own]
        if carriers:
            message = f"R of `{particle.name}` also holds what carries {', '.join(carriers)}"
            hint = "declare forces and potentials on particles to have R as the constraint force alone"
            found.append(
                diagnostics.Diagnostic("reaction-includes-drive", message, particle.location, hint, "warning")
            )
    return tuple(found)
