"""The step that was found, taken again to end where something happens in it."""

from __future__ import annotations

from lagcli.simulation.stepping.stepper import Stepper


def up_to(run: Stepper, reached: float) -> None:
    """Take the step that was found again, up to a time within it."""
    found, bound = run.found, run.bound
    found.reached, found.taken, found.has_dense, found.work = reached, reached - run.t, False, None
    bound.h[0] = found.taken
    bound.staged.trigger()
    run.account.evaluations += run.method.evaluations
