"""The seam for events: a run asks one registry, before each step and after it."""

from __future__ import annotations

from typing import Self

import pytest

import lagcli
from lagcli.simulation import loop
from lagcli.simulation.events import events_of_run
from lagcli.simulation.events.event import Event
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper

MODEL = """\
lagcli: 1
coordinates: {x: {value: 1}}
lagrangian: rate(x)**2/2 - x**2/2
forces: {push: {to: x, force: PUSH}}
simulation: {duration: 4, samples: 5}
"""


class Watched(Event):
    """Counts what it is asked, and stops a run at t = 2."""

    asked: list[str]

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper

    @classmethod
    def of(cls, stepper: Stepper) -> Self:
        cls.asked = []
        return cls(stepper)

    def passes(self) -> None:
        self.asked.append("passes")

    def found(self, step: FoundStep) -> None:
        assert step is self._stepper.found
        self.asked.append("still" if step.is_still else "cut")
        if step.reached >= 2:
            raise StepFailure("a wall is there", "singular")


def test_an_event_of_the_registry_is_asked_before_and_after_each_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plain = events_of_run.found
    monkeypatch.setattr(events_of_run, "found", lambda stepper: (*plain(stepper), Watched.of(stepper)))
    with pytest.raises(lagcli.SimulationStopped, match="a wall is there") as caught:
        lagcli.simulate(lagcli.loads(MODEL.replace("PUSH", "0")), max_step=0.25)
    assert caught.value.trajectory["t"][-1] < 2
    assert Watched.asked == ["passes", "cut"] * (len(Watched.asked) // 2)
    assert len(Watched.asked) >= 16


def test_a_step_that_an_event_finds_is_shown_to_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """A switch of t is passed by an event before it, and the step stands still."""
    plain = events_of_run.found
    monkeypatch.setattr(events_of_run, "found", lambda stepper: (*plain(stepper), Watched.of(stepper)))
    with pytest.raises(lagcli.SimulationStopped, match="a wall is there"):
        lagcli.simulate(lagcli.loads(MODEL.replace("PUSH", "sign(t - 1.1)")), max_step=0.25)
    at = Watched.asked.index("still")
    assert Watched.asked[at - 1] == "cut"
    assert Watched.asked.count("still") == 1


def test_what_cannot_occur_is_not_asked() -> None:
    """A run without functions of t, and without what may jump, has only singular configurations before it."""
    kinds: list[str] = []
    plain = loop.Run.__init__

    def init(self: loop.Run, *arguments: object) -> None:
        plain(self, *arguments)  # type: ignore[arg-type]
        kinds.append(" ".join(type(event).__name__ for event in self._events))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop.Run, "__init__", init)
        lagcli.simulate(lagcli.loads(MODEL.replace("PUSH", "0")))
        lagcli.simulate(lagcli.loads(MODEL.replace("PUSH", "sign(t - 1.1)")))
        lagcli.simulate(lagcli.loads(MODEL.replace("PUSH", "0").replace("x**2/2\n", "atan(1/(x + 5))\n")))
    assert kinds == ["SingularEvent", "SwitchEvent SingularEvent", "SingularEvent ImpulseEvent"]
