"""The Python API as a contract, and what each use of the package may load."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lagcli
from tests.helpers import pendulum

ROOT = Path(lagcli.__file__).parent.parent
MODELS = Path(__file__).parents[2] / "models"

PENDULUM = pendulum.HANGING + "simulation: {duration: 1, samples: 5}\n"
BAR = """\
lagcli: 1
coordinates: {theta: {value: 0.5}}
particles:
  a: {mass: 1, position: "[sin(theta), 0, -cos(theta)]"}
  b: {mass: 1, position: [1, 0, 0]}
  c: {mass: 1, position: [2, 0, 0]}
rigid: {bar: [b, c]}
holonomic:
  hold: b = [1, 0, 0]
  turn: theta = 1/2
simulation: {duration: 0.5, samples: 3}
"""
COLLAPSE = """\
lagcli: 1
coordinates: {x: {value: 1}}
lagrangian: rate(x)**2/2 + 1/x
simulation: {duration: 2, samples: 41}
"""


# The functions


def test_the_names_of_the_package_are_those_of_its_contract() -> None:
    assert {"load", "loads", "dof", "check", "simulate", "ModelError"} <= set(lagcli.__all__)
    assert all(getattr(lagcli, name) is not None for name in lagcli.__all__)
    assert lagcli.__version__.count(".") == 2
    with pytest.raises(AttributeError, match="nonsense"):
        lagcli.nonsense  # noqa: B018


def test_load_takes_a_path_as_text_or_object() -> None:
    text = lagcli.load(str(MODELS / "pendulum.yaml"))
    assert text.path == str(MODELS / "pendulum.yaml")
    assert lagcli.load(MODELS / "pendulum.yaml") == text


def test_load_and_loads_read_the_same_model(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(PENDULUM)
    assert lagcli.load(path).fingerprint == lagcli.loads(PENDULUM).fingerprint


def test_a_missing_file_raises_as_any_missing_file() -> None:
    with pytest.raises(FileNotFoundError):
        lagcli.load("nothing.yaml")


def test_an_invalid_model_raises_all_its_errors() -> None:
    with pytest.raises(lagcli.ModelError) as caught:
        lagcli.loads(PENDULUM.replace("norm(a)", "norm(b)").replace("a.y", "c.y"))
    assert [found.code for found in caught.value.diagnostics] == ["unknown-name", "unknown-name"]
    assert [found.location.line for found in caught.value.diagnostics] == [9, 10]
    assert "<text>:9:17: error[unknown-name]" in str(caught.value)


@pytest.mark.parametrize("value", [2, 2.0, "2", "1 + 1", np.float64(2)])
def test_parameters_override_those_of_the_file(value: object) -> None:
    run = lagcli.simulate(lagcli.loads(PENDULUM, parameters={"m": value}))
    assert run["lambda.rod"] == pytest.approx(2 * 9.81)


@pytest.mark.parametrize("start", [[0, 0, -2], "[0, 0, -2]", (0.0, "0", "-2"), np.array([0, 0, -2.0])])
def test_initial_values_are_overridden_as_on_the_command_line(start: object) -> None:
    run = lagcli.simulate(lagcli.loads(PENDULUM, parameters={"a.position": start, "L": 2}))
    assert run["a.z"][0] == -2
    with pytest.raises(lagcli.OverrideError, match=r"write `a\.position`"):
        lagcli.loads(PENDULUM, parameters={"a.positon": start})


def test_dof_gives_the_count() -> None:
    counted = lagcli.dof(lagcli.loads(PENDULUM))
    assert counted.configuration_dof == 1
    assert (counted.particles, counted.coordinates, counted.holonomic) == (1, 3, 2)
    assert (counted.nonholonomic, counted.redundant, counted.velocity_dof) == (0, 0, 1)
    assert counted.proof == "numeric"


def test_dof_of_an_undecided_model_is_none_with_the_reason() -> None:
    counted = lagcli.dof(lagcli.load(MODELS / "rolling-disk.yaml"))
    if counted.configuration_dof is None:
        assert counted.reason
        low, high = counted.bounds
        assert low < high


def test_check_gives_the_object_behind_the_json() -> None:
    report = lagcli.check(lagcli.load(MODELS / "spoke.yaml"))
    whole = report.as_json()
    assert list(whole) == ["dof", "constraints", "joint", "initial", "warnings", "dependences"]
    assert all(report[key] == whole[key] for key in whole)
    assert json.loads(json.dumps(whole)) == whole
    assert report["dof"] == lagcli.dof(lagcli.load(MODELS / "spoke.yaml")).as_json()
    assert {c.verdict.row: c.verdict.kind for c in report.constraints}["spoke"] == "integrable"


def test_simulate_gives_columns_by_name() -> None:
    run = lagcli.simulate(lagcli.loads(PENDULUM))
    assert run.columns[:4] == ("t", "a.x", "a.y", "a.z")
    assert run.t.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert isinstance(run["lambda.rod"], np.ndarray)
    assert run["lambda.rod"].shape == run["R.a.z"].shape == (5,)
    assert run["R.a.z"] == pytest.approx(9.81)
    assert run.rows.shape == (5, len(run.columns))
    with pytest.raises(KeyError, match="nonsense"):
        run["nonsense"]


def test_multipliers_and_reactions_have_their_shapes() -> None:
    run = lagcli.simulate(lagcli.loads(BAR))
    assert run.multiplier("turn").shape == (3,)
    assert run.multiplier("hold").shape == (3, 3)
    assert run.multiplier("bar").shape == (3, 1)
    assert run.reaction("b").shape == run.reaction("a").shape == (3, 3)
    assert run.reaction("theta").shape == (3,)
    assert np.array_equal(run.reaction("b")[:, 2], run["R.b.z"])
    for wrong in ("rod", "bar.1.2", ""):
        with pytest.raises(KeyError):
            run.multiplier(wrong)
    with pytest.raises(KeyError):
        run.reaction("nobody")


def test_the_account_of_a_run_is_that_of_the_command_line() -> None:
    stats = lagcli.simulate(lagcli.loads(PENDULUM)).stats
    assert list(stats.as_json()) == [
        *["steps", "rejected", "evaluations", "compile_seconds", "solve_seconds", "method"],
        *["position_drift", "velocity_drift", "energy_imbalance", "indeterminate", "singular_times"],
        *["stopped", "ended_by", "rows", "t_end", "provenance"],
        *["rtol", "atol"],
        *["impacts", "releases", "accumulations", "largest_penetration", "warnings", "native_steps"],
    ]
    assert stats.solve_seconds > 0
    assert stats.method == "dop853"


def test_keywords_are_the_options_of_the_command_line() -> None:
    model = lagcli.loads(PENDULUM)
    run = lagcli.simulate(model, duration=2, output_step=0.5, rtol=1e-8, atol=1e-10, method="dop853")
    assert run.t.tolist() == [0, 0.5, 1, 1.5, 2]
    assert lagcli.simulate(model, start=3, samples=2).t.tolist() == [3, 4]
    moved = lagcli.loads(PENDULUM, parameters={"a.x": 0.1})
    with pytest.raises(lagcli.ModelError, match="inconsistent-start"):
        lagcli.simulate(moved)
    assert lagcli.simulate(moved, assemble=True).t.size == 5
    with pytest.raises(TypeError, match="durration"):
        lagcli.simulate(model, durration=2)
    for wrong in ({"duration": -1}, {"samples": 1}, {"samples": 3, "output_step": 0.1}, {"method": "magic"}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            lagcli.simulate(model, **wrong)


def test_a_stopped_run_raises_with_its_rows() -> None:
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(lagcli.loads(COLLAPSE))
    stopped = caught.value
    assert stopped.t == pytest.approx(np.pi / np.sqrt(8), abs=1e-6)
    assert "stopped at t = 1.11" in stopped.reason
    assert stopped.trajectory.t[-1] == pytest.approx(1.1)
    assert np.isfinite(stopped.trajectory.rows).all()


def test_a_model_is_data_that_can_be_used_again() -> None:
    model = lagcli.loads(PENDULUM)
    first, second = lagcli.simulate(model), lagcli.simulate(model)
    assert np.array_equal(first.rows, second.rows)
    assert hash(model) == hash(lagcli.loads(PENDULUM))
    with pytest.raises(AttributeError):
        model.title = "another"  # type: ignore[misc]


def test_columns_in_another_order_keep_their_values() -> None:
    model = lagcli.loads(PENDULUM)
    plain, turned = lagcli.simulate(model), lagcli.simulate(model, columns="lambda.*,R.*,*")
    assert turned.columns != plain.columns
    assert set(turned.columns) == set(plain.columns)
    for column in plain.columns:
        assert np.array_equal(turned[column], plain[column])


# What is loaded

WATCHED = (
    *["numpy", "casadi", "sympy", "mpmath", "scipy", "matplotlib", "PIL", "yaml", "typer", "rich"],
    *["orjson", "pyarrow", "pandas", "pydantic", "IPython", "unittest", "multiprocessing", "asyncio"],
)
PROBE = f"""
import json, sys
def loaded():
    return [name for name in {WATCHED!r} if name in sys.modules]
def command(*arguments):
    from lagcli import __main__
    sys.argv = ["lagcli", *arguments]
    try:
        __main__.main()
    except SystemExit as end:
        assert end.code in (0, None), end.code
"""


def loads_of(code: str) -> set[str]:
    """The libraries of `WATCHED` that a fresh interpreter has loaded after the code."""
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    script = f"{PROBE}\n{code}\nprint(); print(json.dumps(loaded()))"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=MODELS, env=env, capture_output=True, text=True, check=True
    )
    return set(json.loads(done.stdout.splitlines()[-1]))


LIGHT = {"numpy", "casadi", "yaml"}


@pytest.mark.parametrize(
    ("code", "allowed"),
    [
        ("import lagcli", set()),
        ("import lagcli; lagcli.load('pendulum.yaml')", LIGHT),
        ("import lagcli; lagcli.dof(lagcli.load('pendulum.yaml'))", LIGHT),
        ("import lagcli; lagcli.simulate(lagcli.load('pendulum.yaml'), duration=0.1)", LIGHT),
        ("import lagcli; lagcli.check(lagcli.load('knife-edge.yaml'))", LIGHT | {"sympy", "mpmath"}),
        ("command('--help')", {"yaml", "typer"}),
        ("command('explain', 'syntax')", {"yaml", "typer"}),
        ("command('dof', 'pendulum.yaml')", LIGHT | {"typer"}),
        ("command('dof', 'pendulum-angle.yaml', '--json')", LIGHT | {"typer"}),
        ("command('check', 'pendulum.yaml')", LIGHT | {"typer", "rich"}),
        ("command('simulate', 'pendulum.yaml', '--duration', '0.1')", LIGHT | {"typer", "orjson"}),
    ],
)
def test_nothing_is_loaded_before_it_is_needed(code: str, allowed: set[str]) -> None:
    assert loads_of(code) <= allowed


@pytest.mark.parametrize("ending", ["csv", "npz", "json", "parquet", "png"])
def test_a_format_loads_its_own_library_and_no_other(tmp_path: Path, ending: str) -> None:
    option = "--plot" if ending == "png" else "-o"
    target = str(tmp_path / f"run.{ending}")
    code = f"command('simulate', 'pendulum.yaml', '-q', '--duration', '0.1', {option!r}, {target!r})"
    own = {"parquet": {"pyarrow", "pandas"}, "png": {"matplotlib", "PIL", "unittest"}}.get(ending, set())
    assert loads_of(code) <= LIGHT | {"typer", "orjson"} | own


def test_columns_are_chosen_as_on_the_command_line() -> None:
    model = lagcli.load(MODELS / "pendulum.yaml")
    run = lagcli.simulate(model, duration=1, samples=3, columns="t,lambda.*")
    assert run.columns == ("t", "lambda.rod", "lambda.plane")
    assert run["lambda.rod"].shape == (3,)
    with pytest.raises(ValueError, match=r"lamda"):
        lagcli.simulate(model, duration=1, samples=3, columns="lamda.*")
