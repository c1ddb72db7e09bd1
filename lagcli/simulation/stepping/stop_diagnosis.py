"""The sentence and the code for a run that cannot go on, from what the numbers were."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.compiled.force_switches import ForceSwitches
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.linear.metric_rows import LocalRows
from lagcli.simulation.run_state.run_stop import (
    CONTACT,
    NO_SOLUTION,
    NOT_FINITE,
    SINGULAR,
    STICKS,
    TOO_SMALL,
    Reason,
    StepFailure,
)
from lagcli.simulation.scheme import step_end
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.scheme.step_tolerance import UNIT
from lagcli.simulation.singularity import singularity_step
from lagcli.simulation.stepping.step_trial import MOST_RESIDUAL
from lagcli.smoothness import named_functions
from lagcli.smoothness.sides import PARAMETERS as SIDE_LIMITS
from lagcli.smoothness.sides import Sides
from lagcli.start import initial
from lagcli.start.initial import State

# A singular configuration, or a pole, is the reason of a stop where one is predicted within this part of the run.
SOON = 1e-4


class StopParameters:
    """Bounds of what is reported as the reason of a stop; distances along the motion are parts of the size of the
    configuration. The tests are of `tests/unit/test_numbers_of_stops.py` and `tests/unit/test_numbers_of_steps.py`."""

    __slots__ = ()

    behind: float = 1e-2
    """Within this part of the run: a step across begins some way off. `test_an_incident_just_before_is_reported`."""
    weighed: float = 1e-4
    """Rows so close in the mass metric alone amplify rounding: masses differ by 1e8.
    `test_inertias_that_differ_stop_a_run`."""
    order: float = 0.25
    """At three times the distance from a pole of this order rates are 3^-order of what they are; weaker ones do not
    count in a few roundings of the time. `test_a_pole_is_of_the_order_of_a_quarter_at_least`."""
    near: float = 1e-8
    """How close the sides of a point are looked at. `test_a_jump_is_seen_within_rounding_of_the_point`."""
    far: float = 1e-5
    """And from farther off, where steps have become too short.
    `test_the_end_of_a_function_is_seen_from_farther_off`."""
    reaches: tuple[float, ...] = (1.0, 1e2, 1e3, 1e4)
    """So many times these distances, in turn. `test_the_end_of_a_row_is_looked_for_a_tenth_ahead`."""
    part_of_run: float = 1e-3
    """A configuration is as large as the way of this part of the run.
    `test_a_jump_is_seen_within_rounding_of_the_point`."""


PARAMETERS = StopParameters()
# `atan2` jumps by 2 pi at its cut, and by less where both of its arguments go through zero.
AT_CUT = 1.5 * np.pi
THROUGH_ZERO = "both arguments of `atan2` go through zero"


def reason(system: System, numeric: NumericSystem, state: State) -> str:
    """The reason why rows do not lead on from a state along its velocity, as a sentence; empty where none of them jumps
    there."""
    if not system.rows.rows:
        return ""
    scale, last, seen = time_scale(system, state), PARAMETERS.reaches[-1], []
    for reach in PARAMETERS.reaches:
        states = _along(state, reach, scale)
        values = tuple(_rows(numeric, x) for x in states)
        seen.append((reach < last, states, Sides(values, _rounding(numeric, states[1]))))
    # A jump of a value first: close to it cancellation spoils the gradient too.
    count = system.holonomic_count
    looks = [(states, "jumps", sides.jumps()[:count]) for is_close, states, sides in seen if is_close]
    for is_close, states, sides in seen:
        looks.append((states, "ends", sides.ends()))
        if is_close:
            looks += [(states, "jumps", sides.jumps()), (states, "grows", sides.grows())]
    for states, kind, found in looks:
        hit = np.flatnonzero(found)
        if not hit.size:
            continue
        part, row = divmod(int(hit[0]), len(system.rows.rows))
        name, is_holonomic, call = system.rows.rows[row].name, row < count, _call(system, row, states)
        why = f" ({call})" if call else ""
        if kind == "ends":
            return f"the row `{name}` is not defined beyond{why}: its surface, or its gradient, ends there"
        if kind == "grows":
            return f"the gradient of the row `{name}` grows beyond all bounds there{why}"
        if part == 0 and is_holonomic:
            return f"the row `{name}` jumps there{why}"
        what = "gradient of the row" if is_holonomic else "row"
        return f"the {what} `{name}` jumps there{why}, and the velocity would have to jump"
    return ""


def time_scale(system: System, state: State) -> float:
    """The time the run has gone on, or should, where it has not begun: a duration that is asked for is no scale."""
    settings = system.model.simulation
    gone = abs(state.t - settings.start)
    return min(gone, settings.duration) or settings.duration


def _along(state: State, reach: float, duration: float) -> tuple[State, ...]:
    """States on both sides of a state, along its velocity."""
    speed = float(np.abs(state.v).max(initial=0.0))
    size = max(float(np.abs(state.q).max(initial=0.0)), PARAMETERS.part_of_run * speed * duration)
    unit = reach * (size / speed if speed else 1.0)
    steps = [part * unit for part in (-PARAMETERS.far, -PARAMETERS.near, PARAMETERS.near, PARAMETERS.far)]
    return tuple(dataclasses.replace(state, t=state.t + h, q=state.q + h * state.v) for h in steps)


def _rows(numeric: NumericSystem, state: State) -> Floats:
    """f (C,), zero of differential rows, then B u of two directions u, and b: (4 C,)."""
    B, b = numeric.rows(state.t, state.q, np.zeros_like(state.v), state.p)
    f, rows = np.array(numeric.holonomic(state.t, state.q, state.p)[0]).ravel(), LocalRows(B)
    random = np.random.default_rng(0)
    ways = [rows.times(random.standard_normal(state.q.size)) for _ in range(2)]
    return np.concatenate([f, np.zeros(rows.count - f.size), *ways, np.array(b).ravel()])


def _rounding(numeric: NumericSystem, state: State) -> Floats:
    """The values that rounding may leave of f, and zero for the gradients, (4 C,)."""
    norms = LocalRows(numeric.rows(state.t, state.q, np.zeros_like(state.v), state.p)[0]).norms
    s, size = numeric.holonomic.size1_out(0), float(np.abs(state.q).max(initial=0.0))
    floor = np.zeros((4, norms.size))
    floor[0, :s] = doubles.ZERO * np.nan_to_num(norms[:s], posinf=0.0) * size
    return floor.ravel()


def _call(system: System, row: int, states: tuple[State, ...]) -> str:
    """Name the innermost function of a row whose value or slope jumps, ends or grows between the states, or nothing."""
    from lagcli.equations import operation_rules
    from lagcli.smoothness import switches

    names, function = operation_rules.edge_calls(system, row)
    if not names:
        return ""
    values = tuple(np.array(function(x.t, x.q, x.v, x.p)).ravel() for x in states)
    seen = Sides(values)
    hit = (seen.jumps() | seen.ends() | seen.grows()).reshape(2, -1).any(axis=0)
    if not hit.any():
        return ""
    call = int(np.argmax(hit))
    if names[call] == "atan2" and abs(values[2][call] - values[1][call]) < AT_CUT:
        return THROUGH_ZERO
    word = names[call]
    return switches.PHRASES.get(word, word if word == switches.QUOTIENT else f"`{word}`")


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
    """The last step that was tried, with the functions of its run. error: its error; residual: that of the constraints
    at its end, as a part of its size; here, ahead: the states at both ends; rank_margin, is_alone: of
    `SingularityMonitor`; is_soon: an instant is predicted within a small part of the run; last: the time of the last
    incident, or of the start."""

    enforced: EnforcedInvariants
    error: float
    residual: float
    here: State
    ahead: State
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
        return self.rank_margin < step_end.PARAMETERS.close

    @cached_property
    def apart(self) -> float | None:
        """By how much inertias differ, where it is these that bring the rows close; else None."""
        is_asked = self.are_dependent and not self.is_alone
        return singularity_step.apart(self.numeric, self.here) if is_asked else None

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
        if parting := singularity_step.departed(self.numeric, self.ahead, MOST_RESIDUAL):
            rows = named(self.system, parting)
            return Reason(f"the rows {rows} contradict each other beyond: they agree up to here", NO_SOLUTION)
        return Reason("the constraints have no solution after this time", NO_SOLUTION)


def hopeless(
    enforced: EnforcedInvariants, here: State, steps: int, advanced: float, left: float
) -> StepFailure:
    """The failure where the last steps advanced by so little that the run would not end in any time one can wait."""
    return StepFailure(
        jump(enforced, here)
        or f"the last {steps} steps advanced by {advanced:.2g}, so that the run would need"
        f" {left / max(advanced, 1e-300) * steps:.0e} more: the motion chatters across"
        " a jump of the forces, the forces are far too stiff for an explicit scheme, or the run is too long",
        TOO_SMALL,
    )


def impact(enforced: EnforcedInvariants, here: State, beyond: State) -> StepFailure:
    """The failure where the motion does not go on beyond a switch, where velocities would have to jump."""
    if why := jump(enforced, here):
        return StepFailure(why, NO_SOLUTION)
    numeric, system = enforced.functions.numeric, enforced.system
    closed = [i - len(system.rows.rows) for i in numeric.closed_rows]
    if closed:
        # The closed contact whose gap changes most between two times at one configuration.
        y, p = np.concatenate([here.q, here.v, [0.0]]), enforced.parameters[: numeric.gaps.size1_in(2)]
        sides = [np.array(numeric.gaps(t, y, p)).ravel()[closed] for t in (here.t, beyond.t)]
        change = np.abs(sides[1] - sides[0])
        worst = int(np.argmax(change))
        if change[worst] > 0:
            name = system.contacts.rows[closed[worst]].name
            return StepFailure(f"the wall of the closed contact `{name}` jumps there", CONTACT)
    # The rows that the state beyond violates most: B v + b = 0, as a part of the largest there.
    B, b = numeric.rows(beyond.t, beyond.q, beyond.v, beyond.p)
    rows = LocalRows(B)
    off = np.abs(rows.times(beyond.v) + np.array(b).ravel()) / rows.divisors
    listed = named(system, tuple(np.flatnonzero(off > 0.5 * off.max(initial=0.0)).tolist()))
    return StepFailure(
        f"the rows {listed} make velocities jump there: an impact, which the equations of motion do not describe",
        NO_SOLUTION,
    )


def is_pole(rates: Sequence[Floats], acceleration: float) -> bool:
    """True if y' (2n + 1,) grows without bound towards a time, from its values nearby, three times, and nine times as
    far away; acceleration: that of `of_forces`, whose rounding is all that is left where rows hold all still."""
    n = rates[0].size // 2
    near, *_ = sizes = [float(np.abs(k[n : 2 * n]).max(initial=0.0)) for k in rates]
    is_noise = near <= doubles.SUM * acceleration
    order = PARAMETERS.order
    return not is_noise and all(0.0 < b <= 3.0**-order * a for a, b in itertools.pairwise(sizes))


def of_forces(numeric: NumericSystem, state: State) -> float:
    """The largest acceleration of a coordinate that forces alone make."""
    sizes = np.array(numeric.sizes(state.t, state.q, state.v, state.p)).ravel()
    return float(sizes[: state.q.size].max(initial=0.0) * sizes[-1])


def jump(enforced: EnforcedInvariants, here: State) -> str:
    """See `reason`, for the rows without contacts."""
    system, numeric = enforced.system, enforced.plain.functions.numeric
    open_ = numeric.selection.opened(len(system.rows.rows))
    return reason(system, numeric if numeric.selection == open_ else numeric.keeping(open_), here)


def named(system: System, rows: tuple[int, ...]) -> str:
    """The names of the first of some rows."""
    names = [row.name for row in system.multiplier_rows]
    return ", ".join(f"`{names[i]}`" for i in rows[: initial.PARAMETERS.most_listed])


# Where the sides of a switch are looked at: so far from it, as parts of the way of the state to it.
NEAR = 0.25
OFFSETS = np.array([-1, -NEAR, NEAR, 1])


def require_not_stuck(bound: BoundStep, switches: ForceSwitches, t: float) -> None:
    """Raise `StepFailure` where the motion sticks at a switch of a force that it meets within a step from a time: both
    sides push it there, as dry friction does at rest (Filippov, Differential equations with discontinuous righthand
    sides, section 4)."""
    h, (y, k), n = float(bound.h[0]), (bound.y, bound.k), bound.numeric.n
    u, slope = _rates(bound, switches, t, y, k)
    for switch in np.flatnonzero((u * slope <= 0.0) & (np.abs(u) <= h * np.abs(slope))).tolist():
        begin = t, y, k
        if not u[switch]:
            # Of a motion that begins on a switch the sides are looked at from beside it.
            at, beside = t + h, y + h * k
            begin = at, beside, np.array(bound.numeric.rhs(at, beside, bound.p)).ravel()
        found = _sides(bound, switches, begin, switch)
        if found is None:
            continue
        states, slopes = found
        # The motion is led to the switch on both of its sides, by a jump of its rate.
        if not (slopes[1] < 0.0 < slopes[2] and Sides(tuple(slopes[:, None])).jumps()[0]):
            continue
        # The forces that jump between the sides.
        p = bound.p[: switches.forces.size1_in(3)]
        at_sides = [switches.forces(at, state[:n], state[n : 2 * n], p) for at, state in states]
        rounding = UNIT * np.max([np.array(units).ravel() for _, units in at_sides], axis=0)
        values = tuple(np.array(Q).ravel() for Q, _ in at_sides)
        jumps = Sides(values, 2 * rounding).jumps().reshape(len(switches.names), n).any(axis=1)
        forces = list(dict.fromkeys(switches.names[i] for i in np.flatnonzero(jumps)))
        if not forces:
            continue
        (_, before), (_, after) = states[1:3]
        middle, change = (before + after) / 2, np.abs(after - before)
        middle = np.where(np.abs(middle) <= change.max(), 0.0, middle)
        # The names of the entries of v.
        model = bound.enforced.system.model
        names, generalized = model.coordinate_names, model.generalized_names
        rates = [f"rate({n})" if n in generalized else f"{n[:-1]}v{n[-1]}" for n in names]
        listed = switches.coordinates[switch][: initial.PARAMETERS.most_listed]
        where = ", ".join(f"{names[i]} = {middle[i]:.6g}, {rates[i]} = {middle[n + i]:.6g}" for i in listed)
        raise StepFailure(_stuck(forces, where, "v"), STICKS)


def _rates(
    bound: BoundStep, switches: ForceSwitches, t: float, y: Floats, k: Floats
) -> tuple[Floats, Floats]:
    u, slope = switches.rates(t, y, k, bound.p[: switches.rates.size1_in(3)])
    return np.array(u).ravel(), np.array(slope).ravel()


def _sides(
    bound: BoundStep, switches: ForceSwitches, begin: tuple[float, Floats, Floats], switch: int
) -> tuple[list[tuple[float, Floats]], Floats] | None:
    """The states at the `OFFSETS` from a switch on the straight way from t, y, y', and d|u|/dt (4,) there, behind it
    with the other sign: of a smooth u these are the same. None where the sides cannot be told from each other."""
    t, y, k = begin
    u, slope = (float(x[switch]) for x in _rates(bound, switches, t, y, k))
    if not u * slope < 0.0:
        return None
    way = -u / slope
    for reach in (1.0, *PARAMETERS.reaches[1:]):
        ways = [way + reach * way * offset for offset in OFFSETS]
        states = [(t + each, y + each * k) for each in ways]
        rates = [np.array(bound.numeric.rhs(*state, bound.p)).ravel() for state in states]
        found = [_rates(bound, switches, *state, rate) for state, rate in zip(states, rates, strict=True)]
        values = np.array([(u[switch], slope[switch]) for u, slope in found])
        sizes = np.abs(values[:, 0])
        expected = reach * abs(u) * np.abs(OFFSETS)
        if (np.abs(sizes - expected) <= SIDE_LIMITS.stays * expected).all():
            return states, np.sign(values[:, 0]) * values[:, 1] * np.sign(-OFFSETS)
    return None


def at_rest(system: System, y: Floats) -> str:
    """The reason to stop at a state (2n + 1,), at rest on a switch of a force in the position, to which both of its
    sides lead."""
    names = system.model.coordinate_names[: initial.PARAMETERS.most_listed]
    where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(names, y.tolist(), strict=False))
    return _stuck(list(named_functions.switching_forces(system.model)), where, "x")


def _stuck(forces: list[str], where: str, variable: str) -> str:
    named = " and ".join(f"`{name}`" for name in forces[: initial.PARAMETERS.most_listed])
    verb = "switch" if len(forces) > 1 else "switches"
    return (
        f"{'the forces' if len(forces) > 1 else 'the force'} {named} {verb} at {where}, and both sides push the motion"
        " onto the switch: it sticks there, as with dry friction, which a run does not follow (write a smooth law, as"
        f" `tanh({variable}/1e-3)` in place of `sign({variable})`)"
    )
