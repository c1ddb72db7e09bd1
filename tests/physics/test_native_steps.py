"""A run that goes on in native code has the bits of one that does not: rows, incidents, counts and the state at its
end."""

from __future__ import annotations

import dataclasses
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import lagcli
from lagcli import memory

pytest.importorskip("llvmlite")

from lagcli.model import settings
from lagcli.native import object_folder, operations, paying
from lagcli.running.run_account import Stats
from lagcli.simulation import native_steps
from lagcli.simulation.native_steps import NativeFunctions

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))
# The best code of these takes some seconds to make, of others some tenths.
LARGE = {"chain", "cloth", "bricard", "sphere-pile"}

PENDULUM = """
lagcli: 1
particles: {a: {mass: 1, position: [1, 0, 0]}}
forces: {weight: {to: a, force: [0, 0, -9.81]}}
holonomic: {rod: a.x**2 + a.y**2 + a.z**2 - 1}
simulation: {duration: 5, samples: 51}
"""


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("LAGCLI_CACHE", str(tmp_path / "cache"))
    memory.forget()  # functions that have code stay for other runs of the same text


@pytest.fixture
def soon(monkeypatch):
    """Code of the first level is the best there is: it takes a tenth of the time to make."""
    monkeypatch.setattr(native_steps, "BEST", native_steps.SOON)


def bits(run):
    """All that a run gives, but for the seconds it took, and what took its steps."""
    stats = {
        field.name: getattr(run.stats, field.name)
        for field in dataclasses.fields(Stats)
        if "seconds" not in field.name and field.name not in ("provenance", "native_steps")
    }
    events = {name: np.asarray(run.events[name]).tobytes() for name in run.events.columns}
    return {name: np.asarray(run[name]).tobytes() for name in run.columns}, events, stats


def ran(model, mode, **settings):
    try:
        return bits(lagcli.simulate(model, compile=mode, **settings))
    except lagcli.SimulationStopped as stopped:
        return bits(stopped.partial), str(stopped)


@pytest.mark.numeric
@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_every_model_of_the_gallery_has_the_same_bits(path, soon):
    model = lagcli.load(path)
    duration = model.simulation.duration * (0.1 if path.stem in LARGE else 1.0)
    assert ran(model, "always", duration=duration) == ran(model, "never", duration=duration)


def test_native_code_takes_nearly_all_steps_of_an_ordinary_run():
    stats = lagcli.simulate(lagcli.loads(PENDULUM), compile="always").stats
    assert stats.steps - 2 <= stats.native_steps < stats.steps


@pytest.mark.parametrize(
    ("name", "longest", "others"),
    [
        ("water-vibrations", None, 2),
        ("pendulum", 0.01, 2),
        ("particle-in-a-box", None, 33),
        ("stadium", None, 9),
    ],
)
def test_it_takes_steps_that_are_cut_or_screened_and_those_behind_impacts(name, longest, others, soon):
    model = lagcli.load(next(path for path in MODELS if path.stem == name))
    run = lagcli.simulate(model, compile="always", max_step=longest)
    assert bits(run) == bits(lagcli.simulate(model, compile="never", max_step=longest))
    assert run.stats.steps - run.stats.native_steps <= others


def test_a_chain_of_a_hundred_links_has_native_code(soon):
    links = """
lagcli: 1
particles:
  p[i]: {for: "i = 1..100", mass: 1, position: [0.6*i, 0, -0.8*i]}
forces: {weight: {to: p, force: [0, 0, -9.81*m]}}
holonomic:
  hook: norm(p[1]) = 1
  link[i]: {for: "i = 2..100", equation: "distance(p[i], p[i-1]) = 1"}
simulation: {duration: 0.1, samples: 3}
"""
    run = lagcli.simulate(lagcli.loads(links), compile="always")
    assert bits(run) == bits(lagcli.simulate(lagcli.loads(links), compile="never"))
    assert run.stats.native_steps


def test_a_run_goes_over_to_native_code_when_it_pays(monkeypatch):
    model = lagcli.loads(PENDULUM)
    plain = bits(lagcli.simulate(model, duration=20, compile="never"))
    monkeypatch.setattr(paying, "PARAMETERS", SimpleNamespace(loaded=20, soon=100, best=1e9, at_once=5e8))
    memory.forget()
    run = lagcli.simulate(model, duration=20)
    assert bits(run) == plain
    assert run.stats.steps - 110 < run.stats.native_steps <= run.stats.steps - 99


def test_the_best_code_is_made_beside_and_taken_while_the_run_goes_on(monkeypatch):
    # A step at once
    monkeypatch.setattr(paying, "PARAMETERS", SimpleNamespace(loaded=20, soon=20, best=60, at_once=1.0))
    levels = []
    take = NativeFunctions._take

    def noted(self, code, level):
        take(self, code, level)
        levels.append((level, threading.current_thread() is threading.main_thread()))

    monkeypatch.setattr(NativeFunctions, "_take", noted)
    model = lagcli.loads(PENDULUM)
    run = lagcli.simulate(model, duration=20)
    for thread in threading.enumerate():
        if thread is not threading.main_thread() and thread.daemon and thread.name == native_steps.THREAD:
            thread.join(60)
    assert levels == [(native_steps.SOON, True), (native_steps.BEST, False)]
    assert bits(run) == bits(lagcli.simulate(model, duration=20, compile="never"))


def test_a_checkpoint_holds_nothing_of_it_and_a_run_may_go_on_the_other_way(tmp_path, soon):
    model = lagcli.loads(PENDULUM)
    texts = []
    for mode in ("always", "never"):
        lagcli.simulate(model, compile=mode, duration=2.5, samples=26, checkpoint=tmp_path / mode)
        texts.append((tmp_path / mode).read_text(encoding="utf-8"))
    assert texts[0] == texts[1]
    rests = [
        bits(lagcli.simulate(model, compile=mode, samples=51, resume=tmp_path / other))[0]
        for mode, other in (("always", "never"), ("never", "always"))
    ]
    assert rests[0] == rests[1]


def test_code_that_is_kept_is_taken_and_a_damaged_one_is_made_again(monkeypatch, soon):
    model = lagcli.loads(PENDULUM)
    expected = bits(lagcli.simulate(model, compile="always"))
    (kept,) = object_folder.folder().glob(f"*{object_folder.ENDING}")
    made = []
    make = native_steps.machine_code.made
    monkeypatch.setattr(native_steps.machine_code, "made", lambda *args: made.append(args) or make(*args))
    memory.forget()
    assert bits(lagcli.simulate(model, compile="always")) == expected
    assert not made
    memory.forget()
    kept.write_bytes(kept.read_bytes()[:-100] + b"x" * 100)
    assert bits(lagcli.simulate(model, compile="always")) == expected
    assert len(made) == 1


def test_the_time_in_which_code_is_made_is_none_of_the_steps(monkeypatch, soon):
    look = NativeFunctions.look

    def slow(self, *args):
        time.sleep(0.2)
        look(self, *args)

    monkeypatch.setattr(NativeFunctions, "look", slow)
    stats = lagcli.simulate(lagcli.loads(PENDULUM), compile="always").stats
    assert stats.compile_seconds >= 0.2 > stats.solve_seconds


def test_where_no_code_can_be_made_the_interpreter_takes_all_steps(monkeypatch):
    monkeypatch.delitem(operations.ROWS, "OP_MUL")
    run = lagcli.simulate(lagcli.loads(PENDULUM), compile="always")
    assert not run.stats.native_steps
    assert bits(run) == bits(lagcli.simulate(lagcli.loads(PENDULUM), compile="never"))


def test_always_without_the_library_names_what_installs_it(monkeypatch):
    monkeypatch.setattr(settings, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r'pip install "lagcli\[fast\]"'):
        lagcli.simulate(lagcli.loads(PENDULUM), compile="always")
