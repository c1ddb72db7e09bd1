"""Answers that are kept for the next who asks: the same ones, refusals too, and of the same question alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import lagcli
from lagcli.analysis.classification import classify
from lagcli.api.models import cache
from lagcli.compiled.recent_answers import RecentAnswers
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
    cache.forget()
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
    cache.forget()
    assert refusal(lagcli.check, lagcli.loads(APART)) == found


@pytest.mark.parametrize("name", ["knife-edge", "rolling-disk", "hoop-on-ramp"])
def test_what_is_known_is_what_would_be_found(name: str, searches: list[str]) -> None:
    path = ROOT / "models" / f"{name}.yaml"
    count = lagcli.dof(path).as_json()
    report = lagcli.check(path).as_json()
    run = lagcli.simulate(path, duration=0.1, samples=3)
    assert searches.count("_assembled") == 2  # the run is shorter than that of the file
    for question, known in ((lagcli.check, report), (lagcli.dof, count)):
        cache.forget()
        assert question(path).as_json() == known
    cache.forget()
    assert lagcli.simulate(path, duration=0.1, samples=3).rows.tobytes() == run.rows.tobytes()


def test_other_values_are_another_question(searches: list[str]) -> None:
    text = (ROOT / "models" / "pendulum.yaml").read_text(encoding="utf-8")
    for changes in ({}, {"L": 2.0, "theta0": 0.5}, {}):
        model = lagcli.loads(text, changes)
        report = lagcli.check(model)
        assert report.initial.consistent
    assert searches.count("_classified") == 2


def test_the_last_answers_are_kept() -> None:
    recent = RecentAnswers()
    for question in range(RecentAnswers.MOST):
        recent.keep(question, question)
    assert recent.answer(0, int) == 0
    recent.keep("one more", "another")
    assert 0 in recent
    assert 1 not in recent
    assert 2 in recent


def test_what_is_no_refusal_is_not_kept() -> None:
    recent = RecentAnswers()
    with pytest.raises(ZeroDivisionError), recent.refusals("the same"):
        recent.keep("the same", 1 / 0)
    assert "the same" not in recent
