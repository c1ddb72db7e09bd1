"""Compiled systems are kept to be used again, and an answer is the same where nothing is kept."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli import memory
from lagcli.api import cache
from lagcli.model.model import Model

MODELS = Path(__file__).parents[2] / "models"

Answer = Callable[[Model], object]


def table(model: Model) -> object:
    run = lagcli.simulate(model, duration=0.5, samples=6)
    return run.columns, run.rows.tobytes(), run.notes, run.stats.steps


def comparison(model: Model) -> object:
    found = lagcli.compare(model, duration=0.5, samples=6)
    runs = [(one.name, one.steps, one.rows, one.table.tobytes()) for one in found.formulations]
    return runs, found.agreements, found.notes


def displacements(model: Model) -> object:
    return lagcli.displacements(model, 0.25).as_json()


ANSWERS: dict[str, Answer] = {
    "dof": lambda model: lagcli.dof(model).as_json(),
    "check": lambda model: lagcli.check(model, assemble=True).as_json(),
    "simulate": table,
    "digits": lambda model: lagcli.simulate(model, duration=0.5, samples=6, digits=True).rows.tobytes(),
    "compare": comparison,
    "audit": lambda model: lagcli.audit(model, duration=0.5, samples=6).as_json(),
    "displacements": displacements,
    "derive": lambda model: lagcli.derive(model).text(),
}


@pytest.fixture
def forgetful(monkeypatch: pytest.MonkeyPatch) -> None:
    """All memories are emptied each time that one of them is asked."""
    known = memory.Memory.known

    def forgetting(self: memory.Memory, question: Hashable) -> object:
        memory.forget()
        return known(self, question)

    monkeypatch.setattr(memory.Memory, "known", forgetting)


@pytest.fixture(params=["pendulum-angle", "spoke", "rope-slack-and-taut"])
def model(request: pytest.FixtureRequest) -> Model:
    return lagcli.load(MODELS / f"{request.param}.yaml")


@pytest.fixture
def kept(model: Model) -> dict[str, object]:
    """All answers, with whatever is kept from one to the next."""
    return {name: answer(model) for name, answer in ANSWERS.items()}


def test_where_everything_is_forgotten_all_answers_are_the_same(model, kept, forgetful) -> None:
    for name, answer in ANSWERS.items():
        assert answer(model) == kept[name], name


def test_a_system_that_had_other_values_gives_the_same_rows(model) -> None:
    memory.forget()
    first = model.parameters[0]
    values = {first.name: 1.25 * float(np.ravel(first.value)[0])}
    table(model)
    after = table(other := lagcli.load(model.path, values))
    memory.forget()
    assert table(other) == after


def test_a_comparison_keeps_the_system_of_its_model_and_no_other() -> None:
    memory.forget()
    model = lagcli.load(MODELS / "pendulum-angle.yaml")
    found = lagcli.compare(model, duration=0.1, samples=3)
    assert "freed" in [one.name for one in found.formulations]
    assert list(cache._compiled._answers) == [(model.path, model.fingerprint)]


def test_an_error_is_located_in_the_file_that_was_asked_for(tmp_path) -> None:
    text = 'lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0]}}\nholonomic: {rod: "norm(a) = 2"}\n'
    path = tmp_path / "rod.yaml"
    path.write_text(text)
    for model in (lagcli.loads(text), lagcli.load(path)):
        with pytest.raises(lagcli.ModelError) as error:
            lagcli.simulate(model, duration=0.1)
        assert {found.location.path for found in error.value.diagnostics} == {model.path}
