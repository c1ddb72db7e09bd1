"""Sentences on a run: what is to be known of its multipliers and its energy, and why it stopped."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.frozen import frozen_value
from lagcli.linear.metric_rows import LocalRows
from lagcli.model.settings import Simulation
from lagcli.simulation.run_state import run_stop, statistics
from lagcli.simulation.scheme import step_tolerance
from lagcli.start import initial
from lagcli.start.initial import State

if TYPE_CHECKING:
    from lagcli.analysis.classification.verdict import Condition
    from lagcli.simulation.run_entry import RunReport
    from lagcli.simulation.run_state.run_stop import Stop


CODE = "energy-not-kept"


# What is off by so many tolerances is no error of a run that is right: that grows with the number of steps, each of
# which has a hundredth of one.
TOLERANCES = 1e3
MOST_LISTED = 6  # instants reported one by one
# Conditions that are off by less than this part of the largest are not named.
MAIN = 0.1


@frozen_value
class RunWarning:
    """A warning on the rows of a run: its code for `lagcli explain`, and a sentence."""

    code: str
    reason: str

    @property
    def text(self) -> str:
        """The warning as it is printed."""
        return f"warning[{self.code}]: {self.reason}"


def energy_error(numeric: NumericSystem, settings: Simulation, start: State, report: RunReport) -> float:
    """The error of the energy of a run so far, from this start, as a part of the energy exchanged; 0 where it is no
    larger than that of a run that is right, and where energy need not be kept: with an impact, a force without
    potential, or a row that moves."""
    counted, extremes = report.statistics, report.extremes
    off, exchanged = extremes.imbalance, report.exchanged
    of_steps = statistics.LAST_DIGITS * max(1, counted.steps)
    if not off > TOLERANCES * settings.rtol * exchanged + of_steps * extremes.largest:
        return 0.0
    if not numeric.is_conservative or counted.tally.impacts or not counted.is_balanced:
        return 0.0
    last = State(report.t, report.q, report.v, start.p)
    forces = [np.array(numeric.force(each.t, each.q, each.v, each.p)[0]).ravel() for each in (start, last)]
    tolerance = settings.rtol * exchanged
    if settings.atol is not None:
        # An error of position does work against the forces, and one of velocity changes the momentum.
        inertia = np.array(numeric.inertia(start.t, start.q, start.v, start.p)).diagonal()
        momentum = np.sqrt(2 * exchanged * np.abs(inertia).sum())
        tolerance += settings.atol * float(max(np.abs(each).sum() for each in forces) + momentum)
    # The rounding of the energy, of the positions it is taken at and of its terms, in each of the steps.
    moved = [float(np.abs(each * state.q).sum()) for each, state in zip(forces, (start, last), strict=True)]
    rounding = of_steps * (max(moved) + extremes.largest)
    if off <= TOLERANCES * tolerance + rounding:  # the terms of a large system take longer than its run
        return 0.0
    terms = [float(numeric.energy_terms(each.t, each.q, each.v, each.p)) for each in (start, last)]
    rounding += of_steps * max(terms)
    if off <= TOLERANCES * tolerance + rounding:
        return 0.0
    return off / exchanged if exchanged else np.inf


def energy_warnings(error: float) -> tuple[RunWarning, ...]:
    """The warning of an energy with this error, none where it is 0."""
    if not error:
        return ()
    sentence = (
        f"the energy should stay, and is off by {error:.1e} of the energy exchanged: steps have passed over a force, or"
        " their errors have added up, and the table is wrong by as much; bound the steps (`--max-step`), take more rows"
        " (`samples`), which see more of a narrow force, or a smaller `rtol`"
    )
    return (RunWarning(CODE, sentence),)


def remarks(system: System, report: RunReport) -> tuple[str, ...]:
    """Sentences on a run so far: multipliers that are not unique, singular configurations, rows that are nearly
    dependent at its end, integrals that were not enforced all the time."""
    sentences = []
    chosen = report.selection
    named = [dependency for dependency in (*chosen.dependencies, *chosen.idle) if len(dependency) > 1]
    if named:
        from lagcli.linear import independent_rows  # here, as most rows are independent

        shares = independent_rows.shares(
            [[system.multiplier_rows[i].name for i in sorted(dependency)] for dependency in named]
        )
        sentences.append(
            f"{len(chosen.indeterminate)} multipliers are not unique ({'; '.join(shares)}): R and the motion are; of"
            " all lambda with the same R those with the least sum of lambda_i^2 B_i M^-1 B_i^T are given"
        )
    if others := sorted(report.indeterminate - chosen.indeterminate):
        sentences.append(
            f"the multipliers or impulses of {initial.names_of(system, others)} are not unique at some time: the least"
            " are given"
        )
    if report.crossings:
        first, count = report.crossings[0], len(report.crossings)
        times = ", ".join(f"{crossing.t:.7g}" for crossing in report.crossings[:MOST_LISTED])
        times += f" and {count - MOST_LISTED} more" if count > MOST_LISTED else ""
        names = initial.names_of(system, first.participants)
        loss = f"the row {names} has no direction"
        if len(first.participants) > 1:
            loss = f"the rows {names} lose {first.number} of their rank"
        on = "This motion and R go on smoothly"
        if any(i >= len(system.rows.rows) for crossing in report.crossings for i in crossing.participants):
            on = "This motion goes on smoothly, and R where no contact opens"
        sentences.append(
            f"passed singular configurations at t = {times}: there {loss}, a bifurcation of the motions that the"
            f" constraints allow. {on}; a multiplier may have a pole there, and at it no value (nan)"
        )
    if is_amplified(system, report):
        sentences.append(
            f"at t = {report.t:.9g} the rows are within {report.rank_margin:.1g} of dependent ones: whatever the"
            " tolerance, the rounding of positions may move velocities and multipliers there by"
            f" {min(amplified(report), 1.0):.1g} of their size"
        )
    return (*sentences, *report.statistics.notes)


def amplified(report: RunReport) -> float:
    """The part of velocities and multipliers that the rounding of positions may make at the time reached.

    Positions are moved across by their rounding over the angle of the rows to dependent ones, and what depends on them
    by that over the angle again.
    """
    return step_tolerance.UNIT / max(report.rank_margin, step_tolerance.UNIT) ** 2


def is_amplified(system: System, report: RunReport) -> bool:
    """True if that is far more than the tolerance allows."""
    return amplified(report) > TOLERANCES * system.model.simulation.rtol


def explained(
    stop: Stop,
    system: System,
    numeric: NumericSystem,
    ends: tuple[State, RunReport],
    conditions: Sequence[Condition],
) -> Stop:
    """The stop with the inertia that the run has lost since its start, or with the hidden conditions that the forces
    do not keep. ends: the start and the report of the time reached."""
    from lagcli.start import initial  # here, as most runs go to their end

    start, report = ends
    now = numeric.inertia(report.t, report.q, report.v, start.p)
    first = numeric.inertia(start.t, start.q, start.v, start.p)
    if fallen := initial.fallen(now, first, system.model.coordinate_names):
        stop = dataclasses.replace(stop, reason=f"{stop.reason}; {fallen}")
    if not conditions:
        return stop
    state = State(report.t, report.q, report.v, start.p)
    if why := _led_off(system, conditions, state, report.a):
        where = stop.reason.partition(": ")[0]
        stop = dataclasses.replace(stop, reason=f"{where}: {why}", code=run_stop.NO_SOLUTION)
    return stop


def _led_off(system: System, conditions: Sequence[Condition], state: State, a: Floats) -> str:
    """The hidden conditions of a system that accelerations a (n,) at a state do not satisfy, as a sentence, or
    nothing: no multiplier holds a motion to a hidden condition from which the forces lead away."""
    from lagcli.analysis.classification import classify  # here, as most models have none

    whole = classify.extended(system, conditions)
    numeric = NumericSystem(whole)
    index = {row.name: i for i, row in enumerate(whole.rows.rows)}
    own = [index[classify.equation(one)] for one in conditions]
    rows = LocalRows(numeric.rows(state.t, state.q, state.v, state.p)[0][own, :])
    gamma = np.array(numeric.force(state.t, state.q, state.v, state.p)[1]).ravel()[own]
    off, size = np.abs(rows.times(a) - gamma), rows.divisors * np.abs(a).max(initial=0.0) + np.abs(gamma)
    part = off / np.where(size > 0, size, 1.0)
    # What other conditions are off then follows from the largest.
    least = max(doubles.ZERO, MAIN * part.max(initial=0.0))
    left = [one for one, is_left in zip(conditions, part > least, strict=True) if is_left]
    if not left:
        return ""
    if len(left) == 1:
        (one,) = left
        verb = "demands" if len(one.rows) == 1 else "demand"
        who = classify.quoted(one.rows)
        condition = f"`{classify.equation(one)}`, which {who} {verb} and no multiplier holds"
        return f"the forces lead off the hidden condition {condition}"
    named = ", ".join(f"`{classify.equation(one)}` (of {classify.quoted(one.rows)})" for one in left)
    return f"the forces lead off the hidden conditions {named}, which no multiplier holds"
