"""The kind of motion that a start belongs to: rest, a steady motion, or neither.

A steady motion here is q + v s + a s^2 / 2 with constant v + a s, a and lambda, along which the linear equations stay
the same. That it is one is looked at over the duration of the run.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.linearization.linearized import Linear, LinearizedFunctions, Reference

Floats = npt.NDArray[np.float64]
Kind = Literal["equilibrium", "steady", "varying"]

# What is left of forces in balance, as a part of the largest: at 1e-10 and at 1e-12
# `test_forces_balance_where_a_part_of_rounding_is_left` fails.
BALANCED = 1e-11
# The same along a path, where positions have roundings of their own; entries of matrices that stay the same.
PATH_ROUNDOFF, SAME = 1e-9, 1e-9
# Speeds that would lead no farther than this part of the configuration in the time of the run are none: at 1e-13
# `test_what_leads_nowhere_in_the_time_of_the_run_is_at_rest` of `tests/unit/test_numbers_of_linear_equations.py` fails.
RESTING = 1e-12
# Parts of the duration at which the path is looked at: no common period.
PATH_PARTS = (0.0173, 0.1379, 0.3813, 0.7071, 1.0)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Steady:
    """A reference motion: `varying` where it goes on as it is and its linear equations depend on t."""

    kind: Kind
    here: Reference
    linear: Linear


def is_at_rest(q: Floats, v: Floats, duration: float) -> bool:
    """True if the velocities are zero or rounding."""
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    return float(np.abs(v).max(initial=0.0)) * duration <= RESTING * size


def is_balanced(linear: Linear, part: float = BALANCED) -> bool:
    """True if the forces of a reference, which are finite, balance each other."""
    largest = float(linear.load.max(initial=0.0))
    return float(np.abs(linear.residual).max(initial=0.0)) <= part * largest < math.inf


def classified(
    functions: LinearizedFunctions, numeric: NumericSystem, here: Reference, duration: float
) -> Steady | None:
    """The steady motion that a consistent state is an instant of, or None. duration: over which it is looked at."""
    resting = is_at_rest(here.q, here.v, duration)
    if resting:
        still = dataclasses.replace(here, v=np.zeros_like(here.v), a=np.zeros_like(here.a))
        linear = functions.at(still)
        if is_balanced(linear):
            return _lasting(functions, numeric, Steady("equilibrium", still, linear), duration)
    here = dataclasses.replace(here, a=_without_rounding(functions, here))
    return _lasting(functions, numeric, Steady("steady", here, functions.at(here)), duration)


def at_rest(
    functions: LinearizedFunctions, numeric: NumericSystem, here: Reference, duration: float
) -> Steady:
    """A point of rest that was found, `varying` where its linear equations depend on t."""
    found = Steady("equilibrium", here, functions.at(here))
    if not numeric.has_time:
        return found
    later = (functions.at(moved(here, part * duration)).values for part in PATH_PARTS)
    same = all(_is_same(found.linear.values, values) for values in later)
    return found if same else dataclasses.replace(found, kind="varying")


def _without_rounding(functions: LinearizedFunctions, here: Reference) -> Floats:
    """The accelerations of a reference, 0 where its forces balance each other."""
    still = dataclasses.replace(here, a=np.zeros_like(here.q))
    return still.a if is_balanced(functions.at(still)) else functions.acceleration(here)


def _lasting(
    functions: LinearizedFunctions, numeric: NumericSystem, found: Steady, duration: float
) -> Steady | None:
    """The motion with its kind, or None where it does not go on as it is."""
    here, values = found.here, found.linear.values
    if found.kind == "equilibrium" and not numeric.has_time:
        return found
    same = True
    for part in PATH_PARTS:
        later = moved(here, part * duration)
        if not (_on_rows(numeric, later) and _beside_contacts(functions, numeric, later)):
            return None
        linear = functions.at(later)
        if not np.isfinite(linear.values).all() or not is_balanced(linear, PATH_ROUNDOFF):
            return None
        same = same and _is_same(values, linear.values)
    return found if same else dataclasses.replace(found, kind="varying")


def moved(here: Reference, s: float) -> Reference:
    """The reference a time s later, where its motion goes on as it is."""
    with np.errstate(over="ignore", invalid="ignore"):  # beyond all doubles the motion is none
        q = here.q + here.v * s + here.a * (s * s / 2)
        return dataclasses.replace(here, t=here.t + s, q=q, v=here.v + here.a * s)


def _on_rows(numeric: NumericSystem, here: Reference) -> bool:
    """True if a state satisfies the rows."""
    f, B_holonomic = numeric.holonomic(here.t, here.q, here.p)
    B, b = numeric.rows(here.t, here.q, here.v, here.p)[:2]
    left = [np.array(f).ravel(), np.array(B @ here.v).ravel() + np.array(b).ravel()]
    terms = [
        np.abs(np.array(B_holonomic)) @ (np.abs(here.q) + 1.0),
        np.abs(np.array(B)) @ np.abs(here.v) + np.abs(np.array(b).ravel()),
    ]
    return all(bool((np.abs(x) <= PATH_ROUNDOFF * size).all()) for x, size in zip(left, terms, strict=True))


def _beside_contacts(functions: LinearizedFunctions, numeric: NumericSystem, here: Reference) -> bool:
    """True if a state is on the allowed side of the contacts that are no rows: one that closes ends the motion."""
    g, G = (np.array(part) for part in numeric.contacts(here.t, here.q, here.v, here.p)[:2])
    others = [j for j in range(len(g)) if j not in functions.closed]
    size = np.abs(G[others]) @ (np.abs(here.q) + 1.0)
    return not bool((g.ravel()[others] < -PATH_ROUNDOFF * size).any())


def _is_same(one: Floats, other: Floats) -> bool:
    size = float(np.abs(one).max(initial=0.0))
    with np.errstate(invalid="ignore"):  # infinite ones are no number apart
        return bool((np.abs(one - other) <= SAME * size).all())
