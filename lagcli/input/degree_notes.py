"""Notes on numbers that look like degrees: larger than a full turn, and used as an angle as they stand."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.expression import functions, tree
from lagcli.model.model import Expression

FULL_TURN = 2 * math.pi  # radians: a start beyond it is possible, but seldom meant
_FUNCTIONS = functions.named(lambda row: row.angle == "argument")
_CALLS = functions.calls(lambda row: row.angle == "argument")


def notes(root: yaml_tree.Mapping, expressions: Iterable[Expression]) -> Iterator[diagnostics.Diagnostic]:
    """A note for each number beyond a full turn that is an argument, or a term of one, of sin, cos or tan."""
    large = dict(_large(root))
    noted: set[str] = set()
    for expression in expressions:
        if not expression.words & _CALLS:
            continue
        for call, part in _arguments(expression.tree):
            shown = expression.origin.value[call.start : call.end]
            if isinstance(part, tree.Number):
                if abs(float(part.text)) > FULL_TURN:
                    yield _note(part.text, part.text, shown, expression.origin.locate(part.start, part.end))
                continue
            name = part.owner if isinstance(part, tree.Index) else part.name
            if name in large and name not in noted:
                noted.add(name)
                node = large[name]
                yield _note(f"{name} = {node.value.strip()}", node.value.strip(), shown, node.location)


def _note(what: str, number: str, shown: str, location: diagnostics.Location) -> diagnostics.Diagnostic:
    message = f"`{what}` is more than a full turn in radians, and `{shown}` takes it as an angle"
    hint = f"if degrees are meant, write `{number}*deg`"
    return diagnostics.Diagnostic("angle-in-degrees", message, location, hint, "note")


def _large(root: yaml_tree.Mapping) -> Iterator[tuple[str, yaml_tree.Scalar]]:
    """Parameters and starts of coordinates that are plain numbers beyond a full turn, by base name."""
    for section in ("parameters", "coordinates"):
        node = root.get(section)
        for name, value in node if isinstance(node, yaml_tree.Mapping) else ():
            start = value.get("value") if isinstance(value, yaml_tree.Mapping) else value
            if isinstance(start, yaml_tree.Scalar) and abs(_number(start.value)) > FULL_TURN:
                yield name.value.partition("[")[0], start


def _number(text: str) -> float:
    """The number a text is; 0 for any other text."""
    try:
        return float(text)
    except ValueError:
        return 0.0


def _arguments(node: tree.Node) -> Iterator[tuple[tree.Call, tree.Number | tree.Name | tree.Index]]:
    """Each call of sin, cos, tan with its argument, or the terms of it, that are plain numbers or names."""
    for part in tree.walk(node):
        if isinstance(part, tree.Call) and part.function in _FUNCTIONS:
            for argument in part.arguments:
                terms = [term for _, term in argument.terms] if isinstance(argument, tree.Sum) else [argument]
                for term in terms:
                    if isinstance(term, (tree.Number, tree.Name)) or (
                        isinstance(term, tree.Index) and not term.member
                    ):
                        yield part, term
