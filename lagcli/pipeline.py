"""The stages in their order, text to trajectory, on one page. No physics and no printing here."""

from __future__ import annotations

import dataclasses
import os
import time
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli import classification, compile, degrees_of_freedom, diagnostics, report, settings, source
from lagcli.export import columns as selection
from lagcli.integrate import dop853, driver, initial
from lagcli.mechanics import system
from lagcli.model import Model, Simulation
from lagcli.reader import document
from lagcli.trajectory import SimulationStopped, Stats, Trajectory

Floats = npt.NDArray[np.float64]

REAL_SETTINGS = frozenset(("start", "duration", "output_step", "rtol", "atol"))
KEPT_SYSTEMS = 8  # compiled systems that stay for another run with other parameters


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
    """A system with its functions. The scheme is built when a run first asks for it."""

    def __init__(self, built: system.System, numeric: compile.NumericSystem | None = None) -> None:
        self.system = built
        self.numeric = numeric or compile.compile_system(built)
        self._scheme: list[dop853.Scheme] = []

    def scheme(self) -> dop853.Scheme:
        """The compiled step and dense output."""
        if not self._scheme:
            self._scheme.append(dop853.scheme(self.numeric))
        return self._scheme[0]

    def with_values(self, model: Model) -> Compiled | None:
        """The same functions for other values of parameters and start, or None where they do not fit."""
        moved = system.with_values(self.system, model)
        if moved is None:
            return None
        same = Compiled(moved, self.numeric)
        same._scheme = self._scheme
        return same


_kept: OrderedDict[str, Compiled] = OrderedDict()


def compiled(model: Model) -> Compiled:
    """The compiled system of a model. Other values of parameters or of the start need no new build."""
    kept = _kept.pop(model.fingerprint, None)
    result = (kept.with_values(model) if kept is not None else None) or Compiled(system.build(model))
    _kept[model.fingerprint] = result
    while len(_kept) > KEPT_SYSTEMS:
        _kept.popitem(last=False)
    return result


def count(model: Model, limit: float = classification.DEFAULT_LIMIT) -> degrees_of_freedom.DofCount:
    """The degrees of freedom. Raises `diagnostics.ModelError`."""
    ready = compiled(model)
    verdicts = classification.differential(model, limit)
    return degrees_of_freedom.count(ready.system, ready.numeric, {v.row: v.alone for v in verdicts})


def check(model: Model, limit: float = classification.DEFAULT_LIMIT) -> report.Report:
    """Everything that can be said before a run. Raises `diagnostics.ModelError` for an impossible model."""
    ready = compiled(model)
    built, numeric = ready.system, ready.numeric
    differential = classification.differential(model, limit)
    counted = degrees_of_freedom.count(built, numeric, {v.row: v.alone for v in differential})
    names = tuple(row.name for row in built.rows.rows)
    verdicts = (*classification.holonomic(model, names), *differential)
    residuals = initial.residuals(built, numeric, initial.declared(built))
    found = [*_inertia(built, numeric), *initial.inconsistencies(built, residuals)]
    return report.Report(
        title=model.title,
        path=model.path,
        dof=counted,
        constraints=tuple(report.ConstraintReport(v, v.row in counted.redundant_rows) for v in verdicts),
        joint=report.joint(counted, differential, built.holonomic_count),
        initial=report.Initial(
            float(residuals.position.max(initial=0.0)),
            float(residuals.velocity.max(initial=0.0)),
            residuals.consistent,
        ),
        warnings=(
            *model.warnings,
            *built.warnings,
            *(dataclasses.replace(d, severity="warning") for d in found),
        ),
    )


def _inertia(built: system.System, numeric: compile.NumericSystem) -> tuple[diagnostics.Diagnostic, ...]:
    """What `simulate` would refuse about the inertia of a model that can be classified and counted all the same."""
    try:
        initial.inertia(built, numeric, initial.declared(built))
    except diagnostics.ModelError as error:
        return error.diagnostics
    return ()


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
    """A run that is ready to go: columns, then `blocks` of rows once, then `stats`."""

    def __init__(self, model: Model, chosen: Simulation) -> None:
        began = time.perf_counter()
        model = dataclasses.replace(model, simulation=chosen)
        ready = compiled(model)
        built, numeric = ready.system, ready.numeric
        start = initial.declared(built)
        metric = initial.inertia(built, numeric, start)
        self.assembly: initial.Assembly | None = None
        residuals = initial.residuals(built, numeric, start)
        if chosen.assemble:
            self.assembly = initial.assemble(built, numeric, start, chosen.keep)
            start = self.assembly.state
        else:
            initial.require_consistent(built, residuals)
        initial.require_independent(built, numeric, start, metric)
        initial.require_finite(built, numeric, start)
        self.model = model
        self.warnings = (*model.warnings, *built.warnings)
        self.columns = ("t", *built.columns)
        self._run = driver.Run(numeric, ready.scheme(), (start.q, start.v), start.p, chosen, built.columns)
        self.grid = self._run.grid
        self._compile_seconds = time.perf_counter() - began

    @property
    def t(self) -> float:
        """The time reached."""
        return self._run.t

    def blocks(self) -> Iterator[Floats]:
        """Blocks of rows (k, len(columns)). Raises `driver.Stopped` after the last good one."""
        return self._run.blocks()

    @property
    def stats(self) -> Stats:
        """The account so far."""
        account = self._run.account
        return Stats(
            account.steps,
            account.rejected,
            account.evaluations,
            self._compile_seconds,
            account.solve_seconds,
            "dop853",
            account.position_drift,
            account.velocity_drift,
            float(account.energy_imbalance),
        )


def simulate(model: Model, *, columns: str = "*", **changes: Any) -> Trajectory:
    """The whole run of a model; keywords as the options of the command line, `columns` among them.

    Raises `diagnostics.ModelError`, `ValueError` for bad settings, `SimulationStopped` with the rows so far.
    """
    running = Running(model, run_settings(model, changes))
    picked = selection.select(running.columns, columns)
    names = tuple(running.columns[i] for i in picked)
    blocks = [np.zeros((0, len(names)))]
    try:
        blocks.extend(block[:, picked] for block in running.blocks())
    except driver.Stopped as stopped:
        partial = Trajectory(names, np.concatenate(blocks), running.stats)
        raise SimulationStopped(stopped.stop.reason, stopped.stop.t, partial) from None
    return Trajectory(names, np.concatenate(blocks), running.stats)
