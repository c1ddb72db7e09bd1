"""`--events` and `--event-rows`: where incidents go, with made-up ones at the ends of steps."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.output.files import atomic_file
from lagcli.output.tables import incident_table, sinks, table_format
from lagcli.running import run_tables
from lagcli.simulation import loop
from lagcli.simulation.run_state.statistics import Incident
from lagcli.simulation.stepping import stepper
from tests.helpers import pendulum
from tests.helpers.in_process import command

__all__ = ["command"]

MODEL = pendulum.PENDULUM + "simulation: {duration: 2, samples: 41}\n"
FORMATS = ("csv", "tsv", "json", "npz", "parquet")
EVERY = 3  # steps


@pytest.fixture
def made_up(monkeypatch):
    """At every third step up to the last something hits `rod`, and the contact stays closed at every sixth."""
    accept, settle = stepper.Stepper.accept, stepper.Stepper.settle

    def accepting(run):
        run.is_accepting = True
        accept(run)

    def settling(run):
        is_accepting = vars(run).pop("is_accepting", False)
        if is_accepting and run.statistics.steps % EVERY == 0 and run.t < run.grid.end:
            t = run.origin + run.t
            line = np.arange(float(run.trial.rows.line.size - 7))
            kinds = ("impact", "contact") if run.statistics.steps % (2 * EVERY) == 0 else ("impact",)
            for kind in kinds:
                rows = len(run.bound.enforced.integrals.system.rows.rows)
                run.statistics.add(Incident(t, kind, "rod", np.full(rows, t), line, line + t))
        settle(run)

    # Steps that native code takes are not accepted one by one.
    monkeypatch.setattr(loop.paying, "pays", lambda steps: False)
    monkeypatch.setattr(stepper.Stepper, "accept", accepting)
    monkeypatch.setattr(stepper.Stepper, "settle", settling)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(MODEL)
    return tmp_path


@pytest.fixture
def small(monkeypatch):
    """Many blocks, and a checkpoint at each."""
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    monkeypatch.setattr(loop, "BLOCK_VALUES", 200)
    monkeypatch.setattr(run_tables, "EVERY", 0.0)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("ending", FORMATS)
def test_the_incidents_of_a_run_are_in_the_file(command, here, made_up, ending):
    run = lagcli.simulate("m.yaml")
    assert len(run.events) > 4
    assert set(run.events.kinds) == {"impact", "contact"}
    _, err, code = command("simulate", "m.yaml", "-o", "run.csv", "--events", f"e.{ending}")
    assert code == 0, err
    found = incident_table.read(f"e.{ending}")
    assert found.columns == run.events.columns
    assert (found.kinds, found.names) == (run.events.kinds, run.events.names)
    assert found.numbers.tobytes() == run.events.numbers.tobytes()
    assert names(here) == sorted(["m.yaml", "run.csv", f"e.{ending}"])


def test_the_account_counts_them(command, here, made_up):
    run = lagcli.simulate("m.yaml")
    impacts = run.events.kinds.count("impact")
    assert (run.stats.impacts, run.stats.releases, run.stats.accumulations) == (impacts, 0, 0)
    out, err, code = command("simulate", "m.yaml", "-o", "run.csv", "--json")
    assert code == 0
    assert f"incidents: {impacts} impacts\n" in err
    account = json.loads(out)
    assert account["impacts"] == impacts
    assert account["largest_penetration"] == 0.0
    assert account["ended_by"] is None


def test_a_run_without_incidents_says_nothing_of_them(command, here):
    _, err, code = command("simulate", "m.yaml", "-o", "run.csv", "--events", "e.csv")
    assert code == 0
    assert "incidents" not in err
    run = lagcli.simulate("m.yaml")
    assert len(run.events) == 0
    assert Path("e.csv").read_text() == ",".join(run.events.columns) + "\n"


def test_incidents_go_to_standard_output_where_the_rows_do_not(command, here, made_up):
    out, _, code = command("simulate", "m.yaml", "-q", "-o", "run.csv", "--events", "-", "--json")
    assert code == 0
    Path("e.csv").write_text(out)
    assert len(incident_table.read("e.csv")) == len(lagcli.simulate("m.yaml").events)
    out, _, code = command("simulate", "m.yaml", "-q", "--plot", "f.png", "--events", "-")
    assert (code, out.partition(",")[0]) == (0, "t")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--events", "-"], "--events -: the rows go to standard output"),
        (["--events", "-", "-o", "-"], "--events -: the rows go to standard output"),
        (["--events", "e.txt"], "unknown format"),
        (["--events", "e.csv", "-o", "e.csv"], "--events e.csv: that is the file of --output"),
        (["--events", "e.csv", "--stats", "e.csv.partial"], "e.csv.partial"),
        (["--events", "none/e.csv"], "cannot write none/e.csv"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_run(command, here, arguments, reason):
    out, err, code = command("simulate", "m.yaml", *arguments)
    assert out == ""
    assert code in (2, 74)
    assert reason in err
    assert names(here) == ["m.yaml"]


def test_two_columns_of_one_name_are_refused(command, here):
    text = (
        MODEL.replace("rod:", "x:")
        .replace("  a:", "  impulse:")
        .replace("norm(a)", "norm(impulse)")
        .replace("a.y", "impulse.y")
    )
    Path("m.yaml").write_text(text)
    _, err, code = command("simulate", "m.yaml", "-o", "run.csv", "--events", "e.csv")
    assert code == 1
    assert "the impulse of `x` would have the name of a component of the particle `impulse`" in err


# Rows of the instants.


def test_two_rows_stand_at_each_instant_in_the_order_of_time(command, here, made_up):
    plain, run = lagcli.simulate("m.yaml"), lagcli.simulate("m.yaml", event_rows=True)
    instants = sorted(set(run.events["t"]))
    assert len(run.t) == len(plain.t) + 2 * len(instants)
    assert (np.diff(run.t) >= 0).all()
    for t in instants:
        before, after = run.rows[run.t == t]
        width = before.size - 1
        np.testing.assert_array_equal(before[1:], np.arange(width))
        np.testing.assert_array_equal(after[1:], np.arange(width) + t)
    np.testing.assert_array_equal(run.rows[~np.isin(run.t, instants)], plain.rows)
    assert run.stats.rows == len(run.t)
    assert command("simulate", "m.yaml", "-q", "-o", "run.npz", "--event-rows")[2] == 0
    assert table_format.read("run.npz")[1].tobytes() == run.rows.tobytes()


def test_a_row_of_the_grid_at_that_very_instant_comes_after_the_two() -> None:
    rows = np.array([[0.0, 1.0], [1.0, 2.0], [2.0, 3.0]])

    def at(t, kind, before, after):
        return Incident(t, kind, "a", np.zeros(1), np.array([before]), np.array([after]))

    happened = [at(1.0, "impact", -5.0, 2.0), at(1.0, "contact", -5.0, 2.0), at(1.5, "release", 7.0, -0.0)]
    found = incident_table.with_event_rows(rows, happened)
    assert found.tolist() == [[0, 1], [1, -5], [1, 2], [1, 2], [1.5, 7], [1.5, 0], [2, 3]]
    assert not np.signbit(found[5, 1])
    assert incident_table.with_event_rows(rows, []) is rows
    assert incident_table.with_event_rows(rows[:0], happened[2:]).tolist() == [[1.5, 7], [1.5, 0]]
    wide = incident_table.with_event_rows(np.hstack([rows, rows]), happened[2:])
    np.testing.assert_array_equal(wide[2], [1.5, 7, np.nan, np.nan])


def test_columns_of_instants_are_chosen_as_others(command, here, made_up):
    run = lagcli.simulate("m.yaml", event_rows=True, columns="a.vz,t")
    whole = lagcli.simulate("m.yaml", event_rows=True)
    assert run.columns == ("a.vz", "t")
    np.testing.assert_array_equal(run["a.vz"], whole["a.vz"])


BALL = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1], velocity: [1, 0, 0]}
forces:
  weight: {to: a, force: [0, 0, -9.81]}
inequality:
  floor: {restitution: 0.8, condition: a.z + 0.1*sin(5*a.x) >= 0}
simulation: {duration: 2, output_step: 0.1, rtol: 1e-6}
"""


def test_digits_compare_an_incident_with_the_same_one_of_the_repeated_run(here, monkeypatch):
    ball = lagcli.loads(BALL)
    run, plain = lagcli.simulate(ball, event_rows=True, digits=True), lagcli.simulate(ball, digits=True)
    better = lagcli.simulate(ball, event_rows=True, rtol=1e-12)
    instants = np.isin(run.t, run.events.t)
    assert instants.sum() == 2 * len(run.events) > 6
    np.testing.assert_array_equal(run.rows[~instants], plain.rows)
    axes = [run.columns.index(f"a.{axis}") for axis in ("x", "y", "z", "vx", "vy", "vz")]
    apart = np.abs(run.rows[:, axes] - better.rows[:, axes])[instants]
    known = np.column_stack([run["err.r"], run["err.v"]])[instants]
    for kind, errors in enumerate((apart[:, :3].max(axis=1), apart[:, 3:].max(axis=1))):
        assert (known[:, kind] >= 0.5 * errors).all()
        assert known[-1, kind] < 30 * np.maximum.accumulate(errors)[-1]
    monkeypatch.setattr(loop, "BLOCK_VALUES", 60)
    np.testing.assert_array_equal(lagcli.simulate(ball, event_rows=True, digits=True).rows, run.rows)


def test_digits_have_no_value_at_instants_of_one_run_alone(here, made_up):
    run = lagcli.simulate("m.yaml", event_rows=True, digits=True)
    assert np.isnan(run["err.r"][np.isin(run.t, run.events.t)]).all()
    assert len(run.events) == len(lagcli.simulate("m.yaml").events)


# Runs that stop, and runs that go on.


class Killed(BaseException):
    """The end of the process, as far as this process can play it."""


@pytest.mark.parametrize("first", [0.3, 0.55, 1.0, 1.95])
@pytest.mark.parametrize("more", [(), ("--event-rows",)])
def test_the_incidents_of_two_parts_are_those_of_one_run(command, here, made_up, first, more):
    step = ("--output-step", "0.05", *more)
    whole = ("simulate", "m.yaml", "-q", *step, "--events", "whole.csv", "-o", "whole-rows.csv")
    assert command(*whole)[2] == 0
    begin = ("--duration", str(first), "--checkpoint", "ck", "--events", "one.csv", "-o", "one-rows.csv")
    assert command("simulate", "m.yaml", "-q", *step, *begin)[2] == 0
    end = ("--resume", "ck", "--events", "two.csv", "-o", "two-rows.csv", "--stats", "s.json")
    _, err, code = command("simulate", "m.yaml", "-q", *step, *end)
    assert code == 0, err
    one, two, all_of_it = (Path(f"{name}.csv").read_text() for name in ("one", "two", "whole"))
    assert one + two.partition("\n")[2] == all_of_it
    one, two, all_of_it = (Path(f"{name}-rows.csv").read_text() for name in ("one", "two", "whole"))
    assert all_of_it.endswith(two.partition("\n")[2])  # a last row at the end of a run is not of the grid
    assert one.count("\n") + two.count("\n") == all_of_it.count("\n") + 1
    run = lagcli.simulate("m.yaml", output_step=0.05, event_rows=bool(more))
    account = json.loads(Path("s.json").read_text())
    assert (account["impacts"], account["rows"]) == (run.stats.impacts, len(run.t))


def kill(command, monkeypatch, files):
    """A run into files that ends after eight blocks."""
    with monkeypatch.context() as patch:
        patch.setattr(atomic_file, "sweep", lambda: None)
        patch.setattr(sinks.Sink, "discard", lambda sink: None)
        taken = []
        take = run_tables.RunTables.take

        def counted(self, *arguments):
            take(self, *arguments)
            taken.append(1)
            if len(taken) == 8:
                raise Killed

        patch.setattr(run_tables.RunTables, "take", counted)
        with pytest.raises(Killed):
            command("simulate", "m.yaml", *files)


def test_a_killed_run_is_resumed_into_one_table_of_events(command, here, made_up, small, monkeypatch):
    files = ("-o", "run.csv", "--events", "e.parquet", "--checkpoint", "ck")
    whole = lagcli.simulate("m.yaml")
    kill(command, monkeypatch, files)
    assert {"e.parquet.rows", "run.csv.rows", "ck"} <= set(names(here))
    _, err, code = command("simulate", "m.yaml", "--resume", "ck", "--event-rows", *files)
    assert code == 2
    assert "--output run.csv: this one writes rows of --event-rows into it, and the run before none" in err
    _, err, code = command("simulate", "m.yaml", "--resume", "ck", *files)
    assert code == 0, err
    assert "note: e.parquet begins with the" in err
    found = incident_table.read("e.parquet")
    assert found.kinds == whole.events.kinds
    assert found.numbers.tobytes() == whole.events.numbers.tobytes()
    assert table_format.read("run.csv")[1].tobytes() == whole.rows.tobytes()
    assert not {"e.parquet.rows", "run.csv.rows"} & set(names(here))
    _, err, code = command("simulate", "m.yaml", "--resume", "ck", "--duration", "3", "--events", "e.parquet")
    assert code == 2
    assert "--events e.parquet: that is the table of the run before" in err


def test_a_run_that_stops_keeps_its_incidents_aside(command, here, made_up):
    collapse = "lagcli: 1\ncoordinates: {x: {value: 1}}\nlagrangian: rate(x)**2/2 + 1/x\n"
    Path("m.yaml").write_text(collapse + "simulation: {duration: 2, samples: 41}\n")
    _, err, code = command("simulate", "m.yaml", "-o", "run.csv", "--events", "e.csv")
    assert code == 3
    assert "the complete rows are in run.csv.partial, the complete events are in e.csv.partial" in err
    assert names(here) == ["e.csv.partial", "m.yaml", "run.csv.partial"]
    assert Path("e.csv.partial").read_text().count("\n") > 1
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        lagcli.simulate("m.yaml")
    assert len(stopped.value.trajectory.events) > 0


def test_a_trajectory_without_incidents_has_an_empty_table() -> None:
    run = lagcli.simulate(lagcli.loads(MODEL))
    assert not run.events
    assert run.events.columns[:3] == incident_table.HEAD
    assert repr(run.events) == "<IncidentTable: no incidents>"


@pytest.fixture
def drawn(monkeypatch):
    """The rows and facts of the figure that is drawn last."""
    from lagcli.output.figures import chart_figure

    found = {}
    compose = chart_figure.compose_run

    def composing(columns, rows, **facts):
        found.update(rows=rows, facts=facts["facts"])
        return compose(columns, rows, **facts)

    monkeypatch.setattr(chart_figure, "compose_run", composing)
    return found


def test_a_figure_of_a_run_with_incidents_is_drawn(command, here, made_up, drawn):
    assert command("simulate", "m.yaml", "-q", "--plot", "f.png", "-o", "run.csv")[2] == 0
    run = lagcli.simulate("m.yaml", event_rows=True)
    assert [t for t, _ in drawn["facts"].incidents] == run.events.t.tolist()
    np.testing.assert_array_equal(drawn["rows"], run.rows)  # jumps are upright without --event-rows too


@pytest.mark.parametrize("events", [("--events", "e.csv"), ()])
@pytest.mark.usefixtures("here", "made_up", "small")
def test_a_figure_of_a_resumed_run_marks_what_is_known(command, monkeypatch, drawn, events):
    run, files = lagcli.simulate("m.yaml"), ("-o", "run.csv", "--checkpoint", "ck", *events)
    kill(command, monkeypatch, files)
    _, err, code = command("simulate", "m.yaml", "--resume", "ck", "--plot", "f.png", *files)
    assert code == 0, err
    begins = re.search(r"note: marks of incidents in f.png begin after t = (\S+):", err)
    assert (begins is None) == bool(events)
    first = 0.0 if begins is None else float(begins[1])
    wanted = [(t, kind) for t, kind in zip(run.events.t, run.events.kinds, strict=True) if t > first + 1e-6]
    assert drawn["facts"].incidents == wanted
    assert 2 < len(wanted) <= len(run.events) - 2 * (not events)
    assert drawn["rows"][0, 0] == 0.0
