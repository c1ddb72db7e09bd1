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
    from lagcli.degrees_of_freedom import DofCount
    from lagcli.diagnostics import ModelError
    from lagcli.model import Model
    from lagcli.reader.overrides import OverrideError
    from lagcli.report import Report
    from lagcli.trajectory import SimulationStopped, Trajectory

__version__ = "0.1.0"

__all__ = [
    "DofCount",
    "Model",
    "ModelError",
    "OverrideError",
    "Report",
    "SimulationStopped",
    "Trajectory",
    "check",
    "dof",
    "load",
    "loads",
    "simulate",
]

_HOMES = {
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
    model's, columns ("t,lambda.*"), limit (seconds to find the first integrals that are held), and checkpoint and
    resume, files to keep the state of the run in and to go on from: rows then begin after the last one of the run
    before. Raises `ModelError` where the start is inconsistent, `ValueError` for bad options and for a checkpoint of
    another run, `OSError`, `SimulationStopped` where the integration cannot go on.
    """
    run: Trajectory = _pipeline().simulate(model, **options)
    return run


def _pipeline() -> Any:
    return importlib.import_module("lagcli.pipeline")


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"lagcli.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'lagcli' has no attribute {name!r}")
