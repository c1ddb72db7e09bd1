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

import functools
import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lagcli.analysis.check_report import Report
    from lagcli.analysis.displacement_set import Displacements
    from lagcli.analysis.dof import DofCount
    from lagcli.api.audit import audit
    from lagcli.api.check import check
    from lagcli.api.compare import compare
    from lagcli.api.count_dof import dof
    from lagcli.api.derive import derive
    from lagcli.api.find_displacements import displacements
    from lagcli.api.find_modes import modes
    from lagcli.api.limit import limit
    from lagcli.api.load import load, loads
    from lagcli.api.plot import plot
    from lagcli.api.report import report
    from lagcli.api.simulate import simulate
    from lagcli.api.static_points import equilibrium, stationary
    from lagcli.api.sweep import sweep
    from lagcli.auditing.checks.audit_report import Audit
    from lagcli.derivation.sections.derivation_page import Derivation
    from lagcli.errors.diagnostics import ModelError
    from lagcli.formulations.comparison import Comparison
    from lagcli.formulations.stiff_ladder import StiffLimit
    from lagcli.input.overrides import OverrideError
    from lagcli.linearization.linear_modes import Modes
    from lagcli.model.model import Model
    from lagcli.reporting.report_page import ReportPage
    from lagcli.running.trajectory import SimulationStopped, Trajectory
    from lagcli.statics.static_report import StaticReport

__version__ = "0.1.0"

__all__ = [
    "Audit",
    "Comparison",
    "Derivation",
    "Displacements",
    "DofCount",
    "Model",
    "ModelError",
    "Modes",
    "OverrideError",
    "Report",
    "ReportPage",
    "SimulationStopped",
    "StaticReport",
    "StiffLimit",
    "Trajectory",
    "audit",
    "check",
    "compare",
    "derive",
    "displacements",
    "dof",
    "equilibrium",
    "limit",
    "load",
    "loads",
    "modes",
    "plot",
    "report",
    "simulate",
    "stationary",
    "sweep",
]

_CLASSES = {
    "Audit": "auditing.checks.audit_report",
    "Comparison": "formulations.comparison",
    "Derivation": "derivation.sections.derivation_page",
    "Displacements": "analysis.displacement_set",
    "DofCount": "analysis.dof",
    "Model": "model.model",
    "ModelError": "errors.diagnostics",
    "Modes": "linearization.linear_modes",
    "OverrideError": "input.overrides",
    "Report": "analysis.check_report",
    "ReportPage": "reporting.report_page",
    "SimulationStopped": "running.trajectory",
    "StaticReport": "statics.static_report",
    "StiffLimit": "formulations.stiff_ladder",
    "Trajectory": "running.trajectory",
}
# File of `lagcli.api` of each function.
_FUNCTIONS = {
    "audit": "audit",
    "check": "check",
    "compare": "compare",
    "derive": "derive",
    "displacements": "find_displacements",
    "dof": "count_dof",
    "equilibrium": "static_points",
    "limit": "limit",
    "load": "load",
    "loads": "load",
    "modes": "find_modes",
    "plot": "plot",
    "report": "report",
    "simulate": "simulate",
    "stationary": "static_points",
    "sweep": "sweep",
}


@functools.cache
def _require_libraries() -> None:
    """Raise `ImportError` where a library is too old."""
    refusal = importlib.import_module("lagcli.errors.requirements").too_old()
    if refusal:
        raise ImportError(refusal)


def __getattr__(name: str) -> object:
    if name in _FUNCTIONS:
        _require_libraries()
        return getattr(importlib.import_module(f"lagcli.api.{_FUNCTIONS[name]}"), name)
    if name in _CLASSES:
        return getattr(importlib.import_module(f"lagcli.{_CLASSES[name]}"), name)
    raise AttributeError(f"module 'lagcli' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
