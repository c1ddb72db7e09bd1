"""Laws that may hold a narrow feature of place: a wall, a step or a range of a force that is not felt from afar.

`exp(-((x - 5)/0.1)**2)`, `tanh`, `max(0, ...)` or the twelfth power of an inverse distance is nothing to rounding
outside its range, and a step, which sees forces at its stages only, may lead over all of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from lagcli.arrays import Integers
from lagcli.expression import evaluate, functions, tree
from lagcli.frozen import frozen_value
from lagcli.model import model as nouns
from lagcli.smoothness.model_algebra import ModelAlgebra


class NarrowParameters:
    """The fall of a function that is felt from afar. The tests are of `tests/physics/test_narrow_features.py`."""

    __slots__ = ()

    fall: float = -2.0
    """The order of an inverse square: at a thousand times its range a millionth is left of it, which a step sees.
    `test_what_is_felt_from_afar_needs_no_witness` fails at -0.2, and at -20
    `test_what_is_nothing_outside_its_range_has_witnesses`."""


PARAMETERS = NarrowParameters()


@frozen_value
class MotionOrder:
    """The order with which a value grows with the motion, None where it does not depend on it; number: of a literal."""

    order: float | None = None
    number: float | None = None


_CONSTANT, _MOTION = MotionOrder(), MotionOrder(1)


class _Narrow(Exception):
    """A narrow function was met."""


def are_any(model: nouns.Model, has_contacts: bool) -> bool:
    """True if a force, row, position or definition holds such a function; has_contacts: closed one-sided rows too."""
    meanings = {d.name: d.expression.tree for d in model.definitions}
    orders = _Orders(model, lambda value: _CONSTANT, lambda name: _MOTION)
    orders.known["t"] = _CONSTANT
    try:
        for step in model.order:
            if isinstance(step, str):
                orders.known[step] = value = evaluate.value(meanings[step], orders)
                evaluate.each(_require_wide, value)
        if model.lagrangian is not None:
            orders.look(model.lagrangian.tree, {})
        for particle in model.particles:
            for part in particle.position.parts:
                orders.look(part.tree, particle.members.variables)
        for law in model.laws:
            if has_contacts or not isinstance(law, nouns.Inequality):
                orders.look(law.equation.tree, law.members.variables)
        own = orders.on_a_particle(m=_CONSTANT)
        for force in model.forces:
            of_force = own if isinstance(force, nouns.ParticleForce) else orders
            for part in nouns.expressions_of(force):
                of_force.look(part.tree, force.members.variables)
    except _Narrow:
        return True
    return False


def _require_wide(value: MotionOrder) -> None:
    """Raise `_Narrow` for what falls off faster than an inverse square."""
    if value.order is not None and value.order < PARAMETERS.fall:
        raise _Narrow


class _Orders(ModelAlgebra[MotionOrder]):
    """`ModelAlgebra` of orders."""

    def look(self, node: tree.Node, variables: Mapping[str, Integers]) -> None:
        value = self.value(node, variables)
        for part in value if isinstance(value, tuple) else (value,):
            _require_wide(part)

    def number(self, node: tree.Number) -> MotionOrder:
        return MotionOrder(None, float(node.text))

    def atom(self, node: tree.Reference) -> evaluate.Value[MotionOrder]:
        return _CONSTANT if node.member == "m" else super().atom(node)

    def operation(self, node: tree.Node, name: str, *parts: MotionOrder) -> MotionOrder:
        first, last = parts[0], parts[-1]
        orders = [value.order for value in parts if value.order is not None]
        if name in functions.TABLE or name in ("add", "sub"):
            for value in parts:
                _require_wide(value)
        if not orders:
            if name == "neg":
                return MotionOrder(None, None if first.number is None else -first.number)
            if name == "div" and first.number is not None and last.number:
                return MotionOrder(None, first.number / last.number)
            return _CONSTANT
        if name in ("add", "sub"):
            return MotionOrder(max([*orders, 0.0] if len(orders) == 1 else orders))
        if name in ("neg", "mul"):
            return MotionOrder(sum(orders))
        if name == "div":
            return MotionOrder((first.order or 0.0) - (last.order or 0.0))
        if name == "pow":
            # A wave to a high power is a row of peaks.
            if last.number is None or (first.order == 0.0 and abs(last.number) > -PARAMETERS.fall):
                raise _Narrow
            return MotionOrder((first.order or 0.0) * last.number)
        far = functions.TABLE[name].far
        if far == "narrow":
            raise _Narrow
        return MotionOrder(orders[0] / 2 if far == "root" else math.inf if far == "exponential" else 0.0)
