"""`lagcli.stationary`: stationary points of a function on the holonomic surfaces of a model."""

from __future__ import annotations

from lagcli import progress
from lagcli.api import rest_point, static_points
from lagcli.api.models import cache
from lagcli.api.models.load import Path, as_model
from lagcli.api.static_points import SEED, STARTS, StaticQuestion
from lagcli.equations import level_functions
from lagcli.input import given_expression
from lagcli.model.model import Model
from lagcli.statics import static_laws
from lagcli.statics.static_report import StaticReport


@progress.phase("looking for stationary points")
def stationary(
    model: Model | Path, of: str, *, starts: int = STARTS, seed: int = SEED, limit: float | None = None
) -> StaticReport:
    """Return the stationary points of `of`, an expression of positions and coordinates: grad f = sum lambda_i grad f_i
    (D.25).

    Masses and forces play no part; integrable differential rows count as their leaf through the start, nonholonomic
    ones are left out; closed inequalities push or pull. Other arguments as of `equilibrium`. Raises `ModelError`, for
    what is wrong with `of` too, and `ValueError`.
    """
    static_points.require(starts, seed)
    model = as_model(model)
    written = given_expression.function(model, of, "--of")
    ready = cache.compiled(model)
    start = rest_point.begin(ready, limit)
    laws = static_laws.of_function(
        ready.system, level_functions.value(ready.system, written), start.invariant_values
    )
    problem = rest_point.problem(ready, laws, start)
    system = ready.system
    names = [row.name for row in system.rows.rows]
    left_out = [name for name in names[system.holonomic_count :] if name not in start.enforced]
    rows = tuple(i for i, name in enumerate(names) if name not in left_out)
    notes: tuple[str, ...] = ()
    if left_out:
        listed = ", ".join(f"`{name}`" for name in left_out)
        notes = (f"{listed} cannot be integrated and {'are' if len(left_out) > 1 else 'is'} left out",)
    return static_points.answered(ready, StaticQuestion("value", problem, start, rows, notes), starts, seed)
