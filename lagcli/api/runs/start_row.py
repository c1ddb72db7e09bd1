"""A model that starts at a row of a table (`simulate --from`)."""

from __future__ import annotations

import dataclasses
import os
import re

import numpy as np

from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.model.model import Model
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import table_format

LAST = -1  # of the rows of a table
_COLUMNS = {
    "value": ("{}",),
    "rate": ("rate({})",),
    "position": ("{}.x", "{}.y", "{}.z"),
    "velocity": ("{}.vx", "{}.vy", "{}.vz"),
}
_ROW = re.compile(r"(.+):([+-]?\d+)", re.DOTALL)


class NoSuchRow(ValueError):
    """A row, or a column of it, is not there."""


def split(text: str) -> tuple[str, int]:
    """FILE and the number of its row, -1 where none is given; a drive letter is no file."""
    found = _ROW.fullmatch(text)
    if found is None or os.path.exists(text) or re.fullmatch(r"[A-Za-z]", found[1]):
        return text, LAST
    return found[1], int(found[2])


def at(model: Model, text: str) -> Model:
    """The model with the positions of a row, `FILE` or `FILE:ROW`, and its velocities, zero where there are none.

    Initial values that were set by name are put on top of the row: a push to a point of rest.
    Raises `NoSuchRow`, and what `table_format.opened` raises; the messages name the file.
    """
    path, row = split(text)
    table = table_format.opened(path)
    names = model.coordinate_names
    generalized = set(model.generalized_names)
    rates = [f"rate({name})" if name in generalized else f"{name[:-1]}v{name[-1]}" for name in names]
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


def of_option(model: Model, text: str) -> Model:
    """The model as `at` gives it. Raises `BadRequest`, worded for `--from`, in place of what `at` raises."""
    try:
        return at(model, text)
    except FileNotFoundError as error:
        raise BadRequest(f"--from: there is no file {error.filename}") from None
    except OSError as error:
        raise BadRequest(f"--from: cannot read {text}: {error.strerror}") from None
    except (NoSuchRow, *table_format.UNREADABLE) as error:
        raise BadRequest(f"--from {error}") from None
