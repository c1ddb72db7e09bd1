"""Tell if a motion from a start is unique: forces, inertia and rows of (D.24) must be Lipschitz there."""

from __future__ import annotations

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import decompositions
from lagcli.smoothness import named_functions
from lagcli.start import initial, projection
from lagcli.start.initial import State


class LipschitzParameters:
    """Slopes without a bound. The tests are of `tests/unit/test_start_thresholds.py`."""

    __slots__ = ()

    grows: float = 1.3
    """They grow by this each time the distance shrinks by a hundred. Those of |x|^a grow by 100^(1 - a): up to a = 0.94
    it shows (`test_slopes_that_grow_without_bound_are_warned_of`)."""


PARAMETERS = LipschitzParameters()
# Distances from the start over which slopes are compared, as parts of its size, each a hundredth of the one before
DISTANCES = np.geomspace(doubles.ROOT, doubles.VALUE, 4)


def warnings(system: System, numeric: NumericSystem, state: State) -> tuple[diagnostics.Diagnostic, ...]:
    """A warning for the first force, inertia or row whose slope has no bound at a state, or nothing."""
    named = (expression.words for expression in named_functions.expressions(system.model))
    if not state.q.size or all(named_functions.NOT_SMOOTH.isdisjoint(words) for words in named):
        return ()
    index = _growing(numeric, state, system.model.simulation.duration or 1.0)
    if index is None:
        return ()
    names = system.model.coordinate_names
    of_forces, of_inertia = (function.sparsity_out(0).row() for function in (numeric.force, numeric.inertia))
    of_rows = [*numeric.rows.sparsity_out(0).row(), *numeric.rows.sparsity_out(1).row()]
    if index < len(of_forces):
        name = names[of_forces[index]]
        what, location = f"the force along `{name}`", system.model.location(name)
        expressions = list(system.model.force_expressions())
        if len(expressions) == 1:
            location = expressions[0].location
    elif (index := index - len(of_forces)) < len(of_inertia):
        name = names[of_inertia[index]]
        what, location = f"the inertia of `{name}`", system.model.location(name)
    else:
        row = system.rows.rows[of_rows[index - len(of_inertia)]]
        what, location = f"the gradient of the constraint `{row.name}`", row.location
    message = (
        f"{what} is not Lipschitz at the start, where its slope has no bound: the motion from there need not be"
        " unique (D.24), and a run gives one of those that exist"
    )
    hint = "start beside that point, or write the law without the infinite slope"
    return (diagnostics.Diagnostic("not-lipschitz", message, location, hint, "warning"),)


def _growing(numeric: NumericSystem, state: State, duration: float) -> int | None:
    """The first entry of h, M, B and b, each by its pattern, whose slope has no bound at a state; None where none."""
    n, size = state.q.size, initial.size(state.q)
    speed = float(np.abs(state.v).max(initial=0.0)) or size / duration
    t, y, p = np.array([state.t]), np.concatenate([state.q, state.v]), np.array(state.p, dtype=float)
    q, v = y[:n], y[n:]
    calls = [
        BoundFunction(function, [t, q, v, p], wanted=wanted, is_sparse=True)
        for function, wanted in ((numeric.force, 1), (numeric.inertia, 1), (numeric.rows, 2))
    ]

    def values(step: Floats | float = 0.0) -> Floats:
        y[:n], y[n:] = state.q, state.v
        y[:] += step
        for call in calls:
            call.trigger()
        return np.concatenate([part for call in calls for part in call.results])

    here = values()
    count = 3 if here.size < 100_000 else 1  # of many it takes seconds
    lines = decompositions.generic_direction(count * 2 * n, 0).reshape(count, 2 * n)
    ways = [side * np.repeat((size, speed), n) * line for line in lines for side in (1.0, -1.0)]
    scale, growing = np.abs(here), np.zeros(here.size, dtype=bool)

    def changes(way: Floats, distances: Floats) -> Floats:
        return np.array([np.abs(values(distance * way) - here) for distance in distances])

    def grow(changes: Floats, distances: Floats) -> Flags:
        slopes = changes / distances[:, None]
        return np.asarray(slopes[1:] > PARAMETERS.grows * slopes[:-1])

    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        # Where no slope grows from the longest distance to the next, as nearly always, the others are not looked at.
        first = DISTANCES[:2]
        for way in ways:
            seen = changes(way, first)
            if (grow(seen, first)[0] & ~(seen[1] <= doubles.ZERO * np.abs(here))).any():
                break
        else:
            return None
        for way in ways:
            # Over the offset a function is smooth: that gives the scale of its changes.
            scale = np.fmax(scale, changes(way, np.array([projection.PARAMETERS.offset]))[0])
            seen = changes(way, DISTANCES)
            is_growing, is_rounding = grow(seen, DISTANCES), seen[1:] <= doubles.ZERO * scale
            # The shortest distance alone may be one over which no change is seen.
            growing |= (is_growing & ~is_rounding)[:-1].all(axis=0) & (is_growing[-1] | is_rounding[-1])
    return int(np.argmax(growing)) if growing.any() else None
