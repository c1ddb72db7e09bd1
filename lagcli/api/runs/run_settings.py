"""The settings of a run: those of the file and those that a caller gives in their place."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeAlias, TypeVar

from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.output.files.write_guard import BadRequest

Changes: TypeAlias = Mapping[str, Any]  # settings by their names; what is None is as the model says
P = ParamSpec("P")
R = TypeVar("R")


class BadSetting(ValueError):
    """Settings that no run can have; the message says which."""


def keywords(*left_out: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Name the settings of a run, but for those left out, in the signature of a function that takes `**settings`."""

    def naming(function: Callable[P, R]) -> Callable[P, R]:
        own = inspect.signature(function)
        parameters = [each for each in own.parameters.values() if each.kind is not each.VAR_KEYWORD]
        named = {
            name: inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind)
            for name, kind in settings.keyword_types().items()
            if name not in left_out
        }

        @functools.wraps(function)
        def called(*arguments: P.args, **given: P.kwargs) -> R:
            for name in left_out:
                if name in given:
                    raise TypeError(f"{function.__name__}() got an unexpected keyword argument '{name}'")
            return function(*arguments, **given)

        called.__signature__ = own.replace(parameters=[*parameters, *named.values()])  # type: ignore[attr-defined]
        return called

    return naming


def chosen(model: Model, changes: Changes) -> Simulation:
    """The settings of the file, with `changes` that are not None. Raises `BadSetting`, `ValueError`, `TypeError`."""
    unknown = changes.keys() - settings.table().keys()
    if unknown:
        raise TypeError(f"there is no setting `{min(unknown)}`")
    kinds = {key: kind for key, (kind, _) in settings.table().items()}
    given = {key: value for key, value in changes.items() if value is not None}
    for key in given:
        if kinds[key] is float:
            given[key] = float(given[key])
        elif kinds[key] not in (int, bool, str):
            given[key] = tuple(given[key])
    if "samples" in given and "output_step" in given:
        raise ValueError("samples and output_step both set the times of the rows; give one of them")
    if "samples" in given:
        given["output_step"] = None
    changed = dataclasses.replace(model.simulation, **given)
    faults = [f"{key}: {message}" for key, message in settings.faults(changed)]
    if faults:
        raise BadSetting("; ".join(faults))
    return changed


def of_options(model: Model, changes: Changes, row: str | None = None) -> Model:
    """The model with the settings of a command and, where a row of a table is given, `FILE` or `FILE:ROW`, its start.

    Raises `BadRequest`, worded for the options, in place of what `chosen` and `start_row.at` raise.
    """
    if row is not None:
        # Other runs read no tables.
        from lagcli.api.runs import start_row

        model = start_row.of_option(model, row)
    try:
        return dataclasses.replace(model, simulation=chosen(model, changes))
    except ValueError as error:
        raise BadRequest(str(error)) from None


def seconds(limit: float | None) -> float:
    """The limit, or `settings.LIMIT` where it is None. Raises `ValueError` for one that is none."""
    if limit is None:
        return settings.LIMIT
    if not limit >= 0:  # nan neither
        raise ValueError("limit: a number of seconds is needed, 0 or more")
    return limit
