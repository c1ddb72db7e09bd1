"""Consistent starts that were found for some values, for others that inertia and rows do not tell apart."""

from __future__ import annotations

from collections import OrderedDict

from lagcli.compiled import NumericSystem
from lagcli.equations import row_parameters, size_limits
from lagcli.equations.system import System
from lagcli.start import consistent_start, initial
from lagcli.start.consistent_start import ConsistentStart


class KnownStarts:
    """The starts of one text that were found consistent or were assembled, by what they depend on.

    Assembly and the look at the residuals ask inertia, rows and contacts, the duration of the run and the settings of
    assembly, and nothing else: with another weight or another spring the same start is found, to the bit.
    """

    MOST = 64  # that are kept: the inner one of two loops over values comes again for each value of the outer

    def __init__(self, built: System) -> None:
        self._places = row_parameters.of_start(built)
        self._found: OrderedDict[tuple[object, ...], ConsistentStart] = OrderedDict()

    def find(self, built: System, numeric: NumericSystem) -> ConsistentStart:
        """The consistent start of a model. Raises `diagnostics.ModelError` where no run can begin."""
        size_limits.require_run(built)
        declared, chosen = initial.declared(built), built.model.simulation
        parts = declared.q.tobytes(), declared.v.tobytes(), declared.p[self._places].tobytes()
        key = (declared.t, *parts, chosen.duration, chosen.assemble, chosen.keep)
        known = self._found.get(key)
        if known is None:
            known = self._found[key] = consistent_start.find(built, numeric)
            while len(self._found) > self.MOST:
                self._found.popitem(last=False)
        return known.with_numbers(declared.p)
