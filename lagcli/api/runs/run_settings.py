"""The settings of a run: those of the file and those that a caller gives in their place."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeAlias

from lagcli.model import settings
from lagcli.model.model import Model, Simulation
from lagcli.output.files.write_guard import BadRequest

Changes: TypeAlias = Mapping[str, Any]  # settings by their names; what is None is as the model says
REAL_SETTINGS = frozenset(("start", "duration", "output_step", "rtol", "atol", "max_step"))


class BadSetting(ValueError):
    """Settings that no run can have; the message says which."""


def chosen(model: Model, changes: Changes) -> Simulation:
    """The settings of the file, with `changes` that are not None. Raises `BadSetting`, `ValueError`, `TypeError`."""
    given = {key: value for key, value in changes.items() if value is not None}
    unknown = given.keys() - {field.name for field in dataclasses.fields(Simulation)}
    if unknown:
        raise TypeError(f"there is no setting `{min(unknown)}`")
    for key in given.keys() & REAL_SETTINGS:
        given[key] = float(given[key])
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
