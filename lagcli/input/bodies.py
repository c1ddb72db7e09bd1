"""The section `bodies`: a body becomes particles that are held as one, with the weights of its points."""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Mapping
from typing import cast

import numpy as np

from lagcli import doubles, yaml_tree
from lagcli.arrays import Floats, Integers
from lagcli.errors import diagnostics
from lagcli.expression import facts, tokens, tree
from lagcli.frozen import frozen
from lagcli.input import body_inertia, entries, keys
from lagcli.input.body_inertia import PointMasses
from lagcli.input.body_points import COMPONENTS, BodyNames, Writer
from lagcli.input.scalars import Formulas
from lagcli.model import bodies as nouns
from lagcli.model import family, model
from lagcli.model.bodies import AXES, PLANE, weight
from lagcli.model.family import Family

# Names that no point may have: what is asked of a body, and the words of its weights.
TAKEN = {*COMPONENTS, *(f"{m}{c}" for m in "va" for c in ("", *COMPONENTS)), "m", nouns.CENTRE, *PLANE}
PLACE = (facts.Facts(None, frozenset(("position", "cartesian"))),) * 3

Fields = Mapping[str, yaml_tree.AnyNode]


@frozen
class PlacedBody:
    """A body, or a family of K, at the start: centres, axes as columns of R, velocities and angular velocities.

    centre, v, omega (K, 3), R (K, 3, 3); numbers (K, P): of their particles; points: places from the centre in the axes
    of the body; rolls: the velocity is that of rolling without slip.
    """

    names: BodyNames
    members: Family
    masses: PointMasses
    centre: Floats
    R: Floats
    v: Floats
    omega: Floats
    points: Mapping[str, Floats]
    rolls: bool
    numbers: Integers
    made: tuple[nouns.Body, ...]

    def local(self, member: int, place: Floats) -> Floats:
        """A place of the world in the axes of a member, from its centre."""
        return np.asarray((place - self.centre[member]) @ self.R[member])

    def place(self, member: int, point: str) -> Floats:
        """The place of a point, or of the centre, at the start."""
        return np.asarray(self.centre[member] + self.R[member] @ self.points.get(point, np.zeros(3)))


class BodyReader:
    """Reads bodies into `made`, and keeps where they are `placed` for joints and forces."""

    def __init__(self, formulas: Formulas) -> None:
        self._formulas, self.made = formulas, model.Made()
        self.placed: dict[str, PlacedBody] = {}

    def read(self, name: yaml_tree.Scalar, node: yaml_tree.AnyNode, formulas: Formulas | None) -> None:
        """A body, or a family of them; what is wrong is reported, and what speaks of it is not refused too."""
        base = name.value.partition("[")[0].strip()
        self._read(name, node, formulas)
        if base not in self.placed:
            self._formulas.scope.names.reserve(name.value, base, "body")

    def _read(self, name: yaml_tree.Scalar, node: yaml_tree.AnyNode, formulas: Formulas | None) -> None:
        found = None if formulas is None else entries.fields(formulas, node, keys.FORMAT.key("bodies"))
        if formulas is None or found is None:
            return
        points = _points(formulas, found.get("points"))
        given = _mass(formulas, name, found, points)
        R = orientation(formulas, found.get("orientation"))
        centre = _vectors(formulas, found, "center", "the centre of a body")
        if given is None or centre is None or R is None:
            return
        mass, inertia = given
        try:
            masses = body_inertia.point_masses(mass, inertia)
        except body_inertia.ImpossibleInertia as error:
            formulas.report(found.get("inertia", node), "inertia-triangle", str(error))
            return
        for point, place in points.items():
            if not masses.holds(place):
                message = f"the point `{point}` is off the axis of a body without extent across it"
                formulas.report(found["points"], "rod-spin-undefined", message, "give it a radius")
                return
        omega: Floats | None = np.zeros_like(centre)
        v: Floats | None = np.zeros_like(centre)
        if "angular_velocity" in found:
            omega = _vectors(formulas, found, "angular_velocity", "an angular velocity")
        elif "spin" in found:
            spin = _vectors(formulas, found, "spin", "an angular velocity")
            omega = None if spin is None else np.einsum("kij,kj->ki", R, spin)
        if "velocity" in found:
            v = _vectors(formulas, found, "velocity", "an initial velocity")
        elif "pivot" in found:
            pivot = _vectors(formulas, found, "pivot", "a place at rest")
            v = None if pivot is None or omega is None else np.cross(omega, centre - pivot)
        if omega is None or v is None:
            return
        members, base = formulas.members, name.value.partition("[")[0].strip()
        if not members.base:
            members = family.one(base)
        particles = tuple(f"{base}.{k}" for k in range(1, masses.count + 1))
        is_family = any(members.indices)
        names = BodyNames(base, particles, tuple(points), is_family)
        self._formulas.scope.bodies[base] = names
        self._weights(names, masses, points)
        self.parameter(f"{base}.m", mass)
        numbers = self._particles(name, names, members, masses, mass, (centre, R, v, omega))
        made = tuple(
            nouns.Body(word, tuple(own), name.location)
            for word, own in zip(members.names, numbers.tolist(), strict=True)
        )
        self.made.bodies += made
        if masses.count > 1:
            self._hold(name, names, members, made)
        if is_true(formulas, found.get("planar")):
            self._keep_in_plane(name, names, members, centre, R, masses)
        rolls = is_true(formulas, found.get("roll"))
        self.placed[base] = PlacedBody(
            names, members, masses, centre, R, v, omega, points, rolls, numbers, made
        )

    def _weights(self, names: BodyNames, masses: PointMasses, points: Mapping[str, Floats]) -> None:
        """The hidden parameters of directions and points."""
        normal = masses.normal.tolist()
        words = {word: (masses.directions[j], normal[j]) for j, word in enumerate(AXES)}
        if names.is_flat:
            words |= {word: (own, 0.0) for word, own in zip(PLANE, masses.plane, strict=True)}
        words |= {word: masses.weights(place) for word, place in points.items()}
        for word, (weights, of_normal) in words.items():
            for k, each in enumerate(weights.tolist(), 1):
                self.parameter(weight(names.name, word, k), float(each))
            if names.is_flat and word not in PLANE:
                self.parameter(weight(names.name, word, "n"), of_normal)

    def parameter(self, word: str, value: float) -> None:
        """A hidden parameter, which no text of a file can name."""
        self.made.parameters.append(model.Parameter(word, value))
        self._formulas.scope.names.add_hidden(word, "parameter", facts.Facts(value))

    def _particles(
        self,
        name: yaml_tree.Scalar,
        names: BodyNames,
        members: Family,
        masses: PointMasses,
        mass: float,
        motion: tuple[Floats, Floats, Floats, Floats],
    ) -> Integers:
        """The particles of all members, one family for each of the P; their numbers (K, P)."""
        scope, (centre, R, v, omega), writer = self._formulas.scope.names, motion, Writer()
        share = writer.quotient(writer.name(f"{names.name}.m"), writer.number(str(masses.count)))
        numbers = []
        for word, place in zip(names.particles, masses.places, strict=True):
            rho = R @ place
            own = family.with_indices(word, members.indices, members.variables)
            first = len(scope.member_indices["particle"])
            scope.add_hidden(word, "particle", PLACE, names.is_family)
            scope.number(word, own)
            numbers.append(first + np.arange(own.count))
            at = tuple(written(name, f"{word}.{axis}", writer.number("0")) for axis in COMPONENTS)
            self.made.particles.append(
                model.Particle(
                    own,
                    written(name, f"{names.name}.m/{masses.count}", share),
                    np.full(own.count, mass / masses.count),
                    model.VectorExpression(at),
                    centre + rho,
                    v + np.cross(omega, rho),
                    name.location,
                )
            )
        return np.array(numbers, dtype=np.int64).T

    def _hold(
        self, name: yaml_tree.Scalar, names: BodyNames, members: Family, made: tuple[nouns.Body, ...]
    ) -> None:
        laws = self._formulas.scope.laws
        laws.take(names.name, names.is_family)
        laws.number(members, "body")
        self.made.rigid += [model.RigidBody(body.name, body.particles, name.location) for body in made]

    def _keep_in_plane(
        self,
        name: yaml_tree.Scalar,
        names: BodyNames,
        members: Family,
        centre: Floats,
        R: Floats,
        masses: PointMasses,
    ) -> None:
        """Rows that keep y of three particles, which leave a body three freedoms."""
        for k, word in enumerate(names.particles[:3], 1):
            height = f"{names.name}.y.{k}"
            # The indices of a member, as numbers: its name may have any formula of the variables.
            columns = {
                f"{names.name}.index.{d}": np.array(each)
                for d, each in enumerate(zip(*members.indices, strict=True))
            }
            indices = tuple(Writer().name(index) for index in columns)
            if names.is_family:
                left: tree.Node = tree.Index(0, 0, word, indices, "y")
            else:
                left = tree.Member(0, 0, word, "y")
            values = (centre + R @ masses.places[k - 1])[:, 1]
            variables = cast("dict[str, Integers]", {**columns, height: values})
            rows = family.with_indices(f"{names.name}.planar.{k}", members.indices, variables)
            equation = tree.Relation(0, 0, left, "=", Writer().name(height))
            self.made.holonomic.append(model.Holonomic(rows, written(name, rows.base, equation), False))
            self.fix(height, values)

    def fix(self, word: str, values: Floats) -> None:
        """Note numbers that are built into the equations: of others they have to be built anew."""
        self._formulas.scope.names.structure[word] = float(zlib.crc32(values.tobytes()))

    def move(self, body: PlacedBody, v: Floats) -> None:
        """Let a body start with other velocities (K, 3) of its centre."""
        own = set(body.names.particles)
        self.made.particles = [
            dataclasses.replace(one, start_velocity=one.start_velocity + v - body.v)
            if one.members.base in own
            else one
            for one in self.made.particles
        ]


def written(name: yaml_tree.Scalar, text: str, node: tree.Node) -> model.Expression:
    """An expression that the file does not hold, at the name of the entry it stands for."""
    return model.Expression(node, dataclasses.replace(name, value=text))


def is_true(formulas: Formulas, node: yaml_tree.AnyNode | None) -> bool:
    """True for `true`; anything but `true` and `false` is reported."""
    word = node.value.strip() if isinstance(node, yaml_tree.Scalar) else ""
    if node is not None and word not in ("true", "false"):
        formulas.report(node, "bad-setting", "`true` or `false` is needed here")
    return word == "true"


def _vectors(formulas: Formulas, found: Fields, key: str, subject: str) -> Floats | None:
    return None if key not in found else formulas.constant_vectors(found[key], subject)


def _points(formulas: Formulas, node: yaml_tree.AnyNode | None) -> dict[str, Floats]:
    """The points of a body, from its centre in its axes, of a family the same for all."""
    found: dict[str, Floats] = {}
    if node is not None and not isinstance(node, yaml_tree.Mapping):
        formulas.report(node, "not-a-mapping", "points are names with a place in the axes of the body")
        return found
    for name, value in node or ():
        if not tokens.is_name(name.value) or name.value in TAKEN:
            formulas.report(name, "bad-name", f"a point of a body may not be called `{name.value}`")
            continue
        place = _one_of_all(formulas, value, formulas.constant_vectors(value, "a point of a body"))
        if place is not None:
            found[name.value] = place
    return found


def _one_of_all(formulas: Formulas, node: yaml_tree.AnyNode, values: Floats | None) -> Floats | None:
    """What all members have in common, of values (K, ...)."""
    if values is None:
        return None
    if (values != values[:1]).any():
        message = "all members of a family of bodies have one mass, one inertia and the same points"
        formulas.report(node, "bodies-differ", message, "declare those that differ as bodies of their own")
        return None
    return np.asarray(values[0])


def _mass(
    formulas: Formulas, name: yaml_tree.Scalar, found: Fields, points: Mapping[str, Floats]
) -> tuple[float, Floats] | None:
    """Mass, and inertia (3, 3) about the centre in the axes of the body."""
    if "shape" in found:
        return _shape(formulas, found)
    missing = [key for key in ("mass", "inertia") if key not in found]
    if missing:
        hint = "a body has a mass and an inertia, or a shape"
        formulas.report(name, "missing-key", f"the key `{missing[0]}` is missing", hint)
        return None
    mass = _positive(formulas, found["mass"], "a mass", "mass-not-positive")
    node = found["inertia"]
    is_matrix = isinstance(node, yaml_tree.Sequence) and any(
        isinstance(item, yaml_tree.Sequence) for item in node.items
    )
    if is_matrix:
        inertia = _one_of_all(formulas, node, _matrices(formulas, node, "an inertia"))
    else:
        moments = _one_of_all(formulas, node, formulas.constant_vectors(node, "an inertia"))
        inertia = None if moments is None else np.diag(moments)
    if mass is None or inertia is None:
        return None
    if (
        not np.isfinite(inertia).all()
        or np.abs(inertia - inertia.T).max() > doubles.ZERO * np.abs(inertia).max()
    ):
        formulas.report(node, "inertia-not-symmetric", "an inertia is symmetric, and this one is not")
        return None
    inertia = (inertia + inertia.T) / 2
    if "about" in found:
        place = _about(formulas, found["about"], points)
        if place is None:
            return None
        # Steiner: J about the centre is less by that of the mass in it.
        inertia = inertia - mass * (place @ place * np.eye(3) - np.outer(place, place))
    return mass, inertia


def _about(formulas: Formulas, node: yaml_tree.AnyNode, points: Mapping[str, Floats]) -> Floats | None:
    if isinstance(node, yaml_tree.Scalar):
        word = node.value.strip().rpartition(".")[2]
        if word in points:
            return points[word]
        hint = diagnostics.nearest(word, points) or "its points are declared under `points`"
        formulas.report(node, "unknown-name", f"the body has no point `{word}`", hint)
        return None
    return _one_of_all(formulas, node, formulas.constant_vectors(node, "a point of a body"))


def _positive(formulas: Formulas, node: yaml_tree.AnyNode, subject: str, code: str) -> float | None:
    given = formulas.written_constants(node, subject)
    value = None if given is None else _one_of_all(formulas, node, given[1])
    if value is not None and not 0.0 < value < np.inf:
        formulas.report(node, code, f"{subject} must be positive, and this one is {value:g}")
        return None
    return None if value is None else float(value)


def _shape(formulas: Formulas, found: Fields) -> tuple[float, Floats] | None:
    """Mass and inertia of a homogeneous solid; the mass may stand beside the shape or in it."""
    node, shapes = found["shape"], keys.FORMAT.key("bodies").key("shape")
    if "inertia" in found or "about" in found:
        formulas.report(node, "conflicting-keys", "a shape has its inertia, and takes no other")
        return None
    if not isinstance(node, yaml_tree.Mapping) or len(node.entries) != 1:
        message = f"a shape is one of {', '.join(f'`{word}`' for word in shapes.names)} with its sizes"
        formulas.report(node, "bad-shape", message, "for example `{sphere: {mass: 1, radius: 0.2}}`")
        return None
    ((kind, inner),) = node
    if kind.value not in shapes.names:
        listed = ", ".join(f"`{word}`" for word in shapes.names)
        hint = diagnostics.nearest(kind.value, shapes.names) or f"the shapes are {listed}"
        formulas.report(kind, "bad-shape", f"there is no shape `{kind.value}`", hint)
        return None
    sizes = entries.fields(formulas, inner, shapes.key(kind.value))
    if sizes is None:
        return None
    if ("mass" in found) == ("mass" in sizes):
        formulas.report(inner, "missing-key", "a mass is needed once, beside the shape or in it")
        return None
    values: dict[str, Floats] = {}
    for key, part in {**sizes, **({"mass": found["mass"]} if "mass" in found else {})}.items():
        if key != "size":
            value = _positive(
                formulas, part, "a mass" if key == "mass" else f"the {key} of a shape", "bad-shape"
            )
            each = None if value is None else np.array([value])
        else:
            each = _one_of_all(formulas, part, formulas.constant_vectors(part, "the size of a box"))
            if each is not None and not (each > 0).all():
                formulas.report(part, "bad-shape", "the sizes of a box must be positive")
                each = None
        if each is None:
            return None
        values[key] = each
    if any(key.required and key.name not in values for key in shapes.key(kind.value).keys):
        return None  # that has been reported
    mass = float(values["mass"][0])
    return mass, body_inertia.shape(kind.value, mass, values)


def _matrices(formulas: Formulas, node: yaml_tree.AnyNode, subject: str) -> Floats | None:
    """Three rows of three, of each member, (K, 3, 3)."""
    items = node.items if isinstance(node, yaml_tree.Sequence) else ()
    if len(items) != 3 or not all(isinstance(item, yaml_tree.Sequence) for item in items):
        formulas.report(node, "vector-length", f"{subject} is three rows of three numbers")
        return None
    rows = [formulas.constant_vectors(item, subject) for item in items]
    return (
        None
        if any(row is None for row in rows)
        else np.stack([row for row in rows if row is not None], axis=1)
    )


def orientation(formulas: Formulas, node: yaml_tree.AnyNode | None) -> Floats | None:
    """The axes of a body as columns, of each member, (K, 3, 3)."""
    K = formulas.members.count
    if node is None:
        return np.broadcast_to(np.eye(3), (K, 3, 3))
    found = entries.fields(formulas, node, keys.FORMAT.key("bodies").key("orientation"))
    if found is None:
        return None
    given, R = set(found), None
    if given == {"axis", "angle"}:
        axis = directions(formulas, found["axis"])
        angle = formulas.written_constants(found["angle"], "an angle")
        if axis is not None and angle is not None:
            pairs = zip(axis, angle[1].tolist(), strict=True)
            R = np.array([body_inertia.rotation(*pair) for pair in pairs])
        return R
    if given == {"matrix"}:
        R = _matrices(formulas, found["matrix"], "a rotation")
        if R is not None and (
            np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() > doubles.ZERO or (np.linalg.det(R) < 0).any()
        ):
            message = "the matrix of a rotation is orthogonal with determinant 1, and this one is not"
            formulas.report(found["matrix"], "bad-orientation", message)
            return None
        return R
    if given == {"quaternion"}:
        return _of_quaternion(formulas, found["quaternion"])
    if given == {"euler"}:
        return _of_euler(formulas, found["euler"])
    message = (
        "an orientation is given in one of four ways: `axis` and `angle`, `quaternion`, `matrix`, `euler`"
    )
    formulas.report(node, "bad-orientation", message)
    return None


def _of_quaternion(formulas: Formulas, node: yaml_tree.AnyNode) -> Floats | None:
    items = node.items if isinstance(node, yaml_tree.Sequence) else ()
    if len(items) != 4:
        formulas.report(node, "vector-length", "a quaternion has four components: `[w, x, y, z]`")
        return None
    given = [formulas.written_constants(item, "a quaternion") for item in items]
    if any(part is None for part in given):
        return None
    q = np.stack([part[1] for part in given if part is not None], axis=1)
    lengths = np.linalg.norm(q, axis=1)
    if not (np.abs(lengths - 1) <= doubles.ZERO).all():
        worst = float(lengths[int(np.argmax(np.abs(lengths - 1)))])
        message = f"the quaternion of a rotation has length 1, and this one {worst:.9g}"
        formulas.report(node, "bad-orientation", message)
        return None
    w, x, y, z = (q / lengths[:, None]).T
    lines = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(lines), -1, 0)


def _of_euler(formulas: Formulas, node: yaml_tree.AnyNode) -> Floats | None:
    """Rotations about three axes, each of those that the ones before it have turned."""
    items = node.items if isinstance(node, yaml_tree.Sequence) else ()
    letters = [item.value.strip() for item in items[:3] if isinstance(item, yaml_tree.Scalar)]
    if len(items) != 4 or len(letters) != 3 or not set(letters) <= set(COMPONENTS):
        message = "Euler's angles are three axes and their angles: `[z, x, z, [phi, theta, psi]]`"
        formulas.report(node, "bad-orientation", message)
        return None
    angles = formulas.constant_vectors(items[3], "an angle")
    if angles is None:
        return None
    R = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    for letter, each in zip(letters, angles.T.tolist(), strict=True):
        axis = np.eye(3)[COMPONENTS.index(letter)]
        R = R @ np.array([body_inertia.rotation(axis, angle) for angle in each])
    return R


def directions(formulas: Formulas, node: yaml_tree.AnyNode) -> Floats | None:
    """Constant directions of length one, (K, 3)."""
    values = formulas.constant_vectors(node, "a direction")
    return None if values is None else unit(formulas, node, values)


def unit(formulas: Formulas, node: yaml_tree.AnyNode, values: Floats) -> Floats | None:
    """Directions (K, 3) with length one."""
    lengths = np.linalg.norm(values, axis=1)
    if not ((lengths > 0) & np.isfinite(lengths)).all():
        formulas.report(node, "bad-orientation", "a direction has a length above zero, and this one has none")
        return None
    return np.asarray(values / lengths[:, None])
