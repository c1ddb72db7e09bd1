"""Tables that were rounded by hand, incidents that are there twice or as another kind, and runs without events."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.auditing.checks.audit_report import Audit
from lagcli.output.tables.incident_table import IncidentTable
from lagcli.running.trajectory import Trajectory
from tests.helpers.in_process import Command, command

__all__ = ["command"]

PENDULUM = """
lagcli: 1
particles: {a: {mass: 2, position: [0.6, 0, -0.8]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}}
holonomic: {rod: "norm(a) = 1", plane: "a.y = 0"}
simulation: {duration: 2, samples: 121}
"""
ROPE = """
lagcli: 1
particles: {a: {mass: 1, position: [0.3, 0, 0], velocity: [0.5, 0, 1]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}}
inequality: {rope: {condition: "norm(a) <= 1", restitution: 0.4}}
simulation: {duration: 3, samples: 601}
"""
SLEIGH = """
lagcli: 1
coordinates: {x: {value: 0, rate: 1}, y: 0, ph: {value: 0, rate: 0.4}}
lagrangian: "(rate(x)**2+rate(y)**2)/2 + 0.1*rate(ph)**2/2 - 0.3*y"
differential: {a: "sin(ph)*d(x) = cos(ph)*d(y)"}
inequality: {wall: {condition: "x <= 1", restitution: 0.5}}
simulation: {duration: 3, samples: 301}
"""
REBOUNDS = """
lagcli: 1
particles: {{a: {{mass: 1, position: [0.7, 0, -0.3], velocity: [0, 0, {vz}]}}}}
forces: {{w: {{to: all, force: [0, 0, -9.81*m]}}}}
holonomic: {{pl: "a.y = 0"}}
inequality: {{rope: {{condition: "norm(a) <= 1", restitution: 0.5}}}}
simulation: {{duration: 1, samples: 25, rtol: {rtol}, assemble: true}}
"""


def fails(found: Audit) -> list[str]:
    return [check.name for check in found.checks if check.verdict == "fail"]


def rounded(source: Path, target: Path, style: str) -> None:
    """The table with its numbers as a format writes them, as a spreadsheet does."""
    with source.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))

    def short(cell: str) -> str:
        try:
            return format(float(cell), style)
        except ValueError:
            return cell

    with target.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([rows[0], *([short(cell) for cell in row] for row in rows[1:])])


@pytest.mark.parametrize("style", [".15g", ".12g", ".10g", ".9g", ".8g", ".6g", ".9f", ".6f"])
@pytest.mark.parametrize("text", [PENDULUM, ROPE, SLEIGH], ids=["pendulum", "rope", "sleigh"])
def test_a_table_rounded_by_a_spreadsheet_is_judged_by_its_digits(
    command: Command, tmp_path: Path, text: str, style: str
) -> None:
    model, run, events = (tmp_path / name for name in ("m.yaml", "t.csv", "e.csv"))
    model.write_text(text, encoding="utf-8")
    has_events = "inequality" in text
    more = ["--events", str(events)] if has_events else []
    assert command("simulate", str(model), "-o", str(run), *more, "-q")[2] in (None, 0)
    for path in (run, events)[: 1 + has_events]:
        rounded(path, path, style)
    out, _, code = command("audit", str(model), "--run", str(run), *more, "--json")
    assert code in (None, 0), out
    written = json.loads(out)["written"]
    count = int(style[1:-1])
    if count >= 12:  # it passes as one with all digits, or weak impacts show how many there are
        assert written in (None, {"digits": count, "decimals": 0})
    else:
        assert written == {"digits": count * style.endswith("g"), "decimals": count * style.endswith("f")}
        word = "digits" if style.endswith("g") else "decimals"
        shown = command("audit", str(model), "--run", str(run), *more)[0]
        assert f"The table has {count} {word}: judged by them." in shown


def rounded_run(run: Trajectory, digits: int, column: str = "", units: float = 0.0) -> Trajectory:
    rows = np.vectorize(lambda x: float(f"{x:.{digits}g}"))(run.rows)
    if column:
        rows[60, run.columns.index(column)] += units * 10.0**-digits
    return Trajectory(run.columns, rows, run.stats)


@pytest.mark.parametrize("digits", [6, 8])
def test_a_digit_beyond_the_rounding_and_a_rounded_wrong_motion_fail(digits: int) -> None:
    model = lagcli.loads(PENDULUM)
    run = lagcli.simulate(model)
    assert not fails(lagcli.audit(model, rounded_run(run, digits)))
    assert "positions" in fails(lagcli.audit(model, rounded_run(run, digits, "a.x", 50.0)))
    other = lagcli.simulate(lagcli.loads(PENDULUM.replace("9.81", "9.815")))
    assert {"accelerations", "columns"} <= set(fails(lagcli.audit(model, rounded_run(other, digits))))


COORDINATES = """
lagcli: 1
coordinates: {{x: {{value: 0, rate: 1}}, z: {{value: 1}}}}
lagrangian: rate(x)**2/2 + rate(z)**2 - 9.81*2*z
inequality: {{floor: {{condition: z >= 0, restitution: 0.7}}}}
simulation: {{duration: 1.2, samples: {samples}}}
"""
BALL = """
lagcli: 1
particles: {{a: {{mass: 2, position: [0, 0, 1], velocity: [1, 0, 0]}}}}
forces: {{w: {{to: all, force: [0, 0, -9.81*m]}}}}
inequality: {{floor: {{condition: a.z >= 0, restitution: 0.8}}}}
simulation: {{duration: 1.5, samples: {samples}}}
"""


@pytest.mark.parametrize(("text", "samples"), [(COORDINATES, 2), (BALL, 2), (BALL, 3)])
def test_a_table_too_short_to_tell_its_digits_is_not_judged_within_them(text: str, samples: int) -> None:
    """A wrong number beyond the digits fails all the same."""
    model = lagcli.loads(text.format(samples=samples))
    run = lagcli.simulate(model)
    rows = rounded_run(run, 8).rows
    table = Trajectory(run.columns, rows, run.stats)
    found = lagcli.audit(model, table)
    assert found.check("columns").verdict == "not judged"
    assert "too few numbers" in found.check("columns").note
    assert found.passed
    assert "All checks passed." not in found.conclusion
    assert fails(lagcli.audit(model, changed(table, samples - 1, "energy", 1e-5))) == ["columns"]


@pytest.mark.parametrize("text", [COORDINATES, BALL])
def test_one_number_of_eight_digits_in_a_table_of_short_ones_fails(text: str) -> None:
    model = lagcli.loads(text.replace("9.81*2*z", "0*z").replace("-9.81*m", "0").format(samples=101))
    run = lagcli.simulate(model)
    assert lagcli.audit(model, run).passed
    assert not lagcli.audit(model, changed(run, 50, "energy", 1e-7)).passed


def test_rows_too_far_apart_around_impacts_are_not_judged_and_are_said_to_be() -> None:
    """A wrong row that nothing shows is never said to pass: the checks of the motion do not judge it."""
    model = lagcli.loads(COORDINATES.format(samples=11))
    run = lagcli.simulate(model)
    for table in (run, changed(run, 5, "x", 0.0, -1.0)):
        found = lagcli.audit(model, table, events=run.events)
        motion = ("steps", "rates", "newton", "energy", "flights")
        assert {found.check(name).verdict for name in motion} == {"not judged"}
        assert "almost nothing of the motion could be judged" in found.conclusion


def test_a_rope_without_events_passes() -> None:
    model = lagcli.loads(ROPE)
    assert not fails(lagcli.audit(model, lagcli.simulate(model), events=None))


@pytest.mark.parametrize(("vz", "rtol"), [(0.7921, 1e-6), (0.7921, 1e-4), (0.0967, 1e-4)])
@pytest.mark.parametrize("event_rows", [False, True])
def test_rebounds_near_their_accumulation_pass_at_a_wide_tolerance(
    vz: float, rtol: float, event_rows: bool
) -> None:
    model = lagcli.loads(REBOUNDS.format(vz=vz, rtol=rtol))
    run = lagcli.simulate(model, event_rows=event_rows)
    assert not fails(lagcli.audit(model, run, events=run.events))
    without = lagcli.audit(model, run)
    assert not fails(without)
    # Between the two rows of an instant there is no step.
    ((few, all_of_them),) = re.findall(r"(\d+) of (\d+) steps between rows", " ".join(without.notes))
    assert 0 < int(few) <= int(all_of_them) == np.count_nonzero(np.diff(run.t))


@pytest.mark.parametrize("text", [ROPE, SLEIGH], ids=["rope", "sleigh"])
def test_incidents_that_are_repeated_renamed_or_idle_fail(text: str) -> None:
    model = lagcli.loads(text)
    run = lagcli.simulate(model)
    e = run.events
    assert lagcli.audit(model, run, events=e).passed
    assert e.kinds[0] == "impact"
    twice = IncidentTable(
        e.columns, e.kinds[:1] + e.kinds, e.names[:1] + e.names, np.insert(e.numbers, 0, e.numbers[0], 0)
    )
    renamed = IncidentTable(e.columns, ("contact", *e.kinds[1:]), e.names, e.numbers)
    idle = np.zeros(e.numbers.shape[1])
    at = {name: k for k, name in enumerate(run.columns)}
    columns = [name for name in e.columns if name not in ("kind", "name")]
    for k, name in enumerate(columns):
        own = name.removeprefix("before.").removeprefix("after.")
        idle[k] = run.rows[3, at[own]] if own in at and not name.startswith("impulse.") else 0.0
    phantom = IncidentTable(
        e.columns, ("impact", *e.kinds), e.names[:1] + e.names, np.insert(e.numbers, 0, idle, 0)
    )
    for sabotaged in (twice, renamed, phantom):
        assert "recorded" in fails(lagcli.audit(model, run, events=sabotaged))


@pytest.mark.parametrize("number", [0, 3, 8, 12])
def test_an_impulse_that_is_off_by_a_millionth_of_itself_fails_however_weak_it_is(number: int) -> None:
    """The impacts of a series become weaker by 0.4; the tolerance of the first is not that of the last."""
    model = lagcli.loads(ROPE)
    run = lagcli.simulate(model)
    e, k = run.events, run.events.columns.index("impulse.rope") - 2
    numbers = e.numbers.copy()
    numbers[number, k] *= 1 + 1e-6
    assert e.kinds[number] == "impact"
    assert fails(lagcli.audit(model, run, events=IncidentTable(e.columns, e.kinds, e.names, numbers)))


BOX = """
lagcli: 1
particles: {a: {mass: 1, position: [0.3, 0.5, 0.4], velocity: [1.1, -0.7, 0.9]}}
inequality:
  left: {condition: a.x >= 0, restitution: 1}
  right: {condition: a.x <= 1, restitution: 1}
  front: {condition: a.y >= 0, restitution: 1}
  back: {condition: a.y <= 1.2, restitution: 1}
  bottom: {condition: a.z >= 0, restitution: 1}
  top: {condition: a.z <= 0.8, restitution: 1}
simulation: {duration: 10, samples: 201}
"""
FALL = """
lagcli: 1
particles: {{a: {{mass: {m}, position: [0, 0, 0], velocity: [2, 0, 10]}}}}
forces: {{w: {{to: a, force: [0, 0, -10*m]}}}}
holonomic: {{plane: "a.y = 0"}}
simulation: {{duration: 1, samples: {n}}}
"""
WALL = """
lagcli: 1
particles: {{a: {{mass: 3, position: {position}, velocity: {velocity}}}}}
forces: {{w: {{to: a, force: [0, 0, -9.81*m]}}}}
inequality: {{wall: "{wall}"}}
simulation: {{duration: 1.5, samples: {n}}}
"""


def changed(run: Trajectory, row: int | slice, column: str, value: float, factor: float = 1.0) -> Trajectory:
    rows = run.rows.copy()
    rows[row, run.columns.index(column)] *= factor
    rows[row, run.columns.index(column)] += value
    return Trajectory(run.columns, rows, run.stats)


def test_rows_between_impacts_are_judged_however_few_they_are() -> None:
    """No row of a stretch that differences are too wide for is wrong unseen; nor is an impact that was left out."""
    model = lagcli.loads(BOX)
    run = lagcli.simulate(model)
    e = run.events
    assert not fails(lagcli.audit(model, run, events=e))
    t = run.rows[:, 0]
    instants = np.concatenate([[-1.0], e.numbers[:, 0], [20.0]])
    stretches = np.searchsorted(instants, t)
    for k in range(2, len(t) - 2):
        rows = int((stretches == stretches[k]).sum())
        if len(set(stretches[k - 2 : k + 3])) == 1 and rows in (5, 6, 7, 9):
            assert fails(lagcli.audit(model, changed(run, k, "a.vx", 1e-6), events=e)), (k, rows)
            if rows == 7:
                break


@pytest.mark.parametrize("m", [2, 1e6])
@pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 7, 101])
def test_a_table_of_short_numbers_is_not_taken_for_rounded(m: float, n: int) -> None:
    """Numbers of a simple motion have few digits: right ones pass as they are, and wrong ones fail."""
    model = lagcli.loads(FALL.format(m=m, n=n))
    run = lagcli.simulate(model)
    right = lagcli.audit(model, run)
    assert right.passed
    assert right.written is None
    last = n - 1
    wrongs = (
        (last, "a.vz", 0.1, 1),
        (last, "a.z", 0, 1 + 1e-6),
        (0, "a.vz", 0, -1),
        (last, "R.a.z", 1e-3, 1),
    )
    for row, column, value, factor in wrongs[: None if n > 3 else 2]:  # so few rows hardly show a motion
        wrong = lagcli.audit(model, changed(run, row, column, value, factor))
        assert not wrong.passed, (column, wrong.written)


def test_a_wrong_row_of_short_numbers_is_no_rounding() -> None:
    model = lagcli.loads(FALL.format(m=2, n=101))
    run = lagcli.simulate(model)
    rows = np.round(run.rows, 6)  # as they are, but for the rounding of doubles
    run = Trajectory(run.columns, rows, run.stats)
    assert lagcli.audit(model, run).passed
    assert not lagcli.audit(model, changed(run, 50, "a.z", 1e-4)).passed


@pytest.mark.parametrize("style", [".6g", ".8g", ".9f"])
@pytest.mark.parametrize("which", ["rows", "events"])
def test_two_files_are_judged_each_by_its_own_digits(
    command: Command, tmp_path: Path, which: str, style: str
) -> None:
    model, run, events = (tmp_path / name for name in ("m.yaml", "t.csv", "e.csv"))
    model.write_text(ROPE, encoding="utf-8")
    more = ["--events", str(events)]
    assert command("simulate", str(model), "-o", str(run), *more, "-q")[2] in (None, 0)
    path = run if which == "rows" else events
    rounded(path, path, style)
    audit = ("audit", str(model), "--run", str(run), *more, "--json")
    out, _, code = command(*audit)
    found = json.loads(out)
    assert code in (None, 0), found["conclusion"]
    of_table, of_events = found["written"], found["written_events"]
    assert (of_table is None, of_events is None) == (which == "events", which == "rows")
    if which == "events":  # a row is as exact as it was
        table = list(csv.reader(run.read_text(encoding="utf-8").splitlines()))
        k = table[0].index("a.vx")
        table[300][k] = repr(float(table[300][k]) + 1e-8)
        with run.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(table)
        assert command(*audit)[2] == 1


@pytest.mark.parametrize(
    ("wall", "position", "velocity"),
    [
        ("a.z >= 2*max(0, t - 0.505)", "[0, 0, 0]", "[1, 0, 0]"),
        ("a.z >= 2*max(0, a.x - 0.505)", "[0, 0, 0]", "[1, 0, 0]"),
        ("a.z >= 0.3*abs(t - 0.5015) - 0.3*0.5015", "[0, 0, 0]", "[1, 0, -0.3]"),
        ("a.z >= -0.3*t + 0.6*max(0, t - 0.4) + 0.5*max(0, t - 0.9)", "[0, 0, 0]", "[1, 0, -0.3]"),
        ("norm(a) <= 1 - 0.2*max(0, t - 0.4)", "[0, 0, -1]", "[1.5, 0, 0]"),
        ("a.z >= -10*max(0, t - 1)**2", "[0, 0, 0]", "[1, 0, 0]"),
    ],
)
@pytest.mark.parametrize("n", [2, 4, 11, 26, 101])
def test_a_wall_whose_velocity_jumps_fails_no_right_table(
    wall: str, position: str, velocity: str, n: int
) -> None:
    """With rows at incidents and without, with the table of events and without it."""
    model = lagcli.loads(WALL.format(wall=wall, position=position, velocity=velocity, n=n))
    for event_rows in (False, True):
        run = lagcli.simulate(model, event_rows=event_rows)
        for events in (None, run.events):
            assert not fails(lagcli.audit(model, run, events=events)), (event_rows, events is None)


def test_a_row_a_rounding_before_an_impact_with_the_state_after_it_stands_behind_its_rows() -> None:
    model = lagcli.loads(
        """
lagcli: 1
particles: {a: {mass: 1, position: [-0.5, 0, 0], velocity: [1.5, 0, 0]}, b: {mass: 1, position: [0, 0, 0]}}
inequality: {hit: {condition: "b.x - a.x >= 0.05", restitution: 1}}
simulation: {duration: 0.6, samples: 25}
"""
    )
    run = lagcli.simulate(model, event_rows=True)
    v = run["a.vx"]
    assert (np.diff(v) != 0).sum() == 1
    assert not fails(lagcli.audit(model, run, events=run.events))
