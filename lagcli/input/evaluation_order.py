"""The order in which definitions and dependent positions are evaluated, each after all that it uses: a whole family at
once, or member by member where they depend on one another (`p[i]` on `p[i-1]`)."""

from __future__ import annotations

import contextlib
import graphlib
from collections.abc import Sequence

import numpy as np

from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.input.scalars import Formulas
from lagcli.model import family, model
from lagcli.model.family import Family, MemberIndex
from lagcli.model.model import Batch

Node = tuple[int, int]  # a unit and a member of it


@frozen
class _Unit:
    """A definition, or the dependent particles of an entry, with their formulas."""

    members: Family
    parts: tuple[model.Expression, ...]
    entry: int | None


def evaluation(
    formulas: Formulas, particles: Sequence[model.Particle], definitions: Sequence[model.Definition]
) -> tuple[str | Batch, ...]:
    """The steps of the evaluation; a circle is reported."""
    units = [_Unit(p.members, p.position.parts, i) for i, p in enumerate(particles) if p.is_dependent]
    units += [_Unit(family.one(d.name), (d.expression,), None) for d in definitions]
    by_name: dict[str, list[int]] = {}
    for number, unit in enumerate(units):
        by_name.setdefault(unit.members.base, []).append(number)
    names = [{name for part in unit.parts for name in tree.names(part.tree)} for unit in units]
    uses = [sorted(n for name in used for n in by_name.get(name, ())) for used in names]
    steps: list[str | Batch] = []
    for group in _groups(uses):
        first = units[group[0]]
        if len(group) > 1 or group[0] in uses[group[0]]:
            every = MemberIndex([particle.members for particle in particles])
            steps += _in_order(formulas, every, {n: units[n] for n in group})
        elif first.entry is None:
            steps.append(first.members.base)
        elif first.members.count:
            steps.append(Batch(first.entry, np.arange(first.members.count)))
    return tuple(steps)


def _groups(uses: list[list[int]]) -> list[list[int]]:
    """The strongly connected components of a graph, each after those it uses (Tarjan, without recursion)."""
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    on_stack: set[int] = set()
    groups: list[list[int]] = []
    for root in range(len(uses)):
        work = [(root, 0)] if root not in index else []
        while work:
            node, child = work.pop()
            if child == 0:
                index[node] = low[node] = len(index)
                stack.append(node)
                on_stack.add(node)
            for at in range(child, len(uses[node])):
                other = uses[node][at]
                if other not in index:
                    work += [(node, at + 1), (other, 0)]
                    break
                if other in on_stack:
                    low[node] = min(low[node], index[other])
            else:
                if low[node] == index[node]:
                    at = stack.index(node)
                    groups.append(sorted(stack[at:]))
                    on_stack -= set(stack[at:])
                    del stack[at:]
                if work:
                    parent = work[-1][0]
                    low[parent] = min(low[parent], low[node])
    return groups


def _in_order(formulas: Formulas, every: MemberIndex, units: dict[int, _Unit]) -> list[str | Batch]:
    """Batches of members that need only members of earlier batches; every: the members of all particles."""
    of_entry = {unit.entry: n for n, unit in units.items()}
    alone = {unit.members.base: n for n, unit in units.items() if unit.members.count == 1}
    needs = {(n, k): set[Node]() for n, unit in units.items() for k in range(unit.members.count)}
    for n, unit in units.items():
        count = unit.members.count
        for node in (node for part in unit.parts for node in tree.walk(part.tree)):
            if isinstance(node, tree.Index) and node.owner in every:
                numbers = formulas.scope.names.numbers(node, unit.members.variables)
                targets = np.broadcast_to(numbers, count)
                entries = every.entries(targets).tolist()
                for k, (target, entry) in enumerate(zip(targets.tolist(), entries, strict=True)):
                    if entry in of_entry:
                        needs[n, k].add((of_entry[entry], target - every.first(entry)))
            elif isinstance(node, (tree.Name, tree.Member)) and node.owner in alone:
                for k in range(count):
                    needs[n, k].add((alone[node.owner], 0))
    order = graphlib.TopologicalSorter(needs)
    with contextlib.suppress(graphlib.CycleError):  # what is in a circle is never ready
        order.prepare()
    steps: list[str | Batch] = []
    while ready := order.get_ready():
        for number in sorted({number for number, _ in ready}):
            unit = units[number]
            members = np.array(sorted(member for n, member in ready if n == number), np.int64)
            steps.append(unit.members.base if unit.entry is None else Batch(unit.entry, members))
        for done in ready:
            del needs[done]
        order.done(*ready)
    if needs:
        number, member = min(needs)
        unit = units[number]
        message = f"`{unit.members.names[member]}` depends on itself"
        error = ExpressionError("circular", message, 0, len(unit.parts[0].text))
        formulas.trouble(unit.parts[0].origin, error)
    return steps
