"""A sweep that is ready to go: its task, its points, those of its shard, and what identifies it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence

from lagcli import __version__
from lagcli.api.models import cache
from lagcli.api.runs import run_settings
from lagcli.api.sweeps import reductions, sweep_table
from lagcli.api.sweeps.point_sources import BadPoints, SweepPoints, joined
from lagcli.api.sweeps.point_task import PointTask
from lagcli.api.sweeps.reductions import Reduction
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.input import document
from lagcli.input.overrides import OverrideError
from lagcli.model.model import Model
from lagcli.output import table_columns


@dataclasses.dataclass(frozen=True, slots=True)
class Shard:
    """Part `number` of `count`, from 1: every count-th point from the number-th on."""

    number: int = 1
    count: int = 1

    def of(self, points: int) -> range:
        """Its points among so many."""
        return range(self.number - 1, points, self.count)


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
    """The work, the points, and the shard of them that is wanted."""

    task: PointTask
    points: SweepPoints
    shard: Shard
    sha256: str

    @property
    def numbers(self) -> range:
        """The points of the shard."""
        return self.shard.of(self.points.count)

    @property
    def is_shard(self) -> bool:
        """True if there are other parts."""
        return self.shard.count > 1

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of its table."""
        return sweep_table.columns(
            self.points.names, [one.name for one in self.task.reductions], self.is_shard
        )

    @property
    def identity(self) -> dict[str, object]:
        """The data that make two sweeps one, whatever computes them and in how many parts."""
        task = self.task
        return {
            "version": __version__,
            "sha256": self.sha256,
            "set": {name: str(value) for name, value in task.given.items()},
            "settings": {key: value for key, value in task.settings.items() if value is not None},
            "limit": task.limit,
            "limit_each": task.limit_each,
            "names": list(task.names),
            "points": self.points.digest,
            "count": self.points.count,
            "reductions": [[one.name, one.text, one.is_last] for one in task.reductions],
        }

    @property
    def shard_of(self) -> str:
        """The cell of a shard: the same in all parts of a sweep; the number of its points is the last word."""
        text = json.dumps(self.identity, sort_keys=True)
        return f"{hashlib.sha256(text.encode()).hexdigest()[:16]} {self.points.count}"


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
    shard: Shard | None = None,
) -> SweepPlan:
    """The plan of a sweep; reduce: by default the last row of all columns.

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
    kept = tuple(reduce) or reductions.of_last_row(columns)
    file, given = origin.file, origin.changes
    task = PointTask(
        file.data, file.path, given, dict(settings.runs), points.names, kept,
        settings.limit, settings.limit_each, settings.tables,
    )  # fmt: skip
    found = SweepPlan(task, points, shard or Shard(), model.sha256)
    try:
        found.columns  # noqa: B018 - two of one name
    except ValueError as error:
        raise BadPoints(str(error)) from None
    return found


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
