"""Instants at which forces or walls jump or bend decide the contacts anew: each against a closed form."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.simulation.events.contact_decision import ContactChanges
from lagcli.simulation.events.step_watch import StepWatch

pytestmark = pytest.mark.numeric

PARTICLE = """lagcli: 1
particles: {{a: {{mass: {m}, position: [0, 0, 0]}}}}
forces: {{load: {{to: a, force: "[0, 0, {force}]"}}}}
inequality: {{f: {{condition: "a.z >= {wall}", restitution: {e}}}}}
simulation: {{start: {start}, duration: {duration}, samples: {samples}}}
"""
COORDINATE = """lagcli: 1
coordinates: {{s: {{value: 0}}}}
particles: {{a: {{mass: {m}, position: [s, 0, 0]}}}}
forces: {{load: {{to: s, force: "{force}"}}}}
inequality: {{f: {{condition: "s >= {wall}", restitution: {e}}}}}
simulation: {{start: {start}, duration: {duration}, samples: {samples}}}
"""
Function = Callable[[np.ndarray], np.ndarray]
STEP = "max(0, sign(t - 1))"
BEND = "max(0, t - 1)"


def after(t: np.ndarray, at: float = 1.0) -> np.ndarray:
    """The time since an instant, 0 before."""
    return np.maximum(0.0, t - at)


def since(t: np.ndarray, at: float = 1.0) -> np.ndarray:
    """1 from an instant on: a row at the instant is that of the state after it."""
    return (t >= at - 1e-12).astype(float)


@dataclasses.dataclass(frozen=True)
class Case:
    """A force on a mass 1 and a wall, in t from the start on, with its height, the multiplier and the incidents."""

    force: str
    z: Function
    lam: Function
    incidents: tuple[tuple[float, str], ...] = ()
    wall: str = "0"
    e: float = 0.0


def nothing(t: np.ndarray) -> np.ndarray:
    return 0 * t


CASES = {
    # The force jumps.
    "lifted": Case("sign(t - 1)", lambda t: after(t) ** 2 / 2, lambda t: 1 - since(t), ((1, "release"),)),
    "pulse": Case(
        "-1 + 3*max(0, sign((t - 1)*(1.5 - t)))",
        lambda t: after(t) ** 2 - 1.5 * after(t, 1.5) ** 2,
        lambda t: 1 - since(t),
        ((1, "release"),),
    ),
    "heavier": Case(f"-1 - {STEP}", nothing, lambda t: 1 + since(t)),
    "lighter": Case(f"-2 + {STEP}", nothing, lambda t: 2 - since(t)),
    "off": Case(f"-1 + {STEP}", nothing, lambda t: 1 - since(t), ((1, "release"),)),
    "on": Case(f"-{STEP}", nothing, since, ((1, "contact"),)),
    "off and on": Case(
        "-1 + max(0, sign((t - 1)*(1.5 - t)))",
        nothing,
        lambda t: 1 - since(t) + since(t, 1.5),
        ((1, "release"), (1.5, "contact")),
    ),
    "lifted by a jump and a ramp": Case(
        f"-1 + {STEP} + {BEND}", lambda t: after(t) ** 3 / 6, lambda t: 1 - since(t), ((1, "release"),)
    ),
    "lifted by a jump and a cube": Case(
        f"-1 + {STEP} + {BEND}**3", lambda t: after(t) ** 5 / 20, lambda t: 1 - since(t), ((1, "release"),)
    ),
    "jump and pressed by a square": Case(
        f"-1 + {STEP} - {BEND}**2", nothing, lambda t: 1 - since(t) + after(t) ** 2
    ),
    # The force bends, where there was none.
    "pressed by a ramp": Case(f"-{BEND}", nothing, after, ((1, "contact"),)),
    "pressed by a square": Case(f"-{BEND}**2", nothing, lambda t: after(t) ** 2, ((1, "contact"),)),
    "pressed by a cube": Case(f"-{BEND}**3", nothing, lambda t: after(t) ** 3, ((1, "contact"),)),
    "lifted by a cube": Case(f"{BEND}**3", lambda t: after(t) ** 5 / 20, nothing),
    # At the start.
    "smooth step": Case("-(3*t**2 - t**3)/4", nothing, lambda t: (3 * t**2 - t**3) / 4),
    "square": Case("-t**2", nothing, lambda t: t**2),
    "cube": Case("-t**3", nothing, lambda t: t**3),
    "fifth power": Case("-t**5", nothing, lambda t: t**5),
    "square of a sine": Case("-sin(t)**2", nothing, lambda t: np.sin(t) ** 2),
    "cosine": Case("cos(t) - 1", nothing, lambda t: 1 - np.cos(t)),
    "arc tangent": Case("-atan(t)**3", nothing, lambda t: np.arctan(t) ** 3),
    "hyperbolic tangent": Case("-tanh(t)**4", nothing, lambda t: np.tanh(t) ** 4),
    "quotient": Case("-t**2/(1 + t)", nothing, lambda t: t**2 / (1 + t)),
    "logarithm": Case("-log(1 + t)**2", nothing, lambda t: np.log(1 + t) ** 2),
    "exponential": Case("-(exp(t) - 1)**2", nothing, lambda t: (np.exp(t) - 1) ** 2),
    "root": Case("-(sqrt(1 + t) - 1)**2", nothing, lambda t: (np.sqrt(1 + t) - 1) ** 2),
    # Terms that cancel: the first power of t that is left decides, however small its sum is beside them.
    "cube of an exponential": Case(
        "-exp(t) + 1 + t + t**2/2", nothing, lambda t: np.exp(t) - 1 - t - t**2 / 2
    ),
    "cube of a sine": Case("1e6*(sin(t) - t)", nothing, lambda t: 1e6 * (t - np.sin(t))),
    "fourth power of a cosine": Case("1 - cos(t) - t**2/2", nothing, lambda t: np.cos(t) - 1 + t**2 / 2),
    "square of a sum that cancels": Case("-(tanh(t) - t)**2", nothing, lambda t: (np.tanh(t) - t) ** 2),
    "lifted by a cube of an exponential": Case(
        "exp(t) - 1 - t - t**2/2",
        lambda t: np.exp(t) - 1 - t - t**2 / 2 - t**3 / 6 - t**4 / 24,
        nothing,
    ),
    "lifted by a cube of a sine": Case("t - sin(t)", lambda t: t**3 / 6 - t + np.sin(t), nothing),
    "wall of terms that cancel comes": Case(
        "0", lambda t: np.exp(t) - 1 - t - t**2 / 2, lambda t: np.exp(t) - 1, wall="exp(t) - 1 - t - t**2/2"
    ),
    "wall of terms that cancel comes as a fifth power": Case(
        "0",
        lambda t: np.sin(t) - t + t**3 / 6,
        lambda t: t - np.sin(t),
        wall="sin(t) - t + t**3/6",
    ),
    "wall of terms that cancel goes": Case("0", nothing, nothing, wall="1 + t + t**2/2 - exp(t)"),
    "wall and load of terms that cancel": Case(
        "sin(t) - t",
        lambda t: np.exp(t) - 1 - t - t**2 / 2,
        lambda t: np.exp(t) - 1 + t - np.sin(t),
        wall="exp(t) - 1 - t - t**2/2",
    ),
    "lifted by a square at once": Case("t**2", lambda t: t**4 / 12, nothing),
    "wall that comes": Case("0", lambda t: t**3, lambda t: 6 * t, wall="t**3"),
    # The wall bends.
    "floor falls away": Case(
        "-9.81",
        lambda t: -9.81 / 2 * after(t) ** 2,
        lambda t: 9.81 * (1 - since(t)),
        ((1, "release"),),
        f"-10*{BEND}**2",
    ),
    "floor falls slowly": Case(
        "-9.81",
        lambda t: -(after(t) ** 2),
        lambda t: 9.81 - 2 * since(t),
        (),
        f"-{BEND}**2",
    ),
    "floor sinks": Case(
        "-9.81",
        lambda t: -9.81 / 2 * after(t) ** 2,
        lambda t: 9.81 * (1 - since(t)),
        ((1, "release"),),
        f"-20*{BEND}",
    ),
    "floor rises": Case(
        "-9.81", lambda t: 5 * after(t), lambda t: 9.81 + 0 * t, ((1, "impact"),), f"5*{BEND}"
    ),
    "floor throws": Case(
        "-1",
        lambda t: 3 * after(t) - after(t) ** 2 / 2,
        lambda t: 1 - since(t),
        ((1, "impact"), (1, "release")),
        f"2*{BEND}",
        0.5,
    ),
    "floor that nothing presses rises": Case(
        "0", lambda t: 2 * after(t), nothing, ((1, "impact"),), f"2*{BEND}"
    ),
}
RIGHT = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


def made(text: str, case: Case, start: float, m: float = 1.0, duration: float = 2.0) -> lagcli.Trajectory:
    shifted = f"(t - ({start}))" if start else "t"

    def later(expression: str) -> str:
        return "".join(shifted if word == "t" else word for word in words(expression))

    model = text.format(
        m=m,
        force=f"{m}*({later(case.force)})",
        wall=later(case.wall),
        e=case.e,
        start=start,
        duration=duration,
        samples=17,
    )
    return lagcli.simulate(lagcli.loads(model))


def words(expression: str) -> list[str]:
    import re

    return re.findall(r"\w+|\W+", expression)


def check(found: lagcli.Trajectory, case: Case, column: str, start: float, m: float) -> None:
    t = found.t - start
    size = m * max(1.0, float(np.abs(case.lam(t)).max()))
    assert found[column] == pytest.approx(case.z(t), abs=2e-9)
    assert found["lambda.f"] == pytest.approx(m * case.lam(t), abs=2e-9 * size)
    assert found["lambda.f"].min() >= 0.0
    kinds = list(found.events["kind"])
    assert kinds == [kind for _, kind in case.incidents]
    assert list(found.events["t"] - start) == pytest.approx([at for at, _ in case.incidents], abs=1e-10)
    assert set(found.events["name"]) <= {"f"}


@RIGHT
def test_a_particle(case: Case) -> None:
    check(made(PARTICLE, case, 0.0), case, "a.z", 0.0, 1.0)


@RIGHT
def test_a_coordinate_from_another_start(case: Case) -> None:
    check(made(COORDINATE, case, -0.75, 2.5), case, "s", -0.75, 2.5)


@pytest.mark.parametrize(
    "name", ["pulse", "floor falls away", "floor sinks", "floor rises", "floor throws", "heavier"]
)
def test_a_table_with_a_row_at_the_instant_passes_the_audit(name: str) -> None:
    case = CASES[name]
    text = PARTICLE.format(m=1, force=case.force, wall=case.wall, e=case.e, start=0, duration=2, samples=101)
    model = lagcli.loads(text)
    found = lagcli.simulate(model)
    report = lagcli.audit(model, found, events=found.events)
    assert not [check.name for check in report.checks if check.verdict == "fail"]


def incidents(found: lagcli.Trajectory) -> list[tuple[float, str, str]]:
    columns = (found.events[name] for name in ("t", "kind", "name"))
    return [(round(float(t), 9), str(kind), str(name)) for t, kind, name in zip(*columns, strict=True)]


def moving(force: str, condition: str, **how: object) -> lagcli.Trajectory:
    """A particle of mass 1; how: its position, velocity, e, and what stands at the end of the model."""
    model = f"""lagcli: 1
particles: {{a: {{mass: 1, position: {how.get("position", [0, 0, 0])}, velocity: {how.get("velocity", [0, 0, 0])}}}}}
forces: {{load: {{to: a, force: "{force}"}}}}
inequality: {{f: {{condition: "{condition}", restitution: {how.get("e", 0)}}}}}
{how.get("rest", "")}
"""
    return lagcli.simulate(
        lagcli.loads(model), duration=how.get("duration", 3.0), samples=how.get("samples", 13)
    )


# In the state: the force on a particle that slides at 0.1 along x, with its incidents, z and lambda over t.
IN_THE_STATE = {
    "lifted": (
        "sign(a.x - 0.1)",
        [(1.0, "release", "f")],
        lambda t: after(t) ** 2 / 2,
        lambda t: 1 - since(t),
    ),
    "lifted more": (
        "-1 + 4*max(0, sign(a.x - 0.1))",
        [(1.0, "release", "f")],
        lambda t: 1.5 * after(t) ** 2,
        lambda t: 1 - since(t),
    ),
    "heavier": ("-2 - sign(a.x - 0.1)", [], nothing, lambda t: 1 + 2 * since(t)),
    "pressed by a square from the start": ("-100*a.x**2", [], nothing, lambda t: t**2),
    "lifted by a square from the start": ("100*a.x**2", [], lambda t: t**4 / 12, nothing),
    "bends": ("-1 - 100*max(0, a.x - 0.1)**2", [], nothing, lambda t: 1 + after(t) ** 2),
}


@pytest.mark.parametrize(("force", "expected", "z", "lam"), IN_THE_STATE.values(), ids=IN_THE_STATE)
def test_a_switch_of_the_state(
    force: str, expected: list[tuple[float, str, str]], z: Function, lam: Function
) -> None:
    found = moving(f"[0, 0, {force}]", "a.z >= 0", velocity=[0.1, 0, 0])
    assert incidents(found) == expected
    assert found["a.z"] == pytest.approx(z(found.t), abs=1e-9)
    assert found["lambda.f"] == pytest.approx(lam(found.t), abs=1e-9)


# A start on the switch: the force along x, that on the contact and the velocity; x, z and lambda over t.
AT_REST = {
    "led to the side that lifts": (
        ("1", "sign(a.x - 0.1)", 0.0),
        (lambda t: t**2 / 2, lambda t: t**2 / 2, 0),
    ),
    "led to the side that presses": (("1", "-sign(a.x - 0.1)", 0.0), (lambda t: t**2 / 2, nothing, 1)),
    "led back": (("-1", "-2 + sign(a.x - 0.1)", 0.0), (lambda t: -(t**2) / 2, nothing, 3)),
    "by a ramp": (("s", "sign(a.x - 0.1)", 0.0), (lambda t: t**3 / 6, lambda t: t**2 / 2, 0)),
    "back by a square": (("-s**2", "sign(a.x - 0.1)", 0.0), (lambda t: -(t**4) / 12, nothing, 1)),
    "moving": (("0", "sign(a.x - 0.1)", -0.2), (lambda t: -0.2 * t, nothing, 1)),
    "moving away": (("0", "sign(a.x - 0.1)", 0.2), (lambda t: 0.2 * t, lambda t: t**2 / 2, 0)),
    "velocity": (("1.5 - sign(a.vx)", "-2 + sign(a.vx)", 0.0), (lambda t: t**2 / 4, nothing, 1)),
}


@pytest.mark.parametrize("start", [0.0, 2.5])
@pytest.mark.parametrize(("given", "motion"), AT_REST.values(), ids=AT_REST)
def test_a_start_on_a_switch_of_the_state_goes_to_the_side_to_which_it_is_led(
    given: tuple[str, str, float], motion: tuple[Function, Function, float], start: float
) -> None:
    (along, load, speed), (x, z, push) = given, motion
    along = "".join({"s": f"(t - {start})"}.get(word, word) for word in words(along))
    found = moving(
        f"[{along}, 0, {load}]",
        "a.z >= 0",
        position=[0.1, 0, 0],
        velocity=[speed, 0, 0],
        duration=1.0,
        rest=f"simulation: {{start: {start}}}",
    )
    t = found.t - start
    assert not len(found.events["t"])
    assert found["a.x"] - 0.1 == pytest.approx(x(t), abs=1e-9)
    assert found["a.z"] == pytest.approx(z(t), abs=1e-9)
    assert found["lambda.f"] == pytest.approx(push + 0 * t, abs=1e-9)


@pytest.mark.parametrize("along", ["t**2", "-t**2", "-t**5", "-abs(t)*t", "exp(t) - 1 - t"])
@pytest.mark.parametrize(("switch", "speed"), [("a.x", 0.0), ("a.x - a.y", 0.3), ("a.vx - 0.3", 0.3)])
def test_a_start_on_a_switch_at_zero_takes_no_time_to_leave_it(switch: str, speed: float, along: str) -> None:
    model = lagcli.loads(
        f"lagcli: 1\nparticles: {{a: {{mass: 1, position: [0, 0, 0], velocity: [{speed}, {speed}, 0]}}}}\n"
        f'forces: {{load: {{to: a, force: "[{along}, 0, sign({switch})]"}}}}\n'
        "inequality: {f: a.z >= 0}\n"
    )
    found = lagcli.simulate(model, duration=1.0, samples=9)
    t, is_lifted = found.t, along[0] != "-"
    ways = {"t**2": t**4 / 12, "-t**2": -(t**4) / 12, "-t**5": -(t**7) / 42, "-abs(t)*t": -(t**4) / 12}
    way = ways.get(along, np.exp(t) - 1 - t - t**2 / 2 - t**3 / 6)
    assert found["a.x"] == pytest.approx(speed * t + way, abs=1e-10)
    assert found["a.z"] == pytest.approx(t**2 / 2 if is_lifted else 0 * t, abs=1e-10)
    assert found["lambda.f"] == pytest.approx(0.0 if is_lifted else 1.0, abs=1e-10)
    assert not len(found.events["t"])


@pytest.mark.parametrize("place", [0.0, 1e-30, 1e-200])
def test_a_contact_presses_at_a_place_that_is_no_size_yet(place: float) -> None:
    found = moving("[0, 0, -1]", "a.z >= 0", position=[place, 0, 0], velocity=[1, 0, 0])
    assert found["lambda.f"] == pytest.approx(1.0, abs=1e-12)
    assert not len(found.events["t"])


@pytest.mark.parametrize("load", ["sign(a.x - 0.1)", "-2 + sign(a.x - 0.1)"])
def test_a_start_at_rest_on_a_switch_onto_which_both_sides_push_stops(load: str) -> None:
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        moving(f"[0.5 - sign(a.x - 0.1), 0, {load}]", "a.z >= 0", position=[0.1, 0, 0])
    assert stopped.value.code == "motion-sticks"
    assert "the force `load` switches at a.x = 0.1" in str(stopped.value)


def test_a_coordinate_with_a_velocity_is_pressed_by_what_its_inertia_makes() -> None:
    """On a disk that begins to turn with the angle t^3 a mass on a spoke leaves its stop: r'' = 9 t^4 r."""
    model = """lagcli: 1
coordinates: {r: {value: 1}}
particles: {a: {mass: 2, position: ["r*cos(t**3)", "r*sin(t**3)", 0]}}
inequality: {out: r <= 1}
simulation: {duration: 1, samples: 11}
"""
    found = lagcli.simulate(lagcli.loads(model))
    assert found["r"] == pytest.approx(1, abs=1e-14)
    assert found["lambda.out"] == pytest.approx(2 * 9 * found.t**4, abs=1e-10)
    assert not len(found.events["t"])
    turned = lagcli.simulate(lagcli.loads(model.replace("r <= 1", "r >= 1")))
    assert (turned["lambda.out"] == 0).all()
    assert turned["r"][-1] == pytest.approx(1 + 9 / 30 + 81 / 30 / 132, abs=2e-3)


def test_a_wall_that_is_a_driven_particle_falls_away() -> None:
    model = """lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 0]}, b: {mass: 1, position: [0, 0, 0]}}
forces: {weight: {to: all, force: "[0, 0, -m*9.81]"}}
holonomic: {x: b.x = 0, y: b.y = 0, z: "b.z = -10*max(0, t - 1)**2"}
inequality: {f: a.z >= b.z}
simulation: {duration: 2, samples: 9}
"""
    found = lagcli.simulate(lagcli.loads(model))
    assert incidents(found) == [(1.0, "release", "f")]
    assert found["a.z"] == pytest.approx(-9.81 / 2 * after(found.t) ** 2, abs=1e-9)
    assert found["lambda.f"] == pytest.approx(9.81 * (1 - since(found.t)), abs=1e-9)


def test_a_load_that_grows_presses_all_legs_of_a_table() -> None:
    model = """lagcli: 1
particles:
  a: {mass: 1, position: [1, 1, 0]}
  b: {mass: 1, position: [-1, 1, 0]}
  c: {mass: 1, position: [-1, -1, 0]}
  d: {mass: 1, position: [1, -1, 0]}
rigid: {table: [a, b, c, d]}
forces: {load: {to: all, force: "[0, 0, -t**2]"}}
inequality: {fa: a.z >= 0, fb: b.z >= 0, fc: c.z >= 0, fd: d.z >= 0}
simulation: {duration: 1, samples: 5}
"""
    found = lagcli.simulate(lagcli.loads(model))
    for name in "abcd":
        assert found[f"lambda.f{name}"] == pytest.approx(found.t**2, abs=1e-11)
    assert not len(found.events["t"])


@pytest.mark.parametrize(
    "force", ["sign(t - 1)", "-1.5 - 0.5*sign(t - 1)", "-1 + 3*max(0, sign((t - 1)*(1.5 - t)))"]
)
def test_a_start_at_a_switch_is_that_of_the_time_after_it(force: str) -> None:
    found = moving(f"[0, 0, {force}]", "a.z >= 0", rest="simulation: {start: 1}", duration=0.5)
    pushes = force.startswith("-1.5")
    assert (found["lambda.f"] == (2.0 if pushes else 0.0)).all()
    assert found["a.z"][-1] == pytest.approx(
        {"s": 0.125, ".": 0.0, " ": 0.25}[force[0 if force[0] == "s" else 2]], abs=1e-12
    )
    assert not len(found.events["t"])


@pytest.mark.parametrize("force", ["-abs(t)*t**2", "-max(0, t)**2", "-t**2.5", "-t*sqrt(t)"])
def test_a_load_that_begins_at_a_switch_presses_from_the_start_on(force: str) -> None:
    found = moving(f"[0, 0, {force}]", "a.z >= 0")
    t = found.t
    load = {"-a": t**3, "-m": t**2}.get(force[:2], t**2.5 if "2.5" in force else t**1.5)
    assert found["lambda.f"] == pytest.approx(load, abs=1e-12)
    assert not len(found.events["t"])


@pytest.mark.parametrize("start", [0, 5])
@pytest.mark.parametrize("wall", ["max(0, t - {0})**2", "abs(t - {0})**3"])
def test_a_wall_that_begins_to_rise_at_the_start_carries_without_an_impact(wall: str, start: float) -> None:
    found = moving("[0, 0, 0]", f"a.z >= {wall.format(start)}", rest=f"simulation: {{start: {start}}}")
    t, power = found.t - start, 2 if wall[0] == "m" else 3
    assert found["a.z"] == pytest.approx(t**power, abs=1e-12)
    assert found["lambda.f"] == pytest.approx(power * (power - 1) * t ** (power - 2), abs=1e-12)
    assert not len(found.events["t"])


@pytest.mark.parametrize(("begin", "bend"), [(0, 0), (5, 5), (-1, 0)])
@pytest.mark.parametrize("e", [0, 0.5])
def test_a_wall_that_is_suddenly_faster_strikes_at_the_start(e: float, begin: float, bend: float) -> None:
    model = lagcli.loads(
        "lagcli: 1\nparticles: {a: {mass: 1, position: [0, 0, 0]}}\n"
        f"inequality: {{f: {{condition: 'a.z >= 3*max(0, t - {bend})', restitution: {e}}}}}\n"
        f"simulation: {{start: {begin}, duration: 2, samples: 11}}\n"
    )
    found = lagcli.simulate(model)
    assert found["a.z"] == pytest.approx(3 * (1 + e) * after(found.t, bend), abs=1e-9)
    assert [*found.events["kind"]] == ["impact"]
    assert found.events["t"][0] == pytest.approx(bend, abs=1e-12)
    assert begin != bend or found.events["t"][0] == begin
    report = lagcli.audit(model, found, events=found.events)
    assert not [check.name for check in report.checks if check.verdict == "fail"]


@pytest.mark.parametrize("depth", [3.0, 0.25])
def test_a_wall_that_jumps_away_lets_a_contact_go(depth: float) -> None:
    model = lagcli.loads(
        "lagcli: 1\nparticles: {a: {mass: 1, position: [0, 0, 0]}, b: {mass: 1, position: [1, 0, 0]}}\n"
        'forces: {w: {to: all, force: "[0, 0, -2*m]"}}\n'
        f"inequality: {{f: 'a.z >= -{depth}*{STEP}', g: b.z >= 0}}\n"
        "simulation: {duration: 2.2, samples: 9}\n"
    )
    found = lagcli.simulate(model)
    assert found["a.z"] == pytest.approx(-np.minimum(depth, after(found.t) ** 2), abs=1e-10)
    assert found["lambda.g"] == pytest.approx(2.0, abs=1e-12)
    lands = depth < 1
    assert [*found.events["kind"]] == (["release", "impact", "contact"] if lands else ["release"])
    report = lagcli.audit(model, found, events=found.events)
    assert not [check.name for check in report.checks if check.verdict == "fail"]


@pytest.mark.parametrize("end", [0.5, 1.0, 1.25])
def test_a_run_that_is_resumed_decides_as_the_whole_one(end: float, tmp_path) -> None:
    model = lagcli.loads(
        PARTICLE.format(
            m=1, force="-1 + 3*max(0, sign((t - 1)*(1.5 - t)))", wall="0", e=0, start=0, duration=2, samples=9
        )
    )
    mark, grid = tmp_path / "mark.json", {"output_step": 0.25}
    first = lagcli.simulate(model, duration=end, checkpoint=mark, **grid)
    rest = lagcli.simulate(model, duration=2.0, resume=mark, **grid)
    z = lambda t: after(t) ** 2 - 1.5 * after(t, 1.5) ** 2  # noqa: E731
    assert rest["a.z"] == pytest.approx(z(rest.t), abs=1e-11)
    assert rest["lambda.f"] == pytest.approx(1.0 - since(rest.t), abs=1e-11)
    assert [*first.events["kind"], *rest.events["kind"]] == ["release"]


def test_a_start_from_a_row_decides_anew(tmp_path) -> None:
    text = PARTICLE.format(m=1, force="-(t - 1)**2", wall="0", e=0, start=1, duration=2, samples=9)
    model, table = lagcli.loads(text), tmp_path / "rows.csv"
    table.write_text("t,a.x,a.y,a.z,a.vx,a.vy,a.vz\n1,0,0,0,0,0,0\n")
    found = lagcli.simulate(model, begin=table)
    assert found["lambda.f"] == pytest.approx((found.t - 1) ** 2, abs=1e-11)
    assert not len(found.events["t"])


@pytest.mark.parametrize("w", [1e-3, 5e-4])
@pytest.mark.parametrize("t0", [1, 0.9, 0.77, 0.5])
@pytest.mark.parametrize("rtol", [1e-11, 1e-9])
def test_a_steep_ramp_releases(w: float, t0: float, rtol: float) -> None:
    rest = f"simulation: {{rtol: {rtol}, atol: {rtol / 100}}}"
    found = moving(f"[0, 0, -1 + 3*min(1, max(0, (t - {t0})/{w}))]", "a.z >= 0", rest=rest)
    at, rise = t0 + w / 3, 2 * w / 3
    assert incidents(found) == [(pytest.approx(at, abs=1e-9), "release", "f")]
    beyond = 3 - at - rise
    assert found["a.z"][-1] == pytest.approx(rise**2 / 3 + rise * beyond + beyond**2, abs=1e-7)


@pytest.mark.parametrize("t", [0.3, 0.7])
def test_events_that_look_at_a_multiplier_see_the_switch(t: float) -> None:
    rest = "events: {gone: {when: multiplier(f) - 0.5, direction: down}}"
    found = moving(f"[0, 0, -1 + 2*max(0, sign(t - {t}))]", "a.z >= 0", rest=rest)
    assert sorted(incidents(found)) == [(t, "event", "gone"), (t, "release", "f")]


@pytest.mark.parametrize("direction", ["up", "down", "both"])
def test_a_multiplier_that_is_never_negative_crosses_no_level_below_zero(direction: str) -> None:
    rest = f"events: {{none: {{when: multiplier(f) + 0.5, direction: {direction}}}}}"
    found = moving("[0, 0, sign(t - 1)]", "a.z >= 0", rest=rest)
    assert incidents(found) == [(1.0, "release", "f")]


def test_an_event_that_goes_through_zero_at_a_switch_is_reported_beside_the_release() -> None:
    found = moving("[0, 0, sign(t - 1)]", "a.z >= 0", rest="events: {now: {when: t - 1}}")
    assert sorted(incidents(found)) == [(1.0, "event", "now"), (1.0, "release", "f")]


def test_an_event_of_a_multiplier_comes_with_the_contact_that_makes_it_jump() -> None:
    rest = "events: {rests: {when: multiplier(f) - 1, direction: up, action: stop}}"
    found = moving("[0, 0, -9.81]", "a.z >= 0", position=[0, 0, 1], velocity=[0.3, 0, 0], e=0.7, rest=rest)
    (end, *last), *_ = [each for each in incidents(found) if each[1] == "event"]
    assert last == ["event", "rests"]
    assert [each[1] for each in incidents(found) if each[0] == end] == ["accumulation", "contact", "event"]
    first = (2 / 9.81) ** 0.5
    assert end == pytest.approx(first * 1.7 / 0.3, abs=1e-9)


# Walls that are pieces: conditions, starts, and what is known of the motion.
def test_a_ball_slides_off_a_table() -> None:
    found = moving(
        "[0, 0, -9.81]", "max(a.x, a.z) >= 0", position=[-1, 0, 0], velocity=[1.5, 0, 0], duration=2.0
    )
    assert incidents(found) == [(round(1 / 1.5, 9), "release", "f")]
    assert found["a.z"] == pytest.approx(-9.81 / 2 * after(found.t, 1 / 1.5) ** 2, abs=1e-9)
    assert found["lambda.f"] == pytest.approx(9.81 * (1 - since(found.t, 1 / 1.5)), abs=1e-9)


@pytest.mark.parametrize(
    ("condition", "position", "velocity", "t", "v"),
    [
        ("a.z >= min(0.5*a.x + 1, 1)", [-1, 0, 0.5], [2, 0, 1], (2 - 3.2**0.5) / 0.4, 3.2**0.5 / 2),
        ("a.z >= -abs(a.x)", [0.5, 0, -0.5], [-2, 0, 2], (2 - 3.5**0.5) / 0.5, 3.5**0.5 / 2 * 1.0),
        ("a.z + abs(a.x)/2 >= 0", [-1, 0, -0.5], [2, 0, 1], (2 - 3.2**0.5) / 0.4, 3.2**0.5 / 2),
    ],
)
def test_a_ridge_throws(
    condition: str, position: list[float], velocity: list[float], t: float, v: float
) -> None:
    found = moving("[0, 0, -1]", condition, position=position, velocity=velocity, duration=t + 0.1, samples=2)
    assert incidents(found) == [(pytest.approx(t, abs=1e-8), "release", "f")]
    slope = abs(velocity[2] / velocity[0])
    top = position[2] + slope * abs(position[0])
    assert found["a.z"][-1] == pytest.approx(top + 0.1 * 2 * slope * v - 0.005, abs=1e-9)


@pytest.mark.parametrize(
    "condition", ["min(a.x, a.z) >= 0", "a.z >= max(0, a.z - a.x)", "2*min(a.x, min(a.z, a.x + 1))/3 >= 0"]
)
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_corner_is_two_walls(condition: str, e: float) -> None:
    found = moving(
        "[0, 0, -9.81]", condition, position=[1, 0, 0], velocity=[-1, 0, 0], e=e, duration=2.0, samples=9
    )
    ((t, kind, name),) = incidents(found)
    assert (t, kind) == (1.0, "impact")
    assert name.startswith("f[")
    assert found["a.x"] == pytest.approx(np.where(found.t <= 1, 1 - found.t, e * (found.t - 1)), abs=1e-9)
    assert found["a.z"] == pytest.approx(0, abs=1e-14)
    pushes = sum(found[column] for column in found.columns if column.startswith("lambda."))
    assert pushes.max() > 0
    assert found["R.a.z"] == pytest.approx(9.81, abs=1e-9)


def test_a_root_of_a_distance_has_a_plain_reason() -> None:
    for z in (1, 0):
        with pytest.raises(
            lagcli.SimulationStopped, match=r"no finite gradient where the contact closes .*: `f`"
        ):
            moving("[0, 0, -1]", "sqrt(a.z) >= 0", position=[0, 0, z])


def test_a_closed_contact_that_pulls_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ContactChanges, "at_switch", lambda self, side, taken, events: events)
    with pytest.raises(lagcli.SimulationStopped, match=r"the closed contacts `f` would pull there") as stop:
        moving("[0, 0, sign(t - 1)]", "a.z >= 0")
    assert stop.value.t == pytest.approx(1, abs=1e-12)


def test_a_row_in_which_a_contact_pulls_is_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the step looked clear."""
    monkeypatch.setattr(StepWatch, "is_clear", lambda self: True)
    with pytest.raises(lagcli.SimulationStopped, match=r"the closed contacts `f` would pull there") as stop:
        moving("[0, 0, t - 1]", "a.z >= 0", duration=2.0, samples=41)
    assert stop.value.trajectory["lambda.f"].min() > -1e-6


HELD = """lagcli: 1
particles:
  p0: {mass: 2.51, position: [0.2584, 0, 0], velocity: [0.2634, 0, 0]}
  p1: {mass: 2.44, position: [0.4175, 0, 0], velocity: [-0.2634, 0, 0]}
  p2: {mass: 0.859, position: [0, 0, 0], velocity: [0, 0, 0]}
forces:
  f0: {to: p0, force: "[(-24.62) + (0.3427)*max(0, t - 1.86)**1 + (4.607)*(1 + sign(t - 0.485))/2
    + (-4.607)*(1 + sign(t - 0.89))/2, 0, 0]"}
  f1: {to: p1, force: "[(-23.94) + (-2.92)*(1 + sign(t - 2.15))/2, 0, 0]"}
  f2: {to: p2, force: "[(-8.427) + (11.22)*(1 + sign(t - 0.287))/2 + (2.006)*max(0, t - 2.4)**2
    + (7.519)*(1 + sign(t - 2.64))/2, 0, 0]"}
holonomic:
  row0: "(1)*p0.x + (1)*p1.x = 0.6759"
inequality:
  left: {condition: "(1)*p0.x - ((0) + (0.135)*t**1) >= 0", restitution: 0}
  right: {condition: "(1)*p1.x - ((-0.2)) >= 0", restitution: 0}
  below: {condition: "(1)*p2.x - ((0) + (-1.46)*max(0, t - 0.957)**3 + (0.7163)*max(0, t - 1.41)**1) >= 0",
    restitution: 0}
  pair: {condition: "(1)*p1.x + (-1)*p2.x - ((0.05)) >= 0", restitution: 0}
simulation: {start: 0, duration: 3, samples: 61}
"""


def test_rounding_of_accelerations_at_switches_is_no_pole() -> None:
    found = lagcli.simulate(lagcli.loads(HELD))
    x, pair = 0.135 * 3, 2.793 + 2.006 * 0.6**2 + 7.519
    row = 23.94 + 2.92 - pair
    expected = {"p0.x": x, "p1.x": 0.6759 - x, "p2.x": 0.6259 - x, "lambda.pair": pair, "lambda.row0": row}
    expected["lambda.left"] = 24.62 - 0.3427 * (3 - 1.86) - row
    assert {name: found[name][-1] for name in expected} == pytest.approx(expected, rel=1e-9)


STATES = {
    "jump": ("-1 - sign(a.x - 0.1)", lambda t: 2 * since(t), "contact"),
    "ramp": ("-max(0, a.x - 0.1)", lambda t: 0.1 * after(t), "contact"),
    "square": ("-max(0, a.x - 0.1)**2", lambda t: (0.1 * after(t)) ** 2, "contact"),
    "cube": ("-max(0, a.x - 0.1)**3", lambda t: (0.1 * after(t)) ** 3, "contact"),
    "off": ("-1 + sign(a.x - 0.1)", lambda t: 2 * (1 - since(t)), "release"),
    "with t": ("-1 - sign(a.x - 0.2 + 0.1*t)", lambda t: 2 * since(t), "contact"),
    "far": ("-1 - sign((1e6 + a.x) - (1e6 + 0.1))", lambda t: 2 * since(t), "contact"),
}


@pytest.mark.parametrize("name", STATES)
def test_a_force_that_switches_where_a_contact_lies_decides_it(name: str) -> None:
    force, lam, kind = STATES[name]
    found = moving(f"[0, 0, {force}]", "a.z >= 0", velocity=[0.1, 0, 0], duration=2.0, samples=17)
    room = 1e-8 if name == "far" else 1e-12
    [(at, told)] = zip(found.events["t"], found.events["kind"], strict=True)
    assert (float(at), str(told)) == (pytest.approx(1.0, abs=room), kind)
    assert found["lambda.f"] == pytest.approx(lam(found.t), abs=1e-12)
    assert found["R.a.z"] == pytest.approx(lam(found.t), abs=1e-12)
    assert found["a.z"] == pytest.approx(0.0, abs=1e-14)
    assert found["a.x"] == pytest.approx(0.1 * found.t, abs=max(1e-14, 0.1 * room))


def test_a_relay_on_an_oscillation_presses_again_and_again() -> None:
    found = moving(
        "[-9*a.x, 0, -1 - sign(a.x - 0.5)]", "a.z >= 0", velocity=[3, 0, 0], duration=5.0, samples=21
    )
    first, period = np.arcsin(0.5), 2 * np.pi
    times = [x for k in range(3) for x in (first + k * period, np.pi - first + k * period)]
    expected = [x / 3 for x in times if x / 3 < 5]
    assert list(found.events["t"]) == pytest.approx(expected, abs=1e-10)
    assert [str(kind) for kind in found.events["kind"]] == (["contact", "release"] * 3)[: len(expected)]
    assert found["lambda.f"] == pytest.approx(1 + np.sign(np.sin(3 * found.t) - 0.5), abs=1e-12)


def test_a_force_that_switches_in_a_velocity_presses_from_there_on() -> None:
    found = moving(
        "[-0.5, 0, -1 - sign(0.1 - a.vx)]", "a.z >= 0", velocity=[0.5, 0, 0], duration=2.0, samples=9
    )
    assert incidents(found) == [(0.8, "contact", "f")]
    assert found["lambda.f"] == pytest.approx(2 * since(found.t, 0.8), abs=1e-12)


@pytest.mark.parametrize(("level", "times"), [(0.5, []), (0.4999, [1 - 2e-4**0.5, 1 + 2e-4**0.5])])
def test_a_motion_that_turns_round_on_a_switch_or_just_beyond(level: float, times: list[float]) -> None:
    force = f"[-1, 0, -1 - sign(a.x - {level})]"
    found = moving(force, "a.z >= 0", velocity=[1, 0, 0], duration=3.0, samples=9)
    assert list(found.events["t"]) == pytest.approx(times, abs=1e-10)
    assert "impact" not in set(found.events["kind"])


def test_a_potential_that_bends_in_another_coordinate_closes_a_contact() -> None:
    found = lagcli.simulate(
        lagcli.loads("""lagcli: 1
coordinates: {s: {value: 0}, u: {value: 0, rate: 0.1}}
particles: {a: {mass: 2, position: [s, u, 0]}}
forces: {w: {potential: "s*max(0, u - 0.1)"}}
inequality: {f: {condition: "s >= 0", restitution: 0.5}}
simulation: {duration: 2, samples: 9}
""")
    )
    assert incidents(found) == [(1.0, "contact", "f")]
    assert found["lambda.f"] == pytest.approx(0.1 * after(found.t), abs=1e-12)


def test_masses_that_are_held_stand_at_switches_without_a_pole() -> None:
    """A wall and a rod hold two masses, whose accelerations are the rounding of the forces."""
    found = lagcli.simulate(
        lagcli.loads("""lagcli: 1
coordinates: {a: {value: 0.1, rate: 0.006063}, b: {value: 0.9, rate: -0.006063}}
lagrangian: "0.176/2*rate(a)**2 + 0.102/2*rate(b)**2"
forces:
  f: {to: a, force: "-7.727 - 2.451*sin(t) - 2.451*sign(sin(200*t))"}
  g: {to: b, force: "-1.001 + 1.3*sign(sin(200*t))"}
holonomic: {rod: "a + b = 1"}
inequality: {left: {condition: "a >= 0.1 + 0.006063*t"}}
simulation: {duration: 3, samples: 9}
""")
    )
    wave = np.sign(np.sin(200 * found.t))[1:]
    force = 7.727 + 2.451 * np.sin(found.t[1:]) + 2.451 * wave - 1.001 + 1.3 * wave
    assert found["lambda.left"][1:] == pytest.approx(force, abs=1e-9)


@pytest.mark.parametrize(
    "wall",
    [
        "a.z >= 2*max(0, a.x - 0.5)",
        "min(a.z, a.z - 2*(a.x - 0.5)) >= 0",
        "a.z/2 >= max(0, a.x - 0.5)",
        "a.z - 3*max(0, (2*a.x - 1)/3) >= 0",
    ],
)
def test_a_number_before_a_minimum_of_sums_is_a_factor_of_each_of_their_terms(wall: str) -> None:
    model = lagcli.loads(
        f"""
lagcli: 1
particles: {{a: {{mass: 3, position: [0, 0, 0], velocity: [1, 0, 0]}}}}
forces: {{w: {{to: a, force: [0, 0, -9.81*m]}}}}
inequality: {{floor: "{wall}"}}
simulation: {{duration: 0.7, samples: 15}}
"""
    )
    run = lagcli.simulate(model)
    # At x = 1/2 the slope of 2 strikes: of (1, 0, 0) what is along it stays, 1/(1 + 4) of (1, 0, 2). It slides back.
    impacts = [e.t for e in run.events if e.kind == "impact"]
    assert impacts == pytest.approx([0.5, 0.5 + 2 * 0.2 / (0.4 * 9.81)], abs=1e-9)
    assert run["a.vx"][-1] == pytest.approx(-0.2, abs=1e-9)


@pytest.mark.parametrize("velocity", [[0, 0, 0], [0.3, 0, 0]])
@pytest.mark.parametrize(
    ("z", "wall"),
    [
        (lambda t: np.exp(t) - 1 - t - t**2 / 2, "exp(t) - 1 - t - t**2/2"),
        (lambda t: np.sin(t) - t, "sin(t) - t"),
        (lambda t: np.cos(t) - 1 + t**2 / 2, "cos(t) - 1 + t**2/2"),
    ],
)
def test_a_row_that_is_driven_by_terms_that_cancel_has_steps(
    z: Function, wall: str, velocity: list[float]
) -> None:
    model = f"""lagcli: 1
particles: {{a: {{mass: 1, position: [0, 0, 0], velocity: {velocity}}}}}
holonomic: {{f: "a.z = {wall}"}}
simulation: {{duration: 2, samples: 9}}
"""
    found = lagcli.simulate(lagcli.loads(model))
    assert found["a.z"] == pytest.approx(z(found.t), abs=1e-14)


@pytest.mark.parametrize(
    ("force", "value"),
    [
        ("exp(t) - 1 - t - t**2/2", lambda t: np.exp(t) - 1 - t - t**2 / 2),
        ("sin(t) - t", lambda t: np.sin(t) - t),
        ("-(tanh(t) - t)**2", lambda t: -((np.tanh(t) - t) ** 2)),
    ],
)
def test_a_free_body_under_forces_that_cancel_has_steps(force: str, value: Function) -> None:
    found = moving(f"[0, 0, {force}]", "a.z >= -9", duration=1.0)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    s = (nodes + 1) / 2
    assert found["a.z"][-1] == pytest.approx(float(weights @ ((1 - s) * value(s))) / 2, abs=1e-12)


# Bodies that lie on floors of their own: mass, and the multiplier c (t - a)^k ... as c and the pairs (a, k).
Body = tuple[float, float, tuple[tuple[float, int], ...]]
ROOTS: dict[str, tuple[Body, ...]] = {
    "third order, and a fourth later": ((0.908, -0.0207, ((1.06, 3), (1.63, 4))),),
    "third order within a long step of a motionless body": ((0.562, -20.9, ((1.62, 3), (2.39, 4))),),
    "fourth order where another lets go": (
        (0.198, 0.0134, ((1.65, 4),)),
        (4.34, -28.6, ((1.65, 1),)),
    ),
    "two fourth orders where two let go": (
        (0.0526, -357.0, ((1.43, 1),)),
        (0.034, -0.0169, ((1.43, 1), (1.09, 4))),
        (23.8, 27.9, ((1.43, 4), (0.989, 4))),
    ),
    # More contacts than formulas are for.
    "seven bodies, of which two touch zero where another lets go": (
        (1.0, 20.0, ((1.1, 2),)),
        (2.0, 15.0, ((1.3, 4),)),
        (1.0, -20.0, ((1.3, 1),)),
        (0.5, 9.0, ((1.9, 2), (0.7, 2))),
        (3.0, -12.0, ((2.1, 3),)),
        (1.0, 20.0, ((1.3, 2),)),
        (1.0, 7.0, ((0.4, 4),)),
    ),
}


@pytest.mark.parametrize("how", [{}, {"rtol": 1e-10, "atol": 1e-12}], ids=["plain", "atol"])
@pytest.mark.parametrize("bodies", ROOTS.values(), ids=ROOTS)
def test_a_multiplier_lets_go_where_it_becomes_less_than_zero_and_where_it_touches_zero_not(
    bodies: tuple[Body, ...], how: dict[str, float]
) -> None:
    lines = ["lagcli: 1", "particles:"]
    lines += [f"  p{i}: {{mass: {m}, position: [0, 0, 0]}}" for i, (m, _, _) in enumerate(bodies)]
    lines.append("forces:")
    for i, (_, c, roots) in enumerate(bodies):
        factors = "*".join(f"(t - {a})**{k}" for a, k in roots)
        lines.append(f'  f{i}: {{to: p{i}, force: "[0, 0, -({c})*{factors}]"}}')
    lines.append("inequality:")
    lines += [f'  c{i}: {{condition: "p{i}.z >= 0", restitution: 0.5}}' for i in range(len(bodies))]
    found = lagcli.simulate(
        lagcli.loads("\n".join([*lines, "simulation: {duration: 3, samples: 31}"])), **how
    )
    expected = []
    for i, (m, c, roots) in enumerate(bodies):
        push = c * np.polynomial.Polynomial.fromroots([a for a, k in roots for _ in range(k)])
        ways = [(a, k) for a, k in roots if k % 2]
        assert len(ways) <= 1
        let_go = ways[0][0] if ways else 4.0
        z = -push.integ(2, lbnd=let_go)(found.t) / m
        z = np.where(found.t > let_go, z, 0.0)
        np.testing.assert_allclose(found[f"p{i}.z"], z, rtol=1e-8, atol=1e-11 + 1e-10 * np.abs(z).max())
        lam = np.where(found.t < let_go, push(found.t), 0.0)
        np.testing.assert_allclose(found[f"lambda.c{i}"], lam, rtol=0, atol=1e-8 * np.abs(lam).max())
        expected += [(let_go, "release", f"c{i}", k) for _, k in ways]
    told = sorted(incidents(found), key=lambda each: each[2])
    assert [each[1:] for each in told] == [each[1:3] for each in sorted(expected, key=lambda each: each[2])]
    # Where a force vanishes as t^3 it is none about its root.
    for (t, _, _), (at, _, _, k) in zip(told, sorted(expected, key=lambda each: each[2]), strict=True):
        assert t == pytest.approx(at, abs=1e-9 if k == 1 else 2e-3)


# Loads c (t - a)^k on a body whose contact is declared twice, while another one presses its own floor; and the height
# after the switch at t = 1 of the other load, at which the order of the first one decides.
@pytest.mark.parametrize("k", [1, 2, 3, 4])
@pytest.mark.parametrize("beside", ["-1 - max(0, t - 1)", "-2 + sign(t - 1)", "0"])
def test_a_load_that_two_contacts_share_is_decided_beside_one_that_presses(k: int, beside: str) -> None:
    model = f"""lagcli: 1
coordinates: {{a: {{value: 0}}, b: {{value: 0}}}}
lagrangian: "3/2*rate(a)**2 + rate(b)**2"
forces: {{la: {{to: a, force: "-7*(t - 1)**{k}"}}, lb: {{to: b, force: "{beside}"}}}}
inequality: {{fa: a >= 0, ga: a/2 >= 0, fb: b >= 0}}
simulation: {{start: 1, duration: 1, samples: 9}}
"""
    found = lagcli.simulate(lagcli.loads(model), rtol=1e-10, atol=1e-12)
    load = 7 * (found.t - 1) ** k
    assert not len(found.events["t"])
    assert found["a"] == pytest.approx(0, abs=1e-14)
    assert found["lambda.fa"] + found["lambda.ga"] / 2 == pytest.approx(load, abs=1e-9)
    # The shortest multipliers in the mass metric: a contact of twice the gradient takes twice the force.
    assert found["lambda.fa"] == pytest.approx(load / 2, abs=1e-9)


def test_a_load_that_two_contacts_share_and_that_touches_zero_at_a_switch_holds() -> None:
    model = """lagcli: 1
coordinates: {a: {value: 0}, b: {value: 0}}
lagrangian: "40.7/2*rate(a)**2 + 0.02/2*rate(b)**2"
forces:
  la: {to: a, force: "-60*(t - 102.2)**2*(t - 102.79)**2"}
  lb: {to: b, force: "-0.006*max(0, t - 102.79) - 0.02*max(0, t - 100.7)**3"}
inequality: {fa: a >= 0, ga: a/2 >= 0, fb: b >= 0}
simulation: {start: 102, duration: 1, samples: 21}
"""
    found = lagcli.simulate(lagcli.loads(model), rtol=1e-10, atol=1e-12)
    load = 60 * (found.t - 102.2) ** 2 * (found.t - 102.79) ** 2
    assert not len(found.events["t"])
    assert found["R.a"] == pytest.approx(load, abs=1e-8)


def test_a_leg_that_a_load_comes_to_lies_on_the_others_while_another_body_is_pressed() -> None:
    """At a switch a load on one leg grows as t^2, and one on a body beside the table, whose contact is there twice."""
    model = """lagcli: 1
particles:
  a: {mass: 1, position: [1, 1, 0]}
  b: {mass: 1, position: [-1, 1, 0]}
  c: {mass: 1, position: [-1, -1, 0]}
  d: {mass: 1, position: [1, -1, 0]}
  e: {mass: 1, position: [5, 0, 0]}
rigid: {table: [a, b, c, d]}
forces:
  la: {to: a, force: "[0, 0, -5*max(0, t - 0.5)**2]"}
  lb: {to: [b, c, d], force: "[0, 0, -1]"}
  le: {to: e, force: "[0, 0, -max(0, t - 0.5)**2]"}
inequality: {fa: a.z >= 0, fb: b.z >= 0, fc: c.z >= 0, fd: d.z >= 0, fe: e.z >= 0, ge: 2*e.z >= 0}
simulation: {duration: 1, samples: 5}
"""
    found = lagcli.simulate(lagcli.loads(model))
    t = after(found.t, 0.5)
    assert incidents(found) == [(0.5, "contact", "fe"), (0.5, "contact", "ge")]
    assert sum(found[f"lambda.f{leg}"] for leg in "abcd") == pytest.approx(3 + 5 * t**2, abs=1e-10)
    assert found["lambda.fb"] == pytest.approx(found["lambda.fd"], abs=1e-10)
    assert found["lambda.fe"] == pytest.approx(t**2 / 2, abs=1e-11)
    assert found["lambda.ge"] == pytest.approx(t**2 / 4, abs=1e-11)


def test_a_run_goes_on_bit_for_bit_while_it_comes_to_an_edge(tmp_path: Path) -> None:
    """Steps towards the edge are short, and the one behind it as long as was wished: also where a run goes on between
    them."""
    model = lagcli.loads(
        """lagcli: 1
particles: {a: {mass: 1, position: [-1, 0, 0.1], velocity: [1, 0, 0]}}
forces:
  weight: {to: all, force: "[0, 0, -10*m]"}
  swing: {to: a, force: "[-0.3*sin(9*a.x), 0, 0]"}
inequality:
  floor: {condition: "a.z - 0.1 - 0.2*max(a.x - 0.1, 0)**2 - 0.3*max(a.x, 0) >= 0", restitution: 0}
"""
    )
    point, rows = tmp_path / "run.json", 2**-7
    whole = lagcli.simulate(model, duration=1.25, output_step=rows)
    lagcli.simulate(model, duration=140 * rows, output_step=rows, checkpoint=point)
    again = lagcli.simulate(model, duration=1.25, output_step=rows, resume=point)
    assert np.array_equal(again.rows, whole.rows[141:])
    assert again.stats.steps == whole.stats.steps
