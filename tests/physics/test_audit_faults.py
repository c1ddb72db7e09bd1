"""Tables that are no motion fail wherever and however often their rows are wrong; right ones with kinks pass."""

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import lagcli
from lagcli.auditing import all_checks
from lagcli.auditing.checks import checks_pointwise, checks_steps
from lagcli.auditing.checks.audit_report import Audit, Law, judge
from lagcli.auditing.evidence import table_input
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.table_input import AuditedTable
from lagcli.auditing.evidence.tolerances import Evidence, Tolerance, WholeRun
from lagcli.output.tables import sinks
from lagcli.running.trajectory import Trajectory

ROOT = Path(__file__).resolve().parents[2]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

OWN = {
    "uniform circular motion": """
particles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 2, 0]}}
holonomic: {ring: norm(a) = 1}
simulation: {duration: 5, samples: 251}
""",
    "free particle": """
particles: {a: {mass: 1, position: [1, 0, 0], velocity: [0.3, 2, -1]}}
simulation: {duration: 5, samples: 251}
""",
    "coordinates alone": """
coordinates: {x: {value: 1, rate: 0}, y: {value: 0, rate: 1}}
lagrangian: rate(x)**2/2 + rate(y)**2 - 2*x**2 - (y - x)**2
simulation: {duration: 5, samples: 251}
""",
    "family": """
particles:
  p[i]: {for: "i = 1..4", mass: i, position: [i, 0, 0], velocity: [0, 0.1*i, 0]}
holonomic:
  link[i]: {for: "i = 1..3", equation: "distance(p[i], p[i+1]) = 1"}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}, drag: {to: all, force: -0.1*norm(v)*v}}
simulation: {duration: 2, samples: 251}
""",
    "spring": """
particles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 3, 0]}}
forces: {spring: {potential: "5e3*(norm(a) - 1)**2"}}
simulation: {duration: 0.5, samples: 251}
""",
}
GALLERY = (
    "pendulum", "pendulum-angle", "double-pendulum", "spherical-pendulum", "water-molecule", "rolling-disk",
    "knife-edge", "bead-on-rotating-hoop", "moving-ramp-stick",
)  # fmt: skip


@functools.cache
def motion(name: str) -> tuple[lagcli.Model, Trajectory]:
    if name in OWN:
        model = lagcli.loads("lagcli: 1" + OWN[name])
        return model, lagcli.simulate(model)
    model = lagcli.load(ROOT / "models" / f"{name}.yaml")
    return model, lagcli.simulate(model, duration=min(2.0, model.simulation.duration), samples=251)


def failing(found: Audit) -> dict[str, list[str]]:
    return {c.name: [place.name for place in c.failing] for c in found.checks if c.verdict == "fail"}


# Faults: the row of the run that stands in each row of the table, which keeps its times.


def shuffled(k: Integers) -> Integers:
    return np.random.default_rng(1).permutation(k)


def pairs_swapped(k: Integers) -> Integers:
    found = k.copy()
    found[:-1:20], found[1::20] = k[1::20], k[:-1:20]
    return found


def two_swapped(at: int) -> Callable[[Integers], Integers]:
    def change(k: Integers) -> Integers:
        found = k.copy()
        found[[at, at + 1]] = at + 1, at
        return found

    return change


def repeated(every: int) -> Callable[[Integers], Integers]:
    def change(k: Integers) -> Integers:
        found = k.copy()
        found[every::every] -= 1
        return found

    return change


def frozen(first: int, last: int) -> Callable[[Integers], Integers]:
    def change(k: Integers) -> Integers:
        return np.where((k >= first) & (k < last), first - 1, k)

    return change


def delayed(k: Integers) -> Integers:
    return np.where(k >= len(k) // 2, k - 1, k)


def ahead(k: Integers) -> Integers:
    return np.where(k >= len(k) // 2, k + 5, k)[:-5]


def blocks_reversed(k: Integers) -> Integers:
    return k[: len(k) // 10 * 10].reshape(-1, 10)[:, ::-1].ravel()


def block_reversed(k: Integers) -> Integers:
    found = k.copy()
    found[100:110] = k[100:110][::-1]
    return found


FAULTS: dict[str, Callable[[Integers], Integers]] = {
    "all shuffled": shuffled,
    "every tenth pair swapped": pairs_swapped,
    "two swapped": two_swapped(120),
    "two swapped at the start": two_swapped(2),
    "two swapped at the end": two_swapped(247),
    "every 50th row repeats": repeated(50),
    "one row repeated": frozen(77, 78),
    "the last row repeated": frozen(250, 251),
    "ten rows frozen": frozen(100, 110),
    "second half delayed": delayed,
    "second half ahead": ahead,
    "blocks reversed": blocks_reversed,
    "one block reversed": block_reversed,
}


def with_rows(run: Trajectory, rows: Floats) -> Trajectory:
    return Trajectory(run.columns, rows, run.stats)


def with_rows_of(run: Trajectory, places: Integers) -> Trajectory:
    rows = run.rows[places].copy()
    rows[:, 0] = run.rows[: len(rows), 0]
    return Trajectory(run.columns, rows, run.stats)


@pytest.mark.parametrize("name", [*OWN, *GALLERY])
def test_rows_that_are_moved_fail(name: str) -> None:
    model, run = motion(name)
    assert lagcli.audit(model, run).passed
    everywhere = np.arange(len(run.rows))
    for fault, change in FAULTS.items():
        found = lagcli.audit(model, with_rows_of(run, change(everywhere)))
        assert not found.passed, (name, fault)
        assert found.conclusion.endswith("the table is not a motion of this model.")


@pytest.mark.parametrize("name", ["pendulum", "double-pendulum", "water-molecule", "coordinates alone"])
def test_a_row_of_a_neighbouring_run_fails(name: str) -> None:
    """By a part in a million of the start, the motion of another run that is as right as this one."""
    model, run = motion(name)
    other = lagcli.simulate(model, duration=float(run.rows[-1, 0]) * (1 + 1e-6), samples=len(run.rows))
    rows = run.rows.copy()
    rows[130, 1:] = other.rows[130, 1:]
    assert "steps" in failing(lagcli.audit(model, with_rows(run, rows)))


@pytest.mark.parametrize("fault", ["all shuffled", "two swapped", "ten rows frozen"])
def test_the_steps_name_the_entry(fault: str) -> None:
    model, run = motion("pendulum")
    found = lagcli.audit(model, with_rows_of(run, FAULTS[fault](np.arange(251)))).check("steps")
    assert {"a.x", "a.vz"} <= {place.name for place in found.failing}
    if fault == "two swapped":
        assert all(run.rows[118, 0] < place.t < run.rows[123, 0] for place in found.failing)


# Right motions whose forces have kinks or jumps, drives, and springs that are stiff.

KINKS = {
    "quadratic drag": """
coordinates: {x: {value: 1, rate: 0}}
lagrangian: rate(x)**2/2 - 2*x**2
forces: {d: {to: x, force: "-0.3*rate(x)*abs(rate(x))"}}
""",
    "drag of the power 3/2": """
coordinates: {x: {value: 1, rate: 0}, y: {value: 0, rate: 0}}
lagrangian: rate(x)**2/2 + rate(y)**2/2 - 5*x**2 - 5*(y - x)**2
forces:
  d: {to: x, force: "-0.3*abs(rate(x))**1.5*sign(rate(x))"}
  e: {to: y, force: "-0.2*rate(y)*abs(rate(y))"}
""",
    "linear drag": """
particles: {a: {mass: 2, position: [0.6, 0, -0.8]}}
holonomic: {rod: norm(a) = 1}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, d: {to: a, force: -0.8*v}}
""",
    "pendulum with quadratic drag": """
particles: {a: {mass: 1, position: [1, 0, 0]}}
holonomic: {rod: norm(a) = 1}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, d: {to: a, force: -0.3*norm(v)*v}}
""",
    "dependent particles with quadratic drag": """
coordinates: {theta: {value: 2, rate: 0}, phi: {value: 1, rate: 0}}
particles:
  a: {mass: 1, position: [sin(theta), 0, -cos(theta)]}
  b: {mass: 1, position: [a.x + sin(phi), 0, a.z - cos(phi)]}
forces:
  w: {to: all, force: [0, 0, -9.81*m]}
  d: {to: all, force: -0.2*norm(v)*v}
  u: {to: phi, force: "-0.1*rate(phi)*abs(rate(phi))"}
""",
    "projectile in wind": """
particles: {a: {mass: 0.1, position: [0, 0, 0], velocity: [30, 0, 40]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, d: {to: a, force: "-0.01*norm(v - [5, 0, 0])*(v - [5, 0, 0])"}}
""",
    "dry friction": """
particles: {a: {mass: 1, position: [0, 0, 0], velocity: [3, 0, 0]}}
holonomic: {y: a.y = 0, z: a.z = 0}
forces: {s: {to: a, force: [-40*a.x, 0, 0]}, f: {to: a, force: [-0.5*sign(a.vx), 0, 0]}}
simulation: {duration: 3}
""",
    "force that changes its sign": """
coordinates: {x: {value: 0, rate: 0}}
lagrangian: rate(x)**2/2
forces: {d: {to: x, force: sign(2.345 - t)}}
""",
    "switched at the first row": """
particles: {a: {mass: 1, position: [0, 1, 0]}}
holonomic: {sphere: norm(a) = 1}
forces: {d: {to: a, force: ["max(0, t - 3.3)*min(1, max(0, 6.1 - t))", 0, sign(sin(2*t))]}}
""",
    "square wave": """
particles: {a: {mass: 1, position: [0, 0, -1]}}
holonomic: {rod: norm(a) = 1}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, k: {to: a, force: [2*sign(sin(3*t)), "min(1, abs(t - 2))", 0]}}
simulation: {duration: 8}
""",
    "stops on both sides": """
particles: {a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}, b: {mass: 2, position: [1, 0, 0]}}
forces: {p: {potential: "25*max(0, distance(a, b) - 1.2)**2 + 30*max(0, 0.5 - distance(a, b))**2"}}
""",
    "floor": """
particles: {a: {mass: 1, position: [0, 0, 2]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, floor: {to: a, force: [0, 0, "2000*max(0, -a.z)"]}}
simulation: {duration: 3}
""",
    "soft floor": """
particles: {a: {mass: 1, position: [0, 0, 1], velocity: [1, 0, 0]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, floor: {to: a, force: [0, 0, "300*max(0, -a.z)*(1 - 0.2*a.vz)"]}}
simulation: {duration: 3}
""",
    "forces of |x|": """
coordinates: {x: {value: 1, rate: 0}, y: {value: 0.3, rate: 1}}
lagrangian: rate(x)**2/2 + rate(y)**2 - abs(x)**3 - 2*abs(y - x)
simulation: {duration: 6}
""",
    "stiff": """
particles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 3, 0]}}
forces: {k: {potential: "1e6/2*(norm(a) - 1)**2"}}
simulation: {duration: 1}
""",
    "driven support": """
particles: {a: {mass: 1, position: [1, 0, 0]}}
holonomic: {rod: "norm(a - [0.1*sin(7*t), 0, 0.2*cos(5*t) - 0.2]) = 1"}
forces: {w: {to: a, force: [0, 0, -9.81*m]}}
simulation: {assemble: true}
""",
    "shaken wire": """
coordinates: {s: {value: 0, rate: 0.1}}
particles: {a: {mass: 1, position: [s, 0.05*sin(25*t), s**2]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, d: {to: a, force: -0.1*v}}
""",
    "sleigh with torque": """
coordinates: {x: {value: 0, rate: 1}, y: {value: 0, rate: 0}, th: {value: 0, rate: 1}}
lagrangian: rate(x)**2/2 + rate(y)**2/2 + rate(th)**2/4
differential: {knife: sin(th)*d(x) - cos(th)*d(y) = 0}
forces:
  a: {to: th, force: "-0.2*rate(th)*abs(rate(th)) + sign(sin(t))"}
  b: {to: x, force: -0.1*rate(x)}
""",
    "relaxation": """
coordinates: {x: {value: 2, rate: 0}}
lagrangian: rate(x)**2/2 - x**2/2
forces: {d: {to: x, force: "8*(1 - x**2)*rate(x)"}}
""",
    "strong drag": """
particles: {a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}
forces: {d: {to: a, force: "-500*(v - [sin(t), cos(t), 0])"}}
simulation: {duration: 5}
""",
    "magnet": """
particles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 2, 0.3]}}
forces: {l: {to: a, force: "cross(v, [0, 0, 20]) - 0.05*norm(v)*v"}, e: {to: a, force: [3, 0, 0]}}
""",
    "comet": """
particles: {a: {mass: 1, position: [0.2, 0, 0], velocity: [0, 3, 0]}}
forces: {g: {potential: -1/norm(a)}, d: {to: a, force: -0.001*norm(v)*v}}
simulation: {duration: 13}
""",
}


@pytest.mark.parametrize("name", KINKS)
def test_kinks_jumps_and_drives_pass(name: str) -> None:
    model = lagcli.loads("lagcli: 1" + KINKS[name])
    run = lagcli.simulate(model, samples=1001)
    for every in (1, 4, 10):  # 1001, 251 and 101 rows
        found = lagcli.audit(model, with_rows(run, run.rows[::every]))
        assert found.passed, (every, failing(found))
    # At this spacing each is judged as well as a smooth one, step by step.
    assert lagcli.audit(model, run).check("steps").verdict == "pass"


def kicked(rows: int, felt: bool = True) -> Audit:
    """A particle of 2 kg that a triangular push of 20 N and 20 ms kicks at t = 2.27 (closed form)."""
    model = lagcli.loads("""
lagcli: 1
particles: {b: {mass: 2, position: [1, 0, 0], velocity: [0, 1, 0]}}
forces: {s: {to: b, force: ["20*max(0, 1 - abs(t - 2.27)/0.01)", 1, 0]}}
simulation: {duration: 4}
""")
    t, w = np.linspace(0, 4, rows), 0.01
    s = np.clip((t - 2.27) / w, -1, 1)
    v = 10 * w * np.where(s < 0, (1 + s) ** 2 / 2, 1 - (1 - s) ** 2 / 2) * felt
    x = 10 * w * w * np.where(s < 0, (1 + s) ** 3 / 6, s + (1 - s) ** 3 / 6) + 10 * w * np.maximum(
        0, t - 2.28
    )
    nothing = 0 * t
    columns = ["t", "b.x", "b.y", "b.z", "b.vx", "b.vy", "b.vz", "R.b.x", "R.b.y", "R.b.z"]
    table = np.column_stack(
        [t, 1 + x * felt, t + t * t / 4, nothing, v, 1 + t / 2, nothing, nothing, nothing, nothing]
    )
    return all_checks.audit(model, AuditedTable(columns, table), Tolerance(1e-11, 1e-13))


@pytest.mark.parametrize("rows", [41, 81, 161, 401, 1001, 4001])
def test_a_push_between_two_rows_is_no_fault(rows: int) -> None:
    found = kicked(rows)
    assert found.passed, failing(found)
    assert "impulse" in found.unjudged  # what no row shows, no sum over the rows holds


@pytest.mark.parametrize("rows", [161, 401, 1001, 4001])
def test_a_push_that_the_run_did_not_feel_fails(rows: int) -> None:
    assert not kicked(rows, felt=False).passed


def test_a_pulse_that_many_rows_show_and_no_velocity_fails() -> None:
    """A pendulum at rest in a kick of a second that its run stepped over: F stands in 100 rows, nothing moves."""
    model = lagcli.loads("""
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, -1]}}
holonomic: {rod: norm(a) = 1}
forces: {w: {to: a, force: [0, 0, -9.81*m]}, kick: {to: a, force: ["5*exp(-((t - 3)/0.5)**2)", 0, 0]}}
""")
    t = np.linspace(0, 10, 501)
    columns = ["t", "a.x", "a.y", "a.z", "a.vx", "a.vy", "a.vz", "lambda.rod", "R.a.x", "R.a.y", "R.a.z"]
    row = [0, 0, -1, 0, 0, 0, -9.81, 0, 0, 9.81]
    found = all_checks.audit(
        model, AuditedTable(columns, np.column_stack([t, np.tile(row, (501, 1))])), Tolerance(1e-11, 1e-13)
    )
    assert "a.vx" in failing(found)["steps"]


# What is said of what could be judged.


def test_pass_is_said_of_what_was_judged() -> None:
    law = Law("any", "D.0", "0 = 0")
    judged = np.zeros((100, 1), dtype=bool)
    for count, verdict in (
        (100, "pass"),
        (91, "pass"),
        (89, "partly judged"),
        (1, "partly judged"),
        (0, "not judged"),
    ):
        judged[:count], judged[count:] = True, False
        check = judge(law, ["a"], np.arange(100.0), np.zeros((100, 1)), np.ones((1, 1)), judged)
        assert (check.verdict, check.fraction) == (verdict, count / 100)
        assert check.as_json()["fraction"] == count / 100
    beyond = judge(
        law, ["a"], np.arange(100.0), 2 + np.zeros((100, 1)), np.ones((1, 1)), np.arange(100)[:, None] < 1
    )
    assert beyond.verdict == "fail"


@pytest.mark.parametrize("rows", [1, 2, 3, 5])
def test_a_table_of_few_rows_does_not_read_as_passed(rows: int) -> None:
    model, run = motion("double-pendulum")
    places = np.linspace(0, 250, rows).astype(int)
    found = lagcli.audit(model, with_rows(run, run.rows[places]))
    assert found.passed
    assert "almost nothing of the motion could be judged: the rows are too far apart" in found.conclusion
    assert "newton" in found.conclusion
    assert "All checks passed" not in found.conclusion


def test_work_that_the_rows_do_not_show_is_no_number() -> None:
    model = lagcli.loads("""
lagcli: 1
parameters: {om: 10, m: 1, L: 0.3}
coordinates: {th: {rate: om}}
particles: {tip: {mass: m, position: "[L*cos(th), 0, L*sin(th)]"}}
forces: {w: {to: tip, force: [0, 0, -9.81*m]}}
holonomic: {motor: th = om*t}
""")
    run = lagcli.simulate(model, samples=1001)
    dense, coarse = (
        dict(lagcli.audit(model, with_rows(run, run.rows[::every])).figures) for every in (1, 500)
    )
    assert dense["work_of_constraints"] == pytest.approx(dense["energy_gained"], rel=1e-6)
    assert np.isnan(coarse["work_of_constraints"])
    found = lagcli.audit(model, with_rows(run, run.rows[::500]))
    assert found.as_json()["figures"]["work_of_constraints"] is None


# Energy and outputs.

OUTPUTS = """
lagcli: 1
parameters: {N: 3}
coordinates: {th: {value: 0.3, rate: 1}, s: {value: 0.2, rate: 0.1}}
particles:
  p[i]: {for: "i = 1..N", mass: i, position: [i, 0, 0], velocity: [0, 0.1*(i-1), 0]}
  b: {mass: 2, position: [sin(th), t/10, -cos(th)]}
lagrangian: rate(s)**2*(1 + s**2)/2 - s**4/4 + rate(s)*sin(s)
holonomic:
  link[i]: {for: "i = 1..N-1", equation: "distance(p[i], p[i+1]) = 1"}
  on: p[1] = [1, 0, 0]
forces: {w: {to: all, force: [0, 0, -9.81*m]}, d: {to: all, force: -0.1*norm(v)*v}}
outputs:
  tension[i]: {for: "i = 1..N-1", expression: "multiplier(link[i])"}
  push: reaction(b)
  power: "dot(reaction(p[2]), p[2].v)"
  T: kinetic
  V: potential
  sum: T + V + tension[1]
  up: push.z
  of_one: multiplier(on.x)
  of_all: multiplier(on)
  moved[i]: {for: "i = 1..N", expression: "p[i] + [0, T, 0]"}
  member: moved[2].y
  angle: atan2(p[3].z, p[3].x - 1)
  side: sign(p[3].z)
  fast: sin(1000*t)*rate(s)
  fixed: 2*N
  faster[i]: {for: "i = 1..N", expression: "p[i].ay"}
  pull: b.a
  turned: rate(p[2].x, 2)
  along: "dot(b.a, b.v) + faster[2]"
  share: reaction(p[2], link[1])
  shares[i]: {for: "i = 1..N-1", expression: "reaction(p[i], link[i]).x"}
  one_row: "reaction(p[1], on.y).y"
  swing: rate(th, 2)
  of_swing: swing + 1
simulation: {duration: 1, samples: 101}
"""


@pytest.fixture(scope="module")
def with_outputs() -> tuple[lagcli.Model, Trajectory]:
    model = lagcli.loads(OUTPUTS)
    return model, lagcli.simulate(model)


def test_energy_and_outputs_are_computed_again(with_outputs: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = with_outputs
    found = lagcli.audit(model, run)
    assert found.passed, failing(found)
    columns = found.check("columns")
    own = ["energy", *(name for output in model.outputs for name in output.columns)]
    assert columns.judged == columns.entries - 2 * 101 == 101 * (len(own) - 2)
    own = [name for name in own if name not in ("swing", "of_swing")]  # not to be had from r, v, lambda and R
    with np.errstate(all="ignore"):
        e = Evidence(
            ModelLaws(model),
            table_input.read(ModelLaws(model), run.columns, run.rows),
            Tolerance(1e-11, 1e-13),
        )
    for name in own:
        for change in (lambda y: y * 1.001, lambda y: y + 1e-3):
            rows = run.rows.copy()
            place = run.columns.index(name)
            rows[:, place] = change(rows[:, place])
            if np.array_equal(rows, run.rows):
                continue
            e.run = WholeRun(AuditedTable(run.columns, rows), None, e.tolerance)
            with np.errstate(all="ignore"):
                (off,) = checks_pointwise.columns(e)
            assert [place.name for place in off.failing] == [name]


def test_one_entry_of_an_output_is_enough(with_outputs: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = with_outputs
    for name, value in (("energy", 1e-6), ("tension[2]", 1e-6), ("angle", np.nan)):
        rows = run.rows.copy()
        rows[50, run.columns.index(name)] += value
        found = lagcli.audit(model, with_rows(run, rows)).check("columns")
        assert [(place.name, place.t) for place in found.failing] == [(name, 0.5)]


def test_columns_that_are_not_looked_at_are_named(with_outputs: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = with_outputs
    found = lagcli.audit(model, run)
    assert found.unread == ()
    further = Trajectory((*run.columns, "note"), np.column_stack([run.rows, run.rows[:, 0]]), run.stats)
    found = lagcli.audit(model, further)
    assert found.unread == ("note",)
    assert found.as_json()["unread"] == ["note"]
    kept = [k for k, name in enumerate(run.columns) if name != "energy"]
    less = Trajectory(tuple(run.columns[k] for k in kept), run.rows[:, kept], run.stats)
    assert lagcli.audit(model, less).passed


# The instrument by itself.


@pytest.mark.parametrize("even", [True, False])
def test_bounds_of_steps_hold_for_jumps_wherever_they_are(even: bool) -> None:
    """The integral of a rate that jumps, has a kink or is smooth, against what the steps make of its rows."""
    random = np.random.default_rng(4)
    t = np.linspace(0, 2, 41)
    if not even:
        t = np.sort(np.concatenate([t, random.uniform(0, 2, 8)]))
    grid = checks_steps.TableSteps(t)
    for _ in range(40):
        c = random.uniform(0, 2)
        after = np.maximum(0, t - c)
        for y, rate in (
            (after, (t > c) * 1.0),
            (after**2 / 2, after),
            (after**3 / 6, after**2 / 2),
            (-np.cos(9 * t + c), 9 * np.sin(9 * t + c)),
        ):
            nothing = np.zeros((len(t), 1))
            one = checks_steps.Quantity(
                ("y",), y[:, None], rate[:, None], nothing, nothing, np.zeros(1, bool), np.ones(1), np.ones(1)
            )
            residual, limit, _ = checks_steps.judged_steps(grid, one, np.zeros(len(t) - 1, bool))
            assert (np.abs(residual) <= limit + 1e-13).all()


@pytest.mark.parametrize("rows", [[50], [0], range(50, 60), range(251)])
def test_a_table_with_points_where_rows_have_no_gradient_fails(rows: list[int]) -> None:
    model, run = motion("uniform circular motion")
    table = run.rows.copy()
    table[np.ix_(list(rows), [run.columns.index(f"a.{axis}") for axis in "xyz"])] = 0.0
    found = lagcli.audit(model, with_rows(run, table))
    assert "positions" in failing(found)
    assert found.conclusion.endswith("the table is not a motion of this model.")


def test_a_table_with_tabs_is_audited_as_one_with_commas(tmp_path: Path) -> None:
    model, run = motion("pendulum")
    wrong = run.rows.copy()
    wrong[100, 1] += 1e-3
    verdicts = []
    for ending in ("csv", "tsv"):
        for k, rows in enumerate((run.rows, wrong)):
            path = tmp_path / f"{k}.{ending}"
            sink = sinks.open_sink(path, run.columns)
            sink.write(rows)
            sink.commit()
            verdicts.append(lagcli.audit(model, path).passed)
    assert verdicts == [True, False, True, False]


# Pulses between two rows, of what t moves, carries along, or makes heavier.
UNSHOWN = {
    "map": """
coordinates: {s: {value: 0.2, rate: 0.1}}
particles: {b: {mass: 1, position: ["s + exp(-((t - 1.013)/0.001)**2)/50", s**2, 0]}}
forces: {weight: {to: b, force: [0, -9.81, 0]}}
""",
    "inertia": """
coordinates: {x: {value: 0.3, rate: 1}}
lagrangian: (1 + exp(-((t - 1.013)/0.001)**2))*rate(x)**2/2 - x**2
""",
}


@pytest.mark.parametrize("name", UNSHOWN)
def test_a_pulse_between_rows_of_what_t_moves_is_no_fault(name: str) -> None:
    model = lagcli.loads("lagcli: 1" + UNSHOWN[name])
    run = lagcli.simulate(model, duration=2, samples=201)
    assert lagcli.audit(model, run).passed
    for fault in ("two swapped", "ten rows frozen"):
        wrong = with_rows_of(run, FAULTS[fault](np.arange(201)))
        assert "steps" in failing(lagcli.audit(model, wrong)), fault


# A bend in t exactly at a row, of a wall that stays closed and of an equation: the row has one side of it.
BENDS = {
    "wall falls": 'inequality: {f: {condition: "a.z >= -max(0, t - 1)**2"}}',
    "wall rises": 'inequality: {f: {condition: "a.z >= 0.7*max(0, t - 1)**2"}}',
    "wall turns": 'inequality: {f: {condition: "a.z >= 0.3*(t - 1)*abs(t - 1) + 0.3 - 0.6*t"}}',
    "row": 'holonomic: {f: "a.z = max(0, t - 1)**2"}',
    "slope": 'inequality: {f: {condition: "a.z - 0.2*a.x >= -0.5*max(0, t - 1)**2 - 0.5*max(0, t - 1.5)**2"}}',
}


def bent(name: str) -> str:
    velocity = "[0.3, 0, -0.6]" if name == "wall turns" else "[0.3, 0, 0]"
    return f"""lagcli: 1
particles: {{a: {{mass: 1, position: [0, 0, 0], velocity: {velocity if name != "slope" else "[0, 0, 0]"}}}}}
forces: {{w: {{to: a, force: [0, 0, -9.81*m]}}}}
{BENDS[name]}
simulation: {{duration: 2, samples: 201}}
"""


@pytest.mark.parametrize("name", BENDS)
def test_accelerations_are_right_on_either_side_of_a_bend_at_a_row(name: str) -> None:
    found = lagcli.audit(lagcli.loads(bent(name)))
    assert found.passed, found
    assert found.check("accelerations").verdict == "pass"


def test_an_acceleration_beside_both_sides_of_a_bend_is_found() -> None:
    model = lagcli.loads(bent("wall falls"))
    run = lagcli.simulate(model)
    for name in ("R.a.z", "lambda.f"):  # of a force that is too large, with the multiplier of it
        run.rows[100, list(run.columns).index(name)] += 1e-5
    assert "accelerations" in failing(lagcli.audit(model, run))
