"""The objects of the Python interface: mappings, frames, short to look at, models by their path."""

from __future__ import annotations

import copy
import inspect
import json
import pickle
import sys
import xml.etree.ElementTree
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

import lagcli
from tests.helpers import pendulum

PENDULUM = (
    pendulum.HANGING.replace("-L]", "-L], velocity: [1, 0, 0]") + "simulation: {duration: 1, samples: 5}\n"
)


@pytest.fixture(scope="module")
def run() -> lagcli.Trajectory:
    return lagcli.simulate(lagcli.loads(PENDULUM))


def test_a_run_is_a_mapping_of_its_columns(run: lagcli.Trajectory) -> None:
    assert isinstance(run, Mapping)
    assert list(run) == list(run.columns)
    assert len(run) == len(run.columns)
    assert "t" in run
    assert "u" not in run
    plain = dict(run)
    assert type(plain) is dict
    assert all(np.array_equal(plain[name], run.rows[:, i]) for i, name in enumerate(run.columns))
    assert run.get("nothing") is None


@pytest.mark.parametrize(
    ("look", "hint"),
    [
        (lambda run: run["lambda.rodd"], "`lambda.rod`"),
        (lambda run: run["a.X"], "`a.x`"),
        (lambda run: run.multiplier("rodd"), "`lambda.rod`"),
        (lambda run: run.reaction("A"), "`R.a`"),
    ],
)
def test_a_misspelt_column_is_a_key_error_with_the_nearest(run: lagcli.Trajectory, look, hint: str) -> None:
    with pytest.raises(KeyError, match="did you mean") as caught:
        look(run)
    assert hint in str(caught.value)


def test_a_run_is_not_changed_by_accident_and_can_be_stored(run: lagcli.Trajectory) -> None:
    with pytest.raises(TypeError):
        run["t"] = run["t"] + 1
    with pytest.raises(TypeError):
        del run["t"]
    for same in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run)):
        assert same.columns == run.columns
        assert np.array_equal(same.rows, run.rows)
        assert same.stats == run.stats
    assert run == run
    assert run != copy.copy(run)
    assert hash(run) is not None


class Frame:
    """Stands for pandas.DataFrame and xarray.Dataset: what they are called with."""

    def __init__(self, data, columns=None, coords=None, attrs=None) -> None:
        self.data, self.columns, self.coords, self.index, self.attrs = data, columns, coords, None, attrs

    def set_index(self, name: str) -> Frame:
        self.index = name
        return self


def test_frames_are_made_where_the_libraries_are(run: lagcli.Trajectory, monkeypatch) -> None:
    module = type(sys)("stand_in")
    module.DataFrame = module.Dataset = Frame
    monkeypatch.setitem(sys.modules, "pandas", module)
    monkeypatch.setitem(sys.modules, "xarray", module)
    frame = run.to_pandas()
    assert frame.columns == list(run.columns)
    assert np.array_equal(frame.data, run.rows)
    assert frame.index == "t"
    data = run.to_xarray()
    assert list(data.data) == list(run.columns[1:])
    assert all(dimension == "t" for dimension, _, _ in data.data.values())
    assert np.array_equal(data.coords["t"][1], run.t)
    for units in (frame.attrs["units"], {name: more["units"] for name, (_, _, more) in data.data.items()}):
        assert [units[name] for name in ("a.x", "a.vx", "lambda.rod", "R.a.x", "energy")] == [
            "m", "m/s", "N", "N", "J",
        ]  # fmt: skip
    assert frame.attrs["provenance"] == run.stats.provenance.as_json()
    assert json.loads(data.attrs["provenance"])["parameters"] == run.stats.provenance.parameters


@pytest.mark.parametrize("library", ["pandas", "xarray"])
def test_a_missing_library_is_named(run: lagcli.Trajectory, monkeypatch, library: str) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=f"pip install {library}"):
        getattr(run, f"to_{library}")()


def test_frames_of_the_libraries_themselves(run: lagcli.Trajectory) -> None:
    pandas = pytest.importorskip("pandas")
    assert list(pandas.DataFrame(run).columns) == list(run.columns)
    assert run.to_pandas().index.name == "t"
    assert run.to_pandas().attrs["units"]["lambda.rod"] == "N"
    xarray = pytest.importorskip("xarray")
    data = run.to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert data["lambda.rod"].attrs["units"] == "N"
    assert data["t"].attrs["units"] == "s"
    assert len(data) == len(run.columns) - 1


MARKUP = """\
lagcli: 1
title: "<script>alert(1)</script> $x$ \u202e & more"
parameters: {m: 1}
particles: {a: {mass: m, position: [1, 0, 0]}}
holonomic: {rod: norm(a) = 1, low: a.y < 1000000}
"""


def test_notebooks_show_pages_in_which_nothing_is_injected() -> None:
    model = lagcli.loads(MARKUP.replace(", low: a.y < 1000000", ""))
    made = lagcli.simulate(model, duration=0.1, samples=3)
    for result in (model, made, lagcli.check(model), lagcli.audit(model, made), lagcli.derive(model)):
        page = result._repr_html_()
        assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
        assert "<script" not in page
        assert "\u202e" not in page
        assert len(page) < 30_000
        root = xml.etree.ElementTree.fromstring(page)
        assert root.tag == "div"
    assert "norm(a) = 1" in model._repr_html_()
    assert "degrees of freedom: 2" in lagcli.check(model)._repr_html_()
    assert "All checks passed." in lagcli.audit(model)._repr_html_()


def test_a_derivation_has_its_equations_in_latex() -> None:
    shown = lagcli.derive(lagcli.loads(PENDULUM))._repr_latex_()
    assert shown.count("$$") % 2 == 0
    assert shown.count("$$") > 10
    assert r"\tag{D.24}" in shown
    assert r"\documentclass" not in shown


def test_a_family_of_thousands_is_a_short_page_too() -> None:
    text = (
        "lagcli: 1\nparticles:\n  p[i]: {for: 'i = 1..3000', mass: 1, position: '[i, 0, 0]'}\n"
        "holonomic:\n  q[i]: {for: 'i = 1..3000', equation: 'p[i].z = 0'}\n"
    )
    model = lagcli.loads(text)
    assert len(model._repr_html_()) < 2000
    assert "q: 3000" in model._repr_html_()


LONG = PENDULUM + "description: " + "many words " * 500 + "\n"


def results() -> list[object]:
    model = lagcli.loads(LONG)
    report = lagcli.check(model)
    made = lagcli.simulate(model)
    return [
        *[model, model.particles, model.forces, model.holonomic, model.parameters, report, report.dof],
        *[report.constraints[0], made, made.stats, lagcli.audit(model, made), lagcli.compare(model)],
        *[lagcli.compare(model).formulations, lagcli.derive(model), lagcli.displacements(model)],
    ]


def test_everything_is_a_few_lines_to_look_at() -> None:
    for result in results():
        assert len(repr(result)) < 1200, type(result)
        assert "many words many words many words many words" not in repr(result)


def test_a_family_of_thousands_is_a_few_lines_too() -> None:
    text = (
        "lagcli: 1\nparticles:\n  p[i]: {for: 'i = 1..5000', mass: 1, position: '[i, 0, 0]'}\n"
        "holonomic:\n  q[i]: {for: 'i = 1..5000', equation: 'p[i].z = 0'}\n"
    )
    model = lagcli.loads(text)
    assert repr(model) == "<Model from <text>: 5000 particles, 1 constraint>"
    assert len(repr(model.particles)) < 1200


def test_a_derivation_prints_its_text() -> None:
    derived = lagcli.derive(lagcli.loads(PENDULUM))
    assert str(derived) == derived.text()
    assert "Constraints" in str(derived)


def test_a_path_is_taken_wherever_a_model_is(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(PENDULUM, encoding="utf-8")
    assert lagcli.simulate(str(path), samples=3).t.tolist() == [0, 0.5, 1]
    assert lagcli.dof(path).configuration_dof == 1
    assert lagcli.check(path).dof.configuration_dof == 1
    assert lagcli.audit(path, samples=201).passed
    assert lagcli.compare(path, path, duration=0.1).agree
    assert "Constraints" in str(lagcli.derive(path))
    assert lagcli.displacements(str(path)).q.size == 3
    with pytest.raises(FileNotFoundError):
        lagcli.simulate("nothing.yaml")


@pytest.mark.parametrize("name", ["dof", "check", "simulate", "audit", "compare", "derive", "displacements"])
def test_signatures_name_every_option(name: str) -> None:
    signature = inspect.signature(getattr(lagcli, name))
    assert all(p.kind is not inspect.Parameter.VAR_KEYWORD for p in signature.parameters.values())
    assert signature.return_annotation not in (inspect.Signature.empty, "Any")
    with pytest.raises(TypeError, match="unknown_option"):
        getattr(lagcli, name)(lagcli.loads(PENDULUM), unknown_option=1)


def test_every_setting_of_a_run_is_an_option_of_simulate() -> None:
    import dataclasses

    from lagcli.model.settings import Simulation

    options = inspect.signature(lagcli.simulate).parameters.keys()
    assert {field.name for field in dataclasses.fields(Simulation)} <= options


JUMPING = """
lagcli: 1
particles: {p: {mass: 1, position: [-1, 0, 0], velocity: [1, 0, 0]}}
forces: {w: {potential: "sign(p.x)"}}
simulation: {duration: 2, samples: 5}
"""


@pytest.mark.parametrize(
    "fails",
    [
        lambda: lagcli.loads("lagcli: 1\nparticles: 3"),
        lambda: lagcli.simulate(lagcli.loads(JUMPING)),
        lambda: lagcli.simulate(lagcli.loads(PENDULUM), columns="zz"),
        lambda: lagcli.plot("motion.doc", "figure.png"),
    ],
)
def test_what_is_raised_comes_whole_from_another_process(fails: Callable[[], object]) -> None:
    """A pool of processes that cannot read an exception waits for ever."""
    with pytest.raises(Exception) as caught:  # noqa: PT011 - each of its own type
        fails()
    raised = caught.value
    again = pickle.loads(pickle.dumps(raised))
    assert (type(again), str(again), vars(again).keys()) == (type(raised), str(raised), vars(raised).keys())
    if isinstance(raised, lagcli.ModelError):
        assert again.diagnostics == raised.diagnostics
    if isinstance(raised, lagcli.SimulationStopped):
        assert (again.t, again.code, again.stats) == (raised.t, raised.code, raised.stats)
        np.testing.assert_array_equal(again.trajectory.rows, raised.trajectory.rows)
