"""What is given beside a model, with an option: a number (`--mu`), a function of positions (`--of`), and the initial
values of single members of families (`--set p[3].x=1`)."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, facts, parser, tree
from lagcli.expression.facts import Either, Facts
from lagcli.expression.tree import ExpressionError
from lagcli.input import namespace, scope
from lagcli.input.namespace import POSITION, Kind
from lagcli.input.overrides import OfMember, OverrideError
from lagcli.input.scalars import Formulas
from lagcli.model import model as nouns
from lagcli.model.family import Family

POSITIONS = facts.POSITION - {"time"}


def number(model: nouns.Model, label: str, value: object) -> float:
    """The number that `value` stands for; `label`: what it was given with, such as `--mu blade`. Raises `OverrideError`
    where it is neither a number nor a text, `ModelError`, located, for an expression that is none of parameters."""
    if isinstance(value, int | float):
        if not math.isfinite(value):
            raise OverrideError(f"{label}: {value} is not a finite number")
        return float(value)
    if not isinstance(value, str):
        raise OverrideError(f"{label}: a number or an expression is needed, not {type(value).__name__}")
    if not value.strip():
        raise OverrideError(f"{label}: an expression is missing")
    known = {p.name: p.value for p in model.parameters} | model.constants
    origin = yaml_tree.scalar(value, label)

    def lookup(node: tree.Node) -> Either:
        if isinstance(node, tree.Name) and node.name in known:
            return _facts_of(known[node.name])
        hint = diagnostics.nearest(getattr(node, "name", ""), known)
        message = f"`{value[node.start : node.end]}` is no parameter of the model"
        raise ExpressionError("unknown-name", message, node.start, node.end, hint)

    try:
        algebra = facts.FactsAlgebra(lookup, facts.NOTHING, "a value that is given")
        return float(facts.constant(evaluate.scalar(parser.parse(value), algebra)))
    except ExpressionError as error:
        location = origin.locate(error.start, error.end)
        raise diagnostics.error(error.code, error.message, location, error.hint) from None


def function(model: nouns.Model, text: str, label: str) -> nouns.Expression:
    """A scalar of positions, coordinates and parameters. Raises `diagnostics.ModelError`, located in `label`, and
    `ValueError` for a constant."""
    # The names of a model, as its own expressions know them.
    found, whole = diagnostics.Collector(), scope.Scope()
    names, formulas = whole.names, Formulas(whole, found)
    for parameter in model.parameters:
        names.declare(parameter.name, parameter.name, "parameter")
        names.define(parameter.name, namespace.known(_facts_of(parameter.value)))
        names.settle(parameter.name)
    for coordinate in model.coordinates:
        names.define(_declared(whole, coordinate.members, "coordinate"), namespace.known(POSITION))
    for particle in model.particles:
        key = _declared(whole, particle.members, "particle")
        part = POSITION if particle.is_dependent else Facts(None, frozenset(("position", "cartesian")))
        names.define(key, namespace.known((part, part, part)))
    for definition in model.definitions:
        names.declare(definition.name, definition.name, "definition")
        given = definition.expression, facts.MOTION, "a definition"
        names.define(definition.name, functools.partial(formulas.either_facts, *given))
    expression = formulas.parse(yaml_tree.scalar(text, label), parser.parse)
    value = None if expression is None else formulas.facts(expression, POSITIONS, "this function")
    if value is not None and value.value is not None:
        raise ValueError("of: it is a constant, for which every point is stationary")
    found.raise_errors()
    assert expression is not None
    return expression


def _declared(whole: scope.Scope, members: Family, kind: Kind) -> str:
    """The key under which an entry is declared, its members numbered."""
    key = members.base
    if members.names != (key,):
        key += f"{list(members.indices[:1]) or '[]'}"
    whole.names.declare(key, members.base, kind)
    whole.names.number(key, members)
    return key


def _facts_of(value: float | nouns.Vector3) -> Either:
    """The facts of a constant."""
    return evaluate.each(Facts, value)


_FIELDS = {"value": "value", "rate": "rate", "position": "start", "velocity": "start_velocity"}
Declared = TypeVar("Declared", nouns.Coordinate, nouns.Particle)


def changed(
    formulas: Formulas, read: Sequence[Declared], changes: Sequence[OfMember], kind: Kind
) -> tuple[Declared, ...]:
    """The coordinates or particles with the changes to them made. What is wrong with a value is reported. Raises
    `OverrideError` where there is no such member."""
    found = list(read)
    for change in changes:
        if change.section != f"{kind}s":
            continue
        try:
            written = parser.parse_reference(change.owner)
            assert isinstance(written, tree.Index)
            number = formulas.scope.names.numbers(written, {})
        except ExpressionError as error:
            hint = f"; {error.hint}" if error.hint else ""
            raise OverrideError(f"--set {change.name}: {error.message}{hint}") from None
        member_index = formulas.scope.names.member_indices[kind]
        entry = int(member_index.entries(number)[0])
        member, declared = int(number[0]) - member_index.first(entry), found[entry]
        if isinstance(declared, nouns.Particle) and declared.start is None:
            message = f"`{change.owner}` has no initial values"
            message += ": its position is a function of coordinates or time"
            formulas.report(change.value, "not-an-initial-value", message, "change the file instead")
            continue
        values = getattr(declared, _FIELDS[change.field]).copy()
        if kind == "coordinate":
            values[member] = formulas.constant(change.value, f"the initial {change.field} of a coordinate")
        elif change.axis is not None:
            values[member, change.axis] = formulas.constant(change.value, f"an initial {change.field}")
        else:
            vectors = formulas.constant_vectors(change.value, f"an initial {change.field}")
            values[member] = np.nan if vectors is None else vectors[0]
        found[entry] = dataclasses.replace(declared, **{_FIELDS[change.field]: values})
    return tuple(found)
