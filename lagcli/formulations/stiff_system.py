"""A system in which one holonomic row f = 0 has become the potential k f^2/2, which exerts -k f along its gradient.

    M a = h - k f grad f + B^T lambda    with the other rows alone

k = exp(growth (t - since)) times a stiffness: parameters with names that no file can have, so that all runs of a
ladder share one build. A run starts on the slow motion, where the spring already pulls as the row did.
"""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations import energy, system
from lagcli.equations.environment import Environment
from lagcli.equations.rows import ConstraintRows
from lagcli.linear import decompositions
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.start import initial, projection
from lagcli.start.initial import State

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
    numbers = ((STIFFNESS, k.least), (GROWTH, k.growth), (SINCE, k.since))
    further = tuple(nouns.Parameter(name, value) for name, value in numbers)
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
        numbers = [env.symbols.parameters[name] for name in (STIFFNESS, GROWTH, SINCE)]
        k, growth, since = (number for number in numbers if isinstance(number, ca.SX))
        if grows:
            k = k * ca.exp(growth * (env.t - since))
        f, B, f_t = constraints.f[index], constraints.B[index, :], constraints.b[index]
        V = k * f**2 / 2
        by_time = k * f * f_t + (growth * V if grows else 0)
        # The other rows
        rest = [i for i in range(len(constraints.rows)) if i != index]
        if rest:
            holonomic = [i for i in rest if i < constraints.f.numel()]
            others = ConstraintRows(
                tuple(constraints.rows[i] for i in rest),
                constraints.f[holonomic] if holonomic else ca.SX(0, 1),
                ca.sparsify(constraints.B[rest, :]),
                constraints.b[rest],
                constraints.gamma[rest],
            )
        else:
            others = ConstraintRows((), ca.SX(0, 1), ca.SX(0, B.shape[1]), ca.SX(0, 1), ca.SX(0, 1))
        return others, dataclasses.replace(
            dynamics,
            h=ca.densify(dynamics.h - k * f * B.T),
            potential=dynamics.potential + V,
            energy=dynamics.energy + V,
            jacobi=dynamics.jacobi + V,
            rest=dynamics.rest + V,
            power=dynamics.power + by_time,
        )

    return system.build(stiff, restated)


def has_cut(built: system.System, index: int) -> bool:
    """True if f of a row has the cut of an angle, across which its potential would jump."""
    if built.cuts is None:
        return False
    return bool(ca.depends_on(built.f[index], built.cuts.references))


def multiplier_rate(
    solved: ca.Function, at: tuple[float, Floats, Floats, Floats], index: int
) -> tuple[float, float]:
    """lambda of a row and its rate at t, q, v (n,), p by AD of solved(t, y, p) -> y' and lambda of all rows."""
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


# Starts on the slow motion, where the spring already pulls as the row did


class NoSlowStartError(ValueError):
    """No configuration was found in which the row is stretched so far."""


@dataclasses.dataclass(frozen=True, slots=True)
class StiffRow:
    """The row that becomes a spring: its number, and its multiplier and that one's rate at the start."""

    index: int
    multiplier: float
    rate: float


def stretched(numeric: NumericSystem, start: State, row: StiffRow, k: float) -> tuple[Floats, Floats]:
    """q and v (n,) with f = -lambda/k and df/dt = -lambda'/k of the row, and with all other independent rows: those
    nearest to the start in the mass metric. numeric: with the row. Raises `NoSlowStartError`."""
    surface = _Stretched(numeric, start, row.index, -row.multiplier / k)
    reached = surface.descend(start.q)
    if not reached.is_on:
        raise NoSlowStartError
    q = surface.nearest(reached.q, start.q)
    here = surface.at(q)
    assert here is not None
    q = q + here.step()  # a stiff spring pulls with what a descent leaves
    there = dataclasses.replace(start, q=q)
    B, b = numeric.rows(start.t, q, start.v, start.p)
    wanted = np.array(b).ravel()
    wanted[row.index] += row.rate / k
    return q, projection.velocity(start.v, B, wanted, initial.metric_at(numeric, there))


class _Stretched(projection.Surface):
    """f = 0 but for one row, which is at a value of its own; with the metric at a state."""

    def __init__(self, numeric: NumericSystem, start: State, index: int, offset: float) -> None:
        super().__init__(numeric, start.t, start.p, initial.metric_at(numeric, start))
        self._index, self._offset = index, offset

    def values(self, q: Floats) -> tuple[Floats, Floats]:
        """f (s,) less the value, and the entries of B."""
        f, entries = super().values(q)
        f[self._index] -= self._offset
        return f, entries


def frequency(numeric: NumericSystem, start: State, index: int) -> float:
    """omega/sqrt(k) of the swing of the row: B_i P B_i^T, with P the inverse of M on what the other rows leave free."""
    B = numeric.rows(start.t, start.q, start.v, start.p)[0]
    metric = initial.metric_at(numeric, start)
    dense = np.array(MetricRows(B, metric).dense)
    lengths = LocalRows(metric.whitened(B)).norms
    others = np.delete(dense, index, axis=0)
    own = dense[index] * lengths[index]
    return float(np.linalg.norm(decompositions.residual(others.T, own)))
