"""The settings of a run: those of the file and those that a caller gives in their place."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import inspect
import os
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ParamSpec, TypeAlias, TypeVar

import numpy as np

from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.output.files.write_guard import BadRequest

Changes: TypeAlias = Mapping[str, Any]  # settings by their names; what is None is as the model says
# Columns of the initial values of a model.
_COLUMNS = {
    "value": ("{}",),
    "rate": ("rate({})",),
    "position": ("{}.x", "{}.y", "{}.z"),
    "velocity": ("{}.vx", "{}.vy", "{}.vz"),
}
_ROW = re.compile(r"(.+):([+-]?\d+)", re.DOTALL)
P = ParamSpec("P")
R = TypeVar("R")


class BadSetting(ValueError):
    """Settings that no run can have; the message says which."""


class NoSuchRow(ValueError):
    """A row of a table, or a column of it, is not there."""


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
    table = settings.table()
    unknown = changes.keys() - table.keys()
    if unknown:
        raise TypeError(f"there is no setting `{min(unknown)}`")
    given = {key: value for key, value in changes.items() if value is not None}
    for key, value in given.items():
        kind, _ = table[key]
        if kind is float:
            given[key] = float(value)
        elif kind not in (int, bool, str):
            given[key] = tuple(value)
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

    Raises `BadRequest`, worded for the options, in place of what `chosen` and `at_row` raise.
    """
    if row is not None:
        # Other runs read no tables.
        from lagcli.output.tables import table_format

        with reading("--from", row, NoSuchRow, *table_format.UNREADABLE):
            model = at_row(model, row)
    try:
        return dataclasses.replace(model, simulation=chosen(model, changes))
    except ValueError as error:
        raise BadRequest(str(error)) from None


@contextlib.contextmanager
def reading(option: str, name: str | None, *unfit: type[Exception]) -> Iterator[None]:
    """Around what reads a file that an option names: one that is not there, cannot be read, or is `unfit` is refused.

    Raises `BadRequest`.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise BadRequest(f"{option}: there is no file {error.filename}") from None
    except OSError as error:
        raise BadRequest(f"{option}: cannot read {name}: {error.strerror}") from None
    except unfit as error:
        raise BadRequest(f"{option} {error}") from None


def seconds(limit: float | None) -> float:
    """The limit, or `settings.LIMIT` where it is None. Raises `ValueError` for one that is none."""
    if limit is None:
        return settings.LIMIT
    if not limit >= 0:  # nan neither
        raise ValueError("limit: a number of seconds is needed, 0 or more")
    return limit


def at_row(model: Model, text: str) -> Model:
    """The model with the positions of a row, `FILE` or `FILE:ROW`, and its velocities, zero where there are none.

    Initial values that were set by name are put on top of the row: a push to a point of rest.
    Raises `NoSuchRow`, and what `table_format.opened` raises; the messages name the file.
    """
    from lagcli.output.tables import table_format

    path, row, given = text, -1, _ROW.fullmatch(text)
    # A drive letter is no file.
    if given is not None and not os.path.exists(text) and not re.fullmatch(r"[A-Za-z]", given[1]):
        path, row = given[1], int(given[2])
    table = table_format.opened(path)
    names = model.coordinate_names
    rates = model.rate_names
    known = set(table.columns)
    missing = [name for name in names if name not in known]
    if missing:
        hint = diagnostics.nearest(missing[0], table.columns)
        raise NoSuchRow(f"{path}: it has no column `{missing[0]}`{'; ' + hint if hint else ''}")
    there = [name for name in rates if name in known]
    rows = table.take([*names, *there])
    if not -len(rows) <= row < len(rows):
        raise NoSuchRow(f"{path}:{row}: it has {len(rows)} rows, from 0 to {len(rows) - 1}; -1 is the last")
    values = dict(zip([*names, *there], rows[row].tolist(), strict=True))
    # The initial values that were changed by name, by their columns
    declared = dict(zip([*names, *rates], np.concatenate(system.start(model)).tolist(), strict=True))
    found: dict[str, float] = {}
    for name, _ in model.changes:
        owner, dot, field = name.rpartition(".")
        if not dot:
            continue
        columns = [column.format(owner) for column in _COLUMNS.get(field, (f"{{}}.{field}",))]
        if any(column not in declared for column in columns):
            raise NoSuchRow(f"--set {name} is of a whole family: with --from only single members can be set")
        found |= {column: declared[column] for column in columns}
    values |= found
    q = np.array([values[name] for name in names])
    v = np.array([values.get(name, 0.0) for name in rates])
    for name, value in values.items():
        if not np.isfinite(value):
            raise NoSuchRow(f"{path}:{row}: the column `{name}` has no number there")
    changes = (*model.changes, ("from", f"{path}:{row}"))
    return dataclasses.replace(system.started_at(model, q, v), changes=changes)
