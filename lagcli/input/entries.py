"""The entries of the sections, one function for each kind: node -> noun, or None with the error reported."""

from __future__ import annotations

import numpy as np

from lagcli import yaml_tree
from lagcli.arrays import Floats, Integers
from lagcli.errors import diagnostics
from lagcli.expression import facts, parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import entry_names, key_hints, keys, namespace, scope
from lagcli.input.scalars import Formulas
from lagcli.model import model

FAMILY = ("for", "if")

MOST_NAMED = 8  # names that a hint lists
_OWN_WORDS = {"m": "mass", "r": "position", "v": "velocity"}


def fields(formulas: Formulas, node: yaml_tree.AnyNode, key: keys.Key) -> dict[str, yaml_tree.AnyNode] | None:
    """The fields of a mapping by the keys of `key`; unknown and missing ones are reported."""
    if not isinstance(node, yaml_tree.Mapping):
        known = ", ".join(f"`{k.name}`" for k in key.keys)
        message = f"a mapping is needed here, with the keys {known}"
        formulas.report(node, "not-a-mapping", message, key_hints.shape(key, node))
        return None
    unknown = []
    found: dict[str, yaml_tree.AnyNode] = {}
    by_name = {field.name: field for field in key.keys}
    for name, value in node:
        if name.value in FAMILY and name.value in by_name:
            continue  # what they say has become the members of the entry
        if name.value not in by_name:
            unknown.append(name)
            hint = key_hints.key(key, name, value)
            formulas.report(name, "unknown-key", f"there is no key `{name.value}` here", hint)
        else:
            found[name.value] = value
    # What is meant stands in a file that is read where something is not understood.
    meant = key_hints.meant_keys(key, unknown) if unknown else set()
    for field in key.keys:
        if field.required and field.name not in found and field.name not in meant:
            formulas.report(node, "missing-key", f"the key `{field.name}` is missing ({field.meaning})")
    return found


def written(formulas: Formulas, node: yaml_tree.AnyNode, section: str, key: str) -> yaml_tree.AnyNode | None:
    """An entry itself, or what stands under `key` where it is a mapping; None where nothing does."""
    if not isinstance(node, yaml_tree.Mapping):
        return node
    found = fields(formulas, node, keys.FORMAT.key(section)) or {}
    if key not in found:
        formulas.report(node, "missing-key", f"the key `{key}` is missing")
    return found.get(key)


def text(formulas: Formulas, node: yaml_tree.AnyNode) -> str:
    """A text that is free in content."""
    if not isinstance(node, yaml_tree.Scalar):
        formulas.report(node, "not-a-text", "a text is needed here")
        return ""
    return node.value


def parameter(
    formulas: Formulas, node: yaml_tree.AnyNode
) -> tuple[facts.Either | None, model.Expression | None]:
    """Facts of a parameter (a number, an expression of earlier parameters, or a constant vector) and its formula. The
    facts are None where there is a fault; a vector in brackets has several formulas, and so none."""
    subject = "a parameter"
    if isinstance(node, yaml_tree.Sequence):
        vector = formulas.vector_expression(node)
        return None if vector is None else formulas.vector_facts(vector, facts.NOTHING, subject), None
    expression = formulas.parse(node, parser.parse)
    found = None if expression is None else formulas.either_facts(expression, facts.NOTHING, subject)
    return found, expression


def coordinate(
    formulas: Formulas, name: yaml_tree.Scalar, node: yaml_tree.AnyNode
) -> model.Coordinate | None:
    """A generalized coordinate; `theta:` alone starts at rest at zero, `theta: 0.5` at rest there."""
    found: dict[str, yaml_tree.AnyNode] | None = {}
    if isinstance(node, yaml_tree.Scalar) and not yaml_tree.is_empty(node):
        found = {"value": node}  # `X: 0` is short for `X: {value: 0}`
    elif not yaml_tree.is_empty(node):
        found = fields(formulas, node, keys.FORMAT.key("coordinates"))
    if found is None:
        return None
    start, written = dict.fromkeys(("value", "rate"), formulas.values(0.0)), dict[str, model.Expression]()
    for key, part in found.items():
        given = formulas.written_constants(part, f"the initial {key} of a coordinate")
        if given is None:
            return None
        written[key], start[key] = given
    told = start["value"], start["rate"], name.location, written.get("value")
    return model.Coordinate(formulas.members, *told)


class ParticleReader:
    """Reads a particle in two steps, because other positions and definitions may refer to it by name."""

    def __init__(self, formulas: Formulas, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> None:
        self._formulas = formulas
        self._name = name
        self._fields = fields(formulas, node, keys.FORMAT.key("particles")) or {}
        position_node = self._fields.get("position")
        self._position = None if position_node is None else formulas.vector_expression(position_node)
        self._facts: tuple[facts.Facts, facts.Facts, facts.Facts] | None = None

    @property
    def uses(self) -> frozenset[str]:
        """The names the position refers to."""
        parts = self._position.parts if self._position is not None else ()
        return frozenset[str]().union(*(tree.names(part.tree) for part in parts))

    def find(self) -> tuple[facts.Facts, facts.Facts, facts.Facts]:
        """Facts of the position as others see it: coordinates of its own, or functions of q and t."""
        if self._position is not None:
            given = self._position, facts.POSITION_OR_TIME, "the position of a particle"
            self._facts = self._formulas.vector_facts(*given)
        if self._facts is None:
            # What is wrong has been reported; what others say about this particle can still be checked.
            return (facts.Facts(None, frozenset(("position",))),) * 3
        if scope.reads(self._facts):
            x, y, z = (facts.Facts(None, part.reads) for part in self._facts)
            return x, y, z
        return (facts.Facts(None, frozenset(("position", "cartesian"))),) * 3

    def read(self, file_position: yaml_tree.AnyNode | None) -> model.Particle | None:
        """The particle, once its facts are found. `file_position` is the position without changes made."""
        formulas, node = self._formulas, self._fields.get("mass")
        mass = None if node is None else formulas.written_constants(node, "a mass")
        if node is not None and mass is not None and not (mass[1] > 0.0).all():
            first = int(np.argmin(mass[1] > 0.0))
            message = f"a mass must be positive, and this one is {mass[1][first]:g}{formulas.where(first)}"
            hint = (
                "a massless stick or string is a constraint between what it joins; a point that only marks a position"
                " is an expression under `definitions`"
            )
            formulas.report(node, "mass-not-positive", message, hint)
            mass = None
        velocity = self._fields.get("velocity")
        moving: Floats | None = np.zeros((formulas.members.count, 3))
        if velocity is not None:
            moving = formulas.constant_vectors(velocity, "an initial velocity")
        if self._position is None or self._facts is None or mass is None or moving is None:
            return None
        dependent = bool(scope.reads(self._facts))
        position = self._fields["position"]
        if file_position is not None and position is not file_position:
            # A changed position is still an initial value, or still a function.
            silent = Formulas(formulas.scope, diagnostics.Collector(), formulas.members)
            before = silent.vector_expression(file_position)
            found = None if before is None else silent.vector_facts(before, facts.POSITION_OR_TIME, "")
            if found is not None and bool(scope.reads(found)) != dependent:
                message = "an initial position is a constant, and this one depends on coordinates or time"
                if not dependent:
                    message = "the position of this particle is a function of coordinates or time, not an initial value"
                items = position.items if isinstance(position, yaml_tree.Sequence) else ()
                changed = next((item for item in items if item.text is not file_position.text), position)
                formulas.report(changed, "not-an-initial-value", message, "change the file instead")
                return None
        if dependent and velocity is not None:
            message = "a particle whose position depends on coordinates or time has no velocity of its own"
            hint = "its velocity follows from the `rate`s"
            formulas.report(velocity, "velocity-of-dependent", message, hint)
            return None
        start = None if dependent else formulas.vectors(self._facts)
        return model.Particle(formulas.members, *mass, self._position, start, moving, self._name.location)


def force(formulas: Formulas, node: yaml_tree.AnyNode) -> model.Force | None:
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
        return None if expression is None else model.Potential(formulas.members, expression)
    missing = [key for key in ("to", "force") if key not in found]
    if missing:
        assert isinstance(node, yaml_tree.Mapping)
        if set(missing) <= key_hints.meant_keys(keys.FORMAT.key("forces"), (name for name, _ in node)):
            return None  # they are there under other names, and that has been reported
        message = f"the key `{missing[0]}` is missing"
        formulas.report(node, "missing-key", message, "a force has `to` and `force`, or a `potential`")
        return None
    targets = _targets(formulas, found["to"])
    if targets is None:
        return None
    pushing, (kind, action) = found["force"], targets
    if kind == "coordinate":
        expression = formulas.scalar(pushing, facts.MOTION, "a generalized force")
        if expression is None or not formulas.can_evaluate(pushing, expression.tree, action.targets.size):
            return None
        return model.GeneralizedForce(formulas.members, action, expression)
    vector, count = formulas.vector_expression(pushing), action.targets.size
    if vector is None or not all(formulas.can_evaluate(pushing, part.tree, count) for part in vector.parts):
        return None
    lookup = formulas.scope.lookup_in(formulas.members, own=True)
    own = formulas.vector_facts(vector, facts.FORCE, "the force on a particle", lookup)
    if own is None:
        return None
    return model.ParticleForce(formulas.members, action, vector, scope.reads(own) <= {"mass"})


def _targets(formulas: Formulas, node: yaml_tree.AnyNode) -> tuple[namespace.Kind, model.Action] | None:
    """The meaning of `to:`: the kind of the targets, and which member of the force acts on which of them."""
    named = references(formulas, node, ("particle", "coordinate"), everything=True)
    if named is None:
        return None
    if len({kind for kind, _, _ in named}) > 1:
        message = "a force acts on particles or on coordinates, not on both"
        formulas.report(node, "mixed-targets", message)
        return None
    count = formulas.members.count
    # One target for each member of the force, or all of them for each.
    sizes = [count if each else count * numbers.size for _, numbers, each in named]
    if sum(sizes) > entry_names.MAX_MEMBERS:
        message = f"this force acts more than {entry_names.MAX_MEMBERS} times"
        formulas.report(node, "too-many-members", message)
        return None
    acting = [np.arange(count) if each else np.repeat(np.arange(count), n.size) for _, n, each in named]
    targets = [np.broadcast_to(n, count) if each else np.tile(n, count) for _, n, each in named]
    if len(named) == 1:
        return named[0][0], model.Action(targets[0], acting[0])
    # A target named twice is acted on once.
    total = len(formulas.scope.names.member_indices[named[0][0]])
    pairs = np.unique(np.concatenate(acting) * total + np.concatenate(targets))
    return named[0][0], model.Action(pairs % total, pairs // total)


Named = tuple[namespace.Kind, Integers, bool]


def references(
    formulas: Formulas, node: yaml_tree.AnyNode, kinds: tuple[namespace.Kind, ...], everything: bool = False
) -> list[Named] | None:
    """The meaning of one name or a list of names: kind, numbers, and whether there is one for each member. The bare
    name of a family stands for all its members, `all` (where `everything`) for all particles."""
    listed = name_list(formulas, node)
    if listed is None:
        return None
    member_indices = formulas.scope.names.member_indices
    if everything and [n.value.strip() for n in listed] == ["all"]:
        if not len(member_indices["particle"]) and not formulas.scope.names.of("particle"):
            formulas.report(node, "no-particles", "there are no particles for `all` to stand for")
            return None
        return [("particle", np.arange(len(member_indices["particle"])), False)]
    found = [_reference(formulas, name, kinds, everything) for name in listed]
    known = [one for one in found if one is not None]
    return known if len(known) == len(listed) else None


def _reference(
    formulas: Formulas, name: yaml_tree.Scalar, kinds: tuple[namespace.Kind, ...], everything: bool
) -> Named | None:
    try:
        written = parser.parse_reference(name.value)
        base = written.owner
        kind = formulas.scope.names.kind(base)
        if kind not in kinds:
            known = [*formulas.scope.names.of(*kinds), *(("all",) if everything else ())]
            hint = (_word_for_all(base) if everything else "") or diagnostics.nearest(base, known)
            if not hint and known:
                more = ", ..." if len(known) > MOST_NAMED else ""
                hint = f"declared are {', '.join(f'`{one}`' for one in known[:MOST_NAMED])}{more}"
            message = f"there is no {' or '.join(kinds)} `{base}`"
            formulas.report(name, "unknown-name", message, hint)
            return None
        if formulas.scope.names.is_broken(base):
            return None
        if isinstance(written, tree.Name) and formulas.scope.names.is_family(base):
            family = formulas.scope.names.member_indices[kind].family(base)
            return kind, np.array(family, dtype=np.int64), False
        numbers = formulas.scope.names.numbers(written, formulas.members.variables)
        return kind, numbers, isinstance(written, tree.Index)
    except ExpressionError as error:
        hint = _word_for_all(name.value) if everything else ""
        if hint:
            formulas.report(name, "unknown-name", f"there is no name `{name.value.strip()}`", hint)
        else:
            formulas.trouble(name, error)
        return None


def _word_for_all(written: str) -> str:
    """The hint for a word that stands for everything elsewhere; else nothing."""
    meant = diagnostics.meant("values of to").get(written.strip().casefold())
    return f"write `{meant}`" if meant else ""


def name_list(formulas: Formulas, node: yaml_tree.AnyNode) -> list[yaml_tree.Scalar] | None:
    """One name or a list of names, not yet looked up."""
    items = node.items if isinstance(node, yaml_tree.Sequence) else (node,)
    if not items:
        formulas.report(node, "missing-value", "the list is empty")
        return None
    named = [item for item in items if isinstance(item, yaml_tree.Scalar) and not yaml_tree.is_empty(item)]
    for item in items:
        if not isinstance(item, yaml_tree.Scalar) or yaml_tree.is_empty(item):
            formulas.report(item, "not-a-name", "a name is needed here")
    return named if len(named) == len(items) else None


def warn_of_shadows(formulas: Formulas, force: model.ParticleForce, masses: Floats) -> None:
    """`m`, `r`, `v` are the particle's own in a force; say so where another of that name differs. masses: of all
    particles, (N,)."""
    for part in force.force.parts:
        used = tree.names(part.tree) & scope.OWN.keys()
        for name in sorted(used):
            kind = formulas.scope.names.kind(name)
            own = set(masses[force.action.targets].tolist()) if name == "m" else set()
            same = kind == "parameter" and own == {formulas.scope.names.constant(name)}
            # An output cannot be used in a force at all, so it is not shadowed there.
            if kind not in (None, "output") and not same:
                message = f"`{name}` is the particle's own {_OWN_WORDS[name]} here, not the {kind} `{name}`"
                hint = f"rename the {kind} to use it in a force"
                warning = diagnostics.Diagnostic("shadowed-name", message, part.location, hint, "warning")
                formulas.found.add(warning)


def rigid(formulas: Formulas, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> model.RigidBody | None:
    """A list of at least two particles, in which a family stands for all its members."""
    if not isinstance(node, yaml_tree.Sequence) and not (
        isinstance(node, yaml_tree.Scalar) and formulas.scope.names.is_family(node.value.strip())
    ):
        formulas.report(node, "not-a-list", "a rigid body is a list of particles", "for example `[a, b, c]`")
        return None
    named = references(formulas, node, ("particle",))
    if named is None:
        return None
    numbers = [number for _, found, _ in named for number in found.tolist()]
    good, seen = True, set[int]()
    for item, (_, found, _) in zip(name_list(formulas, node) or (), named, strict=True):
        if seen & set(found.tolist()):
            message = f"the particle `{item.value}` occurs twice in the body"
            hint = "list each particle once: its distance to itself is no constraint"
            formulas.report(item, "duplicate-name", message, hint)
            good = False
        seen |= set(found.tolist())
    if len(numbers) < 2:
        message, hint = (
            "a rigid body needs at least two particles",
            "a particle alone needs nothing to hold it together",
        )
        formulas.report(node, "too-few-particles", message, hint)
        good = False
    return model.RigidBody(name.value, tuple(numbers), name.location) if good else None
