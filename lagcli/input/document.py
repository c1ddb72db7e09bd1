"""The sections of a document in their order, each read with the names declared so far: tree -> `Model`."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import math
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, facts, functions, parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.input import (
    constraint_laws,
    entries,
    entry_names,
    evaluation_order,
    given_expression,
    key_hints,
    keys,
    namespace,
    overrides,
    run_sections,
    scope,
)
from lagcli.input.scalars import Formulas, Reading, Trees
from lagcli.model import family, model

if TYPE_CHECKING:
    from lagcli.input.bodies import BodyReader

T = TypeVar("T")
Equation = model.Holonomic | model.Differential
Law = TypeVar("Law", model.Holonomic, model.Differential)

FULL_TURN = 2 * math.pi  # radians: a start beyond it is possible, but seldom meant
_CIRCULAR = functions.named(lambda row: row.angle == "argument")
_CALLS = functions.calls(lambda row: row.angle == "argument")
_NAMED = (
    *(section for section, _ in entry_names.NAMING if section != "bodies"),
    "forces",
    *entry_names.CONSTRAINTS,
    "events",
)


def read(data: bytes | str, path: str, changes: Mapping[str, object] | None = None) -> model.Model:
    """The model a file declares, with `changes` to parameters and initial values made. Raises `diagnostics.ModelError`
    with every error of the file, and `overrides.OverrideError` where a change is wrong."""
    return ParsedFile(data, path).model(changes or {})


class ParsedFile:
    """The text of a file and its tree, from which models with any values are read. Raises `diagnostics.ModelError`."""

    def __init__(self, data: bytes | str, path: str) -> None:
        self.data, self.path = data, path
        self._root = yaml_tree.parse(data, path)
        self._digest = hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()
        self._trees: Trees = {}

    def __reduce__(self) -> tuple[type[ParsedFile], tuple[bytes | str, str]]:
        return ParsedFile, (self.data, self.path)

    def model(self, changes: Mapping[str, object]) -> model.Model:
        """The model with these changes. Raises as `read`."""
        changed, of_members = overrides.apply(self._root, changes)
        # Texts of the file are read once. Those of changes are others each time: kept, they would fill the memory.
        trees = ChainMap({}, self._trees) if self._trees else self._trees
        found = _Document(self._root, changed, Reading(trees)).read(of_members)
        given = tuple((name, str(value)) for name, value in changes.items())
        origin = ModelOrigin(self, dict(changes))
        text = self._root.text.content
        return dataclasses.replace(found, sha256=self._digest, text=text, changes=given, origin=origin)


@frozen
class ModelOrigin:
    """The file that a model was read from, and the changes that were made, as they were given."""

    file: ParsedFile
    changes: dict[str, object]

    def changed(self, changes: Mapping[str, object]) -> model.Model:
        """The model with more changes, which go before those that were made. Raises as `read`."""
        return self.file.model({**self.changes, **changes})


class _Document:
    """One reading: `file` is the document as written, `root` the one with the changes made."""

    def __init__(self, file: yaml_tree.Mapping, root: yaml_tree.Mapping, reading: Reading) -> None:
        self._file = file
        self._root = root
        self._found = diagnostics.Collector()
        self._scope = scope.Scope()
        self._formulas = Formulas(self._scope, self._found, reading=reading)
        self._names = entry_names.EntryNames(self._scope, self._formulas)
        self._reader: BodyReader | None = None

    def read(self, of_members: Sequence[overrides.OfMember]) -> model.Model:
        """The model, with the changes to single members made."""
        self._check_shape()
        declared = self._declared()
        if not declared.particles and not declared.coordinates and not self._found.has_errors:
            message = "the model has no particles and no coordinates"
            self._formulas.report(self._root, "nothing-to-move", message)
        self._found.raise_errors()
        order = evaluation_order.evaluation(self._formulas, declared.particles, declared.definitions)
        coordinates = given_expression.changed(self._formulas, declared.coordinates, of_members, "coordinate")
        particles = given_expression.changed(self._formulas, declared.particles, of_members, "particle")
        self._found.raise_errors()
        # It tells laws apart: those of the file, and positions of dependent particles, which a change may replace.
        laws = [part.text for p in particles if p.is_dependent for part in p.position.parts]
        told = "\0".join([self._root.text.content, *laws])
        found = dataclasses.replace(
            declared,
            fingerprint=hashlib.sha256(told.encode()).hexdigest(),
            coordinates=coordinates,
            particles=particles,
            warnings=self._found.warnings,
            order=order,
            structure=tuple(sorted(self._scope.names.structure.items())),
        )
        notes = _degree_notes(self._root, found.expressions())
        return dataclasses.replace(found, warnings=(*found.warnings, *notes))

    def _declared(self) -> model.Model:
        """The sections of the document in their order, without what follows from all of them."""
        title, description, source = (
            "" if (node := self._root.get(section)) is None else entries.text(self._formulas, node)
            for section in ("title", "description", "source")
        )
        node = self._written("units")
        labels = None if node is None else entries.fields(self._formulas, node, keys.FORMAT.key("units"))
        units = {key: entries.text(self._formulas, value) for key, value in (labels or {}).items()}
        self._names.declare(self._entries)
        self._names.take_constraint_names(self._entries)
        parameters = self._parameters()
        self._names.count_members(self._entries)
        coordinates = self._named("coordinates", self._coordinate)
        made = self._bodies()
        particles, definitions = self._particles_and_definitions()
        particles = (*particles, *made.particles)
        node = self._written("lagrangian")
        lagrangian = None if node is None else self._formulas.scalar(node, facts.MOTION, "a Lagrangian")
        forces = self._forces(particles)
        holonomic = self._laws("holonomic", constraint_laws.holonomic)
        differential = self._laws("differential", constraint_laws.differential)
        walls = self._named("inequality", self._walls)
        rigid = self._named("rigid", self._rigid)
        outputs = self._named("outputs", self._output)
        events = self._named("events", functools.partial(run_sections.event, self._formulas))
        # Nothing may be left out in silence: without an error every entry has become a noun.
        laws = (holonomic, differential, walls, rigid)
        own = particles[: len(particles) - len(made.particles)]
        read = (parameters, coordinates, own, definitions, forces, *laws, outputs, events)
        count = sum(1 for section in _NAMED for _ in self._entries(section))
        assert self._found.has_errors or sum(map(len, read)) == count
        return model.Model(
            path=self._root.text.path,
            fingerprint="",
            title=title,
            description=description,
            source=source,
            units=model.Units(**units),
            parameters=(*parameters, *made.parameters),
            coordinates=coordinates,
            particles=particles,
            definitions=definitions,
            lagrangian=lagrangian,
            forces=tuple(force for each in forces for force in each),
            holonomic=(*holonomic, *made.holonomic),
            differential=(*differential, *made.differential),
            rigid=(*rigid, *made.rigid),
            inequality=tuple(wall for each in walls for wall in each),
            outputs=outputs,
            events=events,
            simulation=run_sections.simulation(self._formulas, self._root.get("simulation"), particles),
            warnings=(),
            order=(),
            structure=(),
            bodies=tuple(made.bodies),
            joints=tuple(made.joints),
        )

    def _check_shape(self) -> None:
        """Report entries whose keys are not indented, which are read as if they were, unknown sections, and a format
        version that is missing or none."""
        same = self._file is self._root
        self._root, flat = key_hints.indented(self._root)
        self._file = self._root if same else key_hints.indented(self._file)[0]
        report = self._formulas.report
        for entry, key in flat:
            message, short = f"the keys of `{entry.value}` are not indented below it", f"{{{key.value}: ...}}"
            hint = f"indent `{key.value}` and the keys after it, or write `{entry.value}: {short}`"
            report(key, "not-a-mapping", message, hint)
        empty = ""
        for key, value in self._root:
            if key.value not in keys.FORMAT.names:
                hint = key_hints.section(key.value, value, empty)
                report(key, "unknown-key", f"there is no section `{key.value}`", hint)
            empty = key.value if yaml_tree.is_empty(value) and key.value in keys.FORMAT.names else ""
        version = self._root.get("lagcli")
        if version is None:
            hint = "a model begins with the line `lagcli: 1`"
            report(self._root, "missing-key", "the format version `lagcli: 1` is missing", hint)
        elif not isinstance(version, yaml_tree.Scalar) or version.value.strip() != "1":
            report(version, "unknown-version", "this version of lagcli reads format version 1")

    def _written(self, section: str) -> yaml_tree.AnyNode | None:
        """What stands in a section; None where nothing does."""
        node = self._root.get(section)
        return None if node is None or yaml_tree.is_empty(node) else node

    def _entries(self, section: str) -> Iterator[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]]:
        """The entries of a section of named things; what is no mapping is reported once."""
        node = self._written(section)
        if isinstance(node, yaml_tree.Mapping):
            yield from node
        elif node is not None:
            key = keys.FORMAT.key(section)
            what = "keys" if key.holds == "mapping" else key.holds
            message = f"`{section}` needs a name for each entry, with its {what} after a colon"
            hint = f"for example {diagnostics.meant('examples')[section]}, indented under `{section}:`"
            self._formulas.report(node, "not-a-mapping", message, hint)

    def _formulas_of(self, section: str, name: yaml_tree.Scalar) -> Formulas | None:
        """Reads the expressions of an entry; None where its members are not known."""
        found = self._names.members[section, name.value]
        return None if found is None else self._formulas.within(found)

    def _named(
        self, section: str, one: Callable[[yaml_tree.Scalar, yaml_tree.AnyNode], T | None]
    ) -> tuple[T, ...]:
        read = [one(name, node) for name, node in self._entries(section)]
        return tuple(item for item in read if item is not None)

    def _parameters(self) -> tuple[model.Parameter, ...]:
        read = []
        for name, node in self._entries("parameters"):
            if key_hints.is_decimal_part(name, node):
                continue  # reported where names are declared
            found, formula = entries.parameter(self._formulas, node)
            self._scope.names.define(name.value, namespace.known(found))
            if found is not None:
                value = evaluate.each(lambda part: float(facts.constant(part)), found)
                read.append(model.Parameter(name.value, value, formula))
                self._scope.names.settle(name.value)
        return tuple(read)

    def _bodies(self) -> model.Made:
        """What the bodies and joints stand for."""
        declared, joined = (list(self._entries(section)) for section in ("bodies", "joints"))
        if not (declared or joined):
            return model.Made()
        from lagcli.input import joints  # most models have none

        self._reader = joints.all_of(self._formulas, declared, joined, self._formulas_of)
        return self._reader.made

    def _coordinate(self, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> model.Coordinate | None:
        self._scope.names.define(name.value, namespace.known(namespace.POSITION))
        formulas = self._formulas_of("coordinates", name)
        return None if formulas is None else entries.coordinate(formulas, name, node)

    def _particles_and_definitions(self) -> tuple[tuple[model.Particle, ...], tuple[model.Definition, ...]]:
        names, readers = self._scope.names, dict[str, entries.ParticleReader]()
        for name, node in self._entries("particles"):
            if (formulas := self._formulas_of("particles", name)) is not None:
                reader = readers[name.value] = entries.ParticleReader(formulas, name, node)
                names.define(name.value, reader.find, reader.uses)
        # Definitions must be known before positions are looked at: a position may use one.
        order = {name.value: i for i, (name, _) in enumerate(self._entries("definitions"))}
        defined: dict[str, model.Expression] = {}
        for name, node in self._entries("definitions"):
            expression = self._formulas.parse(node, parser.parse)
            uses: set[str] = set()
            if expression is not None:
                defined[name.value] = expression
                uses = tree.names(expression.tree)
            find = functools.partial(self._definition, name.value, expression, order)
            names.define(name.value, find, uses)
        # Positions as the file has them: a change may not make a function of an initial value, or the reverse.
        unchanged = None if self._file is self._root else self._file.get("particles")
        particles = []
        for word, reader in readers.items():
            names.settle(word)
            entry = unchanged.get(word) if isinstance(unchanged, yaml_tree.Mapping) else None
            position = entry.get("position") if isinstance(entry, yaml_tree.Mapping) else None
            particles.append(reader.read(position))
        settled = (one for one in defined.items() if names.settle(one[0]) is not None)
        definitions = tuple(model.Definition(*one) for one in settled)
        return tuple(particle for particle in particles if particle is not None), definitions

    def _definition(
        self, name: str, expression: model.Expression | None, order: Mapping[str, int]
    ) -> facts.Either | None:
        """The facts of a definition, which may use those before it."""

        def lookup(node: tree.Node) -> facts.Either:
            used = str(getattr(node, "owner", ""))
            if used in order and order[used] >= order[name]:
                message = f"the definition `{used}` is used before it is declared"
                raise ExpressionError("used-before-declared", message, node.start, node.end)
            return self._scope.lookup(node)

        if expression is None:
            return None
        return self._formulas.either_facts(expression, facts.MOTION, "a definition", lookup)

    def _forces(self, particles: tuple[model.Particle, ...]) -> tuple[tuple[model.Force, ...], ...]:
        masses = np.concatenate([np.zeros(0), *(particle.mass_values for particle in particles)])
        complete = masses.size == len(self._scope.names.member_indices["particle"])

        def one(name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> tuple[model.Force, ...] | None:
            formulas = self._formulas_of("forces", name)
            if formulas is not None and self._reader is not None:
                from lagcli.input import body_forces  # as above

                on_bodies = body_forces.forces(self._reader, formulas, node)
                if on_bodies is not None:
                    return on_bodies
            force = None if formulas is None else entries.force(formulas, node)
            if formulas is not None and isinstance(force, model.ParticleForce) and complete:
                entries.warn_of_shadows(formulas, force, masses)
            return None if force is None else (force,)

        return self._named("forces", one)

    def _laws(
        self, section: str, law: Callable[[Formulas, yaml_tree.AnyNode], Law | None]
    ) -> tuple[Law, ...]:
        """Equations, each written shortly or as a mapping."""

        def one(name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> Law | None:
            formulas = self._formulas_of(section, name)
            found = None if formulas is None else law(formulas, node)
            self._number_law(name, found)
            return found

        return self._named(section, one)

    def _walls(self, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> tuple[model.Inequality, ...] | None:
        """The walls of a condition."""
        formulas = self._formulas_of("inequality", name)
        found = None if formulas is None else constraint_laws.inequality(formulas, node)
        if formulas is None or found is None:
            self._number_law(name, None)
            return None
        walls = constraint_laws.pieces(formulas, found)
        indices = [each for wall in walls for each in wall.members.indices]
        whole = family.with_indices(found.members.base, indices, {})
        self._number_law(name, dataclasses.replace(found, members=whole))
        return walls

    def _number_law(self, name: yaml_tree.Scalar, law: Equation | model.Inequality | None) -> None:
        base = entry_names.base_of(name)
        if base in self._scope.laws:
            shape: scope.Shape = "vector" if isinstance(law, Equation) and law.is_vector else "scalar"
            found = family.one(base) if law is None else law.members
            repeated = self._scope.laws.number(found, None if law is None else shape)
            self._names.refuse_repeated(name, found, repeated)

    def _rigid(self, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> model.RigidBody | None:
        body = entries.rigid(self._formulas, name, node)
        if name.value in self._scope.laws:
            self._scope.laws.number(family.one(name.value), None if body is None else "body")
        return body

    def _output(self, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> model.Output | None:
        formulas = self._formulas_of("outputs", name)
        if formulas is None:
            return None
        written = entries.written(formulas, node, "outputs", "expression")
        expression = None if written is None else formulas.parse(written, parser.parse)
        value = None if expression is None else formulas.either_facts(expression, facts.OUTPUT, "an output")
        self._scope.names.define(name.value, namespace.known(value))
        self._scope.names.settle(name.value)
        if expression is None or value is None:
            return None
        return model.Output(formulas.members, expression, isinstance(value, tuple))


def _degree_notes(
    root: yaml_tree.Mapping, expressions: Iterable[model.Expression]
) -> Iterator[diagnostics.Diagnostic]:
    """A note for each number beyond a full turn that is an argument, or a term of one, of sin, cos or tan."""
    # Parameters and starts of coordinates that are plain numbers beyond a full turn, by base name.
    large: dict[str, yaml_tree.Scalar] = {}
    for section in ("parameters", "coordinates"):
        node = root.get(section)
        for name, value in node if isinstance(node, yaml_tree.Mapping) else ():
            start = value.get("value") if isinstance(value, yaml_tree.Mapping) else value
            with contextlib.suppress(ValueError):
                if isinstance(start, yaml_tree.Scalar) and abs(float(start.value)) > FULL_TURN:
                    large[name.value.partition("[")[0]] = start
    for expression in expressions:
        for call, part in _angles(expression.tree) if expression.words & _CALLS else ():
            if isinstance(part, tree.Number):
                if abs(float(part.text)) <= FULL_TURN:
                    continue
                what = number = part.text
                location = expression.origin.locate(part.start, part.end)
            else:
                known = large.pop(part.owner, None)  # noted once
                if known is None:
                    continue
                number, location = known.value.strip(), known.location
                what = f"{part.owner} = {number}"
            shown = expression.origin.value[call.start : call.end]
            message = f"`{what}` is more than a full turn in radians, and `{shown}` takes it as an angle"
            hint = f"if degrees are meant, write `{number}*deg`"
            yield diagnostics.Diagnostic("angle-in-degrees", message, location, hint, "note")


def _angles(node: tree.Node) -> Iterator[tuple[tree.Call, tree.Number | tree.Name | tree.Index]]:
    """Each call of sin, cos, tan with its argument, or the terms of it, that are plain numbers or names."""
    for part in tree.walk(node):
        if not isinstance(part, tree.Call) or part.function not in _CIRCULAR:
            continue
        for argument in part.arguments:
            terms = [term for _, term in argument.terms] if isinstance(argument, tree.Sum) else [argument]
            for term in terms:
                if isinstance(term, tree.Index) and term.member:
                    continue
                if isinstance(term, (tree.Number, tree.Name, tree.Index)):
                    yield part, term
