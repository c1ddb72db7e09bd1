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
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lagcli.analysis.check_report import Report
    from lagcli.analysis.displacements.displacement_set import Displacements
    from lagcli.analysis.dof import DofCount
    from lagcli.auditing.audit_report import Audit
    from lagcli.derivation.derivation_page import Derivation
    from lagcli.errors.diagnostics import ModelError
    from lagcli.formulations.comparison import Comparison
    from lagcli.input.overrides import OverrideError
    from lagcli.model.model import Model
    from lagcli.output.trajectory import SimulationStopped, Trajectory

    Path = str | os.PathLike[str]

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
    "Audit": "auditing.audit_report",
    "Comparison": "formulations.comparison",
    "Derivation": "derivation.derivation_page",
    "Displacements": "analysis.displacements.displacement_set",
    "DofCount": "analysis.dof",
    "Model": "model.model",
    "ModelError": "errors.diagnostics",
    "OverrideError": "input.overrides",
    "Report": "analysis.check_report",
    "SimulationStopped": "output.trajectory",
    "Trajectory": "output.trajectory",
}


def load(path: Path, parameters: Mapping[str, object] | None = None) -> Model:
    """Return the model in a file (`-` for standard input).

    `parameters` overrides parameters and initial values, `{"m": 2, "theta.value": "pi/3"}`.
    Raises `ModelError` with every error of the file, `OverrideError`, `OSError`.
    """
    model: Model = _pipeline().load(path, parameters)
    return model


def loads(text: str, parameters: Mapping[str, object] | None = None) -> Model:
    """Return the model in a text; otherwise as `load`."""
    model: Model = _pipeline().loads(text, parameters)
    return model


def dof(model: Model | Path, *, limit: float | None = None) -> DofCount:
    """Count the degrees of freedom; `configuration_dof` is None where it is undecided, with the `reason`.

    `limit`: the seconds for proofs of integrability. Raises `ModelError`, `ValueError`.
    """
    counted: DofCount = _pipeline().count(_read(model), **_given(limit=limit))
    return counted


def check(model: Model | Path, *, assemble: bool = False, limit: float | None = None) -> Report:
    """Return verdicts, count, redundancy and consistency: the object behind `lagcli check --json`.

    `assemble` looks at the nearest consistent start; `limit`: the seconds for proofs of integrability. Raises
    `ModelError`, `ValueError`.
    """
    report: Report = _pipeline().check(_read(model), assemble=assemble, **_given(limit=limit))
    return report


def simulate(
    model: Model | Path,
    *,
    start: float | None = None,
    duration: float | None = None,
    samples: int | None = None,
    output_step: float | None = None,
    method: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    assemble: bool | None = None,
    keep: Sequence[str] | None = None,
    columns: str = "*",
    digits: bool = False,
    limit: float | None = None,
    checkpoint: Path | None = None,
    resume: Path | None = None,
) -> Trajectory:
    """Integrate m a = F + sum lambda_i B_i (D.24) and return the table.

    What is None is as the model says. `samples` (both ends counted) or `output_step` say where the rows are; `max_step`
    is what no step is longer than; `assemble` moves the start to the nearest consistent state, without the coordinates
    in `keep`; `columns` takes patterns ("t,lambda.*"); `digits` adds columns `err.*` and `run.digits`, from a second
    run; `limit` is the seconds to find the first integrals that are enforced; `checkpoint` and `resume` are files to
    keep the state of the run in and to go on from: rows then begin after the last one of the run before.
    Raises `ModelError` where the start is inconsistent, `ValueError` for bad options and for a checkpoint that belongs
    to a different run, `OSError`, `SimulationStopped` where the integration cannot go on.
    """
    given = _given(
        start=start, duration=duration, samples=samples, output_step=output_step, method=method, rtol=rtol, atol=atol,
        max_step=max_step, assemble=assemble, keep=None if keep is None else tuple(keep), limit=limit,
        checkpoint=checkpoint, resume=resume,
    )  # fmt: skip
    run: Trajectory = _pipeline().simulate(_read(model), columns=columns, digits=digits, **given)
    return run


def audit(
    model: Model | Path,
    run: Trajectory | Path | None = None,
    *,
    duration: float | None = None,
    samples: int | None = None,
    output_step: float | None = None,
    method: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    assemble: bool | None = None,
    digits: bool = False,
) -> Audit:
    """Check a run by its table and the model alone, without the functions that made it.

    `run`: a trajectory, or the file of a table; without one the model is simulated now, with the other options as of
    `simulate`. For a table that is given, `rtol` and `atol` say how well it was computed. `passed` says whether no
    check fails, `checks` has each with its worst place and limit. Raises `ModelError`, `ValueError` for a table that
    lacks columns and for bad options, `OSError`.
    """
    given = _given(
        duration=duration, samples=samples, output_step=output_step, method=method, rtol=rtol, atol=atol,
        max_step=max_step, assemble=assemble,
    )  # fmt: skip
    audited: Audit = _pipeline().audit(_read(model), run, digits=digits, **given)
    return audited


def compare(
    model: Model | Path,
    other: Model | Path | None = None,
    *,
    columns: str = "*",
    tolerance: float | None = None,
    duration: float | None = None,
    samples: int | None = None,
    output_step: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    assemble: bool | None = None,
) -> Comparison:
    """Run a model in every formulation that fits it, or two models, and compare their shared columns.

    `tolerance` (1e-8): the largest difference that passes, as a part of the largest value of its kind; `columns`:
    patterns of the columns to compare; the other options as of `simulate` (samples: 101). `agree` is the verdict,
    `agreements` has the digits. Raises `ModelError`, `ValueError` for bad options and models that share no column.
    """
    given = _given(
        duration=duration, samples=samples, output_step=output_step, rtol=rtol, atol=atol, max_step=max_step,
        assemble=assemble,
    )  # fmt: skip
    second = None if other is None else _read(other)
    compared: Comparison = _pipeline().compare(
        _read(model), second, columns=columns, tolerance=tolerance, **given
    )
    return compared


def derive(
    model: Model | Path,
    *,
    solve: bool = False,
    everything: bool = False,
    values: Iterable[str] = (),
    limit: float | None = None,
) -> Derivation:
    """Return the equations of motion as they are written on paper, each line with its number; `print` shows them.

    `solve`: lambda and accelerations in closed form; `everything`: all members of families and all terms of sums;
    `values`: names of parameters that are put in as numbers; `limit`: seconds of this computation. The object has
    `text()`, `latex()`, `markdown()`, `html()`, `as_json()`, and in SymPy `equations()`, `constraints()` and `system`.
    Raises `ModelError`, `ValueError` for a parameter there is not and for a limit that is none.
    """
    options = {"solve": solve, "everything": everything, "values": values, **_given(limit=limit)}
    derived: Derivation = _pipeline().derive(_read(model), **options)
    return derived


def displacements(
    model: Model | Path,
    at: float | None = None,
    *,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    assemble: bool | None = None,
) -> Displacements:
    """Return bases of the allowed (D.6) and virtual (D.9) displacements at a time, by default the start.

    Also the dependent and independent components (D.16), and whether forces between particles are central. Options
    as of `simulate`. Raises `ModelError`, `ValueError` for a time before the start, `SimulationStopped`.
    """
    given = _given(rtol=rtol, atol=atol, max_step=max_step, assemble=assemble)
    found: Displacements = _pipeline().displacements(_read(model), at, **given)
    return found


def _read(model: Model | Path) -> Model:
    """The model itself, or that in a file."""
    return load(model) if isinstance(model, (str, os.PathLike)) else model


def _given(**options: Any) -> dict[str, Any]:
    """The options that are not None."""
    return {name: value for name, value in options.items() if value is not None}


@functools.cache
def _pipeline() -> Any:
    """The module behind all functions here. Raises `ImportError` where a library is too old."""
    refusal = importlib.import_module("lagcli.requirements").too_old()
    if refusal:
        raise ImportError(refusal)
    return importlib.import_module("lagcli.api.pipeline")


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"lagcli.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'lagcli' has no attribute {name!r}")
