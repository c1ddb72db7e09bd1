"""Another value of a model costs no new build and no new proof, and changes no bit of a run."""

import gc
import pathlib
import pickle

import numpy as np
import pytest

import lagcli
from lagcli import memory
from lagcli.analysis.classification import classify
from lagcli.expression import tree
from lagcli.start import assembly

MODELS = pathlib.Path(__file__).parents[2] / "models"
ROWS = {"duration": 0.2, "samples": 3}
# Models of the gallery, with changes one after the other: of what rows hold, of what they do not hold, of the start.
STUDIES = {
    "pendulum": [{"L": 1.5}, {"m": 3}, {"g": 1.6}],
    "rolling-disk": [{"M": 2}, {"M": 3}, {"a": 0.4}, {"x.value": 0.5}, {"M": 2}],
    "knife-edge": [{"m": 2}, {"m": 3}],
    "rigid-plate": [{"g": 3}],
    "breaking-rod": [{"g": 9}],
    "two-wheel-axle": [{"theta.value": 0.2}],
}
CLOSED = """
lagcli: 1
parameters: {L: 1, m: 1, g: 9.81, D: 2}
particles:
  a: {mass: m, position: [0.3, 0, -0.8]}
  b: {mass: 2*m, position: [1.6, 0, -0.8]}
forces: {gravity: {to: [a, b], force: [0, 0, -m*g]}}
holonomic:
  l1: L = distance(a, [0, 0, 0])
  l2: L = distance(a, b)
  l3: L = distance(b, [D, 0, 0])
  pa: a.y = 0
  pb: b.y = 0
"""


def fresh(load, change: dict[str, object], **options: object) -> np.ndarray:
    memory.forget()
    rows = lagcli.simulate(load(change), **ROWS, **options).rows
    memory.forget()
    return rows


@pytest.mark.parametrize("name", STUDIES)
def test_runs_of_one_study_are_those_of_fresh_processes(name: str) -> None:
    path = MODELS / f"{name}.yaml"
    changes = STUDIES[name]
    expected = [fresh(lambda one: lagcli.load(path, one), change) for change in changes]
    model = lagcli.load(path)
    for change, rows in zip(changes, expected, strict=True):
        assert lagcli.simulate(model.with_parameters(change), **ROWS).rows.tobytes() == rows.tobytes()


def test_assembled_starts_are_found_again_only_where_what_they_depend_on_has_changed(monkeypatch) -> None:
    calls: list[object] = []
    assemble = assembly.assemble
    changes = [{"g": 9.81}, {"g": 3}, {"m": 2}, {"D": 1.9}, {"a.x": 0.2}, {"g": 4}]
    expected = [fresh(lambda one: lagcli.loads(CLOSED, one), one, assemble=True) for one in changes]
    monkeypatch.setattr(assembly, "assemble", lambda *a, **k: calls.append(a) or assemble(*a, **k))
    model = lagcli.loads(CLOSED)
    counts = []
    for change, rows in zip(changes, expected, strict=True):
        run = lagcli.simulate(model.with_parameters(change), **ROWS, assemble=True)
        assert run.rows.tobytes() == rows.tobytes()
        counts.append(len(calls))
    assert counts == [1, 1, 2, 3, 4, 4]  # gravity moves no assembled start; masses weigh its distance


def test_a_proof_is_made_again_only_where_rows_hold_what_has_changed(monkeypatch) -> None:
    calls: list[object] = []
    proof = classify.certainly_nonholonomic
    monkeypatch.setattr(classify, "certainly_nonholonomic", lambda case: calls.append(case) or proof(case))
    memory.forget()
    model = lagcli.load(MODELS / "rolling-disk.yaml")
    assert {p.name for p in model.parameters} >= {"M", "a"}
    counts = []
    for change in ({"M": 1}, {"M": 2}, {"a": 0.4}, {"M": 3}):
        lagcli.simulate(model.with_parameters(change), **ROWS)
        counts.append(len(calls))
    assert counts == [1, 1, 2, 2]


def test_changes_go_on_top_of_earlier_ones_and_are_reported() -> None:
    model = lagcli.loads(CLOSED, {"L": 2, "m": "3/2"}).with_parameters({"a.x": 0.25}, L=1.5)
    assert {p.name: p.value for p in model.parameters} == {"L": 1.5, "m": 1.5, "g": 9.81, "D": 2.0}
    assert dict(model.changes) == {"L": "1.5", "m": "3/2", "a.x": "0.25"}
    assert model.particles[0].start.tolist() == [[0.25, 0.0, -0.8]]
    assert pickle.loads(pickle.dumps(model)).with_parameters(g=1).parameters[2].value == 1.0


def test_wrong_changes_are_refused_as_those_of_the_command_line() -> None:
    model = lagcli.loads(CLOSED)
    with pytest.raises(lagcli.OverrideError, match="did you mean `L`"):
        model.with_parameters(LL=1)
    with pytest.raises(lagcli.ModelError, match="unknown-name"):
        model.with_parameters(L="2*q")


def test_values_leave_nothing_behind_in_the_file_that_was_read():
    model = lagcli.load(MODELS / "pendulum.yaml")

    def kept():
        gc.collect()
        return sum(isinstance(one, tree.Number) for one in gc.get_objects())

    model.with_parameters(L=1.25)
    before = kept()
    for i in range(50):
        model.with_parameters(L=1.25 + i / 64)
    assert kept() <= before


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("double-pendulum", {"m1": 2}),
        ("rolling-disk", {"M": 2}),
        ("zeno-ball", {"e": 0.5}),
        ("chain", {"N": 4}),
    ],
)
def test_a_model_and_its_run_are_gone_when_nobody_holds_them(name, change):
    """Objects that hold each other in a circle stay until a collection, which looks through all of a long sweep."""
    model = lagcli.load(MODELS / f"{name}.yaml")

    def go():
        lagcli.simulate(model.with_parameters(change), duration=0.1, samples=3)

    go()
    gc.collect()
    gc.disable()
    try:
        go()
        assert gc.collect() == 0
    finally:
        gc.enable()
