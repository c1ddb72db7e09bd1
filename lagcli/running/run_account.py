"""The account of a run, the object of `--stats`: the report of its numbers, and what has become of its rows."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from lagcli.frozen import frozen_value
from lagcli.model.settings import Simulation
from lagcli.output.tables.provenance import Provenance

if TYPE_CHECKING:
    from lagcli.running.run_remarks import RunWarning
    from lagcli.simulation.error_estimate import Accuracy
    from lagcli.start.consistent_start import Moves

# The codes of a run that a signal ended, and of one whose rows could not be written.
INTERRUPTED, NOT_WRITTEN = "interrupted", "not-written"


@frozen_value
class Stopped:
    """The reason why a run ended before its end: the time reached, a sentence, and its code for `lagcli explain`."""

    t: float
    reason: str
    code: str


@dataclasses.dataclass(slots=True)
class Outcome:
    """The outcome of a run so far: the number of its rows, the time of the last one, and why it stopped."""

    rows: int = 0
    t_end: float | None = None
    stopped: Stopped | None = None


@frozen_value
class Stats:
    """The account of a run, the object of `--stats`.

    steps: accepted ones; evaluations: of the right-hand side; compile_seconds, of equations and native code, and
    solve_seconds, of all else: wall time; position_drift and velocity_drift: largest |f_i| / |B_i| and |B_i v + b_i| /
    |B_i| over all rows written, the first also over |g_j| / |dg_j| of the first integrals that are enforced, g_j being
    the integral less its value at the start; energy_imbalance: largest deviation from the energy balance over all rows,
    as a part of the energies exchanged, or None where the work within a step was not found; indeterminate: rows whose
    multipliers are not unique; singular_times: of configurations that were passed; stopped: why the run ended before
    its end; ended_by: the event that ended it; rows: how many there are up to t_end; accuracy: the estimate of the
    errors, assembled: what assembly changed in the start, where they were asked for; atol: None where it is a part
    of the sizes of the motion; impacts, releases, accumulations: numbers of such, by contact; largest_penetration:
    the largest -g over all rows, in units of g; warnings: why the rows are not to be trusted; native_steps: those
    that native code took, of a resumed run in this part of it.
    """

    steps: int
    rejected: int
    evaluations: int
    compile_seconds: float
    solve_seconds: float
    method: str
    position_drift: float
    velocity_drift: float
    energy_imbalance: float | None
    indeterminate: tuple[str, ...] = ()
    singular_times: tuple[float, ...] = ()
    stopped: Stopped | None = None
    ended_by: str | None = None
    rows: int = 0
    t_end: float | None = None
    provenance: Provenance | None = None
    accuracy: Accuracy | None = None
    assembled: Moves | None = None
    rtol: float = Simulation().rtol
    atol: float | None = None
    impacts: int = 0
    releases: int = 0
    accumulations: int = 0
    largest_penetration: float = 0.0
    warnings: tuple[RunWarning, ...] = ()
    native_steps: int = 0

    def as_json(self) -> dict[str, object]:
        """The object written by `--stats`."""
        account = dataclasses.asdict(
            dataclasses.replace(self, accuracy=None, assembled=None, provenance=None)
        )
        del account["accuracy"], account["assembled"]
        if self.provenance is not None:
            account["provenance"] = self.provenance.as_json()
        if self.assembled is not None:
            account["assembled"] = self.assembled.as_json()
        return account if self.accuracy is None else {**account, **self.accuracy.as_json()}
