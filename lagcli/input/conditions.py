"""One-sided constraints: what makes a condition g >= 0 one, and the restitution of its impacts."""

from __future__ import annotations

import numpy as np

from lagcli import yaml_tree
from lagcli.expression import evaluate, facts, parser, tree
from lagcli.expression.facts import FactsAlgebra
from lagcli.expression.tree import ExpressionError
from lagcli.input import entries, keys
from lagcli.input.scalars import Formulas
from lagcli.model.model import Expression, Floats, Inequality

SUBJECT = "a one-sided constraint"


def inequality(formulas: Formulas, entry: yaml_tree.AnyNode) -> Inequality | None:
    """g(r, q, t) >= 0, written shortly or with its restitution."""
    section = keys.FORMAT.key("inequality")
    found: dict[str, yaml_tree.AnyNode] = {"condition": entry}
    if isinstance(entry, yaml_tree.Mapping):
        found = entries.fields(formulas, entry, section) or {}
    condition = _condition(formulas, found["condition"]) if "condition" in found else None
    restitution = _restitution(formulas, found.get("restitution"))
    if condition is None or restitution is None:
        return None
    return Inequality(formulas.members, condition, restitution)


def _condition(formulas: Formulas, node: yaml_tree.AnyNode) -> Expression | None:
    if isinstance(node, yaml_tree.Sequence):
        message = "a condition is needed here, and this is a list"
        formulas.report(node, "bad-condition", message, "each condition has an entry of its own")
        return None
    condition = formulas.parse(node, parser.parse_condition)
    if condition is None:
        return None
    assert isinstance(condition.tree, tree.Relation)
    algebra = FactsAlgebra(formulas.lookup, facts.POSITION, SUBJECT)
    try:
        _check(condition.tree, algebra)
    except ExpressionError as error:
        formulas.trouble(condition.origin, error)
        formulas.unknown_names(condition, formulas.lookup)
        return None
    return condition


def _check(node: tree.Relation, algebra: FactsAlgebra) -> None:
    """Raise `ExpressionError` for what is no condition on coordinates."""
    left, right = evaluate.evaluate(node.left, algebra), evaluate.evaluate(node.right, algebra)
    if isinstance(left, tuple) or isinstance(right, tuple):
        message = "a condition compares two numbers, and here is a vector"
        hint = "give each component an entry of its own, `a.x >= 0`; a distance is `norm(a) >= 1`"
        raise ExpressionError("bad-condition", message, node.start, node.end, hint)
    reads = algebra.add(node, left, -1, right).reads
    if "position" not in reads:
        what = "only the time `t`" if reads else "only constants"
        message = f"{SUBJECT} holds coordinates, and this one holds {what}"
        hint = "its force acts on the coordinates in it: without any there is none"
        raise ExpressionError("nothing-to-push", message, node.start, node.end, hint)


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
