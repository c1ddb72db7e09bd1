"""Holonomic rows that jump are told by `check` before a run gets there."""

import pytest

import lagcli

TEXT = """\
lagcli: 1
particles:
  a[i]: {for: "i = 1..3", mass: 1, position: [1.2*i, 0.3, 0]}
holonomic:
  step[i]: {for: "i = 1..3", equation: "ROW"}
simulation: {duration: 1, assemble: true}
"""


@pytest.mark.parametrize(
    ("row", "word"),
    [
        ("a[i].z = 0.2*sign(a[i].x - 1.5)", "`sign` switches"),
        ("a[i].z + 0.1*abs(a[i].x)/a[i].x = 0", "divisor"),
        ("a[i].z = a[i].x*sign(a[i].x)", ""),
        ("a[i].z = max(abs(a[i].x), a[i].y)", ""),
        ("a[i].z = tanh(a[i].x/0.01)", ""),
        ("norm(a[i]) = 2", ""),
    ],
)
def test_check_warns_once_of_a_family_of_rows_that_jump(row: str, word: str) -> None:
    report = lagcli.check(lagcli.loads(TEXT.replace("ROW", row)))
    found = [warning for warning in report.warnings if warning.code == "row-jumps"]
    assert [warning.location.line for warning in found] == ([5] if word else [])
    assert not found or ("the row `step[1]` jumps" in found[0].message and word in found[0].message)


def test_a_run_stops_where_the_row_that_was_warned_of_jumps() -> None:
    text = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0.5, 0, 0]}
holonomic:
  step: a.z = 0.1*sign(a.x - 1) + 0.1
forces:
  push: {to: a, force: [1, 0, 0]}
simulation: {duration: 2}
"""
    model = lagcli.loads(text)
    assert [warning.code for warning in lagcli.check(model).warnings] == ["row-jumps"]
    with pytest.raises(lagcli.SimulationStopped, match="`step` jumps"):
        lagcli.simulate(model)
