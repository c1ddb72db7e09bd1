"""Rows too far apart for what turns with a coordinate, and tables in which all rests: right ones do not fail."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.auditing.checks.audit_report import Audit
from lagcli.auditing.evidence import row_spacing
from lagcli.running.trajectory import Trajectory

KNIFE = """
lagcli: 1
coordinates: {{x: {{value: 0, rate: 1}}, y: 0, ph: {{value: 0, rate: {rate}}}}}
lagrangian: "(rate(x)**2+rate(y)**2)/2 + 0.1*rate(ph)**2/2"
differential: {{a: "sin(ph)*d(x) = cos(ph)*d(y)"}}
simulation: {{duration: {duration}, samples: {samples}}}
"""
DISK = """
lagcli: 1
parameters: {{r: 0.5}}
coordinates: {{x: 0, y: 0, ph: {{value: 0, rate: 1}}, th: {{value: 0.4, rate: 2*pi}}}}
lagrangian: "(rate(x)**2+rate(y)**2)/2 + 0.1*(rate(ph)**2+rate(th)**2)/2"
differential: {{a: "d(x) = r*cos(th)*d(ph)", b: "d(y) = r*sin(th)*d(ph)"}}
simulation: {{duration: 10, samples: {samples}, assemble: true}}
"""
INERTIA = """
lagcli: 1
coordinates: {{x: {{value: 0, rate: 1}}, ph: {{value: 0.3, rate: 2*pi}}}}
lagrangian: "rate(x)**2/2 + 0.1*rate(ph)**2/2 + 0.1*cos(ph)*rate(ph)*rate(x)"
simulation: {{duration: 10, samples: {samples}}}
"""
STACK = """
lagcli: 1
parameters: {{N: {count}}}
particles:
  p[i]: {{for: "i = 1..N", mass: {mass}, position: [0, 0, "(i-1) + 0.5*i"]}}
forces:
  w: {{to: all, force: [0, 0, -9.81*m]}}
inequality:
  f: {{condition: "p[1].z >= 0", restitution: 0}}
  c[i]: {{for: "i = 2..N", condition: "p[i].z - p[i-1].z >= 1", restitution: 0}}
simulation: {{duration: 6, samples: 2}}
"""


def knife(turns: float, samples: int = 11) -> str:
    """A knife edge that turns so often from a row to the next."""
    return KNIFE.format(rate=2 * np.pi * turns, duration=samples - 1, samples=samples)


def fails(found: Audit) -> list[str]:
    return [check.name for check in found.checks if check.verdict == "fail"]


def audited(text: str) -> Audit:
    model = lagcli.loads(text)
    run = lagcli.simulate(model)
    return lagcli.audit(model, run, events=run.events if model.inequality else None)


@pytest.mark.parametrize(
    "text",
    [
        *(knife(turns) for turns in (0.5, 1.0, 2.0)),
        knife(1.0, samples=6),
        *(DISK.format(samples=samples) for samples in (6, 11)),
        *(INERTIA.format(samples=samples) for samples in (11, 21)),
    ],
)
def test_rows_at_whole_and_half_turns_are_not_judged(text: str) -> None:
    found = audited(text)
    assert not fails(found)
    assert found.check("path").verdict == "not judged"
    assert found.check("velocities").verdict in ("pass", "nothing")


def test_rows_close_together_are_judged_and_an_error_is_found() -> None:
    model = lagcli.loads(knife(1 / 24, samples=121))
    run = lagcli.simulate(model)
    assert lagcli.audit(model, run).check("path").verdict == "pass"
    rows = np.array(run.rows)
    rows[40:, run.columns.index("x")] += 1e-5
    changed = Trajectory(run.columns, rows, run.stats)
    assert {"path", "rates"} <= set(fails(lagcli.audit(model, changed)))


@pytest.mark.parametrize(("radians", "verdict"), [(0.5, "pass"), (1.5, "not judged")])
def test_what_turns_by_a_radian_from_row_to_row_is_too_far_apart(radians: float, verdict: str) -> None:
    found = audited(knife(radians / (2 * np.pi), samples=61))
    assert found.check("path").verdict == verdict


def test_no_number_of_whole_turns_between_rows_hides() -> None:
    """The instants within a step, for one to fifty turns of a cosine that begins at its largest."""
    parts = np.modf(row_spacing.GOLDEN * np.arange(1, row_spacing.BETWEEN + 1) ** 2)[0]
    for turns in range(1, 51):
        assert np.abs(np.cos(2 * np.pi * turns * parts) - 1).max(initial=0.0) > 0.8, turns


@pytest.mark.parametrize("count", [5, 10])
@pytest.mark.parametrize("mass", [1, 1e6])
def test_a_stack_at_rest_in_two_rows_passes(count: int, mass: float) -> None:
    assert not fails(audited(STACK.format(count=count, mass=mass)))


def test_a_push_that_is_wrong_at_rest_fails() -> None:
    model = lagcli.loads(STACK.format(count=3, mass=1))
    run = lagcli.simulate(model)
    rows = np.array(run.rows)
    rows[-1, run.columns.index("lambda.f")] *= 1 + 1e-6
    found = lagcli.audit(model, Trajectory(run.columns, rows, run.stats), events=run.events)
    assert "reactions" in fails(found)
