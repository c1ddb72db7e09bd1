"""The judges of one-sided motions: they pass what is right, and find faults that are put in."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from tests.helpers import free_flight, motion_legs, one_sided_models
from tests.helpers.motion_legs import Instant, Recorded
from tests.helpers.one_sided_models import Contact, Floats, Scene

SCENES = [seed for seed in range(40) if not one_sided_models.scene(seed).rods]


@functools.cache
def flown(seed: int) -> Recorded:
    """The closed form of a scene, as a run."""
    scene = one_sided_models.scene(seed)
    answer = free_flight.solve(scene)
    starts = {leg[0]: leg for leg in answer.legs}

    def instant(t: float, kind: str, impulses: dict[str, float], names: tuple[str, ...]) -> Instant:
        began, _, v, a = [leg for leg in answer.legs if leg[0] < t][-1]
        after = starts[t]
        return Instant(t, tuple((kind, n) for n in names), impulses, after[1], v + (t - began) * a, after[2])

    instants = [
        instant(blow.t, "impact", blow.impulses, tuple(blow.impulses))
        for blow in answer.blows
        if blow.t in starts
    ]
    instants += [instant(t, "contact", {}, (name,)) for t, name in answer.rests]
    t = np.linspace(0, answer.until, 21)
    x, v = (np.array(part) for part in zip(*map(answer.at, t), strict=True))
    energy = (scene.m[:, None] * (v**2 / 2 - x * scene.weight)).sum((1, 2))
    still = {c.name: np.zeros(len(t)) for c in scene.contacts}
    return Recorded(sorted(instants, key=lambda at: at.t), t, x, v, still, energy)


@pytest.mark.parametrize("seed", SCENES)
def test_parabolas_and_impacts_of_the_closed_form_pass_the_other_judge(seed: int) -> None:
    run = flown(seed)
    if run.t[-1] > 0:
        assert motion_legs.faults(one_sided_models.scene(seed), run) == []


FREE = next(s for s in SCENES if len(flown(s).instants) > 4 and not one_sided_models.scene(s).moves)
SCENE = one_sided_models.scene(FREE)


def with_instant(run: Recorded, k: int, **changes: object) -> Recorded:
    instants = list(run.instants)
    instants[k] = dataclasses.replace(instants[k], **changes)  # type: ignore[arg-type]
    return dataclasses.replace(run, instants=instants)


def spoilt(kind: str) -> Recorded:
    run = flown(FREE)
    at = run.instants[1]
    if kind == "missed":
        return dataclasses.replace(run, instants=[run.instants[0], *run.instants[2:]])
    if kind == "late":
        return with_instant(run, 1, t=at.t + 1e-4)
    if kind == "impulse":
        return with_instant(run, 1, impulses={name: 1.001 * P for name, P in at.impulses.items()})
    if kind == "restitution":
        return with_instant(run, 1, after=1.01 * at.after)
    if kind == "energy":
        energy = run.energy.copy()
        energy[10] += 1e-5
        return dataclasses.replace(run, energy=energy)
    if kind == "row":
        x = run.x.copy()
        x[10] += 3.0
        return dataclasses.replace(run, x=x)
    pull = run.multipliers | {SCENE.contacts[0].name: -np.full(len(run.t), 1e-3)}
    return dataclasses.replace(run, multipliers=pull)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("missed", "leg"),
        ("late", "leg"),
        ("impulse", "momenta"),
        ("restitution", "momenta"),
        ("energy", "energy grows"),
        ("row", "penetration"),
        ("pull", "pull"),
    ],
)
def test_faults_that_are_put_in_are_found(kind: str, said: str) -> None:
    assert any(said in fault for fault in motion_legs.faults(SCENE, spoilt(kind)))


def ball(e: float, weight: float = -10.0, height: float = 0.8) -> Scene:
    floor = Contact("floor", (0,), 0.0, e, (0.0, 0.0, 1.0))
    x = np.array([[0.0, 0.0, height]])
    return Scene("ball", np.ones(1), x, np.zeros((1, 3)), np.array([0.0, 0.0, weight]), (floor,), (), 5.0)


def test_series_of_rebounds_ends_where_theory_says() -> None:
    answer = free_flight.solve(ball(0.5))
    assert answer.blows[0].t == pytest.approx(0.4, rel=1e-14)
    ((t, name),) = answer.rests
    assert (t, name) == (pytest.approx(1.2, rel=1e-9), "floor")
    x, v = answer.at(5.0)
    assert np.abs(np.concatenate([x, v])).max() < 1e-14


def test_two_spheres_exchange_their_velocities() -> None:
    x = np.array([[0.0, 0, 0], [2.0, 0, 0]])
    v = np.array([[1.0, 0, 0], [0.0, 0, 0]])
    contact = Contact("ab", (0, 1), 0.5, 1.0)
    answer = free_flight.solve(Scene("two", np.ones(2), x, v, np.zeros(3), (contact,), (), 3.0))
    assert answer.blows == [free_flight.Blow(pytest.approx(1.5), {"ab": pytest.approx(1.0)})]
    assert answer.at(3.0)[1][:, 0] == pytest.approx([0.0, 1.0])


def test_gradients_and_rates_are_those_of_differences() -> None:
    random = np.random.default_rng(0)
    for seed in range(30):
        for c in one_sided_models.scene(seed).contacts:
            x, v, t, h = random.normal(size=(4, 3)), random.normal(size=(4, 3)), 0.3, 1e-4

            def gap(s: float, c: Contact = c, x: Floats = x, v: Floats = v) -> float:
                return c.gap(0.3 + s, x + s * v)

            G, g_t = c.slope(t, x)
            assert (gap(h) - gap(-h)) / 2 / h == pytest.approx((G * v).sum() + g_t, abs=1e-5)
            assert (gap(h) - 2 * gap(0) + gap(-h)) / h**2 == pytest.approx(c.bend(t, x, v), abs=1e-4)
