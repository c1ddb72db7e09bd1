"""Runs that go on from a checkpoint: bit for bit, and refused where they would be another run."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import lagcli
from lagcli.analysis.classification import verdict
from lagcli.api import prepare_run, run_settings
from lagcli.model import invariant
from lagcli.running import run_tables, simulation_run
from lagcli.simulation import loop
from lagcli.simulation.run_state import checkpoint, saved_form
from tests.helpers import in_process

PENDULUM = """\
lagcli: 1
parameters: {m: 1, L: 1, g: 9.81}
particles:
  a: {mass: m, position: [L, 0, 0], velocity: [0, 0.3, -1]}
  b: {mass: m, position: [2*L, 0, 0]}
forces:
  weight: {to: all, force: [0, 0, -m*g]}
holonomic:
  upper: L = norm(a)
  lower: distance(a, b) = L
"""
# A bead on a ring that turns and shakes: the constraint does work.
RHEONOMIC = """\
lagcli: 1
parameters: {w: 3}
particles:
  bead: {mass: 0.5, position: [1, 0, 0.5], velocity: [0, w, 0]}
forces:
  weight: {to: all, force: [0, 0, -9.81*m]}
holonomic:
  plane: bead.x*sin(w*t) = bead.y*cos(w*t)
  ring: bead.x**2 + bead.y**2 + (bead.z - 0.5*cos(t))**2 = 1
"""
SLEIGH = """\
lagcli: 1
parameters: {ramp: 0.4, k: [1, 2, 3]}
coordinates:
  x: {rate: 1}
  y: {}
  theta: {rate: 0.7}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(theta)**2)/2 - 9.81*sin(ramp)*x
differential:
  edge: sin(theta)*d(x) - cos(theta)*d(y) = 0
outputs: {speed: "sqrt(rate(x)**2 + rate(y)**2)"}
"""
BODY = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0.2]}
  b: {mass: 2, position: [1, 0, 0], velocity: [1, 0.4, 0.2]}
  c: {mass: 3, position: [0, 2, 0], velocity: [0.2, 0, 0.2]}
rigid:
  body: [a, b, c]
"""
# Kinks of the force: steps are rejected, also the last.
KINKS = """\
lagcli: 1
coordinates: {x: {value: 1, rate: 0}}
lagrangian: rate(x)**2/2 - x**2/2
forces:
  push: {to: x, force: "max(0, sin(7*t))"}
"""
# Steps are longer than the waves of the power.
MOTOR = """\
lagcli: 1
coordinates: {th: {rate: 10}}
particles:
  tip: {mass: 1, position: "[0.3*cos(th), 0, 0.3*sin(th)]"}
forces:
  weight: {to: tip, force: "[0, 0, -9.81]"}
holonomic: {motor: th = 10*t}
"""
FALL = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
forces:
  pull: {to: a, force: -r/norm(r)**3}
"""
MODELS = {
    "holonomic": PENDULUM,
    "rheonomic": RHEONOMIC,
    "nonholonomic": SLEIGH,
    "rigid": BODY,
    "kinks": KINKS,
    "driven": MOTOR,
}

every_model = pytest.mark.parametrize("text", MODELS.values(), ids=MODELS.keys())


def ready(
    text: str,
    resumed: checkpoint.Checkpoint | None = None,
    found: tuple[invariant.FirstIntegral, ...] = (),
    **options: Any,
) -> simulation_run.SimulationRun:
    model = lagcli.loads(text)
    chosen = run_settings.chosen(model, options)
    if resumed is not None:
        return prepare_run.resume(model, chosen, resumed)
    return prepare_run.start(model, chosen, verdict.KnownIntegrals(found))


def kept(point: checkpoint.Checkpoint) -> checkpoint.Checkpoint:
    """As it comes back from a file."""
    return checkpoint.decoded(checkpoint.encoded(point))


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def untimed(stats: Any) -> Any:
    return dataclasses.replace(stats, compile_seconds=0, solve_seconds=0, native_steps=0)


def cut(text: str, rows: int, **options: Any) -> tuple[np.ndarray, checkpoint.Checkpoint]:
    """A run broken off after so many rows or a few more: the rows, and its checkpoint."""
    broken = ready(text, **options)
    blocks = []
    for block in broken.blocks():
        blocks.append(block)
        if sum(map(len, blocks)) >= rows:
            break
    return np.concatenate(blocks), kept(broken.checkpoint())


# Bit for bit.


@every_model
@pytest.mark.parametrize("samples", [11, 2001])
def test_a_run_broken_off_anywhere_goes_on_bit_for_bit(
    text: str, samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = {"duration": 4, "samples": samples}
    uncut = lagcli.simulate(lagcli.loads(text), **options)
    # Blocks of few rows, and of one step each: most cuts then lie between rows of one step.
    monkeypatch.setattr(loop, "BLOCK_VALUES", 60)
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    sides = set()
    for rows in np.random.default_rng(samples).integers(1, samples, 8):
        first, point = cut(text, int(rows), **options)
        assert point.run_state.row == first[-1, 0]
        sides.add(np.sign(point.run_state.row - point.run_state.t))
        second = ready(text, point, **options)
        rest = np.concatenate(list(second.blocks()))
        assert same_bits(np.concatenate([first, rest]), uncut.rows)
        assert untimed(second.stats) == untimed(uncut.stats)
    if samples == 2001:
        assert 1 in sides, "no cut lay between rows of one step"


@every_model
@pytest.mark.parametrize("duration", [5, 3.21987])
def test_a_finished_run_goes_on_to_a_longer_duration_bit_for_bit(
    text: str, duration: float, tmp_path: Path
) -> None:
    model, file = lagcli.loads(text), tmp_path / "run.json"
    first = lagcli.simulate(model, duration=duration, output_step=0.125, checkpoint=file)
    second = lagcli.simulate(model, duration=10, output_step=0.125, resume=file)
    whole = lagcli.simulate(model, duration=10, output_step=0.125)
    assert first.t[-1] == duration
    assert same_bits(second.rows, whole.rows[whole.t > duration])
    assert second.stats.steps == whole.stats.steps
    assert second.stats.position_drift == pytest.approx(whole.stats.position_drift, abs=1e-15)
    assert second.stats.energy_imbalance == pytest.approx(whole.stats.energy_imbalance, rel=0.5, abs=1e-15)


@pytest.mark.parametrize("text", [KINKS, KINKS.replace("7*t", "9*x")], ids=["in time", "in place"])
def test_the_end_of_a_run_leaves_no_trace_in_its_checkpoint(text: str) -> None:
    """Many ends, of which some fall on a step that ends at a kink, or is rejected because one lies in it."""
    whole = lagcli.simulate(lagcli.loads(text), duration=4, output_step=0.25)
    rejected = []
    for duration in np.linspace(0.3, 2.4, 60):
        rows, point = cut(text, 10**9, duration=duration, output_step=0.25)
        again = ready(text, point, duration=4, output_step=0.25)
        rest = np.concatenate(list(again.blocks()))
        assert same_bits(rest, whole.rows[whole.t > duration])
        assert again.stats.steps == whole.stats.steps
        rejected.append(point.run_state.rejected)
        assert rows[-1, 0] == duration
    # Kinks in time are known beforehand, and met.
    assert len(set(rejected)) > (2 if text is KINKS else 5)


def test_a_run_goes_on_twice_and_from_a_duration_of_zero(tmp_path: Path) -> None:
    model, file = lagcli.loads(PENDULUM), tmp_path / "run.json"
    parts = [lagcli.simulate(model, duration=0, output_step=0.1, checkpoint=file)]
    for duration in (0.75, 1.3, 3):
        more = lagcli.simulate(model, duration=duration, output_step=0.1, checkpoint=file, resume=file)
        parts.append(more)
    whole = lagcli.simulate(model, duration=3, output_step=0.1)
    rows = np.concatenate([part.rows for part in parts])
    # The last step of a run is cut to its end, so that its last row differs by rounding.
    assert same_bits(rows[~np.isin(rows[:, 0], [0.75, 1.3])], whole.rows[~np.isin(whole.t, [1.3])])


def test_other_columns_and_another_grid_may_be_asked_for(tmp_path: Path) -> None:
    model, file = lagcli.loads(PENDULUM), tmp_path / "run.json"
    lagcli.simulate(model, duration=1, samples=2, checkpoint=file)
    more = lagcli.simulate(model, duration=3, samples=301, columns="t,lambda.*", resume=file)
    whole = lagcli.simulate(model, duration=3, samples=301, columns="t,lambda.*")
    assert more.columns == ("t", "lambda.upper", "lambda.lower")
    assert same_bits(more.rows, whole.rows[whole.t > 1])


def test_a_finer_grid_cannot_look_behind_the_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    going = ready(PENDULUM, duration=10, samples=3, compile="never")
    blocks = going.blocks()
    for _ in range(20):
        next(blocks)
    point = going.checkpoint()
    assert point.run_state.row == 0 < point.run_state.t
    finer = ready(PENDULUM, point, duration=10, output_step=0.001)
    assert finer.skipped_rows == np.ceil(point.run_state.t / 0.001) - 1
    t = np.concatenate(list(finer.blocks()))[:, 0]
    assert point.run_state.t <= t[0] < point.run_state.t + 0.001
    assert ready(PENDULUM, point, duration=10, samples=3).skipped_rows == 0


def test_a_run_that_an_event_has_ended_goes_on_with_the_next_row_of_the_grid(tmp_path: Path) -> None:
    text = FALL + 'events: {halt: {when: "t - 0.55", action: stop}}\n'
    model, file = lagcli.loads(text), tmp_path / "run.json"
    ended = lagcli.simulate(model, duration=0.9, output_step=0.1, checkpoint=file)
    assert ended["t"][-1] == pytest.approx(0.55, abs=1e-12)
    more = lagcli.simulate(model, duration=0.9, output_step=0.1, resume=file)
    assert more["t"] == pytest.approx([0.6, 0.7, 0.8, 0.9], abs=1e-12)


def test_an_event_a_rounding_after_the_last_row_of_the_run_before_has_no_second_row(tmp_path: Path) -> None:
    text = FALL + 'events: {halt: {when: "t - 0.50000000001", action: stop}}\n'
    model, file = lagcli.loads(text), tmp_path / "run.json"
    assert lagcli.simulate(model, duration=0.5, output_step=0.1, checkpoint=file)["t"][-1] == 0.5
    more = lagcli.simulate(model, duration=0.9, output_step=0.1, resume=file)
    assert more.stats.ended_by == "halt"
    assert len(more["t"]) == 0


def test_a_stopped_run_stops_at_the_same_state_again(tmp_path: Path) -> None:
    model, file = lagcli.loads(FALL), tmp_path / "run.json"
    with pytest.raises(lagcli.SimulationStopped) as first:
        lagcli.simulate(model, duration=5, samples=501, checkpoint=file)
    with pytest.raises(lagcli.SimulationStopped) as second:
        lagcli.simulate(model, duration=5, samples=501, resume=file)
    assert str(second.value) == str(first.value)
    assert second.value.t == first.value.t
    rows = len(first.value.trajectory.rows) + len(second.value.trajectory.rows)
    assert f"after row {rows} of 501" in str(second.value)


def test_an_assembled_start_is_not_assembled_again(tmp_path: Path) -> None:
    text = PENDULUM.replace("position: [L, 0, 0]", "position: [1.02*L, 0, 0]")
    model, file = lagcli.loads(text), tmp_path / "run.json"
    lagcli.simulate(model, duration=1, output_step=0.5, assemble=True, checkpoint=file)
    more = lagcli.simulate(model, duration=2, output_step=0.5, resume=file)
    whole = lagcli.simulate(model, duration=2, output_step=0.5, assemble=True)
    assert same_bits(more.rows, whole.rows[3:])


def test_checkpoints_are_written_at_once_then_now_and_then_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    written = []
    write = run_tables.CheckpointWriter.write

    def counted(keeper: run_tables.CheckpointWriter) -> bool:
        done = write(keeper)
        written.append(checkpoint.read(tmp_path / "run.json").run_state.t)
        return done

    monkeypatch.setattr(run_tables.CheckpointWriter, "write", counted)
    # A pause comes behind each step; native code takes many at once.
    model, options = lagcli.loads(PENDULUM), {"duration": 2, "samples": 11, "compile": "never"}
    lagcli.simulate(model, checkpoint=tmp_path / "run.json", **options)
    assert len(written) == 2
    assert written[0] < 0.1 < written[1] < 2
    written.clear()
    monkeypatch.setattr(run_tables, "EVERY", 0.0)
    lagcli.simulate(model, checkpoint=tmp_path / "run.json", **options)
    assert len(written) > 20
    assert written == sorted(written)


# Integrals that are held.

LINE = """\
lagcli: 1
coordinates: {x: {value: -1, rate: 1}, y: {value: -0.5, rate: 0.5}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - (x**2 + 3*y**2)
differential: {row: y*d(x) - x*d(y) = 0}
"""
GOOD = invariant.LevelFunction("y", "x")
ROOT = invariant.LevelFunction("sqrt(-x)", "sqrt(-y)")  # ends where the motion passes the origin, at t = 0.62
LOG = invariant.LevelFunction("log(-x) - log(-y)")
HELD = {"stays": (GOOD,), "for another": (ROOT, LOG, GOOD), "let go": (LOG,)}


def line(*charts: invariant.LevelFunction) -> tuple[invariant.FirstIntegral, ...]:
    return (invariant.FirstIntegral("y/x", ("row",), charts),)


every_holding = pytest.mark.parametrize("charts", HELD.values(), ids=HELD.keys())


@every_holding
@pytest.mark.parametrize("samples", [11, 801])
def test_a_run_with_an_integral_goes_on_bit_for_bit_before_and_after_a_change_of_charts(
    charts: tuple[invariant.LevelFunction, ...], samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    options: dict[str, Any] = {"found": line(*charts), "duration": 2, "samples": samples}
    whole = ready(LINE, **options)
    uncut = np.concatenate(list(whole.blocks()))
    monkeypatch.setattr(loop, "BLOCK_VALUES", 30)
    monkeypatch.setattr(loop, "PAUSE", 0.0)
    used = set()
    for rows in np.unique(np.linspace(1, 0.9 * samples, 30).astype(int)):
        first, point = cut(LINE, int(rows), **options)
        used |= {level and level.chart for level in point.run_state.invariant_values}
        second = ready(LINE, point, **options)
        rest = np.concatenate(list(second.blocks()))
        assert same_bits(np.concatenate([first, rest]), uncut)
        assert untimed(second.stats) == untimed(whole.stats)
        assert second.notes == whole.notes
    assert (
        used
        == {"stays": {0}, "for another": {0, 2}, "let go": {0, None}}[
            next(name for name, held in HELD.items() if held == charts)
        ]
    )


@every_holding
def test_the_end_of_a_run_with_an_integral_leaves_no_trace(
    charts: tuple[invariant.LevelFunction, ...],
) -> None:
    found = line(*charts)
    whole = ready(LINE, found=found, duration=2, output_step=0.125)
    rows = np.concatenate(list(whole.blocks()))
    for duration in np.linspace(0.45, 0.8, 30):
        _, point = cut(LINE, 10**9, found=found, duration=duration, output_step=0.125)
        again = ready(LINE, point, found=found, duration=2, output_step=0.125)
        assert same_bits(np.concatenate(list(again.blocks())), rows[rows[:, 0] > duration])
        assert again.stats.steps == whole.stats.steps
        assert again.notes == whole.notes


def test_a_run_goes_on_with_the_integrals_it_began_with() -> None:
    """What a search finds may depend on the time it has: it is not asked again."""
    _, point = cut(LINE, 1, found=line(GOOD), duration=1, samples=3)
    again = checkpoint.decoded(checkpoint.encoded(point))
    assert again.integrals == line(GOOD)
    for other in ((), line(LOG)):
        assert ready(LINE, again, found=other, duration=2).checkpoint().integrals == line(GOOD)


def test_integrals_that_are_none_of_the_system_are_damage() -> None:
    _, point = cut(LINE, 1, found=line(GOOD), duration=1, samples=3)
    for text in ("x - unknown", "x - (", "x*d(y)"):
        strange = dataclasses.replace(line(GOOD)[0], charts=(invariant.LevelFunction(text),))
        with pytest.raises(checkpoint.CheckpointError, match="damaged checkpoint: it holds integrals"):
            ready(LINE, dataclasses.replace(point, integrals=(strange,)), duration=2)


# Refusals.


@pytest.fixture
def point(tmp_path: Path) -> Path:
    file = tmp_path / "run.json"
    lagcli.simulate(lagcli.loads(SLEIGH), duration=1, samples=3, checkpoint=file)
    return file


@pytest.mark.parametrize(
    ("changes", "options", "sentence"),
    [
        ({"ramp": 0.5}, {}, "the parameter `ramp` is 0.4 in it and 0.5 here"),
        ({"k": [1, 2, 4]}, {}, r"the parameter `k` is \[1.0, 2.0, 3.0\] in it and \[1.0, 2.0, 4.0\] here"),
        ({"y.value": 1e-300}, {}, "the start of `y` is 0.0 in it and 1e-300 here"),
        ({"theta.rate": 0.8}, {}, "the initial rate of `theta` is 0.7 in it and 0.8 here"),
        ({}, {"start": 1}, "`start` is 0.0 in it and 1.0 here"),
        ({}, {"rtol": 1e-9}, "`rtol` is 1e-11 in it and 1e-09 here"),
        ({}, {"atol": 1e-9}, "`atol` is not given in it and 1e-09 here"),
        ({}, {"duration": 1}, "nothing is left to do.*last row at 1.* ends at 1; a longer duration goes on"),
        ({}, {"duration": 0.5}, "nothing is left to do.*last row at 1.* ends at 0.5"),
    ],
)
def test_a_checkpoint_of_another_run_is_refused_with_what_differs(
    changes: dict[str, object], options: dict[str, float], sentence: str, point: Path
) -> None:
    with pytest.raises(ValueError, match=sentence) as caught:
        lagcli.simulate(lagcli.loads(SLEIGH, changes), **({"duration": 2} | options), resume=point)
    assert str(caught.value).startswith(f"{point}: ")


def test_a_checkpoint_of_another_text_is_refused(point: Path) -> None:
    with pytest.raises(ValueError, match="belongs to a different run: the text of the model"):
        lagcli.simulate(lagcli.loads(SLEIGH + "title: the same in other words\n"), duration=2, resume=point)


def test_a_dependent_particle_may_not_move_elsewhere(tmp_path: Path) -> None:
    text = "lagcli: 1\ncoordinates: {x: {rate: 1}}\nparticles:\n  a: {mass: 1, position: [x, 0, 0]}\n"
    file = tmp_path / "run.json"
    lagcli.simulate(lagcli.loads(text), duration=1, samples=3, checkpoint=file)
    with pytest.raises(ValueError, match="of the position of a dependent particle, is different"):
        lagcli.simulate(lagcli.loads(text, {"a.position": "[2*x, 0, 0]"}), duration=2, resume=file)


def changed(**changes: Any) -> Callable[[dict[str, Any]], None]:
    def change(whole: dict[str, Any]) -> None:
        for key, value in changes.items():
            part, _, name = key.partition("__")
            if value is None:
                del whole[part][name]
            else:
                whole[part][name] = value

    return change


@pytest.mark.parametrize(
    "damage",
    [
        changed(run_state__t=float("nan")),
        changed(run_state__step=float("inf")),
        changed(run_state__step=0.0),
        changed(run_state__step=-1.0),
        changed(run_state__step=10**400),
        changed(run_state__y=[1.0, 2.0]),
        changed(run_state__k=[]),
        changed(run_state__y=[0.0] * 6 + [True]),
        changed(run_state__y=[0.0] * 6 + ["1"]),
        changed(run_state__y=[0.0] * 6 + [float("nan")]),
        changed(run_state__y=3.0),
        changed(run_state__steps=1.5),
        changed(run_state__steps=-1),
        changed(run_state__extremes={}),
        changed(run_state__extremes=None),
        changed(run_state__row=None),
        changed(run_state__invariant_values=None),
        changed(run_state__invariant_values=7),
        changed(run_state__invariant_values=[[0, 1.0]]),
        changed(run_state__invariant_values=[[0.5, 1.0, 1.0]]),
        changed(run_state__invariant_values=[[0, 1.0, float("inf")]]),
        changed(run_state__invariant_values=[[0, 1.0, 1.0]]),
        changed(run_state__notes=[1]),
        lambda whole: whole.pop("integrals"),
        lambda whole: whole.update(integrals="0"),
        changed(run_state__row=-1e308),
        changed(run_state__t=-1e308),
        changed(run_state__t=0.5),
        changed(run_state__evaluations=7),
        changed(identity__q=[0.0]),
        changed(identity__parameters=[1]),
        changed(identity__parameters={"ramp": [1]}),
        changed(identity__fingerprint=7),
        lambda whole: whole.pop("run_state"),
        lambda whole: whole.update(run_state=[1, 2]),
    ],
)
def test_a_damaged_checkpoint_is_refused(damage: Callable[[dict[str, Any]], None], point: Path) -> None:
    whole = json.loads(point.read_text())
    damage(whole)
    point.write_text(json.dumps(whole))
    with pytest.raises(ValueError, match="it is a damaged checkpoint"):
        lagcli.simulate(lagcli.loads(SLEIGH), duration=2, resume=point)


def test_a_checkpoint_laid_out_in_another_way_is_the_same(point: Path) -> None:
    whole = json.loads(point.read_text())
    point.write_text(json.dumps(whole, indent=1, sort_keys=True))
    run = lagcli.simulate(lagcli.loads(SLEIGH), duration=2, samples=5, resume=point)
    assert same_bits(run.rows, lagcli.simulate(lagcli.loads(SLEIGH), duration=2, samples=5).rows[-2:])


class Corner(NamedTuple):
    x: float
    of: int


@dataclasses.dataclass(frozen=True)
class Shape:
    name: str
    corners: tuple[Corner | None, ...]
    sizes: dict[str, float | tuple[float, float, float]]
    inner: "Shape | None" = None


SHAPE = Shape("a", (Corner(0.5, 3), None), {"one": 2.0, "three": (1.0, 2.0, 3.0)}, Shape("b", (), {}))


def test_dataclasses_are_saved_and_read_by_their_types() -> None:
    tree = json.loads(json.dumps(saved_form.saved(SHAPE)))
    assert tree["corners"] == [[0.5, 3], None]
    assert tree["inner"] == {"name": "b", "corners": [], "sizes": {}, "inner": None}
    assert saved_form.read(Shape, tree) == SHAPE


@pytest.mark.parametrize(
    ("place", "value", "sentence"),
    [
        (("name",), 1, "Shape.name: no str"),
        (("corners", 0), [0.5], r"Shape.corners\[0\]: 1 in place of 2 values"),
        (("corners",), {}, "Shape.corners: no list"),
        (("sizes", "one"), True, "Shape.sizes.one: no list"),
        (("sizes", "three"), [1.0, 10**400, 1.0], r"Shape.sizes.three\[1\]: no finite number"),
        (("sizes", "three"), [1.0, 2.0], "Shape.sizes.three: 2 in place of 3 values"),
        (("inner",), {"name": "b"}, "Shape.inner: other fields than name, corners, sizes, inner"),
        (("more",), 1, "Shape: other fields than name, corners, sizes, inner"),
    ],
)
def test_what_is_not_of_its_type_is_reported_with_its_location(
    place: tuple[Any, ...], value: object, sentence: str
) -> None:
    tree = json.loads(json.dumps(saved_form.saved(SHAPE)))
    part = tree
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    with pytest.raises(saved_form.FormError, match=f"^{sentence}$"):
        saved_form.read(Shape, tree)


def test_the_form_of_a_file_is_the_one_of_format_10() -> None:
    identity = {
        "fingerprint": "f", "parameters": {"g": 9.81, "w": [0.0, 1.0, 2.0]}, "q": [1.0], "v": [2.0], "start": 0.0,
        "rtol": 1e-9, "atol": None, "method": "dop853", "max_step": None,
    }  # fmt: skip
    extremes = dict.fromkeys(
        (
            "start", "rest", "position_drift", "velocity_drift", "imbalance", "moving", "resting", "largest",
            "unbalanced", "penetration",
        ),
        0.5,
    )  # fmt: skip
    tally = {"incidents": 2, "instants": 1, "impacts": 1, "releases": 0, "accumulations": 0}
    tally["last"] = 0.25
    run_state = {
        "t": 0.5, "y": [1.0, 2.0, 0.0], "k": [2.0, 0.0, 0.0], "step": 0.1, "pace_from": 0.0, "steps": 3,
        "rejected": 0, "evaluations": 36, "row": 0.5, "extremes": extremes,
        "selection": {"independent": [0], "dependencies": [[1, 0]], "inactive": [2], "idle": []},
        "invariant_values": [[0, 0.6, 0.8], None], "notes": ["n"],
        "watch": [0.5], "crossings": [{"t": 0.25, "number": 1, "participants": [0, 1]}], "origin": 0.0, "turns": [],
        "tally": tally, "reported": tally, "is_blurred": None,
        "contacts": {
            "touching": [2], "apart": [], "unarmed": [], "last": 0.25, "again": 0, "size": 1.0, "ending": [[2, 0.75]],
            "postponed": [[1, 0.75]], "deepest": 0.0, "shared": [1], "crowds": [[2, 3, 0.125, [0.25]]],
        },
    }  # fmt: skip
    chart = {"above": "x", "below": "1", "period": None}
    integrals = [{"text": "x", "rows": ["r"], "charts": [chart]}, {"text": "y", "rows": ["r"], "charts": []}]
    table = {"file": "t.csv", "step": 0.1, "count": 6, "checksum": 7, "has_event_rows": False}
    parts = {
        "identity": identity,
        "run_state": run_state,
        "integrals": integrals,
        "table": table,
        "events": None,
    }
    head = {"lagcli-checkpoint": 10, "version": lagcli.__version__}
    whole = {**head, **parts, "sum": checkpoint.control_sum(parts)}
    point = checkpoint.decoded(json.dumps(whole).encode())
    assert point.run_state.invariant_values[0] == (0, 0.6, 0.8)
    assert json.loads(checkpoint.encoded(point)) == whole


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "no checkpoint, or torn"),
        (b"\x80\x04\x95\x00.", "no checkpoint, or torn"),
        (b"[" * 100_000, "no checkpoint, or torn"),
        (b"9" * 10_000, "no checkpoint"),
        (b"[1, 2]", "no checkpoint"),
        (b"t,x\n0,1\n", "no checkpoint, or torn"),
        (b'{"columns": [], "rows": []}', "no checkpoint"),
        (b'{"lagcli-checkpoint": 1}', "checkpoint of a different version, of format 1"),
    ],
)
def test_a_file_that_is_no_checkpoint_is_refused(data: bytes, sentence: str, point: Path) -> None:
    point.write_bytes(data)
    with pytest.raises(ValueError, match=sentence):
        lagcli.simulate(lagcli.loads(SLEIGH), duration=2, resume=point)


def test_a_checkpoint_torn_anywhere_is_refused(point: Path) -> None:
    data = point.read_bytes()
    for size in np.linspace(0, len(data) - 3, 40).astype(int):
        with pytest.raises(checkpoint.CheckpointError, match="torn"):
            checkpoint.decoded(data[:size])


def test_a_file_without_end_is_refused(point: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpoint, "MOST_BYTES", 100)
    with pytest.raises(ValueError, match="too large"):
        lagcli.simulate(lagcli.loads(SLEIGH), duration=2, resume=point)


def test_files_that_cannot_be_opened_are_reported(tmp_path: Path) -> None:
    model = lagcli.loads(SLEIGH)
    with pytest.raises(FileNotFoundError):
        lagcli.simulate(model, duration=1, resume=tmp_path / "none.json")
    with pytest.raises(FileNotFoundError):
        lagcli.simulate(model, duration=1, checkpoint=tmp_path / "none" / "run.json")


def test_a_disk_that_is_full_for_a_while_costs_nothing_but_a_late_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keeper = run_tables.CheckpointWriter(tmp_path / "run.json")
    monkeypatch.setattr(run_tables, "EVERY", 0.0)
    _, first = cut(SLEIGH, 1, duration=1, samples=3)
    _, second = cut(SLEIGH, 3, duration=1, samples=3)
    keeper.take(first)
    encoded = checkpoint.encoded

    def full(point: checkpoint.Checkpoint) -> bytes:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint, "encoded", full)
    keeper.take(second)
    with pytest.raises(OSError, match="No space"):
        keeper.write()
    assert checkpoint.read(tmp_path / "run.json").run_state.t == first.run_state.t
    monkeypatch.setattr(checkpoint, "encoded", encoded)
    assert keeper.write()
    assert checkpoint.read(tmp_path / "run.json").run_state.t == second.run_state.t
    assert not keeper.write()
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


# The command line.


def command(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return in_process.completed(*arguments, folder=folder)


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(Path(lagcli.__file__).parent.parent)}


@pytest.mark.skipif(sys.platform == "win32", reason="signals of a terminal are others there")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_process_goes_on_byte_for_byte(tmp_path: Path, number: int, code: int) -> None:
    (tmp_path / "m.yaml").write_text(PENDULUM)
    # Fewer rows than steps: most of the time the run is between rows.
    options = ["simulate", "m.yaml", "--duration", "600", "--output-step", "0.5", "-q", "--compile", "never"]
    files = ["-o", "run.csv", "--checkpoint", "c.json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "lagcli", *options, *files], cwd=tmp_path, env=environment(),
        stderr=subprocess.PIPE,
    )  # fmt: skip
    deadline = time.monotonic() + 30
    while not (tmp_path / "c.json").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.15)
    process.send_signal(number)
    err = process.communicate()[1].decode()
    assert process.returncode == code, err
    first = (tmp_path / "run.csv.partial").read_bytes()
    assert f"{checkpoint.read(tmp_path / 'c.json').run_state.row!r}," in first.decode().splitlines()[-1] + ","
    resumed = command(
        *options, "-o", "rest.csv", "--checkpoint", "c.json", "--resume", "c.json", folder=tmp_path
    )
    assert resumed.returncode == 0, resumed.stderr
    assert command(*options, "-o", "whole.csv", folder=tmp_path).returncode == 0
    header, _, rest = (tmp_path / "rest.csv").read_bytes().partition(b"\n")
    assert first.startswith(header)
    assert first + rest == (tmp_path / "whole.csv").read_bytes()
    again = command(*options, "--resume", "c.json", folder=tmp_path)
    assert again.returncode == 2
    assert "--resume c.json: nothing is left to do" in again.stderr


def test_options_that_do_not_fit_exit_2_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(SLEIGH)
    (tmp_path / "old.json").write_text("{}")
    for arguments, sentence in (
        (["--resume", "old.json"], "--resume old.json: it is no checkpoint"),
        (["--resume", "none.json"], "--resume: there is no file none.json"),
        (["--resume", "-"], "--resume: a file name is needed"),
        (["--checkpoint", "-"], "--checkpoint: a file name is needed"),
        (["--checkpoint", "m.yaml"], "--checkpoint m.yaml: that is the file of MODEL"),
        (["-o", "a.csv", "--checkpoint", "a.csv"], "--checkpoint a.csv: that is the file of --output"),
        (["--stats", "a.json", "--checkpoint", "a.json"], "--checkpoint a.json: that is the file of --stats"),
        (["-o", "old.json", "--resume", "old.json"], "--resume old.json: that is the file of --output"),
    ):
        done = command("simulate", "m.yaml", *arguments, folder=tmp_path)
        assert (done.returncode, done.stdout) == (2, ""), done.stderr
        assert sentence in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.yaml", "old.json"]


def test_later_rows_never_replace_the_complete_table_of_the_run_before(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(PENDULUM)
    options = ["simulate", "m.yaml", "--output-step", "0.5", "--checkpoint", "c.json", "-q", "-o", "run.csv"]
    assert command(*options, "--duration", "1", folder=tmp_path).returncode == 0
    whole = (tmp_path / "run.csv").read_bytes()
    longer = command(*options, "--duration", "2", "--resume", "c.json", folder=tmp_path)
    assert (longer.returncode, longer.stdout) == (2, "")
    assert longer.stderr.startswith(
        "lagcli: --output run.csv: that is the table of the run before, and a resumed run"
    )
    assert (tmp_path / "run.csv").read_bytes() == whole
    (tmp_path / "run.csv").rename(tmp_path / "first.csv")
    assert command(*options, "--duration", "2", "--resume", "c.json", folder=tmp_path).returncode == 0
    assert (tmp_path / "run.csv").read_text().splitlines()[1].startswith("1.5,")


def test_a_checkpoint_that_cannot_be_made_exits_74(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(SLEIGH)
    done = command("simulate", "m.yaml", "--checkpoint", "none/c.json", folder=tmp_path)
    assert (done.returncode, done.stdout) == (74, "")
    assert "none/c.json" in done.stderr


# The account.


@pytest.mark.parametrize("rows", [3, 100_001])
def test_the_account_holds_the_wall_time(rows: int) -> None:
    model = lagcli.loads(PENDULUM)
    missing = []
    for _ in range(4):
        began = time.perf_counter()
        run = lagcli.simulate(model, duration=1, samples=rows)
        seconds = time.perf_counter() - began
        missing.append(seconds - run.stats.compile_seconds - run.stats.solve_seconds)
    # Beside other work a run may be put to sleep at any moment: the best of a few counts.
    assert -1e-6 <= min(missing) < 0.05  # a machine may be slow; what was forgotten once took seconds
