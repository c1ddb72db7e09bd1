"""The stages in their order, text to trajectory, on one page. No physics and no printing here."""

from __future__ import annotations

import dataclasses
import functools
import os
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli import (
    compile,
    conserved,
    degrees_of_freedom,
    diagnostics,
    redundancy,
    report,
    settings,
    source,
    uniqueness,
    walk,
)
from lagcli.classification import classify, rows, unheld
from lagcli.classification.case import Case
from lagcli.export import checkpoint_file
from lagcli.export import columns as selection
from lagcli.expression.tree import ExpressionError
from lagcli.integrate import assembly, degenerate, driver, holding, initial
from lagcli.integrate import checkpoint as checkpoints
from lagcli.mechanics import system
from lagcli.model import Model, Simulation
from lagcli.reader import document
from lagcli.trajectory import SimulationStopped, Stats, Trajectory

Floats = npt.NDArray[np.float64]
Path = str | os.PathLike[str]
Integrals = tuple[conserved.FirstIntegral, ...]
Values = tuple[float, ...]

REAL_SETTINGS = frozenset(("start", "duration", "output_step", "rtol", "atol"))
KEPT_SYSTEMS = 8  # compiled systems that stay for another run with other parameters


@dataclasses.dataclass(frozen=True, slots=True)
class Found:
    """First integrals of the differential rows, and notes on those that are not known."""

    integrals: Integrals = ()
    notes: tuple[str, ...] = ()


def load(path: str | os.PathLike[str], parameters: Mapping[str, object] | None = None) -> Model:
    """The model in a file, `-` for standard input; `parameters` as `--set`.

    Raises `diagnostics.ModelError`, `reader.overrides.OverrideError`, `OSError`.
    """
    name = "<stdin>" if os.fspath(path) == "-" else os.fspath(path)
    return document.read(source.read(path), name, parameters)


def loads(text: str, parameters: Mapping[str, object] | None = None, path: str = "<text>") -> Model:
    """The model in a text."""
    return document.read(text, path, parameters)


class Compiled:
    """A system with its functions, also with integrals held."""

    def __init__(self, built: system.System, functions: holding.Functions | None = None) -> None:
        self.system = built
        self.functions = functions or holding.Functions(compile.NumericSystem(built))
        self._integrals: dict[Integrals, holding.Integrals] = {}
        self._searched: dict[Values, Found] = {}

    @property
    def numeric(self) -> compile.NumericSystem:
        """The functions of the system by itself."""
        return self.functions.numeric

    def case(self) -> Case:
        """The system at the consistent state nearest to its start. Raises `diagnostics.ModelError`."""
        return Case(self.system, self.numeric, walk.begin(self.system, self.numeric))

    def integrals(self, found: Integrals) -> holding.Integrals:
        """These integrals with their functions, built anew where a value is built in that has changed."""
        known = self._integrals.get(found)
        if known is None or not known.hold_for(self.system):
            known = self._integrals[found] = holding.Integrals(self.system, self.functions, found)
        return known

    def with_values(self, model: Model) -> Compiled | None:
        """The same functions for other values of parameters and start, or None where they do not fit."""
        moved = system.with_values(self.system, model)
        if moved is None:
            return None
        same = Compiled(moved, self.functions)
        same._integrals, same._searched = self._integrals, self._searched
        return same

    def searched(self, limit: float) -> Found:
        """The first integrals as far as they are found in `limit` seconds; another run with the same values asks
        for no other search."""
        start = initial.declared(self.system)
        values = (*start.p.tolist(), *start.q.tolist(), *start.v.tolist(), start.t, limit)
        if values not in self._searched:
            found = _searched(self, limit)
            self._searched.clear()  # only the last: a study of many values asks for none of them again
            self._searched[values] = found
        return self._searched[values]


_kept: OrderedDict[str, Compiled] = OrderedDict()


def compiled(model: Model) -> Compiled:
    """The compiled system of a model. Other values of parameters or of the start need no new build."""
    kept = _kept.pop(model.fingerprint, None)
    result = (kept.with_values(model) if kept is not None else None) or Compiled(system.build(model))
    _kept[model.fingerprint] = result
    while len(_kept) > KEPT_SYSTEMS:
        _kept.popitem(last=False)
    return result


def count(model: Model, limit: float = settings.LIMIT) -> degrees_of_freedom.DofCount:
    """The degrees of freedom. Raises `diagnostics.ModelError`, `ValueError` for a limit that is none."""
    _require_seconds(limit)
    case = compiled(model).case()
    found = classify.classify(case, limit)
    return degrees_of_freedom.examine(case.system, case.numeric, case.begin, found).count


def check(model: Model, limit: float = settings.LIMIT) -> report.Report:
    """Everything that can be said before a run.

    Raises `diagnostics.ModelError` for an impossible model, `ValueError` for a limit that is none.
    """
    _require_seconds(limit)
    case = compiled(model).case()
    built, numeric = case.system, case.numeric
    found = classify.classify(case, limit)
    examined = degrees_of_freedom.examine(built, numeric, case.begin, found)
    counted = examined.count
    multipliers = uniqueness.multipliers(built, numeric, examined.points, examined.surface)
    verdicts = (*rows.holonomic(model, tuple(row.name for row in built.rows.rows)), *found.verdicts)
    residuals = initial.residuals(built, numeric, initial.declared(built))
    faults = [*_inertia(built, numeric), *initial.inconsistencies(built, residuals)]
    return report.Report(
        title=model.title,
        path=model.path,
        dof=counted,
        constraints=tuple(
            report.ConstraintReport(verdict, verdict.row in counted.redundant_rows, unique)
            for verdict, unique in zip(verdicts, multipliers.unique, strict=True)
        ),
        null_vectors=multipliers.null_vectors,
        joint=report.joint(counted, found),
        initial=report.Initial(
            float(residuals.position.max(initial=0.0)),
            float(residuals.velocity.max(initial=0.0)),
            residuals.consistent,
        ),
        warnings=(
            *model.warnings,
            *built.warnings,
            *(dataclasses.replace(d, severity="warning") for d in faults),
        ),
    )


def _inertia(built: system.System, numeric: compile.NumericSystem) -> tuple[diagnostics.Diagnostic, ...]:
    """What `simulate` would refuse about the inertia of a model that can be classified and counted all the same."""
    try:
        initial.inertia(built, numeric, initial.declared(built))
    except diagnostics.ModelError as error:
        return error.diagnostics
    return ()


def first_integrals(ready: Compiled, limit: float = settings.LIMIT) -> Found:
    """The first integrals of the differential rows, as far as they are found in `limit` seconds."""
    return ready.searched(limit) if ready.system.model.differential else Found()


def _searched(ready: Compiled, limit: float) -> Found:
    """The same by a search. Where numbers show that there are none, no algebra is asked."""
    case = ready.case()
    if classify.certainly_nonholonomic(case):
        return Found()
    found = classify.classify(case, limit)
    return Found(found.integrals, unheld.notes(found))


Find = Callable[[Compiled], Found]


def run_settings(model: Model, changes: Mapping[str, Any]) -> Simulation:
    """The settings of a run: the file's, with `changes` that are not None. Raises `ValueError`, `TypeError`."""
    given = {key: value for key, value in changes.items() if value is not None}
    unknown = given.keys() - {field.name for field in dataclasses.fields(Simulation)}
    if unknown:
        raise TypeError(f"there is no setting `{min(unknown)}`")
    for key in given.keys() & REAL_SETTINGS:
        given[key] = float(given[key])
    if "samples" in given and "output_step" in given:
        raise ValueError("samples and output_step both say where the rows stand; give one of them")
    if "samples" in given:
        given["output_step"] = None
    changed = dataclasses.replace(model.simulation, **given)
    faults = [f"{key}: {message}" for key, message in settings.faults(changed)]
    if faults:
        raise ValueError("; ".join(faults))
    return changed


class Running:
    """A run that is ready to go: columns, then `blocks` of rows once, then `stats`.

    `resumed` is where an earlier run of the same model stood: this one goes on from there. `find` gives the first
    integrals of the differential rows, which are held at their values at the start as far as that can be.
    Raises `diagnostics.ModelError`, `checkpoints.CheckpointError` where it is of another run or nothing is left.
    """

    def __init__(
        self,
        model: Model,
        chosen: Simulation,
        resumed: checkpoints.Checkpoint | None = None,
        find: Find = first_integrals,
    ) -> None:
        began = time.perf_counter()
        self.model = model = dataclasses.replace(model, simulation=chosen)
        if resumed is not None:
            checkpoints.require_same(resumed.identity, model)
        ready = compiled(model)
        self._system = ready.system
        self.assembly: assembly.Assembly | None = None
        self.warnings = (*model.warnings, *ready.system.warnings)
        columns = ready.system.columns
        self.columns = ("t", *columns)
        state = initial.declared(ready.system)
        # The start of a run that goes on was examined, and perhaps assembled, when it began.
        if resumed is None:
            state = self._examined(ready, state)
            begin = redundancy.begin(ready.system, ready.numeric, state)
            found = find(ready)
            self._found = found.integrals
            held, notes = holding.begin(ready.integrals(self._found).keeping(begin.selection), state)
            with_constants = dataclasses.replace(state, p=held.parameters)
            if not begin.is_singular:
                initial.require_finite(ready.system, held.functions.numeric, with_constants)
            first = driver.Begin(state.q, state.v, begin.is_singular)
            self._run = driver.Run(held, first, chosen, columns, (*notes, *found.notes))
        else:
            self._found = resumed.integrals
            held = holding.Holding(_resumed(ready, resumed), resumed.mark.levels, state.p)
            self._run = driver.Run(held, resumed.mark, chosen, columns)
        self._start, self._numeric = state, ready.numeric
        self.grid = self._run.grid
        self._compile_seconds = time.perf_counter() - began

    def _examined(self, ready: Compiled, start: initial.State) -> initial.State:
        """The start, assembled where that is wanted. Raises `diagnostics.ModelError` where no run can begin."""
        built, numeric, chosen = ready.system, ready.numeric, self.model.simulation
        initial.inertia(built, numeric, start)
        residuals = initial.residuals(built, numeric, start)
        if chosen.assemble:
            self.assembly = assembly.assemble(built, numeric, start, chosen.keep)
            start = self.assembly.state
            initial.inertia(built, numeric, start)
        else:
            assembly.require_consistent(built, numeric, start, residuals)
        return start

    @property
    def t(self) -> float:
        """The time reached."""
        return self._run.t

    def blocks(self) -> Iterator[Floats]:
        """Blocks of rows (k, len(columns)). Raises `driver.Stopped` after the last good one."""
        try:
            yield from self._run.blocks()
        except driver.Stopped as stopped:
            fallen = self._fallen_inertia()
            if not fallen:
                raise
            stop = stopped.stop
            raise driver.Stopped(dataclasses.replace(stop, reason=f"{stop.reason}; {fallen}")) from None

    def _fallen_inertia(self) -> str:
        """What inertia a run has lost where it stopped, as a sentence, or nothing."""
        start, inertia = self._start, self._numeric.inertia
        now = inertia(self._run.t, *np.split(self._run.y[:-1], 2), start.p)
        return degenerate.fallen(
            now, inertia(start.t, start.q, start.v, start.p), self.model.coordinate_names
        )

    @property
    def passed_over(self) -> int:
        """Rows of the grid that a resumed run cannot give: those before the state it goes on from."""
        return self._run.passed_over

    def checkpoint(self) -> checkpoints.Checkpoint:
        """Where to go on from after all blocks so far; for the time between two of them, or after the last."""
        return checkpoints.Checkpoint(self._identity, self._run.mark(), self._found)

    @functools.cached_property
    def _identity(self) -> checkpoints.Identity:
        return checkpoints.identity(self.model)

    @property
    def notes(self) -> tuple[str, ...]:
        """What there is to say so far: multipliers that are not unique, singular configurations that were passed,
        integrals that are not held all the time."""
        account = self._run.account
        return (
            *redundancy.notes(self._system, self._run.selection),
            *redundancy.passed(self._system, account.crossings),
            *account.notes,
        )

    @property
    def stats(self) -> Stats:
        """The account so far; of a resumed run it covers the whole, but for the seconds."""
        account = self._run.account
        figures = account.figures
        return Stats(
            account.steps,
            account.rejected,
            account.evaluations,
            self._compile_seconds,
            account.solve_seconds,
            checkpoints.METHOD,
            figures.position_drift if figures else 0.0,
            figures.velocity_drift if figures else 0.0,
            account.energy_imbalance,
            tuple(self._system.rows.rows[i].name for i in sorted(self._run.selection.indeterminate)),
            tuple(crossing.t for crossing in account.crossings),
        )


def _resumed(ready: Compiled, point: checkpoints.Checkpoint) -> holding.Integrals:
    """The integrals of a checkpoint. Raises `checkpoints.CheckpointError` where one is none of this system."""
    if point.mark.selection.count != len(ready.system.rows.rows):
        raise checkpoints.CheckpointError("it is a damaged checkpoint: it has another number of rows")
    try:
        return ready.integrals(point.integrals).keeping(point.mark.selection)
    except (ExpressionError, KeyError):
        raise checkpoints.CheckpointError(
            "it is a damaged checkpoint: it holds integrals of other names"
        ) from None


def _require_seconds(limit: float) -> None:
    if not limit >= 0:  # nan neither
        raise ValueError("limit: a number of seconds is needed, 0 or more")


def running(
    model: Model, chosen: Simulation, resume: Path | None = None, limit: float = settings.LIMIT
) -> Running:
    """A run from its start, or from the checkpoint in a file; `limit`: seconds to find first integrals.

    Raises as `Running`, `OSError`, and `ValueError` for a limit that is none; what is wrong with the checkpoint is
    told with the name of the file.
    """
    _require_seconds(limit)
    find = functools.partial(first_integrals, limit=limit)
    try:
        return Running(model, chosen, checkpoints.read(resume) if resume is not None else None, find)
    except checkpoints.CheckpointError as error:
        raise checkpoints.CheckpointError(f"{os.fspath(resume or '')}: {error}") from None


def simulate(
    model: Model,
    *,
    columns: str = "*",
    checkpoint: Path | None = None,
    resume: Path | None = None,
    limit: float = settings.LIMIT,
    **changes: Any,
) -> Trajectory:
    """The whole run of a model; keywords as the options of the command line, `columns` and `limit` among them.

    Raises `diagnostics.ModelError`, `ValueError` for bad settings and for a checkpoint that does not fit,
    `OSError` for one that cannot be read or written, `SimulationStopped` with the rows so far.
    """
    began = time.perf_counter()
    ready = running(model, run_settings(model, changes), resume, limit)
    picked = selection.select(ready.columns, columns)
    names = tuple(ready.columns[i] for i in picked)
    keeper = checkpoint_file.Keeper(checkpoint) if checkpoint is not None else None
    blocks = [np.zeros((0, len(names)))]
    stop: driver.Stop | None = None
    try:
        for block in ready.blocks():
            blocks.append(block if names == ready.columns else block[:, picked])
            if keeper is not None:
                keeper.take(ready.checkpoint())
    except driver.Stopped as stopped:
        stop = stopped.stop
    finally:
        if keeper is not None:
            keeper.write()
    rows = np.concatenate(blocks)
    blocks.clear()  # freeing memory takes its time too
    # What is left of the wall time went into the rows: taken together, chosen, kept.
    stats = ready.stats
    seconds = time.perf_counter() - began - stats.compile_seconds
    result = Trajectory(names, rows, dataclasses.replace(stats, solve_seconds=seconds), ready.notes)
    if stop is not None:
        raise SimulationStopped(stop.reason, stop.t, result)
    return result
