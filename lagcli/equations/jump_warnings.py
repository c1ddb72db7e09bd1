"""Warnings of rows, gaps, forces and potentials that jump: where they do, and what a run does there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from lagcli.equations import branch_cuts, energy_jumps
from lagcli.equations import system as mechanics
from lagcli.equations.rows import Row
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.expression import functions
from lagcli.smoothness import jump_search, named_functions

# Angles have a warning of their own, `branch-cut`.
_ANGLES = functions.named(lambda row: bool(row.period))
CUT_HINT = (
    "write the law with `cos` and `sin` of the angle, or with the angle as a coordinate: those have no cut"
)
ENERGY_HINT = (
    "write a force that is steep but finite, as from `tanh(x/w)`, or the torque of an angle as a force"
)
ROW_HINT = "write each surface as a condition of its own, or a step of finite width, as `tanh(x/w)`"


def warnings(built: System) -> tuple[diagnostics.Diagnostic, ...]:
    """The warnings of angles at their cuts, of energies, and of other rows and gaps, in this order. One for each
    constraint with an angle that jumps and one for the forces; one for each potential, Lagrangian or position with a
    jump; one for each condition of `inequality` and each holonomic row that is found to jump near the start."""
    return tuple(_found(built))


def _found(built: System) -> Iterator[diagnostics.Diagnostic]:
    if not all(named_functions.ANGLES.isdisjoint(e.words) for e in named_functions.expressions(built.model)):
        for location, message in _cuts(built).items():
            yield diagnostics.Diagnostic("branch-cut", message, location, CUT_HINT, "warning")
    if built.jumps is not None:
        state = built.model.simulation.start, *mechanics.start(built.model)
        for subject, word in built.jumps.anywhere(state, mechanics.values(built)):
            message = (
                f"{subject.description} jumps where {energy_jumps.PHRASES[word]}: the force there is an impulse, and a"
                " run that gets there stops"
            )
            yield diagnostics.Diagnostic("energy-jump", message, subject.location, ENERGY_HINT, "warning")
    for row, word in _jumping(built, built.contacts.rows, built.contacts.g):
        message = f"the one-sided constraint `{row.name}` jumps where {energy_jumps.PHRASES[word]}"
        yield diagnostics.Diagnostic("condition-jumps", message, row.location, ROW_HINT, "warning")
    for row, word in _jumping(built, built.rows.rows[: built.holonomic_count], built.rows.f):
        phrase = energy_jumps.PHRASES[word]
        message = f"the row `{row.name}` jumps where {phrase}; a run that gets there stops"
        yield diagnostics.Diagnostic("row-jumps", message, row.location, ROW_HINT, "warning")


def out_of_sight(built: System) -> tuple[str, ...]:
    """A sentence on rows that go on smoothly beyond a cut, where searches for points do not follow them."""
    cut = built.cuts
    passed = zip(cut.rows, cut.verdicts, strict=True) if cut else ()
    names = dict.fromkeys(
        f"`{built.rows.rows[i].name}`" for i, verdict in passed if verdict == branch_cuts.PASSED
    )
    if not names:
        return ()
    return (
        f"points beyond the cut of `atan2` or `atan` in {', '.join(names)} are not looked for: {CUT_HINT}",
    )


def _cuts(built: System) -> dict[diagnostics.Location, str]:
    """The messages of rows, one-sided constraints and the forces that jump at the cut of an angle."""
    found: dict[diagnostics.Location, str] = {}
    at_cut = "where `atan2` or `atan` crosses its cut"
    ends = {
        branch_cuts.PASSED: f"jumps by a constant {at_cut}; a run goes on smoothly there and counts the turns",
        branch_cuts.JUMPS: f"jumps {at_cut}; a run that gets there stops",
    }
    cut, first = built.cuts, built.holonomic_count
    verdicts = list(zip(cut.rows, cut.verdicts, strict=True)) if cut else []
    differential = built.rows.B[first:, :] @ built.symbols.v + built.rows.b[first:, :]
    verdicts += [(first + i, branch_cuts.JUMPS) for i in _at_cuts(built, ca.densify(differential))]
    for i, verdict in verdicts:
        if verdict in ends:
            row = built.rows.rows[i]
            found.setdefault(row.location, f"the row `{row.name}` {ends[verdict]}")
    for j in _at_cuts(built, ca.densify(built.contacts.g)):
        row = built.contacts.rows[j]
        found.setdefault(row.location, f"the one-sided constraint `{row.name}` jumps {at_cut}")
    model, names = built.model, built.model.coordinate_names
    hit = _at_cuts(built, ca.densify(ca.vertcat(built.dynamics.h, ca.vec(built.dynamics.M.nz[:]))))
    if hit:
        along = f"along `{names[hit[0]]}`" if hit[0] < len(names) else "of inertia"
        expressions = [*model.force_expressions(), *([] if model.lagrangian is None else [model.lagrangian])]
        expressions += [definition.expression for definition in model.definitions]
        location = next(
            (e.location for e in expressions if e.words & named_functions.ANGLES),
            diagnostics.Location(model.path, 1, 1),
        )
        message = f"the force {along} jumps {at_cut}; a run goes on with the force on the other side"
        found.setdefault(location, message)
    return found


def _at_cuts(built: System, value: ca.SX) -> list[int]:
    state = mechanics.start(built.model)[0]
    p = mechanics.values(built)
    return branch_cuts.jumping(
        value, built.symbols, built.p, (built.model.simulation.start, state, np.asarray(p))
    )


def _jumping(built: System, rows: Sequence[Row], values: ca.SX) -> Iterator[tuple[Row, str]]:
    """A member of each declared law that jumps, and the function by which it does. values: (len(rows), 1)."""
    dense = ca.densify(values)
    laws: dict[diagnostics.Location, list[int]] = {}
    for j, row in enumerate(rows):
        laws.setdefault(row.location, []).append(j)
    s, t = built.symbols, built.model.simulation.start
    near = (t, *mechanics.start(built.model)), mechanics.values(built)
    for members in laws.values():
        for j in (members[k] for k in jump_search.spread(len(members)).tolist()):
            word = jump_search.word(dense[j], [s.t, s.q, s.v, built.p], near, _ANGLES)
            if word is not None:
                yield rows[j], word
                break
