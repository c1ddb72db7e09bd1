"""The reason why a run cannot go on: the row whose value or gradient jumps there, ends or has a pole, and the function
in it."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear.metric_rows import LocalRows
from lagcli.smoothness.sides import Sides
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


class DiagnosisParameters:
    """Thresholds of the diagnosis of why a run could not go on; distances along the motion are parts of the
    size of the configuration.

    The tests are of `tests/unit/test_numbers_of_steps.py`.
    """

    __slots__ = ()

    near: float = 1e-8
    """How close the two sides of a point are looked at: a run stops within rounding of a jump.
    `test_a_jump_is_seen_within_rounding_of_the_point` fails at 1e-9 and 1e-7."""
    far: float = 1e-5
    """And from farther off: a run stops some way before the end of a function, where its steps have become
    too short. `test_the_end_of_a_function_is_seen_from_farther_off` fails at 1e-6 and 0.0001."""
    reaches: tuple[float, ...] = (1.0, 1e2, 1e3, 1e4)
    """So many times these distances, in turn. `test_the_end_of_a_row_is_looked_for_a_tenth_ahead` fails at a
    tenth and at ten times of it."""
    part_of_run: float = 1e-3
    """A configuration is as large as the way of this part of the run, or larger.
    `test_a_jump_is_seen_within_rounding_of_the_point` fails at 0.0001 and 0.01."""


PARAMETERS = DiagnosisParameters()
# `atan2` jumps by 2 pi at its cut, and by less where both of its arguments go through zero.
AT_CUT = 1.5 * np.pi
THROUGH_ZERO = "both arguments of `atan2` go through zero"


def reason(system: System, numeric: NumericSystem, state: State) -> str:
    """The reason why rows do not lead on from a state along its velocity, as a sentence; empty where none of them jumps
    there."""
    if not system.rows.rows:
        return ""
    ways = [(reach, _along(state, reach, time_scale(system, state))) for reach in PARAMETERS.reaches]
    found_sides = [
        (reach, states, Sides(tuple(_rows(numeric, x) for x in states), _rounding(numeric, states[1])))
        for reach, states in ways
    ]
    for reach, states, seen in found_sides:
        # A jump of a value first: close to it cancellation spoils the gradient too.
        hit = np.flatnonzero(seen.jumps()[: system.holonomic_count])
        if hit.size and reach < PARAMETERS.reaches[-1]:
            row = int(hit[0])
            return _sentence(system, row, "jumps", True, _call(system, row, states))
    for reach, states, seen in found_sides:
        kinds = [("ends", seen.ends())]
        if reach < PARAMETERS.reaches[-1]:
            kinds += [("jumps", seen.jumps()), ("grows", seen.grows())]
        for kind, found in kinds:
            hit = np.flatnonzero(found)
            if hit.size:
                part, row = divmod(int(hit[0]), len(system.rows.rows))
                return _sentence(system, row, kind, part == 0, _call(system, row, states))
    return ""


def _sentence(system: System, row: int, kind: str, in_value: bool, call: str) -> str:
    name, is_holonomic = system.rows.rows[row].name, row < system.holonomic_count
    why = f" ({call})" if call else ""
    if kind == "ends":
        return f"the row `{name}` is not defined beyond{why}: its surface, or its gradient, ends there"
    if kind == "grows":
        return f"the gradient of the row `{name}` grows beyond all bounds there{why}"
    if in_value and is_holonomic:
        return f"the row `{name}` jumps there{why}"
    what = "gradient of the row" if is_holonomic else "row"
    return f"the {what} `{name}` jumps there{why}, and the velocity would have to jump"


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
    """Name the innermost function of a row whose value or slope jumps, ends or grows between the states, or
    nothing."""
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
