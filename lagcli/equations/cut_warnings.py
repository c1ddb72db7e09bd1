"""Warnings about `atan2` and `atan` in rows and forces: where they jump, and what a run does there."""

from __future__ import annotations

import re
from collections.abc import Iterator

import casadi as ca
import numpy as np

from lagcli.equations import branch_cuts
from lagcli.equations import system as mechanics
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.model import model as nouns

_WORDS = re.compile(r"\b(atan2?)\s*\(")
HINT = "write the law with `cos` and `sin` of the angle, or with the angle as a coordinate: those have no cut"


def warnings(built: System) -> tuple[diagnostics.Diagnostic, ...]:
    """One warning for each constraint with an angle that jumps, and one for the forces."""
    model = built.model
    if not any(_WORDS.search(text) for text in texts(model)):
        return ()
    found: dict[diagnostics.Location, diagnostics.Diagnostic] = {}
    for i, told in _rows(built):
        row = built.rows.rows[i]
        found.setdefault(row.location, _warning(f"the row `{row.name}` {told}", row.location))
    for j in _jumping(built, ca.densify(built.contacts.g)):
        row = built.contacts.rows[j]
        message = f"the one-sided constraint `{row.name}` jumps where `atan2` or `atan` crosses its cut"
        found.setdefault(row.location, _warning(message, row.location))
    return (*found.values(), *_forces(built))


def out_of_sight(built: System) -> tuple[str, ...]:
    """A sentence on rows that go on smoothly beyond a cut, where searches for points do not follow them."""
    cut = built.cuts
    passed = zip(cut.rows, cut.verdicts, strict=True) if cut else ()
    names = dict.fromkeys(
        f"`{built.rows.rows[i].name}`" for i, verdict in passed if verdict == branch_cuts.PASSED
    )
    if not names:
        return ()
    return (f"points beyond the cut of `atan2` or `atan` in {', '.join(names)} are not looked for: {HINT}",)


def _rows(built: System) -> Iterator[tuple[int, str]]:
    cut = built.cuts
    jumps = "jumps where `atan2` or `atan` crosses its cut; a run that gets there stops"
    for i, verdict in zip(cut.rows, cut.verdicts, strict=True) if cut else ():
        if verdict == branch_cuts.PASSED:
            yield (
                i,
                "jumps by a constant where `atan2` or `atan` crosses its cut; a run goes on smoothly there and"
                " counts the turns",
            )
        elif verdict == branch_cuts.JUMPS:
            yield i, jumps
    first, v = built.holonomic_count, built.symbols.v
    rows = built.rows.B[first:, :] @ v + built.rows.b[first:, :]
    for i in _jumping(built, ca.densify(rows)):
        yield first + i, jumps


def _forces(built: System) -> Iterator[diagnostics.Diagnostic]:
    model = built.model
    hit = _jumping(built, ca.densify(ca.vertcat(built.dynamics.h, ca.vec(built.dynamics.M.nz[:]))))
    if not hit:
        return
    names = model.coordinate_names
    along = f"along `{names[hit[0]]}`" if hit[0] < len(names) else "of inertia"
    places = [*_force_expressions(model)]
    location = next(
        (e.location for e in places if _WORDS.search(e.text)), diagnostics.Location(model.path, 1, 1)
    )
    message = (
        f"the force {along} jumps where `atan2` or `atan` crosses its cut; a run goes on with the force on the other"
        " side"
    )
    yield _warning(message, location)


def _jumping(built: System, value: ca.SX) -> list[int]:
    state = mechanics.start(built.model)[0]
    p = mechanics.values(built)
    return branch_cuts.jumping(
        value, built.symbols, built.p, (built.model.simulation.start, state, np.asarray(p))
    )


def _force_expressions(model: nouns.Model) -> Iterator[nouns.Expression]:
    for force in model.forces:
        if isinstance(force, nouns.Potential):
            yield force.expression
        elif isinstance(force, nouns.GeneralizedForce):
            yield force.force
        else:
            yield from force.force.parts
    if model.lagrangian is not None:
        yield model.lagrangian
    yield from (definition.expression for definition in model.definitions)


def texts(model: nouns.Model) -> Iterator[str]:
    """The texts that rows, forces and places of dependent particles are made of."""
    yield from (law.equation.text for law in model.holonomic)
    yield from (law.equation.text for law in model.differential)
    yield from (law.equation.text for law in model.inequality)
    yield from (expression.text for expression in _force_expressions(model))
    yield from (part.text for p in model.particles if p.is_dependent for part in p.position.parts)


def _warning(message: str, location: diagnostics.Location) -> diagnostics.Diagnostic:
    return diagnostics.Diagnostic("branch-cut", message, location, HINT, "warning")
