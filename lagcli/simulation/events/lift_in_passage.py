"""Closed contacts along a step across a singular configuration: the first place at which one would have to pull.

Multipliers may have a pole at the instant, where they change their sign without a zero: a contact whose multiplier
grows beyond all bounds before it and pulls behind it opens at the instant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli.contact import zero_search
from lagcli.simulation.events.passage_watch import PassageWatch
from lagcli.simulation.events.state_ahead import FixedAhead
from lagcli.simulation.events.watch_functions import WatchFunctions
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure

Floats = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

# Parts of the step before the instant, and of that behind it, at which multipliers are looked at: at the instant they
# have no values.
PARTS = (0.25, 0.5, 0.75, 1.0)


class Lift(NamedTuple):
    """x: the fraction of the step; places: of the functions of contacts that open there; beyond: a fraction behind it
    at which they pull."""

    x: float
    places: Places
    beyond: float


def first(curve: PassageWatch, functions: WatchFunctions, rounding: Floats) -> Lift | None:
    """The first lift of the closed contacts among the functions (W,) that are watched, with their rounding (W,)."""
    instant, opened = curve.instant, len(functions.open_)
    if not (functions.held and instant > 0):
        return None
    places = np.arange(opened, opened + len(functions.held))
    noise = rounding[places]
    before = [0.0, *(part * instant for part in PARTS[:-1])]
    behind = [instant + part * (1.0 - instant) for part in PARTS]
    last = before[0]
    for x in (*before[1:], *behind):
        pulls = curve.inside(x)[0][places] < -noise
        if pulls.any():
            if x == behind[0]:
                return Lift(instant, places[pulls], x)
            return _between(curve, places, noise, (last, x)) or Lift(x, places[pulls], x)
        last = x
    return None


def end(curve: PassageWatch, lift: Lift) -> FixedAhead:
    """End the step at a lift; the state behind it. Raises `StepFailure` where there is no state on the constraints."""
    before = None
    if lift.x == curve.instant:
        before = curve.end_at_instant()
    elif not curve.end_at(lift.x):
        raise StepFailure("a contact opens where a singular configuration is passed", run_stop.CONTACT)
    return curve.ahead(lift.beyond, before)


def _between(curve: PassageWatch, places: Places, noise: Floats, span: tuple[float, float]) -> Lift | None:
    begin, width = span[0], span[1] - span[0]

    def values(u: float) -> tuple[Floats, Floats]:
        w, slope = curve.inside(begin + u * width)
        return w[places], slope[places] * width

    crossing = zero_search.first_crossing(values, noise)
    if crossing.x is None:
        return None
    return Lift(begin + crossing.x * width, places[list(crossing.rows)], span[1])
