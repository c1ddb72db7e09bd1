"""Sweeps that keep first and last rows alone make no others; what they keep is that of `simulate` all the same."""

import pytest

import lagcli
from lagcli.api import cache, reductions
from lagcli.equations import operation_rules
from lagcli.simulation.row_writer import RowWriter

THROWN = """lagcli: 1
parameters: {k: 2, e: 0.5}
particles:
  a: {mass: 1, position: [0, 0, 1], velocity: [1, 0, 0]}
  b: {mass: 2, position: [0, 0, 2], velocity: [0.5, 0, 0]}
forces:
  weight: {to: all, force: [0, 0, -9.81*m]}
  push: {to: a, force: [k*cos(3*t), 0, 0]}
holonomic: {rod: "distance(a, b) = 1"}
inequality: {floor: {condition: a.z >= 0, restitution: e}}
outputs: {far: norm(a), pull: multiplier(rod)}
EXTRA
simulation: {duration: 1.2, samples: 301}
"""
STOPPED = """lagcli: 1
parameters: {k: 1}
particles: {a: {mass: 1, position: [0, -1, 0], velocity: [k, 0, 0]}}
holonomic: {circle: a.x**2 + a.y**2 = 1, flat: a.z = 0, wall: "a.x*(a.x**2 + a.y**2 - 1) = 0"}
forces: {on: {to: a, force: [0, "1/sqrt(1 - 2*t)", 0]}}
simulation: {duration: 1, samples: 101}
"""


def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The rows of blocks that are handed out from here on."""
    counts: list[int] = []
    close = RowWriter.close

    def counted(self: RowWriter):
        block = close(self)
        counts.append(len(block))
        return block

    monkeypatch.setattr(RowWriter, "close", counted)
    return counts


@pytest.mark.parametrize(
    "extra",
    ["", 'events: {low: {when: "b.z - 0.8", action: stop}}', 'events: {swings: {when: "b.x - a.x"}}'],
)
def test_rows_that_nobody_needs_are_not_made_and_the_last_is_the_same(monkeypatch, extra):
    text = THROWN.replace("EXTRA", extra)
    run = lagcli.simulate(lagcli.loads(text))
    counts = made(monkeypatch)
    (row,) = lagcli.sweep(lagcli.loads(text), {"k": [2]}).to_dict("records")
    assert sum(counts) == 2
    assert {name: row[name] for name in run.columns[1:]} == {name: run[name][-1] for name in run.columns[1:]}
    assert (row["status"], row["t_end"]) == (0, run.t[-1])
    kept = {"peak": "max(a.z)", "end": "last(abs(a.x)) - first(a.x)"}
    (row,) = lagcli.sweep(lagcli.loads(text), {"k": [2]}, reduce=kept).to_dict("records")
    assert sum(counts) == 2 + len(run.t)
    assert row["peak"] == run["a.z"].max()
    assert row["end"] == abs(run["a.x"][-1]) - run["a.x"][0]


def test_a_run_that_stops_has_the_time_of_its_last_row(monkeypatch):
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        lagcli.simulate(lagcli.loads(STOPPED))
    (row,) = lagcli.sweep(lagcli.loads(STOPPED), {"k": [1]}).to_dict("records")
    assert row["status"] == 3
    assert row["t_end"] == stopped.value.trajectory.t[-1]
    assert row["message"] == stopped.value.reason


def test_a_row_that_ends_a_run_is_made():
    """log(a.z) has no value below the floor that is not there: `simulate` ends at that row, and so does a point."""
    text = THROWN.replace("inequality: {floor: {condition: a.z >= 0, restitution: e}}\n", "")
    text = text.replace("far: norm(a)", "far: log(a.z)").replace("EXTRA", "")
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        lagcli.simulate(lagcli.loads(text))
    (row,) = lagcli.sweep(lagcli.loads(text), {"k": [2]}).to_dict("records")
    assert (row["status"], row["t_end"]) == (3, stopped.value.trajectory.t[-1])
    assert row["message"] == stopped.value.reason


@pytest.mark.parametrize(
    ("output", "is_total"),
    [
        ("a.x**2 + 3*b.z", True),
        ("norm(a - b)", True),
        ("sin(a.x)/k", True),
        ("sqrt(k)*a.ax", True),
        ("1/a.x", False),
        ("log(a.x)", False),
        ("sqrt(a.x)", False),
        ("sqrt(norm(a) - 1)", False),
        ("a.x**k", False),
        ("exp(a.x)", False),
        ("asin(a.x)", False),
        ("norm(a)/norm(b)", False),
    ],
)
def test_what_has_a_value_at_any_state_is_known(output, is_total):
    text = THROWN.replace("far: norm(a)", f"far: {output}").replace("EXTRA", "")
    if output == "a.x**k":
        text = text.replace("k: 2", "k: 0.5")
    assert operation_rules.has_total_columns(cache.compiled(lagcli.loads(text)).system) is is_total


@pytest.mark.parametrize(
    ("text", "are"),
    [
        ("last(a.x)", True), ("first(a.x) - last(abs(b.z))", True), ("max(last(a.x), 1)", False),
        ("last(max(a.x))", False), ("argmax(a.x)", False), ("integral(a.x)", False), ("rms( a.x )", False),
    ],
)  # fmt: skip
def test_reductions_of_first_and_last_rows_are_known(text, are):
    assert reductions.are_of_ends(reductions.read([f"end={text}"])) is are
    assert reductions.are_of_ends(reductions.of_last_row(("t", "a.x")))
