"""A warning where a conservative run does not keep its energy: then it is no motion of the model.

The balance is a witness that no step looks at. Where nothing but forces with a potential acts and no row moves, the
energy stays to the tolerance of the run; what is far more is a force that steps have passed over, or errors that have
added up.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from lagcli.compiled import NumericSystem
from lagcli.frozen import frozen_value
from lagcli.model.settings import Simulation
from lagcli.simulation.run_state import statistics
from lagcli.start.initial import State

if TYPE_CHECKING:
    from lagcli.simulation.run_entry import RunReport

CODE = "energy-not-kept"


class EnergyParameters:
    """From when on an energy is not kept.

    The tests are of `tests/physics/test_narrow_features.py`.
    """

    __slots__ = ()

    tolerances: float = 1e3
    """What is off by so many tolerances is no error of a run that is right: that grows with the number of steps, of
    which each has a hundredth of one.
    `test_an_energy_is_not_kept_from_a_thousand_tolerances_on` fails at 100 and 10000."""


PARAMETERS = EnergyParameters()


@frozen_value
class RunWarning:
    """A warning on the rows of a run: its code for `lagcli explain`, and a sentence."""

    code: str
    reason: str

    @property
    def text(self) -> str:
        """The warning as it is printed."""
        return f"warning[{self.code}]: {self.reason}"


@frozen_value
class EnergyError:
    """The largest error of the energy of a run, the energy exchanged, and what the tolerance and rounding allow."""

    off: float
    exchanged: float
    tolerance: float
    rounding: float

    @property
    def is_kept(self) -> bool:
        """True where the error is no larger than that of a run that is right."""
        return self.off <= PARAMETERS.tolerances * self.tolerance + self.rounding

    @property
    def part(self) -> float:
        """The error as a part of the energy exchanged."""
        return self.off / self.exchanged if self.exchanged else np.inf

    @property
    def warning(self) -> RunWarning:
        """The warning that it is."""
        return RunWarning(
            CODE,
            f"the energy should stay, and is off by {self.part:.1e} of the energy exchanged: steps have passed over a"
            " force, or their errors have added up, and the table is wrong by as much; bound the steps (`--max-step`),"
            " take more rows (`samples`), which see more of a narrow force, or a smaller `rtol`",
        )


def found(
    numeric: NumericSystem, settings: Simulation, start: State, report: RunReport
) -> EnergyError | None:
    """The error of the energy of a run so far, from this start, where it is not kept; None where it is, and where it
    need not be: with an impact, a force without potential, or a row that moves."""
    counted, extremes = report.statistics, report.extremes
    exchanged = report.exchanged
    if not extremes.imbalance > PARAMETERS.tolerances * settings.rtol * exchanged:
        return None
    if not numeric.is_conservative or counted.tally.impacts or not counted.is_balanced:
        return None
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
    rounding = statistics.LAST_DIGITS * max(1, counted.steps)
    error = EnergyError(extremes.imbalance, exchanged, tolerance, rounding * (max(moved) + extremes.largest))
    if error.is_kept:  # the terms of a large system take longer than its run
        return None
    terms = [float(numeric.energy_terms(each.t, each.q, each.v, each.p)) for each in (start, last)]
    error = dataclasses.replace(error, rounding=error.rounding + rounding * max(terms))
    return None if error.is_kept else error
