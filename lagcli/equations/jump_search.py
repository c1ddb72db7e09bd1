"""Places near a start at which a value jumps: where its switches change their sign, found by Newton's method."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations.family_columns import taken
from lagcli.frozen import frozen

Floats = npt.NDArray[np.float64]
# t, q and v.
Place = tuple[float, Floats, Floats]

# Bisections: an interval of the size of its ends has 53 bits.
HALVINGS = 60
# A value jumps where it differs across a switch by so many times what it changes by in the same distance, ASIDE of the
# way, on either side, and by more than its rounding.
ASIDE, ABRUPT, ROUNDED = 1e-9, 10.0, 1e-10
# Places of a switch are sought from so many points, of the size of the start, by so many steps of Newton's method.
POINTS, NEWTON, ON_SWITCH = 12, 30, 1e-9


def is_abrupt(values: Floats) -> npt.NDArray[np.bool_]:
    """True where values (4, ...) at 2 and 1 ASIDE before a switch, and as far behind it, jump there."""
    a, b, c, d = values
    least = np.maximum(ABRUPT * np.maximum(abs(b - a), abs(d - c)), ROUNDED * np.maximum(abs(b), abs(c)))
    return np.asarray(abs(c - b) > least)


@frozen
class Starts:
    """The points that places are sought from: q (n, S) at one t, v and p; size: of q."""

    t: float
    q: Floats
    v: Floats
    p: ca.DM
    size: float


def starts(place: Place, p: Floats) -> Starts:
    """A place, and points about it."""
    t, q, v = place
    random = np.random.default_rng(0)
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    speed = v + (float(np.abs(v).max(initial=0.0)) or 1.0) * random.standard_normal(v.size)
    points = np.vstack([q, q + size * random.standard_normal((POINTS, q.size))])
    return Starts(t, points.T, speed, ca.DM(p), size)


class Local:
    """A column of t, q, v and p as a function of those coordinates and rates that stand in it; moving: which these are.

    with_slopes: the column is a scalar, and its gradient by these coordinates follows.
    """

    def __init__(self, value: ca.SX, inputs: list[ca.SX], with_slopes: bool = False) -> None:
        t, q, v, p = inputs
        self.moving, self._rates = (np.flatnonzero(ca.which_depends(value, x, 1, False)) for x in (q, v))
        x = taken(q, self.moving)
        column = ca.vertcat(value, ca.gradient(value, x)) if with_slopes else value
        self._function = ca.Function("local", [t, x, taken(v, self._rates), p], [ca.densify(column)])

    def at(self, begin: Starts, x: Floats) -> Floats:
        """The column (k, S) at places x (m, S)."""
        return np.array(self._function(begin.t, x, begin.v[self._rates], begin.p))


def jumps(value: Local, argument: ca.SX, inputs: list[ca.SX], begin: Starts) -> bool:
    """True if a value (1, 1) jumps where the argument of a switch in it changes its sign, at one of the places that
    are come upon."""
    switch = Local(argument, inputs, with_slopes=True)
    with np.errstate(all="ignore"):
        numbers, centres, across = _places(switch, begin)
        if not numbers.size:
            return False
        low, high = np.zeros(numbers.size), np.ones(numbers.size)

        def place(part: Floats) -> Floats:
            return centres + (2 * part - 1) * across

        sign = np.sign(switch.at(begin, place(low))[0])
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            is_before = np.sign(switch.at(begin, place(middle))[0]) == sign
            low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
        at = begin.q[value.moving][:, numbers]
        own = np.searchsorted(value.moving, switch.moving)
        values = []
        for part in (low - 2 * ASIDE, low - ASIDE, high + ASIDE, high + 2 * ASIDE):
            at[own] = place(part)
            values.append(value.at(begin, at)[0])
        return bool(is_abrupt(np.array(values)).any())


def _places(switch: Local, begin: Starts) -> tuple[npt.NDArray[np.intp], Floats, Floats]:
    """The starts (A,) from which Newton's method comes upon a switch, the places (m, A), and ways across it there."""
    x = begin.q[switch.moving]
    slopes = np.zeros_like(x)
    is_going, is_there = np.ones(x.shape[1], dtype=bool), np.zeros(x.shape[1], dtype=bool)
    for _ in range(NEWTON):
        found = switch.at(begin, x)
        value, slope = found[0], found[1:]
        square = (slope * slope).sum(axis=0)
        is_going &= np.isfinite(value) & np.isfinite(square) & (square > 0)
        step = np.where(is_going, value / square * slope, 0.0)
        x = x - step
        arrived = is_going & (np.abs(step).max(axis=0) < ON_SWITCH * begin.size)
        slopes[:, arrived] = slope[:, arrived] / np.sqrt(square[arrived])
        is_there |= arrived
        is_going &= ~arrived
        if not is_going.any():
            break
    numbers = np.flatnonzero(is_there)
    return numbers, x[:, numbers], begin.size * ASIDE**0.5 * slopes[:, numbers]
