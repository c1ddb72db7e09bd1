"""Forces that act for a short time: no step leads over what a model says about t alone, and rows see the rest."""

from __future__ import annotations

import functools
import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.integrate

import lagcli
from lagcli.simulation.stepping import timetable
from lagcli.simulation.stepping.timetable import Timetable
from lagcli.smoothness import time_functions
from tests.helpers.in_process import command as command

Floats = npt.NDArray[np.float64]
Curve = Callable[[Floats], Floats]
Columns = dict[str, Callable[[float, Floats], float]]

# What is compared is of the size of one. The defaults promise 1e-11 of a motion that amplifies nothing.
CLOSE = 2e-11


def free(force: str, simulation: str = "duration: 10, samples: 101", more: str = "") -> str:
    """A particle of mass 2 that moves along x, and is pushed along y."""
    return f"""\
lagcli: 1
{more}
particles: {{a: {{mass: 2, position: [0, 0, 0], velocity: [1, 0, 0]}}}}
forces: {{push: {{to: a, force: "[0, {force}, 0]"}}}}
simulation: {{{simulation}}}
"""


def integral(force: Curve, t: Floats, corners: tuple[float, ...] = ()) -> tuple[Floats, Floats]:
    """The integrals of F and of (t - s) F(s) up to each time, by Gauss's formula on short pieces.

    corners: where the force jumps or has a kink.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    impulse, path = np.zeros(t.size), np.zeros(t.size)
    for i in range(1, t.size):
        cuts = [t[i - 1], *(c for c in corners if t[i - 1] < c < t[i]), t[i]]
        edges = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in itertools.pairwise(cuts)]))
        half, middle = np.diff(edges)[:, None] / 2, (edges[1:] + edges[:-1])[:, None] / 2
        s = middle + half * nodes
        F = force(s.ravel()).reshape(s.shape)
        impulse[i] = impulse[i - 1] + (half * weights * F).sum()
        path[i] = path[i - 1] + impulse[i - 1] * (t[i] - t[i - 1]) + (half * weights * F * (t[i] - s)).sum()
    return impulse, path


def square(a: float, b: float) -> Curve:
    return lambda t: np.where((t > a) & (t < b), 1.0, 0.0)


SQUARE = ("(sign(t - 3.45) - sign(t - 3.95))/2", square(3.45, 3.95), (3.45, 3.95))
PULSES: dict[str, tuple[str, Curve, tuple[float, ...]]] = {
    "gauss": ("exp(-((t - 7.1)/0.3)**2)", lambda t: np.exp(-(((t - 7.1) / 0.3) ** 2)), ()),
    "narrow gauss": ("exp(-((t - 7.15)/0.004)**2)", lambda t: np.exp(-(((t - 7.15) / 0.004) ** 2)), (7.15,)),
    "cosh": ("1/cosh((t - 7.1)/0.1)", lambda t: 1 / np.cosh((t - 7.1) / 0.1), ()),
    "exponential": ("exp(-abs(t - 5.03)/0.05)", lambda t: np.exp(-np.abs(t - 5.03) / 0.05), (5.03,)),
    "lorentz": ("1/(1 + ((t - 5)/0.05)**2)**4", lambda t: 1 / (1 + ((t - 5) / 0.05) ** 2) ** 4, ()),
    "product": (
        "(1 + tanh((t - 4)/0.05))*(1 - tanh((t - 4.3)/0.05))/4",
        lambda t: (1 + np.tanh((t - 4) / 0.05)) * (1 - np.tanh((t - 4.3) / 0.05)) / 4,
        (),
    ),
    "periodic": ("exp(-400*(1 - cos(2*t)))", lambda t: np.exp(-400 * (1 - np.cos(2 * t))), ()),
    "square": SQUARE,
    "short square": (
        "max(0, sign(0.005 - abs(t - 3.045)))",
        square(3.04, 3.05),
        (3.04, 3.05),
    ),
    "square of a product": ("(1 + sign((t - 3.001)*(3.003 - t)))/2", square(3.001, 3.003), (3.001, 3.003)),
    "triangle": (
        "max(0, 1 - abs(t - 6.02)/0.03)",
        lambda t: np.maximum(0, 1 - np.abs(t - 6.02) / 0.03),
        (5.99, 6.02, 6.05),
    ),
    "ramp": (
        "min(1, max(0, (t - 4.05)/0.02)) - min(1, max(0, (t - 4.5)/0.02))",
        lambda t: np.clip((t - 4.05) / 0.02, 0, 1) - np.clip((t - 4.5) / 0.02, 0, 1),
        (4.05, 4.07, 4.5, 4.52),
    ),
    "half waves": (
        "max(0, sin(20*t))",
        lambda t: np.maximum(0, np.sin(20 * t)),
        tuple(k * math.pi / 20 for k in range(64)),
    ),
    "switched": ("sign(sin(t))", lambda t: np.sign(np.sin(t)), (math.pi, 2 * math.pi, 3 * math.pi)),
    "saw": (
        "asin(sin(3*t))",
        lambda t: np.arcsin(np.sin(3 * t)),
        tuple((k + 0.5) * math.pi / 3 for k in range(10)),
    ),
    "power of a number": ("2**(-((t - 7.15)/0.02)**2)", lambda t: 2.0 ** -(((t - 7.15) / 0.02) ** 2), ()),
    "jump at a pole": (
        "atan(1/(t - 5.0371))",
        lambda t: np.arctan(1 / (t - 5.0371)),
        (5.0371,),
    ),
    "saw of a tangent": (
        "1 + atan(tan(t))",
        lambda t: 1 + np.arctan(np.tan(t)),
        tuple((k + 0.5) * math.pi for k in range(3)),
    ),
    "root": (
        "sqrt(max(0, 0.04 - (t - 5)**2))**3",
        lambda t: np.maximum(0, 0.04 - (t - 5) ** 2) ** 1.5,
        (4.8, 5.2),
    ),
}


@pytest.mark.parametrize("name", PULSES)
@pytest.mark.parametrize("speed", [0, 1])
def test_a_pulse_moves_a_free_particle(name: str, speed: int) -> None:
    text, force, corners = PULSES[name]
    model = free(f"4*({text})").replace("velocity: [1,", f"velocity: [{speed},")
    run = lagcli.simulate(lagcli.loads(model))
    impulse, path = integral(force, run.t, corners)
    assert np.abs(run["a.vy"] - 2 * impulse).max() < CLOSE
    assert np.abs(run["a.y"] - 2 * path).max() < CLOSE
    assert np.abs(run["a.x"] - speed * run.t).max() < CLOSE


# Forces whose terms cancel at a start at rest: stairs of rounding, or small and exact beside larger terms.
CANCELLING: dict[str, tuple[str, Curve]] = {
    "late": ("1 + tanh((t - 4)/0.05)", lambda t: 2 / (1 + np.exp(-40 * (t - 4)))),
    "early": ("1 + tanh((t - 4)/0.5)", lambda t: 2 / (1 + np.exp(-4 * (t - 4)))),
    "wave": ("1 - cos(t)", lambda t: 2 * np.sin(t / 2) ** 2),
    "exact": ("k*t - k*t + 1e-12*sin(t)", lambda t: 1e-12 * np.sin(t)),
    "exact and tiny": ("k - k + 1e-25*sin(t)", lambda t: 1e-25 * np.sin(t)),
}


@pytest.mark.parametrize("name", CANCELLING)
def test_forces_that_cancel_at_rest_take_few_steps_and_lose_nothing(name: str) -> None:
    text, force = CANCELLING[name]
    model = free(text, more="parameters: {k: 1}").replace("velocity: [1,", "velocity: [0,")
    run = lagcli.simulate(lagcli.loads(model))
    impulse, path = integral(force, run.t)
    assert np.abs(run["a.vy"] - impulse / 2).max() < CLOSE * impulse[-1]
    assert np.abs(run["a.y"] - path / 2).max() < CLOSE * path[-1]
    assert run.stats.steps < 4000


def test_a_pulse_below_what_was_rounding_before_it_is_not_passed_over() -> None:
    """The terms are 1e6 at the start, where they cancel, and the pulse is 1e-29."""
    run = lagcli.simulate(
        lagcli.loads(free("1e6*(1 + tanh((t - 4)/0.05))*exp(-20*t)").replace("[1, 0", "[0, 0"))
    )
    impulse, path = integral(lambda t: 2e6 * np.exp(-20 * t) / (1 + np.exp(-40 * (t - 4))), run.t)
    assert np.abs(run["a.vy"] - impulse / 2).max() < 1e-7 * impulse[-1]
    assert np.abs(run["a.y"] - path / 2).max() < 1e-7 * path[-1]


def reference(
    rate: Callable[[float, Floats], Floats], y0: list[float], t: Floats, corners: tuple[float, ...] = ()
) -> Floats:
    """y (len(t), len(y0)) of y' = rate(t, y), by SciPy in short steps that end at corners."""
    rows, y = [np.array(y0)], np.array(y0)
    for a, b in itertools.pairwise(t.tolist()):
        cuts = [a, *(c for c in corners if a < c < b), b]
        for low, high in itertools.pairwise(cuts):
            # Closed pieces: the value at a corner is that of the piece.
            inside = functools.partial(_inside, rate, low, high)
            found = scipy.integrate.solve_ivp(
                inside, (low, high), y, method="DOP853", rtol=3e-14, atol=1e-15, max_step=(b - a) / 2
            )
            y = found.y[:, -1]
        rows.append(y)
    return np.array(rows)


def _inside(rate: Callable[[float, Floats], Floats], low: float, high: float, t: float, y: Floats) -> Floats:
    edge = 1e-13 * (high - low)
    return rate(min(max(t, low + edge), high - edge), y)


G = 9.81


def bump(t: float, at: float, width: float) -> float:
    return math.exp(-(((t - at) / width) ** 2))


def bump_rates(t: float, at: float, width: float) -> tuple[float, float, float]:
    """A Gaussian pulse and its first and second derivative."""
    u, value = (t - at) / width, bump(t, at, width)
    return value, -2 * u / width * value, (4 * u * u - 2) / width**2 * value


PENDULUM = """\
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, -1]}}
holonomic: {rod: norm(a) = 1}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, kick: {to: a, force: "[%s, 0, 0]"}}
simulation: {duration: 40, samples: 401}
"""
SIDEWAYS: dict[str, tuple[str, Callable[[float], float], tuple[float, ...]]] = {
    "smooth": ("5*exp(-((t - 31)/0.5)**2)", lambda t: 5 * bump(t, 31, 0.5), ()),
    "short": ("5*exp(-((t - 37)/0.05)**2)", lambda t: 5 * bump(t, 37, 0.05), ()),
    "square": ("5*(sign(t - 31) - sign(t - 31.2))/2", lambda t: 5.0 * (31 < t < 31.2), (31.0, 31.2)),
}


@pytest.mark.parametrize("name", SIDEWAYS)
def test_a_kick_moves_a_pendulum_that_hangs_at_rest(name: str) -> None:
    text, force, corners = SIDEWAYS[name]
    run = lagcli.simulate(lagcli.loads(PENDULUM % text), digits=True)

    def rate(t: float, y: Floats) -> Floats:
        return np.array([y[1], -G * math.sin(y[0]) + force(t) * math.cos(y[0])])

    late = run.t >= 28
    angle, speed = reference(rate, [0.0, 0.0], run.t[late], corners).T
    assert np.abs(angle).max() > 0.1
    assert np.abs(run["a.x"][~late]).max() < 1e-12
    assert np.abs(run["a.x"][late] - np.sin(angle)).max() < 1e-9
    assert np.abs(run["a.vx"][late] - speed * np.cos(angle)).max() < 1e-9
    # R along the rod, from Newton's law; at a corner itself the force has a value of its own.
    push = np.array([force(t) for t in run.t[late]])
    tension = speed**2 + G * np.cos(angle) + push * np.sin(angle)
    away = ~np.isin(np.round(run.t[late], 9), corners)
    assert np.abs((run["R.a.x"][late] + np.sin(angle) * tension)[away]).max() < 1e-8
    assert np.abs((run["R.a.z"][late] - np.cos(angle) * tension)[away]).max() < 1e-8
    assert np.abs((run["lambda.rod"][late] + tension)[away]).max() < 1e-8
    assert run.digits["r"] > 9


def test_a_row_with_a_pulse_moves_a_particle_on_a_circle() -> None:
    """Uniform motion on a circle that becomes wider for a moment: the angular momentum stays."""
    row = "a.x**2 + a.y**2 = (1 + exp(-((t - 6.02)/0.02)**2)/5)**2"
    text = f"""\
lagcli: 1
particles: {{a: {{mass: 2, position: [1, 0, 0], velocity: [0, 0.05, 0]}}}}
holonomic: {{circle: "{row}", plane: a.z = 0}}
simulation: {{samples: 101}}
"""
    run = lagcli.simulate(lagcli.loads(text))
    L = 0.05

    def radius(t: float) -> tuple[float, float, float]:
        value, first, second = bump_rates(t, 6.02, 0.02)
        return 1 + value / 5, first / 5, second / 5

    angle = reference(lambda t, y: np.array([L / radius(t)[0] ** 2]), [0.0], run.t)[:, 0]
    r, r1, r2 = np.array([radius(t) for t in run.t]).T
    omega = L / r**2
    assert np.abs(run["a.x"] - r * np.cos(angle)).max() < 1e-10
    assert np.abs(run["a.vy"] - (r1 * np.sin(angle) + r * omega * np.cos(angle))).max() < 1e-9
    inward = 2 * (r2 - r * omega**2)
    assert np.abs(run["R.a.x"] - inward * np.cos(angle)).max() < 1e-8 * np.abs(inward).max()
    # R = lambda B with B = 2 (x, y), as f is the square.
    assert np.abs(run["lambda.circle"] - inward / (2 * r)).max() < 1e-8 * np.abs(inward).max()


# Of each: the model, y' of a reduced description, its start, corners, and columns as functions of t and y.
def _dependent() -> tuple[str, Callable[[float, Floats], Floats], list[float], tuple[float, ...], Columns]:
    """A bead on a horizontal line that is dragged along itself: only the drag by the air pushes it."""
    text = """\
lagcli: 1
coordinates: {s: {value: 0, rate: 0}}
particles: {b: {mass: 1, position: ["s + exp(-((t - 6.03)/0.02)**2)", 0, 0]}}
"""
    return (
        text,
        lambda t, y: np.array([y[1], -bump_rates(t, 6.03, 0.02)[2]]),
        [0.0, 0.0],
        (),
        {"s": lambda t, y: y[0], "b.x": lambda t, y: y[0] + bump(t, 6.03, 0.02)},
    )


def _inertia() -> tuple[str, Callable[[float, Floats], Floats], list[float], tuple[float, ...], Columns]:
    """A mass that doubles for a moment: the momentum stays."""
    text = """\
lagcli: 1
coordinates: {x: {value: 0, rate: 1}}
lagrangian: (1 + exp(-((t - 6.03)/0.02)**2))*rate(x)**2/2
"""
    return (
        text,
        lambda t, y: np.array([1 / (1 + bump(t, 6.03, 0.02))]),
        [0.0],
        (),
        {"x": lambda t, y: y[0], "rate(x)": lambda t, y: 1 / (1 + bump(t, 6.03, 0.02))},
    )


def _potential() -> tuple[str, Callable[[float, Floats], Floats], list[float], tuple[float, ...], Columns]:
    """A slope for a moment, by a definition."""
    text = """\
lagcli: 1
parameters: {at: 6.03, w: 0.02}
definitions: {tilt: "1/cosh((t - at)/w)"}
coordinates: {x: {value: 0, rate: 0}}
lagrangian: rate(x)**2/2
forces: {slope: {potential: 3*tilt*x}}
"""
    return (
        text,
        lambda t, y: np.array([y[1], -3 / math.cosh(min(700.0, abs(t - 6.03) / 0.02))]),
        [0.0, 0.0],
        (),
        {"x": lambda t, y: y[0], "rate(x)": lambda t, y: y[1]},
    )


def _differential() -> tuple[str, Callable[[float, Floats], Floats], list[float], tuple[float, ...], Columns]:
    """A belt that runs for a moment and takes a block with it; the load on it is lambda."""
    text = """\
lagcli: 1
coordinates: {x: {value: 0, rate: 0}, y: {value: 0, rate: 1}}
lagrangian: rate(x)**2/2 + rate(y)**2/2
differential: {belt: "d(x) = max(0, 1 - abs(t - 6.02)/0.03)**3*dt"}
"""

    def run(t: float) -> float:
        return max(0.0, 1 - abs(t - 6.02) / 0.03)

    return (
        text,
        lambda t, y: np.array([run(t) ** 3]),
        [0.0],
        (5.99, 6.02, 6.05),
        {
            "x": lambda t, y: y[0],
            "rate(x)": lambda t, y: run(t) ** 3,
            "y": lambda t, y: t,
            "lambda.belt": lambda t, y: -3 * run(t) ** 2 * np.sign(t - 6.02) / 0.03,
        },
    )


def _family() -> tuple[str, Callable[[float, Floats], Floats], list[float], tuple[float, ...], Columns]:
    """Particles that are pushed one after another."""
    text = """\
lagcli: 1
particles: {"p[i]": {for: "i = 1 .. 3", mass: 1, position: ["i", 0, 0]}}
forces: {"push[i]": {for: "i = 1 .. 3", to: "p[i]", force: "[0, max(0, 1 - abs(t - 2*i - 0.05)/0.02), 0]"}}
"""

    def push(t: float, i: int) -> float:
        return max(0.0, 1 - abs(t - 2 * i - 0.05) / 0.02)

    corners = tuple(2 * i + 0.05 + side for i in (1, 2, 3) for side in (-0.02, 0, 0.02))
    return (
        text,
        lambda t, y: np.array([*y[3:], *(push(t, i) for i in (1, 2, 3))]),
        [0.0] * 6,
        corners,
        {
            "p[1].y": lambda t, y: y[0],
            "p[3].y": lambda t, y: y[2],
            "p[2].vy": lambda t, y: y[4],
            "p[3].vy": lambda t, y: y[5],
        },
    )


@pytest.mark.parametrize("make", [_dependent, _inertia, _potential, _differential, _family])
def test_a_pulse_anywhere_in_a_model_is_seen(make: Callable[[], Any]) -> None:
    text, rate, start, corners, columns = make()
    run = lagcli.simulate(lagcli.loads(text), samples=101, digits=True, limit=0)
    y = reference(rate, start, run.t, corners)
    for name, curve in columns.items():
        expected = np.array([curve(t, row) for t, row in zip(run.t, y, strict=True)])
        assert np.abs(run[name] - expected).max() < 1e-10 * max(1.0, np.abs(expected).max()), name
    assert run.digits["v"] > 8
    assert run.stats.accuracy.parted is None


# Pulses that depend on the place too are seen where rows lie in them.
def test_rows_see_a_pulse_that_travels() -> None:
    force = "exp(-((t - 60 - a.x)/0.3)**2)"
    text = free(force, "duration: 100, samples: 1001").replace("velocity: [1,", "velocity: [0.5,")
    run = lagcli.simulate(lagcli.loads(text))
    # It goes through the particle at t = 120 with half of its speed, and so takes no part in the first 100 s.
    assert np.abs(run["a.vy"]).max() < 1e-12
    longer = lagcli.simulate(lagcli.loads(text), duration=200)
    assert longer["a.vy"][-1] == pytest.approx(0.3 * math.sqrt(math.pi) / 2 / 0.5, rel=1e-10)


HIDDEN = "100*exp(-((t - 5.0375)/0.002 - a.y)**2)"


def test_where_two_runs_see_different_forces_it_is_reported() -> None:
    model = lagcli.loads(free(HIDDEN))
    run = lagcli.simulate(model, digits=True)
    known = run.stats.accuracy
    assert known is not None
    if abs(run["a.vy"][-1]) < 1e-3:  # what the run has missed, the other has seen
        assert known.digits["v"] < 1
        assert known.parted is not None
        assert known.parted[0] < 5.0375 < known.parted[1]
        assert "--max-step" in known.sentence
    run = lagcli.simulate(model, digits=True, max_step=0.002)
    assert run["a.vy"][-1] == pytest.approx(0.1 * math.sqrt(math.pi), rel=1e-3)
    assert run.stats.accuracy.parted is None
    assert run.digits["v"] > 9


def test_no_step_is_longer_than_the_largest() -> None:
    model = lagcli.loads(free("0"))
    assert lagcli.simulate(model).stats.steps < 50
    run = lagcli.simulate(model, max_step=0.01)
    assert 1000 <= run.stats.steps < 1030  # the first ones grow
    assert np.abs(run["a.x"] - run.t).max() < 1e-13


@pytest.mark.parametrize(
    ("value", "words"),
    [(0, "positive"), (-1, "positive"), (math.nan, "positive"), (math.inf, "finite"), (1e-12, "steps")],
)
def test_a_largest_step_that_is_none_is_refused(value: float, words: str) -> None:
    with pytest.raises(ValueError, match=f"max_step: .*{words}"):
        lagcli.simulate(lagcli.loads(free("0")), max_step=value)


def test_the_commands_take_a_largest_step(command: Any, tmp_path: Path) -> None:
    file, stats = tmp_path / "model.yaml", tmp_path / "stats.json"
    file.write_text(free(HIDDEN), encoding="utf-8")
    _, told, code = command("simulate", file, "--max-step", "0.5", "--digits", "--stats", stats)
    assert code == 0
    account = json.loads(stats.read_text(encoding="utf-8"))
    assert account["steps"] >= 20
    assert (account["repeated"]["parted"] is None) == ("go apart" not in told)
    assert account["repeated"]["steps"] >= 40
    for line in (["simulate"], ["compare"], ["audit"]):
        _, told, code = command(*line, file, "--max-step", "0")
        assert code == 2
        assert "largest step must be positive" in told
    out, _, code = command("compare", file, "--max-step", "0.02", "--json", "--samples", "11")
    assert code == 0
    assert all(each["steps"] >= 500 for each in json.loads(out)["formulations"])


def test_a_checkpoint_knows_the_largest_step(tmp_path: Path) -> None:
    model, file = lagcli.loads(free("max(0, sin(20*t))")), tmp_path / "run.json"
    lagcli.simulate(model, duration=2, max_step=0.05, checkpoint=file)
    with pytest.raises(ValueError, match=r"`max_step` is 0\.05 in it and not given here"):
        lagcli.simulate(model, duration=4, resume=file)
    whole = lagcli.simulate(model, duration=4, output_step=0.1, max_step=0.05)
    lagcli.simulate(model, duration=2, output_step=0.1, max_step=0.05, checkpoint=file)
    rest = lagcli.simulate(model, duration=4, output_step=0.1, max_step=0.05, resume=file)
    assert rest.rows.tobytes() == whole.rows[whole.t > 2].tobytes()


@pytest.mark.parametrize("name", ["narrow gauss", "half waves", "triangle", "switched", "saw"])
def test_a_run_with_pulses_goes_on_bit_for_bit(name: str, tmp_path: Path) -> None:
    text, _, corners = PULSES[name]
    model, file = lagcli.loads(free(f"4*({text})")), tmp_path / "run.json"
    whole = lagcli.simulate(model, duration=10, output_step=0.1)
    for end in (0.0, math.pi, 5.0, corners[0] or 0.3, 7.1):
        lagcli.simulate(model, duration=end, output_step=0.1, checkpoint=file)
        rest = lagcli.simulate(model, duration=10, output_step=0.1, resume=file)
        assert 0 < rest.t[0] - end < 0.1 + 1e-9
        assert rest.rows.tobytes() == whole.rows[-len(rest.t) :].tobytes()


# A run that begins or ends at a switch, and rows on it.
@pytest.mark.parametrize(("start", "duration"), [(3.45, 0.5), (3.0, 0.45), (3.0, 0.95), (3.45, 1.0)])
def test_a_run_may_begin_and_end_at_a_switch(start: float, duration: float) -> None:
    text = free(f"4*{SQUARE[0]}", f"start: {start}, duration: {duration}, samples: 20")
    run = lagcli.simulate(lagcli.loads(text), digits=True)
    expected = 2 * np.clip(run.t - 3.45, 0, 0.5)
    assert np.abs(run["a.vy"] - expected).max() < 1e-14
    assert run.digits["r"] > 10


def test_a_velocity_that_jumps_in_time_stops_the_run() -> None:
    text = """\
lagcli: 1
particles: {a: {mass: 1, position: [5, 0, 0], velocity: [-1, 0, 0]}}
holonomic: {led: a.x = abs(t - 5)}
simulation: {samples: 101}
"""
    with pytest.raises(lagcli.SimulationStopped, match=r"abs|jump") as stopped:
        lagcli.simulate(lagcli.loads(text))
    assert stopped.value.t == pytest.approx(5, abs=1e-12)
    run = stopped.value.trajectory
    assert np.abs(run["a.x"] - (5 - run.t)).max() < 1e-13
    assert run.t[-1] > 4.85


@pytest.mark.parametrize("start", [0.0, 3.0, 1e3, 1e6])
def test_digits_of_a_square_pulse_do_not_stop(start: float) -> None:
    """Where the jump lies may be known to the rounding of the time alone."""
    text = free(f"4*(sign(t - {start + 3.45}) - sign(t - {start + 3.95}))/2", f"start: {start}, samples: 101")
    run = lagcli.simulate(lagcli.loads(text), digits=True)
    assert run["a.vy"][-1] == pytest.approx(1, abs=1e-14 + 4e-16 * start)


@pytest.mark.parametrize("force", ["-sign(a.y - 0.3)", "4*sign(a.x - 3.45)", "abs(a.x - 2)"])
def test_digits_of_a_force_that_jumps_in_place_do_not_stop(force: str) -> None:
    run = lagcli.simulate(lagcli.loads(free(force, "duration: 5, samples: 101")), digits=True)
    assert run.t[-1] == 5


def test_compare_sees_the_pulse_in_every_formulation() -> None:
    text = PENDULUM.replace("duration: 40", "duration: 8") % "5*exp(-((t - 6.03)/0.05)**2)"
    found = lagcli.compare(lagcli.loads(text))
    assert found.agree


# The timetable by itself.
def spoken(force: str) -> time_functions.TimeFunctions | None:
    return time_functions.functions(lagcli.loads(free(force)))


def test_a_model_without_t_has_no_timetable() -> None:
    assert spoken("sign(a.x) + 3*exp(-a.y**2)") is None


def test_smooth_functions_of_t_and_sums_need_no_witnesses() -> None:
    for force in ("t**2/3 + sin(t)*a.x", "exp(-t**2)*norm(a.v)", "3*t - a.y**2"):
        found = spoken(force)
        assert found is not None
        assert found.is_bounded
        assert not found.is_mixed
    for force in ("exp(-(t - a.x)**2)", "1/(1 + (t - a.x)**2)", "sign(t - a.y)", "sin(2*t - a.x)"):
        found = spoken(force)
        assert found is not None
        assert found.is_mixed


def test_switches_are_found_to_the_last_bit() -> None:
    cases = {
        "sign(t - 3.45)": [3.45],
        "sign((t - 3.001)*(3.003 - t))": [3.001, 3.003],
        "max(t, 2)*min(4, t)": [2.0, 4.0],
        "abs(sin(t))": [0.0, math.pi, 2 * math.pi, 3 * math.pi],
        "sign(max(0, t - 5))": [5.0],
        "sign(t**2 - 2)": [math.sqrt(2)],
        "sign(exp(t) - 100)": [math.log(100)],
        "sqrt(abs(t - 1))**3": [1.0],
    }
    for force, expected in cases.items():
        table, found, t = Timetable(spoken(force), 0.0, 0.01), [], 0.0
        while t < 10:
            at = table.switch(t)
            if at is not None:
                found.append(at[0])
                t = at[1]
            t += table.shortened(t, 10.0 - t + 1e-3)
        assert found == pytest.approx(expected, abs=4e-15), force


def test_constants_of_the_timetable() -> None:
    """A step passes functions that change by 2 * (BETWEEN + CHANGE) of their range at most, less than a pulse has."""
    assert 2 * (timetable.PARAMETERS.between + timetable.PARAMETERS.change) < 2
    table = Timetable(spoken("exp(-((t - 5)/0.001)**2)"), 0.0, 1.0)
    t, ends = 0.0, []
    while t < 10:
        t += table.shortened(t, 100.0)
        ends.append(t)
    assert any(abs(end - 5) < 0.0015 for end in ends)
    assert len(ends) < 20


@pytest.mark.parametrize(
    "force", ["sign(sin(1/(t - 2)))", "sign(sin(1e6*t))", "exp(sin(1e7*t))", "tan(1e5*t)"]
)
def test_the_search_is_bounded(force: str) -> None:
    table = Timetable(spoken(force), 0.0, 0.1)
    assert 0 < table.shortened(0.0, 10.0) <= 10
    assert len(table._switches) + len(table._stationary_times) < 20 * timetable.PARAMETERS.most_cells


def test_a_chain_of_definitions_needs_no_deep_stack() -> None:
    chain = {"d0": "2", **{f"d{i}": f"d{i - 1} + 1" for i in range(1, 1500)}}
    late = {"s0": "t", **{f"s{i}": f"s{i - 1} + 1" for i in range(1, 1500)}}
    lines = "\n".join(f"  {name}: {text}" for name, text in (chain | late).items())
    found = spoken_of(free("sign(s1499 - d1499 - 5)", more=f"definitions:\n{lines}"))
    assert found.is_mixed  # more than is looked at


def spoken_of(text: str) -> time_functions.TimeFunctions:
    found = time_functions.functions(lagcli.loads(text))
    assert found is not None
    return found


def test_a_switch_in_a_definition_and_of_a_parameter_is_met() -> None:
    text = free(
        "pulse",
        more="parameters: {at: 3.45, w: 0.0005}\ndefinitions: {pulse: 'max(0, sign(w - abs(t - at)))'}",
    )
    model = lagcli.loads(text)
    assert lagcli.simulate(model)["a.vy"][-1] == pytest.approx(0.0005, rel=1e-9)
    other = lagcli.loads(text, {"at": 7.77, "w": 0.002})
    run = lagcli.simulate(other)
    assert run["a.vy"][-1] == pytest.approx(0.002, rel=1e-9)
    assert np.abs(run["a.vy"][run.t < 7.7]).max() == 0


def test_what_is_too_fast_to_be_looked_at_costs_no_steps() -> None:
    plain, run = (
        lagcli.simulate(lagcli.loads(free(f"1 + {noise}"))) for noise in ("0*t", "1e-14*sin(1e13*t)")
    )
    assert run.stats.steps < plain.stats.steps + 20
    assert run["a.vy"][-1] == pytest.approx(5, rel=1e-11)


def test_large_families_of_pulses_are_left_to_the_rows() -> None:
    text = """\
lagcli: 1
particles: {"p[i]": {for: "i = 1 .. 10000", mass: 1, position: ["i", 0, 0]}}
forces: {"push[i]": {for: "i = 1 .. 10000", to: "p[i]", force: "[0, exp(-((t - i/300)/0.1)**2), 0]"}}
"""
    found = spoken_of(text)
    assert found.is_mixed
    assert found.size <= time_functions.MOST_VALUES


def test_a_function_that_is_too_busy_hides_no_other_one() -> None:
    run = lagcli.simulate(
        lagcli.loads(free("exp(-((t - 5)/0.001)**2)*sin(300*t)", "duration: 10, samples: 3"))
    )
    # The integral of exp(-s^2/w^2) cos(300 s), half of it, times sin(1500).
    impulse = 0.001 * math.sqrt(math.pi) * math.exp(-((300 * 0.001 / 2) ** 2)) * math.sin(1500)
    assert run["a.vy"][-1] == pytest.approx(impulse / 2, rel=1e-10)


@pytest.mark.parametrize(
    "force",
    [
        "1/(t - 5.0371)",
        "1/abs(t - 5)",
        "1/sqrt(abs(t - 5))",
        "tan(t/3.2)",
        "(t - 5.0371)**(-1)",
        "1/(t - 5)**2",
        "(t - 5)**(-2)",
        "0.01*(t - 5.003)**(-2)",
        "(1 + a.y)/(t - 5)**3",
        "(1 + a.y)*(t - 5)**(-3)",
    ],
)
def test_a_run_does_not_go_on_beyond_a_pole_of_a_force(force: str) -> None:
    with pytest.raises(lagcli.SimulationStopped, match="a function of t has a pole") as stopped:
        lagcli.simulate(lagcli.loads(free(force)))
    assert stopped.value.trajectory.t[-1] < 5.0371


def test_a_coordinate_may_be_called_r_where_time_is_about() -> None:
    """In the force of a particle `r` and `v` are its own vectors; elsewhere they are what the file declares."""
    text = """
lagcli: 1
coordinates: {r: {value: 1, rate: 0.2}, q: {}}
particles:
  a: {mass: 1, position: "[r*cos(q), r*sin(q), 0]"}
forces: {push: {to: a, force: "-r*sin(t)"}}
holonomic: {rope: r = 1 + 0.1*sin(2*t)}
simulation: {duration: 1}
"""
    other = text.replace("r: {value", "rho: {value").replace("[r*cos(q), r*", "[rho*cos(q), rho*")
    runs = [lagcli.simulate(lagcli.loads(one)) for one in (text, other.replace("rope: r =", "rope: rho ="))]
    assert runs[0]["lambda.rope"] == pytest.approx(runs[1]["lambda.rope"], abs=1e-12)


@pytest.mark.parametrize("force", ["[0, 0, -m*sin(t)]", "m*[0, 0, -sin(t)]", "[0, 0, -m*sin(m*t/2)]"])
def test_a_particle_may_be_called_m_where_time_is_about(force: str) -> None:
    """In the force of a particle `m` is its own mass, also where the whole model holds t."""
    text = f"""
lagcli: 1
particles:
  m: {{mass: 2, position: [1, 0, 0]}}
  b: {{mass: 2, position: [0, 1, 0]}}
forces: {{push: {{to: all, force: "{force}"}}}}
simulation: {{duration: 1}}
"""
    run = lagcli.simulate(lagcli.loads(text))
    assert run["b.z"][-1] == pytest.approx(math.sin(1) - 1, abs=1e-11)
    assert run["m.z"][-1] == pytest.approx(math.sin(1) - 1, abs=1e-11)
