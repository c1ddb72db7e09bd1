"""Scalars of the document -> checked expressions; here alone an expression's trouble becomes a diagnostic."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, MutableMapping
from typing import TypeVar

import numpy as np

from lagcli import yaml_tree
from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, facts, hints, parser, tree
from lagcli.expression.facts import Either, Facts, FactsAlgebra, Flag, Lookup
from lagcli.expression.tree import ExpressionError
from lagcli.input import namespace
from lagcli.input import scope as scopes
from lagcli.model import family
from lagcli.model.family import Family
from lagcli.model.model import Expression, VectorExpression

T = TypeVar("T")

ALONE = family.one("")

# Parts of expressions times members of families: what one model may ask to be evaluated, some seconds of it.
MAX_WORK = 100_000_000
LARGE = 1000  # members from which on parts are counted
# Functions in whose arguments names are looked up: those of `rate` and others are special, a misspelt one's may be.
_SEARCHED = frozenset(evaluate.FUNCTION_NAMES) - {"rate", "multiplier", "reaction"}

Trees = MutableMapping[tuple[Callable[[str], tree.Node], str], tree.Node]


@dataclasses.dataclass(slots=True)
class Reading:
    """What the expressions of one model share: the trees of texts, many of which are written often, and the work that
    is left."""

    trees: Trees = dataclasses.field(default_factory=dict)
    work: int = MAX_WORK


class Formulas:
    """Reads expressions of an entry in a scope; what is wrong goes to the collector and the answer is None. The
    expression of a family is read once; constants in it are arrays, one value for each of its `members`."""

    def __init__(
        self,
        scope: scopes.Scope,
        found: diagnostics.Collector,
        members: Family | None = None,
        reading: Reading | None = None,
    ) -> None:
        self.scope = scope
        self.found = found
        self.members = members or ALONE
        self._reading = reading or Reading()
        self.lookup = scope.lookup_in(self.members)

    def within(self, members: Family) -> Formulas:
        return Formulas(self.scope, self.found, members, self._reading)

    def report(self, node: yaml_tree.AnyNode, code: str, message: str, hint: str = "") -> None:
        if isinstance(node, yaml_tree.Scalar) and node.is_torn:
            hint = yaml_tree.QUOTES
        self.found.add(diagnostics.Diagnostic(code, message, node.location, hint))

    def trouble(self, origin: yaml_tree.Scalar, error: ExpressionError) -> None:
        if error.code != namespace.BROKEN:
            location = origin.locate(error.start, error.end)
            hint = yaml_tree.QUOTES if origin.is_torn else error.hint
            if error.code == "unknown-function" and (
                self.scope.names.kind(origin.value[error.start : error.end]) is not None
            ):
                hint = hints.AT_A_TIME
            message = error.message + self.where(error.member)
            self.found.add(diagnostics.Diagnostic(error.code, message, location, hint))

    def where(self, member: int | None) -> str:
        """The end of a sentence about one member of a family, the first it is true of."""
        if member is None or not self.members.variables:
            return ""
        return f" (first where {self.members.at(member)})"

    def parse(self, node: yaml_tree.AnyNode, read: Callable[[str], tree.Node]) -> Expression | None:
        if not isinstance(node, yaml_tree.Scalar):
            shape, hint = "mapping", "write the expression itself after the colon"
            if isinstance(node, yaml_tree.Sequence):
                shape, hint = "list", "an expression that begins with `[` needs quotes"
            message = f"an expression is needed here, and this is a {shape}"
            self.report(node, "not-an-expression", message, hint)
            return None
        if yaml_tree.is_empty(node):
            self.report(node, "missing-value", "an expression is missing")
            return None
        trees = self._reading.trees
        known = trees.get((read, node.value))
        if known is None:
            try:
                known = read(node.value)
                if self.scope.bodies:
                    from lagcli.input import body_points  # most models have none

                    known = body_points.expanded(known, self.scope.bodies)
                trees[read, node.value] = known
            except ExpressionError as error:
                self.trouble(node, error)
                return None
        return Expression(known, node) if self.can_evaluate(node, known, self.members.count) else None

    def can_evaluate(self, node: yaml_tree.AnyNode, found: tree.Node, count: int) -> bool:
        """True if an expression may be evaluated for this many members; if not, that is reported."""
        reading = self._reading
        if count < LARGE:
            return True
        if reading.work < 0:
            return False  # that has been reported
        parts = sum(1 for _ in itertools.islice(tree.walk(found), reading.work // count + 1))
        reading.work -= parts * count
        if reading.work >= 0:
            return True
        message = f"the expressions of all members have together more than {MAX_WORK} parts"
        self.report(node, "too-many-members", message, "shorten the expression, or the family")
        return False

    def facts(
        self, expression: Expression, allowed: frozenset[Flag], subject: str, lookup: Lookup | None = None
    ) -> Facts | None:
        """Facts of a checked scalar expression, or None where it is wrong."""
        algebra = FactsAlgebra(lookup or self.lookup, allowed, subject)
        return self.checked(evaluate.scalar, expression, algebra)

    def either_facts(
        self, expression: Expression, allowed: frozenset[Flag], subject: str, lookup: Lookup | None = None
    ) -> Either | None:
        """Facts of a checked expression of a scalar or a vector, or None where it is wrong."""
        algebra = FactsAlgebra(lookup or self.lookup, allowed, subject)
        return self.checked(evaluate.value, expression, algebra)

    def checked(
        self, read: Callable[[tree.Node, FactsAlgebra], T], expression: Expression, algebra: FactsAlgebra
    ) -> T | None:
        """What `read` makes of an expression; None where it raises, which is reported, with all unknown names."""
        try:
            return read(expression.tree, algebra)
        except ExpressionError as error:
            self.trouble(expression.origin, error)
            if error.code == "syntax":  # names are not what they seem
                return None
        waiting = [expression.tree]
        while waiting:
            node = waiting.pop()
            if isinstance(node, tree.Reference):
                try:
                    algebra.lookup(node)
                except ExpressionError as error:
                    if error.code == "unknown-name":
                        self.trouble(expression.origin, error)
            elif not isinstance(node, tree.Call) or node.function in _SEARCHED:
                waiting += tree.children(node)
        return None

    def scalar(self, node: yaml_tree.AnyNode, allowed: frozenset[Flag], subject: str) -> Expression | None:
        expression = self.parse(node, parser.parse)
        is_right = expression is not None and self.facts(expression, allowed, subject) is not None
        return expression if is_right else None

    def constant(self, node: yaml_tree.AnyNode, subject: str) -> float | None:
        found = self.written_constants(node, subject)
        return None if found is None else float(found[1][0])

    def written_constants(self, node: yaml_tree.AnyNode, subject: str) -> tuple[Expression, Floats] | None:
        """An expression of parameters and indices, and its values, one for each member, (K,)."""
        expression = self.parse(node, parser.parse)
        if expression is None:
            return None
        found = self.facts(expression, facts.NOTHING, subject)
        return None if found is None else (expression, self.values(facts.constant(found)))

    def values(self, value: float | Floats) -> Floats:
        """A constant as one value for each member, (K,)."""
        if self.members.count == 1:
            return np.array([value] if isinstance(value, float) else value, dtype=float).reshape(1)
        return np.array(np.broadcast_to(value, self.members.count), dtype=float)

    def vector_expression(self, node: yaml_tree.AnyNode) -> VectorExpression | None:
        """A list of three expressions or one vector expression, parsed."""
        if isinstance(node, yaml_tree.Mapping):
            message = "a vector is needed here, and this is a mapping"
            self.report(node, "not-an-expression", message, "a vector is a list: `[x, y, z]`")
            return None
        if not isinstance(node, yaml_tree.Sequence):
            expression = self.parse(node, parser.parse)
            return None if expression is None else VectorExpression((expression,))
        if len(node.items) != 3:
            message = f"a vector has three components, and this one has {len(node.items)}"
            torn = any(isinstance(item, yaml_tree.Scalar) and item.is_torn for item in node.items)
            hint = yaml_tree.QUOTES if torn else hints.vector(len(node.items))
            self.report(node, "vector-length", message, hint)
            return None
        parsed = [self.parse(item, parser.parse) for item in node.items]
        parts = tuple(part for part in parsed if part is not None)
        return VectorExpression(parts) if len(parts) == 3 else None

    def vector_facts(
        self, vector: VectorExpression, allowed: frozenset[Flag], subject: str, lookup: Lookup | None = None
    ) -> tuple[Facts, Facts, Facts] | None:
        if len(vector.parts) == 1:
            algebra = FactsAlgebra(lookup or self.lookup, allowed, subject)
            return self.checked(evaluate.vector, vector.parts[0], algebra)
        x, y, z = (self.facts(part, allowed, subject, lookup) for part in vector.parts)
        return None if x is None or y is None or z is None else (x, y, z)

    def constant_vectors(self, node: yaml_tree.AnyNode, subject: str) -> Floats | None:
        """The values of a vector of parameters and indices, one for each member, (K, 3)."""
        vector = self.vector_expression(node)
        found = None if vector is None else self.vector_facts(vector, facts.NOTHING, subject)
        return None if found is None else self.vectors(found)

    def vectors(self, found: tuple[Facts, Facts, Facts]) -> Floats:
        """The values of three constants, one vector for each member, (K, 3)."""
        values = [facts.constant(part) for part in found]
        if self.members.count == 1 and all(isinstance(value, float) for value in values):
            return np.array([values])
        return np.column_stack([self.values(value) for value in values])
