"""The error estimate of `--digits`: against true errors, beside an unchanged table, and where a run stops."""

import dataclasses
import functools
import json
import math
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import lagcli
from lagcli.api import prepare_run, run_settings
from lagcli.simulation import error_estimate, loop, reference_run
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.scheme import step_tolerance
from lagcli.simulation.stepping.stepper import Stepper
from tests.helpers import reference_models
from tests.helpers.in_process import completed
from tests.physics import test_reference as reference

ERRORS = ("err.r", "err.v", "err.lambda", "err.R")
RTOLS = [10.0**-k for k in range(4, 12)]
PROBLEMS = reference_models.problems()

PENDULUM = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
forces:
  weight: {to: a, force: [0, 0, -9.81]}
holonomic:
  rod: norm(a) = 1
simulation: {duration: 4, samples: 41}
"""
# Henon and Heiles's oscillator on a chaotic orbit of energy 0.16.
CHAOS = """\
lagcli: 1
coordinates:
  x: {value: 0, rate: 0.548}
  y: {value: 0.1, rate: 0.1}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - (x**2 + y**2)/2 - x**2*y + y**3/3
simulation: {duration: 300, samples: 301, rtol: 1e-6, atol: 1e-8}
"""
# x = 1 / (1 - t)**2 has a pole at t = 1.
POLE = """\
lagcli: 1
coordinates:
  x: {value: 1, rate: 2}
lagrangian: rate(x)**2/2 + 2*x**3
simulation: {duration: 2, samples: 41}
"""
# At rest up to t = 1.05, then pushed; with `pole` the motion soon ends in a pole.
PUSHED = """\
lagcli: 1
parameters: {pole: 0}
coordinates:
  x: {}
lagrangian: rate(x)**2/2 + pole*x**3
forces:
  push: {to: x, force: "max(t - 1.05, 0)**3"}
simulation: {duration: 10, samples: 101}
"""
# What no step resolves, and no tolerance that is used sees.


def ratios(name, rtol):
    """Estimate over true error, both not below 1e-13 of the scale, for each kind and reference time of a problem."""
    problem = PROBLEMS[name]
    form = "particles" if name in reference.WITH_PARTICLES else "coordinates"
    write = {"coordinates": reference_models.as_coordinates, "particles": reference_models.as_particles}[form]
    duration, step = reference_models.grid(problem)
    options = {"duration": duration, "output_step": step, "rtol": rtol, "atol": rtol / 100}
    run = lagcli.simulate(model_of(write(problem)), digits=True, **options)
    points = sorted(problem["reference"], key=lambda point: float(point["t"]))
    at = [reference.row_at(run, point["t"]) for point in points]
    found = []
    for kind, (columns, expected) in references(name, form, points).items():
        values = np.array([run[column] for column in columns]).T
        error = np.maximum.accumulate(np.abs(values[at] - expected).max(axis=1))
        scale = np.maximum.accumulate(np.abs(values).max(axis=1))[at]
        found += (
            run[f"err.{kind}"][at] / np.maximum(error, error_estimate.PARAMETERS.floor * scale)
        ).tolist()
    return found


def references(name, form, points):
    """Columns and true values (times, columns) of each kind."""
    problem = PROBLEMS[name]
    state, force = reference.columns(problem, form)
    coordinates, rows = problem["coords"], reference_models.rows(problem)
    wanted = {"r": coordinates, "v": [f"v{q}" for q in coordinates]}
    found = {
        kind: (
            [state[name] for name in names],
            np.array([[float(p["state"][name]) for name in names] for p in points]),
        )
        for kind, names in wanted.items()
    }
    if rows:
        multipliers = np.array([point["lam"] for point in points], dtype=float)
        forces = [list(reference.expected_reaction(name, point).values()) for point in points]
        found["lambda"] = [f"lambda.{row}" for row in rows], multipliers
        found["R"] = [force[q] for q in coordinates], np.array(forces)
    return found


@functools.cache
def model_of(text):
    return lagcli.loads(text)


@functools.cache
def all_ratios():
    return {(name, rtol): ratios(name, rtol) for name in PROBLEMS for rtol in RTOLS}


def test_the_estimate_is_never_under_a_third_of_the_true_error():
    low = {case: min(found) for case, found in all_ratios().items() if min(found) < 1 / 3}
    assert not low


def test_the_estimate_is_within_ten_times_of_the_true_error_on_nine_in_ten():
    found = np.concatenate(list(all_ratios().values()))
    assert len(found) > 1000
    assert np.mean(found <= 10) >= 0.9


@pytest.mark.parametrize("name", ["knife_edge", "nonholonomic_particle", "spherical_pendulum"])
def test_every_row_of_the_first_steps_has_its_error(name):
    """First steps grow as fast as they may at any tolerance: the repeated run must take others all the same."""
    model = model_of(reference_models.as_coordinates(PROBLEMS[name]))
    options = {"duration": 1.0, "samples": 401}
    run = lagcli.simulate(model, digits=True, rtol=1e-4, atol=1e-6, **options)
    better = lagcli.simulate(model, rtol=1e-12, atol=1e-14, **options)
    for kind, prefix in (("r", ""), ("lambda", "lambda.")):
        names = reference_models.rows(PROBLEMS[name]) if prefix else PROBLEMS[name]["coords"]
        columns = [prefix + name for name in names]
        gap = np.maximum.accumulate(np.max([np.abs(run[c] - better[c]) for c in columns], axis=0))
        scale = np.maximum.accumulate(np.max([np.abs(run[c]) for c in columns], axis=0))
        assert (run[f"err.{kind}"] >= np.maximum(gap, error_estimate.PARAMETERS.floor * scale) / 3).all()


def test_the_rest_of_the_table_is_what_it_is_without():
    model = lagcli.loads(PENDULUM)
    plain, run = lagcli.simulate(model), lagcli.simulate(model, digits=True)
    assert run.columns == (*plain.columns, *ERRORS)
    assert np.array_equal(run.rows[:, : len(plain.columns)], plain.rows)
    assert run.stats.steps == plain.stats.steps
    assert run.stats.as_json().keys() - plain.stats.as_json().keys() == {
        "digits",
        "errors",
        "three_digits_until",
        "repeated",
    }


def test_errors_never_fall_and_end_as_the_digits_say():
    run = lagcli.simulate(lagcli.loads(PENDULUM), digits=True, rtol=1e-6, atol=1e-8)
    for kind, digits in run.digits.items():
        columns = {
            "r": ("a.x", "a.y", "a.z"),
            "v": ("a.vx", "a.vy", "a.vz"),
            "lambda": ("lambda.rod",),
            "R": ("R.a.x", "R.a.y", "R.a.z"),
        }[kind]
        error = run[f"err.{kind}"]
        assert (np.diff(error) >= 0).all()
        scale = max(np.abs(run[column]).max() for column in columns)
        assert digits == pytest.approx(math.log10(scale / error[-1]))
        assert 4 < digits < 9


def test_digits_are_asked_for():
    with pytest.raises(ValueError, match="digits=True"):
        _ = lagcli.simulate(lagcli.loads(PENDULUM)).digits


def test_a_chaotic_motion_loses_its_digits_and_says_when():
    run = lagcli.simulate(lagcli.loads(CHAOS), digits=True)
    assert run.digits["r"] < 1
    assert run.digits["lambda"] is None
    assert run.digits["R"] is None
    found = run.stats.accuracy
    assert 30 < found.until[0] < 200
    assert f"(to 3 up to t = {found.until[0]:.9g})" in found.sentence
    assert "multipliers" not in found.sentence
    # The estimate is right where it counts: a run with a much smaller tolerance parts from it there.
    better = lagcli.simulate(lagcli.loads(CHAOS), rtol=1e-13, atol=1e-15)
    names = ("x", "y")
    gap = np.max([np.abs(run[name] - better[name]) for name in names], axis=0)
    seen = np.maximum.accumulate(gap)
    good = run.t <= found.until[0]
    assert (run["err.r"][good] >= seen[good] / 3).all()


def test_rows_that_shorten_no_step_do_not_hide_the_error():
    """Many rows, or few: the estimate at the end is the same but for what rows between the steps err more."""
    model = lagcli.loads(PENDULUM)
    few, many = (
        lagcli.simulate(model, digits=True, samples=n, rtol=1e-6, atol=1e-8).rows[-1, -4:] for n in (5, 4001)
    )
    assert (few <= many * (1 + 1e-9)).all()
    assert (many <= 5 * few).all()


@pytest.mark.parametrize("rtol", [1e-4, 1e-9, 1e-11, 1e-12, 1e-14, 1e-15])
def test_the_repeated_run_has_another_tolerance_near_the_rounding_too(rtol):
    settings = run_settings.chosen(lagcli.loads(PENDULUM), {"rtol": rtol, "atol": rtol / 100})
    first = step_tolerance.of_steps(settings)
    again = step_tolerance.of_steps(error_estimate.repeated(settings))
    part = again[0] / first[0]
    assert part == pytest.approx(1 / 250) or 1e-15 <= again[0] < 1e-14
    assert part < 0.31 or part == pytest.approx(3)
    assert 0 < again[1] <= 3.001 * first[1]


def test_before_the_first_row_nothing_is_known():
    model = lagcli.loads(PENDULUM)
    ready = prepare_run.start(model, run_settings.chosen(model, {}), digits=True)
    assert ready.stats.accuracy is None
    assert "digits" not in ready.stats.as_json()
    next(ready.blocks())
    assert json.dumps(ready.stats.as_json(), allow_nan=False)


def test_a_multiplier_at_its_pole_does_not_count():
    errors = error_estimate.Errors(([1], [2]), 2.0)
    rows = np.array([[0.0, 1.0, 5.0], [1.0, 2.0, np.nan], [2.0, 3.0, 6.0]])
    others = np.array([[0.0, 1.0, 5.5], [1.0, 2.1, 7.0], [2.0, 3.0, np.inf]])
    found = errors.take(rows, others)
    assert found[:, 0] == pytest.approx([1e-13, 0.2, 0.2])
    assert found[:, 1] == pytest.approx([1.0, 1.0, 1.0])


def test_a_run_that_stops_gives_the_errors_of_its_rows():
    model = lagcli.loads(POLE)
    with pytest.raises(lagcli.SimulationStopped) as plain:
        lagcli.simulate(model)
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        lagcli.simulate(model, digits=True)
    before, run = plain.value.trajectory, stopped.value.trajectory
    assert len(run.rows) == 20
    assert np.array_equal(run.rows[:, :-4], before.rows[:20])
    # No step leads to the pole, where there is a row.
    assert len(before.rows) == 20
    assert abs(stopped.value.t - 1) < 1e-6
    true = np.abs(run["x"] - 1 / (1 - run.t) ** 2)
    assert (run["err.r"] >= np.maximum.accumulate(true) / 3).all()


def hopeless(settings):
    """The settings of a repeated run that stops: see `stubborn`."""
    return dataclasses.replace(settings, rtol=1e-30, atol=1e-30)


def stubborn(run, advance=Stepper.advance):
    """A run with those settings finds no step beyond the beginning of the push."""
    if run.t > 1.05 and run.tolerance[0] < 1e-20:
        raise run_stop.StepFailure("no step is short enough", run_stop.TOO_SMALL)
    advance(run)


def test_where_the_repeated_run_stops_the_rows_up_to_there_are_given(monkeypatch, tmp_path):
    monkeypatch.setattr(error_estimate, "repeated", hopeless)
    monkeypatch.setattr(Stepper, "advance", stubborn)
    model, kept = lagcli.loads(PUSHED), tmp_path / "kept.json"
    with pytest.raises(lagcli.SimulationStopped, match="repeated at other tolerances stopped") as stopped:
        lagcli.simulate(model, digits=True, checkpoint=kept)
    whole, run = lagcli.simulate(model), stopped.value.trajectory
    assert 1 <= run.t[-1] < 2
    assert np.array_equal(run.rows[:, :-4], whole.rows[: len(run.rows)])
    # Resumed without the digits it gives rows after them, and says which it cannot give.
    chosen = run_settings.chosen(model, {})
    rest = prepare_run.prepare(model, chosen, kept)
    rows = np.concatenate(list(rest.blocks()))
    assert len(run.rows) + rest.skipped_rows + len(rows) == len(whole.rows)
    assert np.array_equal(rows, whole.rows[len(whole.rows) - len(rows) :])


def test_where_both_runs_stop_after_the_same_row_the_reason_is_that_of_the_first():
    model = lagcli.loads(POLE)
    with pytest.raises(lagcli.SimulationStopped) as plain:
        lagcli.simulate(model, output_step=0.3)
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        lagcli.simulate(model, output_step=0.3, digits=True)
    assert str(stopped.value) == str(plain.value)
    assert len(stopped.value.trajectory.rows) == len(plain.value.trajectory.rows) == 4
    assert stopped.value.trajectory.digits["r"] > 8


def test_memory_and_blocks_are_those_of_a_stream(monkeypatch):
    """Blocks come while the run goes on, the repeated run no more than a block ahead; a mark fits the rows before."""
    monkeypatch.setattr(loop, "BLOCK_VALUES", 400)
    model = lagcli.loads(PENDULUM)
    chosen = run_settings.chosen(model, {"samples": 401})
    ready = prepare_run.start(model, chosen, digits=True)
    seen, points = [], []
    for block in ready.blocks():
        seen.append(block)
        points.append(ready.checkpoint())
        assert len(ready._run.reference._waiting) <= max(map(len, seen))
        if len(block):
            assert points[-1].run_state.row == block[-1, 0]
    assert len(seen) > 10
    rows = np.concatenate(seen)
    assert np.array_equal(rows[:, :-4], lagcli.simulate(model, samples=401).rows)
    assert np.array_equal(rows, lagcli.simulate(model, samples=401, digits=True).rows)
    middle = len(seen) // 2
    rest = np.concatenate(list(prepare_run.resume(model, chosen, points[middle]).blocks()))
    assert np.array_equal(rest, rows[sum(map(len, seen[: middle + 1])) :, :-4])


def test_digits_and_resume_are_refused_together(tmp_path):
    model, kept = lagcli.loads(PENDULUM), tmp_path / "kept.json"
    lagcli.simulate(model, duration=2, output_step=0.1, digits=True, checkpoint=kept)
    rest = lagcli.simulate(model, output_step=0.1, resume=kept)
    assert np.array_equal(rest.rows, lagcli.simulate(model, output_step=0.1).rows[21:])
    with pytest.raises(ValueError, match="a checkpoint holds a run"):
        lagcli.simulate(model, output_step=0.1, resume=kept, digits=True)


def test_kinds_are_told_from_one_another_whatever_their_names():
    """Outputs and other columns do not count, and coordinates stand beside particles."""
    model = lagcli.loads(
        PENDULUM
        + "outputs: {speed: 'a.vx', big: '1e9*a.x'}\ncoordinates: {theta: {value: 0.3}}\nlagrangian: rate(theta)**2/2\n"
    )
    ready = prepare_run.start(model, run_settings.chosen(model, {}), digits=True)
    kinds = [[ready.columns[i] for i in at] for at in error_estimate.columns_of_kinds(ready.built)]
    assert kinds == [
        ["a.x", "a.y", "a.z", "theta"],
        ["a.vx", "a.vy", "a.vz", "rate(theta)"],
        ["lambda.rod"],
        ["R.a.x", "R.a.y", "R.a.z", "R.theta"],
    ]
    assert isinstance(ready._run.reference, reference_run.RunWithReference)


def test_the_sentence_counts_whole_digits():
    found = error_estimate.Accuracy(
        10.0, (2e-9, 1.0, 0.0, 1e-3), (1.0, 2.0, 0.0, 9.5), (10.0, 4.5, 10.0, 10.0), 1e-13, 1, 0, 12
    )
    assert found.sentence == (
        "positions are right to 8 digits up to t = 10, velocities to 0 (to 3 up to t = 4.5), R to 3"
    )
    assert found.digits["lambda"] is None


def test_the_command_line_tells_and_writes_them(tmp_path):
    file, table, stats, figure = (tmp_path / name for name in ("a.yaml", "a.npz", "a.json", "a.svg"))
    file.write_text(PENDULUM, encoding="utf-8")
    options = ("-o", table, "--stats", stats, "--plot", figure, "--columns", "err.*,t")
    done = completed("simulate", file, "--digits", *options)
    assert done.returncode == 0
    run = lagcli.simulate(lagcli.loads(PENDULUM), digits=True)
    assert f"digits: {run.stats.accuracy.sentence}" in done.stderr
    written = np.load(table)
    assert tuple(written) == (*ERRORS, "t")
    assert all(np.array_equal(written[name], run[name]) for name in ERRORS)
    assert json.loads(stats.read_text(encoding="utf-8"))["digits"] == run.digits
    # The figure is the one of the run without them.
    other = tmp_path / "b.svg"
    independent = completed("simulate", file, "--plot", other)
    assert other.read_bytes() == figure.read_bytes()
    assert "digits" not in independent.stderr


def test_the_command_line_refuses_a_resumed_run_and_has_no_errors_without(tmp_path):
    file = tmp_path / "a.yaml"
    file.write_text(PENDULUM, encoding="utf-8")
    refused = completed("simulate", file, "--digits", "--resume", tmp_path / "none.json")
    assert refused.returncode == 2
    assert "--digits with --resume" in refused.stderr
    unknown = completed("simulate", file, "--columns", "err.*")
    assert unknown.returncode == 2
    stopped = completed("simulate", "-", "--digits", given=POLE)
    assert stopped.returncode == 3
    assert stopped.stdout.splitlines()[0] == "t,x,rate(x),R.x,energy," + ",".join(ERRORS)
    assert len(stopped.stdout.splitlines()) == 21


@pytest.mark.skipif(sys.platform == "win32", reason="signals of another kind")
def test_an_interrupt_keeps_the_rows_with_their_errors(tmp_path):
    file, table = tmp_path / "a.yaml", tmp_path / "a.csv"
    file.write_text(PENDULUM, encoding="utf-8")
    asked = ["simulate", file, "--digits", "-o", table, "--duration", "1e5", "--output-step", "0.1"]
    process = subprocess.Popen([sys.executable, "-m", "lagcli", *map(str, asked)], stderr=subprocess.PIPE)
    partial = tmp_path / "a.csv.partial"
    deadline = time.monotonic() + 20
    while not any(path.stat().st_size > 50_000 for path in tmp_path.glob(".a.csv*")):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)
    assert process.returncode == 130
    lines = partial.read_text(encoding="utf-8").splitlines()
    assert lines[0].endswith(",".join(ERRORS))
    assert len({line.count(",") for line in lines}) == 1
