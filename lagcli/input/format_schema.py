"""The model format as a JSON Schema, for editors: made from the table of keys that the reader itself goes by. It knows
shapes; what a formula means is for `lagcli check`."""

from __future__ import annotations

import json
import re
from typing import TypeAlias

from lagcli import yaml_tree
from lagcli.input import entry_names, keys, namespace

Json: TypeAlias = "str | float | bool | list[Json] | dict[str, Json] | None"
Schema: TypeAlias = dict[str, Json]

# The draft that editors know best.
DRAFT = "http://json-schema.org/draft-07/schema#"
FILE = "lagcli.schema.json"  # the name it is written under, beside the models
MARK = "# yaml-language-server: $schema="
EDITOR_LINE = f"{MARK}{FILE}"

_TEXT: Schema = {"type": ["string", "number", "boolean", "null"]}
_FORMULA: Schema = {"type": ["string", "number"]}
_NAME: Schema = {"type": "string"}
_VECTOR: Schema = {
    "anyOf": [{"type": "array", "items": dict(_FORMULA), "minItems": 3, "maxItems": 3}, {"type": "string"}]
}
_MATRIX: Schema = {"type": "array", "items": dict(_VECTOR), "minItems": 3, "maxItems": 3}
# What a key of the table may hold; words in backticks are a choice, and need no line here.
_SHAPES: dict[str, Schema] = {
    "text": _TEXT,
    "expression": _FORMULA,
    "expression of parameters": _FORMULA,
    "equation": _FORMULA,
    "condition": {"type": "string"},
    "whole number": _FORMULA,
    "vector": _VECTOR,
    "vector of parameters": _VECTOR,
    "vector or expression": {"anyOf": [*_VECTOR["anyOf"], {"type": "number"}]},  # type: ignore[misc]
    "number, expression or vector": {"anyOf": [*_VECTOR["anyOf"], {"type": "number"}]},  # type: ignore[misc]
    "name, list of names or `all`": {"anyOf": [_NAME, {"type": "array", "items": _NAME, "minItems": 1}]},
    "list of particles": {"anyOf": [{"type": "array", "items": _NAME, "minItems": 1}, _NAME]},
    "list of coordinates": {"anyOf": [{"type": "array", "items": _NAME}, {"type": ["string", "null"]}]},
    **dict.fromkeys(("point", "direction", "three lengths"), _VECTOR),
    "body": _NAME,
    "two bodies": {"type": "array", "items": _NAME, "minItems": 2, "maxItems": 2},
    "two lengths": {"type": "array", "items": dict(_FORMULA), "minItems": 2, "maxItems": 2},
    "two directions": {"type": "array", "items": dict(_VECTOR), "minItems": 2, "maxItems": 2},
    "place, or two places": {
        "anyOf": [*_VECTOR["anyOf"], {"type": "array", "items": dict(_VECTOR), "minItems": 2, "maxItems": 2}]  # type: ignore[misc]
    },
    "four numbers": {"type": "array", "items": dict(_FORMULA), "minItems": 4, "maxItems": 4},
    "three rows of three": _MATRIX,
    "three moments, or three rows of three": {"anyOf": [*_VECTOR["anyOf"], _MATRIX]},  # type: ignore[misc]
    "axes and angles": {"type": "array", "minItems": 4, "maxItems": 4},
    "range or list of ranges": {
        "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]
    },
}
_CHOICE = re.compile(r"`([^`]+)`")
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")
# A name of ASCII letters, digits, `_`, and of any letters beyond ASCII; in a way that every dialect of patterns reads.
_WORD = r"[^\u0000-@\[-\^`{-\u007f][^\u0000-/:-@\[-\^`{-\u007f]*"
_INDICES = r"(\s*\[[^\[\]]+\])*\s*"


def schema() -> Schema:
    """The whole schema, as JSON values."""
    head: Schema = {
        "$schema": DRAFT,
        "title": "lagcli model, format version 1",
        "description": "A constrained mechanical system: particles and coordinates, forces, constraints.",
    }
    return {**head, **_mapping(keys.FORMAT)}


def text() -> str:
    """The whole schema as the text of a file."""
    return json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"


def plain(node: yaml_tree.AnyNode) -> Json:
    """The value that an editor takes a node for, by the core types of YAML: numbers, truths, nothing, else texts."""
    match node:
        case yaml_tree.Mapping():
            return {name.value: plain(value) for name, value in node}
        case yaml_tree.Sequence():
            return [plain(item) for item in node.items]
    if node.style != "plain":
        return node.value
    if yaml_tree.is_empty(node) or node.value in ("~", "null", "Null", "NULL"):
        return None
    if node.value.casefold() in ("true", "false"):
        return node.value.casefold() == "true"
    if _NUMBER.fullmatch(node.value):
        number = float(node.value)
        return int(number) if re.fullmatch(r"[-+]?\d{1,15}", node.value) else number
    return node.value


def _mapping(key: keys.Key) -> Schema:
    """A mapping with the keys of `key` and no others."""
    found: Schema = {"type": "object", "properties": {one.name: _described(one) for one in key.keys}}
    found["additionalProperties"] = False
    required = [one.name for one in key.keys if one.required]
    if required:
        found["required"] = list(required)
    if key.one_of:
        found["anyOf"] = [{"required": list(names)} for names in key.one_of]
    alone: Schema = {}
    for one in key.keys:
        if one.instead_of:
            alone[one.name] = {"not": {"anyOf": [{"required": [name]} for name in one.instead_of]}}
    if alone:
        found["dependencies"] = alone
    return found


def _described(key: keys.Key) -> Schema:
    """The values that may stand under `key`, with its meaning and an example."""
    meaning = key.meaning[0].upper() + key.meaning[1:] + "."
    if key.default:
        meaning += f" Default: {key.default}."
    found: Schema = {"description": meaning}
    if key.entries:
        # The names that entries of a section may have
        kinds = dict(entry_names.NAMING)
        columns = namespace.NOT_FOR_COLUMNS if kinds.get(key.name) in namespace.NUMBERED else ()
        pattern = f"^{_WORD}{_INDICES if key.name in entry_names.FAMILIES else ''}$"
        # An entry is a mapping, its short form, or either.
        forms: list[Json] = [_mapping(key)] if key.keys else []
        if not key.keys or key.holds != "mapping":
            forms.append(_shape(key.holds))
        elif key.short:
            forms += [_shape(key.short), {"type": "null"}]
        found["type"] = ["object", "null"]
        found["propertyNames"] = {"pattern": pattern, "not": {"enum": [*namespace.RESERVED, *columns]}}
        found["additionalProperties"] = forms[0] if len(forms) == 1 else {"anyOf": forms}
    elif key.keys:
        found |= {**_mapping(key), "type": ["object", "null"]}
    elif key.name == "lagrangian":  # a section too: it may be left empty
        found["type"] = ["string", "number", "null"]
    else:
        found |= _shape(key.holds)
    if key.example:
        found["examples"] = [_written(key.example)]
    default = _written(key.default) if key.default else None
    if default is not None and (not isinstance(default, str) or " " not in default):
        found["default"] = default
    return found


def _shape(holds: str) -> Schema:
    if holds in _SHAPES:
        return dict(_SHAPES[holds])
    words = [_written(word) for word in _CHOICE.findall(holds)]
    if not words:
        raise ValueError(f"no shape for {holds!r}")
    # A text in quotes means the same.
    return {"enum": [*words, *(str(word).lower() for word in words if not isinstance(word, str))]}


def _written(text: str) -> Json:
    """A value as it stands in a file, as JSON."""
    (_, node), *_ = yaml_tree.parse(f"key: {text}", "")
    return plain(node)
