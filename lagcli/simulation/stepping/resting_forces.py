"""The size of forces that balance each other at the start of a run, where the system stays at rest.

Nothing in such a motion has a size but these forces, and where they cancel within an entry of h not even h has. Their
rounding is what is left, and no error of a step.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.linear import generic_direction
from lagcli.simulation.scheme.step_tolerance import UNIT
from lagcli.start import initial

# Places are moved by this part of their size, and h is balanced where it is this part of what it is beside.
BESIDE, BALANCED = 1e-3, 1e-9
# Forces that are less than this part of the terms that they are the sum of are stairs of rounding.
STAIRS = 1e-2


@dataclasses.dataclass(frozen=True, slots=True)
class RestingForces:
    """acceleration: that the largest term of h would make, in the units of `parts.Sizes`, 0 where the forces do not
    balance within h; energy: of the forces over the size of q; blurred: acceleration by the rounding of forces that
    depend on the time and cancel at first, else 0. All are 0 where the start moves."""

    acceleration: float
    energy: float
    blurred: float = 0.0


def of_start(system: System, numeric: NumericSystem) -> RestingForces:
    """The forces at the declared start."""
    state = initial.declared(system)
    t, q, v, p = state.t, state.q, state.v, state.p
    if not q.size or np.any(v):
        return RestingForces(0.0, 0.0)
    reach = BESIDE * (np.abs(q) + np.abs(q).max() + (not np.any(q)))
    aside = q + reach * generic_direction.signs(q.size)
    place = q.copy()
    sizes = BoundFunction(numeric.sizes, [np.array([t]), place, v.copy(), p.copy()])
    sizes.trigger()
    length, here = sizes.results[0][[q.size, -1]].tolist()
    place[:] = aside
    sizes.trigger()
    beside = float(sizes.results[0][-1])
    units = float(numeric.force_roundings(t, q, v, p)[-1]) if numeric.has_time else 0.0
    blurred = UNIT * units if here <= STAIRS * units < np.inf else 0.0
    if not here <= BALANCED * beside:
        return RestingForces(0.0, here * length if np.isfinite(here) else 0.0, blurred)
    found = float(numeric.term_sizes(t, q, v, p)[-1])
    found = found if np.isfinite(found) else 0.0
    return RestingForces(found, found * length, blurred)
