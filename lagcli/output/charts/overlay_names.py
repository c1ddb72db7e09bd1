"""Names of several tables that say what differs: a parameter, or the part of a path that is no other's."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import PurePath

MOST_NAMED = 3  # parameters in one name
SETTINGS = ("method", "rtol", "atol", "version")


def distinguishing(paths: Sequence[str], origins: Sequence[Mapping[str, object] | None]) -> list[str]:
    """A name for each table, from the provenance where all have one and it tells them apart, else from the paths."""
    if len(paths) == 1:
        return [""]
    known = [origin for origin in origins if origin is not None]
    if len(known) == len(paths):
        told = _by_values(_values(known))
        if told is not None:
            return told
    names = _by_paths(paths)
    numbered = [f"{name} ({number})" if name else f"run {number}" for number, name in enumerate(names, 1)]
    return [
        name if name and names.count(name) == 1 else other
        for name, other in zip(names, numbered, strict=True)
    ]


def _values(origins: Sequence[Mapping[str, object]]) -> list[dict[str, object]]:
    """The parameters and settings of each table; of one model those parameters alone that were set: others follow."""
    found = [_mapping(origin.get("parameters")) for origin in origins]
    models = {_text(origin.get("sha256")) for origin in origins}
    if len(models) == 1 and models != {"none"}:
        was_set = {name for origin in origins for name in _mapping(origin.get("set"))}
        found = [{name: value for name, value in one.items() if name in was_set} for one in found]
    return [
        parameters
        | {f" {name}": origin.get(name) for name in SETTINGS}  # a space: no parameter has such a name
        for parameters, origin in zip(found, origins, strict=True)
    ]


def _mapping(value: object) -> dict[str, object]:
    return {str(name): one for name, one in value.items()} if isinstance(value, Mapping) else {}


def _by_values(tables: Sequence[Mapping[str, object]]) -> list[str] | None:
    """`L = 1.5, m = 2` of the values that differ, if they are few and tell all tables apart."""
    names = dict.fromkeys(name for table in tables for name in table)
    differing = [name for name in names if len({_text(table.get(name)) for table in tables}) > 1]
    if not 1 <= len(differing) <= MOST_NAMED:
        return None
    told = [", ".join(f"{name.strip()} = {_text(table.get(name))}" for name in differing) for table in tables]
    return told if len(set(told)) == len(told) else None


def _text(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _by_paths(paths: Sequence[str]) -> list[str]:
    """The parts of paths that differ: folders first, then words of the names."""
    parts = [PurePath(path).parts for path in paths]
    cut = _without_common([list(each) for each in parts])
    if {len(each) for each in cut} != {1}:
        return ["/".join(each) or "/".join(whole) for each, whole in zip(cut, parts, strict=True)]
    names = [PurePath(each[0]) for each in cut]
    # A dot may be that of a number, and a hyphen its sign, or stand between a quantity and its value.
    is_alike = len({name.suffix for name in names}) == 1
    plain = [name.stem if is_alike else name.name for name in names]
    words = [re.findall(r"[^_ ]+|[_ ]", name) for name in plain]
    short = ["".join(each).strip("_ ") for each in _without_common(words)]
    return short if all(short) else plain


def _without_common(lists: list[list[str]]) -> list[list[str]]:
    """The lists without what all begin with and all end with."""
    fewest = min(map(len, lists))
    head = next((i for i in range(fewest) if len({each[i] for each in lists}) > 1), fewest)
    tails = [each[head:] for each in lists]
    fewest = min(map(len, tails))
    tail = next((i for i in range(fewest) if len({each[-1 - i] for each in tails}) > 1), fewest)
    return [each[: len(each) - tail] for each in tails]
