"""Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems.

    import lagcli
    model = lagcli.load("models/pendulum.yaml")
    lagcli.dof(model).configuration_dof
    run = lagcli.simulate(model, duration=10)
    run.t, run["lambda.rod"], run.reaction("a")

Nothing heavy is loaded before it is needed: importing this package loads neither SymPy, SciPy, matplotlib nor
the numeric engine.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lagcli.auditing.report import Audit
    from lagcli.degrees_of_freedom import DofCount
    from lagcli.derivation.page import Derivation
    from lagcli.diagnostics import ModelError
    from lagcli.formulations.comparison import Comparison
    from lagcli.model import Model
    from lagcli.reader.overrides import OverrideError
    from lagcli.report import Report
    from lagcli.trajectory import SimulationStopped, Trajectory
    from lagcli.virtual_displacements.answer import Displacements

__version__ = "0.1.0"

__all__ = [
    "Audit",
    "Comparison",
    "Derivation",
    "Displacements",
    "DofCount",
    "Model",
    "ModelError",
    "OverrideError",
    "Report",
    "SimulationStopped",
    "Trajectory",
    "audit",
    "check",
    "compare",
    "derive",
    "displacements",
    "dof",
    "load",
    "loads",
    "simulate",
]

_HOMES = {
    "Audit": "auditing.report",
    "Comparison": "formulations.comparison",
    "Derivation": "derivation.page",
    "Displacements": "virtual_displacements.answer",
    "DofCount": "degrees_of_freedom",
    "Model": "model",
    "ModelError": "diagnostics",
    "OverrideError": "reader.overrides",
    "Report": "report",
    "SimulationStopped": "trajectory",
    "Trajectory": "trajectory",
}


def load(path: str | os.PathLike[str], parameters: Mapping[str, object] | None = None) -> Model:
    """The model in a file (`-` for standard input).

    `parameters` overrides parameters and initial values, `{"m": 2, "theta.value": "pi/3"}`.
    Raises `ModelError` with every error of the file, `OverrideError`, `OSError`.
    """
    model: Model = _pipeline().load(path, parameters)
    return model


def loads(text: str, parameters: Mapping[str, object] | None = None) -> Model:
    """The model in a text; otherwise as `load`."""
    model: Model = _pipeline().loads(text, parameters)
    return model


def dof(model: Model, **options: Any) -> DofCount:
    """The count of degrees of freedom; `configuration_dof` is None where it is undecided, with the `reason`.

    Options: limit, the seconds for proofs of integrability.
    """
    counted: DofCount = _pipeline().count(model, **options)
    return counted


def check(model: Model, **options: Any) -> Report:
    """Verdicts, count, redundancy and consistency: the object behind `lagcli check --json`; options as of `dof`."""
    report: Report = _pipeline().check(model, **options)
    return report


def simulate(model: Model, **options: Any) -> Trajectory:
    """Integrate m a = F + sum lambda_i B_i (D.24) and return the table.

    Options: start, duration, samples, output_step, method, rtol, atol, assemble, keep, whose defaults are the
    model's, columns ("t,lambda.*"), digits (columns `err.*` and `run.digits`, from a second run), limit (seconds to
    find the first integrals that are held), and checkpoint and resume, files to keep the state of the run in and to go
    on from: rows then begin after the last one of the run before. Raises `ModelError` where the start is
    inconsistent, `ValueError` for bad options and for a checkpoint of another run, `OSError`, `SimulationStopped`
    where the integration cannot go on.
    """
    run: Trajectory = _pipeline().simulate(model, **options)
    return run


def audit(model: Model, run: Trajectory | str | os.PathLike[str] | None = None, **options: Any) -> Audit:
    """A second opinion on a run: only its table and the model are looked at, without the functions that made it.

    `run`: a trajectory, or the file of a table; without one the model is simulated now. Options: those of `simulate`,
    of which `rtol` and `atol` say how well a table that is given was computed. `passed` tells whether no check fails,
    `checks` has each with its worst place and limit. Raises `ModelError`, `ValueError` for a table that lacks columns
    and for bad options, `OSError`.
    """
    audited: Audit = _pipeline().audit(model, run, **options)
    return audited


def compare(model: Model, other: Model | None = None, **options: Any) -> Comparison:
    """A model in every formulation that fits it, or two models on their shared columns, side by side.

    Options: tolerance (1e-8), the largest difference that passes, as a part of the largest value of its kind; columns
    to compare; duration, samples (101), output_step, rtol, atol, assemble as of `simulate`. `agree` tells the verdict,
    `agreements` the digits. Raises `ModelError`, `ValueError` for bad options and models that share no column.
    """
    compared: Comparison = _pipeline().compare(model, other, **options)
    return compared


def derive(model: Model, **options: Any) -> Derivation:
    """The equations of motion as they are written on paper, each line with its number in the text.

    Options: solve, for lambda and accelerations in closed form; everything, for all members of families and all terms
    of sums; values, names of parameters that are put in as numbers. The object has `text()`, `latex()`, `markdown()`,
    `html()`, `as_json()`, and in SymPy `equations()`, `constraints()` and `system`. Raises `ModelError`,
    `ValueError` for a parameter there is not.
    """
    derived: Derivation = _pipeline().derive(model, **options)
    return derived


def displacements(model: Model, at: float | None = None, **options: Any) -> Displacements:
    """Bases of the allowed (D.6) and virtual (D.9) displacements at a time, by default the start.

    Also the dependent and independent components (D.16), and whether forces between particles are central. Options:
    rtol, atol, assemble as of `simulate`. Raises `ModelError`, `ValueError` for a time before the start,
    `SimulationStopped`.
    """
    found: Displacements = _pipeline().displacements(model, at, **options)
    return found


def _pipeline() -> Any:
    return importlib.import_module("lagcli.pipeline")


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"lagcli.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'lagcli' has no attribute {name!r}")
