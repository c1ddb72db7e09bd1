"""A family document written out entry by entry, by rules of its own: what the families of a model must agree with.

The member `p[1][2]` becomes the entry `p__1__2`; every index is replaced by its number. Nothing of the package is
used but what a parameter is worth is computed by Python, so documents here are written with care.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

import yaml

MEMBER = re.compile(r"\b([A-Za-z_]\w*)((?:\[[^\[\]]*\])+)")
INDEX = re.compile(r"\[([^\[\]]*)\]")
PLACE = re.compile(r"(?<=[\w\]])((?:\[-?\d+\])+)")
WORD = re.compile(r"(?<![\w.])[A-Za-z_]\w*")
SECTIONS = ("coordinates", "particles", "forces", "holonomic", "differential", "outputs")
FUNCTIONS = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "pi": math.pi}
LISTS = ("to", "keep")

# Texts as they stand; LibYAML's reader, where there is one, takes a tenth of the time.
LOADER = getattr(yaml, "CBaseLoader", yaml.BaseLoader)

Environment = Mapping[str, int]


def text(document: str, changes: Mapping[str, str] | None = None) -> str:
    """The document without families; `changes` to parameters decide the members too."""
    root = yaml.load(document, LOADER)
    root.setdefault("parameters", {}).update(changes or {})
    return yaml.safe_dump(_Document(root).written(), sort_keys=False, default_flow_style=None, width=10**6)


def name(member: str) -> str:
    """`p[1][-2].x`, or a text of such names, as it is called in the document written out."""
    return PLACE.sub(
        lambda found: "".join("__" + i.replace("-", "m") for i in INDEX.findall(found[1])), member
    )


class _Document:
    def __init__(self, root: dict[str, Any]) -> None:
        self.root = root
        self.numbers: dict[str, Any] = {}
        for key, value in root["parameters"].items():
            if isinstance(value, str) and not value.startswith("["):
                self.numbers[key] = eval(value, {**FUNCTIONS, **self.numbers})
        self.members: dict[str, list[str]] = {}  # base -> the names of its members, in order
        for section in SECTIONS:
            for key, entry in (root.get(section) or {}).items():
                base = key.partition("[")[0]
                if "[" in key:
                    known = self.members.setdefault(base, [])
                    known += [self.put(key, env) for env in self.environments(entry)]

    def written(self) -> dict[str, Any]:
        root = dict(self.root)
        for section in SECTIONS:
            if section in root:
                root[section] = dict(self.entries(root[section] or {}))
        if "rigid" in root:
            root["rigid"] = {key: self.listed(value, {}) for key, value in root["rigid"].items()}
        if "keep" in root.get("simulation", {}):
            root["simulation"] = {
                **root["simulation"],
                "keep": self.listed(root["simulation"]["keep"], {}),
            }
        return self.filled(root, {})

    def entries(self, section: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        for key, entry in section.items():
            for env in self.environments(entry):
                rest = entry
                if isinstance(entry, dict):
                    rest = {k: v for k, v in entry.items() if k not in ("for", "if")}
                written = self.filled(rest, env)
                if not (isinstance(written, dict) and written.get("to") == []):  # a family of no members
                    yield self.put(key, env), written

    def environments(self, entry: Any) -> Iterator[dict[str, int]]:
        ranges = entry.get("for", []) if isinstance(entry, dict) else []
        condition = entry.get("if", "True") if isinstance(entry, dict) else "True"
        found: list[dict[str, int]] = [{}]
        for one in [ranges] if isinstance(ranges, str) else ranges:
            variable, bounds = one.split("=")
            low, high = bounds.split("..")
            found = [
                {**env, variable.strip(): k}
                for env in found
                for k in range(self.whole(low, env), self.whole(high, env) + 1)
            ]
        return (env for env in found if self.value(condition, env))

    def value(self, expression: str, env: Environment) -> Any:
        exact = {key: Fraction(value) for key, value in {**self.numbers, **env}.items()}
        return eval(expression.strip(), {"min": min, "max": max, "abs": abs}, exact)

    def whole(self, expression: str, env: Environment) -> int:
        value = Fraction(self.value(expression, env))
        assert value.denominator == 1, expression
        return int(value)

    def put(self, expression: str, env: Environment) -> str:
        """An expression or a name for one member."""

        def member(found: re.Match[str]) -> str:
            indices = [self.whole(index, env) for index in INDEX.findall(found[2])]
            return name(found[1] + "".join(f"[{i}]" for i in indices))

        return WORD.sub(lambda w: f"({env[w[0]]})" if w[0] in env else w[0], MEMBER.sub(member, expression))

    def filled(self, entry: Any, env: Environment) -> Any:
        if isinstance(entry, str):
            return self.put(entry, env)
        if isinstance(entry, list):
            return [self.filled(part, env) for part in entry]
        return {k: self.listed(v, env) if k in LISTS else self.filled(v, env) for k, v in entry.items()}

    def listed(self, names: str | list[str], env: Environment) -> list[str]:
        items = [names] if isinstance(names, str) else names
        return list(itertools.chain(*(self.members.get(item, [self.put(item, env)]) for item in items)))
