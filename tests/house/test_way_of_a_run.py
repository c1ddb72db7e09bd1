"""The way of a model through `lagcli simulate`: each stage is entered once or twice, and little calls back up.

What is counted are calls while it runs, properties and generators among them; data that is handed on is none.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import lagcli
from lagcli.api.models import cache
from tests.helpers import calls_between
from tests.helpers.in_process import run
from tests.house.test_architecture import ROOMS

MODELS = Path(__file__).parents[2] / "models"

MOST_ENTRIES = 2

# A lower package calls a higher one through what it was handed, and in these files alone.
CLIMBS = {
    "expression/evaluate.py": "walks a formula and lets the algebra it was given carry out the operations",
    "expression/facts.py": "asks the file that is being read what a name stands for",
    "model/resolve.py": "asks the stage it serves for the value of a name that it has found",
    "equations/operation_graph.py": "walks a graph of operations and shows each to the visitor it was given",
    "contact/zero_search.py": "looks for the first zero of the function it was given",
}
MOST_CLIMBS = 4  # of them in one run


# A holonomic model, one whose first integrals are searched, one with impacts, one with a rope that goes slack.
@pytest.mark.parametrize("name", ["pendulum", "rolling-disk", "zeno-ball", "rope-slack-and-taut"])
def test_each_stage_is_entered_once_or_twice(name: str, tmp_path: Path) -> None:
    lagcli.simulate(MODELS / "pendulum.yaml", samples=2)  # loads what the recorder would slow down
    cache.forget()
    with calls_between.recorded() as places:
        _, err, code = run("simulate", MODELS / f"{name}.yaml", "--samples", "5", "-o", tmp_path / "run.csv")
    assert code == 0, err
    entered = {called: found for (caller, called), found in places.items() if caller == "api"}
    assert {"input", "equations", "compiled", "analysis", "simulation", "output"} <= entered.keys()
    assert not {called: found for called, found in entered.items() if len(found) > MOST_ENTRIES}
    up = {
        place.partition(":")[0]
        for (caller, called), found in places.items()
        if ROOMS.index(called) > ROOMS.index(caller)
        for place in found
    }
    assert up <= CLIMBS.keys()
    assert len(up) <= MOST_CLIMBS
