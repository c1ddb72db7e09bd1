"""Tell if a motion from a start is unique: forces, inertia and rows of (D.24) must be Lipschitz there."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import decompositions
from lagcli.smoothness import named_functions
from lagcli.start import initial, projection
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


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
    n = state.q.size
    size = initial.size(state.q)
    speed = float(np.abs(state.v).max(initial=0.0)) or size / (system.model.simulation.duration or 1.0)
    size_of_all = n + numeric.inertia.nnz_out(0) + numeric.rows.nnz_out(0) + numeric.rows.size1_out(1)
    count = 3 if size_of_all < 100_000 else 1  # of many it takes seconds
    ways = list(decompositions.generic_direction(count * 2 * n, 0).reshape(count, 2 * n))
    if not _may_grow(numeric, state, [np.repeat((size, speed), n) * way for way in ways]):
        return ()
    here = _values(numeric, state, state.q[:, None], state.v[:, None])[0]
    scale, growing = np.abs(here), np.zeros(here.size, dtype=bool)
    for way in ways:
        for side in (1.0, -1.0):
            # All distances at once: most of the time of a call goes by before and after it. The first one, over which
            # a function is smooth, gives the scale of its changes.
            steps = side * np.multiply.outer(way, (projection.PARAMETERS.offset, *DISTANCES))
            q, v = state.q[:, None] + size * steps[:n], state.v[:, None] + speed * steps[n:]
            changes = np.abs(_values(numeric, state, q, v) - here)
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                scale = np.fmax(scale, changes[0])
                slopes = changes[1:] / DISTANCES[:, None]
                ratios = slopes[1:] / slopes[:-1]
                is_rounding = changes[2:] <= doubles.ZERO * scale
                # The shortest distance alone may be one over which no change is seen.
                growing |= ((ratios > PARAMETERS.grows) & ~is_rounding)[:-1].all(axis=0) & (
                    (ratios[-1] > PARAMETERS.grows) | is_rounding[-1]
                )
    if not growing.any():
        return ()
    index, names, M, B = (
        int(np.argmax(growing)),
        system.model.coordinate_names,
        system.dynamics.M,
        system.rows.B,
    )
    entries = [
        *M.sparsity().row(),
        *(n + row for row in B.sparsity().row()),
        *range(n, n + len(system.rows.rows)),
    ]
    if index < n:
        what, location = f"the force along `{names[index]}`", system.model.location(names[index])
        expressions = list(system.model.force_expressions())
        if len(expressions) == 1:
            location = expressions[0].location
    elif entries[index - n] < n:
        name = names[entries[index - n]]
        what, location = f"the inertia of `{name}`", system.model.location(name)
    else:
        row = system.rows.rows[entries[index - n] - n]
        what, location = f"the gradient of the constraint `{row.name}`", row.location
    message = (
        f"{what} is not Lipschitz at the start, where its slope has no bound: the motion from there need not be"
        " unique (D.24), and a run gives one of those that exist"
    )
    hint = "start beside that point, or write the law without the infinite slope"
    return (diagnostics.Diagnostic("not-lipschitz", message, location, hint, "warning"),)


def _may_grow(numeric: NumericSystem, state: State, ways: list[Floats]) -> bool:
    """True if a slope grows from the longest distance to the next on any of the ways (2n,): where none does, as nearly
    always, the others need not be looked at."""
    n = state.q.size
    t, y, p = np.array([state.t]), np.concatenate([state.q, state.v]), np.array(state.p, dtype=float)
    q, v = y[:n], y[n:]
    calls = [
        BoundFunction(function, [t, q, v, p], wanted=wanted, is_sparse=True)
        for function, wanted in ((numeric.force, 1), (numeric.inertia, 1), (numeric.rows, 2))
    ]

    def values(distance: float, way: Floats) -> Floats:
        y[:n], y[n:] = state.q, state.v
        y[:] += distance * way
        for call in calls:
            call.trigger()
        return np.concatenate([part for call in calls for part in call.results])

    long, short = DISTANCES[:2].tolist()
    here = values(0.0, ways[0])
    floor = doubles.ZERO * np.abs(here)
    with np.errstate(invalid="ignore", over="ignore"):
        for way in ways:
            for side in (1.0, -1.0):
                far, near = (np.abs(values(side * distance, way) - here) for distance in (long, short))
                if ((near * (long / short) > PARAMETERS.grows * far) & ~(near <= floor)).any():
                    return True
    return False


def _values(numeric: NumericSystem, state: State, q: Floats, v: Floats) -> Floats:
    """h (n,), the entries of M, of B and b (C,) at the time of a state, beside one another for each of the columns
    of q and v (n, k): (k, entries)."""
    at, count = (state.t, q, v, state.p), q.shape[1]
    h, *_ = numeric.force(*at)
    M, (B, b) = numeric.inertia(*at), numeric.rows(*at)
    # Not as lists of numbers: a million particles have millions of entries. Those of each column follow one another.
    entries = [part.nz[:].full().reshape(count, -1) for part in (M, B)]
    return np.concatenate([h.full().T, *entries, b.full().T], axis=1)
