"""Where within a step a function of place that may be narrow has its feature: beside turns and zeros of its argument.

At the turn itself the force of a wall vanishes; it acts where the argument has left the turn by a part of a unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled import narrow_arguments
from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.compiled.narrow_arguments import NarrowArguments
from lagcli.contact import zero_search
from lagcli.simulation.scheme.bound_scheme import BoundStep

# The fraction x of a step -> the state (2n + 1,) there.
Curve = Callable[[float], Floats]


# A piece of a step in which an argument waves is cut so often in turn; halved steps down to which a way counts, 1e-11
# of a step.
CUTS, HALVES = 12, 36
# Part of a unit by which an argument has left its turn, or up to four times as much: there its function changes.
BESIDE = 0.125


class _Sample(NamedTuple):
    """All arguments at the fraction x of a step: values and slopes du/dx, (K,) each."""

    x: float
    u: Floats
    slope: Floats


class NarrowPlaces:
    """The places of features within the steps of a run, in the functions of one set of closed contacts."""

    def __init__(self, arguments: NarrowArguments, bound: BoundStep) -> None:
        self._arguments, self._h = arguments, bound.h
        values, passes = arguments.values, arguments.passes
        _, h, y, k, _, p = bound.arguments
        size = values.size1_in(2)
        t = np.zeros(1)
        self._values = BoundFunction(values, [np.zeros(1), np.zeros(y.size), p[:size]])
        self._passes = BoundFunction(passes, [t, h, y, k, bound.new, bound.k_new, p[:size]])
        self._t, self._passed = cells(t), cells(self._passes.results[0])

    def are_passed(self, t: float) -> bool:
        """True if the step to be taken from a time, which is no longer counted from the origin of a run, may lead over
        a feature."""
        self._t[0] = t
        self._passes.trigger()
        return self._passed[0] > 0.0

    def within(self, dense: Curve, end: float) -> Iterator[float]:
        """The fractions of the step at which features are felt, up to one of them. A dense output one of whose own
        stages has met a force leads elsewhere: then those on the cubic of the ends."""

        def cubic(x: float) -> Floats:
            _, h, y, k, new, k_new, _ = self._passes.arguments
            bend = (1 - x) * k - x * k_new
            return np.asarray(y + x * x * (3 - 2 * x) * (new - y) + h * x * (1 - x) * bend)

        for curve in (dense, cubic):
            found = False
            for x in self._features(curve, end):
                if 0.0 < x < end:
                    found = True
                    yield x
            if found:
                return

    def _features(self, curve: Curve, end: float) -> Iterator[float]:
        known, used = self._arguments, self._values.used

        def sample(x: float) -> _Sample:
            t, y, _ = self._values.arguments
            t[0], y[:] = self._t[0] + x * self._h[0], curve(x)
            self._values.trigger()
            self._values.used += 1
            u, rate = self._values.results
            return _Sample(x, u.copy(), self._h[0] * rate)

        every = np.ones(len(known.absolute), dtype=bool)
        pieces = [(sample(0.0), sample(end), every, CUTS)]
        while pieces and self._values.used - used < zero_search.PARAMETERS.most_evaluations:
            left, right, wanted, cuts = pieces.pop()
            width = right.x - left.x
            inner = sample(left.x + narrow_arguments.PARAMETERS.inner * width)
            ends = left.u, width * left.slope, inner.u, right.u, width * right.slope
            # A part of a wave is smaller than the wave.
            units = narrow_arguments.PARAMETERS.units if cuts == CUTS else 0.0
            waves = wanted & (np.array(known.waves(*ends, units)).ravel() > 0.0) & (cuts > 0)
            for a, b in ((inner, right), (left, inner)):
                if waves.any():
                    pieces.append((a, b, waves, cuts - 1))
            for a, b in ((left, inner), (inner, right)):
                width = b.x - a.x
                found = known.piece(a.u, width * a.slope, b.u, width * b.slope, units)
                vanishes, turns = (wanted & ~waves & (np.array(each).ravel() > 0.0) for each in found)
                for k in np.flatnonzero(vanishes | turns).tolist():
                    at = _found(sample, a, b, k, is_turn=bool(turns[k]))
                    unit = known.absolute[k] + known.relative[k] * abs(at.u[k]) * bool(turns[k])
                    # At the feature itself its force may vanish: a step that ends there would see none again.
                    before, behind = _beside(sample, at, k, BESIDE * unit)
                    yield from (before, at.x, behind)


def _found(sample: Callable[[float], _Sample], a: _Sample, b: _Sample, k: int, is_turn: bool) -> _Sample:
    """The turn or the zero of an argument between two samples, by secants that stay on both sides of it."""

    def height(of: _Sample) -> float:
        return float((of.slope if is_turn else of.u)[k])

    low, high = height(a), height(b)
    if (low > 0.0) == (high > 0.0):  # it turns at an end
        return a if abs(low) < abs(high) else b
    for _ in range(2 * HALVES):
        x = b.x - high * (b.x - a.x) / (high - low)
        if abs(x - b.x) < math.ldexp(1.0, -HALVES):
            break
        middle = sample(x)
        at = height(middle)
        a, low = (b, high) if (at > 0.0) != (high > 0.0) else (a, low / 2)
        b, high = middle, at
        if at == 0.0:
            break
    return b


def _beside(sample: Callable[[float], _Sample], at: _Sample, k: int, change: float) -> Iterator[float]:
    """The fractions before and behind a sample, the nearest of halved ways, at which an argument has changed by so
    much."""
    for side in (-1.0, 1.0):
        near, far = HALVES, 0 if change else HALVES - 1
        while near - far > 1:
            halves = (near + far) // 2
            changed = abs(sample(at.x + side * math.ldexp(1.0, -halves)).u[k] - at.u[k]) > change
            near, far = (near, halves) if changed else (halves, far)
        yield at.x + side * math.ldexp(1.0, -far)
