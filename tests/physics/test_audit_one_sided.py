"""The second opinion on runs with contacts and impacts: closed forms pass, faults that are put in are found."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import lagcli
from lagcli.auditing import all_checks
from lagcli.auditing.checks.audit_report import Audit
from lagcli.auditing.evidence.table_input import AuditedTable, EventTable, TableError
from lagcli.auditing.evidence.tolerances import Tolerance
from lagcli.running.trajectory import Trajectory
from tests.helpers import bouncing_ball
from tests.helpers.bouncing_ball import COLUMNS, EVENTS, MODEL, Ball, G, M
from tests.helpers.in_process import Command, command

__all__ = ["command"]

Floats = npt.NDArray[np.float64]
LAMBDA, Z, VZ, R_Z = (COLUMNS.index(name) for name in ("lambda.floor", "a.z", "a.vz", "R.a.z"))
MOTION = {
    "steps",
    "rates",
    "newton",
    "impulse",
    "dalembert",
    "energy",
    "flights",
    "balance",
    "jumps",
    "impacts",
}


def audited(found: Ball, told: bool = True, model: str = MODEL) -> Audit:
    names = ("floor",) * len(found.kinds)
    events = EventTable(tuple(found.kinds), names, EVENTS, found.incidents) if told else None
    table = AuditedTable(COLUMNS, found.rows, (), events)
    return all_checks.audit(lagcli.loads(model), table, Tolerance(1e-11, 1e-13))


def fails(found: Audit) -> set[str]:
    return {check.name for check in found.checks if check.verdict == "fail"}


def rebounds() -> Ball:
    return bouncing_ball.ball(np.linspace(0, 1.4, 281))


def to_rest() -> Ball:
    return bouncing_ball.ball(np.linspace(0, 5, 401))


@pytest.mark.parametrize("made", [rebounds, to_rest])
def test_a_ball_in_closed_form_passes(made: Callable[[], Ball]) -> None:
    found = audited(made())
    assert found.passed, fails(found)
    for name in ("gaps", "pushes", "complementarity", "contacts", "missed", *MOTION, "losses", "columns"):
        assert found.check(name).judged > 0.8 * found.check(name).entries, name
    assert dict(found.figures)["energy_lost_in_impacts"] == pytest.approx(
        -dict(found.figures)["energy_gained"], rel=1e-9
    )


def test_steps_with_incidents_are_left_out_and_counted() -> None:
    found = audited(rebounds())
    assert "2 of 280 steps between rows hold incidents" in found.notes[0]
    assert found.check("steps").entries - found.check("steps").judged <= 6 * 3


@pytest.mark.parametrize("made", [rebounds, to_rest])
def test_without_events_jumps_are_not_judged_and_not_failed(made: Callable[[], Ball]) -> None:
    found = audited(made(), told=False)
    assert found.passed, fails(found)
    assert "not judged without --events" in found.notes[0]
    assert found.check("newton").judged > 0
    assert found.check("steps").judged < found.check("steps").entries


def test_what_is_determined_is_reported_for_each_set_of_contacts() -> None:
    told = " ".join(audited(to_rest()).sentences)
    assert "with all contacts open, there are no rows" in told
    assert "while floor is closed, the one row leaves 2 of 3 directions free" in told


def wrong_sign(found: Ball) -> None:
    found.rows[-50:, LAMBDA] *= -1


def wrong_sign_with_its_reaction(found: Ball) -> None:
    found.rows[-50:, [LAMBDA, R_Z]] *= -1


def impulse_too_large(found: Ball) -> None:
    found.incidents[1, EVENTS.index("impulse.floor")] *= 1.01


def event_left_out(found: Ball) -> None:
    del found.kinds[1]
    found.incidents = np.delete(found.incidents, 1, axis=0)


def penetration(found: Ball) -> None:
    found.rows[-30, Z] = -1e-6


def energy_created(found: Ball) -> None:
    """An impact that gives back 1.1 of what it is met with, and the flight that follows from it."""
    found.incidents[1, EVENTS.index("after.a.vz")] *= 1.1 / bouncing_ball.E
    found.incidents[1, EVENTS.index("impulse.floor")] *= 2.1 / (1 + bouncing_ball.E)


def push_in_the_air(found: Ball) -> None:
    found.rows[20, [LAMBDA, R_Z]] = 0.5


def no_push_at_rest(found: Ball) -> None:
    found.rows[-20, [LAMBDA, R_Z]] = 0.0


def contact_without_an_incident(found: Ball) -> None:
    found.kinds[-2:] = ["event", "event"]


def event_late(found: Ball) -> None:
    found.incidents[1, 0] += 1e-6


def velocity_of_one_row(found: Ball) -> None:
    found.rows[45, VZ] += 1e-6


def rebounds_end_early(found: Ball) -> None:
    """At once after the second impact the ball is said to rest."""
    at = found.incidents[1, 0]
    rests = found.rows[:, 0] > at + 1e-3
    found.rows[np.ix_(rests, [Z, VZ])] = 0
    found.rows[np.ix_(rests, [LAMBDA, R_Z])] = M * G
    found.kinds = ["impact", "impact", "accumulation", "contact"]
    last = found.incidents[-1].copy()
    last[0] = at + 1e-3
    found.incidents = np.array([*found.incidents[:2], last, last])


FAULTS = [
    (to_rest, wrong_sign, {"pushes", "reactions"}),
    (to_rest, wrong_sign_with_its_reaction, {"pushes", "newton"}),
    (rebounds, impulse_too_large, {"jumps"}),
    (rebounds, event_left_out, {"steps"}),
    (to_rest, event_left_out, {"balance"}),
    (to_rest, penetration, {"gaps"}),
    (rebounds, energy_created, {"impacts", "losses", "flights", "balance"}),
    (rebounds, push_in_the_air, {"complementarity", "positions"}),
    (to_rest, no_push_at_rest, {"contacts"}),
    (to_rest, contact_without_an_incident, {"missed"}),
    (rebounds, event_late, {"flights"}),
    (rebounds, velocity_of_one_row, {"steps"}),
    (to_rest, rebounds_end_early, {"flights"}),
]


@pytest.mark.parametrize(("made", "fault", "seen"), FAULTS, ids=[fault.__name__ for _, fault, _ in FAULTS])
def test_faults_are_found(made: Callable[[], Ball], fault: Callable[[Ball], None], seen: set[str]) -> None:
    found = made()
    fault(found)
    judged = audited(found)
    assert seen <= fails(judged)
    assert judged.conclusion.endswith("the table is not a motion of this model.")


@pytest.mark.parametrize(
    "fault", [wrong_sign, penetration, push_in_the_air, no_push_at_rest, velocity_of_one_row]
)
def test_faults_of_rows_are_found_without_events(fault: Callable[[Ball], None]) -> None:
    found = to_rest() if fault in (wrong_sign, no_push_at_rest, penetration) else rebounds()
    fault(found)
    assert fails(audited(found, told=False))


def test_another_restitution_fails() -> None:
    found = audited(rebounds(), model=MODEL.replace("e: 0.8", "e: 0.79"))
    assert "impacts" in fails(found)
    assert found.check("impacts").worst is not None
    assert found.check("impacts").worst.name == "floor"


def test_rows_before_and_after_an_incident_may_stand_at_one_time() -> None:
    """As `--event-rows` writes them."""
    found = rebounds()
    extra = []
    for line in found.incidents:
        for head in ("before.", "after."):
            row = dict.fromkeys(COLUMNS, 0.0)
            row |= {name: line[EVENTS.index(name)] for name in ("t", "a.x", "a.y", "a.z")}
            row |= {f"a.v{axis}": line[EVENTS.index(f"{head}a.v{axis}")] for axis in "xyz"}
            row["energy"] = M * (row["a.vx"] ** 2 + row["a.vz"] ** 2) / 2
            extra.append(list(row.values()))
    rows = np.concatenate([found.rows, extra])
    found.rows = rows[np.argsort(rows[:, 0], kind="stable")]
    judged = audited(found)
    assert judged.passed, fails(judged)
    assert judged.check("steps").judged == judged.check("steps").entries
    assert audited(found, told=False).passed


def test_tables_of_other_events_are_refused() -> None:
    found = rebounds()
    events = EventTable(("impact",) * 2, ("wall",) * 2, EVENTS, found.incidents)
    with pytest.raises(TableError, match="`wall`, which is no inequality"):
        all_checks.audit(
            lagcli.loads(MODEL), AuditedTable(COLUMNS, found.rows, (), events), Tolerance(1e-11, 1e-13)
        )
    short = EventTable(("impact",) * 2, ("floor",) * 2, EVENTS[:-1], found.incidents[:, :-1])
    with pytest.raises(TableError, match=r"lacks the column `after\.a\.vz`"):
        all_checks.audit(
            lagcli.loads(MODEL), AuditedTable(COLUMNS, found.rows, (), short), Tolerance(1e-11, 1e-13)
        )


def files(folder: Path, found: Ball) -> list[str]:
    """The files of model, table and events, as options of `audit`."""
    model = folder / "ball.yaml"
    model.write_text(MODEL, encoding="utf-8")
    table, events = folder / "run.csv", folder / "events.csv"
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in found.rows.tolist())]
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    head = [EVENTS[0], "kind", "name", *EVENTS[1:]]
    lines = [",".join(head)]
    for kind, line in zip(found.kinds, found.incidents.tolist(), strict=True):
        lines.append(",".join([repr(line[0]), kind, "floor", *map(repr, line[1:])]))
    events.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return [str(model), "--run", str(table), "--events", str(events)]


def test_command_with_a_table_and_its_events(tmp_path: Path, command: Command) -> None:
    good = rebounds()
    options = files(tmp_path, good)
    out, err, code = command("audit", *options, "--json")
    assert code == 0, err
    told = json.loads(out)
    assert told["passed"]
    assert {"gaps", "jumps", "impacts", "flights"} <= {check["name"] for check in told["checks"]}
    impulse_too_large(good)
    out, _, code = command("audit", *files(tmp_path, good))
    assert code == 1
    assert "jumps fails" in out


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (["--events", "events.csv"], "--events: the incidents are of the table of --run"),
        (["--run", "run.csv", "--events", "none.csv"], "--events: there is no file none.csv"),
        (["--run", "run.csv", "--events", "run.csv"], "--events: run.csv is no table of events"),
    ],
)
def test_command_refuses_other_events(
    tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch, wrong: list[str], said: str
) -> None:
    files(tmp_path, rebounds())
    monkeypatch.chdir(tmp_path)
    _, err, code = command("audit", "ball.yaml", *wrong)
    assert code == 2
    assert said in " ".join(err.split())


def test_a_run_that_an_audit_makes_is_judged_with_its_incidents() -> None:
    found = lagcli.audit(Path(__file__).parents[2] / "models" / "zeno-ball.yaml")
    assert found.check("impacts").verdict == found.check("missed").verdict == "pass"


@pytest.mark.parametrize("event_rows", [False, True])
def test_an_impact_at_the_start_is_behind_its_row(event_rows: bool) -> None:
    model = lagcli.loads("""
lagcli: 1
particles: {a: {mass: 2, position: [0, 0, 0], velocity: [0.2, 0, -1]}}
forces: {weight: {to: a, force: "[0, 0, -9.81*m]"}}
inequality: {floor: {condition: a.z >= 0, restitution: 0.5}}
simulation: {duration: 0.3, samples: 31}
""")
    run = lagcli.simulate(model, event_rows=event_rows)
    assert run.events["t"][0] == 0
    found = lagcli.audit(model, run, events=run.events)
    assert found.passed, fails(found)
    assert found.check("balance").judged >= 31
    assert dict(found.figures)["energy_lost_in_impacts"] > 0.75


@pytest.mark.parametrize("contact", ["", "inequality: {floor: a.z >= -0.2*t}\n"])
def test_a_run_that_an_event_ends_at_a_row_but_for_rounding_is_a_motion(contact: str) -> None:
    """The grid has a row at 8 * (1.2/24), which is 0.39999999999999997, a rounding before that of the event.

    The run has one row there; a table of others may have both.
    """
    model = lagcli.loads(f"""
lagcli: 1
particles: {{a: {{mass: 0.89, position: [0, -0.33, 0], velocity: [0.72, -0.69, -0.11]}}}}
forces: {{weight: {{to: a, force: "[-1, 0, -9.81*m]"}}}}
holonomic: {{sphere: "norm(a - [0, 0, 2]) = sqrt(4.1089)"}}
{contact}events: {{late: {{when: t - 0.4, action: stop}}}}
simulation: {{duration: 1.2, samples: 25, assemble: true}}
""")
    alone = lagcli.simulate(model)
    assert alone.t[-1] - alone.t[-2] > 0.04
    rows = np.vstack([alone.rows, alone.rows[-1]])
    rows[-2, 0] = 8 * (1.2 / 24)
    both = Trajectory(alone.columns, rows, alone.stats)
    assert 0 < both.t[-1] - both.t[-2] < 1e-15
    for run in (alone, both):
        found = lagcli.audit(model, run, events=alone.events)
        assert found.passed, fails(found)
        assert found.check("steps").judged > 0


def test_an_impact_one_rounding_after_a_row_with_the_state_after_it_is_at_the_row() -> None:
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 0], velocity: [1.5, 0, 0]}}
inequality: {wall: {condition: "a.x <= 0.45", restitution: 0.5}}
simulation: {duration: 0.6, samples: 121}
"""
    model = lagcli.loads(text)
    run = lagcli.simulate(model)
    assert run.events is not None
    table, rows = run.events, run.rows.copy()
    row = int(np.argmin(np.abs(rows[:, 0] - 0.3)))
    assert abs(rows[row, list(run.columns).index("a.vx")] + 0.75) < 1e-9
    heads = ("t", *table.columns[3:])
    for late in (-1, 0, 1, 2):
        numbers = np.array(table.numbers)
        numbers[0, 0] = rows[row, 0] + late * np.spacing(rows[row, 0])
        events = EventTable(tuple(table.kinds), tuple(table.names), heads, numbers)
        found = all_checks.audit(
            model, AuditedTable(tuple(run.columns), rows, (), events), Tolerance(1e-9, 1e-12)
        )
        assert found.passed, (late, fails(found))


def test_a_contact_beside_a_particle_that_time_alone_moves_is_judged() -> None:
    model = lagcli.loads("""lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1]}
  b: {mass: 1, position: ["sin(t)", 0, 0]}
holonomic: {plane: a.y = 0}
inequality: {floor: {condition: "a.z >= 0.5", restitution: 0.4}}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
simulation: {duration: 1, samples: 41}
""")
    run = lagcli.simulate(model)
    found = lagcli.audit(model, run, events=run.events)
    assert found.passed, fails(found)
    assert found.check("accelerations").verdict == "pass"
