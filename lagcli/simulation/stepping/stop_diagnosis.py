"""The sentence and the code for a run that cannot go on, from what the numbers were."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear.metric_rows import LocalRows
from lagcli.simulation.run_state.run_stop import (
    CONTACT,
    NO_SOLUTION,
    NOT_FINITE,
    SINGULAR,
    TOO_SMALL,
    StepFailure,
)
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.singularity import singular_point
from lagcli.simulation.stepping import stop_reasons
from lagcli.smoothness import named_functions
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

BELOW_ROUNDING = "the step needed for the tolerance is below the rounding of the time"
START_NOT_FINITE = "the accelerations are not finite at the start"
POLE = "the accelerations grow beyond all bounds there: a function of t has a pole"
NO_BRANCH = (
    "the start is a singular configuration, and no smooth motion along one of the branches that meet there has the"
    " initial velocities"
)


class Rejection(NamedTuple):
    """The last step that was tried: its error, the residual of the constraints at its end, as a part of its size, and
    the states at both ends; rank_margin, is_alone: of `SingularityMonitor`; is_soon: an instant is predicted within
    `SOON` of the run; last: the time of the last incident, or of the start."""

    error: float
    residual: float
    here: initial.State
    ahead: initial.State
    rank_margin: float
    is_alone: bool
    is_soon: bool
    last: float


def no_step(enforced: EnforcedInvariants, tried: Rejection, most_residual: float) -> StepFailure:
    """The failure where no step can be taken; residual: that of a step that was projected."""
    system, numeric, here = enforced.system, enforced.functions.numeric, tried.here
    is_near, is_alone = tried.rank_margin < PARAMETERS.dependent, tried.is_alone
    apart = singular_point.apart(numeric, here) if is_near and not is_alone else None
    run, last = system.model.simulation, tried.last
    # So close behind an incident no instant may be predicted.
    is_behind = run.start < last and here.t - last < PARAMETERS.behind * run.duration
    if is_near and (tried.is_soon or is_behind) and apart is None:
        reported = _named(system, singular_point.closest(numeric, here, is_alone))
        what = f"the gradient of {reported} vanishes" if is_alone else f"the rows {reported} become dependent"
        behind = f", or one too close behind the incident at t = {last:.9g}" if is_behind else ""
        return StepFailure(
            f"{what} there, a singular configuration through which this motion does not go on smoothly (a toggle"
            f" position, or a cusp{behind})",
            SINGULAR,
        )
    jump = _jump(enforced, here)
    if jump:
        return StepFailure(jump, NO_SOLUTION)
    # Loaded here, with all that decides contacts: few runs stop.
    from lagcli.simulation.closed_contacts import contact_gradient

    kinked, span = named_functions.switching_contacts(system.model), stop_reasons.time_scale(system, here)
    if edges := contact_gradient.edges(numeric, here, kinked, span):
        return StepFailure(
            f"the gradient of the closed contact {_named(system, edges)} jumps there, and so would the velocity: where"
            " a contact slides over an edge or into a corner, one condition has no single direction of the push (make"
            " the edge round, as `sqrt(x**2 + w**2)` in place of `abs(x)`)",
            CONTACT,
        )
    if apart is not None and tried.rank_margin < PARAMETERS.weighed:
        reported = f"inertias that differ by a factor of {apart:.0e} amplify rounding"
        return StepFailure(f"{BELOW_ROUNDING}: {reported}", TOO_SMALL)
    if not math.isfinite(tried.error) or not math.isfinite(tried.residual):
        return StepFailure(
            "the accelerations or multipliers are not finite there: the constraints become dependent,"
            " or a function of the model has a pole",
            NOT_FINITE,
        )
    if tried.residual > most_residual:
        parting = singular_point.departed(numeric, tried.ahead, most_residual)
        if parting:
            reported = _named(system, parting)
            return StepFailure(
                f"the rows {reported} contradict each other beyond: they agree up to here", NO_SOLUTION
            )
        return StepFailure("the constraints have no solution after this time", NO_SOLUTION)
    return StepFailure(BELOW_ROUNDING, TOO_SMALL)


def hopeless(
    enforced: EnforcedInvariants, here: initial.State, steps: int, advanced: float, left: float
) -> StepFailure:
    """The failure where the last steps advanced by so little that the run would not end in any time one can wait."""
    jump = _jump(enforced, here)
    return StepFailure(
        jump
        or f"the last {steps} steps advanced by {advanced:.2g}, so that the run would need"
        f" {left / max(advanced, 1e-300) * steps:.0e} more: the motion chatters across"
        " a jump of the forces, the forces are far too stiff for an explicit scheme, or the run is too long",
        TOO_SMALL,
    )


def impact(enforced: EnforcedInvariants, here: initial.State, beyond: initial.State) -> StepFailure:
    """The failure where the motion does not go on beyond a switch, where velocities would have to jump."""
    jump = _jump(enforced, here)
    if not jump:
        if wall := _wall(enforced, here, beyond):
            return StepFailure(f"the wall of the closed contact `{wall}` jumps there", CONTACT)
        rows = _violated(enforced.functions.numeric, beyond)
        named = _named(enforced.system, rows)
        jump = f"the rows {named} make velocities jump there: an impact, which the equations of motion do not describe"
    return StepFailure(jump, NO_SOLUTION)


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


def _jump(enforced: EnforcedInvariants, here: initial.State) -> str:
    system, numeric = enforced.system, enforced.plain.functions.numeric
    open_ = numeric.selection.opened(len(system.rows.rows))
    return stop_reasons.reason(
        system, numeric if numeric.selection == open_ else numeric.keeping(open_), here
    )


def _named(system: System, rows: tuple[int, ...]) -> str:
    names = [row.name for row in system.multiplier_rows]
    return ", ".join(f"`{names[i]}`" for i in rows[: initial.PARAMETERS.most_listed])
