"""One-sided constraints: what makes a condition g >= 0 one, and the restitution of its impacts."""

from __future__ import annotations

import numpy as np

from lagcli import yaml_tree
from lagcli.expression import facts, parser, tree
from lagcli.expression.facts import Facts, FactsAlgebra
from lagcli.expression.tree import ExpressionError
from lagcli.input import constraint_equations, entries, keys, scope
from lagcli.input.scalars import Formulas
from lagcli.model.model import Expression, Floats, Inequality

SUBJECT = "a one-sided constraint"


def inequality(formulas: Formulas, entry: yaml_tree.AnyNode) -> Inequality | None:
    """g(r, q, t) >= 0, written shortly or with its restitution."""
    section = keys.FORMAT.key("inequality")
    found: dict[str, yaml_tree.AnyNode] = {"condition": entry}
    if isinstance(entry, yaml_tree.Mapping):
        found = entries.fields(formulas, entry, section) or {}
    node = entries.required(formulas, entry, found, "condition")
    condition = None if node is None else _condition(formulas, node)
    restitution = _restitution(formulas, found.get("restitution"))
    if condition is None or restitution is None:
        return None
    return Inequality(formulas.members, condition, restitution)


def _condition(formulas: Formulas, node: yaml_tree.AnyNode) -> Expression | None:
    condition = formulas.parse(node, parser.parse_condition)
    if condition is None:
        return None
    algebra = FactsAlgebra(formulas.lookup, facts.POSITION, SUBJECT)
    found = constraint_equations.difference(formulas, condition, algebra)
    trouble = None if found is None else _trouble(condition.tree, found)
    if trouble is not None:
        formulas.trouble(condition.origin, trouble)
    return condition if found is not None and trouble is None else None


def _trouble(node: tree.Node, found: tuple[Facts, ...]) -> ExpressionError | None:
    """The error of a condition whose difference has these facts."""
    if len(found) == 3:
        message = "a condition compares two numbers, and these are vectors"
        hint = "give each component an entry of its own, `a.x >= 0`; a distance is `norm(a) >= 1`"
        return ExpressionError("bad-condition", message, node.start, node.end, hint)
    reads = scope.reads(found)
    if "position" not in reads:
        what = "only the time `t`" if reads else "only constants"
        message = f"{SUBJECT} holds coordinates, and this one holds {what}"
        hint = "its force acts on the coordinates in it: without any there is none"
        return ExpressionError("nothing-to-push", message, node.start, node.end, hint)
    return None


def _restitution(formulas: Formulas, node: yaml_tree.AnyNode | None) -> Floats | None:
    """The coefficients of restitution, (K,), or None with the error reported."""
    if node is None:
        return formulas.values(0.0)
    values = formulas.constants(node, "a coefficient of restitution")
    if values is None:
        return None
    outside = ~((values >= 0.0) & (values <= 1.0))
    if outside.any():
        first = int(np.argmax(outside))
        message = f"a coefficient of restitution lies between 0 and 1, and this one is {values[first]:g}"
        hint = "at 0 nothing bounces, at 1 an impact takes no energy"
        formulas.report(node, "restitution-out-of-range", message + formulas.where(first), hint)
        return None
    return values
