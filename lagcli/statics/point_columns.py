"""The columns of a model's table at a point of rest: positions, multipliers, reactions."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations.system import System

Floats = npt.NDArray[np.float64]


class PointColumns:
    """Places and reactions of one system at rest, at one time and for one p."""

    def __init__(self, system: System, t: float, p: Floats) -> None:
        self._system, self._t, self._p = system, t, p
        s, n = system.symbols, system.symbols.q.numel()
        zeros = ca.SX.zeros(n)
        R = ca.substitute([system.R, system.Q_R], [s.v, system.a], [zeros, zeros])
        places = ca.Function("places", [s.t, s.q, system.p], [system.r])
        reactions = ca.Function(
            "reactions", [s.t, s.q, system.lam, system.p], [ca.densify(part) for part in R]
        )
        self._places, self._reactions = places, reactions

    def at(self, q: Floats) -> dict[str, float]:
        """Positions of all particles, then the generalized coordinates."""
        model = self._system.model
        names = [f"{name}.{axis}" for name in model.particle_names for axis in "xyz"]
        places = self._places(self._t, q, self._p).full().ravel().tolist()
        own = q[q.size - len(model.generalized_names) :].tolist()
        return _named((*names, *model.generalized_names), [*places, *own])

    def reactions(self, q: Floats, lam: Floats) -> dict[str, float]:
        """R of all particles, then of the generalized coordinates; lam (C + K,)."""
        model = self._system.model
        R, Q = (part.full().ravel().tolist() for part in self._reactions(self._t, q, lam, self._p))
        names = [f"R.{name}.{axis}" for name in model.particle_names for axis in "xyz"]
        generalized = model.generalized_names
        return _named((*names, *(f"R.{name}" for name in generalized)), [*R, *Q[len(Q) - len(generalized) :]])

    def row_reactions(self, q: Floats, lam: Floats) -> dict[str, float]:
        """The sum of lambda_i times the gradients, by the columns of the coordinates."""
        Q = self._reactions(self._t, q, lam, self._p)[1].full().ravel().tolist()
        return _named([f"R.{name}" for name in self._system.model.coordinate_names], Q)


def _named(names: tuple[str, ...] | list[str], values: list[float]) -> dict[str, float]:
    return {name: value + 0.0 for name, value in zip(names, values, strict=True)}
