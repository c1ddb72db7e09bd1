"""A system in which one holonomic row f = 0 has become the potential k f^2/2, which exerts -k f along its gradient.

    M a = h - k f grad f + B^T lambda    with the other rows alone

k = exp(growth (t - since)) times a stiffness: parameters with names that no file can have, so that all runs of a
ladder share one build.
"""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import energy, system
from lagcli.equations.environment import Environment
from lagcli.equations.rows import ConstraintRows
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

STIFFNESS, GROWTH, SINCE = "stiffness of the row", "growth of the stiffness", "time of the least stiffness"


@dataclasses.dataclass(frozen=True, slots=True)
class Stiffness:
    """k at the time `since`, and its rate of growth there, (dk/dt)/k."""

    least: float
    growth: float = 0.0
    since: float = 0.0

    def at(self, t: Floats) -> Floats:
        """k at times (T,)."""
        return np.asarray(self.least * np.exp(self.growth * (t - self.since)))


def model(declared: nouns.Model, row: str, start: tuple[float, Floats, Floats], k: Stiffness) -> nouns.Model:
    """The model with the parameters of k, which starts at t, q, v (n,); without outputs and events."""
    t, q, v = start
    further = tuple(
        nouns.Parameter(name, value)
        for name, value in ((STIFFNESS, k.least), (GROWTH, k.growth), (SINCE, k.since))
    )
    return dataclasses.replace(
        system.started_at(declared, q, v),
        fingerprint=f"{declared.fingerprint} stiff {row}",
        parameters=(*declared.parameters, *further),
        outputs=(),
        events=(),
        simulation=dataclasses.replace(declared.simulation, start=t, assemble=False, keep=()),
        warnings=(),
    )


def build(stiff: nouns.Model, row: str, grows: bool) -> system.System:
    """The system of a model that `model` made for this row; `grows`: with a stiffness that depends on time."""

    def restated(
        env: Environment, constraints: ConstraintRows, dynamics: energy.Dynamics
    ) -> tuple[ConstraintRows, energy.Dynamics]:
        index = [one.name for one in constraints.rows].index(row)
        k, growth, since = (_parameter(env, name) for name in (STIFFNESS, GROWTH, SINCE))
        if grows:
            k = k * ca.exp(growth * (env.t - since))
        f, B, f_t = constraints.f[index], constraints.B[index, :], constraints.b[index]
        V = k * f**2 / 2
        by_time = k * f * f_t + (growth * V if grows else 0)
        return _without(constraints, index), dataclasses.replace(
            dynamics,
            h=ca.densify(dynamics.h - k * f * B.T),
            potential=dynamics.potential + V,
            energy=dynamics.energy + V,
            jacobi=dynamics.jacobi + V,
            rest=dynamics.rest + V,
            power=dynamics.power + by_time,
        )

    return system.build(stiff, restated)


def _parameter(env: Environment, name: str) -> ca.SX:
    value = env.symbols.parameters[name]
    assert isinstance(value, ca.SX)
    return value


def _without(constraints: ConstraintRows, index: int) -> ConstraintRows:
    """The rows but one, a holonomic one."""
    rest = [i for i in range(len(constraints.rows)) if i != index]
    holonomic = [i for i in rest if i < constraints.f.numel()]
    rows = tuple(constraints.rows[i] for i in rest)
    if not rest:
        n = constraints.B.shape[1]
        return ConstraintRows((), ca.SX(0, 1), ca.SX(0, n), ca.SX(0, 1), ca.SX(0, 1))
    f = constraints.f[holonomic] if holonomic else ca.SX(0, 1)
    return ConstraintRows(
        rows, f, ca.sparsify(constraints.B[rest, :]), constraints.b[rest], constraints.gamma[rest]
    )


def has_cut(built: system.System, index: int) -> bool:
    """True if f of a row has the cut of an angle, across which its potential would jump."""
    if built.cuts is None:
        return False
    return bool(ca.depends_on(built.f[index], built.cuts.references))


def multiplier_rate(
    solved: ca.Function, at: tuple[float, Floats, Floats, Floats], index: int
) -> tuple[float, float]:
    """lambda of a row and its rate along the motion, at t, q, v (n,) with parameters p.

    solved: solved(t, y, p) -> y' and lambda of all rows, differentiated by AD.
    """
    t, q, v, p = at
    y = np.concatenate([q, v, [0.0]])
    time, state, numbers = (ca.MX.sym(name, size) for name, size in (("t", 1), ("y", y.size), ("p", p.size)))
    y_dot, lam = solved(time, state, numbers)
    where = ca.vertcat(time, state)
    rate = ca.jtimes(lam[index], where, ca.vertcat(1, y_dot))
    values = SizedFunction("rate", [time, state, numbers], [lam[index], rate])(t, y, p)
    return float(values[0]), float(values[1])


def stretch(built: system.System, index: int) -> ca.Function:
    """stretch(t, q, p) -> f of a row, also of many states side by side."""
    symbols = built.symbols
    return SizedFunction("stretch", [symbols.t, symbols.q, built.p], [built.rows.f[index]])


def size_of_terms(built: system.System, index: int, start: State) -> float:
    """sum |B_i q_i| of a row at a state: the size of the terms of f, of which rounding is a part."""
    symbols = built.symbols
    terms = ca.dot(ca.fabs(ca.densify(built.rows.B[index, :]).T), ca.fabs(symbols.q))
    return float(SizedFunction("terms", [symbols.t, symbols.q, built.p], [terms])(start.t, start.q, start.p))
