"""The parts of a system at numbers, dense: what the reduction by the null space is computed from."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compiled import numeric, parts
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.simulation.run_state.between_steps import Turns
from lagcli.smoothness import time_functions
from lagcli.smoothness.sized_function import SizedFunction

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DensePoint:
    """The values that depend on t and q: f (s,), B (C, n) and b (C,); the arrays are the caller's own."""

    f: Floats
    B: Floats
    b: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DenseForces:
    """The values that depend on the velocities too: M (n, n), h (n,), gamma (C,)."""

    M: Floats
    h: Floats
    gamma: Floats
    is_diagonal: bool

    def times(self, X: Floats) -> Floats:
        """M X for X (n,) or (n, k)."""
        return np.asarray((self.M.diagonal() * X.T).T if self.is_diagonal else self.M @ X)


class DenseFunctions:
    """Compiled functions of a system at one set of parameters p. Nothing in them knows of multipliers."""

    def __init__(self, system: System, p: Floats) -> None:
        symbols, rows, dynamics = system.symbols, system.rows, system.dynamics
        self.n, self.rows, self.holonomic = symbols.q.numel(), len(rows.rows), int(rows.f.numel())
        self._t, self._q, self._v = np.zeros(1), np.zeros(self.n), np.zeros(self.n)
        own = [self._t, self._q]
        inputs = [symbols.t, symbols.q, system.p]
        outputs = [system.f, ca.densify(rows.B), rows.b]
        self._turns, self._last = Turns(system), np.array(p)
        self._point = BoundFunction(_function("point", inputs, outputs), [*own, self._last])
        forces = [ca.densify(dynamics.M), dynamics.h, rows.gamma]
        inputs = [symbols.t, symbols.q, symbols.v, system.p]
        self._forces = BoundFunction(_function("forces", inputs, forces), [*own, self._v, np.array(p)])
        self._is_diagonal = bool(dynamics.M.sparsity().is_diag())
        self._record = numeric.table(system, parts.build(system))
        self._p = p
        self.timed = time_functions.functions(system.model)
        self.calls = 0

    def settle(self, t: float, q: Floats) -> None:
        """Angles with a cut are counted on from where they are at t, q (n,), a state of the motion."""
        self._turns.settle(t, q, self._last)

    def point(self, t: float, q: Floats) -> DensePoint:
        """The rows at t, q (n,)."""
        self._t[0], self._q[:] = t, q
        self._point.trigger()
        f, B, b = self._point.results
        return DensePoint(f.copy(), B.reshape(self.rows, self.n).copy(), b.copy())

    def forces(self, t: float, q: Floats, v: Floats) -> DenseForces:
        """Inertia, forces and bias at t, q, v (n,)."""
        self._t[0], self._q[:], self._v[:] = t, q, v
        self._forces.trigger()
        self.calls += 1
        M, h, gamma = self._forces.results
        return DenseForces(M.reshape(self.n, self.n).copy(), h.copy(), gamma.copy(), self._is_diagonal)

    def row(self, t: float, state: tuple[Floats, Floats, Floats], lam: Floats) -> Floats:
        """One row of the table, t first, of q, v, a (n,) and lambda (C,)."""
        q, v, a = state
        y, rate = np.concatenate([q, v, [0.0]]), np.concatenate([v, a, [0.0]])
        values = np.array(self._record(t, y, rate, lam, self._p)[0]).ravel()
        return np.concatenate([[t], values])


def _function(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    return SizedFunction(name, inputs, [ca.densify(output) for output in outputs])
