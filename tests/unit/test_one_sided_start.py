"""The start of a model with one-sided constraints: open, closed or violated; refused, warned of, and moved out."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.analysis.check_report import Report
from lagcli.api import cache
from lagcli.cli.commands import check_command
from lagcli.errors import diagnostics
from lagcli.smoothness import time_functions
from lagcli.start import assembly, gaps, initial

BALL = """lagcli: 1
parameters: {x: 0, y: 0, z: 1}
particles:
  a: {mass: 1, position: [x, y, z], velocity: [0, 0, -1]}
forces:
  weight: {to: a, force: [0, 0, -9.81*m]}
"""
BOX = "inequality:\n  floor: a.z >= 0\n  lid: {condition: 2*a.z <= 4, restitution: 0.5}\n"


def checked(text: str, **changes: object) -> Report:
    return lagcli.check(lagcli.loads(text, changes))


def sides(text: str, **changes: object) -> list[str | None]:
    return [one.side for one in checked(text, **changes).constraints]


def refused(text: str, **changes: object) -> tuple[diagnostics.Diagnostic, ...]:
    with pytest.raises(diagnostics.ModelError) as caught:
        lagcli.simulate(lagcli.loads(text, changes), duration=0.01, samples=2)
    return caught.value.diagnostics


def assembled(text: str, *keep: str, **changes: object) -> assembly.Assembly:
    ready = cache.compiled(lagcli.loads(text, changes))
    return assembly.assemble(
        ready.system, ready.numeric, initial.declared(ready.system), keep, one_sided=True
    )


@pytest.mark.parametrize(
    ("z", "expected"),
    [
        (1, ["open", "open"]),
        (0, ["closed", "open"]),
        (2, ["open", "closed"]),
        (-0.5, ["violated", "open"]),
        (2.5, ["open", "violated"]),
        # Decimals explain as much as they do of a violated equation.
        (2 + 1e-10, ["open", "closed"]),
        (2 + 1e-7, ["open", "violated"]),
    ],
)
def test_check_says_on_which_side_the_start_is(z: float, expected: list[str]) -> None:
    assert sides(BALL + BOX, z=z) == expected


def test_check_lists_inequalities_after_the_equations_and_dof_does_not_count_them() -> None:
    model = lagcli.loads(BALL + BOX + "holonomic:\n  wire: a.x = 0\n")
    report = lagcli.check(model).as_json()
    assert [(c["name"], c["declared"], c["verdict"], c.get("state")) for c in report["constraints"]] == [
        ("wire", "holonomic", "holonomic", None),
        ("floor", "inequality", "inequality", "open"),
        ("lid", "inequality", "inequality", "open"),
    ]
    assert "state" not in report["constraints"][0]
    assert report["constraints"][1]["redundant"] is False
    count = lagcli.dof(model)
    assert (count.holonomic, count.configuration_dof) == (1, 2)


def test_the_text_shows_the_side(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    check_command.print_report(checked(BALL + BOX, z=-1), heading=False)
    lines = capsys.readouterr().out.splitlines()
    assert next(line.split() for line in lines if line.startswith("floor")) == [
        "floor",
        *["inequality"] * 2,
        "violated",
    ]
    monkeypatch.setenv("COLUMNS", "50")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    check_command.print_report(checked(BALL + BOX, z=0), heading=False)
    assert "floor: inequality, closed at the start" in capsys.readouterr().out


def test_check_warns_of_a_start_on_the_forbidden_side_and_simulate_refuses_it_with_the_depth() -> None:
    report = checked(BALL + BOX, z=2.25)
    (warning,) = report.warnings
    assert (warning.code, warning.severity, warning.location.line) == ("start-penetrates", "warning", 9)
    assert (report.initial.consistent, report.initial.position_residual) == (False, 0.5)
    (error,) = refused(BALL + BOX, z=2.25)
    assert (error.code, error.severity) == ("start-penetrates", "error")
    # As the condition is written, and as a way.
    assert "`lid` by 0.5 (0.25 m per unit of its gradient)" in error.message
    (error,) = refused(BALL + BOX, z=-0.25)
    assert "`floor` by 0.25 m" in error.message


def test_a_family_is_told_by_some_members_and_the_worst_of_the_rest() -> None:
    text = """lagcli: 1
particles:
  p[i]: {for: "i = 1..30", mass: 1, position: "[0, 0, -i]"}
inequality:
  floor[i]: {for: "i = 1..30", condition: "p[i].z >= 0"}
"""
    found = refused(text)
    assert len(found) == initial.PARAMETERS.most_listed + 1
    assert "`floor[1]` by 1 m" in found[0].message
    assert "10 more rows" in found[-1].message
    assert "`floor[30]` by 30 m" in found[-1].message


def test_a_gap_that_has_no_value_is_refused_where_it_stands() -> None:
    with pytest.raises(diagnostics.ModelError) as caught:
        checked(BALL + "inequality:\n  bowl: log(a.x) <= 1\n")
    (error,) = caught.value.diagnostics
    assert (error.code, error.location.line) == ("not-finite-at-start", 8)


def test_a_gap_without_a_gradient_at_the_start_has_a_side() -> None:
    rope = "inequality:\n  rope: norm(a) <= 1\n  ball: norm(a - [0, 0, 1]) >= 0.5\n"
    assert sides(BALL + rope, z=0) == ["open", "open"]
    assert sides(BALL + rope) == ["closed", "violated"]


def test_gaps_that_decimals_put_below_zero_begin_at_zero() -> None:
    text = BALL + "inequality:\n  rope: norm(a) <= 1\n"
    ready = cache.compiled(lagcli.loads(text, {"x": "0.6", "z": 0.8 + 1e-11}))
    start = initial.declared(ready.system)
    assert gaps.at_state(ready.system, ready.numeric, start).g[0] < -1e-12
    moved = gaps.settled(ready.system, ready.numeric, start)
    assert abs(gaps.at_state(ready.system, ready.numeric, moved).g[0]) < 1e-15
    assert np.abs(moved.q - start.q).max() < 1e-11


@pytest.mark.parametrize(
    ("inequalities", "start", "nearest"),
    [
        ("f: a.z >= 0", (0.3, 0, -0.5), (0.3, 0, 0)),
        ("f: norm(a) <= 1", (3, 0, 4), (0.6, 0, 0.8)),
        ("f: norm(a) >= 5", (1.5, 0, 2), (3, 0, 4)),
        # Both are violated, and only one of them is in the way of the nearest point.
        ("f: a.x + a.z >= 0\n  g: a.x >= 0", (-1, 0, 0.1), (0, 0, 0.1)),
        # One is violated, and the way out of it leads into the other.
        ("f: a.x >= a.z\n  g: a.x <= 0", (-1, 0, 3), (0, 0, 0)),
        ("f: a.x >= 0\n  g: a.y >= 0\n  h: a.z >= 0\n  s: norm(a) <= 1", (3, -1, 4), (0.6, 0, 0.8)),
    ],
)
def test_assembly_moves_to_the_nearest_allowed_configuration(
    inequalities: str, start: tuple[float, ...], nearest: tuple[float, ...]
) -> None:
    found = assembled(f"{BALL}inequality:\n  {inequalities}\n", **dict(zip("xyz", start, strict=True)))
    assert found.state.q == pytest.approx(nearest, abs=1e-9)
    assert found.moved == pytest.approx(float(np.linalg.norm(np.subtract(nearest, start))))
    # A gap that closes does so by an impact.
    assert found.state.v.tolist() == [0, 0, -1]


def test_assembly_takes_equations_and_inequalities_together() -> None:
    text = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0.1]}
  b: {mass: 3, position: [1.5, 0, -0.5]}
holonomic: {rod: "distance(a, b) = 1"}
inequality:
  one: a.z >= 0
  two: b.z >= 0
"""
    found = assembled(text).state.q
    assert np.linalg.norm(found[:3] - found[3:]) == pytest.approx(1, abs=1e-12)
    assert found[5] == pytest.approx(0, abs=1e-12)
    # Lagrange: the lighter end has gone three times as far as the other along the floor.
    assert found[0] - 0 == pytest.approx(3 * (1.5 - found[3]))
    kept = assembled(text, "a").state.q
    assert kept == pytest.approx([0, 0, 0.1, np.sqrt(0.99), 0, 0], abs=1e-9)


def test_overlapping_balls_are_moved_apart_even_where_they_coincide() -> None:
    text = """lagcli: 1
particles:
  p[i]: {for: "i = 1..4", mass: 1, position: "[0.3*min(i, 3), 0, 1]"}
inequality:
  gap[i][j]: {for: ["i = 1..4", "j = i+1..4"], condition: "distance(p[i], p[j]) >= 0.5"}
"""
    q = assembled(text).state.q.reshape(4, 3)
    distances = [np.linalg.norm(q[i] - q[j]) for i in range(4) for j in range(i)]
    assert min(distances) > 0.5 - 1e-9
    assert np.abs(q - [[0.3 * min(i, 3), 0, 1] for i in range(1, 5)]).max() < 0.6


def test_contradictory_conditions_are_named_where_no_configuration_is_found() -> None:
    with pytest.raises(diagnostics.ModelError) as caught:
        assembled(BALL + "inequality:\n  f: a.z >= 1\n  g: a.z <= 0.5\n")
    (error,) = caught.value.diagnostics
    assert error.code == "no-consistent-start"


def test_a_count_needs_no_allowed_start() -> None:
    text = BALL + "inequality:\n  f: a.z >= 2\n  g: a.z <= 0.5\nholonomic:\n  rod: norm(a) = 1.1\n"
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 2
    assert sides(text) == [None, "violated", "violated"]


def test_check_looks_at_the_assembled_start() -> None:
    report = lagcli.check(lagcli.loads(BALL + BOX, {"z": -1}), assemble=True)
    assert [one.side for one in report.constraints] == ["closed", "open"]
    assert report.initial.assembled is not None
    assert report.initial.position_residual == 1
    assert report.warnings == ()


def test_steps_end_where_a_wall_begins_to_move() -> None:
    model = lagcli.loads(BALL + "inequality:\n  floor: a.z >= max(0, t - 0.1)\n")
    times = time_functions.functions(model)
    assert times is not None
    assert time_functions.functions(lagcli.loads(BALL + BOX)) is None


def test_check_warns_of_an_angle_that_jumps_in_a_condition() -> None:
    report = checked(BALL + "inequality:\n  fan: atan2(a.y, a.x - 1) <= 1\n", x=2)
    (warning,) = report.warnings
    assert (warning.code, warning.location.line) == ("branch-cut", 8)
    assert "`fan`" in warning.message


@pytest.mark.parametrize(
    ("condition", "word"),
    [
        ("a.z >= 0.2*sign(a.x - 1.5)", "`sign` switches"),
        ("a.z*(1 + sign(a.y)) + 1 >= 0", "`sign` switches"),
        ("a.z + 0.1*abs(a.x)/a.x + 3 >= 0", "divisor"),
        ("a.z + a.x*sign(a.x) >= 0", ""),
        ("max(abs(a.x), a.z) >= 0", ""),
        ("a.z + tanh(a.x/0.01) + 3 >= 0", ""),
    ],
)
def test_check_warns_of_a_condition_that_jumps(condition: str, word: str) -> None:
    found = checked(BALL + f"inequality:\n  step: {condition}\n", x=2).warnings
    assert [(w.code, w.location.line) for w in found] == ([("condition-jumps", 8)] if word else [])
    assert not found or ("`step`" in found[0].message and word in found[0].message)
