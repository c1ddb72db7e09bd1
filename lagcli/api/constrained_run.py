"""The constrained run beside which `lagcli.limit` sets its stiff runs, and the rows that have none."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lagcli.api import assemble_start
from lagcli.api.runs import prepare_run
from lagcli.errors import diagnostics
from lagcli.formulations import stiff_system
from lagcli.formulations.stiff_system import StiffRow
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import run_stop
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

# Rows in a swing, by which means are taken, and the most rows of a run.
IN_A_SWING, MOST_ROWS = 16, 400_000
# The run that tells the uncertainty has this many times the tolerance; where rounding takes part, the errors of the two
# are nearly equal, and what they differ by is divided by little.
LOOSER, LARGER = 100.0, 2.0


@dataclasses.dataclass(frozen=True, slots=True)
class LimitPlan:
    """A limit that is asked for: the name of the row, the stiffnesses, the kind of start, and whether k rises in one
    run; `report` takes sentences on what is about to take long."""

    constraint: str
    stiffness: tuple[float, ...]
    unprestressed: bool
    is_ramp: bool
    report: Callable[[str], None]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Constrained:
    """The constrained run: times (T,) and lambda (T,) on a grid of rows and on finer ones, where it began, the row,
    omega/sqrt(k) of its swing, and what lambda is off by at the rows, by the tolerance."""

    run: SimulationRun
    row: StiffRow
    start: State
    frequency: float
    settings: Simulation
    refined: int
    t: Floats
    multiplier: Floats
    uncertainty: Floats

    def at(self, refined: int) -> tuple[Floats, Floats]:
        """Times and lambda on a grid that is `refined` times as fine as that of the rows."""
        rows = spaced(len(self.t), self.refined // refined)
        return self.t[rows], self.multiplier[rows]


def constrained(
    model: Model, chosen: Simulation, plan: LimitPlan
) -> tuple[Constrained | str, str, list[str]]:
    """The constrained run or why it stopped, the name of the row, and notes.

    Raises `diagnostics.ModelError` where the row has no limit, `ValueError` for a name there is not.
    """
    for law in model.inequality:
        if law.members.count:
            raise _without_limit(
                "no limit is taken of models with inequalities: a blow on a spring goes on swinging, and is not that"
                " on a constraint, however stiff it is",
                law.equation.location,
                "take the inequality out, if it plays no part",
            )
    first = prepare_run.start(model, chosen)
    # The number of the row of this name
    name = plan.constraint
    built = first.built
    rows = built.rows.rows
    s = built.holonomic_count
    named = [i for i, row in enumerate(rows) if row.name == name] or [
        i
        for i, row in enumerate(rows)
        if row.constraint == name or row.name.startswith((f"{name}[", f"{name}."))
    ]
    if not named:
        known = [row.name for row in rows[:s]]
        hint = diagnostics.nearest(name, known) or (
            f"they are {', '.join(known[:6])}" if known else "there is none"
        )
        raise ValueError(f"constraint: there is no holonomic row `{name}`; {hint}")
    if named[0] >= s:
        raise _without_limit(
            f"`{name}` is a differential row: it is no surface f = 0 from which a spring could be stretched",
            rows[named[0]].location,
            "if `check` finds it integrable, write its integral under `holonomic`",
        )
    if len(named) > 1:
        hint = f"its rows are `{rows[named[0]].name}` to `{rows[named[-1]].name}`"
        raise ValueError(f"constraint: `{name}` is {len(named)} rows, and one becomes a spring; {hint}")
    (index,) = named
    if index in first.report.selection.indeterminate:
        raise _without_limit(
            f"the row `{rows[index].name}` is redundant: others hold it when it becomes a spring, which then has no"
            " force, and its multiplier is not unique",
            rows[index].location,
            "take the rows out that repeat it",
        )
    if stiff_system.has_cut(built, index):
        raise _without_limit(
            f"f of the row `{rows[index].name}` has the cut of an angle, where the potential k f^2/2 would jump",
            rows[index].location,
            "write the row without `atan2`, or name the angle as a coordinate",
        )
    chosen, stops = _until_stopped(model, chosen, first)
    notes = [*assemble_start.of_run(first), *stops]
    return _constrained(model, chosen, index, plan), first.built.rows.rows[index].name, notes


def _without_limit(message: str, where: diagnostics.Location, hint: str) -> diagnostics.ModelError:
    return diagnostics.ModelError([diagnostics.Diagnostic("no-stiff-limit", message, where, hint)])


def _until_stopped(model: Model, chosen: Simulation, run: SimulationRun) -> tuple[Simulation, list[str]]:
    """The settings up to an event that ends the run, and a note on it."""
    if not any(event.action == "stop" for event in model.events):
        return chosen, []
    try:
        for _ in run.blocks():
            pass
    except run_stop.RunStop:
        return chosen, []
    name = run.stats.ended_by
    if name is None or run.end <= chosen.start:
        return chosen, []
    note = f"the event `{name}` ends the constrained run at t = {run.end:.9g}: the limit is taken up to there"
    return dataclasses.replace(chosen, duration=run.end - chosen.start), [note]


def _constrained(model: Model, chosen: Simulation, index: int, plan: LimitPlan) -> Constrained | str:
    """The constrained run without outputs and events, or why it stopped."""
    bare = dataclasses.replace(model, outputs=(), events=(), fingerprint=f"{model.fingerprint} bare")
    run = prepare_run.start(bare, chosen)
    start, numeric = run.begin, run.numeric
    solved = numeric.keeping(run.report.selection).solved
    lam, rate = stiff_system.multiplier_rate(solved, (start.t, start.q, start.v, start.p), index)
    frequency = stiff_system.frequency(numeric, start, index)
    swings = frequency * math.sqrt(plan.stiffness[-1]) * chosen.duration / (2 * math.pi)
    refined = refinement(run.grid.count - 1, swings)
    if refined > 1:
        run = prepare_run.start(bare, finer(chosen, refined))
    row = StiffRow(index, lam, rate)
    try:
        t, multiplier = _multiplier(run, index)
        again = _multiplier(prepare_run.start(bare, looser(chosen)), index)[1]
    except run_stop.RunStop as stop:
        return f"the constrained run stopped at t = {stop.stop.t:.9g}: {stop.stop.reason}"
    uncertainty = np.abs(again - multiplier[spaced(len(t), refined)]) / LARGER
    return Constrained(run, row, start, frequency, chosen, refined, t, multiplier, uncertainty)


def _multiplier(run: SimulationRun, index: int) -> Floats:
    """The times and lambda of a row, (2, T). Raises `run_stop.RunStop`."""
    column = run.columns.index(f"lambda.{run.built.rows.rows[index].name}")
    blocks = [np.zeros((0, 2)), *(block[:, [0, column]].copy() for block in run.blocks())]
    return np.concatenate(blocks).T


def looser(chosen: Simulation) -> Simulation:
    """The settings with a larger tolerance."""
    atol = None if chosen.atol is None else LOOSER * chosen.atol
    return dataclasses.replace(chosen, rtol=min(LOOSER * chosen.rtol, 0.1), atol=atol)


def refinement(rows: int, swings: float) -> int:
    """The power of two by which the rows of a run are too far apart for means over its swings."""
    refined = 1
    while refined * rows < IN_A_SWING * swings and 2 * refined * rows <= MOST_ROWS:
        refined *= 2
    return refined


def finer(chosen: Simulation, refined: int) -> Simulation:
    """The settings with rows `refined` times as close."""
    if refined == 1:
        return chosen
    if chosen.output_step is not None:
        return dataclasses.replace(chosen, output_step=chosen.output_step / refined)
    return dataclasses.replace(chosen, samples=(chosen.samples - 1) * refined + 1)


def spaced(count: int, every: int) -> npt.NDArray[np.int64]:
    """Every so many of `count` rows, and the last."""
    indices = np.arange(0, count, every)
    return indices if indices[-1] == count - 1 else np.append(indices, count - 1)
