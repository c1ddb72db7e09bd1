"""The laws of constraints: what makes an equation a holonomic or a differential one, and a condition g >= 0 a one-sided
one, with the restitution of its impacts."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from typing import Literal

import numpy as np

from lagcli import yaml_tree
from lagcli.expression import evaluate, facts, parser, tree
from lagcli.expression.facts import Facts, FactsAlgebra
from lagcli.expression.tree import ExpressionError
from lagcli.input import entries, keys
from lagcli.input.scalars import Formulas
from lagcli.model import family
from lagcli.model.model import Differential, Expression, Holonomic, Inequality

ONE_SIDED = "a one-sided constraint"


def holonomic(formulas: Formulas, entry: yaml_tree.AnyNode) -> Holonomic | None:
    """f(r, q, t) = 0 (D.2), scalar or vector."""
    equation = _equation(formulas, entry, "holonomic")
    if equation is None:
        return None
    algebra = FactsAlgebra(formulas.lookup, facts.POSITION, "a holonomic constraint")
    found = formulas.checked(evaluate.difference, equation, algebra)
    return None if found is None else Holonomic(formulas.members, equation, len(found) == 3)


def differential(formulas: Formulas, entry: yaml_tree.AnyNode) -> Differential | None:
    """A law linear in differentials or in velocities (D.3, D.4), scalar or vector."""
    equation = _equation(formulas, entry, "differential")
    if equation is None:
        return None
    subject, text = "a differential constraint", equation.origin.value
    algebra = FactsAlgebra(formulas.lookup, facts.DIFFERENTIAL, subject, linear=True, text=text)
    found = formulas.checked(evaluate.difference, equation, algebra)
    form = None if found is None else formulas.checked(functools.partial(_form, found), equation, algebra)
    if found is None or form is None:
        return None
    return Differential(formulas.members, equation, len(found) == 3, form)


def _equation(formulas: Formulas, entry: yaml_tree.AnyNode, section: str) -> Expression | None:
    node = entries.written(formulas, entry, section, "equation")
    if isinstance(node, yaml_tree.Sequence):
        message = "an equation is needed here, and this is a list"
        formulas.report(node, "not-an-expression", message, "each equation has an entry of its own")
        return None
    return None if node is None else formulas.parse(node, parser.parse_equation)


def _form(
    found: tuple[Facts, ...], node: tree.Node, algebra: FactsAlgebra
) -> Literal["differentials", "velocities"]:
    """How the law is written. Raises `ExpressionError` where it is in neither form, or in both."""
    everything = frozenset[facts.Flag]().union(*(part.reads for part in found))
    if "differential" not in everything:
        if "velocity" not in everything:
            hint = "write `d(x)` or `rate(x)`, `a.vx`; a law in positions belongs under `holonomic`"
            message = "a differential constraint needs differentials or velocities"
            raise ExpressionError("no-differential", message, node.start, node.end, hint)
        return "velocities"
    # The terms a user sees: the summands of both sides.
    waiting, terms = [node], list[tree.Node]()
    while waiting:
        part = waiting.pop()
        if isinstance(part, (tree.Relation, tree.Sum)):
            waiting += reversed(tree.children(part))
        else:
            terms.append(part)
    for term in terms:
        value = evaluate.value(term, algebra)
        parts = value if isinstance(value, tuple) else (value,)
        if any("velocity" in part.reads for part in parts):
            message = "differentials and velocities are mixed in one equation"
            hint = "write the whole law with `d(...)` and `dt`, or the whole law with rates"
            raise ExpressionError("mixed-forms", message, term.start, term.end, hint)
        if any(part.low == 0 and np.any(part.value != 0.0) for part in parts):
            message = "every term of a law in differentials holds a differential, and this one holds none"
            raise ExpressionError("no-differential", message, term.start, term.end, "multiply it by `dt`")
    return "differentials"


def inequality(formulas: Formulas, entry: yaml_tree.AnyNode) -> Inequality | None:
    """g(r, q, t) >= 0, written shortly or with its restitution."""
    found: dict[str, yaml_tree.AnyNode] = {"condition": entry}
    if isinstance(entry, yaml_tree.Mapping):
        found = entries.fields(formulas, entry, keys.FORMAT.key("inequality")) or {}
    condition = None
    node = found.get("condition")
    if isinstance(node, yaml_tree.Sequence):
        message = "a condition is needed here, and this is a list"
        formulas.report(node, "bad-condition", message, "each condition has an entry of its own")
    elif node is not None:
        condition = formulas.parse(node, parser.parse_condition)
    algebra = FactsAlgebra(formulas.lookup, facts.POSITION, ONE_SIDED)
    if condition is not None and formulas.checked(_gap, condition, algebra) is None:
        condition = None
    values = formulas.values(0.0)
    if "restitution" in found:
        node = found["restitution"]
        given = formulas.written_constants(node, "a coefficient of restitution")
        if given is None:
            return None
        values = given[1]
        outside = ~((values >= 0.0) & (values <= 1.0))
        if outside.any():
            first = int(np.argmax(outside))
            message = f"a coefficient of restitution lies between 0 and 1, and this one is {values[first]:g}"
            hint = "at 0 nothing bounces, at 1 an impact takes no energy"
            formulas.report(node, "restitution-out-of-range", message + formulas.where(first), hint)
            return None
    return None if condition is None else Inequality(formulas.members, condition, values)


def _gap(node: tree.Node, algebra: FactsAlgebra) -> Facts:
    """The facts of left - right. Raises `ExpressionError` for what is no condition on coordinates."""
    assert isinstance(node, tree.Relation)
    left, right = evaluate.value(node.left, algebra), evaluate.value(node.right, algebra)
    if isinstance(left, tuple) or isinstance(right, tuple):
        message = "a condition compares two numbers, and here is a vector"
        hint = "give each component an entry of its own, `a.x >= 0`; a distance is `norm(a) >= 1`"
        raise ExpressionError("bad-condition", message, node.start, node.end, hint)
    found = algebra.operation(node, "sub", left, right)
    if "position" not in found.reads:
        what = "only the time `t`" if found.reads else "only constants"
        message = f"{ONE_SIDED} holds coordinates, and this one holds {what}"
        hint = "its force acts on the coordinates in it: without any there is none"
        raise ExpressionError("nothing-to-push", message, node.start, node.end, hint)
    return found


def pieces(formulas: Formulas, law: Inequality) -> tuple[Inequality, ...]:
    """The walls that a condition holds at once: min(g, h) >= 0 is g >= 0 and h >= 0, and so is a.z >= max(g, h). Sums,
    numbers as factors and nested calls are gone through; the walls of `name` are `name[1]`, `name[2]`, ... One of t
    alone, and a `max` of which one part is enough, stays as it is."""
    relation, origin = law.equation.tree, law.equation.origin
    assert isinstance(relation, tree.Relation)
    algebra = FactsAlgebra(formulas.lookup, facts.POSITION, ONE_SIDED)
    difference = tree.Sum(relation.start, relation.end, ((1, relation.left), (-1, relation.right)))
    texts = _smooth_parts(difference, 1, origin.value, algebra)
    if len(texts) < 2:
        return (law,)
    found = []
    for number, text in enumerate(texts, start=1):
        condition = parser.parse_condition(f"{text} >= 0")
        try:
            _gap(condition, algebra)
        except ExpressionError:
            return (law,)  # a part without coordinates is no wall
        indices = [(*index, number) for index in law.members.indices]
        members = family.with_indices(law.members.base, indices, law.members.variables)
        equation = Expression(condition, dataclasses.replace(origin, value=f"{text} >= 0"))
        found.append(Inequality(members, equation, law.restitution))
    return tuple(found)


def _smooth_parts(node: tree.Node, sign: int, text: str, algebra: FactsAlgebra) -> list[str]:
    """The texts of smooth parts of a node, or of its negative, of which the least is a condition; each with its sign
    before it."""
    if isinstance(node, tree.Sum):
        parts = [_smooth_parts(term, sign * own, text, algebra) for own, term in node.terms]
        return [" ".join(each) for each in itertools.product(*parts)]
    if isinstance(node, tree.Call):
        value = evaluate.value(node, algebra)
        moves = not isinstance(value, tuple) and "position" in value.reads
        if moves and node.function == ("min" if sign > 0 else "max"):
            return [part for each in node.arguments for part in _smooth_parts(each, sign, text, algebra)]
        if moves and node.function == "abs" and sign < 0:
            return [part for way in (1, -1) for part in _smooth_parts(node.arguments[0], way, text, algebra)]
    if isinstance(node, tree.Product):
        numbers = [(way, each) for way, each in node.factors if isinstance(each, tree.Number)]
        others = [each for each in node.factors if not isinstance(each[1], tree.Number)]
        if len(others) == 1 and others[0][0] > 0:
            by = "".join(f"{'*' if way > 0 else '/'}{number.text}" for way, number in numbers)
            inner = _smooth_parts(others[0][1], sign, text, algebra)
            return [f"+ ({part.removeprefix('+ ')}){by}" for part in inner]
    return [f"{'+' if sign > 0 else '-'} ({text[node.start : node.end]})"]
