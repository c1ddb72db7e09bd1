"""The account of incidents: what is counted, and what a resumed run tells."""

import dataclasses

import numpy as np
import pytest

from lagcli.simulation.run_state import saved_form
from lagcli.simulation.run_state.statistics import NONE, Incident, Kind, RunStatistics, Tally


def incident(t: float, kind: Kind, name: str = "floor") -> Incident:
    return Incident(t, kind, name, np.zeros(1), np.zeros(2), np.zeros(2))


def test_incidents_are_counted_by_contact_and_by_instant() -> None:
    account = RunStatistics()
    for t, kind, name in (
        (1.0, "impact", "a"), (1.0, "impact", "b"), (1.0, "contact", "b"), (2.0, "impact", "a"),
        (3.0, "accumulation", "a"), (3.0, "accumulation", "b"), (4.0, "release", "a"), (4.0, "release", "b"),
    ):  # fmt: skip
        account.add(incident(t, kind, name))
    tally = account.tally
    assert (tally.incidents, tally.instants) == (8, 4)
    assert (tally.impacts, tally.accumulations, tally.releases) == (3, 2, 2)
    assert [i.t for i in account.incidents] == [1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 4.0, 4.0]


def test_a_resumed_run_tells_no_incident_that_was_handed_out_before() -> None:
    before = RunStatistics()
    before.add(incident(1.0, "impact"))
    mark = before.tally
    before.add(incident(2.0, "impact"))
    resumed = RunStatistics(tally=mark, reported=before.reported)
    resumed.add(incident(2.0, "impact"))
    assert not resumed.incidents
    resumed.add(incident(3.0, "impact"))
    assert [i.t for i in resumed.incidents] == [3.0]
    assert resumed.reported.impacts == 3


@pytest.mark.parametrize("tally", [NONE, NONE.plus(incident(0.1, "impact")).plus(incident(0.3, "release"))])
def test_a_tally_reads_back_from_a_checkpoint(tally: Tally) -> None:
    assert saved_form.read(Tally, saved_form.saved(tally)) == tally
    assert dataclasses.is_dataclass(tally)
