"""The section `joints`: rows between points and directions of two bodies, fixed in both from the start on.

A kind of joint is a function here and its line in `KINDS`. Rows are at most quadratic in the positions of particles,
but where a body is flat.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from lagcli import yaml_tree
from lagcli.arrays import Floats, Integers
from lagcli.errors import diagnostics
from lagcli.expression import facts, parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.input import bodies, entries, keys
from lagcli.input.bodies import BodyReader, Fields, PlacedBody, written
from lagcli.input.body_points import COMPONENTS, Writer
from lagcli.input.scalars import Formulas
from lagcli.model import bodies as nouns
from lagcli.model import family, model
from lagcli.model.bodies import CENTRE, weight
from lagcli.model.family import Family

GROUND = "ground"


@frozen
class Side:
    """One of the two bodies of a joint: None for the ground; indices, numbers (K,): the member of a family that it is,
    for each member of the joint."""

    body: PlacedBody | None
    indices: tuple[tree.Node, ...]
    numbers: Integers


class Joint:
    """A joint, or a family of K, as its rows are written. `rows` takes their left sides, which are zero."""

    def __init__(
        self, reader: BodyReader, formulas: Formulas, name: yaml_tree.Scalar, kind: str, found: Fields
    ) -> None:
        self._reader, self.formulas, self._name = reader, formulas, name
        self.kind, self.found = kind, found
        self.members = formulas.members if formulas.members.base else family.one(name.value.strip())
        self._base, self._variables = self.members.base, dict[str, Floats]()
        self._holonomic: list[tree.Node] = []
        self._differential: list[tree.Node] = []
        self.write = Writer()

    @property
    def count(self) -> int:
        """K."""
        return self.members.count

    # What stands in the file

    def pair(self) -> tuple[Side, Side] | None:
        """The two bodies, one of which may be the ground."""
        node = self.found[self.kind]
        items = node.items if isinstance(node, yaml_tree.Sequence) else ()
        if len(items) != 2:
            message = "a joint is between two bodies, or a body and `ground`"
            self.formulas.report(
                node, "bad-joint", message, f"for example `{{{self.kind}: [ground, crank]}}`"
            )
            return None
        first, second = (self.side(item) for item in items)
        if first is None or second is None:
            return None
        same = first.body is second.body and (first.numbers == second.numbers).any()
        if same:
            message = "a joint is between two bodies, and these are one"
            self.formulas.report(node, "bad-joint", message)
            return None
        return first, second

    def side(self, node: yaml_tree.AnyNode) -> Side | None:
        """The body of a name, or `ground`."""
        formulas, placed = self.formulas, self._reader.placed
        if not isinstance(node, yaml_tree.Scalar) or yaml_tree.is_empty(node):
            formulas.report(node, "not-a-name", "the name of a body is needed here")
            return None
        if node.value.strip() == GROUND:
            return Side(None, (), np.zeros(self.count, dtype=np.int64))
        try:
            named = parser.parse_reference(node.value)
        except ExpressionError as error:
            formulas.trouble(node, error)
            return None
        body = placed.get(named.owner)
        if body is None:
            names = formulas.scope.names
            if named.owner not in names or not names.is_broken(named.owner):
                hint = diagnostics.nearest(named.owner, [*placed, GROUND])
                formulas.report(node, "unknown-name", f"there is no body `{named.owner}`", hint)
            return None
        if body.names.is_family != isinstance(named, tree.Index):
            code = "family-needs-index" if body.names.is_family else "not-a-family"
            what = "is a family: name one of its members" if body.names.is_family else "is no family"
            formulas.report(node, code, f"`{named.owner}` {what}")
            return None
        try:
            first = tree.Index(named.start, named.end, body.names.particles[0], named.indices, "")
            numbers = np.zeros(1, dtype=np.int64)
            if body.names.is_family:
                of_particles = formulas.scope.names.numbers(first, formulas.members.variables)
                numbers = of_particles - body.numbers[0, 0]
        except ExpressionError as error:
            formulas.trouble(node, error)
            return None
        return Side(body, named.indices, np.array(np.broadcast_to(numbers, self.count)))

    def places(self, key: str, meaning: str) -> Floats | None:
        """Places of the world at the start (K, 3): constants, or `crank.pin`."""
        if key not in self.found:
            self.formulas.report(self._name, "missing-key", f"the key `{key}` is missing ({meaning})")
            return None
        return self.place_of(self.found[key])

    def place_of(self, node: yaml_tree.AnyNode) -> Floats | None:
        """As `places`, of a node."""
        point = self._point(node) if isinstance(node, yaml_tree.Scalar) else None
        return self.formulas.constant_vectors(node, "the place of a joint") if point is None else point

    def _point(self, node: yaml_tree.Scalar) -> Floats | None:
        owner, _, point = node.value.strip().rpartition(".")
        body = self._reader.placed.get((owner or point).partition("[")[0])
        if body is None or (owner and point not in body.points):
            return None
        side = self.side(yaml_tree.Scalar(node.text, node.start, node.end, owner or point, node.style))
        if side is None:
            return None
        return np.array([body.place(k, point if owner else "") for k in side.numbers.tolist()])

    def directions(self, key: str, meaning: str, node: yaml_tree.AnyNode | None = None) -> Floats | None:
        """Directions of the world at the start, of length one (K, 3): constants, or `direction(crank, [0, 0, 1])`."""
        node = self.found.get(key) if node is None else node
        if node is None:
            self.formulas.report(self._name, "missing-key", f"the key `{key}` is missing ({meaning})")
            return None
        if isinstance(node, yaml_tree.Scalar) and node.value.strip().startswith("direction("):
            return self._turned(node)
        return bodies.directions(self.formulas, node)

    def _turned(self, node: yaml_tree.Scalar) -> Floats | None:
        try:
            call = parser.parse(node.value)
        except ExpressionError as error:
            self.formulas.trouble(node, error)
            return None
        if isinstance(call, tree.Call) and call.function == "direction" and len(call.arguments) == 2:
            first, vector = call.arguments
            shown = node.value[first.start : first.end]
            side = self.side(yaml_tree.Scalar(node.text, node.start, node.end, shown, node.style))
            own = model.VectorExpression((model.Expression(vector, node),))
            found = self.formulas.vector_facts(own, facts.NOTHING, "a direction")
            if side is None or side.body is None or found is None:
                return None
            u = np.broadcast_to(self.formulas.vectors(found), (self.count, 3))
            turned = np.einsum("kij,kj->ki", side.body.R[side.numbers], u)
            return bodies.unit(self.formulas, node, turned)
        message = "a direction of a body is written `direction(body, [x, y, z])`"
        self.formulas.report(node, "wrong-arguments", message)
        return None

    def number(self, key: str, meaning: str) -> Floats | None:
        """Numbers (K,)."""
        if key not in self.found:
            self.formulas.report(self._name, "missing-key", f"the key `{key}` is missing ({meaning})")
            return None
        given = self.formulas.written_constants(self.found[key], meaning)
        return None if given is None else given[1]

    # What is written of it

    def point(self, side: Side, word: str, place: Floats) -> tree.Node:
        """A place of the world (K, 3), fixed in a body from the start on."""
        return self._fixed(side, word, place, is_place=True)

    def along(self, side: Side, word: str, u: Floats) -> tree.Node:
        """A direction of the world (K, 3), fixed in a body from the start on."""
        return self._fixed(side, word, u, is_place=False)

    def _fixed(self, side: Side, word: str, vectors: Floats, is_place: bool) -> tree.Node:
        word = f"{self._base}.{word}"
        if side.body is None:
            columns = {f"{word}.{axis}": vectors[:, i] for i, axis in enumerate(COMPONENTS)}
            self._put(columns)
            return tree.Vector(0, 0, tuple(self.write.name(column) for column in columns))
        body, pairs = side.body, list[tuple[Floats, float]]()
        for k, vector in zip(side.numbers.tolist(), vectors, strict=True):
            own = body.local(k, vector) if is_place else vector @ body.R[k]
            if not body.masses.holds(own):
                self._report_undefined(body)
            weights, normal = body.masses.weights(own)
            pairs.append((weights if is_place else own @ body.masses.directions, normal))
        weights = np.array([pair[0] for pair in pairs])
        self._put({weight(body.names.name, word, i): w for i, w in enumerate(weights.T, 1)})
        if body.names.is_flat:
            self._put({weight(body.names.name, word, "n"): np.array([pair[1] for pair in pairs])})
        return Writer(None, side.indices).point(body.names, word)

    def scalar(self, word: str, values: Floats) -> tree.Node:
        """A number (K,) of the joint."""
        word = f"{self._base}.{word}"
        self._put({word: values})
        return self.write.name(word)

    def omega(self, side: Side) -> tree.Node | None:
        """The angular velocity of a body; None for the ground, and for what has none, which is reported."""
        if side.body is None:
            return None
        if not side.body.names.has_directions:
            self._report_undefined(side.body)
            return None
        return Writer(None, side.indices).omega(side.body.names)

    def _report_undefined(self, body: PlacedBody) -> None:
        word = body.names.name
        message = f"`{word}` has no extent across its axis, so that its turning about it is not defined"
        self.formulas.report(self.found[self.kind], "rod-spin-undefined", message, "give it a radius")

    def velocity(self, side: Side, word: str) -> tree.Node | None:
        """The velocity of a point that was written before, or of the centre; None for the ground."""
        if side.body is None:
            return None
        own = CENTRE if word == CENTRE else f"{self._base}.{word}"
        return Writer(None, side.indices).point(side.body.names, own, "v")

    def start_rolling(self, side: Side, v: Floats) -> None:
        """Let bodies start with these velocities (K, 3) of their centres."""
        assert side.body is not None
        whole = side.body.v.copy()
        whole[side.numbers] = v
        self._reader.move(side.body, whole)

    def _put(self, columns: dict[str, Floats]) -> None:
        """Numbers of the rows: hidden parameters, or of a family values that are built in."""
        for word, values in columns.items():
            if any(self.members.indices):
                self._variables[word] = values
                self._reader.fix(word, values)
            else:
                self._reader.parameter(word, float(values[0]))

    def rows(self, *left_sides: tree.Node) -> None:
        """Holonomic rows."""
        self._holonomic += left_sides

    def velocity_rows(self, *left_sides: tree.Node) -> None:
        """Rows in velocities."""
        self._differential += left_sides

    def finish(self, pair: tuple[Side, Side], place: Floats) -> None:
        """Make the rows `J.1`, `J.2`, ..., and the joint with its reaction at a place of the world (K, 3)."""
        made, names, laws = self._reader.made, list[tuple[str, ...]](), self.formulas.scope.laws
        for left in self._holonomic:
            members, equation = self._row(left, len(names) + 1)
            names.append(members.names)
            made.holonomic.append(model.Holonomic(members, equation, False))
        for left in self._differential:
            members, equation = self._row(left, len(names) + 1)
            names.append(members.names)
            made.differential.append(model.Differential(members, equation, False, "velocities"))
        laws.number(self.members, "body")
        side, sign = (pair[1], 1.0) if pair[1].body is not None else (pair[0], -1.0)
        body = side.body
        assert body is not None
        self.point(side, "at", place)
        for k, (word, member) in enumerate(zip(self.members.names, side.numbers.tolist(), strict=True)):
            rows = tuple(row[k] for row in names)
            built_in = (
                body.masses.weights(body.local(member, place[k])) if any(self.members.indices) else None
            )
            made.joints.append(nouns.Joint(word, body.made[member], rows, sign, f"{self._base}.at", built_in))

    def _row(self, left: tree.Node, number: int) -> tuple[Family, model.Expression]:
        indices, variables = self.members.indices, {**self.members.variables, **self._variables}
        # `J[3].1`, as the rows of a body of a family are called.
        names = tuple(f"{name}.{number}" for name in self.members.names)
        members = Family(f"{self._base}.{number}", names, indices, cast("dict[str, Integers]", variables))
        equation = tree.Relation(0, 0, left, "=", self.write.number("0"))
        return members, written(self._name, f"{self._base}.{number}", equation)


Entries = Sequence[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]]


def all_of(
    formulas: Formulas,
    bodies_: Entries,
    joints: Entries,
    formulas_of: Callable[[str, yaml_tree.Scalar], Formulas | None],
) -> BodyReader:
    """All bodies of a file, then its joints; formulas_of(section, name): those of an entry."""
    reader = BodyReader(formulas)
    for name, node in bodies_:
        reader.read(name, node, formulas_of("bodies", name))
    for name, node in joints:
        read(reader, name, node, formulas_of("joints", name))
    return reader


def read(
    reader: BodyReader, name: yaml_tree.Scalar, node: yaml_tree.AnyNode, formulas: Formulas | None
) -> None:
    """A joint, or a family of them; what is wrong is reported."""
    found = None if formulas is None else entries.fields(formulas, node, keys.FORMAT.key("joints"))
    if formulas is None or found is None:
        return
    kinds = [kind for kind in found if kind in KINDS]
    if len(kinds) != 1:
        message = f"a joint is one of {', '.join(f'`{kind}`' for kind in KINDS)}"
        hint = "for example `{revolute: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}`"
        formulas.report(node, "bad-joint", message, hint)
        return
    KINDS[kinds[0]](Joint(reader, formulas, name, kinds[0], found))


AT, AXIS = "where it is at the start", "its direction at the start"


def across(n: Floats) -> tuple[Floats, Floats]:
    """Two directions (K, 3) across others, all of length one."""
    least = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    e1 = least - n * (least * n).sum(axis=1, keepdims=True)
    e1 = e1 / np.linalg.norm(e1, axis=1, keepdims=True)
    return e1, np.cross(n, e1)


def _ends(joint: Joint, pair: tuple[Side, Side], at: Floats) -> tuple[tree.Node, tree.Node]:
    return joint.point(pair[0], "p", at), joint.point(pair[1], "q", at)


def _together(joint: Joint, pair: tuple[Side, Side], at: Floats) -> None:
    """p_a = p_b."""
    p, q = _ends(joint, pair, at)
    gap = joint.write.difference(q, p)
    joint.rows(*(joint.write.component(gap, axis) for axis in COMPONENTS))


def _on_line(joint: Joint, pair: tuple[Side, Side], at: Floats, n: Floats) -> tree.Node:
    """(p_b - p_a) . e_1 = (p_b - p_a) . e_2 = 0 with e_1, e_2 across n in the first body; p_b - p_a."""
    p, q = _ends(joint, pair, at)
    gap = joint.write.difference(q, p)
    sides = (joint.along(pair[0], f"e{i}", e) for i, e in enumerate(across(n), 1))
    joint.rows(*(joint.write.call("dot", gap, side) for side in sides))
    return gap


def _parallel(joint: Joint, pair: tuple[Side, Side], n: Floats, turns: bool) -> None:
    """e_1^a . n^b = e_2^a . n^b = 0; where nothing turns about n, e_1^a . e_2^b = 0 too."""
    e1, e2 = across(n)
    normal, dot = joint.along(pair[1], "n", n), joint.write.call
    first, second = joint.along(pair[0], "e1", e1), joint.along(pair[0], "e2", e2)
    joint.rows(dot("dot", first, normal), dot("dot", second, normal))
    if not turns:
        joint.rows(dot("dot", first, joint.along(pair[1], "f2", e2)))


def _pinned(joint: Joint) -> None:
    """spherical: a common place; revolute: and axis; fixed: and all directions."""
    pair, at, n = joint.pair(), joint.places("at", AT), np.tile([0.0, 0.0, 1.0], (joint.count, 1))
    axis = joint.directions("axis", AXIS) if joint.kind == "revolute" else n
    if pair is None or at is None or axis is None:
        return
    _together(joint, pair, at)
    if joint.kind != "spherical":
        _parallel(joint, pair, axis, turns=joint.kind == "revolute")
    joint.finish(pair, at)


def _sliding(joint: Joint) -> None:
    """cylindrical: along an axis and about it; prismatic: along it; point_on_line: a point on a line."""
    pair, at, n = joint.pair(), joint.places("at", AT), joint.directions("axis", AXIS)
    if pair is None or at is None or n is None:
        return
    _on_line(joint, pair, at, n)
    if joint.kind != "point_on_line":
        _parallel(joint, pair, n, turns=joint.kind == "cylindrical")
    joint.finish(pair, at)


def _crossed(joint: Joint) -> None:
    """hooke: two axes that stay across each other, one in each body; universal: at a common place."""
    pair, node = joint.pair(), joint.found.get("axes")
    items = node.items if isinstance(node, yaml_tree.Sequence) else ()
    if len(items) != 2:
        joint.formulas.report(
            node or joint.found[joint.kind], "missing-key", "`axes` are two directions: one of each body"
        )
        return
    u, w = (joint.directions("axes", AXIS, item) for item in items)
    at: Floats | None = np.zeros((joint.count, 3))
    if joint.kind == "universal":
        at = joint.places("at", AT)
    elif pair is not None:
        side = pair[1] if pair[1].body is not None else pair[0]
        at = None if side.body is None else side.body.centre[side.numbers]
    if pair is None or at is None or u is None or w is None:
        return
    if joint.kind == "universal":
        _together(joint, pair, at)
    joint.rows(joint.write.call("dot", joint.along(pair[0], "u", u), joint.along(pair[1], "w", w)))
    joint.finish(pair, at)


def _planar(joint: Joint) -> None:
    """planar: a plane of the second body stays in one of the first; point_on_plane: a point of it does."""
    pair, at, n = (
        joint.pair(),
        joint.places("at", AT),
        joint.directions("normal", "of the plane, at the start"),
    )
    if pair is None or at is None or n is None:
        return
    p, q = _ends(joint, pair, at)
    normal = joint.along(pair[0], "n", n)
    joint.rows(joint.write.call("dot", joint.write.difference(q, p), normal))
    if joint.kind == "planar":
        flat = (joint.along(pair[1], f"e{i}", e) for i, e in enumerate(across(n), 1))
        joint.rows(*(joint.write.call("dot", normal, e) for e in flat))
    joint.finish(pair, at)


def _distance(joint: Joint) -> None:
    """A massless rod between two places, whose distance stays."""
    pair = joint.pair()
    node = joint.found.get("at")
    items = node.items if isinstance(node, yaml_tree.Sequence) else ()
    if len(items) != 2:
        joint.formulas.report(
            node or joint.found["distance"], "missing-key", "`at` are two places: one of each body"
        )
        return
    ends = [joint.place_of(item) for item in items]
    if pair is None or any(end is None for end in ends):
        return
    a, b = (end for end in ends if end is not None)
    length = np.linalg.norm(b - a, axis=1)
    p, q = joint.point(pair[0], "p", a), joint.point(pair[1], "q", b)
    joint.rows(joint.write.difference(joint.write.call("distance", q, p), joint.scalar("length", length)))
    joint.finish(pair, b if pair[1].body is not None else a)


def _less(joint: Joint, vectors: Sequence[tree.Node | None]) -> tree.Node:
    """The second less the first, either of which may be zero, of the ground."""
    first, second = vectors
    if second is None:
        assert first is not None
        return tree.Sum(0, 0, ((-1, first),))
    return second if first is None else joint.write.difference(second, first)


def _screw(joint: Joint) -> None:
    """cylindrical, and n . (v_b - v_a) = pitch/(2 pi) n . (omega_b - omega_a), with v of both at the axis."""
    pair, at, n = joint.pair(), joint.places("at", AT), joint.directions("axis", AXIS)
    pitch = joint.number("pitch", "the way along the axis in one turn")
    if pair is None or at is None or n is None or pitch is None:
        return
    gap = _on_line(joint, pair, at, n)
    _parallel(joint, pair, n, turns=True)
    normal = joint.along(pair[0], "m", n)
    speeds = [joint.velocity(side, word) for side, word in zip(pair, "pq", strict=True)]
    slide = _less(joint, speeds)
    omegas = [joint.omega(side) for side in pair]
    if omegas == [None, None]:
        return  # that has been reported
    # The point of the first body moves with its turning: at the place of the second it has omega_a x gap more.
    if omegas[0] is not None:
        slide = joint.write.difference(slide, joint.write.call("cross", omegas[0], gap))
    lead = joint.scalar("lead", pitch / (2 * np.pi))
    turn = joint.write.product(lead, joint.write.call("dot", normal, _less(joint, omegas)))
    joint.velocity_rows(joint.write.difference(joint.write.call("dot", normal, slide), turn))
    joint.finish(pair, at)


def _gear(joint: Joint) -> None:
    """Two wheels whose rims have one velocity along the pitch line: r_a omega_a + r_b omega_b = 0 about the axis."""
    pair, n = joint.pair(), joint.directions("axis", AXIS)
    node = joint.found.get("radii")
    items = node.items if isinstance(node, yaml_tree.Sequence) else ()
    if len(items) != 2:
        joint.formulas.report(
            node or joint.found["gear"], "missing-key", "`radii` are two lengths: one of each wheel"
        )
        return
    radii = [joint.formulas.written_constants(item, "the radius of a wheel") for item in items]
    if pair is None or n is None or any(radius is None for radius in radii):
        return
    omegas = [joint.omega(side) for side in pair]
    if any(omega is None for omega in omegas):
        joint.formulas.report(joint.found["gear"], "bad-joint", "a gear is between two bodies that turn")
        return
    normal = joint.along(Side(None, (), pair[0].numbers), "axis", n)
    rims = [
        joint.write.product(joint.scalar(f"radius{k}", radius[1]), joint.write.call("dot", normal, omega))
        for k, (radius, omega) in enumerate(zip(radii, omegas, strict=True), 1)
        if radius is not None and omega is not None
    ]
    joint.velocity_rows(joint.write.sum(*rims))
    side = pair[1].body
    assert side is not None
    joint.finish(pair, side.centre[pair[1].numbers])


def _rack(joint: Joint) -> None:
    """A pinion, the first body, on a rack, the second: n . omega_a r = u . (v_b - v_a), u the way of the rack."""
    pair, n, u = (
        joint.pair(),
        joint.directions("axis", AXIS),
        joint.directions("along", "the way of the rack"),
    )
    radius = joint.number("radius", "the radius of the pinion")
    if pair is None or n is None or u is None or radius is None:
        return
    omega = joint.omega(pair[0])
    if omega is None or pair[0].body is None:
        joint.formulas.report(
            joint.found["rack"], "bad-joint", "the first of a rack is a body that turns, the pinion"
        )
        return
    ground = Side(None, (), pair[0].numbers)
    normal, way = joint.along(ground, "axis", n), joint.along(ground, "way", u)
    slide = _less(joint, [joint.velocity(side, CENTRE) for side in pair])
    rim = joint.write.product(joint.scalar("radius", radius), joint.write.call("dot", normal, omega))
    joint.velocity_rows(joint.write.difference(joint.write.call("dot", way, slide), rim))
    body = pair[1].body or pair[0].body
    joint.finish(pair, body.centre[(pair[1] if pair[1].body is not None else pair[0]).numbers])


def _rolling(joint: Joint) -> None:
    """A disk, with an axis, or a sphere that rolls on a plane of the ground: the gap, and no slip at the contact."""
    side, on = joint.side(joint.found[joint.kind]), None
    if "on" in joint.found:
        on = entries.fields(joint.formulas, joint.found["on"], keys.FORMAT.key("joints").key("on"))
    if on is None or not {"point", "normal"} <= set(on):
        message = "what it rolls on is missing: `on: {point: [0, 0, 0], normal: [0, 0, 1]}`"
        joint.formulas.report(joint.found[joint.kind], "missing-key", message)
        return
    radius = joint.number("radius", "the radius of a body that rolls")
    place = joint.formulas.constant_vectors(on["point"], "a point of a plane")
    n = joint.directions("on", AXIS, on["normal"])
    axis = joint.directions("axis", AXIS) if "axis" in joint.found else None
    if side is None or side.body is None or radius is None or place is None or n is None:
        if side is not None and side.body is None:
            joint.formulas.report(joint.found[joint.kind], "bad-joint", "a body rolls, and not the ground")
        return
    if axis is None and "axis" in joint.found:
        return
    w, body, ground = joint.write, side.body, Side(None, (), side.numbers)
    normal, r = joint.along(ground, "normal", n), joint.scalar("radius", radius)
    centre = Writer(None, side.indices).point(body.names, CENTRE)
    height = w.call("dot", w.difference(centre, joint.point(ground, "point", place)), normal)
    below, down = n, normal
    if axis is None:
        joint.rows(w.difference(height, r))
    else:
        # The steepest way in the plane of the disk is along Z - (Z . n) n, n being its axis.
        own = joint.along(side, "axis", axis)
        tilt = w.call("dot", normal, own)
        length = w.call("sqrt", w.difference(w.number("1"), tree.Power(0, 0, tilt, w.number("2"))))
        down = w.quotient(w.difference(normal, w.product(tilt, own)), length)
        joint.rows(w.difference(height, w.product(r, length)))
        steepest = n - axis * (n * axis).sum(axis=1, keepdims=True)
        lengths = np.linalg.norm(steepest, axis=1, keepdims=True)
        if not (lengths > 0).all():
            joint.formulas.report(joint.found[joint.kind], "bad-joint", "a disk that lies flat does not roll")
            return
        below = steepest / lengths
    contact = body.centre[side.numbers] - radius[:, None] * below
    if body.rolls:
        arm = contact - body.centre[side.numbers]
        joint.start_rolling(side, -np.cross(body.omega[side.numbers], arm))
    omega = joint.omega(side)
    velocity = joint.velocity(side, CENTRE)
    if omega is None or velocity is None:
        return  # that has been reported
    arm_node = tree.Sum(0, 0, ((-1, w.product(r, down)),))
    slip = w.sum(velocity, w.call("cross", omega, arm_node))
    ways = (joint.along(ground, f"t{i}", e) for i, e in enumerate(across(n), 1))
    joint.velocity_rows(*(w.call("dot", slip, way) for way in ways))
    joint.finish((ground, side), contact)


KINDS: dict[str, Callable[[Joint], None]] = {
    "revolute": _pinned,
    "spherical": _pinned,
    "fixed": _pinned,
    "prismatic": _sliding,
    "cylindrical": _sliding,
    "point_on_line": _sliding,
    "screw": _screw,
    "universal": _crossed,
    "hooke": _crossed,
    "planar": _planar,
    "point_on_plane": _planar,
    "distance": _distance,
    "gear": _gear,
    "rack": _rack,
    "rolling": _rolling,
}
