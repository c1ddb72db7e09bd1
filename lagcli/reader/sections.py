"""The entries of the sections, one function for each kind: node -> noun, or None with the error reported."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lagcli import diagnostics, model, source
from lagcli.expression import facts, parser, tree
from lagcli.reader import keys, scope
from lagcli.reader.formula import Formulas


def fields(formulas: Formulas, node: source.AnyNode, key: keys.Key) -> dict[str, source.AnyNode] | None:
    """The fields of a mapping by the keys of `key`; unknown, unsupported and missing ones are reported."""
    if not isinstance(node, source.Mapping):
        known = ", ".join(f"`{k.name}`" for k in key.keys if k.supported)
        formulas.report(node, "not-a-mapping", f"a mapping is needed here, with the keys {known}")
        return None
    found: dict[str, source.AnyNode] = {}
    for name, value in node:
        if name.value not in key.names:
            known = ", ".join(f"`{k.name}`" for k in key.keys if k.supported)
            hint = diagnostics.nearest(name.value, key.names) or f"the keys here are {known}"
            formulas.report(name, "unknown-key", f"there is no key `{name.value}` here", hint)
        elif not key.key(name.value).supported:
            formulas.report(name, "not-supported-yet", f"`{name.value}` is not supported yet")
        else:
            found[name.value] = value
    for field in key.keys:
        if field.required and field.name not in found:
            formulas.report(node, "missing-key", f"the key `{field.name}` is missing ({field.meaning})")
    return found


def text(formulas: Formulas, node: source.AnyNode) -> str:
    """A text that is free in content."""
    if not isinstance(node, source.Scalar):
        formulas.report(node, "not-a-text", "a text is needed here")
        return ""
    return node.value


def parameter(formulas: Formulas, node: source.AnyNode) -> Any:
    """Facts of a parameter: a number, an expression of earlier parameters, or a constant vector."""
    subject = "a parameter"
    if isinstance(node, source.Sequence):
        vector = formulas.vector_expression(node)
        return None if vector is None else formulas.vector_facts(vector, facts.NOTHING, subject)
    expression = formulas.parse(node, parser.parse)
    return None if expression is None else formulas.facts(expression, facts.NOTHING, subject, shape="either")


def coordinate(formulas: Formulas, name: source.Scalar, node: source.AnyNode) -> model.Coordinate | None:
    """A generalized coordinate; `theta:` alone starts at rest at zero."""
    if source.is_empty(node):
        return model.Coordinate(name.value, 0.0, 0.0, name.location)
    found = fields(formulas, node, keys.FORMAT.key("coordinates"))
    if found is None:
        return None
    values = {"value": 0.0, "rate": 0.0}
    for key, part in found.items():
        value = formulas.constant(part, f"the initial {key} of a coordinate")
        if value is None:
            return None
        values[key] = value
    return model.Coordinate(name.value, values["value"], values["rate"], name.location)


class ParticleReader:
    """Reads a particle in two steps, because other positions and definitions may refer to it by name."""

    def __init__(self, formulas: Formulas, name: source.Scalar, node: source.AnyNode) -> None:
        self._formulas = formulas
        self._name = name
        self._fields = fields(formulas, node, keys.FORMAT.key("particles")) or {}
        place = self._fields.get("position")
        self._position = None if place is None else formulas.vector_expression(place)
        self._facts: tuple[facts.Facts, ...] | None = None

    @property
    def uses(self) -> frozenset[str]:
        """The names the position refers to."""
        parts = self._position.parts if self._position is not None else ()
        return frozenset[str]().union(*(tree.names(part.tree) for part in parts))

    def find(self) -> Any:
        """Facts of the position as others see it: coordinates of its own, or functions of q and t."""
        if self._position is not None:
            self._facts = self._formulas.vector_facts(
                self._position, facts.PLACE, "the position of a particle"
            )
        if self._facts is None:
            # What is wrong has been reported; what others say about this particle can still be checked.
            return (facts.Facts(None, frozenset(("position",))),) * 3
        if scope.reads(self._facts):
            return tuple(facts.Facts(None, part.reads) for part in self._facts)
        return (facts.Facts(None, frozenset(("position", "cartesian"))),) * 3

    def read(self, file_position: source.AnyNode | None) -> model.Particle | None:
        """The particle, once its facts are found. `file_position` is the position without changes made."""
        formulas = self._formulas
        mass, value = self._mass()
        velocity = self._fields.get("velocity")
        moving: model.Vector3 | None = (0.0, 0.0, 0.0)
        if velocity is not None:
            moving = formulas.constant_vector(velocity, "an initial velocity")
        if self._position is None or self._facts is None or mass is None or moving is None:
            return None
        dependent = bool(scope.reads(self._facts))
        if not self._keeps_kind(dependent, file_position):
            return None
        if dependent and velocity is not None:
            message = "a particle whose position depends on coordinates or time has no velocity of its own"
            hint = "its velocity follows from the `rate`s"
            formulas.report(velocity, "velocity-of-dependent", message, hint)
            return None
        start = None if dependent else values(self._facts)
        name, at = self._name.value, self._name.location
        return model.Particle(name, mass, value, self._position, start, moving, at)

    def _keeps_kind(self, dependent: bool, file_position: source.AnyNode | None) -> bool:
        """Whether a changed position is still an initial value, or still a function; else it is refused."""
        place = self._fields.get("position")
        if place is None or file_position is None or place is file_position:
            return True
        before = self._formulas.silent().vector_expression(file_position)
        found = self._formulas.silent().vector_facts(before, facts.PLACE, "") if before is not None else None
        if found is None or bool(scope.reads(found)) == dependent:
            return True
        if dependent:
            message = "an initial position is a constant, and this one depends on coordinates or time"
        else:
            message = (
                "the position of this particle is a function of coordinates or time, not an initial value"
            )
        items = place.items if isinstance(place, source.Sequence) else ()
        changed = next((item for item in items if item.text is not file_position.text), place)
        self._formulas.report(changed, "not-an-initial-value", message, "change the file instead")
        return False

    def _mass(self) -> tuple[model.Expression | None, float]:
        node = self._fields.get("mass")
        if node is None:
            return None, 0.0
        expression = self._formulas.parse(node, parser.parse)
        found = None if expression is None else self._formulas.facts(expression, facts.NOTHING, "a mass")
        if found is None:
            return None, 0.0
        if found.value <= 0.0:
            message = f"a mass must be positive, and this one is {found.value:g}"
            self._formulas.report(node, "mass-not-positive", message)
            return None, 0.0
        return expression, found.value


def values(parts: tuple[facts.Facts, ...]) -> model.Vector3:
    """The values of three constants."""
    x, y, z = (part.value for part in parts if part.value is not None)
    return x, y, z


def force(formulas: Formulas, name: source.Scalar, node: source.AnyNode) -> model.Force | None:
    """An applied force, a generalized force or a potential."""
    found = fields(formulas, node, keys.FORMAT.key("forces"))
    if found is None:
        return None
    if "potential" in found:
        if len(found) > 1:
            message = "a potential acts on all it depends on: it takes no `to` and no `force`"
            formulas.report(node, "conflicting-keys", message)
            return None
        expression = formulas.scalar(found["potential"], facts.POSITION, "a potential")
        return None if expression is None else model.Potential(name.value, expression)
    missing = [key for key in ("to", "force") if key not in found]
    if missing:
        message = f"the key `{missing[0]}` is missing"
        formulas.report(node, "missing-key", message, "a force has `to` and `force`, or a `potential`")
        return None
    names = _targets(formulas, found["to"])
    if names is None:
        return None
    kinds = {formulas.scope.kind(n) for n in names}
    if kinds == {"coordinate"}:
        expression = formulas.scalar(found["force"], facts.MOTION, "a generalized force")
        return None if expression is None else model.GeneralizedForce(name.value, names, expression)
    if kinds != {"particle"}:
        message = "a force acts on particles or on coordinates, not on both"
        formulas.report(found["to"], "mixed-targets", message)
        return None
    return _particle_force(formulas, name, names, found["force"])


def _targets(formulas: Formulas, node: source.AnyNode) -> tuple[str, ...] | None:
    names = name_list(formulas, node)
    if names is None:
        return None
    if [n.value for n in names] == ["all"]:
        particles = tuple(formulas.scope.names("particle"))
        if not particles:
            formulas.report(node, "no-particles", "there are no particles for `all` to stand for")
            return None
        return particles
    bad = [n for n in names if formulas.scope.kind(n.value) not in ("particle", "coordinate")]
    for name in bad:
        hint = diagnostics.nearest(name.value, [*formulas.scope.names("particle", "coordinate"), "all"])
        formulas.report(name, "unknown-name", f"there is no particle or coordinate `{name.value}`", hint)
    return None if bad or not names else tuple(dict.fromkeys(n.value for n in names))


def name_list(formulas: Formulas, node: source.AnyNode) -> list[source.Scalar] | None:
    """One name or a list of names, not yet looked up."""
    items = node.items if isinstance(node, source.Sequence) else (node,)
    if not items:
        formulas.report(node, "missing-value", "the list is empty")
        return None
    names = [item for item in items if isinstance(item, source.Scalar) and not source.is_empty(item)]
    for item in items:
        if not isinstance(item, source.Scalar) or source.is_empty(item):
            formulas.report(item, "not-a-name", "a name is needed here")
    return names if len(names) == len(items) else None


def _particle_force(
    formulas: Formulas, name: source.Scalar, targets: tuple[str, ...], node: source.AnyNode
) -> model.ParticleForce | None:
    vector = formulas.vector_expression(node)
    if vector is None:
        return None
    lookup = scope.lookup_with_own(formulas.scope)
    found = formulas.vector_facts(vector, facts.FORCE, "the force on a particle", lookup)
    if found is None:
        return None
    constant = scope.reads(found) <= {"mass"}
    return model.ParticleForce(name.value, targets, vector, constant)


def warn_of_shadows(
    formulas: Formulas, vector: model.VectorExpression, targets: tuple[str, ...], masses: Mapping[str, float]
) -> None:
    """`m`, `r`, `v` are the particle's own in a force; say so where another of that name differs."""
    for part in vector.parts:
        used = tree.names(part.tree) & scope.OWN.keys()
        for name in sorted(used):
            kind = formulas.scope.kind(name)
            own = {masses.get(target) for target in targets} if name == "m" else set()
            same = kind == "parameter" and own == {formulas.scope.constant(name)}
            # An output cannot be used in a force at all, so it is not shadowed there.
            if kind not in (None, "output") and not same:
                message = f"`{name}` is the particle's own {_OWN_WORDS[name]} here, not the {kind} `{name}`"
                formulas.warn(
                    part.location, "shadowed-name", message, f"rename the {kind} to use it in a force"
                )


_OWN_WORDS = {"m": "mass", "r": "position", "v": "velocity"}


def rigid(formulas: Formulas, name: source.Scalar, node: source.AnyNode) -> model.RigidBody | None:
    """A list of at least two particles."""
    if not isinstance(node, source.Sequence):
        formulas.report(node, "not-a-list", "a rigid body is a list of particles", "for example `[a, b, c]`")
        return None
    names = name_list(formulas, node)
    if names is None:
        return None
    good = True
    seen: set[str] = set()
    for item in names:
        if formulas.scope.kind(item.value) != "particle":
            hint = diagnostics.nearest(item.value, formulas.scope.names("particle"))
            formulas.report(item, "unknown-name", f"there is no particle `{item.value}`", hint)
            good = False
        elif item.value in seen:
            formulas.report(item, "duplicate-name", f"the particle `{item.value}` stands twice in the body")
            good = False
        seen.add(item.value)
    if len(names) < 2:
        formulas.report(node, "too-few-particles", "a rigid body needs at least two particles")
        good = False
    return model.RigidBody(name.value, tuple(n.value for n in names), name.location) if good else None


def either(formulas: Formulas, node: source.AnyNode, allowed: frozenset[facts.Flag], subject: str) -> Any:
    """Expression and facts of a scalar or vector, or a pair of None."""
    expression = formulas.parse(node, parser.parse)
    if expression is None:
        return None, None
    return expression, formulas.facts(expression, allowed, subject, shape="either")
