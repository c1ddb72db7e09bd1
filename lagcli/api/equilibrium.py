"""`lagcli.equilibrium`: the points of rest of a model."""

from __future__ import annotations

from lagcli import progress
from lagcli.api import rest_point, static_points
from lagcli.api.models import cache
from lagcli.api.models.load import Path, as_model
from lagcli.api.static_points import SEED, STARTS, StaticQuestion
from lagcli.model.model import Model
from lagcli.statics import static_laws
from lagcli.statics.static_report import StaticReport


@progress.phase("looking for points of rest")
def equilibrium(
    model: Model | Path, *, starts: int = STARTS, seed: int = SEED, limit: float | None = None
) -> StaticReport:
    """Return the points of rest (D.25): q' = q'' = 0 satisfies the equations of motion at every t.

    With multipliers, constraint forces, the effective potential and the type by the bordered Hessian; contacts push.
    From the declared start and from `starts` others, the same for one `seed`; `limit` is the seconds to find the first
    integrals of differential rows, whose leaf through the start is fixed. Raises `ModelError`, `ValueError`.
    """
    static_points.require(starts, seed)
    model = as_model(model)
    ready = cache.compiled(model)
    start = rest_point.begin(ready, limit)
    laws = static_laws.of_rest(ready.system, start.invariant_values)
    problem = rest_point.problem(ready, laws, start)
    rows = tuple(range(len(ready.system.rows.rows)))
    return static_points.answered(ready, StaticQuestion("potential", problem, start, rows, ()), starts, seed)
