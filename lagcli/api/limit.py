"""`lagcli.limit`: one holonomic row as a stiff spring, and how its force tends to the multiplier."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from lagcli import progress
from lagcli.api.models.load import Path, as_model
from lagcli.api.runs import run_settings
from lagcli.model.model import Model

if TYPE_CHECKING:
    from lagcli.formulations.stiff_ladder import StiffLimit

STIFFNESS = "1e3:1e5"


@progress.phase("following the stiff limit")
def limit(
    model: Model | Path,
    constraint: str,
    *,
    stiffness: str | Sequence[float] = STIFFNESS,
    unprestressed: bool = False,
    ramp: float | None = None,
    duration: float | None = None,
    samples: int | None = None,
    output_step: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    assemble: bool | None = None,
    told: Callable[[str], None] | None = None,
) -> StiffLimit:
    """Replace a holonomic row f = 0 by the potential k f^2/2 for growing k, and set -k f against its lambda.

    constraint: the name of the row, of a member of a family, or of a row of a rigid body (`body.1`). `stiffness`:
    LOW:HIGH, two runs a decade, or the stiffnesses, in units of lambda over those of f. Runs start on the slow motion,
    f = -lambda/k, df/dt = -lambda'/k, or `unprestressed` on f = 0; `ramp` is the seconds in which k rises over all of
    them in one run. The other options are as of `simulate`; `told` is called with a sentence before the stiffest run.
    Raises `ModelError` where the row is not holonomic, redundant, or has no spring, and `ValueError` for a name there
    is not and for bad options.
    """
    # Other commands make no limit.
    from lagcli.api.stiff import stiff_runs
    from lagcli.api.stiff.constrained_run import LimitPlan
    from lagcli.formulations import stiff_ladder

    model = as_model(model)
    changes = {
        "duration": duration if ramp is None else ramp, "samples": samples, "output_step": output_step,
        "rtol": rtol, "atol": atol, "max_step": max_step, "assemble": assemble,
    }  # fmt: skip
    if ramp is not None and duration is not None:
        raise ValueError("ramp: its seconds are the duration of the run; give one of them")
    if ramp is not None and not ramp > 0:
        raise ValueError("ramp: a positive number of seconds is needed")
    chosen = run_settings.chosen(model, changes)
    if not chosen.duration > 0:
        raise ValueError("duration: a stiff run needs some time")
    rungs = stiff_ladder.rungs(stiffness)
    if ramp is not None and len(rungs) < 2:
        raise ValueError("ramp: a range of stiffnesses is needed, LOW:HIGH")
    plan = LimitPlan(constraint, rungs, unprestressed, ramp is not None, told or (lambda sentence: None))
    return stiff_runs.limit(model, chosen, plan)
