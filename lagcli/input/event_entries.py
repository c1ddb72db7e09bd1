"""The entries of `events`: an expression, the direction in which it crosses zero, and what happens then."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeVar

from lagcli import yaml_tree
from lagcli.errors import diagnostics, meant
from lagcli.expression import facts, parser
from lagcli.input import entries, keys
from lagcli.input.scalars import Formulas
from lagcli.model.model import DeclaredEvent, Expression

DIRECTIONS: dict[str, Literal["up", "down", "both"]] = {"up": "up", "down": "down", "both": "both"}
ACTIONS: dict[str, Literal["record", "stop"]] = {"record": "record", "stop": "stop"}
Word = TypeVar("Word", bound=str)


def event(formulas: Formulas, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> DeclaredEvent | None:
    """An event, or None with what is wrong with it reported."""
    found = entries.fields(formulas, node, keys.FORMAT.key("events"))
    if found is None:
        return None
    when = _when(formulas, found["when"]) if "when" in found else None
    direction = _word(formulas, found, "direction", "both", DIRECTIONS)
    action = _word(formulas, found, "action", "record", ACTIONS)
    if when is None or direction is None or action is None:
        return None
    return DeclaredEvent(name.value, when, direction, action)


def _when(formulas: Formulas, node: yaml_tree.AnyNode) -> Expression | None:
    expression = formulas.parse(node, parser.parse_crossing)
    found = None if expression is None else formulas.facts(expression, facts.OUTPUT, "an event")
    if found is not None and found.value is not None:
        message = "this expression is a constant, and an event is where one crosses zero"
        formulas.report(node, "never-crosses", message, "for example `a.z`, or `t - 1` for an instant")
        return None
    return None if found is None else expression


def _word(
    formulas: Formulas,
    found: Mapping[str, yaml_tree.AnyNode],
    key: str,
    default: str,
    words: Mapping[str, Word],
) -> Word | None:
    """The word under a key, or None with the error reported."""
    if key not in found:
        return words[default]
    node = found[key]
    written = entries.text(formulas, node).strip()
    if written in words:
        return words[written]
    if isinstance(node, yaml_tree.Scalar):
        listed = " or ".join(f"`{word}`" for word in words)
        message = f"the `{key}` of an event is {listed}"
        known = meant.words(f"values of {key}").get(written.casefold())
        hint = f"did you mean `{known}`?" if known else diagnostics.nearest(written, words)
        formulas.report(node, "bad-setting", message, hint)
    return None
