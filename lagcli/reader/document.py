"""The sections of a document in their order, each read with the names declared so far: tree -> `Model`."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from lagcli import diagnostics, model, settings, source
from lagcli.expression import facts, parser, tokens, tree
from lagcli.expression.tree import ExpressionError
from lagcli.reader import keys, laws, overrides, scope, sections
from lagcli.reader.formula import Formulas

T = TypeVar("T")


def _same(value: T) -> T:
    return value


_NAMING: tuple[tuple[str, scope.Kind], ...] = (
    ("parameters", "parameter"),
    ("coordinates", "coordinate"),
    ("particles", "particle"),
    ("definitions", "definition"),
    ("outputs", "output"),
)
_NAMED = (*(section for section, _ in _NAMING), "forces", "holonomic", "differential", "rigid")


def read(data: bytes | str, path: str, changes: Mapping[str, object] | None = None) -> model.Model:
    """The model a file declares, with `changes` to parameters and initial values made.

    Raises `diagnostics.ModelError` with every error of the file, and `overrides.OverrideError` where a change
    is wrong.
    """
    root = source.parse(data, path)
    return _Document(root, overrides.apply(root, changes or {})).read()


class _Document:
    """One reading: `file` is the document as written, `root` the one with the changes made."""

    def __init__(self, file: source.Mapping, root: source.Mapping) -> None:
        self._file = file
        self._root = root
        self._found = diagnostics.Collector()
        self._scope = scope.Scope()
        self._formulas = Formulas(self._scope, self._found)
        self._defined: dict[str, model.Expression] = {}

    def read(self) -> model.Model:
        self._check_sections()
        texts = {section: self._text(section) for section in ("title", "description", "source")}
        units = self._units()
        self._declare_names()
        self._take_constraint_names()
        parameters = self._parameters()
        coordinates = self._named("coordinates", self._coordinate)
        particles = self._particles()
        definitions = self._definitions()
        lagrangian = self._lagrangian()
        forces = self._forces(particles)
        holonomic = self._laws("holonomic", laws.holonomic)
        differential = self._laws("differential", laws.differential)
        rigid = self._named("rigid", lambda k, n: sections.rigid(self._formulas, k, n))
        rows = {law.name: law.rows for law in holonomic} | {law.name: law.rows for law in differential}
        self._take_rows(rows)
        outputs = self._outputs()
        simulation = self._simulation(particles)
        if not particles and not coordinates and not self._found.has_errors:
            message = "the model has no particles and no coordinates"
            self._formulas.report(self._root, "nothing-to-move", message)
        self._found.raise_errors()
        read = (
            parameters,
            coordinates,
            particles,
            definitions,
            forces,
            holonomic,
            differential,
            rigid,
            outputs,
        )
        # Nothing may be left out in silence: without an error every entry has become a noun.
        assert sum(map(len, read)) == sum(1 for section in _NAMED for _ in self._entries(section))
        return model.Model(
            path=self._root.text.path,
            fingerprint=hashlib.sha256(self._root.text.content.encode()).hexdigest(),
            title=texts["title"],
            description=texts["description"],
            source=texts["source"],
            units=units,
            parameters=parameters,
            coordinates=coordinates,
            particles=particles,
            definitions=definitions,
            lagrangian=lagrangian,
            forces=forces,
            holonomic=holonomic,
            differential=differential,
            rigid=rigid,
            outputs=outputs,
            simulation=simulation,
            warnings=self._found.warnings,
            order=self._scope.order("particle", "definition"),
        )

    def _check_sections(self) -> None:
        root, formulas = self._root, self._formulas
        for key, value in root:
            if key.value not in keys.FORMAT.names:
                hint = diagnostics.nearest(key.value, keys.FORMAT.names)
                hint = hint or "the sections are " + ", ".join(keys.FORMAT.names)
                formulas.report(key, "unknown-key", f"there is no section `{key.value}`", hint)
            elif not keys.FORMAT.key(key.value).supported and not source.is_empty(value):
                formulas.report(key, "not-supported-yet", f"the section `{key.value}` is not supported yet")
        version = root.get("lagcli")
        if version is None:
            hint = "a model begins with the line `lagcli: 1`"
            formulas.report(root, "missing-key", "the format version `lagcli: 1` is missing", hint)
        elif not isinstance(version, source.Scalar) or version.value.strip() != "1":
            formulas.report(version, "unknown-version", "this version of lagcli reads format version 1")

    def _entries(self, section: str) -> Iterator[tuple[source.Scalar, source.AnyNode]]:
        """The entries of a section of named things; what is no mapping is reported once."""
        node = self._root.get(section)
        if node is None or source.is_empty(node):
            return
        if not isinstance(node, source.Mapping):
            key = keys.FORMAT.key(section)
            message = f"`{section}` is a mapping from names to {key.holds}"
            self._formulas.report(node, "not-a-mapping", message)
            return
        for name, value in node:
            if not self._is_family(name, value):
                yield name, value

    def _is_family(self, name: source.Scalar, value: source.AnyNode) -> bool:
        """Whether an entry stands for many, which is refused; its bare name is taken as broken."""
        spot = name if "[" in name.value else value.key("for") if isinstance(value, source.Mapping) else None
        if spot is None:
            return False
        self._formulas.report(spot, "not-supported-yet", "families `name[i]` are not supported yet")
        return True

    def _declare_names(self) -> None:
        for section, kind in _NAMING:
            node = self._root.get(section)
            for name, value in node if isinstance(node, source.Mapping) else ():
                if self._is_family(name, value):
                    self._scope.spoil(name.value.partition("[")[0].strip(), kind)
                    continue
                trouble = self._scope.declare(name.value, kind)
                if trouble:
                    code = "duplicate-name" if name.value in self._scope else "bad-name"
                    self._formulas.report(name, code, trouble)
                    self._scope.spoil(name.value, kind)

    def _take_constraint_names(self) -> None:
        """Constraints have names of their own, told apart in the columns `lambda.NAME`."""
        taken: dict[str, str] = {}
        for section in ("holonomic", "rigid", "differential", "forces"):
            node = self._root.get(section)
            for name, value in node if isinstance(node, source.Mapping) else ():
                word = name.value
                if self._is_family(name, value):
                    self._scope.constraints[word.partition("[")[0].strip()] = None
                elif not tokens.is_name(word):
                    message = "a name is a letter or `_`, then letters, digits and `_`"
                    self._formulas.report(name, "bad-name", message)
                elif word in scope.RESERVED:
                    self._formulas.report(name, "bad-name", f"`{word}` is reserved")
                elif section != "forces" and word in taken:
                    message = f"`{word}` is already a constraint under `{taken[word]}`"
                    self._formulas.report(name, "duplicate-name", message, "two columns would have one name")
                elif section != "forces":
                    taken[word] = section
                    # Before the laws are read, what matters is that the name is a constraint's.
                    self._scope.constraints[word] = () if section == "rigid" else (word,)

    def _take_rows(self, rows: Mapping[str, tuple[str, ...]]) -> None:
        """The rows of the laws that were read; those that could not be are broken from here on."""
        for section in ("holonomic", "differential"):
            for name, _ in self._entries(section):
                self._scope.constraints[name.value] = rows.get(name.value)

    def _named(self, section: str, one: Callable[[source.Scalar, source.AnyNode], T | None]) -> tuple[T, ...]:
        read = [one(name, node) for name, node in self._entries(section)]
        return tuple(item for item in read if item is not None)

    def _parameters(self) -> tuple[model.Parameter, ...]:
        read = []
        for name, node in self._entries("parameters"):
            found = sections.parameter(self._formulas, node)
            self._scope.define(name.value, functools.partial(_same, found))
            if found is not None:
                value = sections.values(found) if isinstance(found, tuple) else found.value
                read.append(model.Parameter(name.value, value))
                self._look(name.value)
        return tuple(read)

    def _look(self, name: str) -> Any:
        """Have the facts of a name found now; whatever is wrong has been reported."""
        try:
            return self._scope.lookup(tree.Name(0, 0, name))
        except ExpressionError:
            return None

    def _coordinate(self, name: source.Scalar, node: source.AnyNode) -> model.Coordinate | None:
        self._scope.define(name.value, lambda: facts.Facts(None, frozenset(("position",))))
        return sections.coordinate(self._formulas, name, node)

    def _particles(self) -> tuple[model.Particle, ...]:
        readers = {}
        for name, node in self._entries("particles"):
            reader = readers[name.value] = sections.ParticleReader(self._formulas, name, node)
            self._scope.define(name.value, reader.find, reader.uses)
        # Definitions must be known before positions are looked at: a position may use one.
        self._define_definitions()
        read = []
        for word, reader in readers.items():
            self._look(word)
            read.append(reader.read(self._position_in_file(word)))
        return tuple(particle for particle in read if particle is not None)

    def _position_in_file(self, particle: str) -> source.AnyNode | None:
        if self._file is self._root:
            return None
        node = self._file.get("particles")
        entry = node.get(particle) if isinstance(node, source.Mapping) else None
        return entry.get("position") if isinstance(entry, source.Mapping) else None

    def _define_definitions(self) -> None:
        order = {name.value: i for i, (name, _) in enumerate(self._entries("definitions"))}
        for name, node in self._entries("definitions"):
            expression = self._formulas.parse(node, parser.parse)
            uses: set[str] = set()
            if expression is not None:
                self._defined[name.value] = expression
                uses = tree.names(expression.tree)
            self._scope.define(name.value, self._definition_finder(name.value, expression, order), uses)

    def _definition_finder(
        self, name: str, expression: model.Expression | None, order: Mapping[str, int]
    ) -> Callable[[], Any]:
        def lookup(node: tree.Node) -> Any:
            used = str(getattr(node, "owner", getattr(node, "name", "")))
            if used in order and order[used] >= order[name]:
                message = f"the definition `{used}` is used before it is declared"
                raise ExpressionError("used-before-declared", message, node.start, node.end)
            return self._scope.lookup(node)

        def find() -> Any:
            if expression is None:
                return None
            return self._formulas.facts(expression, facts.MOTION, "a definition", lookup, "either")

        return find

    def _definitions(self) -> tuple[model.Definition, ...]:
        read = []
        for name, expression in self._defined.items():
            if self._look(name) is not None:
                read.append(model.Definition(name, expression))
        return tuple(read)

    def _lagrangian(self) -> model.Expression | None:
        node = self._root.get("lagrangian")
        if node is None or source.is_empty(node):
            return None
        return self._formulas.scalar(node, facts.MOTION, "a Lagrangian")

    def _forces(self, particles: tuple[model.Particle, ...]) -> tuple[model.Force, ...]:
        forces: tuple[model.Force, ...] = self._named(
            "forces", functools.partial(sections.force, self._formulas)
        )
        masses = {p.name: p.mass_value for p in particles}
        for force in forces:
            if isinstance(force, model.ParticleForce):
                sections.warn_of_shadows(self._formulas, force.force, force.targets, masses)
        return forces

    def _laws(self, section: str, law: Callable[[Formulas, str, source.AnyNode], T | None]) -> tuple[T, ...]:
        """Equations, each written shortly or as a mapping with `equation:`."""

        def one(name: source.Scalar, node: source.AnyNode) -> T | None:
            if isinstance(node, source.Mapping):
                fields = sections.fields(self._formulas, node, keys.FORMAT.key(section)) or {}
                if "equation" not in fields:
                    self._formulas.report(node, "missing-key", "the key `equation` is missing")
                    return None
                node = fields["equation"]
            return law(self._formulas, name.value, node)

        return self._named(section, one)

    def _outputs(self) -> tuple[model.Output, ...]:
        read = []
        for name, node in self._entries("outputs"):
            expression, value = sections.either(self._formulas, node, facts.OUTPUT, "an output")
            self._scope.define(name.value, functools.partial(_same, value))
            if value is not None:
                read.append(model.Output(name.value, expression, isinstance(value, tuple)))
        return tuple(read)

    def _text(self, section: str) -> str:
        node = self._root.get(section)
        return "" if node is None else sections.text(self._formulas, node)

    def _units(self) -> model.Units:
        node = self._root.get("units")
        if node is None or source.is_empty(node):
            return model.Units()
        fields = sections.fields(self._formulas, node, keys.FORMAT.key("units")) or {}
        return model.Units(**{key: sections.text(self._formulas, value) for key, value in fields.items()})

    def _simulation(self, particles: tuple[model.Particle, ...]) -> model.Simulation:
        default = model.Simulation()
        node = self._root.get("simulation")
        if node is None or source.is_empty(node):
            return default
        fields = sections.fields(self._formulas, node, keys.FORMAT.key("simulation"))
        if fields is None:
            return default
        read: dict[str, Any] = {}
        for key, value in fields.items():
            setting = self._setting(key, value, particles)
            if setting is not None:
                read[key] = setting
        if "samples" in fields and "output_step" in fields:
            message = "`samples` and `output_step` both say where the rows stand"
            self._formulas.report(fields["output_step"], "conflicting-keys", message, "keep one of them")
        simulation = dataclasses.replace(default, **read)
        for key, message in settings.faults(simulation):
            self._formulas.report(fields.get(key, node), "bad-setting", message)
        return simulation

    def _setting(self, key: str, node: source.AnyNode, particles: tuple[model.Particle, ...]) -> Any:
        if key == "keep":
            return self._keep(node, particles)
        if key in ("method", "assemble"):
            text = sections.text(self._formulas, node).strip()
            if key == "method":
                return text
            if text not in ("true", "false"):
                self._formulas.report(node, "bad-setting", "`assemble` is `true` or `false`")
            return text == "true"
        value = self._formulas.constant(node, f"the setting `{key}`")
        if key == "samples" and value is not None:
            if value != round(value):
                self._formulas.report(node, "bad-setting", "`samples` is a whole number")
                return None
            return round(value)
        return value

    def _keep(self, node: source.AnyNode, particles: tuple[model.Particle, ...]) -> tuple[str, ...] | None:
        names = sections.name_list(self._formulas, node)
        if names is None:
            return None
        cartesian = [p.name for p in particles if not p.is_dependent]
        components = [f"{name}.{axis}" for name in cartesian for axis in "xyz"]
        known = dict.fromkeys((*self._scope.names("coordinate"), *cartesian, *components))
        for name in names:
            if name.value not in known:
                hint = diagnostics.nearest(name.value, known)
                self._formulas.report(name, "unknown-name", f"there is no coordinate `{name.value}`", hint)
        return tuple(name.value for name in names)
