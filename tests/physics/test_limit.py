"""A holonomic row as a stiff spring: closed forms of its force, the rate of its error, and what has no limit."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import numpy.typing as npt
import pytest
from scipy import integrate

import lagcli
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.api import prepare_run
from lagcli.api.cache import CompiledModel
from lagcli.formulations import stiff_ladder, stiff_system
from tests.helpers import in_process

Floats = npt.NDArray[np.float64]

STICK = """
lagcli: 1
parameters: {L: 1, T0: 3, w: 2}
particles:
  a: {mass: 1.2, position: [0, 0, 0]}
  b: {mass: 0.8, position: [L, 0, 0]}
forces:
  pull: {to: b, force: "[T0*cos(w*t), 0, 0]"}
holonomic:
  rod: distance(a, b) = L
simulation: {duration: 3, samples: 101}
"""
WHIRLED = """
lagcli: 1
parameters: {L: 1, v: 2}
particles:
  a: {mass: 1.5, position: [L, 0, 0], velocity: [0, v, 0]}
holonomic:
  rod: norm(a) = L
simulation: {duration: 4, samples: 201}
"""

PENDULUM = """
lagcli: 1
particles: {p: {mass: 1.5, position: [0.6, 0, -0.8]}}
forces: {w: {to: p, force: [0, 0, -9.81*m]}}
holonomic: {rod: norm(p) = 1, plane: p.y = 0}
"""
CURVE = """
lagcli: 1
coordinates: {x: {value: 0, rate: 1}, y: {value: 0, rate: -0.3}, z: {value: 0}}
lagrangian: "rate(x)**2/2 + rate(y)**2 + rate(x)*rate(y)*0.3 + rate(z)**2/2 - y*x**2 - z"
holonomic: {s: "y + 0.3*sin(x) + 0.2*z = 0"}
"""


def of_stick(k: float, t: Floats, adapted: bool) -> Floats:
    """-k f of the stick: u'' + (k/mu) u = (T0/m2) cos w t in closed form, from u = -lambda/k or from u = 0."""
    mu, push, w = 1.2 * 0.8 / 2.0, 3 / 0.8, 2.0
    steady = push / (k / mu - w**2)
    begin = mu * push / k if adapted else 0.0
    return np.asarray(-k * (steady * np.cos(w * t) + (begin - steady) * np.cos(np.sqrt(k / mu) * t)))


@pytest.mark.parametrize("adapted", [True, False])
def test_force_of_every_run_is_that_of_the_closed_form(adapted: bool) -> None:
    found = lagcli.limit(lagcli.loads(STICK), "rod", unprestressed=not adapted)
    assert [rung.stiffness for rung in found.rungs] == pytest.approx([1e3, 10**3.5, 1e4, 10**4.5, 1e5])
    assert found.multiplier == pytest.approx(-1.8 * np.cos(2 * found.t), abs=1e-9)
    for rung in found.rungs:
        want = of_stick(rung.stiffness, found.t, adapted)
        assert rung.force == pytest.approx(want, abs=max(1e-7, 3 * rung.uncertainty))
        assert rung.max_error == pytest.approx(np.abs(want - found.multiplier).max(), rel=1e-3)
    assert found.rate is not None
    if adapted:
        assert found.rate.slope == pytest.approx(-1, abs=0.02)
        assert found.rungs[-1].max_error * 1e5 <= 6.912 * 1.001
    else:
        assert found.rate_of == "weighted_mean"
        assert all(
            rung.max_error > 1.7 for rung in found.rungs
        )  # it swings between 0 and 2 lambda at every k
        assert found.rungs[-1].weighted_mean is not None
        assert found.rungs[-1].weighted_mean < 1e-4


def test_errors_of_a_whirled_mass_are_those_of_the_series() -> None:
    """lambda^2/(L k) in the mean and twice that at most."""
    found = lagcli.limit(lagcli.loads(WHIRLED), "rod")
    last = found.rungs[-1]
    assert last.max_error * last.stiffness == pytest.approx(72, rel=1e-2)
    assert last.mean_error is not None
    assert last.mean_error * last.stiffness == pytest.approx(36, rel=1e-3)
    assert found.rate is not None
    assert found.rate.slope == pytest.approx(-1, abs=0.01)


CASES = {
    "member of a family": (
        """
lagcli: 1
particles:
  p[i]: {for: "i = 1..3", mass: 1, position: "[i, 0, 0]"}
forces: {weight: {to: p, force: [0, 0, -9.81*m]}}
holonomic:
  hook: norm(p[1]) = 1
  link[i]: {for: "i = 2..3", equation: "distance(p[i-1], p[i]) = 1"}
simulation: {duration: 0.4, samples: 51}
""",
        "link[2]",
    ),
    "row of a rigid body": (
        """
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [0, 1, 0]}
  b: {mass: 2, position: [1, 0, 0]}
  c: {mass: 1, position: [0, 1, 0], velocity: [1, 1, 0.3]}
rigid: {body: [a, b, c]}
simulation: {duration: 1, samples: 51, assemble: true}
""",
        "body.2",
    ),
    "coordinates, a moving row and a differential one": (
        """
lagcli: 1
coordinates: {x: {value: 1, rate: 0.2}, y: {rate: 0.3}, th: {rate: 0.5}, s: {value: 0.2}}
lagrangian: rate(x)**2 + rate(y)**2 + rate(th)**2/2 + rate(s)**2*(1 + x**2)/2 + x*rate(s) - y**2 - s*y
holonomic:
  rail: x**2 + s = 1.2 + 0.4*t + 0.3*(1 - cos(3*t))
differential:
  blade: sin(th)*rate(x) - cos(th)*rate(y) + 0.3*cos(th) = 0.2*sin(th)
simulation: {duration: 1, samples: 51, assemble: true}
""",
        "rail",
    ),
    "dependent particle": (
        """
lagcli: 1
coordinates: {q: {value: 0.3}, r: {value: 1}}
particles:
  a: {mass: 1, position: "[r*sin(q), 0, -r*cos(q)]"}
forces: {weight: {to: a, force: [0, 0, -9.81*m]}}
holonomic: {rope: r = 1 + 0.1*sin(2*t)}
simulation: {duration: 1, samples: 51, assemble: true}
""",
        "rope",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_error_goes_as_one_over_k(name: str) -> None:
    text, row = CASES[name]
    found = lagcli.limit(lagcli.loads(text), row, stiffness="1e4:1e6:3")
    assert found.constraint == row
    assert found.rate is not None, found.ended
    assert found.rate.slope == pytest.approx(-1, abs=0.05)
    assert found.rungs[-1].max_error < 1e-2 * np.abs(found.multiplier).max()


def test_slow_start_is_stretched_by_lambda_over_k_and_keeps_the_rest() -> None:
    text = CASES["coordinates, a moving row and a differential one"][0]
    run = prepare_run.start(lagcli.loads(text), lagcli.loads(text).simulation)
    begin = run.begin
    solved = run.numeric.keeping(run.report.selection).solved
    lam, rate = stiff_system.multiplier_rate(solved, (begin.t, begin.q, begin.v, begin.p), 0)
    near = lagcli.simulate(lagcli.loads(text), duration=1e-3, samples=3)["lambda.rail"]
    assert lam == pytest.approx(near[0], rel=1e-12)
    assert rate == pytest.approx((-3 * near[0] + 4 * near[1] - near[2]) / 1e-3, rel=1e-4)
    k = 1e4
    q, v = stiff_system.stretched(run.numeric, begin, stiff_system.StiffRow(0, lam, rate), k)
    f = np.array(run.numeric.holonomic(begin.t, q, begin.p)[0]).ravel()
    assert f[0] == pytest.approx(-lam / k, rel=1e-12)
    B, b = run.numeric.rows(begin.t, q, v, begin.p)
    speeds = np.array(B) @ v + np.array(b).ravel()
    assert speeds == pytest.approx([-rate / k, 0], abs=1e-13)
    # The nearest in the mass metric: M (q - q0) is a combination of the row's gradient.
    M = np.array(run.numeric.inertia(begin.t, begin.q, begin.v, begin.p))
    push, row_there = M @ (q - begin.q), np.array(B)[0]
    assert (
        np.abs(push - row_there * (push @ row_there) / (row_there @ row_there)).max()
        < 1e-3 * np.abs(push).max()
    )


def test_energy_balance_of_a_spring_that_moves_and_stiffens() -> None:
    text, row = CASES["coordinates, a moving row and a differential one"]
    model = lagcli.loads(text)
    begin = prepare_run.start(model, model.simulation).begin
    k = stiff_system.Stiffness(200.0, 1.5, begin.t)
    stiff = stiff_system.model(model, row, (begin.t, begin.q, begin.v), k)
    run = prepare_run.start_compiled(CompiledModel(stiff_system.build(stiff, row, True)), KnownIntegrals())
    blocks = np.concatenate(list(run.blocks()))
    assert len(blocks) == 51
    assert run.stats.energy_imbalance is not None
    assert run.stats.energy_imbalance < 1e-9


def test_swings_of_a_ramp_grow_as_their_action_is_constant() -> None:
    """The action of the swing k^(1/2) u^2 is constant, and its force k u grows as k^(3/4)."""
    found = lagcli.limit(
        lagcli.loads(STICK.replace("w: 2", "w: 0")), "rod", ramp=6.0, stiffness="1e3:1e5", unprestressed=True
    )
    assert found.ramp is not None
    assert found.ramp["seconds"] == 6.0
    assert found.force is not None
    assert found.stiffness is not None
    assert found.stiffness[[0, -1]] == pytest.approx([1e3, 1e5])
    largest = np.array([rung.max_error for rung in found.rungs])
    ends = np.array([10**3.5, 1e4, 10**4.5, 1e5])
    assert np.polyfit(np.log(ends), np.log(largest), 1)[0] == pytest.approx(0.75, abs=0.02)
    assert found.rungs[-1].mean_error is not None
    assert found.rungs[-1].mean_error < 0.01 * largest[-1]
    # The means of its stretches go with no power of k, and none is told.
    assert found.rate is None
    assert found.as_json()["rate"] is None
    assert any("no rate is fitted" in note for note in found.notes)


def test_ladder_ends_where_tolerance_takes_over() -> None:
    found = lagcli.limit(
        lagcli.loads(WHIRLED), "rod", stiffness="1e4:1e12:5", rtol=1e-6, duration=0.5, samples=26
    )
    assert 1 <= len(found.rungs) < 5
    assert "uncertain" in found.ended
    # Nothing above the noise at all: at rest on the slow motion the spring is the rod.
    rest = WHIRLED.replace("v: 2", "v: 0") + "forces: {push: {to: a, force: [-1, 0, 0]}}\n"
    found = lagcli.limit(lagcli.loads(rest), "rod", stiffness="1e3:1e5", duration=1)
    assert len(found.rungs) == 1
    assert found.rungs[0].max_error < 1e-9
    assert found.ended


@pytest.mark.parametrize(
    ("text", "row", "why", "line"),
    [
        (STICK + "differential:\n  level: a.vz = a.y*b.vx\n", "level", "differential row", 13),
        (STICK + "inequality:\n  floor: a.z >= -5\n", "rod", "models with inequalities", 13),
        (STICK.replace("= L\n", "= L\n  twice: norm(a - b)**2 = L**2\n"), "twice", "redundant", 11),
        (
            "lagcli: 1\nparticles:\n  a: {mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}\n"
            "holonomic:\n  turn: atan2(a.y, a.x) = t\n",
            "turn",
            "cut of an angle",
            5,
        ),
    ],
)  # fmt: skip
def test_rows_without_a_limit_are_refused_where_they_stand(text: str, row: str, why: str, line: int) -> None:
    with pytest.raises(lagcli.ModelError) as caught:
        lagcli.limit(lagcli.loads(text), row)
    (found,) = caught.value.diagnostics
    assert found.code == "no-stiff-limit"
    assert why in found.message
    assert found.location.line == line


def test_names_and_stiffnesses_that_there_are_not() -> None:
    with pytest.raises(ValueError, match="did you mean `rod`"):
        lagcli.limit(lagcli.loads(STICK), "rood")
    text, _ = CASES["member of a family"]
    with pytest.raises(ValueError, match=r"its rows are `link\[2\]` to `link\[3\]`"):
        lagcli.limit(lagcli.loads(text), "link")
    for wrong in ("1e5:1e3", "0:1", "a:b", "1:2:3:4", "1:nan", "1e3:1e5:1000"):
        with pytest.raises(ValueError, match="stiffness"):
            lagcli.limit(lagcli.loads(STICK), "rod", stiffness=wrong)
    assert stiff_ladder.rungs("1e3:1e5:3") == pytest.approx((1e3, 1e4, 1e5))
    assert stiff_ladder.rungs([5.0, 2.0]) == (2.0, 5.0)


def test_a_spring_at_rest_is_said_to_be_the_rod(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "rest.yaml"
    path.write_text(WHIRLED.replace("v: 2", "v: 0") + "forces: {push: {to: a, force: [-1, 0, 0]}}\n")
    out, err, code = in_process.run("limit", path, "--constraint", "rod", "--duration", 1)
    assert code == 0
    assert "is lambda as far as tolerance and rounding tell" in out
    assert "the ladder ends there" in err


@pytest.mark.parametrize(("adapted", "seconds"), [(True, 3.0), (False, 3.0), (True, 0.83), (False, 0.83)])
def test_the_mean_is_that_over_the_run_to_what_it_is_off_by(adapted: bool, seconds: float) -> None:
    found = lagcli.limit(lagcli.loads(STICK), "rod", unprestressed=not adapted, duration=seconds)
    mu, push, w = 1.2 * 0.8 / 2.0, 3 / 0.8, 2.0
    for rung in found.rungs:
        k, fast = rung.stiffness, np.sqrt(rung.stiffness / mu)
        steady = push / (k / mu - w**2)
        begin = mu * push / k if adapted else 0.0
        slow_part = (mu * push - k * steady) * np.sin(w * seconds) / w
        mean = (slow_part - k * (begin - steady) * np.sin(fast * seconds) / fast) / seconds
        assert rung.mean_error is not None
        assert rung.mean_uncertainty is not None
        assert abs(rung.mean_error - abs(mean)) <= rung.mean_uncertainty
        assert rung.mean_uncertainty <= 0.02 * rung.mean_error


def test_the_mean_of_a_pendulum_is_that_of_another_integration() -> None:
    """The first 0.2 s of 2 are in it, though no swing of the whole error begins there."""
    k, m, gravity = 1e4, 1.5, 9.81

    def rod(t: float, y: Floats) -> list[float]:
        return [y[1], -gravity * np.sin(y[0])]

    def spring(t: float, y: Floats) -> list[float]:
        pull = -k * (np.hypot(*y[:2]) - 1) / np.hypot(*y[:2]) / m
        return [*y[2:], pull * y[0], pull * y[1] - gravity]

    t = np.linspace(0, 2, 40001)
    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "t_eval": t}
    begin = np.arctan2(0.6, 0.8)
    th, rate = integrate.solve_ivp(rod, (0, 2), [begin, 0], **tight).y
    multiplier = -m * (rate**2 + gravity * np.cos(th))
    # lambda' = -m (2 th' th'' - g sin th th') vanishes at the start, at rest.
    length = 1 - multiplier[0] / k
    x, z = integrate.solve_ivp(spring, (0, 2), [0.6 * length, -0.8 * length, 0, 0], **tight).y[:2]
    error = -k * (np.hypot(x, z) - 1) - multiplier
    found = lagcli.limit(lagcli.loads(PENDULUM), "rod", stiffness=[k], duration=2)
    (rung,) = found.rungs
    assert rung.mean_error == pytest.approx(abs(integrate.simpson(error, x=t)) / 2, abs=rung.mean_uncertainty)
    assert rung.mean_uncertainty < 1e-4 * rung.mean_error


@pytest.mark.parametrize("unprestressed", [True, False])
@pytest.mark.parametrize(
    ("name", "duration"), [("pendulum", 2), ("pendulum", 0.9), ("curve", 2), ("curve", 7)]
)
def test_the_rate_is_minus_one_within_what_it_is_off_by(
    name: str, duration: float, unprestressed: bool
) -> None:
    text, row = {"pendulum": (PENDULUM, "rod"), "curve": (CURVE, "s")}[name]
    found = lagcli.limit(lagcli.loads(text), row, duration=duration, unprestressed=unprestressed)
    assert found.rate_of == ("weighted_mean" if unprestressed else "max_error")
    assert found.rate is not None
    assert found.rate.error is not None
    assert abs(found.rate.slope + 1) <= found.rate.error < 0.1


def test_a_mean_without_swings_needs_four_of_them() -> None:
    """sqrt(k/m) 0.7/(2 pi) is 2.9 at the first, where the ends of the run are all there is, and 5.1 at the second."""
    found = lagcli.limit(lagcli.loads(PENDULUM), "rod", stiffness="1e3:1e4", duration=0.7, unprestressed=True)
    assert [rung.weighted_mean is None for rung in found.rungs] == [True, False, False]
    assert all(rung.mean_error is not None for rung in found.rungs)
    assert found.rate is not None


def test_swings_leave_the_weighted_mean_and_the_time_mean_tells_what_it_is_off_by() -> None:
    t = np.linspace(0, 3.37, 2001)
    curve = 0.25 + np.cos(40 * t + 0.3)
    assert stiff_ladder.mean_without_swings(t, curve) == pytest.approx(0.25, abs=1e-5)
    mean, off = stiff_ladder.time_mean(t, curve)
    exact = 0.25 + (np.sin(40 * 3.37 + 0.3) - np.sin(0.3)) / 40 / 3.37
    assert abs(mean - exact) <= off < 1e-6


def test_a_stop_event_ends_the_limit() -> None:
    text = STICK + "events:\n  slack: {when: multiplier(rod), action: stop}\n"
    found = lagcli.limit(lagcli.loads(text), "rod", stiffness="1e4:1e4")
    assert found.t[-1] == pytest.approx(np.pi / 4, abs=1e-8)
    assert any("slack" in note for note in found.notes)


def test_command_tells_table_rate_and_what_will_take_long(tmp_path: pathlib.Path) -> None:
    path, table, figure = tmp_path / "stick.yaml", tmp_path / "l.csv", tmp_path / "l.svg"
    path.write_text(STICK)
    arguments = ["limit", path, "--constraint", "rod", "--stiffness", "1e3:1e4"]
    out, err, code = in_process.run(*arguments, "-o", table, "--plot", figure)
    assert code == 0, err
    assert "the stiffest run, k = 1e+04, swings" in err
    assert "its largest error goes as k^(-1.0" in out
    assert table.read_text().startswith("stiffness,max_error,mean_error,steps")
    assert len(table.read_text().splitlines()) == 4
    assert "mathdefault" not in figure.read_text()
    out, err, _ = in_process.run(*arguments, "--json", "-q")
    told = json.loads(out)
    assert err == ""
    assert told["constraint"] == "rod"
    assert told["rate"] == pytest.approx(-1, abs=0.02)
    assert [set(row) >= {"stiffness", "max_error", "mean_error", "steps"} for row in told["table"]] == [
        True
    ] * 3
    for more in (["--stiffness", "x"], ["--ramp", "0"], ["--ramp", "2", "--duration", "3"], ["-o", "l.doc"]):
        assert in_process.run(*arguments, *more)[2] == 2, more
    assert in_process.run("limit", path, "--constraint", "x")[2] == 2
    assert in_process.run("limit", path)[2] == 2
