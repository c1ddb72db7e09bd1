"""The way of a model through a command: each package is entered once or twice, and little calls back up.

What is counted are calls while it runs, properties and generators among them; data that is handed on is none.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import lagcli
from lagcli.api.models import cache
from tests.helpers import calls_between
from tests.helpers.calls_between import Places
from tests.helpers.in_process import run
from tests.house.test_architecture import ROOMS

MODELS = Path(__file__).parents[2] / "models"

MOST_ENTRIES = 2

# A lower package calls a higher one through what it was handed, and in these files alone.
CLIMBS = {
    "expression/evaluate.py": "walks a formula and lets the algebra it was given carry out the operations",
    "expression/functions.py": "takes the slope of a function with the arithmetic it was given",
    "expression/facts.py": "asks the file that is being read what a name stands for",
    "model/resolve.py": "asks the stage it serves for the value of a name that it has found",
    "smoothness/operation_graph.py": "walks a graph of operations and shows each to the visitor it was given",
    "contact/zero_search.py": "looks for the first zero of the function it was given",
}
MOST_CLIMBS = 5  # of them in one run


def walked(*arguments: object) -> Places:
    """The places by which packages enter one another while a command runs."""
    lagcli.simulate(MODELS / "pendulum.yaml", samples=2)  # loads what the recorder would slow down
    cache.forget()
    with calls_between.recorded() as places:
        _, err, code = run(*arguments)
    assert code == 0, err
    return places


def entered(places: Places, caller: str) -> dict[str, set[str]]:
    """The places of a package by the package that is entered there."""
    return {called: found for (one, called), found in places.items() if one == caller}


def too_many(places: Places, caller: str) -> dict[str, set[str]]:
    return {called: found for called, found in entered(places, caller).items() if len(found) > MOST_ENTRIES}


# A holonomic model, one whose first integrals are searched, one with impacts, one with a rope that goes slack.
@pytest.mark.parametrize("name", ["pendulum", "rolling-disk", "zeno-ball", "rope-slack-and-taut"])
def test_each_stage_is_entered_once_or_twice(name: str, tmp_path: Path) -> None:
    places = walked("simulate", MODELS / f"{name}.yaml", "--samples", "5", "-o", tmp_path / "run.csv")
    assert {"input", "equations", "compiled", "analysis", "simulation", "output"} <= entered(
        places, "api"
    ).keys()
    assert {"api", "output", "errors", "progress"} == entered(places, "cli").keys()
    assert not too_many(places, "api")
    assert not too_many(places, "cli")
    up = {
        place.partition(":")[0]
        for (caller, called), found in places.items()
        if ROOMS.index(called) > ROOMS.index(caller)
        for place in found
    }
    assert up <= CLIMBS.keys()
    assert len(up) <= MOST_CLIMBS


def test_all_files_of_a_run_take_no_more_entries(tmp_path: Path) -> None:
    files = [
        ("-o", "run.csv"),
        ("--events", "e.csv"),
        ("--plot", "p.svg"),
        ("--stats", "s.json"),
        ("--checkpoint", "c"),
    ]
    options = [part for option, name in files for part in (option, tmp_path / name)]
    places = walked(
        "simulate", MODELS / "zeno-ball.yaml", "--event-rows", "--digits", "--columns", "t,lambda.*", *options
    )
    assert len(list(tmp_path.iterdir())) == len(files)
    assert not too_many(places, "api")
    assert not too_many(places, "cli")


def test_a_run_that_is_resumed_takes_no_more_entries(tmp_path: Path) -> None:
    model, point = MODELS / "pendulum.yaml", tmp_path / "point"
    assert (
        run("simulate", model, "--duration", "1", "-o", tmp_path / "run.csv", "--checkpoint", point)[2] == 0
    )
    places = walked("simulate", model, "--resume", point, "-o", tmp_path / "more.csv", "--checkpoint", point)
    # A checkpoint is read, refused before anything is built where it is of another run, and gone on from.
    assert too_many(places, "api").keys() <= {"simulation"}
    assert len(entered(places, "api")["simulation"]) == 3
    assert not too_many(places, "cli")


def test_a_run_in_memory_enters_each_stage_once_or_twice() -> None:
    model = lagcli.load(MODELS / "pendulum.yaml")
    lagcli.simulate(model, samples=2)
    cache.forget()
    with calls_between.recorded() as places:
        lagcli.simulate(model, samples=5)
    assert "output" in entered(places, "api")
    assert not too_many(places, "api")


# The answer is a frozen object, and what is told of it is another one.
@pytest.mark.parametrize(
    ("command", "name"), [("dof", "pendulum"), ("check", "rolling-disk"), ("audit", "pendulum")]
)
def test_other_commands_enter_each_package_once_or_twice(command: str, name: str) -> None:
    places = walked(command, MODELS / f"{name}.yaml")
    assert "api" in entered(places, "cli")
    assert not too_many(places, "cli")


SWEPT = ("sweep", MODELS / "pendulum.yaml", "--over", "L=1:2:4", "--samples", "3")


def assert_few_from_above(places: Places) -> None:
    assert "output" in entered(places, "cli")
    assert not too_many(places, "cli")


@pytest.mark.parametrize(
    "options",
    [("-o", "rows.csv"), ("-o", "rows.csv", "--jobs", "2"), ("-o", "rows.parquet", "--resume"), ("-o", "-")],
)
def test_a_sweep_enters_each_package_once_or_twice(
    options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    places = walked(*SWEPT, *options)
    assert {"api", "output", "errors", "progress"} == entered(places, "cli").keys()
    assert_few_from_above(places)


def test_a_sweep_of_draws_and_its_json_take_no_more_entries(tmp_path: Path) -> None:
    drawn = ("--uncertain", "L~normal(1, 0.01)", "--draws", "4", "--reduce", "peak=max(lambda.rod)")
    places = walked("sweep", SWEPT[1], *drawn, "--samples", "3", "--json", "-o", tmp_path / "rows.csv")
    assert_few_from_above(places)


def test_a_sweep_that_is_gone_on_with_and_one_that_is_merged_take_no_more_entries(tmp_path: Path) -> None:
    parts = [tmp_path / f"{number}.csv" for number in (1, 2)]
    for number, path in enumerate(parts, 1):
        assert run(*SWEPT, "--shard", f"{number}/2", "-o", path)[2] == 0
    places = walked(*SWEPT, "--shard", "1/2", "-o", parts[0], "--resume")
    assert_few_from_above(places)
    merged = walked("sweep", "--merge", *parts, "-o", tmp_path / "all.csv")
    assert {"output", "errors"} == entered(merged, "cli").keys()
    assert_few_from_above(merged)


# A table, a sentence and a note are each printed by one function, which escapes what a terminal would act on.
PRINTERS = 3


def assert_few_but_for_escapes(places: Places) -> None:
    assert too_many(places, "cli").keys() <= {"errors"}
    assert len(entered(places, "cli").get("errors", ())) <= PRINTERS


BRIEF = ("--duration", "0.1", "--samples", "5")


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("compare", BRIEF),
        ("compare", (MODELS / "pendulum.yaml", *BRIEF)),
        ("equilibrium", ("--starts", "2")),
        ("stationary", ("--of", "a.z", "--starts", "2")),
        ("modes", ()),
        ("limit", ("--constraint", "rod", *BRIEF)),
        ("limit", ("--constraint", "rod", *BRIEF, "-o", "-", "--plot", "limit.svg")),
        ("plot", (*BRIEF, "--show")),
        ("report", BRIEF),
        ("animate", BRIEF),
    ],
)
def test_commands_that_run_a_model_more_than_once_or_draw_it_enter_each_package_once_or_twice(
    command: str, options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    places = walked(command, MODELS / "pendulum.yaml", *options)
    assert "api" in entered(places, "cli")
    assert_few_but_for_escapes(places)


def test_two_principles_with_their_files_take_no_more_entries(tmp_path: Path) -> None:
    files = ("--vakonomic", "-o", tmp_path / "other.csv", "--plot", tmp_path / "both.svg")
    places = walked("compare", MODELS / "rolling-disk.yaml", *BRIEF, *files)
    assert len(list(tmp_path.iterdir())) == 2
    assert_few_but_for_escapes(places)
