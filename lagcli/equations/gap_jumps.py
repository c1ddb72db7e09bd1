"""Warnings of one-sided constraints whose gap jumps: by `sign`, or where a divisor goes through zero."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from lagcli.equations import energy_jumps, jump_search, jump_switches
from lagcli.equations import system as mechanics
from lagcli.equations.system import System
from lagcli.errors import diagnostics

# Angles have a warning of their own, `branch-cut`.
_ANGLES = ("atan", "atan2")
HINT = "write each surface as a condition of its own, or a step of finite width, as `tanh(x/w)`"


def warnings(built: System) -> tuple[diagnostics.Diagnostic, ...]:
    """One warning for each condition of `inequality` that is found to jump near the start."""
    rows = built.contacts.rows
    places: dict[diagnostics.Location, list[int]] = {}
    for j, row in enumerate(rows):
        places.setdefault(row.location, []).append(j)
    found = []
    for location, members in places.items():
        spread = np.linspace(0, len(members) - 1, min(len(members), energy_jumps.MEMBERS))
        for j in np.unique(spread.round().astype(int)).tolist():
            word = next(_words(built, ca.densify(built.contacts.g)[members[j]]), None)
            if word is not None:
                name = rows[members[j]].name
                told = f"the one-sided constraint `{name}` jumps where {energy_jumps.PHRASES[word]}"
                found.append(diagnostics.Diagnostic("condition-jumps", told, location, HINT, "warning"))
                break
    return tuple(found)


def _words(built: System, gap: ca.SX) -> Iterator[str]:
    """The functions by which a gap (1, 1) jumps, as far as places where they do are come upon."""
    s = built.symbols
    inputs = [s.t, s.q, s.v, built.p]
    switches = [one for one in jump_switches.of(gap, inputs) if one.word not in _ANGLES]
    if not switches:
        return
    place = built.model.simulation.start, *mechanics.start(built.model)
    begin, whole = jump_search.starts(place, mechanics.values(built)), jump_search.Local(gap, inputs)
    for switch in jump_switches.examples(switches, energy_jumps.SWITCHES):
        if jump_search.jumps(whole, switch.argument, inputs, begin):
            yield switch.word
