"""Tell if a motion sticks at a switch of a force: both sides push it there, as dry friction does at rest (Filippov,
Differential equations with discontinuous righthand sides, section 4)."""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled.force_switches import ForceSwitches
from lagcli.equations.system import System
from lagcli.simulation.run_state.run_stop import STICKS, StepFailure
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.scheme.step_tolerance import UNIT
from lagcli.simulation.stepping import stop_diagnosis
from lagcli.smoothness import named_functions
from lagcli.smoothness.sides import PARAMETERS as SIDE_LIMITS
from lagcli.smoothness.sides import Sides
from lagcli.start import initial

# Where the sides of a switch are looked at: so far from it, as parts of the way of the state to it.
NEAR = 0.25
OFFSETS = np.array([-1, -NEAR, NEAR, 1])


def require_step(bound: BoundStep, switches: ForceSwitches, t: float) -> None:
    """Raise `StepFailure` where the motion sticks at a switch that it comes to within a step from a time."""
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
    for reach in (1.0, *stop_diagnosis.PARAMETERS.reaches[1:]):
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
