"""Tell if a motion sticks at a switch of a force: both sides push it there, as dry friction does at rest (Filippov,
Differential equations with discontinuous righthand sides, section 4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

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

Floats = npt.NDArray[np.float64]
# Where the sides of a switch are looked at: so far from it, as parts of the way of the state to it.
OFFSETS = np.array([-1.0, -0.25, 0.25, 1.0])


class Approach(NamedTuple):
    """A state on its way to a switch: t, y and y' (2n + 1,) each."""

    t: float
    y: Floats
    k: Floats

    def at(self, way: float) -> tuple[float, Floats]:
        """The time and the state farther on the straight way."""
        return self.t + way, self.y + way * self.k


class _Sides(NamedTuple):
    """At the `OFFSETS` from a switch: the states, and d|u|/dt (4,), behind it with the other sign: of a smooth u these
    are the same."""

    states: list[tuple[float, Floats]]
    slopes: Floats

    @property
    def are_drawn(self) -> bool:
        """True if the motion is led to the switch on both of its sides, by a jump of its rate."""
        _, before, after, _ = self.slopes
        return bool(before < 0.0 < after and Sides(tuple(self.slopes[:, None])).jumps()[0])


def require_step(bound: BoundStep, switches: ForceSwitches, t: float) -> None:
    """Raise `StepFailure` where the motion sticks at a switch that it comes to within a step from a time."""
    h = float(bound.h[0])
    begin = Approach(t, bound.y, bound.k)
    u, slope = _rates(bound, switches, *begin)
    for switch in np.flatnonzero((u * slope <= 0.0) & (np.abs(u) <= h * np.abs(slope))).tolist():
        # Of a motion that begins on a switch the sides are looked at from beside it.
        sides = _sides(bound, switches, begin if u[switch] else _turned(bound, begin, h), switch)
        forces = _jumping(bound, switches, sides) if sides is not None and sides.are_drawn else []
        if sides is not None and forces:
            raise StepFailure(_sentence(bound.enforced.system, switches, switch, forces, sides), STICKS)


def _turned(bound: BoundStep, begin: Approach, h: float) -> Approach:
    """The state that an approach leads to, with the rate that it has there."""
    t, y = begin.at(h)
    return Approach(t, y, np.array(bound.numeric.rhs(t, y, bound.p)).ravel())


def _rates(
    bound: BoundStep, switches: ForceSwitches, t: float, y: Floats, k: Floats
) -> tuple[Floats, Floats]:
    u, slope = switches.rates(t, y, k, bound.p[: switches.rates.size1_in(3)])
    return np.array(u).ravel(), np.array(slope).ravel()


def _sides(bound: BoundStep, switches: ForceSwitches, begin: Approach, switch: int) -> _Sides | None:
    """The sides of a switch; None where they cannot be told from each other."""
    u, slope = (float(x[switch]) for x in _rates(bound, switches, *begin))
    if not u * slope < 0.0:
        return None
    way = -u / slope
    for reach in (1.0, *stop_diagnosis.PARAMETERS.reaches[1:]):
        states = [begin.at(way + reach * way * offset) for offset in OFFSETS]
        rates = [np.array(bound.numeric.rhs(*state, bound.p)).ravel() for state in states]
        found = [_rates(bound, switches, *state, k) for state, k in zip(states, rates, strict=True)]
        values = np.array([(u[switch], slope[switch]) for u, slope in found])
        sizes = np.abs(values[:, 0])
        expected = reach * abs(u) * np.abs(OFFSETS)
        if (np.abs(sizes - expected) <= SIDE_LIMITS.stays * expected).all():
            return _Sides(states, np.sign(values[:, 0]) * values[:, 1] * np.sign(-OFFSETS))
    return None


def _jumping(bound: BoundStep, switches: ForceSwitches, sides: _Sides) -> list[str]:
    """The names of the forces that jump between the sides."""
    n, count = bound.numeric.n, len(switches.names)
    p = bound.p[: switches.forces.size1_in(3)]
    found = [switches.forces(t, y[:n], y[n : 2 * n], p) for t, y in sides.states]
    values = tuple(np.array(Q).ravel() for Q, _ in found)
    rounding = UNIT * np.max([np.array(units).ravel() for _, units in found], axis=0)
    jumps = Sides(values, 2 * rounding).jumps().reshape(count, n).any(axis=1)
    return list(dict.fromkeys(switches.names[i] for i in np.flatnonzero(jumps)))


def _sentence(system: System, switches: ForceSwitches, switch: int, forces: list[str], sides: _Sides) -> str:
    names, n = system.model.coordinate_names, system.symbols.q.numel()
    (_, before), (_, after) = sides.states[1:3]
    middle, change = (before + after) / 2, np.abs(after - before)
    middle = np.where(np.abs(middle) <= change.max(), 0.0, middle)
    listed = switches.coordinates[switch][: initial.PARAMETERS.most_listed]
    rates = _rate_names(system)
    where = ", ".join(f"{names[i]} = {middle[i]:.6g}, {rates[i]} = {middle[n + i]:.6g}" for i in listed)
    return _stuck(forces, where, "v")


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


def _rate_names(system: System) -> list[str]:
    """The names of the entries of v."""
    names, generalized = system.model.coordinate_names, system.model.generalized_names
    cartesian = [name.rpartition(".") for name in names[: len(names) - len(generalized)]]
    return [f"{owner}.v{axis}" for owner, _, axis in cartesian] + [f"rate({name})" for name in generalized]
