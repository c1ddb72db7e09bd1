"""The kind of motion that a start belongs to: rest, a steady motion, or neither.

A steady motion here is q + v s + a s^2 / 2 with constant v + a s, a and lambda, along which the linear equations stay
the same. That it is one is looked at over the duration of the run.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Literal

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.linear import decompositions
from lagcli.linearization import spectrum
from lagcli.linearization.linearized import Linear, LinearizedFunctions, Reference

Kind = Literal["equilibrium", "steady", "varying"]

# Parts of the duration at which the path is looked at.
PATH_PARTS = decompositions.generic_parts(5)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Steady:
    """A reference motion: `varying` where it goes on as it is and its linear equations depend on t."""

    kind: Kind
    here: Reference
    linear: Linear


def is_at_rest(q: Floats, v: Floats, duration: float) -> bool:
    """True if the velocities are zero or rounding."""
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    return float(np.abs(v).max(initial=0.0)) * duration <= doubles.VALUE * size


def is_balanced(linear: Linear, least: float = 0.0) -> bool:
    """True if forces, over the roots of their masses, are finite and balance but for the acceleration `least`."""
    with np.errstate(all="ignore"):  # what is no number is none of balance
        load, left = (np.linalg.norm(each / linear.inertia) for each in (linear.load, linear.residual))
    return bool(left <= doubles.ZERO * load + least < math.inf)


def classified(
    functions: LinearizedFunctions, numeric: NumericSystem, here: Reference, duration: float
) -> Steady | None:
    """The steady motion that a consistent state is an instant of; None where it does not go on so over a duration."""
    kind: Kind = "steady"
    if is_at_rest(here.q, here.v, duration):
        still = dataclasses.replace(here, v=np.zeros_like(here.v), a=np.zeros_like(here.a))
        linear = functions.at(still)
        if is_balanced(linear):
            kind, here = "equilibrium", still
    if kind == "steady":
        # The accelerations, 0 where the forces balance each other
        still = dataclasses.replace(here, a=np.zeros_like(here.q))
        linear = functions.at(still)
        balanced = is_balanced(linear, _least(linear, here, duration))
        here = still if balanced else dataclasses.replace(here, a=functions.acceleration(here))
        linear = functions.at(here)
    elif not numeric.has_time:
        return Steady(kind, here, linear)
    same, least = True, _least(linear, here, duration)
    for part in PATH_PARTS:
        there = moved(here, part * duration)
        if not functions.is_on_rows(there):
            return None
        later = functions.at(there)
        if not np.isfinite(later.values).all() or not is_balanced(later, least):
            return None
        same = same and is_same(linear, later, duration)
    return Steady(kind if same else "varying", here, linear)


def at_rest(
    functions: LinearizedFunctions, numeric: NumericSystem, here: Reference, duration: float
) -> Steady:
    """A point of rest that was found, `varying` where its linear equations depend on t."""
    found = Steady("equilibrium", here, functions.at(here))
    if not numeric.has_time:
        return found
    later = (functions.at(moved(here, part * duration)) for part in PATH_PARTS)
    same = all(is_same(found.linear, linear, duration) for linear in later)
    return found if same else dataclasses.replace(found, kind="varying")


def _least(linear: Linear, here: Reference, duration: float) -> float:
    """An acceleration that changes the velocities by their rounding in the time of the run."""
    return doubles.VALUE * float(np.linalg.norm(linear.inertia * here.v)) / duration


def moved(here: Reference, s: float) -> Reference:
    """The reference a time s later, where its motion goes on as it is."""
    with np.errstate(over="ignore", invalid="ignore"):  # beyond all doubles the motion is none
        q = here.q + here.v * s + here.a * (s * s / 2)
        return dataclasses.replace(here, t=here.t + s, q=q, v=here.v + here.a * s)


def is_same(one: Linear, other: Linear, duration: float) -> bool:
    """True if two linear equations, which are finite, differ by rounding of the largest in each row.

    Where a row is all rounding the largest of its matrix, or else one turn in the time of the run, tells its size.
    """
    for (entries, row, order), (others, _, _) in zip(one.in_units(one), other.in_units(one), strict=True):
        if entries.shape != others.shape:  # a leaf has lost its gradient
            return False
        largest = np.zeros(int(row.max(initial=-1)) + 1)
        np.maximum.at(largest, row, np.abs(entries))
        floor = spectrum.floor(len(largest)) * largest.max(initial=0.0)
        least = floor + doubles.VALUE * (1 / duration) ** order
        with np.errstate(invalid="ignore"):  # infinite ones are no number apart
            if not (np.abs(entries - others) <= doubles.ZERO * largest[row] + least).all():
                return False
    return True
