"""The arguments of functions of place that may be narrow, and whether one may have its feature within a step.

A wall, a well or a step of a force lies where the argument of its function turns, as of `exp(-((x - a)/w)**2)` at a, or
vanishes, as of `tanh((x - a)/w)`. Arguments are wide where functions are narrow: values and slopes at the ends of a
step, and at one point between, show turns and zeros.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.smoothness import operation_graph, switches
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.smoothness.time_functions import MOST_OPERATIONS, MOST_STEPS

_POWERS = (ca.OP_POW, ca.OP_CONSTPOW)


class NarrowArgumentParameters:
    """From when on a feature is narrow in a step. The tests are of `tests/physics/test_narrow_places.py`."""

    __slots__ = ()

    units: float = 8.0
    """Units by which an argument changes within a piece of a step where its function has its feature between the
    stages, which are a quarter of the step apart: one is as wide as two units.
    `test_a_feature_is_narrow_where_its_argument_changes_by_eight_units` fails at 0.8 and 80."""
    inner: float = (3 - 5**0.5) / 2
    """The point between the ends of a piece: the golden section, which no whole number of waves fits well.
    `test_a_piece_is_cut_inside` fails at a tenth and at ten times of it."""
    misfit: float = 0.125
    """Part of the change of an argument by which it may be off its cubic: else it may turn unseen.
    `test_an_argument_that_waves_within_a_step_is_looked_at` fails at 1.25."""


PARAMETERS = NarrowArgumentParameters()


@frozen
class NarrowArguments:
    """The K arguments u, functions of place and time.

    A unit is the change of an argument that changes its function: `absolute` plus `relative` times |u| at a turn,
    `absolute` where u vanishes, (K,) each.
    values(t, y, p) -> u and du/dt, (K,) each;
    piece(u, s, u', s', units) -> 1 of arguments that vanish, and of those that turn, where a function may have its
    feature, and change by more than so many units, (K,) each, by values and slopes at the ends of a piece of a step;
    waves(u, s, u at `inner`, u', s', units) -> 1 of arguments that are no cubic in a piece, (K,);
    passes(t, h, y, y', new, new', p) -> the number of arguments that may turn or vanish within a step from y, and
    change by many units in it, or wave.
    """

    absolute: Floats
    relative: Floats
    values: ca.Function
    piece: ca.Function
    waves: ca.Function
    passes: ca.Function


# What is a unit of an argument, absolute and relative, and whether its function has a feature where it vanishes.
_Kind = tuple[float, float, bool]


def find(system: System, has_contacts: bool) -> NarrowArguments | None:
    """The arguments of a system; None where there are none, or too many. has_contacts: of closed one-sided rows too."""
    s, rows = system.symbols, system.rows
    inputs = [s.t, s.q, s.v, system.p]
    moving = [system.dynamics.jacobi, system.dynamics.driving, system.f, rows.B, rows.b]
    if has_contacts:
        moving += [system.contacts.g, system.contacts.G]
    value = ca.densify(ca.vertcat(*(ca.vec(ca.SX(each).nz[:]) for each in moving)))
    if SizedFunction("moving", inputs, [value]).n_instructions() > MOST_STEPS:
        return None
    found: dict[int, tuple[ca.SX, _Kind]] = {}

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        row, u, kind = operation_graph.FUNCTIONS.get(op), None, (0.0, 1.0, True)
        if switches.is_comparing(op):
            u = switches.comparison(op, parts)
        elif row is not None and row.arguments == 1 and row.far in ("narrow", "exponential"):
            u, kind = parts[0], (1.0, 0.0, True)
        elif op in (ca.OP_DIV, ca.OP_INV) and parts[-1].op() not in _POWERS:  # of which the base is looked at
            u, kind = parts[-1], (0.0, 1.0, False)
        elif op in _POWERS and parts[1].is_constant():
            u, kind = parts[0], (0.0, 1 / max(1.0, abs(float(parts[1]))), False)
        if u is not None:
            _, (absolute, relative, crosses) = found.get(u.element_hash(), (u, kind))
            # The unit of an argument whose functions are of both kinds is that of a number.
            unit = (absolute, min(relative, kind[1])) if absolute == kind[0] else (1.0, 0.0)
            found[u.element_hash()] = u, (*unit, crosses or kind[2])
        return result

    operation_graph.replayed(value, inputs, visit)
    every = ca.vertcat(ca.SX(0, 1), *(u for u, _ in found.values()))
    if not every.numel():
        return None
    of_place = np.array(ca.which_depends(every, s.q, 1, True)) & ~np.array(
        ca.which_depends(every, s.v, 1, True)
    )
    chosen = np.flatnonzero(of_place)
    if not 0 < chosen.size <= MOST_OPERATIONS:
        return None
    kinds = [list(found.values())[k][1] for k in chosen]
    absolute, relative, crosses = (np.array(each) for each in zip(*kinds, strict=True))
    u, n = every[chosen.tolist()], s.q.numel()
    y = ca.SX.sym("y", 2 * n + 1)
    slope = ca.jtimes(u, ca.vertcat(s.t, s.q), ca.vertcat(1, s.v))
    outputs = [ca.densify(x) for x in ca.substitute([u, slope], [s.q, s.v], [y[:n], y[n : 2 * n]])]
    values = SizedFunction("narrow_arguments", [s.t, y, system.p], outputs)
    waves, piece = _waves(absolute, relative), _piece(absolute, relative, crosses.astype(float))
    # The pieces of a step before and after a point within it.
    x = PARAMETERS.inner
    t, h, p = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("p", system.p.numel())
    y, k, new, k_new = (ca.SX.sym(name, 2 * n + 1) for name in ("y", "k", "new", "k_new"))
    states = (0.0, y), (x, _cubic(y, h * k, new, h * k_new)), (1.0, new)
    looked = [values(t + at * h, state, p) for at, state in states]
    (u, slope), (inner, inner_slope), (end, end_slope) = [(value, h * rate) for value, rate in looked]
    passes = waves(u, slope, inner, end, end_slope, PARAMETERS.units)
    for ends in (
        (u, x * slope, inner, x * inner_slope),
        (inner, (1 - x) * inner_slope, end, (1 - x) * end_slope),
    ):
        vanishes, turns = piece(*ends, PARAMETERS.units)
        passes += vanishes + turns
    passing = SizedFunction("passes", [t, h, y, k, new, k_new, p], [ca.sum1(passes)])
    return NarrowArguments(absolute, relative, values, piece, waves, passing)


def _cubic(u: ca.SX, slope: ca.SX, end: ca.SX, end_slope: ca.SX) -> ca.SX:
    """The cubic with these values and slopes at 0 and 1, at `inner`."""
    x = PARAMETERS.inner
    return u + x * x * (3 - 2 * x) * (end - u) + x * (1 - x) * ((1 - x) * slope - x * end_slope)


def _piece(absolute: Floats, relative: Floats, crosses: Floats) -> ca.Function:
    u, slope, end, end_slope = ends = [
        ca.SX.sym(name, len(absolute)) for name in ("u", "s", "u_end", "s_end")
    ]
    units = ca.SX.sym("units")
    vanishes = ca.logic_and(crosses * u * end < 0, ca.fabs(end - u) > units * absolute)
    # The parabola with these slopes turns there, and a corner where lines with them meet: the turn is between it and
    # the nearer end.
    turn = u + slope * slope / (slope - end_slope) / 2
    change = ca.fmax(ca.fabs(u - turn), ca.fabs(end - turn))
    corner = u + slope * (end - end_slope - u) / (slope - end_slope)
    near = ca.if_else(ca.fabs(u - corner) < ca.fabs(end - corner), u, end)
    least = (near * corner > 0) * ca.fmin(ca.fabs(near), ca.fabs(corner))
    unit = absolute + relative * least
    # A step may begin or end at the flat top of a feature.
    is_at_end = ca.logic_and(units > 0, ca.fmin(ca.fabs(u - turn), ca.fabs(end - turn)) < unit)
    turns = ca.logic_or(slope * end_slope < 0, is_at_end)
    return SizedFunction("piece", [*ends, units], [vanishes, ca.logic_and(turns, change > units * unit)])


def _waves(absolute: Floats, relative: Floats) -> ca.Function:
    names = ("u", "s", "u_in", "u_end", "s_end")
    u, slope, inner, end, end_slope = inputs = [ca.SX.sym(name, len(absolute)) for name in names]
    units = ca.SX.sym("units")
    change = ca.fmax(ca.fabs(inner - u), ca.fabs(end - inner))
    is_off = ca.fabs(inner - _cubic(u, slope, end, end_slope)) > PARAMETERS.misfit * change
    least = ca.fmax(0, ca.fmin(ca.fmin(ca.fabs(u), ca.fabs(inner)), ca.fabs(end)) - change)
    is_large = change > units * (absolute + relative * least)
    return SizedFunction("waves", [*inputs, units], [ca.logic_and(is_off, is_large)])
