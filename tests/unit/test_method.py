"""The seam for schemes: one that is written here is taken by its name, and every column of its table has its order."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.input import keys
from lagcli.model import settings
from lagcli.model.settings import Simulation
from lagcli.simulation.scheme import method
from lagcli.simulation.scheme.method import Method
from tests.helpers.bogacki_shampine import BogackiShampine
from tests.helpers.projected_midpoint import ProjectedMidpoint
from tests.helpers.runge_kutta_4 import RungeKutta4

# The disk on an incline, pushed so that nothing is a polynomial of t.
ROLLING = """\
lagcli: 1
parameters: {M: 2, a: 0.5}
coordinates:
  x: {value: 0, rate: 0}
  y: {value: 0, rate: -a*4}
  theta: {value: 0, rate: 1.25}
  phi: {value: 0, rate: 4}
lagrangian: M*(rate(x)**2 + rate(y)**2)/2 + M*a**2*rate(phi)**2/4 + M*a**2*rate(theta)**2/8 - 3*x - theta**2/2
differential:
  roll_x: d(x) - a*sin(theta)*d(phi) = 0
  roll_y: d(y) + a*cos(theta)*d(phi) = 0
simulation: {duration: 2}
"""
# A pendulum, on a pivot that stands still or moves.
PENDULUM = """\
lagcli: 1
particles:
  a: {mass: 1.5, position: [0.6, 0, -0.8], velocity: [VELOCITY, 0, 0]}
forces:
  weight: {to: all, force: [0, 0, -9.81*m]}
holonomic:
  rod: distance(a, [PIVOT, 0, 0]) = 1
  plane: a.y = 0
simulation: {duration: 2}
"""


PARTICLE = {"r": ["a.x", "a.z"], "v": ["a.vx", "a.vz"], "lambda": ["lambda.rod"], "R": ["R.a.x", "R.a.z"]}
DISK = {
    "r": ["x", "y", "theta", "phi"],
    "v": ["rate(x)", "rate(y)", "rate(theta)", "rate(phi)"],
    "lambda": ["lambda.roll_x", "lambda.roll_y"],
    "R": ["R.x", "R.y", "R.phi"],
}
CASES = {
    "pendulum": (PENDULUM.replace("PIVOT", "0").replace("VELOCITY", "0"), PARTICLE),
    "rolling disk": (ROLLING, DISK),
    "rheonomic": (PENDULUM.replace("PIVOT", "0.3*sin(3*t)").replace("VELOCITY", "0.9"), PARTICLE),
}
STEPS = (0.02, 0.01, 0.005)


def registered(monkeypatch: pytest.MonkeyPatch, scheme: type[Method]) -> str:
    """The name of a scheme, registered as one of the package."""
    name = str(scheme.name)
    monkeypatch.setitem(method.METHODS, name, scheme)
    monkeypatch.setattr(settings, "METHOD_NAMES", (*settings.METHOD_NAMES, name))
    monkeypatch.setattr(settings, "METHODS", (*settings.METHODS, name))
    return name


@pytest.fixture
def rk4(monkeypatch: pytest.MonkeyPatch) -> str:
    """See `registered`."""
    return registered(monkeypatch, RungeKutta4)


@pytest.fixture
def bs23(monkeypatch: pytest.MonkeyPatch) -> str:
    """See `registered`."""
    return registered(monkeypatch, BogackiShampine)


@pytest.fixture
def pm2(monkeypatch: pytest.MonkeyPatch) -> str:
    """See `registered`."""
    return registered(monkeypatch, ProjectedMidpoint)


@pytest.mark.parametrize("case", CASES)
def test_every_column_has_the_order_of_the_scheme(rk4: str, case: str) -> None:
    """Positions, velocities, multipliers and constraint forces, at the ends of steps and between them."""
    text, kinds = CASES[case]
    model = lagcli.loads(text)
    exact = lagcli.simulate(model, samples=37, rtol=1e-13)
    runs = [lagcli.simulate(model, samples=37, method=rk4, max_step=h, rtol=0.1) for h in STEPS]
    assert all(run.stats.method == rk4 for run in runs)
    for kind, columns in kinds.items():
        errors = [max(np.abs(run[name] - exact[name]).max() for name in columns) for run in runs]
        ratios = [first / second for first, second in itertools.pairwise(errors)]
        assert ratios == pytest.approx([16, 16], rel=0.15), (kind, errors)


@pytest.mark.parametrize("case", CASES)
def test_its_states_are_on_the_constraints(rk4: str, case: str) -> None:
    stats = lagcli.simulate(lagcli.loads(CASES[case][0]), samples=37, method=rk4, max_step=0.02).stats
    assert max(stats.position_drift, stats.velocity_drift) <= 1e-13


def test_a_step_counts_the_evaluations_of_its_method(rk4: str) -> None:
    model = lagcli.loads(CASES["pendulum"][0])
    few, many = (lagcli.simulate(model, samples=2, method=rk4, max_step=h).stats for h in STEPS[:2])
    assert many.evaluations - few.evaluations == 4 * (many.steps - few.steps)


def test_a_run_goes_on_with_its_own_scheme(rk4: str, tmp_path: Path) -> None:
    model, point = lagcli.loads(CASES["rheonomic"][0]), tmp_path / "run.json"
    chosen = {"output_step": 0.25, "method": rk4, "max_step": 0.02}
    whole = lagcli.simulate(model, duration=2, **chosen)
    first = lagcli.simulate(model, duration=1, checkpoint=point, **chosen)
    second = lagcli.simulate(model, duration=2, resume=point, **chosen)
    assert np.array_equal(np.concatenate([first.rows, second.rows]), whole.rows)
    with pytest.raises(ValueError, match="`method` is rk4 in it and dop853 here"):
        lagcli.simulate(model, duration=2, resume=point, **{**chosen, "method": "dop853"})


def test_all_schemes_have_their_names() -> None:
    """Names stand below the numbers; each leads to a scheme, `auto` to the first."""
    assert tuple(method.METHODS) == settings.METHOD_NAMES
    for name in settings.METHODS:
        found: Method = method.of(Simulation(method=name))
        assert found.name == (settings.METHOD_NAMES[0] if name == "auto" else name)
    assert keys.FORMAT.key("simulation").key("method").holds == "`auto` or `dop853`"


def test_a_scheme_of_another_program_is_told_which_there_are(rk4: str) -> None:
    """The sentences hold with another scheme beside the first."""
    for name in ("ode45", "radau", "rattle"):
        ((key, sentence),) = settings.faults(Simulation(method=name))
        assert key == "method"
        assert f"there are auto, dop853, {rk4}: " in sentence
        assert not re.search(r"is the explicit|there is no (implicit|symplectic)|one scheme", sentence)


def test_the_page_on_schemes_shows_the_one_that_is_tested() -> None:
    root = Path(__file__).resolve().parents[2]
    page = (root / "docs" / "how-to" / "add-a-scheme.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert shown in (root / "tests" / "helpers" / "runge_kutta_4.py").read_text(encoding="utf-8")
    told = page.replace(shown, "")
    for name in ("step", "dense", "interpolated", "order", "evaluations", "dense_evaluations"):
        assert f"`{name}`" in told, name


MODELS = Path(__file__).parents[2] / "models"
# Parts of their durations, where a run is long: 87 000 steps of order 3 in `bricard`, where the projection holds them
# short, and not the tolerance.
SHORTENED = {"bricard": 0.05, "chain": 0.2, "sphere-pile": 0.1}


@pytest.mark.parametrize("model", sorted(path.stem for path in MODELS.glob("*.yaml")))
def test_the_gallery_runs_to_its_end_under_a_scheme_of_order_3(bs23: str, model: str) -> None:
    """No number of the run counts in steps of the scheme there is: singular configurations, contacts and events are
    met with steps of any length."""
    loaded = lagcli.load(MODELS / f"{model}.yaml")
    duration = SHORTENED.get(model, 1.0) * loaded.simulation.duration
    coarse = lagcli.simulate(loaded, method=bs23, rtol=1e-4, duration=duration)
    fine = lagcli.simulate(loaded, duration=duration)
    assert coarse.t[-1] == pytest.approx(fine.t[-1], rel=1e-4)
    assert len(coarse.events) == len(fine.events)


HOLONOMIC = {
    path.stem: lagcli.load(path)
    for path in MODELS.glob("*.yaml")
    if re.search(r"^holonomic:", path.read_text(encoding="utf-8"), re.MULTILINE)
    and path.stem != "bricard"  # whose start takes longer than all other runs
}


@pytest.mark.parametrize("model", sorted(HOLONOMIC))
def test_a_scheme_that_keeps_the_constraints_within_its_step_is_one_too(pm2: str, model: str) -> None:
    """Singular configurations, contacts and events of the holonomic models are met as by the scheme there is."""
    loaded = HOLONOMIC[model]
    part = 0.1 * SHORTENED.get(model, 1.0)
    chosen = {"duration": part * loaded.simulation.duration, "samples": 11}
    coarse, fine = lagcli.simulate(loaded, method=pm2, rtol=1e-3, **chosen), lagcli.simulate(loaded, **chosen)
    assert [one.kind for one in coarse.events] == [one.kind for one in fine.events]
    assert max(coarse.stats.position_drift, coarse.stats.velocity_drift) <= 1e-13
    names = [*loaded.coordinate_names]
    size = max(np.abs(fine[name]).max() for name in names)
    assert max(np.abs(coarse[name] - fine[name]).max() for name in names) <= 1e-2 * size


@pytest.mark.parametrize("case", CASES)
def test_it_is_of_its_order(pm2: str, case: str) -> None:
    text, kinds = CASES[case]
    model = lagcli.loads(text)
    exact = lagcli.simulate(model, samples=37, rtol=1e-13)
    runs = [lagcli.simulate(model, samples=37, method=pm2, max_step=h, rtol=0.1) for h in STEPS]
    errors = [max(np.abs(run[name] - exact[name]).max() for name in kinds["r"]) for run in runs]
    ratios = [first / second for first, second in itertools.pairwise(errors)]
    assert ratios == pytest.approx([4, 4], rel=0.15), errors
