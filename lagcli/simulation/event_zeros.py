"""Declared events that are at zero where no search ends: at a switch of a function of t, and at the end of the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from lagcli.contact import zero_search
from lagcli.model.model import DeclaredEvent
from lagcli.simulation.step_watch import StepWatch
from lagcli.simulation.stepper import Stepper
from lagcli.simulation.watch_kinds import WatchKinds

Floats = npt.NDArray[np.float64]

# So many times its rounding from zero on both sides of a switch a declared function is at zero there; whether it
# crosses, values tell by this part of a step farther off.
TOUCHED, ASIDE = 4.0, 1e-5
# Roundings of time within which an incident is at the end of the run.
AT_END = 8.0


def at_switch(
    watch: StepWatch,
    run: Stepper,
    sides: tuple[Floats, Floats],
    jumped: Callable[[Floats, Floats], list[int]],
) -> tuple[list[int], list[int]]:
    """The events that cross zero, of those that are at zero on both sides, and all these, by their numbers.

    The next step would see no more than on which side rounding has put them. sides: values (E,) before and after;
    jumped: as `EventValues.jumped`.
    """
    before, after = sides
    E = before.size
    rounding, values = watch.rounding()[-E:], np.maximum(np.abs(before), np.abs(after))
    at_zero = np.flatnonzero(values <= TOUCHED * rounding)
    if not at_zero.size:
        return [], []
    aside = ASIDE * min(run.control.step, run.grid.end - run.grid.start)
    beside = watch.beside(run.found.reached, aside)[:, -E:]
    # At a pole there is nothing but rounding, and it shrinks with the distance.
    found = at_zero[(values <= np.abs(beside).max(axis=0))[at_zero]].tolist()
    crosses = jumped(*np.where(np.abs(beside) <= TOUCHED * rounding, 0.0, beside))
    return [number for number in crosses if number in found], found


def arriving(watch: StepWatch, run: Stepper, kinds: WatchKinds, events: Sequence[DeclaredEvent]) -> list[int]:
    """The events, by their numbers, that go through zero at the end of the run, to rounding of its time."""
    found = run.found
    begin = watch.inside(0.0)[0].copy()
    end, slope = watch.inside(1.0)
    room = np.abs(slope) / found.taken * AT_END * math.ulp(found.reached)
    arrives = (np.abs(end) <= room) & (begin * slope < 0) & (np.abs(begin) > room)
    arrives &= (kinds.direction == zero_search.BOTH) | (np.sign(slope) == kinds.direction)
    last = run.origin + found.reached - AT_END * math.ulp(found.reached)
    told = {incident.name for incident in found.within if incident.t >= last}
    numbers = kinds.numbers - kinds.first_event
    return [int(e) for e in numbers[arrives] if e >= 0 and events[e].name not in told]
