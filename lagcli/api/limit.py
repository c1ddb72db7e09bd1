"""`lagcli.limit`: one holonomic row as a stiff spring, and how its force tends to the multiplier."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Mapping, Sequence
from typing import Unpack

import numpy as np

from lagcli import progress
from lagcli.api import run_settings, stiff_runs
from lagcli.api.load import Path, as_model
from lagcli.api.stiff_runs import LimitPlan
from lagcli.formulations import stiff_ladder
from lagcli.formulations.stiff_ladder import StiffLimit
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.output.files import write_guard
from lagcli.output.tables import provenance
from lagcli.running import run_tables

STIFFNESS = "1e3:1e5"


@progress.phase("following the stiff limit")
@run_settings.keywords("start", "method", "keep")
def limit(
    model: Model | Path,
    constraint: str,
    *,
    stiffness: str | Sequence[float] = STIFFNESS,
    unprestressed: bool = False,
    ramp: float | None = None,
    told: Callable[[str], None] | None = None,
    **settings: Unpack[RunSettings],
) -> StiffLimit:
    """Replace a holonomic row f = 0 by the potential k f^2/2 for growing k, and set -k f against its lambda.

    constraint: the name of the row, of a member of a family, or of a row of a rigid body (`body.1`). `stiffness`:
    LOW:HIGH, two runs a decade, or the stiffnesses, in units of lambda over those of f. Runs start on the slow motion,
    f = -lambda/k, df/dt = -lambda'/k, or `unprestressed` on f = 0; `ramp` is the seconds in which k rises over all of
    them in one run. The other options are as of `simulate`; `told` is called with a sentence before the stiffest run.
    Raises `ModelError` where the row is not holonomic, redundant, or has no spring, and `ValueError` for a name there
    is not and for bad options.
    """

    model = as_model(model)
    if ramp is not None:
        if settings.get("duration") is not None:
            raise ValueError("ramp: its seconds are the duration of the run; give one of them")
        settings["duration"] = ramp
    if ramp is not None and not ramp > 0:
        raise ValueError("ramp: a positive number of seconds is needed")
    chosen = run_settings.chosen(model, settings)
    if not chosen.duration > 0:
        raise ValueError("duration: a stiff run needs some time")
    rungs = stiff_ladder.rungs(stiffness)
    if ramp is not None and len(rungs) < 2:
        raise ValueError("ramp: a range of stiffnesses is needed, LOW:HIGH")
    plan = LimitPlan(constraint, rungs, unprestressed, ramp is not None, told or (lambda sentence: None))
    return stiff_runs.limit(model, chosen, plan)


def limit_to_files(
    model: Model, asked: Mapping[str, object], output: str | None, plot: str | None
) -> tuple[StiffLimit, list[str]]:
    """The answer of `limit` to these keywords, its table and its figure in files, and lines to print about the table.

    output: `-` for standard output. Raises what `limit` raises, `WriteError`, `BadRequest`.
    """
    found = limit(model, **asked)  # type: ignore[arg-type]
    lines = []
    if output is not None:
        names, rows = found.table
        whence = provenance.of(model).as_json() | {"limit": {"constraint": found.constraint}}
        saved = run_tables.write(output, names, rows, whence, bool(found.stopped))
        lines += [f"lagcli: {saved or 'a run stopped'}"] if found.stopped else []
    if plot is not None and found.rungs:
        with write_guard.drawing(plot):
            # matplotlib takes a third of a second to load: only where a figure is asked for.
            from lagcli.output.figures import figure_page, result_figures

            rungs = found.rungs
            if found.force is not None:
                forces = [("-k f as k rises", found.force)]
            else:
                ends = [rungs[0], rungs[-1]] if len(rungs) > 1 else [rungs[0]]
                forces = [(f"-k f, k = {one.stiffness:.3g}", one.force) for one in ends]
            rate = "" if found.rate is None else f", slope {-found.rate.slope:.3f}".replace("-", "−")
            curves = result_figures.LimitCurves(
                found.constraint,
                found.t,
                found.multiplier,
                forces,
                np.array([(one.stiffness, one.force.min(), one.force.max()) for one in rungs]),
                np.array([(one.stiffness, one.as_json()[found.rate_of] or 0.0) for one in rungs]),
                None if found.rate is None else found.rate.line(np.array([one.stiffness for one in rungs])),
                rate,
                "mean error without swings" if found.rate_of == "weighted_mean" else "largest error",
            )
            title = f"{model.title or pathlib.Path(model.path).stem}: `{found.constraint}` as a stiff spring"
            figure_page.write(plot, result_figures.limit(curves, title, model.units.time))
    return found, lines
