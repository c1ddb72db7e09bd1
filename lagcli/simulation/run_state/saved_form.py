"""Dataclasses as trees of JSON and back, by the types of their fields; what is read is checked to the last number.

A dataclass is an object, a named tuple and a tuple are lists, and so is an array (k,) of doubles. An `int` is a count,
and a `float` is finite.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import types
from collections.abc import Callable
from typing import TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from lagcli import doubles, memory

T = TypeVar("T")


class FormError(ValueError):
    """A tree that is none of this type; the text says where."""


def saved(value: object) -> object:
    """The tree of a value."""
    if dataclasses.is_dataclass(value):
        return {field.name: saved(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {name: saved(part) for name, part in value.items()}
    return [saved(part) for part in value] if isinstance(value, tuple) else value


def read(kind: type[T], tree: object) -> T:
    """The value of a dataclass from its tree. Raises `FormError`."""
    found = _read(kind, tree, kind.__name__)
    assert isinstance(found, kind)
    return found


def _read(kind: object, tree: object, path: str) -> object:
    origin, parts = get_origin(kind), get_args(kind)
    if isinstance(kind, types.UnionType):
        # None, or a value of the first of some types that it has.
        if tree is None and type(None) in parts:
            return None
        *others, last = (part for part in parts if part is not type(None))
        for other in others:
            with contextlib.suppress(FormError):
                return _read(other, tree, path)
        return _read(last, tree, path)
    if origin is tuple:
        return _of_parts(parts, tree, path)
    if origin is dict:
        named = _typed(dict, tree, path).items()
        return {name: _read(parts[1], part, f"{path}.{name}") for name, part in named}
    if origin is np.ndarray:
        return np.array(_of_parts((float, ...), tree, path), dtype=float)
    # A bool is an int to Python, and a text may read as a number.
    if kind is float:
        with contextlib.suppress(OverflowError):  # an integer beyond all doubles
            if (type(tree) is float or type(tree) is int) and math.isfinite(tree):
                return float(tree)
        raise FormError(f"{path}: no finite number")
    if kind is int:
        if type(tree) is not int or not 0 <= tree <= doubles.WHOLE:
            raise FormError(f"{path}: no count")
        return tree
    if kind is str or kind is bool:
        return _typed(kind, tree, path)
    # A dataclass from an object with all of its fields, or a named tuple from a list.
    assert isinstance(kind, type), kind
    make: Callable[..., object] = kind
    fields = _fields(kind)
    if issubclass(kind, tuple):
        return make(*_of_parts(tuple(fields.values()), tree, path))
    found = _typed(dict, tree, path)
    if found.keys() != fields.keys():
        raise FormError(f"{path}: other fields than {', '.join(fields)}")
    return make(**{name: _read(of, found[name], f"{path}.{name}") for name, of in fields.items()})


@memory.remembered()
def _fields(kind: type) -> dict[str, object]:
    return get_type_hints(kind)


def _of_parts(kinds: tuple[object, ...], tree: object, path: str) -> tuple[object, ...]:
    found = _typed(list, tree, path)
    if kinds[1:] == (...,):
        kinds = kinds[:1] * len(found)
    if len(found) != len(kinds):
        raise FormError(f"{path}: {len(found)} in place of {len(kinds)} values")
    return tuple(
        _read(kind, part, f"{path}[{i}]") for i, (kind, part) in enumerate(zip(kinds, found, strict=True))
    )


def _typed(kind: type[T], tree: object, path: str) -> T:
    if not isinstance(tree, kind):
        raise FormError(f"{path}: no {kind.__name__}")
    return tree
