"""Answers that are kept for the next who asks: the same ones, refusals too, and of the same question alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import lagcli
from lagcli import memory
from lagcli.analysis.classification import classify
from lagcli.memory import Memory
from lagcli.start import assembly

ROOT = Path(lagcli.__file__).parent.parent
APART = """
lagcli: 1
coordinates: {x: {}}
lagrangian: rate(x)**2
holonomic: {row: x**2 + 1 = 0}
"""


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Grows by one entry with each search for a start and each classification."""
    made: list[str] = []

    def counted(name: str, work: Callable[..., object]) -> Callable[..., object]:
        def counting(*given: object) -> object:
            made.append(name)
            return work(*given)

        return counting

    for module, name in ((assembly, "_assembled"), (classify, "_classified")):
        monkeypatch.setattr(module, name, counted(name, getattr(module, name)))
    memory.forget()
    return made


def refusal(question: object, *given: object, **named: object) -> list[tuple[str, str]]:
    with pytest.raises(lagcli.ModelError) as refused:
        question(*given, **named)  # type: ignore[operator]
    return [(one.code, one.message) for one in refused.value.diagnostics]


def test_a_search_in_vain_is_made_once_and_reported_each_time(searches: list[str]) -> None:
    found = refusal(lagcli.dof, lagcli.loads(APART))
    assert searches.count("_assembled") == 1
    assert refusal(lagcli.check, lagcli.loads(APART)) == found
    assert found[0] in refusal(lagcli.simulate, lagcli.loads(APART), duration=1.0)
    # Another duration is another question: conflicts are looked for later in time too.
    assert searches.count("_assembled") == 2
    memory.forget()
    assert refusal(lagcli.check, lagcli.loads(APART)) == found


@pytest.mark.parametrize("name", ["knife-edge", "rolling-disk", "hoop-on-ramp"])
def test_what_is_known_is_what_would_be_found(name: str, searches: list[str]) -> None:
    path = ROOT / "models" / f"{name}.yaml"
    count = lagcli.dof(path).as_json()
    report = lagcli.check(path).as_json()
    run = lagcli.simulate(path, duration=0.1, samples=3)
    assert searches.count("_assembled") == 2  # the run is shorter than that of the file
    for question, known in ((lagcli.check, report), (lagcli.dof, count)):
        memory.forget()
        assert question(path).as_json() == known
    memory.forget()
    assert lagcli.simulate(path, duration=0.1, samples=3).rows.tobytes() == run.rows.tobytes()


def test_other_values_are_another_question(searches: list[str]) -> None:
    text = (ROOT / "models" / "pendulum.yaml").read_text(encoding="utf-8")
    for changes in ({}, {"L": 2.0, "theta0": 0.5}, {}):
        model = lagcli.loads(text, changes)
        report = lagcli.check(model)
        assert report.initial.consistent
    assert searches.count("_classified") == 2


def test_the_last_answers_are_kept() -> None:
    few = Memory(2)
    for question in "aba":
        assert few.answer(question, lambda asked=question: asked) == question
    few.keep("c", None)
    assert (few.known("a"), few.known("b")) == ("a", None)


def test_nothing_is_an_answer() -> None:
    asked: list[int] = []
    nothing = Memory()
    for _ in range(2):
        assert nothing.answer("the same", lambda: asked.append(1)) is None
    assert asked == [1]


def test_what_is_no_refusal_is_not_kept() -> None:
    recent = Memory()
    with pytest.raises(ZeroDivisionError):
        recent.answer("the same", lambda: 1 / 0, (lagcli.ModelError,))
    assert recent.known("the same") is None


def test_all_memories_are_emptied() -> None:
    asked: list[int] = []

    @memory.remembered()
    def remembering(question: int) -> int:
        asked.append(question)
        return question

    kept = Memory()
    kept.keep("the same", 1)
    for _ in range(2):
        assert remembering(3) == 3
    memory.forget()
    assert remembering(3) == 3
    assert asked == [3, 3]
    assert kept.known("the same") is None
    kept.keep("the same", 2)
    assert kept.known("the same") == 2
