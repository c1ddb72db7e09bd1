"""A sweep that is ready to go: its task, its points, and the rows that are planned of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from lagcli import __version__
from lagcli.api.models import cache
from lagcli.api.runs import run_settings
from lagcli.api.sweeps import reductions
from lagcli.api.sweeps.point_sources import BadPoints, SweepPoints, joined
from lagcli.api.sweeps.point_task import PointTask
from lagcli.api.sweeps.reductions import Reduction
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.input import document
from lagcli.input.overrides import OverrideError
from lagcli.model.model import Model
from lagcli.output.sweeps.sweep_table import PlannedRows
from lagcli.running import table_columns


@dataclasses.dataclass(frozen=True, slots=True)
class SweepSettings:
    """The settings of all runs, what is None as the model says; seconds for proofs and for a point; the pattern of the
    files of full tables."""

    runs: Mapping[str, object]
    limit: float
    limit_each: float | None = None
    tables: str | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class SweepPlan:
    """The work, the points, and the rows that are wanted of them."""

    task: PointTask
    points: SweepPoints
    rows: PlannedRows


def require_names(model: Model, part: SweepPoints, label: str) -> None:
    """Raise `BadPoints` where a name of these points is of nothing that can be set, or is set already."""
    set_already = dict(model.changes)
    for name in part.names:
        if name in set_already:
            raise BadPoints(f"{label} {name}: --set has a value for it too; give one of them")
    if not part.count:
        return
    try:
        model.with_parameters(dict(zip(part.names, part.point(0), strict=True)))
    except OverrideError as error:
        raise BadPoints(str(error).replace("--set", label, 1)) from None
    except diagnostics.ModelError:
        pass  # the first point is invalid, which its row will say


def plan(
    model: Model,
    parts: Sequence[SweepPoints],
    reduce: Sequence[Reduction],
    settings: SweepSettings,
    part: tuple[int, int] = (1, 1),
) -> SweepPlan:
    """The plan of a sweep; reduce: by default the last row of all columns; part: which shard of how many.

    Raises `BadPoints`, `reductions.BadReduction`, `diagnostics.ModelError`, and `ValueError` for bad settings and for a
    model that is not as it was read.
    """
    origin = model.origin
    if not isinstance(origin, document.ModelOrigin):
        raise ValueError("the start of this model was changed after it was read: load the file anew")
    run_settings.chosen(model, settings.runs)
    if settings.limit_each is not None and not settings.limit_each >= 0:  # nan neither
        raise ValueError("limit_each: a number of seconds is needed, 0 or more")
    points = joined(parts)
    if not points.count:
        raise BadPoints("there are no points")
    columns, by_name = _columns(model, points)
    known = {**model.constants, **{p.name: p.value for p in model.parameters}}
    reductions.check(reduce, (*columns, *by_name), known)
    reduced = tuple(reduce) or reductions.of_last_row(columns)
    file, given = origin.file, origin.changes
    task = PointTask(
        file.data, file.path, given, dict(settings.runs), points.names, reduced,
        settings.limit, settings.limit_each, settings.tables,
    )  # fmt: skip
    names = tuple(one.name for one in reduced)
    planned = PlannedRows(_identity(task, points, model.sha256), points.names, names, points.count, *part)
    try:
        planned.columns  # noqa: B018 - two of one name
    except ValueError as error:
        raise BadPoints(str(error)) from None
    return SweepPlan(task, points, planned)


def _identity(task: PointTask, points: SweepPoints, sha256: str) -> dict[str, object]:
    """The data that make two sweeps one, whatever computes them and in how many parts."""
    return {
        "version": __version__,
        "sha256": sha256,
        "set": {name: str(value) for name, value in task.given.items()},
        "settings": {key: value for key, value in task.settings.items() if value is not None},
        "limit": task.limit,
        "limit_each": task.limit_each,
        "names": list(task.names),
        "points": points.digest,
        "count": points.count,
        "reductions": [[one.name, one.text, one.is_last] for one in task.reductions],
    }


def _columns(model: Model, points: SweepPoints) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The columns of the run of the first point, and those that are given by name alone; where that point is invalid
    they are of the model as it is."""
    try:
        first = model.with_parameters(dict(zip(points.names, points.point(0), strict=True)))
        built = cache.compiled(first)
    except (diagnostics.ModelError, OverrideError):  # of a member that another value has taken away, say
        built = cache.compiled(model)
    names = ("t", *built.system.columns)
    forces = table_columns.GeneralizedForces(built.system, built.numeric, system.values(built.system), names)
    return names, forces.names
