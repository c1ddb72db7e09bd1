"""A number that comes with an option, as a number or as an expression of the model's parameters."""

from __future__ import annotations

import math

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, facts, parser, tree
from lagcli.expression.facts import Either, Facts
from lagcli.expression.tree import ExpressionError
from lagcli.input.overrides import OverrideError
from lagcli.model.model import Model


def number(model: Model, label: str, value: object) -> float:
    """The number that `value` stands for; `label`: what it was given with, such as `--mu blade`.

    Raises `OverrideError` where it is neither a number nor a text, `ModelError`, located, for an expression that is
    none of parameters.
    """
    if isinstance(value, int | float):
        if not math.isfinite(value):
            raise OverrideError(f"{label}: {value} is not a finite number")
        return float(value)
    if not isinstance(value, str):
        raise OverrideError(f"{label}: a number or an expression is needed, not {type(value).__name__}")
    if not value.strip():
        raise OverrideError(f"{label}: an expression is missing")
    known = {p.name: p.value for p in model.parameters} | model.constants
    origin = yaml_tree.scalar(value, label)

    def lookup(node: tree.Node) -> Either:
        if isinstance(node, tree.Name) and node.name in known:
            found = known[node.name]
            if isinstance(found, tuple):
                x, y, z = map(Facts, found)
                return x, y, z
            return Facts(found)
        hint = diagnostics.nearest(getattr(node, "name", ""), known)
        message = f"`{value[node.start : node.end]}` is no parameter of the model"
        raise ExpressionError("unknown-name", message, node.start, node.end, hint)

    try:
        algebra = facts.FactsAlgebra(lookup, facts.NOTHING, "a value that is given")
        return float(facts.constant(evaluate.scalar(parser.parse(value), algebra)))
    except ExpressionError as error:
        location = origin.locate(error.start, error.end)
        raise diagnostics.ModelError(
            [diagnostics.Diagnostic(error.code, error.message, location, error.hint)]
        ) from None
