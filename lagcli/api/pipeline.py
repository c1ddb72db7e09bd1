"""The stages in their order, text to trajectory, on one page. No physics and no printing here."""

from __future__ import annotations

import dataclasses
import functools
import os
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from lagcli import compiled as compile
from lagcli import progress, yaml_tree
from lagcli.analysis import check_report, codimension, dof, free_particles, redundancy, uniqueness
from lagcli.analysis.classification import classify, hidden_conditions, led_off, row_verdicts, unenforced
from lagcli.analysis.classification.case import Case
from lagcli.analysis.classification.verdict import Condition
from lagcli.equations import (
    cut_warnings,
    energy_jumps,
    level_functions,
    restart,
    row_jumps,
    size_limits,
    system,
    time_functions,
)
from lagcli.errors import diagnostics
from lagcli.expression.tree import ExpressionError
from lagcli.input import document
from lagcli.model import invariant, settings
from lagcli.model.model import Model, Simulation
from lagcli.output import checkpoint_file, table_columns
from lagcli.output import column_choice as selection
from lagcli.output.trajectory import Outcome, SimulationStopped, Stats, Trajectory, provenance
from lagcli.simulation import checkpoint as checkpoints
from lagcli.simulation import grid as grids
from lagcli.simulation import invariants, loop, run_start, run_stop
from lagcli.simulation import step_tolerance as tolerances
from lagcli.simulation.global_error import error_estimate, reference_run
from lagcli.simulation.global_error.accuracy import KINDS, Accuracy
from lagcli.simulation.singular_point import RankDrop
from lagcli.start import assembly, assembly_moves, initial, lipschitz, sample_points, singular_inertia

if TYPE_CHECKING:
    from lagcli import derivation
    from lagcli.analysis.displacements import displacement_set
    from lagcli.auditing import audit_report
    from lagcli.formulations import comparison

Floats = npt.NDArray[np.float64]
Path = str | os.PathLike[str]
Integrals = tuple[invariant.FirstIntegral, ...]
Values = tuple[float, ...]

REAL_SETTINGS = frozenset(("start", "duration", "output_step", "rtol", "atol", "max_step"))
KEPT_SYSTEMS = 8  # compiled systems that stay for another run with other parameters
MOST_AUDITED = 20001  # rows of a run that is made to be audited, where the model asks for fewer
COMPARED_ROWS = 101  # of tables that are compared, where no number of samples is given


@dataclasses.dataclass(frozen=True, slots=True)
class KnownIntegrals:
    """First integrals of the differential rows, notes on those that are not known, and the hidden conditions."""

    integrals: Integrals = ()
    notes: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    orbits: tuple[redundancy.Orbit, ...] = ()


@progress.phase("reading the model")
def load(path: str | os.PathLike[str], parameters: Mapping[str, object] | None = None) -> Model:
    """The model in a file, `-` for standard input; `parameters` as `--set`.

    Raises `diagnostics.ModelError`, `reader.overrides.OverrideError`, `OSError`.
    """
    name = "<stdin>" if os.fspath(path) == "-" else os.fspath(path)
    return document.read(yaml_tree.read(path), name, parameters)


def loads(text: str, parameters: Mapping[str, object] | None = None, path: str = "<text>") -> Model:
    """The model in a text."""
    return document.read(text, path, parameters)


class Compiled:
    """A system with its functions, also with integrals held."""

    def __init__(self, built: system.System, functions: invariants.RunFunctions | None = None) -> None:
        self.system = built
        self.functions = functions or invariants.RunFunctions(compile.NumericSystem(built))
        self._integrals: dict[Integrals, invariants.Integrals] = {}
        self._searched: dict[Values, KnownIntegrals] = {}
        self._timed: time_functions.TimeFunctions | Literal[False] | None = False  # where nobody has asked

    @property
    def numeric(self) -> compile.NumericSystem:
        """The functions of the system by itself."""
        return self.functions.numeric

    @progress.phase("looking for a consistent start")
    def case(self) -> Case:
        """The system at the consistent state nearest to its start. Raises `diagnostics.ModelError`."""
        return Case(self.system, self.numeric, sample_points.begin(self.system, self.numeric))

    def integrals(self, found: Integrals) -> invariants.Integrals:
        """These integrals with their functions, built anew where a value is built in that has changed."""
        known = self._integrals.get(found)
        if known is None or not known.hold_for(self.system):
            known = self._integrals[found] = invariants.Integrals(self.system, self.functions, found)
        return known

    def with_values(self, model: Model) -> Compiled | None:
        """The same functions for other values of parameters and start, or None where they do not fit."""
        moved = system.with_values(self.system, model)
        if moved is None:
            return None
        same = Compiled(moved, self.functions)
        same._integrals, same._searched = self._integrals, self._searched
        if self._timed is None or model.parameters == self.system.model.parameters:
            same._timed = self._timed
        return same

    def timed(self) -> time_functions.TimeFunctions | None:
        """The functions of t; another run of the same model asks for no others."""
        if self._timed is False:
            self._timed = time_functions.functions(self.system.model)
        return self._timed

    def searched(self, limit: float) -> KnownIntegrals:
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


@progress.phase("building the equations")
def compiled(model: Model) -> Compiled:
    """The compiled system of a model. Other values of parameters or of the start need no new build."""
    size_limits.require_built(model)
    kept = _kept.pop(model.fingerprint, None)
    result = (kept.with_values(model) if kept is not None else None) or Compiled(system.build(model))
    _kept[model.fingerprint] = result
    while len(_kept) > KEPT_SYSTEMS:
        _kept.popitem(last=False)
    return result


def count(model: Model, limit: float = settings.LIMIT) -> dof.DofCount:
    """The degrees of freedom. Raises `diagnostics.ModelError`, `ValueError` for a limit that is none."""
    _require_seconds(limit)
    if free_particles.holds_for(model):
        return free_particles.count(model)
    return _examined(compiled(model), limit)[1].count


def _examined(ready: Compiled, limit: float) -> tuple[hidden_conditions.Classified, dof.Examined]:
    """The classification and the count, with the hidden conditions among the rows."""
    whole = hidden_conditions.classified(ready.system, ready.numeric, limit)
    case = whole.case
    found = dof.examine(case.system, case.numeric, case.begin, whole.found)
    own = {hidden_conditions.equation(one) for one in whole.conditions}
    counted = dataclasses.replace(
        found.count,
        notes=(*whole.notes, *found.count.notes),
        redundant_rows=tuple(name for name in found.count.redundant_rows if name not in own),
    )
    return whole, dataclasses.replace(found, count=counted)


def assembled(model: Model) -> tuple[Model, assembly.Assembly]:
    """The model with its start moved to the nearest consistent state, and how far. Raises `diagnostics.ModelError`."""
    ready = compiled(model)
    built, numeric = ready.system, ready.numeric
    try:
        found = assembly.assemble(built, numeric, initial.declared(built), model.simulation.keep)
    except diagnostics.ModelError as error:
        if not hidden_conditions.is_conflict(error):
            raise
        case = hidden_conditions.classified(built, numeric).case
        found = assembly.assemble(
            case.system, case.numeric, initial.declared(case.system), model.simulation.keep
        )
    return restart.at(model, found.state.q, found.state.v), found


def check(model: Model, limit: float = settings.LIMIT, *, assemble: bool = False) -> check_report.Report:
    """Everything that can be said before a run; of one that assembles, of its start after that.

    `assemble`: as `--assemble`; the file may ask for it too.
    Raises `diagnostics.ModelError` for an impossible model, `ValueError` for a limit that is none.
    """
    _require_seconds(limit)
    if free_particles.holds_for(model):
        return free_particles.check(model)
    ready = compiled(model)
    residuals = initial.residuals(ready.system, ready.numeric, initial.declared(ready.system))
    moved = None
    if (assemble or model.simulation.assemble) and not residuals.consistent:
        model, done = assembled(model)
        moved, ready = assembly_moves.moves(model, done), compiled(model)
    whole, examined = _examined(ready, limit)
    built, numeric, case = ready.system, ready.numeric, whole.case
    found, counted = whole.found, examined.count
    # A hidden condition has no multiplier of its own.
    surface = codimension.examine(built, numeric, case.begin) if whole.conditions else examined.surface
    multipliers = uniqueness.multipliers(built, numeric, examined.points, surface)
    verdicts = (*row_verdicts.holonomic(model, tuple(row.name for row in built.rows.rows)), *found.verdicts)
    if whole.conditions and moved is None:
        residuals = initial.residuals(case.system, case.numeric, initial.declared(case.system))
    faults = [
        *_inertia(built, numeric),
        *(initial.inconsistencies(case.system, residuals) if moved is None else ()),
    ]
    return check_report.Report(
        title=model.title,
        path=model.path,
        dof=counted,
        constraints=tuple(
            check_report.ConstraintReport(verdict, verdict.row in counted.redundant_rows, unique)
            for verdict, unique in zip(verdicts, multipliers.unique, strict=True)
        ),
        null_vectors=multipliers.null_vectors,
        joint=check_report.joint(counted, found),
        initial=check_report.Initial(
            residuals.of_positions,
            residuals.of_velocities,
            residuals.consistent,
            moved,
        ),
        warnings=(
            *model.warnings,
            *built.warnings,
            *cut_warnings.warnings(built),
            *_jumps(built),
            *lipschitz.warnings(built, numeric, case.begin),
            *(dataclasses.replace(d, severity="warning") for d in faults),
        ),
    )


def _jumps(built: system.System) -> tuple[diagnostics.Diagnostic, ...]:
    place = built.model.simulation.start, *system.start(built.model)
    return energy_jumps.warnings(built.jumps, place, system.values(built))


def _inertia(built: system.System, numeric: compile.NumericSystem) -> tuple[diagnostics.Diagnostic, ...]:
    """What `simulate` would refuse about the inertia of a model that can be classified and counted all the same."""
    try:
        initial.inertia(built, numeric, initial.declared(built))
    except diagnostics.ModelError as error:
        return error.diagnostics
    return ()


def first_integrals(ready: Compiled, limit: float = settings.LIMIT) -> KnownIntegrals:
    """The first integrals of the differential rows, as far as they are found in `limit` seconds."""
    return ready.searched(limit) if ready.system.model.differential else KnownIntegrals()


def _searched(ready: Compiled, limit: float) -> KnownIntegrals:
    """The same by a search. Where numbers show that there are none, no algebra is asked."""
    try:
        case = ready.case()
        if classify.certainly_nonholonomic(case):
            return KnownIntegrals(orbits=case.orbits)
    except diagnostics.ModelError as error:
        if not hidden_conditions.is_conflict(error):
            raise
    whole = hidden_conditions.classified(ready.system, ready.numeric, limit)
    orbits = whole.case.orbits if not whole.conditions else ()
    return KnownIntegrals(whole.found.integrals, unenforced.notes(whole.found), whole.conditions, orbits)


Find = Callable[[Compiled], KnownIntegrals]


def run_settings(model: Model, changes: Mapping[str, Any]) -> Simulation:
    """The settings of a run: the file's, with `changes` that are not None. Raises `ValueError`, `TypeError`."""
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
        raise ValueError("; ".join(faults))
    return changed


class Running:
    """A run that is ready to go: columns, then `blocks` of rows once, then `stats`.

    `resumed` is where an earlier run of the same model stood: this one goes on from there. `find` gives the first
    integrals of the differential rows, which are held at their values at the start as far as that can be.
    `digits`: with columns of errors, from the same run repeated; only from the start.
    Raises `diagnostics.ModelError`, `checkpoints.CheckpointError` where it is of another run or nothing is left.
    """

    def __init__(
        self,
        model: Model,
        chosen: Simulation,
        resumed: checkpoints.Checkpoint | None = None,
        find: Find = first_integrals,
        digits: bool = False,
    ) -> None:
        began = time.perf_counter()
        self.model = model = dataclasses.replace(model, simulation=chosen)
        if resumed is not None:
            checkpoints.require_same(resumed.identity, model)
        ready = compiled(model)
        size_limits.require_run(ready.system)
        self._system = ready.system
        self.assembly: assembly.Assembly | None = None
        self.warnings = (*model.warnings, *ready.system.warnings)
        columns = ready.system.columns
        self.columns = ("t", *columns, *(error_estimate.COLUMNS if digits else ()))
        self._paired: reference_run.RunWithReference | None = None
        state = initial.declared(ready.system)
        spoken = ready.timed()
        self._conditions: tuple[Condition, ...] = ()
        # The start of a run that goes on was examined, and perhaps assembled, when it began.
        if resumed is None:
            state, found, whole = self._begun(ready, state, find)
            self.warnings += lipschitz.warnings(ready.system, ready.numeric, state)
            begin = redundancy.begin(ready.system, ready.numeric, state, whole, found.orbits)
            self._found, self._conditions = found.integrals, found.conditions
            held, notes = invariants.begin(ready.integrals(self._found).keeping(begin.selection), state)
            with_constants = dataclasses.replace(state, p=held.parameters)
            if not begin.is_singular:
                initial.require_finite(ready.system, held.functions.numeric, with_constants)
            first = run_start.RunStart(state.q, state.v, begin.is_singular)
            self._run = loop.start(held, first, chosen, columns, (*notes, *found.notes), spoken)
            if digits:
                self._paired = reference_run.RunWithReference(ready.system, self._run, held, first, chosen)
        else:
            self._found = resumed.integrals
            if len(resumed.mark.turns) != (ready.system.cuts.count if ready.system.cuts else 0):
                raise checkpoints.CheckpointError("it is a damaged checkpoint: its number of angles is wrong")
            held = invariants.EnforcedInvariants(_resumed(ready, resumed), resumed.mark.levels, state.p)
            self._run = loop.resume(held, resumed.mark, chosen, columns, spoken)
        self._start, self._numeric = state, ready.numeric
        self.grid = grids.grid(chosen)
        self.resumed = resumed
        # The account covers the whole run: rows that were handed out before it was resumed too.
        self.outcome = Outcome()
        if resumed is not None:
            row = resumed.mark.row
            self.outcome = Outcome(self._run.grid.after(row), resumed.mark.origin + row)
        self._compile_seconds = time.perf_counter() - began

    def _begun(
        self, ready: Compiled, state: initial.State, find: Find
    ) -> tuple[initial.State, KnownIntegrals, tuple[system.System, compile.NumericSystem] | None]:
        """The start, on hidden conditions too, what was found, and the system with these conditions where there are
        some. Raises `diagnostics.ModelError`."""
        try:
            start = self._examined(ready.system, ready.numeric, state)
            found = find(ready)
        except diagnostics.ModelError as error:
            # Off a hidden condition no velocity satisfies the rows.
            found = find(ready) if hidden_conditions.is_conflict(error) else KnownIntegrals()
            if not found.conditions:
                raise
        if not found.conditions:
            return start, found, None
        whole = hidden_conditions.extended(ready.system, found.conditions)
        numeric = compile.NumericSystem(whole)
        return self._examined(whole, numeric, state), found, (whole, numeric)

    @progress.phase("looking at the start")
    def _examined(
        self, built: system.System, numeric: compile.NumericSystem, start: initial.State
    ) -> initial.State:
        """The start, assembled where that is wanted. Raises `diagnostics.ModelError` where no run can begin."""
        chosen = self.model.simulation
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
        return self._run.origin + self._run.t

    def blocks(self) -> Iterator[Floats]:
        """Blocks of rows (k, len(columns)). Raises `run_stop.RunStop` after the last good one."""
        try:
            for block in (self._paired or self._run).blocks():
                if self._paired:
                    self._floors.take(block)
                self.outcome.take(block)
                yield block
        except run_stop.RunStop as stopped:
            stop = stopped.stop
            if fallen := self._fallen_inertia():
                stop = dataclasses.replace(stop, reason=f"{stop.reason}; {fallen}")
            if why := self._led_off():
                where = stop.reason.partition(": ")[0]
                stop = dataclasses.replace(stop, reason=f"{where}: {why}", code=run_stop.NO_SOLUTION)
            self.outcome.stop(stop)
            raise run_stop.RunStop(stop) from None

    @functools.cached_property
    def _forces(self) -> table_columns.GeneralizedForces:
        return table_columns.GeneralizedForces(self._system, self._numeric, self._start.p, self.columns)

    @property
    def built(self) -> system.System:
        """What is integrated."""
        return self._system

    @property
    def numeric(self) -> compile.NumericSystem:
        """Its functions, whatever integrals are held."""
        return self._numeric

    @property
    def parameters(self) -> Floats:
        """The numbers that go with them."""
        return self._start.p

    @property
    def exchanged(self) -> float:
        """The largest T so far plus the largest change of V."""
        figures = self._run.account.figures
        return figures.moving + figures.resting if figures else 0.0

    @property
    def rank(self) -> int:
        """The number of independent rows it is stepped with."""
        return len(self._run.selection.kept)

    @property
    def by_name(self) -> tuple[str, ...]:
        """Columns that are given only where they are asked for by name: `Q.theta`."""
        return self._forces.names

    def taken(self, block: Floats, picked: list[int]) -> Floats:
        """Some columns of a block, by their numbers in `columns` and, after them, `by_name`."""
        if picked == list(range(len(self.columns))):
            return block
        if max(picked, default=0) >= len(self.columns):
            block = np.hstack([block, self._forces(block)])
        return block[:, picked]

    def _fallen_inertia(self) -> str:
        """What inertia a run has lost where it stopped, as a sentence, or nothing."""
        start, inertia = self._start, self._numeric.inertia
        now = inertia(self.t, *np.split(self._run.y[:-1], 2), start.p)
        return singular_inertia.fallen(
            now, inertia(start.t, start.q, start.v, start.p), self.model.coordinate_names
        )

    def _led_off(self) -> str:
        """The hidden conditions that the forces do not keep where a run stopped, as a sentence, or nothing."""
        if not self._conditions:
            return ""
        (q, v), a = np.split(self._run.y[:-1], 2), np.split(self._run.rate[:-1], 2)[1]
        state = initial.State(self.t, q, v, self._start.p)
        return led_off.reason(self._system, self._conditions, state, a)

    def of_table(self, rows: Floats) -> Accuracy | None:
        """What is known of the error of a table of this run; of one with `digits`, in place of `blocks`."""
        assert self._paired is not None
        self._floors.take(rows)
        return self._known(self._paired.of_table(rows))

    @functools.cached_property
    def _floors(self) -> table_columns.Floors:
        return self.floors()

    def floors(self) -> table_columns.Floors:
        """What is zero to rounding in a table of this run, when it has taken its rows."""
        return table_columns.Floors(self._system, self._numeric, self._start.p, self.columns)

    def _known(self, found: Accuracy | None) -> Accuracy | None:
        """The accuracy with the kinds that are zero to rounding."""
        if found is None:
            return None
        floors = self._floors
        kinds = zip(KINDS, error_estimate.places(self._system), strict=True)
        return dataclasses.replace(found, zero=frozenset(k for k, at in kinds if floors.are_zero(at)))

    @property
    def passed_over(self) -> int:
        """Rows of the grid that a resumed run cannot give: those before the state it goes on from."""
        return self._run.passed_over

    def require_rows_left(self) -> None:
        """Raise `checkpoints.CheckpointError` where a resumed run has nothing left to do."""
        self._run.require_rows_left()

    def checkpoint(self) -> checkpoints.Checkpoint:
        """Where to go on from after all blocks so far; for the time between two of them, or after the last."""
        return checkpoints.Checkpoint(self._identity, (self._paired or self._run).mark(), self._found)

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
            *redundancy.passed(self._system, self._crossings),
            *account.notes,
        )

    @property
    def _crossings(self) -> tuple[RankDrop, ...]:
        """Singular configurations up to the time reached: the last step may lead farther."""
        return tuple(crossing for crossing in self._run.account.crossings if crossing.t <= self.t)

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
            account.solve_seconds + (self._paired.solve_seconds if self._paired else 0.0),
            settings.method_name(self.model.simulation),
            figures.position_drift if figures else 0.0,
            figures.velocity_drift if figures else 0.0,
            account.energy_imbalance,
            tuple(self._system.rows.rows[i].name for i in sorted(self._run.selection.indeterminate)),
            tuple(crossing.t for crossing in self._crossings),
            self.outcome.stopped,
            None,
            self.outcome.rows,
            self.outcome.t_end,
            provenance(self.model),
            self._known(self._paired.accuracy) if self._paired else None,
            assembly_moves.moves(self.model, self.assembly) if self.assembly else None,
            self.model.simulation.rtol,
            self.model.simulation.atol,
        )


def _resumed(ready: Compiled, point: checkpoints.Checkpoint) -> invariants.Integrals:
    """The integrals of a checkpoint. Raises `checkpoints.CheckpointError` where one is none of this system."""
    if point.mark.selection.count != len(ready.system.rows.rows):
        raise checkpoints.CheckpointError("it is a damaged checkpoint: its number of rows is wrong")
    try:
        return ready.integrals(point.integrals).keeping(point.mark.selection)
    except (ExpressionError, level_functions.UnknownName):
        raise checkpoints.CheckpointError(
            "it is a damaged checkpoint: it holds integrals of other names"
        ) from None


def _require_seconds(limit: float) -> None:
    if not limit >= 0:  # nan neither
        raise ValueError("limit: a number of seconds is needed, 0 or more")


@progress.phase("preparing the run")
def running(
    model: Model,
    chosen: Simulation,
    resume: Path | None = None,
    limit: float = settings.LIMIT,
    digits: bool = False,
    may_be_over: bool = False,
) -> Running:
    """A run from its start, or from the checkpoint in a file; `limit`: seconds to find first integrals; `digits`: with
    columns of errors; may_be_over: a run whose rows were all handed out before is no error.

    Raises as `Running`, `OSError`, and `ValueError` for a limit that is none and for digits of a run that is resumed;
    what is wrong with the checkpoint is told with the name of the file.
    """
    _require_seconds(limit)
    if digits and resume is not None:
        raise ValueError(f"digits: {error_estimate.NOT_RESUMED}")
    find = functools.partial(first_integrals, limit=limit)
    try:
        resumed = checkpoints.read(resume) if resume is not None else None
        ready = Running(model, chosen, resumed, find, digits)
        if not may_be_over:
            ready.require_rows_left()
        return ready
    except checkpoints.CheckpointError as error:
        raise checkpoints.CheckpointError(f"{os.fspath(resume or '')}: {error}") from None


@progress.phase("simulating")
def simulate(
    model: Model,
    *,
    columns: str = "*",
    checkpoint: Path | None = None,
    resume: Path | None = None,
    limit: float = settings.LIMIT,
    digits: bool = False,
    **changes: Any,
) -> Trajectory:
    """The whole run of a model; keywords as the options of the command line, `columns`, `limit`, `digits` among them.

    Raises `diagnostics.ModelError`, `ValueError` for bad settings and for a checkpoint that does not fit,
    `OSError` for one that cannot be read or written, `SimulationStopped` with the rows so far.
    """
    began = time.perf_counter()
    ready = running(model, run_settings(model, changes), resume, limit, digits)
    picked = selection.select(ready.columns, columns, ready.by_name)
    everything = (*ready.columns, *ready.by_name)
    names = tuple(everything[i] for i in picked)
    keeper = checkpoint_file.Keeper(checkpoint) if checkpoint is not None else None
    blocks = [np.zeros((0, len(names)))]
    stop: run_stop.Stop | None = None
    try:
        for block in ready.blocks():
            blocks.append(ready.taken(block, picked))
            if keeper is not None:
                keeper.take(ready.checkpoint())
    except run_stop.RunStop as stopped:
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


@progress.phase("comparing")
def compare(
    model: Model,
    other: Model | None = None,
    *,
    columns: str = "*",
    tolerance: float | None = None,
    **changes: Any,
) -> comparison.Comparison:
    """A model in every formulation that fits it, or two models as they stand, side by side.

    `columns`: patterns of the columns to compare; `changes` as of `simulate`; `tolerance`: the largest difference that
    passes, as a part of the largest value of its kind. Raises `diagnostics.ModelError`, and `ValueError` for bad
    settings and for two models that share no column or do not start at one time.
    """
    # Other commands compare nothing.
    from lagcli.formulations import comparison, formulation_plan

    if tolerance is None:
        tolerance = comparison.TOLERANCE
    if not tolerance > 0:
        raise ValueError("tolerance: a positive number is needed")
    chosen = _compared_settings(model, other, changes)
    ready = Running(model, chosen)
    first = _recorded(formulation_plan.declared(model, len(ready.built.rows.rows)), ready)
    names = [first.columns[i] for i in selection.select(first.columns, columns)]
    left_out: list[str] = []
    if other is None:
        of = comparison.kinds(model, names)
        others = [(run, formulation_plan.comparable(model, run, of)) for run in _reformulated(ready, first)]
    else:
        beside = Running(other, dataclasses.replace(chosen, assemble=other.simulation.assemble, keep=()))
        second = _recorded(formulation_plan.declared(other, len(beside.built.rows.rows)), beside)
        of = {n: kind for n, kind in comparison.kinds(model, names).items() if n in second.columns}
        if not of:
            raise ValueError(f"{model.path} and {other.path} share none of these columns")
        loose = {f"lambda.{name}" for run in (ready, beside) for name in run.stats.indeterminate}
        left_out = [name for name in of if name in loose]
        others = [(second, {name: kind for name, kind in of.items() if name not in loose})]
    near = np.zeros(len(first.table), dtype=bool)
    if ready.stats.singular_times:
        states = table_columns.States(model, ready.columns)(first.table)
        near = formulation_plan.singular(ready.numeric, states, ready.parameters, ready.rank)
    found = formulation_plan.compared(first, others, tolerance, near)
    if not left_out:
        return found
    note = f"not compared, for they are not unique in one of the models: {', '.join(left_out)}"
    return dataclasses.replace(found, notes=(*found.notes, note))


@progress.phase("auditing")
def audit(
    model: Model, run: Trajectory | Path | None = None, digits: bool = False, **changes: Any
) -> audit_report.Audit:
    """A second opinion on a run, a table in memory or in a file; without one the model is simulated now.

    digits: with an estimate of the error of its rows, from the same run repeated.
    Keywords: the settings of the run, as of `simulate`; of a table that is given `rtol` and `atol` count.
    Raises `diagnostics.ModelError`, `table_input.TableError` where the table lacks columns, `OSError` and
    `read_table.UnreadableTable` for its file, `ValueError` for bad settings.
    """
    # Other commands audit nothing and read no tables.
    from lagcli.auditing import all_checks
    from lagcli.auditing import tolerances as evidence

    chosen = run_settings(model, changes)
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    if isinstance(run, Trajectory):
        columns, rows = run.columns, run.rows
    elif run is not None:
        from lagcli.output.tables import read_table

        table_file = read_table.opened(run)
        columns = all_checks.wanted(model, table_file.columns)
        known = set(columns)
        unread = tuple(name for name in table_file.columns if name not in known)
        rows = table_file.take(columns)
    else:
        table, notes = _dense(model, changes)
        columns, rows = table.columns, table.rows
    model = dataclasses.replace(model, simulation=chosen)
    tolerance = evidence.Tolerance(
        chosen.rtol,
        tolerances.absolute(chosen, table_columns.size(model, columns, rows)),
        row_jumps.jumps(model),
    )
    found = all_checks.audit(model, columns, rows, tolerance, notes, unread)
    found = dataclasses.replace(found, complete=not notes)
    return _with_digits(found, model, columns, rows) if digits else found


def _with_digits(
    found: audit_report.Audit, model: Model, columns: Sequence[str], rows: Floats
) -> audit_report.Audit:
    """An audit with what is known of the error of its rows. Raises `ValueError` where the model does not give such
    rows: they must begin with its start, at equal distances."""
    t = rows[:, list(columns).index("t")]
    if len(t) < 2 or t[0] != model.simulation.start:
        raise ValueError("digits: the table has no rows from the start of the model on")
    step, length = float(t[1] - t[0]), float(t[-1] - t[0])
    is_even = abs(length - step * (len(t) - 1)) <= 1e-9 * length
    rest = {"samples": len(t), "output_step": None} if is_even else {"samples": None, "output_step": step}
    chosen = dataclasses.replace(model.simulation, duration=length, **rest)
    again = Running(model, chosen, digits=True)
    at = {name: i for i, name in enumerate(columns)}
    nothing = np.full(len(rows), np.nan)
    wanted = again.columns[: -len(error_estimate.COLUMNS)]
    table = np.column_stack([rows[:, at[name]] if name in at else nothing for name in wanted])
    try:
        known = again.of_table(table)
    except run_stop.RunStop as stopped:
        raise ValueError(f"digits: the repeated run {stopped.stop.reason}") from None
    if known is None:
        raise ValueError("digits: the rows of the table are not at equal times")
    said = (*found.sentences, known.sentence) if known.sentence else found.sentences
    return dataclasses.replace(found, digits=known.as_json(), sentences=said)


def _dense(model: Model, changes: Mapping[str, Any]) -> tuple[Trajectory, tuple[str, ...]]:
    """A run whose rows stand as close as every second step, and why it stopped where it did."""
    table, notes = _as_far(model, changes)
    wanted = min(table.stats.steps // 2 + 1, MOST_AUDITED)
    if len(table.rows) >= wanted or notes:
        return table, notes
    kept = {key: value for key, value in changes.items() if key != "output_step"}
    return _as_far(model, {**kept, "samples": wanted})


def _as_far(model: Model, changes: Mapping[str, Any]) -> tuple[Trajectory, tuple[str, ...]]:
    try:
        return simulate(model, **changes), ()
    except SimulationStopped as stopped:
        return stopped.trajectory, (f"only the rows before it are audited: {stopped.reason}",)


def _compared_settings(model: Model, other: Model | None, changes: Mapping[str, Any]) -> Simulation:
    """The settings of all runs: the first model's, as long as both last."""
    given = {key: value for key, value in changes.items() if value is not None}
    if not given.keys() & {"samples", "output_step"}:
        given["samples"] = COMPARED_ROWS
    chosen = run_settings(model, given)
    if other is None:
        return chosen
    if other.simulation.start != model.simulation.start and "start" not in given:
        raise ValueError(f"{model.path} and {other.path} start at different times; give one start")
    if "duration" not in given:
        chosen = dataclasses.replace(chosen, duration=min(chosen.duration, other.simulation.duration))
    return chosen


def _reformulated(ready: Running, first: comparison.Formulation) -> Iterator[comparison.Formulation]:
    """The same model in the other formulations that fit it, from the same start."""
    from lagcli.equations import particle_form
    from lagcli.formulations import formulation_plan, reduced_run

    if not len(first.table):
        return
    (t,), (q,), (v,) = table_columns.States(ready.model, ready.columns)(first.table[:1])
    chosen = dataclasses.replace(ready.model.simulation, start=float(t), assemble=False, keep=())
    if formulation_plan.has_dependent(ready.model):
        free = particle_form.model(ready.built, float(t), q, v)
        _kept[free.fingerprint] = Compiled(particle_form.build(ready.built, free))
        yield _recorded("freed", Running(free, chosen, None, lambda _: KnownIntegrals()))
    if formulation_plan.is_reducible(first.rows, first.coordinates):
        table, account, stop = reduced_run.run(ready.built, ready.grid, (q, v, ready.parameters), chosen)
        yield dataclasses.replace(
            first,
            name="reduced",
            rows=0,
            steps=account.steps,
            seconds=account.seconds,
            table=table,
            stopped="" if stop is None else f"stopped at t = {stop.t:.9g}: {stop}",
        )


def _recorded(name: str, ready: Running) -> comparison.Formulation:
    """A run to its end, or as far as it goes."""
    blocks, stopped = [np.zeros((0, len(ready.columns)))], ""
    try:
        for block in ready.blocks():
            blocks.append(block)
    except run_stop.RunStop as stop:
        stopped = stop.stop.reason
    n, stats = len(ready.model.coordinate_names), ready.stats
    from lagcli.formulations import comparison

    return comparison.Formulation(
        name=name,
        path=ready.model.path,
        coordinates=n,
        freedoms=n - ready.rank,
        rows=len(ready.built.rows.rows),
        steps=stats.steps,
        seconds=stats.solve_seconds,
        columns=ready.columns,
        table=np.concatenate(blocks),
        exchanged=ready.exchanged,
        stopped=stopped,
    )


@progress.phase("looking for displacements")
def displacements(model: Model, at: float | None = None, **changes: Any) -> displacement_set.Displacements:
    """Allowed and virtual displacements where the motion has come to at the time `at`, by default its start.

    `changes` as of `simulate`. Raises `diagnostics.ModelError`, `ValueError` for a time before the start, for bad
    settings and for too many coordinates, `SimulationStopped` where the motion does not get there.
    """
    chosen = run_settings(model, changes)
    n = len(model.coordinate_names)
    from lagcli.analysis.displacements import displacement_set

    most = displacement_set.MOST_COORDINATES
    if n > most:
        raise ValueError(f"the model has {n} coordinates, and bases are dense: up to {most} are looked at")
    if at is not None and not 0 <= at - chosen.start < float("inf"):
        raise ValueError(f"at: a time from the start on, t = {chosen.start:g}, is needed")
    if at is None:
        return _displacements_at_start(dataclasses.replace(model, simulation=chosen))
    run = simulate(model, **{**changes, "duration": at - chosen.start, "samples": 2, "output_step": None})
    ready = compiled(model)
    (t,), (q,), (v,) = table_columns.States(model, run.columns)(run.rows[-1:])
    state = initial.State(float(t), q, v, initial.declared(ready.system).p)
    return displacement_set.displacements(ready.system, ready.numeric, state)


def _displacements_at_start(model: Model) -> displacement_set.Displacements:
    """The same at the start, whose velocities need not fit the rows: no row depends on them."""
    from lagcli.analysis.displacements import displacement_set

    moved = None
    if model.simulation.assemble:
        model, done = assembled(model)
        moved = assembly_moves.moves(model, done)
    ready = compiled(model)
    start = initial.declared(ready.system)
    residuals = initial.residuals(ready.system, ready.numeric, start)
    if any(residuals.in_position(i) for i in residuals.violated):
        assembly.require_consistent(ready.system, ready.numeric, start, residuals)
    notes = (
        ()
        if residuals.consistent
        else tuple(d.message for d in initial.inconsistencies(ready.system, residuals))
    )
    found = displacement_set.displacements(ready.system, ready.numeric, start)
    return dataclasses.replace(found, assembled=moved, notes=notes)


@progress.phase("deriving the equations")
def derive(
    model: Model,
    *,
    solve: bool = False,
    everything: bool = False,
    values: Iterable[str] = (),
    limit: float = settings.LIMIT,
) -> derivation.Derivation:
    """The equations of motion, to be printed or worked with in SymPy.

    `solve`: lambda and accelerations in closed form where they stay readable; `everything`: all members of families
    and terms of sums; `values`: parameters that are put in as numbers, `all` for every one; `limit`: seconds of
    processor time for it. Raises `diagnostics.ModelError`, and `ValueError` for a parameter there is not or a
    limit that is none.
    """
    _require_seconds(limit)
    # SymPy is not loaded by commands that need none.
    from lagcli import derivation

    names = [parameter.name for parameter in model.parameters]
    wanted = frozenset(names) if "all" in (given := frozenset(values)) and "all" not in names else given
    if unknown := sorted(wanted.difference(names)):
        hint = diagnostics.nearest(unknown[0], names)
        raise ValueError(f"there is no parameter `{unknown[0]}`{'; ' + hint if hint else ''}")
    return derivation.derive(compiled(model).system, derivation.Options(solve, everything, wanted, limit))
