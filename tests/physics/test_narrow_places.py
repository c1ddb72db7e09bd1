"""Walls, wells and steps that are passed whole between two rows: found beside turns and zeros of their arguments."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

import lagcli
from lagcli.compiled import narrow_arguments
from lagcli.compiled.narrow_arguments import PARAMETERS
from lagcli.equations import system
from lagcli.input import document

Floats = npt.NDArray[np.float64]

# A potential of the distance u in widths, whose value is 1 at its place, or behind it.
WALLS = {
    "gauss": "exp(-(U)**2)",
    "flat gauss": "exp(-(U)**4)",
    "cusp": "exp(-abs(U))",
    "far": "1/(1 + (U)**2)",
    "rational": "1/(1 + (U)**2)**4",
    "power": "(1 + (U)**2)**(-3)",
    "root": "1/sqrt(1 + (U)**2)",
    "two steps": "(tanh((U) + 1) - tanh((U) - 1))/2/tanh(1)",
    "square": "1 - tanh(U)**2",
    "compact": "max(0, 1 - (U)**2)**4",
    "corner": "max(0, 1 - abs(U))**2",
}
STEPS = {
    "tanh": "(1 + tanh(U))/2",
    "atan": "atan(U)/pi + 0.5",
    "ramp": "max(0, min(1, U))",
    "logistic": "1/(1 + exp(-20*tanh(U)))",
}


def final(potential: str, width: float, place: str = "(x - 4.2371)", rows: int = 11) -> lagcli.Trajectory:
    """A coordinate that comes with rate 1, at the end of 10 s."""
    U = f"{place}/{width}"
    text = f"""\
lagcli: 1
coordinates: {{x: {{value: 0, rate: 1}}}}
lagrangian: "rate(x)**2/2 - ({potential.replace("U", U)})"
simulation: {{duration: 10, samples: {rows}}}
"""
    return lagcli.simulate(lagcli.loads(text))


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("name", WALLS)
def test_a_wall_between_two_rows_turns_back_what_is_too_slow(name: str, width: float) -> None:
    run = final(f"0.8*({WALLS[name]})", width)
    assert run.stats.warnings == ()
    assert run["rate(x)"][-1] == pytest.approx(-1, abs=1e-3)
    # It turns back some widths before the middle.
    assert run["x"][-1] == pytest.approx(2 * 4.2371 - 10, abs=40 * width)


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("name", STEPS)
def test_a_step_between_two_rows_takes_its_energy(name: str, width: float) -> None:
    run = final(f"0.3*({STEPS[name]})", width)
    assert run["rate(x)"][-1] == pytest.approx(math.sqrt(0.4), abs=width)


@pytest.mark.parametrize("rows", [2, 3, 101])
def test_a_rotor_turns_back_at_a_narrow_wall_however_few_rows_there_are(rows: int) -> None:
    run = final("0.8*exp(-(U)**2)", 1e-3, "2*sin((x - 1.3)/2)", rows)
    # It swings between two walls that are a turn apart.
    assert run["rate(x)"][-1] == pytest.approx(1, abs=1e-6)
    assert run["x"][-1] == pytest.approx(
        10 + 2 * (1.3 - 2 * math.pi) - 2 * 1.3 + 2 * math.pi - 2 * math.pi, abs=0.02
    )


def test_a_rotor_among_many_walls_stays_between_two() -> None:
    run = final("0.8*exp(-(U)**2)", 1e-3, "2*sin(50*(x - 1.3))", 2)
    assert abs(run["x"][-1]) < math.pi / 50


def test_a_pair_meets_off_its_middle_with_a_range_of_a_thousandth() -> None:
    text = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}
  b: {mass: 2, position: [5.3, 0.0003, 0]}
forces: {p: {potential: "0.8*exp(-(distance(a, b)/0.001)**2)"}}
simulation: {duration: 10, samples: 11}
"""
    run = lagcli.simulate(lagcli.loads(text))
    assert abs(run["a.vy"][-1]) > 0.1
    assert run["energy"][-1] == pytest.approx(0.5, abs=1e-9)


def arguments(potential: str) -> narrow_arguments.NarrowArguments:
    text = f"lagcli: 1\ncoordinates: {{x: {{value: 0, rate: 1}}}}\nlagrangian: 'rate(x)**2/2 - {potential}'\n"
    found = narrow_arguments.find(system.build(document.read(text, "model.yaml")), False)
    assert found is not None
    return found


def passes(potential: str, h: float) -> bool:
    found = arguments(potential)
    y, k, new = np.array([-h / 2, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([h / 2, 1.0, 0.0])
    return bool(found.passes(0.0, h, y, k, new, k, []) > 0)


def test_a_feature_is_narrow_where_its_argument_changes_by_eight_units() -> None:
    assert not passes("tanh(x)", 7.0)
    assert passes("tanh(x)", 14.0)


def test_an_argument_that_waves_within_a_step_is_looked_at() -> None:
    """`sin` has the same sign and slope at both ends of a wave."""
    found, h = arguments("exp(20*sin(x))"), 2 * math.pi
    x = np.array([0.0, PARAMETERS.inner * h, h])
    u, slope = 20 * np.sin(x), h * 20 * np.cos(x)
    assert np.array(found.waves(u[0], slope[0], u[1], u[2], slope[2], PARAMETERS.units)).all()
    # A parabola is none.
    u, slope = x**2, 2 * h * x
    assert not np.array(found.waves(u[0], slope[0], u[1], u[2], slope[2], PARAMETERS.units)).any()


def test_a_piece_is_cut_inside() -> None:
    assert 0.1 < PARAMETERS.inner < 0.9


def test_a_smooth_run_has_the_steps_it_had(monkeypatch: pytest.MonkeyPatch) -> None:
    def run() -> lagcli.Trajectory:
        return final("5*(1 - exp(-2*(x - 1)))**2 + 0.1*x**2", 1.0)

    looked = run()
    monkeypatch.setattr(narrow_arguments, "find", lambda *_: None)
    assert run().rows.tobytes() == looked.rows.tobytes()
