"""The order in which definitions and dependent positions are evaluated, each after all that it uses.

A whole family is one step of it, unless its members depend on one another (`p[i]` on `p[i-1]`): those are put in
order member by member, and a circle among them is an error.
"""

from __future__ import annotations

import contextlib
import graphlib
from collections.abc import Sequence

import numpy as np

from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError
from lagcli.input.scalars import Formulas
from lagcli.model import model
from lagcli.model.family import MemberIndex
from lagcli.model.model import Batch

Node = tuple[int, int]  # a unit and a member of it


class _Unit:
    """A definition, or an entry of dependent particles: its formulas and the base names they use."""

    def __init__(self, name: str, parts: tuple[model.Expression, ...], entry: int | None, count: int) -> None:
        self.name, self.parts, self.entry, self.count = name, parts, entry, count
        self.uses = frozenset[str]().union(*(tree.names(part.tree) for part in parts))


def evaluation(
    formulas: Formulas, particles: Sequence[model.Particle], definitions: Sequence[model.Definition]
) -> tuple[str | Batch, ...]:
    """The steps of the evaluation; a circle is reported."""
    members = _Members(formulas, particles, definitions)
    uses = [sorted(n for name in unit.uses for n in members.by_name.get(name, ())) for unit in members.units]
    steps: list[str | Batch] = []
    for group in _groups(uses):
        first = members.units[group[0]]
        if len(group) > 1 or group[0] in uses[group[0]]:
            steps += members.steps(group)
        elif first.entry is None:
            steps.append(first.name)
        elif first.count:
            steps.append(Batch(first.entry, np.arange(first.count)))
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


class _Members:
    """The order of members that depend on members of the same families."""

    def __init__(
        self, formulas: Formulas, particles: Sequence[model.Particle], definitions: Sequence[model.Definition]
    ) -> None:
        self._formulas, self._particles = formulas, particles
        self.units = [
            _Unit(p.members.base, p.position.parts, i, p.members.count)
            for i, p in enumerate(particles)
            if p.is_dependent
        ]
        self.units += [_Unit(d.name, (d.expression,), None, 1) for d in definitions]
        self.by_name: dict[str, list[int]] = {}
        for number, unit in enumerate(self.units):
            self.by_name.setdefault(unit.name, []).append(number)
        self._member_index = MemberIndex([particle.members for particle in particles])
        self._unit_of = {unit.entry: n for n, unit in enumerate(self.units) if unit.entry is not None}

    def steps(self, group: list[int]) -> list[str | Batch]:
        """Batches of members that need only members of earlier batches."""
        needs = {(n, k): set[Node]() for n in group for k in range(self.units[n].count)}
        for number in group:
            for node, others in self._references(number, set(group)):
                needs[node] |= others
        order = graphlib.TopologicalSorter(needs)
        with contextlib.suppress(graphlib.CycleError):  # what is in a circle is never ready
            order.prepare()
        steps: list[str | Batch] = []
        while ready := order.get_ready():
            for number in sorted({number for number, _ in ready}):
                unit = self.units[number]
                members = sorted(member for n, member in ready if n == number)
                steps.append(
                    unit.name if unit.entry is None else Batch(unit.entry, np.array(members, dtype=np.int64))
                )
            for node in ready:
                del needs[node]
            order.done(*ready)
        if needs:
            number, member = min(needs)
            unit = self.units[number]
            entry = self._particles[unit.entry] if unit.entry is not None else None
            name = unit.name if entry is None else entry.members.names[member]
            error = ExpressionError("circular", f"`{name}` depends on itself", 0, len(unit.parts[0].text))
            self._formulas.trouble(unit.parts[0].origin, error)
        return steps

    def _references(self, number: int, group: set[int]) -> list[tuple[Node, set[Node]]]:
        """For each member of a unit the members and definitions in the group that its formulas speak of."""
        unit = self.units[number]
        variables = {} if unit.entry is None else self._particles[unit.entry].members.variables
        found: list[tuple[Node, set[Node]]] = []
        for node in (node for part in unit.parts for node in tree.walk(part.tree)):
            if isinstance(node, tree.Index) and node.owner in self._member_index:
                numbers = self._formulas.scope.indexed.numbers(node, variables)
                targets = np.broadcast_to(numbers, unit.count)
                entries = self._member_index.entries(targets)
                for k, (target, entry) in enumerate(zip(targets.tolist(), entries.tolist(), strict=True)):
                    other = self._unit_of.get(entry)
                    if other is not None and other in group:
                        found.append(((number, k), {(other, target - self._member_index.first(entry))}))
            elif isinstance(node, (tree.Name, tree.Member)):
                named = self.by_name.get(node.owner, ())
                others = {(n, 0) for n in named if n in group and self.units[n].count == 1}
                if others:
                    found += [((number, k), others) for k in range(unit.count)]
        return found
