"""The sections `events` and `simulation`: what is recorded or stops a run, and the settings of a run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal, TypeVar

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.expression import facts, parser
from lagcli.input import entries, keys
from lagcli.input.scalars import Formulas
from lagcli.model import model, settings
from lagcli.model.model import DeclaredEvent

DIRECTIONS: dict[str, Literal["up", "down", "both"]] = {"up": "up", "down": "down", "both": "both"}
ACTIONS: dict[str, Literal["record", "stop"]] = {"record": "record", "stop": "stop"}
Word = TypeVar("Word", bound=str)


def event(formulas: Formulas, name: yaml_tree.Scalar, node: yaml_tree.AnyNode) -> DeclaredEvent | None:
    """An event, or None with what is wrong with it reported."""
    found = entries.fields(formulas, node, keys.FORMAT.key("events"))
    if found is None:
        return None
    when = formulas.parse(found["when"], parser.parse_crossing) if "when" in found else None
    value = None if when is None else formulas.facts(when, facts.OUTPUT, "an event")
    if value is not None and value.value is not None:
        message = "this expression is a constant, and an event is where one crosses zero"
        hint = "for example `a.z`, or `t - 1` for an instant"
        formulas.report(found["when"], "never-crosses", message, hint)
        value = None
    direction = _word(formulas, found, "direction", "both", DIRECTIONS)
    action = _word(formulas, found, "action", "record", ACTIONS)
    if when is None or value is None or direction is None or action is None:
        return None
    return DeclaredEvent(name.value, when, direction, action)


def _word(
    formulas: Formulas,
    found: Mapping[str, yaml_tree.AnyNode],
    key: str,
    default: str,
    words: Mapping[str, Word],
) -> Word | None:
    if key not in found:
        return words[default]
    node = found[key]
    written = entries.text(formulas, node).strip()
    if written in words:
        return words[written]
    if isinstance(node, yaml_tree.Scalar):
        listed = " or ".join(f"`{word}`" for word in words)
        message = f"the `{key}` of an event is {listed}"
        known = diagnostics.meant(f"values of {key}").get(written.casefold())
        hint = f"did you mean `{known}`?" if known else diagnostics.nearest(written, words)
        formulas.report(node, "bad-setting", message, hint)
    return None


def simulation(
    formulas: Formulas, node: yaml_tree.AnyNode | None, particles: tuple[model.Particle, ...]
) -> settings.Simulation:
    """The settings of the section; what is wrong with them is reported. particles: what `keep` may name."""
    default = settings.Simulation()
    if node is None or yaml_tree.is_empty(node):
        return default
    fields = entries.fields(formulas, node, keys.FORMAT.key("simulation"))
    if fields is None:
        return default
    read = {key: _setting(formulas, key, value, particles) for key, value in fields.items()}
    if "samples" in fields and "output_step" in fields:
        message = "`samples` and `output_step` both set the times of the rows"
        formulas.report(fields["output_step"], "conflicting-keys", message, "keep one of them")
    given: dict[str, Any] = {key: value for key, value in read.items() if value is not None}
    simulation = dataclasses.replace(default, **given)
    for key, message in settings.faults(simulation):
        formulas.report(fields.get(key, node), "bad-setting", message)
    return simulation


def _setting(
    formulas: Formulas, key: str, node: yaml_tree.AnyNode, particles: tuple[model.Particle, ...]
) -> object:
    kind, _ = settings.table()[key]
    if kind in (str, bool):
        text = entries.text(formulas, node).strip()
        if not isinstance(node, yaml_tree.Scalar):
            return None
        if kind is str:
            return text
        if text not in ("true", "false"):
            known = diagnostics.meant("truths").get(text.casefold(), text.casefold())
            hint = f"write `{known}`" if known in ("true", "false") else ""
            formulas.report(node, "bad-setting", f"`{key}` is `true` or `false`", hint)
        return text == "true"
    if kind not in (int, float):
        return _keep(formulas, node, particles)
    value = formulas.constant(node, f"the setting `{key}`")
    if kind is int and value is not None:
        if value != round(value):
            formulas.report(node, "bad-setting", f"`{key}` is a whole number")
            return None
        return round(value)
    return value


def _keep(
    formulas: Formulas, node: yaml_tree.AnyNode, particles: tuple[model.Particle, ...]
) -> tuple[str, ...] | None:
    listed = [] if yaml_tree.is_empty(node) else entries.name_list(formulas, node)
    if listed is None:
        return None
    cartesian = {name for p in particles if not p.is_dependent for name in p.members.names}
    found: list[str] = []
    for name in listed:
        word, dot, axis = name.value.strip().rpartition(".")
        if dot and word in cartesian and axis in "xyz":
            found.append(name.value.strip())
            continue
        if dot and axis not in "]":
            components = [f"{particle}.{part}" for particle in sorted(cartesian) for part in "xyz"]
            hint = diagnostics.nearest(name.value, components)
            formulas.report(name, "unknown-name", f"there is no coordinate `{name.value}`", hint)
            continue
        for kind, numbers, _ in entries.references(formulas, name, ("coordinate", "particle")) or ():
            known = formulas.scope.names.member_indices[kind].names
            members = [known[number] for number in numbers.tolist()]
            dependent = [member for member in members if member not in cartesian]
            if kind != "coordinate" and dependent:
                message = f"the particle `{dependent[0]}` has no coordinates of its own"
                formulas.report(name, "unknown-name", message, "keep the coordinates it depends on")
            found += members
    return tuple(found)
