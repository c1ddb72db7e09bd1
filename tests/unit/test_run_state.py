"""The state of a run: all that it counts goes into its checkpoint, and comes out of it."""

import dataclasses
from pathlib import Path

import pytest

import lagcli
from lagcli.api import prepare_run
from lagcli.simulation.run_state import checkpoint
from lagcli.simulation.run_state.statistics import Counts, RankDrop, RunStatistics, Tally

MODEL = Path(__file__).parents[2] / "models" / "zeno-ball.yaml"
# Another value of a count, by the type that its declaration tells.
OTHERS = {
    "int": 1_234_567,
    "tuple[str, ...]": ("a note",),
    "tuple[RankDrop, ...]": (RankDrop(0.125, 1, (0,)),),
    "Tally": Tally(1000, 900, 800, 50, 25, 0.0625),
}


@pytest.fixture(scope="module")
def point() -> checkpoint.Checkpoint:
    model = lagcli.load(MODEL)
    run = prepare_run.start(model, dataclasses.replace(model.simulation, duration=0.5))
    for _ in run.blocks():
        pass
    return run.checkpoint()


@pytest.mark.parametrize("count", dataclasses.fields(Counts), ids=lambda field: field.name)
def test_a_resumed_run_has_every_count_of_its_checkpoint(
    count: "dataclasses.Field[object]", point: checkpoint.Checkpoint
) -> None:
    assert isinstance(count.type, str)
    other = OTHERS[count.type]
    counts = {field.name: getattr(point.run_state, field.name) for field in dataclasses.fields(Counts)}
    assert counts[count.name] != other
    counts[count.name] = other
    if count.name == "tally":
        counts["reported"] = other  # of no less incidents
    changed = dataclasses.replace(point, run_state=dataclasses.replace(point.run_state, **counts))
    read = checkpoint.decoded(checkpoint.encoded(changed))
    model = lagcli.load(MODEL)
    resumed = prepare_run.resume(model, dataclasses.replace(model.simulation, duration=1), read)
    again = resumed.checkpoint().run_state
    assert {name: getattr(again, name) for name in counts} == counts


def test_the_account_of_a_run_counts_what_its_state_counts() -> None:
    names = {field.name for field in dataclasses.fields(Counts)}
    own = {field.name for field in dataclasses.fields(RunStatistics)} - names
    of_account = {"solve_seconds", "extremes", "incidents", "resting", "ended_by", "is_balanced"}
    assert own == {*of_account, "native_steps", "compile_seconds"}
    assert names < {field.name for field in dataclasses.fields(checkpoint.RunState)}
