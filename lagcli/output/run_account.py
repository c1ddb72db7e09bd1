"""The account of a run, from the report of its numbers and from what has become of its rows."""

from __future__ import annotations

from lagcli.equations.system import System
from lagcli.model import settings
from lagcli.output.trajectory import Outcome, Stats, provenance
from lagcli.simulation.global_error.accuracy import Accuracy
from lagcli.simulation.run_report import RunReport
from lagcli.start import assembly_moves
from lagcli.start.assembly import Assembly


def of(
    system: System,
    report: RunReport,
    outcome: Outcome,
    seconds: float,
    assembly: Assembly | None = None,
    accuracy: Accuracy | None = None,
) -> Stats:
    """The account so far; of a resumed run it covers the whole, but for the seconds.

    seconds: those before the first step; assembly: what moved the start; accuracy: of the rows, with the kinds that
    are zero to rounding.
    """
    chosen, told = system.model.simulation, report.told
    return Stats(
        report.steps,
        report.rejected,
        report.evaluations,
        seconds,
        report.solve_seconds,
        settings.method_name(chosen),
        report.position_drift,
        report.velocity_drift,
        report.energy_imbalance,
        tuple(system.multiplier_rows[i].name for i in sorted(report.indeterminate)),
        tuple(crossing.t for crossing in report.crossings),
        outcome.stopped,
        report.ended_by,
        outcome.rows,
        outcome.t_end,
        provenance(system.model),
        accuracy,
        assembly_moves.moves(system.model, assembly) if assembly else None,
        chosen.rtol,
        chosen.atol,
        told.impacts,
        told.releases,
        told.accumulations,
        report.largest_penetration,
    )
