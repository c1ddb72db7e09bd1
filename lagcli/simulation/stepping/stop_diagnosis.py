"""The sentence and the code for a run that cannot go on, from what the numbers were."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.linear.metric_rows import LocalRows
from lagcli.simulation.run_state.run_stop import (
    CONTACT,
    NO_SOLUTION,
    NOT_FINITE,
    SINGULAR,
    TOO_SMALL,
    Reason,
    StepFailure,
)
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.singularity import singular_point
from lagcli.simulation.stepping import stop_reasons
from lagcli.simulation.stepping.step_trial import MOST_RESIDUAL
from lagcli.start import initial

Floats = npt.NDArray[np.float64]

# A singular configuration is the reason of a stop where one is predicted within this part of the run.
SOON = 1e-4


class StopParameters:
    """Bounds of what is reported as the reason of a stop; parts are of no unit.

    The tests are of `tests/unit/test_numbers_of_stops.py`.
    """

    __slots__ = ()

    dependent: float = 1e-2
    """Rows that are this close to dependent ones where a run stops are the reason.
    `test_rows_that_are_dependent_to_a_hundredth_are_the_reason_of_a_stop` fails at 1e-3 and 0.1."""
    behind: float = 1e-2
    """An incident within this part of the run before is reported: a step across must begin some way off.
    `test_an_incident_within_a_hundredth_of_the_run_before_is_reported` fails at 1e-3 and 0.1."""
    weighed: float = 1e-4
    """Rows that are independent in themselves, but this close to dependent ones in the mass metric, amplify rounding so
    much that a step may not reach its tolerance: masses differ by 1e8.
    `test_inertias_that_differ_are_the_reason_of_a_stop_from_four_digits_on` fails at 1e-5 and 1e-3."""
    order: float = 0.25
    """At three times the distance from a pole of this order rates are 3^-order of what they are. Weaker ones change
    velocities by nothing that counts in a few roundings of the time.
    `test_a_pole_is_of_the_order_of_a_quarter_at_least` fails at 0.025 and 2.5."""


PARAMETERS = StopParameters()

BELOW_ROUNDING = Reason("the step needed for the tolerance is below the rounding of the time", TOO_SMALL)
START_NOT_FINITE = Reason("the accelerations are not finite at the start", NOT_FINITE)
POLE = Reason("the accelerations grow beyond all bounds there: a function of t has a pole", NOT_FINITE)
NO_BRANCH = Reason(
    "the start is a singular configuration, and no smooth motion along one of the branches that meet there has the"
    " initial velocities",
    SINGULAR,
)


@frozen
class Rejection:
    """The last step that was tried, with the functions of its run.

    error: its error; residual: that of the constraints at its end, as a part of its size; here, ahead: the states at
    both ends; rank_margin, is_alone: of `SingularityMonitor`; is_soon: an instant is predicted within `SOON` of
    the run; last: the time of the last incident, or of the start.
    """

    enforced: EnforcedInvariants
    error: float
    residual: float
    here: initial.State
    ahead: initial.State
    rank_margin: float
    is_alone: bool
    is_soon: bool
    last: float

    @property
    def system(self) -> System:
        """The equations."""
        return self.enforced.system

    @property
    def numeric(self) -> NumericSystem:
        """Their functions."""
        return self.enforced.functions.numeric

    @property
    def are_dependent(self) -> bool:
        """True if rows are close to dependent ones."""
        return self.rank_margin < PARAMETERS.dependent

    @cached_property
    def apart(self) -> float | None:
        """By how much inertias differ, where it is these that bring the rows close; else None."""
        is_asked = self.are_dependent and not self.is_alone
        return singular_point.apart(self.numeric, self.here) if is_asked else None

    @property
    def verdict(self) -> Reason:
        """What its own numbers say."""
        if not math.isfinite(self.error) or not math.isfinite(self.residual):
            return Reason(
                "the accelerations or multipliers are not finite there: the constraints become dependent,"
                " or a function of the model has a pole",
                NOT_FINITE,
            )
        if not self.residual > MOST_RESIDUAL:
            return BELOW_ROUNDING
        if parting := singular_point.departed(self.numeric, self.ahead, MOST_RESIDUAL):
            rows = named(self.system, parting)
            return Reason(f"the rows {rows} contradict each other beyond: they agree up to here", NO_SOLUTION)
        return Reason("the constraints have no solution after this time", NO_SOLUTION)


def hopeless(
    enforced: EnforcedInvariants, here: initial.State, steps: int, advanced: float, left: float
) -> StepFailure:
    """The failure where the last steps advanced by so little that the run would not end in any time one can wait."""
    return StepFailure(
        jump(enforced, here)
        or f"the last {steps} steps advanced by {advanced:.2g}, so that the run would need"
        f" {left / max(advanced, 1e-300) * steps:.0e} more: the motion chatters across"
        " a jump of the forces, the forces are far too stiff for an explicit scheme, or the run is too long",
        TOO_SMALL,
    )


def impact(enforced: EnforcedInvariants, here: initial.State, beyond: initial.State) -> StepFailure:
    """The failure where the motion does not go on beyond a switch, where velocities would have to jump."""
    why = jump(enforced, here)
    if not why:
        if wall := _wall(enforced, here, beyond):
            return StepFailure(f"the wall of the closed contact `{wall}` jumps there", CONTACT)
        rows = _violated(enforced.functions.numeric, beyond)
        listed = named(enforced.system, rows)
        why = f"the rows {listed} make velocities jump there: an impact, which the equations of motion do not describe"
    return StepFailure(why, NO_SOLUTION)


def _violated(numeric: NumericSystem, state: initial.State) -> tuple[int, ...]:
    """The rows that a state violates most: B v + b = 0, as a part of the largest there."""
    B, b = numeric.rows(state.t, state.q, state.v, state.p)
    rows = LocalRows(B)
    off = np.abs(rows.times(state.v) + np.array(b).ravel()) / rows.divisors
    return tuple(np.flatnonzero(off > 0.5 * off.max(initial=0.0)).tolist())


def _wall(enforced: EnforcedInvariants, here: initial.State, beyond: initial.State) -> str:
    """The closed contact whose gap changes most between two times at one configuration; none where nothing changes."""
    numeric, system = enforced.functions.numeric, enforced.system
    closed = [i - len(system.rows.rows) for i in numeric.closed_rows]
    if not closed:
        return ""
    y, p = np.concatenate([here.q, here.v, [0.0]]), enforced.parameters[: numeric.gaps.size1_in(2)]
    sides = [np.array(numeric.gaps(t, y, p)).ravel()[closed] for t in (here.t, beyond.t)]
    change = np.abs(sides[1] - sides[0])
    worst = int(np.argmax(change))
    return system.contacts.rows[closed[worst]].name if change[worst] > 0 else ""


def is_pole(rates: Sequence[Floats], acceleration: float) -> bool:
    """True if y' (2n + 1,) grows without bound towards a time, from its values nearby, three times, and nine times as
    far away; acceleration: that of `of_forces`, whose rounding is all that is left where rows hold all still."""
    n = rates[0].size // 2
    near, *_ = sizes = [float(np.abs(k[n : 2 * n]).max(initial=0.0)) for k in rates]
    is_noise = near <= initial.PARAMETERS.roundings * np.finfo(float).eps * acceleration
    order = PARAMETERS.order
    return not is_noise and all(0.0 < b <= 3.0**-order * a for a, b in itertools.pairwise(sizes))


def of_forces(numeric: NumericSystem, state: initial.State) -> float:
    """The largest acceleration of a coordinate that forces alone make."""
    sizes = np.array(numeric.sizes(state.t, state.q, state.v, state.p)).ravel()
    return float(sizes[: state.q.size].max(initial=0.0) * sizes[-1])


def impulse(reported: str) -> StepFailure:
    """The failure where an energy or a position jumps; reported: what does."""
    return StepFailure(
        f"{reported}: the force is an impulse, which the equations of motion do not describe", NO_SOLUTION
    )


def row_not_finite(columns: tuple[str, ...], column: int, t: float) -> StepFailure:
    """The failure where a row cannot be written; column: the number of what has no value, of energies beyond the
    columns."""
    what = f"the column `{columns[column]}`" if column < len(columns) else "the energy balance"
    return StepFailure(f"{what} is not finite at t = {t:.9g}", NOT_FINITE)


def jump(enforced: EnforcedInvariants, here: initial.State) -> str:
    """See `stop_reasons.reason`, for the rows without contacts."""
    system, numeric = enforced.system, enforced.plain.functions.numeric
    open_ = numeric.selection.opened(len(system.rows.rows))
    return stop_reasons.reason(
        system, numeric if numeric.selection == open_ else numeric.keeping(open_), here
    )


def named(system: System, rows: tuple[int, ...]) -> str:
    """The names of the first of some rows."""
    names = [row.name for row in system.multiplier_rows]
    return ", ".join(f"`{names[i]}`" for i in rows[: initial.PARAMETERS.most_listed])
