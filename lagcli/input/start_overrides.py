"""Changes to the initial values of single members of families: `p[3].x`, `theta[2].rate`."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from lagcli.expression import parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import namespace
from lagcli.input.overrides import OfMember, OverrideError
from lagcli.input.scalars import Formulas
from lagcli.model import model

_FIELDS = {"value": "value", "rate": "rate", "position": "start", "velocity": "start_velocity"}


def coordinates(
    formulas: Formulas, read: Sequence[model.Coordinate], changes: Sequence[OfMember]
) -> tuple[model.Coordinate, ...]:
    """The coordinates with the changes made. What is wrong with a value is reported; raises `OverrideError`."""
    changed = list(read)
    for change in changes:
        entry, member = _member(formulas, change, "coordinate")
        found = formulas.constant(change.value, f"the initial {change.field} of a coordinate")
        if found is not None:
            values = getattr(changed[entry], change.field).copy()
            values[member] = found
            changed[entry] = dataclasses.replace(changed[entry], **{change.field: values})
    return tuple(changed)


def particles(
    formulas: Formulas, read: Sequence[model.Particle], changes: Sequence[OfMember]
) -> tuple[model.Particle, ...]:
    """The particles with the changes made. What is wrong with a value is reported; raises `OverrideError`."""
    changed = list(read)
    for change in changes:
        entry, member = _member(formulas, change, "particle")
        particle = changed[entry]
        if particle.start is None:
            message = (
                f"`{change.owner}` has no initial values: its position is a function of coordinates or time"
            )
            formulas.report(change.value, "not-an-initial-value", message, "change the file instead")
            continue
        values = getattr(particle, _FIELDS[change.field]).copy()
        subject = f"an initial {change.field}"
        if change.axis is not None:
            found = formulas.constant(change.value, subject)
            values[member, change.axis] = 0.0 if found is None else found
        else:
            vectors = formulas.constant_vectors(change.value, subject)
            values[member] = 0.0 if vectors is None else vectors[0]
        changed[entry] = dataclasses.replace(particle, **{_FIELDS[change.field]: values})
    return tuple(changed)


def _member(formulas: Formulas, change: OfMember, kind: namespace.Kind) -> tuple[int, int]:
    """The entry of a member, and its number in it. Raises `OverrideError` where there is none."""
    try:
        written = parser.parse_reference(change.owner)
        assert isinstance(written, tree.Index)
        number = formulas.scope.indexed.numbers(written, {})
    except ExpressionError as error:
        hint = f"; {error.hint}" if error.hint else ""
        raise OverrideError(f"--set {change.name}: {error.message}{hint}") from None
    member_index = formulas.scope.names.member_indices[kind]
    entry = int(member_index.entries(number)[0])
    return entry, int(number[0]) - member_index.first(entry)
