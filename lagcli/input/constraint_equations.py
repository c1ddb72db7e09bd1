"""Holonomic and differential equations: what makes an equation a constraint of the one kind or the other."""

from __future__ import annotations

from typing import Literal

import numpy as np

from lagcli import yaml_tree
from lagcli.expression import evaluate, facts, parser, tree
from lagcli.expression.facts import Facts, FactsAlgebra
from lagcli.expression.tree import ExpressionError
from lagcli.input import entries
from lagcli.input.scalars import Formulas
from lagcli.model.model import Differential, Expression, Holonomic


def holonomic(formulas: Formulas, entry: yaml_tree.AnyNode) -> Holonomic | None:
    """f(r, q, t) = 0 (D.2), scalar or vector."""
    equation = _equation(formulas, entry, "holonomic")
    if equation is None:
        return None
    algebra = FactsAlgebra(formulas.lookup, facts.POSITION, "a holonomic constraint")
    found = _difference(formulas, equation, algebra)
    return None if found is None else Holonomic(formulas.members, equation, len(found) == 3)


def differential(formulas: Formulas, entry: yaml_tree.AnyNode) -> Differential | None:
    """A law linear in differentials or in velocities (D.3, D.4), scalar or vector."""
    equation = _equation(formulas, entry, "differential")
    if equation is None:
        return None
    subject, text = "a differential constraint", equation.origin.value
    algebra = FactsAlgebra(formulas.lookup, facts.DIFFERENTIAL, subject, linear=True, text=text)
    found = _difference(formulas, equation, algebra)
    if found is None:
        return None
    try:
        in_differentials = _form(equation.tree, found, algebra)
    except ExpressionError as error:
        formulas.trouble(equation.origin, error)
        return None
    form: Literal["differentials", "velocities"] = "differentials" if in_differentials else "velocities"
    return Differential(formulas.members, equation, len(found) == 3, form)


def _equation(formulas: Formulas, entry: yaml_tree.AnyNode, section: str) -> Expression | None:
    """The equation of an entry, written shortly or under `equation:`."""
    node = entries.written(formulas, entry, section, "equation")
    return None if node is None else formulas.parse(node, parser.parse_equation)


def _difference(formulas: Formulas, equation: Expression, algebra: FactsAlgebra) -> tuple[Facts, ...] | None:
    assert isinstance(equation.tree, tree.Relation)
    try:
        return evaluate.difference(equation.tree, algebra)
    except ExpressionError as error:
        formulas.trouble(equation.origin, error)
        formulas.unknown_names(equation, formulas.lookup)
        return None


def _form(node: tree.Node, found: tuple[Facts, ...], algebra: FactsAlgebra) -> bool:
    """True if the law is written in differentials; raises where it is in neither form, or in both."""
    everything = frozenset[facts.Flag]().union(*(part.reads for part in found))
    terms = list(_terms(node))
    if "differential" not in everything:
        if "velocity" not in everything:
            hint = "write `d(x)` or `rate(x)`, `a.vx`; a law in whole coordinates belongs under `holonomic`"
            message = "a differential constraint needs differentials or velocities"
            raise ExpressionError("no-differential", message, node.start, node.end, hint)
        return False
    for term in terms:
        value = evaluate.evaluate(term, algebra)
        parts = value if isinstance(value, tuple) else (value,)
        if any("velocity" in part.reads for part in parts):
            message = "differentials and velocities are mixed in one equation"
            hint = "write the whole law with `d(...)` and `dt`, or the whole law with rates"
            raise ExpressionError("mixed-forms", message, term.start, term.end, hint)
        if any(part.low == 0 and np.any(part.value != 0.0) for part in parts):
            message = "every term of a law in differentials holds a differential, and this one holds none"
            raise ExpressionError("no-differential", message, term.start, term.end, "multiply it by `dt`")
    return True


def _terms(node: tree.Node) -> list[tree.Node]:
    """The terms a user sees: the summands of both sides."""
    if isinstance(node, tree.Relation):
        return _terms(node.left) + _terms(node.right)
    if isinstance(node, tree.Sum):
        return [part for _, term in node.terms for part in _terms(term)]
    return [node]
