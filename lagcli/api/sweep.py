"""`lagcli.sweep`: many runs of one model, as a data frame with a row for each point."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Unpack

import numpy as np

from lagcli import progress
from lagcli.api.models.load import Path, as_model
from lagcli.api.runs import run_settings
from lagcli.api.sweeps import drawn_points, engines, point_sources, point_task, reductions, sweep_plan
from lagcli.api.sweeps.point_sources import SweepPoints
from lagcli.api.sweeps.sweep_plan import SweepPlan
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.output.sweeps import sweep_table
from lagcli.output.sweeps.sweep_table import PointRow
from lagcli.output.tables import table_format

if TYPE_CHECKING:
    import pandas

Values = str | float | Sequence[float]
Table = "pandas.DataFrame | Sequence[Mapping[str, float]]"


@progress.phase("sweeping")
@run_settings.keywords()
def sweep(
    model: Model | Path,
    points: Mapping[str, Values] | Sequence[Mapping[str, float]] | pandas.DataFrame | Path | None = None,
    *,
    reduce: Mapping[str, str] | None = None,
    uncertain: Mapping[str, str] | None = None,
    draws: int = 1024,
    seed: int = 0,
    sampling: str = "sobol",
    executor: Executor | None = None,
    jobs: int = 1,
    limit_each: float | None = None,
    tables: str | None = None,
    limit: float | None = None,
    **settings: Unpack[RunSettings],
) -> pandas.DataFrame:
    """Run a model at many points and return a row for each, in their order, as `pandas.DataFrame`.

    points: names with their values for a grid, `{"L": "0.5:2:16", "m": [1, 2, 5]}`, the last name changing first; a
    data frame, a list of mappings or the file of a table, a row a point; `uncertain`: names with distributions,
    `{"L": "normal(1, 0.01)"}`, of which `draws` points are drawn, quasi-random or, with `sampling="random"`, random,
    for each of `points`. reduce: names of columns with expressions, `{"peak": "max(abs(lambda.rod))"}`; by default the
    last row of all columns. Parts go to the `executor`, of any kind that is a `concurrent.futures.Executor`, or to so
    many `jobs`, processes of this machine. `limit_each` ends a point after so many seconds; `tables` is a folder for
    full tables. The other options are as of `simulate`; each row is that of a run of its own, to the last bit.
    Columns: `point`, the numbers of the point, the reductions, `status` (0, 1 invalid, 3 stopped), `message`, `t_end`;
    `attrs` of the frame holds the account. Raises `ModelError`, `ValueError`, `OSError`,
    `RuntimeError` where workers were lost again and again, and `ImportError` without pandas.
    """
    try:
        import pandas  # noqa: F401 - before the runs, and not after them
    except ModuleNotFoundError as error:
        raise ImportError("sweep() needs pandas: pip install pandas") from error

    model = as_model(model)
    parts = [] if points is None else _points(model, points)
    if uncertain:
        laws = [drawn_points.read(model, f"{name}~{text}") for name, text in uncertain.items()]
        parts.append(drawn_points.draw(laws, draws, seed, sampling))
    if not parts:
        raise ValueError("points: there are none; give points or uncertain")
    if executor is not None and jobs != 1:
        raise ValueError("executor and jobs both say who computes; give one of them")
    for part in parts:
        sweep_plan.require_names(model, part, "points")
    reduced = [reductions.Reduction(name, text) for name, text in (reduce or {}).items()]
    pattern = None if tables is None else point_task.require_folder(os.fspath(tables))
    chosen = sweep_plan.SweepSettings(settings, run_settings.seconds(limit), limit_each, pattern)
    plan = sweep_plan.plan(model, parts, reduced, chosen)
    with point_task.locked(pattern, plan.rows):
        rows: list[PointRow] = []
        with engines.local(jobs) if executor is None else engines.given(executor) as engine:
            for found in engines.rows(engine, plan.task, plan.points, plan.rows.numbers):
                rows += found
        return _frame(plan, rows, bool(uncertain), engine.lost)


def _points(
    model: Model, points: Mapping[str, Values] | Sequence[Mapping[str, float]] | pandas.DataFrame | Path
) -> list[SweepPoints]:
    """The sources of the points. Raises `ValueError` for what is none."""

    if isinstance(points, (str, os.PathLike)):
        columns, rows = table_format.read(points)
        return [point_sources.TableOfPoints(columns, rows, os.fspath(points))]
    if isinstance(points, Mapping):
        return [_axis(model, name, values) for name, values in points.items()]
    if hasattr(points, "columns"):
        names = [str(name) for name in points.columns]
        return [point_sources.TableOfPoints(names, np.array(points, dtype=np.float64), "points")]
    if not len(points):
        raise ValueError("points: there are none")
    names = list(points[0])
    if any(list(point) != names for point in points):
        raise ValueError("points: all of them need the same names in the same order")
    numbers = np.array([[float(value) for value in point.values()] for point in points])
    return [point_sources.TableOfPoints(names, numbers.reshape(-1, len(names)), "points")]


def _axis(model: Model, name: str, values: Values) -> SweepPoints:

    if isinstance(values, str):
        return point_sources.over(model, f"{name}={values}")
    return point_sources.TableOfPoints([name], np.array(values, dtype=np.float64).reshape(-1, 1), "points")


def _frame(plan: SweepPlan, rows: Sequence[PointRow], spreads: bool, lost: int) -> pandas.DataFrame:
    import pandas

    account = sweep_table.SweepAccount(plan.rows.results, spreads)
    account.take(rows)
    account.lost = lost
    numbers = np.array([(*row.point, *row.results) for row in rows])
    names = plan.rows.columns[1:-3]
    frame = pandas.DataFrame(numbers.reshape(len(rows), len(names)), columns=list(names))
    frame.insert(0, "point", [row.number for row in rows])
    frame["status"] = [row.status for row in rows]
    frame["message"] = [row.message for row in rows]
    frame["t_end"] = [row.t_end for row in rows]
    frame.attrs.update(account.as_json() | {"sweep": plan.rows.identity})
    return frame
