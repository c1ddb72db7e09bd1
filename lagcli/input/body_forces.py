"""Forces and torques on bodies, as forces on the particles that they are made of: their virtual work is the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli import yaml_tree
from lagcli.arrays import Integers
from lagcli.errors import diagnostics
from lagcli.expression import facts, parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.input import body_points, entries
from lagcli.input.bodies import BodyReader, PlacedBody
from lagcli.input.body_points import Writer
from lagcli.input.scalars import Formulas
from lagcli.model import model
from lagcli.model.bodies import CENTRE, weight


@frozen
class Target:
    """Members of a body, by their numbers (K,), each acted on by the member `acting` (K,) of the force; point: where;
    indices: of the member that an expression of the force speaks of, none where it is one of many."""

    body: PlacedBody
    numbers: Integers
    acting: Integers
    point: str
    indices: tuple[tree.Node, ...]


def forces(reader: BodyReader, formulas: Formulas, node: yaml_tree.AnyNode) -> tuple[model.Force, ...] | None:
    """The forces on particles that a force on bodies stands for; None where it acts on no body; () where it is wrong,
    which is reported. With `all` it acts on all bodies and on the particles that are none of a body."""
    if not isinstance(node, yaml_tree.Mapping):
        return None
    to, between = node.get("to"), node.get("between")
    kinds = [key for key in ("force", "torque") if node.get(key) is not None]
    if between is not None:
        return _between(reader, formulas, node, between)
    if to is None:
        return None
    items: Sequence[yaml_tree.AnyNode] = to.items if isinstance(to, yaml_tree.Sequence) else (to,)
    words = [item.value.strip() for item in items if isinstance(item, yaml_tree.Scalar)]
    is_all = words == ["all"]
    are_bodies = [word.partition("[")[0].partition(".")[0] in reader.placed for word in words]
    names = formulas.scope.names
    if any(names.is_broken(word.partition("[")[0].partition(".")[0]) for word in words) or (
        not reader.placed and formulas.found.has_errors
    ):
        return ()  # that has been reported
    if not any(are_bodies) and not is_all and "torque" not in kinds:
        return None
    if not reader.placed or (not is_all and not all(are_bodies)) or len(words) < len(items):
        message = "a force acts on bodies or on particles, not on both; a torque acts on bodies"
        formulas.report(to, "mixed-targets", message)
        return ()
    if len(kinds) != 1 or {key.value for key, _ in node} - {"to", *kinds, *entries.FAMILY}:
        message = "a force on a body has `to`, and `force` or `torque`"
        formulas.report(node, "conflicting-keys", message)
        return ()
    written, kind = node.get(kinds[0]), kinds[0]
    assert written is not None
    vector = formulas.vector_expression(written)
    lookup = formulas.scope.lookup_in(formulas.members, own=True)
    own = (
        None
        if vector is None
        else formulas.vector_facts(vector, facts.FORCE, f"the {kind} on a body", lookup)
    )
    if vector is None or own is None:
        return ()
    found: list[model.Force] = []
    reads = frozenset[facts.Flag]().union(*(part.reads for part in own))
    is_constant = kind == "force" and reads <= {"mass"}
    free = len(formulas.scope.names.member_indices["particle"]) - sum(
        body.numbers.size for body in reader.placed.values()
    )
    if is_all and free and kind == "force":
        count = formulas.members.count
        acting, targets = np.repeat(np.arange(count), free), np.tile(np.arange(free), count)
        found.append(
            model.ParticleForce(formulas.members, model.Action(targets, acting), vector, is_constant)
        )
    for target in _targets(reader, formulas, items, is_all):
        if target is None:
            return ()
        has_directions = target.body.names.has_directions
        if kind == "torque" and (target.point or not has_directions):
            word = target.body.names.name
            message = f"`{word}` has no extent across its axis, so that no torque about it acts on it"
            hint = "give it a radius"
            if has_directions:
                message, hint = "a torque acts on a body, and on no point of it", f"write `to: {word}`"
            formulas.report(to, "rod-spin-undefined", message, hint)
            return ()
        found += _on(formulas, target, vector, kind, is_constant)
    return tuple(found)


def _targets(
    reader: BodyReader, formulas: Formulas, items: Sequence[yaml_tree.AnyNode], is_all: bool
) -> list[Target | None]:
    count = formulas.members.count

    def every(body: PlacedBody, point: str) -> Target:
        K = body.members.count
        acting, numbers = np.repeat(np.arange(count), K), np.tile(np.arange(K), count)
        return Target(body, numbers, acting, point, ())

    if is_all:
        return [every(body, "") for body in reader.placed.values()]
    found: list[Target | None] = []
    for item in items:
        assert isinstance(item, yaml_tree.Scalar)
        try:
            node = parser.parse(item.value)
            if not isinstance(node, tree.Reference):
                raise ExpressionError("not-a-name", "a name is needed here", node.start, node.end)
            body = reader.placed[node.owner]
            if node.member and node.member not in body.points:
                hint = diagnostics.nearest(node.member, body.points) or "points are declared under `points`"
                message = f"`{node.owner}` has no point `{node.member}`"
                raise ExpressionError("unknown-component", message, node.start, node.end, hint)
            if not node.indices:
                found.append(every(body, node.member))
                continue
            first = tree.Index(node.start, node.end, body.names.particles[0], node.indices, "")
            numbers = formulas.scope.names.numbers(first, formulas.members.variables) - body.numbers[0, 0]
            numbers = np.array(np.broadcast_to(numbers, count))
            found.append(Target(body, numbers, np.arange(count), node.member, node.indices))
        except ExpressionError as error:
            formulas.trouble(item, error)
            found.append(None)
    return found


def _on(
    formulas: Formulas, target: Target, vector: model.VectorExpression, kind: str, is_constant: bool
) -> list[model.Force]:
    """The forces on the particles of a target."""
    body, names = target.body, target.body.names
    speaks_of_own = any(tree.names(part.tree) & {"r", "v"} for part in vector.parts)
    if names.is_family and not target.indices and (speaks_of_own or kind == "torque"):
        # `r` and `v`, and directions, are those of each member: a force of its own for each.
        pairs = zip(target.numbers.tolist(), target.acting.tolist(), strict=True)
        found: list[model.Force] = []
        for number, acting in pairs:
            indices = tuple(tree.Number(0, 0, str(i)) for i in body.members.indices[number])
            one = Target(body, np.array([number]), np.array([acting]), target.point, indices)
            found += _on(formulas, one, vector, kind, is_constant)
        return found
    P = len(names.particles)
    mass = f"{names.name}.m"
    plain = [
        body_points.with_own(part.tree, names, target.indices, lambda w: w.name(mass))
        for part in vector.parts
    ]

    def force(of_particles: Integers, parts: Sequence[tree.Node]) -> model.ParticleForce:
        """The force on particles (K, P') of the members."""
        acting = np.repeat(target.acting, of_particles.shape[1])
        made = tuple(
            model.Expression(one, vector.parts[min(i, len(vector.parts) - 1)].origin)
            for i, one in enumerate(parts)
        )
        return model.ParticleForce(
            formulas.members,
            model.Action(of_particles.ravel(), acting),
            model.VectorExpression(made),
            is_constant,
        )

    numbers = body.numbers[target.numbers]
    if kind == "torque":
        whole = plain[0] if len(plain) == 1 else tree.Vector(plain[0].start, plain[-1].end, tuple(plain))
        writer = Writer(whole, target.indices)
        each = (writer.of_torque(names, k, whole) for k in range(1, P + 1))
        return [force(numbers[:, [k]], [one]) for k, one in enumerate(each)]
    if not target.point:
        writer = Writer(plain[0])
        return [force(numbers, [writer.quotient(one, writer.number(str(P))) for one in plain])]
    if names.is_flat and body.masses.weights(body.points[target.point])[1]:
        # A point off the plane moves with the normal too: its weights are those of the virtual work along it.
        whole = plain[0] if len(plain) == 1 else tree.Vector(plain[0].start, plain[-1].end, tuple(plain))
        writer = Writer(whole, target.indices)
        arm = writer.difference(writer.point(names, target.point), writer.point(names, CENTRE))
        torque = writer.call("cross", arm, whole)
        share = writer.quotient(whole, writer.number(str(P)))
        each = (writer.sum(share, writer.of_torque(names, k, torque)) for k in range(1, P + 1))
        return [force(numbers[:, [k]], [one]) for k, one in enumerate(each)]
    shares = (Writer(plain[0]).name(weight(names.name, target.point, k)) for k in range(1, P + 1))
    return [
        force(numbers[:, [k]], [Writer(one).product(share, one) for one in plain])
        for k, share in enumerate(shares)
    ]


def _between(
    reader: BodyReader, formulas: Formulas, node: yaml_tree.Mapping, between: yaml_tree.AnyNode
) -> tuple[model.Force, ...] | None:
    """A torque on the second of two bodies, and the opposite one on the first."""
    items = between.items if isinstance(between, yaml_tree.Sequence) else ()
    written = node.get("torque")
    if (
        len(items) != 2
        or written is None
        or {key.value for key, _ in node} - {"between", "torque", *entries.FAMILY}
    ):
        message = "`between` takes two bodies, and a `torque` on the second of them"
        formulas.report(node, "conflicting-keys", message)
        return ()
    vector = formulas.vector_expression(written)
    own = None if vector is None else formulas.vector_facts(vector, facts.MOTION, "a torque between bodies")
    if vector is None or own is None:
        return ()
    shadowed = sorted(set().union(*(tree.names(part.tree) for part in vector.parts)) & {"m", "r", "v"})
    if shadowed:
        message = f"`{shadowed[0]}` is a body's own in a force, and a torque between two has none"
        formulas.report(written, "shadowed-name", message, "give what it stands for another name")
        return ()
    found: list[model.Force] = []
    for item, sign in zip(items, (-1, 1), strict=True):
        if isinstance(item, yaml_tree.Scalar) and item.value.strip() == "ground":
            continue
        word = item.value.strip() if isinstance(item, yaml_tree.Scalar) else ""
        if word.partition("[")[0] not in reader.placed:
            hint = diagnostics.nearest(word, [*reader.placed, "ground"])
            formulas.report(item, "unknown-name", f"there is no body `{word}`", hint)
            return ()
        (target,) = _targets(reader, formulas, [item], False)
        if target is None:
            return ()
        if target.point or not target.body.names.has_directions:
            formulas.report(
                item, "rod-spin-undefined", "a torque acts on a body that has an extent across its axis"
            )
            return ()
        turned = vector
        if sign < 0:
            negative = (tree.Sum(p.tree.start, p.tree.end, ((-1, p.tree),)) for p in vector.parts)
            pairs = zip(negative, vector.parts, strict=True)
            turned = model.VectorExpression(tuple(model.Expression(one, part.origin) for one, part in pairs))
        found += _on(formulas, target, turned, "torque", False)
    return tuple(found)
