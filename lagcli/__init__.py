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
    from lagcli.analysis.check_report import Report as Report
    from lagcli.analysis.displacement_set import Displacements as Displacements
    from lagcli.analysis.dof import DofCount as DofCount
    from lagcli.api.audit import audit as audit
    from lagcli.api.check import check as check
    from lagcli.api.compare import compare as compare
    from lagcli.api.count_dof import dof as dof
    from lagcli.api.derive import derive as derive
    from lagcli.api.find_displacements import displacements as displacements
    from lagcli.api.find_modes import modes as modes
    from lagcli.api.limit import limit as limit
    from lagcli.api.load import load as load
    from lagcli.api.load import loads as loads
    from lagcli.api.plot import plot as plot
    from lagcli.api.report import report as report
    from lagcli.api.simulate import simulate as simulate
    from lagcli.api.static_points import equilibrium as equilibrium
    from lagcli.api.static_points import stationary as stationary
    from lagcli.api.sweep import sweep as sweep
    from lagcli.auditing.checks.audit_report import Audit as Audit
    from lagcli.derivation.sections.derivation_page import Derivation as Derivation
    from lagcli.errors.diagnostics import ModelError as ModelError
    from lagcli.formulations.comparison import Comparison as Comparison
    from lagcli.formulations.stiff_ladder import StiffLimit as StiffLimit
    from lagcli.input.overrides import OverrideError as OverrideError
    from lagcli.linearization.linear_modes import Modes as Modes
    from lagcli.model.model import Model as Model
    from lagcli.reporting.report_page import ReportPage as ReportPage
    from lagcli.running.trajectory import SimulationStopped as SimulationStopped
    from lagcli.running.trajectory import Trajectory as Trajectory
    from lagcli.statics.static_report import StaticReport as StaticReport

__version__ = "0.1.0"

# The file that each name comes from.
_HOMES = {
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
    "audit": "api.audit",
    "check": "api.check",
    "compare": "api.compare",
    "derive": "api.derive",
    "displacements": "api.find_displacements",
    "dof": "api.count_dof",
    "equilibrium": "api.static_points",
    "limit": "api.limit",
    "load": "api.load",
    "loads": "api.load",
    "modes": "api.find_modes",
    "plot": "api.plot",
    "report": "api.report",
    "simulate": "api.simulate",
    "stationary": "api.static_points",
    "sweep": "api.sweep",
}
__all__ = [*_HOMES]


@functools.cache
def _require_libraries() -> None:
    """Raise `ImportError` where a library is too old."""
    refusal = importlib.import_module("lagcli.errors.requirements").too_old()
    if refusal:
        raise ImportError(refusal)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'lagcli' has no attribute {name!r}")
    if _HOMES[name].startswith("api."):
        _require_libraries()
    return getattr(importlib.import_module(f"lagcli.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
