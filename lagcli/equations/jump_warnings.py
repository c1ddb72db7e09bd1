"""Warnings of holonomic rows and of gaps that jump: by `sign`, or where a divisor goes through zero."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from lagcli.equations import energy_jumps, jump_search, jump_switches
from lagcli.equations import system as mechanics
from lagcli.equations.rows import Row
from lagcli.equations.system import System
from lagcli.errors import diagnostics

# Angles have a warning of their own, `branch-cut`.
_ANGLES = ("atan", "atan2")
HINT = "write each surface as a condition of its own, or a step of finite width, as `tanh(x/w)`"


def warnings(built: System) -> tuple[diagnostics.Diagnostic, ...]:
    """One warning for each condition of `inequality` and each holonomic row that is found to jump near the start."""
    found = []
    for row, word in _jumping(built, built.contacts.rows, built.contacts.g):
        told = f"the one-sided constraint `{row.name}` jumps where {energy_jumps.PHRASES[word]}"
        found.append(diagnostics.Diagnostic("condition-jumps", told, row.location, HINT, "warning"))
    for row, word in _jumping(built, built.rows.rows[: built.holonomic_count], built.rows.f):
        told = f"the row `{row.name}` jumps where {energy_jumps.PHRASES[word]}; a run that gets there stops"
        found.append(diagnostics.Diagnostic("row-jumps", told, row.location, HINT, "warning"))
    return tuple(found)


def _jumping(built: System, rows: Sequence[Row], values: ca.SX) -> Iterator[tuple[Row, str]]:
    """A member of each declared law that jumps, and the function by which it does. values: (len(rows), 1)."""
    dense = ca.densify(values)
    laws: dict[diagnostics.Location, list[int]] = {}
    for j, row in enumerate(rows):
        laws.setdefault(row.location, []).append(j)
    for members in laws.values():
        spread = np.linspace(0, len(members) - 1, min(len(members), energy_jumps.MEMBERS))
        for j in np.unique(spread.round().astype(int)).tolist():
            word = next(_words(built, dense[members[j]]), None)
            if word is not None:
                yield rows[members[j]], word
                break


def _words(built: System, value: ca.SX) -> Iterator[str]:
    """The functions by which a gap or f (1, 1) jumps, as far as places where they do are come upon."""
    s = built.symbols
    inputs = [s.t, s.q, s.v, built.p]
    switches = [one for one in jump_switches.of(value, inputs) if one.word not in _ANGLES]
    if not switches:
        return
    place = built.model.simulation.start, *mechanics.start(built.model)
    begin, whole = jump_search.starts(place, mechanics.values(built)), jump_search.Local(value, inputs)
    for switch in jump_switches.examples(switches, energy_jumps.SWITCHES):
        if jump_search.jumps(whole, switch.argument, inputs, begin):
            yield switch.word
