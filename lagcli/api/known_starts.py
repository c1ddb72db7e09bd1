"""Consistent starts that were found for some values, for others that inertia and rows do not tell apart."""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Callable

from lagcli.compiled import NumericSystem
from lagcli.equations import row_parameters, system
from lagcli.start import assembly, initial

Start = tuple[initial.State, assembly.Assembly | None]
Examine = Callable[[system.System, NumericSystem, initial.State], Start]


class KnownStarts:
    """The starts of one text that were found consistent or were assembled, by what they depend on.

    Assembly and the look at the residuals ask inertia, rows and contacts, the duration of the run and the settings of
    assembly, and nothing else: with another weight or another spring the same start is found, to the bit.
    """

    MOST = 64  # that are kept: the inner one of two loops over values comes again for each value of the outer

    def __init__(self, built: system.System) -> None:
        self._places = row_parameters.of_start(built)
        self._found: OrderedDict[tuple[object, ...], Start] = OrderedDict()

    def at(
        self, built: system.System, numeric: NumericSystem, start: initial.State, examine: Examine
    ) -> Start:
        """The consistent start of a declared one. Raises `diagnostics.ModelError` where `examine` does."""
        chosen = built.model.simulation
        parts = start.q.tobytes(), start.v.tobytes(), start.p[self._places].tobytes()
        key = (start.t, *parts, chosen.duration, chosen.assemble, chosen.keep)
        known = self._found.get(key)
        if known is None:
            known = self._found[key] = examine(built, numeric, start)
            while len(self._found) > self.MOST:
                self._found.popitem(last=False)
        state, moved = known
        return dataclasses.replace(state, p=start.p), None if moved is None else _with_numbers(moved, start)


def _with_numbers(moved: assembly.Assembly, start: initial.State) -> assembly.Assembly:
    """The assembly with other numbers, of which it depends on none."""
    state = dataclasses.replace(moved.state, p=start.p)
    return dataclasses.replace(moved, state=state, declared=start)
