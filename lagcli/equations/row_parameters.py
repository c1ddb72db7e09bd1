"""The parameters that the start and the rows depend on: what was found for some values holds where others differ."""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations.system import System
from lagcli.expression import tree
from lagcli.model import model as nouns

Indices = npt.NDArray[np.intp]


def of_start(system: System) -> Indices:
    """The indices in `System.p` of numbers that M, the rows f, B, b or the contacts g, G hold, as assembly asks."""
    contacts, rows = system.contacts, system.rows
    moving = [system.dynamics.M, rows.gamma, contacts.g, contacts.G, contacts.g_t, contacts.gamma]
    return _occurring(system, _rows(system) + moving)


def of_rows(system: System) -> Indices:
    """The indices in `System.p` of numbers that the rows f, B, b hold, or that are named where they are written."""
    occurring = _occurring(system, _rows(system))
    named = _named(system.model)
    indices: list[int] = []
    first = 0
    for parameter in system.model.parameters:
        count = len(parameter.value) if isinstance(parameter.value, tuple) else 1
        if parameter.name in named:
            indices += range(first, first + count)
        first += count
    return np.union1d(occurring, np.array(indices, dtype=np.intp))


def formulas(model: nouns.Model) -> tuple[str, ...]:
    """The parameters that rows name, as they are written: pi/3 is not a decimal near it."""
    named = _named(model)
    return tuple(
        "" if parameter.formula is None else parameter.formula.text
        for parameter in model.parameters
        if parameter.name in named
    )


def _rows(system: System) -> list[ca.SX]:
    return [system.f, system.rows.f, system.rows.B, system.rows.b]


def _occurring(system: System, expressions: Iterable[ca.SX]) -> Indices:
    """The indices of symbols that occur: a number that only decides between pieces occurs too, without a derivative."""
    # Of matrices the entries alone: columns of all their zeros would take memory by the square of a model.
    entries = ca.vertcat(ca.SX(0, 1), *(ca.vec(each.nz[:]) for each in expressions if each.nnz()))
    found = {symbol.element_hash() for symbol in ca.symvar(entries)}
    p = ca.vertsplit(system.p) if system.p.numel() else []
    return np.array([k for k, symbol in enumerate(p) if symbol.element_hash() in found], dtype=np.intp)


def _named(model: nouns.Model) -> frozenset[str]:
    """The names that rows use, also by way of definitions, positions and other parameters."""
    uses = {one.name: tree.names(one.expression.tree) for one in model.definitions}
    uses |= {one.name: tree.names(one.formula.tree) for one in model.parameters if one.formula is not None}
    for particle in model.particles:
        if particle.is_dependent:
            names = (tree.names(part.tree) for part in particle.position.parts)
            uses[particle.members.base] = set().union(*names)
    waiting = {name for law in model.laws for name in tree.names(law.equation.tree)}
    waiting |= set(uses) & set(model.particle_names if model.rigid else ())
    found: set[str] = set()
    while waiting:
        name = waiting.pop()
        found.add(name)
        waiting |= uses.get(name, set()) - found
    return frozenset(found)
