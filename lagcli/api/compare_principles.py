"""The vakonomic motion beside a run: the other principle of `lagcli.compare(..., vakonomic=True)`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.analysis.classification import classify
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.api.models.cache import CompiledModel
from lagcli.api.runs import prepare_run
from lagcli.equations import size_limits
from lagcli.errors import diagnostics
from lagcli.formulations import vakonomic_system
from lagcli.formulations.comparison import Formulation, Principles
from lagcli.input import given_expression
from lagcli.input.overrides import OverrideError
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.running import table_columns
from lagcli.running.simulation_run import SimulationRun

Floats = npt.NDArray[np.float64]
TableMaker = Callable[[str, SimulationRun], "Formulation"]


@dataclasses.dataclass(frozen=True, slots=True)
class OtherPrinciple:
    """The vakonomic run, what is known of the two, and notes."""

    run: Formulation
    principles: Principles
    notes: tuple[str, ...]


def initial_multipliers(
    model: Model, rows: Sequence[str], given: Mapping[str, float | str]
) -> dict[str, float]:
    """mu at the start of all differential `rows`, zero where none is given.

    Raises `OverrideError` for a name that is none of them, `ModelError` for a value that is no number.
    """
    found = dict.fromkeys(rows, 0.0)
    for name, value in given.items():
        label = f"--mu {name}"
        if name not in found:
            raise OverrideError(f"{label}: {_unknown(model, name, rows)}")
        found[name] = given_expression.number(model, label, value)
    return found


def _unknown(model: Model, name: str, rows: Sequence[str]) -> str:
    constrained = [row for law in model.holonomic for row in law.rows]
    constrained += [base for law in model.holonomic for base in law.members.names]
    constrained += [body.name for body in model.rigid]
    if name in constrained or name.rpartition(".")[0] in constrained:
        return f"`{name}` is holonomic: its multiplier follows from the motion and has no initial value"
    parts = [row for row in rows if row.startswith((f"{name}.", f"{name}["))]
    hint = f"its rows are `{parts[0]}` to `{parts[-1]}`" if parts else diagnostics.nearest(name, rows)
    hint = hint or (f"they are {', '.join(rows[:6])}" if rows else "the model has none")
    return f"there is no differential row `{name}`; {hint}"


@progress.phase("following the other principle")
def beside(
    run: SimulationRun, first: Formulation, given: Mapping[str, float | str], table_of: TableMaker
) -> OtherPrinciple:
    """The vakonomic motion from the start of a run whose table is `first`; `table_of` makes a table of a run.

    Raises `ModelError` for forces without a potential, one-sided rows, rows that are too many, and `OverrideError`.
    """

    built, model = run.built, run.model
    differential = built.rows.rows[built.holonomic_count :]
    names = [row.name for row in differential]
    mu = initial_multipliers(model, names, given)
    t, q, v = (part[0] for part in table_columns.States(model, run.columns)(first.table[:1]))
    vakonomic_system.require_action(built, float(t), q, run.parameters)
    for condition in run.conditions:
        where = next(row.location for row in run.built.rows.rows if row.name in condition.rows)
        message = (
            f"the row demands the hidden condition `{condition.text} = 0`, which no multiplier holds: its vakonomic"
            " equations are not written"
        )
        hint = "write the condition under `holonomic` in its place"
        raise diagnostics.ModelError([diagnostics.Diagnostic("not-of-an-action", message, where, hint)])
    if not names:
        same = dataclasses.replace(first, name="vakonomic")
        return OtherPrinciple(same, Principles({}, (), (), (), 0.0), ())
    values = np.array([mu[name] for name in names])
    independent = tuple(i for i in run.report.selection.independent if i < len(built.rows.rows))
    start = vakonomic_system.VakonomicStart(float(t), q, v, values, independent)
    start = dataclasses.replace(start, mu=vakonomic_system.effective(built, start))
    extended, left_out = vakonomic_system.model(built, start)
    size_limits.require_built(extended)
    try:
        ready = CompiledModel(vakonomic_system.build(built, extended, start))
    except vakonomic_system.TooLargeError:
        raise _too_large(model, differential[0].location) from None
    vakonomic = table_of("vakonomic", prepare_run.start_compiled(ready, KnownIntegrals(run.integrals)))
    columns, indices = vakonomic_system.table(vakonomic.columns, model, differential)
    vakonomic = dataclasses.replace(
        vakonomic,
        path=first.path,
        coordinates=first.coordinates,
        freedoms=first.freedoms,
        columns=tuple(columns),
        table=vakonomic.table[:, indices],
    )
    # The verdict on each differential row
    found = classify.classified(run.built, run.numeric, settings.LIMIT).found
    kinds = {verdict.row: verdict.kind for verdict in found.verdicts}
    principles = Principles(
        mu=mu,
        integrable=tuple(n for n in names if kinds.get(n) in ("exact", "integrable", "jointly-integrable")),
        nonholonomic=tuple(n for n in names if kinds.get(n) == "nonholonomic"),
        undecided=tuple(n for n in names if kinds.get(n, "undecided") == "undecided"),
        tolerance=0.0,
        left_out=left_out,
    )
    return OtherPrinciple(vakonomic, principles, tuple(_notes(names, start.mu, values, left_out)))


def _notes(names: Sequence[str], mu: Floats, given: Floats, left_out: Sequence[str]) -> Iterator[str]:
    """Notes on initial multipliers that were shared out, and on outputs without a value."""
    moved = [f"{name} {value:.6g}" for name, value, old in zip(names, mu, given, strict=True) if value != old]
    if moved:
        yield (
            "differential rows follow from others, and their initial mu is carried by those: mu begins as "
            + ", ".join(moved)
        )
    if left_out:
        yield (
            f"without a value in vakonomic motion, for they read multipliers of differential rows or whole reactions:"
            f" {', '.join(left_out)}"
        )


def _too_large(model: Model, where: diagnostics.Location) -> diagnostics.ModelError:
    message = "the vakonomic equations are too large: the rows are too many to be solved for mu' in written-out form"
    return diagnostics.ModelError(
        [diagnostics.Diagnostic("too-large-to-build", message, where, "model fewer members")]
    )
