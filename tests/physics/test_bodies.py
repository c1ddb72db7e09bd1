"""Rigid bodies and joints: trees and loops against an independent code, and what a file may say of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from tests.helpers import in_process, rigid_bodies
from tests.helpers.rigid_bodies import Body, Row

G = 9.81
KINDS = (
    "revolute", "spherical", "fixed", "prismatic", "cylindrical", "point_on_line", "universal", "hooke", "planar",
    "point_on_plane",
)  # fmt: skip
NONE = np.zeros(3)


def vector(x) -> str:
    return f"[{', '.join(repr(float(part)) for part in x)}]"


def rotation(q: np.ndarray) -> np.ndarray:
    K = rigid_bodies.skew(q[1:])
    return np.eye(3) + 2 * q[0] * K + 2 * K @ K


def across(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    e = np.eye(3)[np.argmin(np.abs(n))]
    e = e - n * (e @ n)
    e = e / np.linalg.norm(e)
    return e, np.cross(n, e)


class Machine:
    """Bodies at random places with joints between them, as the text of a model and as rows of their own."""

    def __init__(self, seed: int) -> None:
        random = self._random = np.random.default_rng(seed)
        self.bodies: list[Body] = []
        self.rows: list[Row] = []
        self.joints: list[tuple[int, int, np.ndarray]] = []  # body, sign, its place in it
        lines = ["lagcli: 1", f"parameters: {{g: {G}}}", "bodies:"]
        for i in range(int(random.integers(2, 5))):
            lines.append(self._body(i))
        lines += ["forces: {weight: {to: all, force: [0, 0, -m*g]}}", "joints:"]
        for i in range(len(self.bodies)):
            other = int(random.integers(-1, i)) if i else -1
            pair = (other, i) if random.random() < 0.8 else (i, other)
            lines.append(self._joint(*pair, KINDS[int(random.integers(len(KINDS)))]))
        if random.random() < 0.4:
            lines.append(self._joint(len(self.bodies) - 1, -1, "point_on_plane"))
        self.text = "\n".join(lines) + "\n"

    def _body(self, i: int) -> str:
        random = self._random
        mass, kind, second = random.uniform(0.5, 3), int(random.integers(4)), random.uniform(0.02, 0.2, 3)
        if kind == 0:  # a plate
            second[int(random.integers(3))] = 0.0
        inertia = mass * np.diag(second.sum() - second)
        if kind == 1:
            turn = rotation(self._quaternion())
            inertia = turn @ inertia @ turn.T
        q, centre = self._quaternion(), random.uniform(-1, 1, 3)
        self.bodies.append(Body(mass, inertia, centre, rotation(q), NONE, NONE))
        shown = vector(inertia.diagonal()) if kind != 1 else f"[{', '.join(map(vector, inertia))}]"
        return (
            f"  b{i}: {{mass: {mass!r}, inertia: {shown}, center: {vector(centre)},"
            f" orientation: {{quaternion: {vector(q)}}}}}"
        )

    def _quaternion(self) -> np.ndarray:
        q = self._random.standard_normal(4)
        return q / np.linalg.norm(q)

    def _joint(self, a: int, b: int, kind: str) -> str:
        number, at, n = len(self.joints), self._random.uniform(-1, 1, 3), self._random.standard_normal(3)
        n = n / np.linalg.norm(n)

        def place(i: int) -> np.ndarray:
            return at if i < 0 else self.bodies[i].R.T @ (at - self.bodies[i].c)

        def way(i: int, u: np.ndarray) -> np.ndarray:
            return u if i < 0 else self.bodies[i].R.T @ u

        def row(of: str, u: np.ndarray = NONE, w: np.ndarray = NONE, k: int = 0) -> None:
            ends = (NONE, NONE) if of == "dot" else (place(a), place(b))
            self.rows.append(Row(number, of, a, b, *ends, way(a, u), way(b, w), k))

        e1, e2 = across(n)
        told = f", at: {vector(at)}"
        if kind in ("revolute", "spherical", "fixed", "universal"):
            for k in range(3):
                row("gap", k=k)
        elif kind in ("prismatic", "cylindrical", "point_on_line"):
            row("slide", e1)
            row("slide", e2)
        elif kind in ("planar", "point_on_plane"):
            row("slide", n)
            told += f", normal: {vector(n)}"
        if kind in ("revolute", "prismatic", "cylindrical", "point_on_line"):
            told += f", axis: {vector(n)}"
        if kind in ("revolute", "prismatic", "cylindrical", "fixed"):
            axis = n if kind != "fixed" else np.array([0.0, 0.0, 1.0])
            f1, f2 = across(axis)
            row("dot", f1, axis)
            row("dot", f2, axis)
            if kind in ("prismatic", "fixed"):
                row("dot", f1, f2)
        elif kind == "planar":
            row("dot", n, e1)
            row("dot", n, e2)
        elif kind in ("universal", "hooke"):
            row("dot", e1, e2)
            told += f", axes: [{vector(e1)}, {vector(e2)}]"
        acted, sign = (b, 1) if b >= 0 else (a, -1)
        if kind == "hooke":  # its reaction is about the centre
            told, at = told[told.index(", axes") :], self.bodies[acted].c
        self.joints.append((acted, sign, self.bodies[acted].R.T @ (at - self.bodies[acted].c)))
        named = ", ".join("ground" if i < 0 else f"b{i}" for i in (a, b))
        return f"  j{number}: {{{kind}: [{named}]{told}}}"

    @property
    def rank(self) -> int:
        centres, axes = [b.c for b in self.bodies], [b.R for b in self.bodies]
        return int(np.linalg.matrix_rank(rigid_bodies.matrix(self.rows, centres, axes), tol=1e-9))

    def values(self, now: list[Body]) -> dict[str, float]:
        """The columns of all bodies and joints at a state."""
        _, lam, A = rigid_bodies.accelerations(now, self.rows, G)
        found = {}
        for i, body in enumerate(now):
            parts = zip("x y z vx vy vz wx wy wz".split(), [*body.c, *body.v, *body.omega], strict=True)
            found |= {f"b{i}.{word}": value for word, value in parts}
        for number, (acted, sign, place) in enumerate(self.joints):
            own = [i for i, one in enumerate(self.rows) if one.joint == number]
            pair = rigid_bodies.reaction(A[own], lam[own], acted, now[acted].R @ place)
            for kind, vectors in zip(("force", "torque"), pair, strict=True):
                found |= {
                    f"{kind}.j{number}.{axis}": sign * x for axis, x in zip("xyz", vectors, strict=True)
                }
        return found


@pytest.mark.parametrize("seed", range(12))
def test_machines_move_as_by_an_independent_code(seed: int) -> None:
    machine = Machine(seed)
    model = lagcli.loads(machine.text)
    assert lagcli.dof(model).velocity_dof == 6 * len(machine.bodies) - machine.rank
    if machine.rank < len(machine.rows):
        return  # reactions are not unique
    run = lagcli.simulate(model, duration=0.3, samples=2, rtol=1e-12, atol=1e-14)
    for k, bodies in ((0, machine.bodies), (-1, rigid_bodies.run(machine.bodies, machine.rows, G, 0.3))):
        for column, value in machine.values(bodies).items():
            assert run[column][k] == pytest.approx(value, rel=1e-8, abs=2e-7), column


def test_some_machines_have_unique_reactions() -> None:
    machines = [Machine(seed) for seed in range(12)]
    assert sum(machine.rank == len(machine.rows) for machine in machines) > 5


CHAIN = """
lagcli: 1
parameters: {g: 9.81, N: 3, L: 0.5}
bodies:
  link[i]:
    {for: "i = 1..N", mass: 0.7, inertia: [0.001, 0.02, 0.02], center: ["(i - 1/2)*L", 0, 0],
     points: {tip: [L/2, 0, 0]}}
forces:
  weight: {to: all, force: [0, 0, -m*g]}
  wind[i]: {for: "i = 2..N", to: "link[i].tip", force: [0, "0.1*i", 0]}
joints:
  hinge: {revolute: [ground, "link[1]"], at: [0, 0, 0], axis: [0, 1, 0]}
  pin[i]: {for: "i = 2..N", spherical: ["link[i-1]", "link[i]"], at: ["(i-1)*L", 0, 0]}
outputs: {end: "link[N].tip", speed: "norm(link[N].tip.v)", turn: "omega(link[2])"}
simulation: {duration: 0.4, samples: 5}
"""


def test_a_family_is_as_bodies_of_their_own() -> None:
    one = CHAIN.split("bodies:")[0] + "bodies:\n"
    for i in (1, 2, 3):
        one += f"  l{i}: {{mass: 0.7, inertia: [0.001, 0.02, 0.02], center: [{(i - 0.5) * 0.5}, 0, 0],"
        one += " points: {tip: [0.25, 0, 0]}}\n"
    one += "forces:\n  weight: {to: all, force: [0, 0, -m*g]}\n"
    one += "  w2: {to: l2.tip, force: [0, 0.2, 0]}\n  w3: {to: l3.tip, force: [0, 0.3, 0]}\njoints:\n"
    one += "  hinge: {revolute: [ground, l1], at: [0, 0, 0], axis: [0, 1, 0]}\n"
    one += "  p2: {spherical: [l1, l2], at: [0.5, 0, 0]}\n  p3: {spherical: [l2, l3], at: [1.0, 0, 0]}\n"
    one += "simulation: {duration: 0.4, samples: 5}\n"
    family, alone = lagcli.simulate(lagcli.loads(CHAIN)), lagcli.simulate(lagcli.loads(one))
    for column, other in (
        ("link[3].z", "l3.z"),
        ("force.pin[3].z", "force.p3.z"),
        ("torque.hinge.x", "torque.hinge.x"),
    ):
        assert family[column] == pytest.approx(alone[other], rel=1e-9, abs=1e-9)
    assert family["turn.y"] == pytest.approx(family["link[2].wy"], rel=1e-9)


def test_another_value_of_a_parameter_moves_joints_and_points() -> None:
    model = lagcli.loads(CHAIN)
    lagcli.simulate(model)
    again = lagcli.simulate(model.with_parameters(L=0.6))
    fresh = lagcli.simulate(lagcli.loads(CHAIN.replace("L: 0.5", "L: 0.6")))
    assert np.array_equal(again.rows, fresh.rows)


ROLLING = """
lagcli: 1
bodies:
  ball: {shape: {sphere: {mass: 2, radius: 0.3}}, center: [0, 0, 0.3], angular_velocity: [0, 5, 0], roll: true}
forces: {push: {to: ball, force: [1, 0, 0]}}
joints: {floor: {rolling: ball, radius: 0.3, on: {point: [0, 0, 0], normal: [0, 0, 1]}}}
simulation: {duration: 1, samples: 2}
"""


def test_a_ball_rolls() -> None:
    """a = F / (m + J/r^2) = 5/7 F/m, and the ground pushes with -2/7 F."""
    run = lagcli.simulate(lagcli.loads(ROLLING))
    assert run["ball.vx"] == pytest.approx([1.5, 1.5 + 5 / 14], rel=1e-9)
    assert run["force.floor.x"] == pytest.approx([-2 / 7, -2 / 7], rel=1e-9)


SCREW = """
lagcli: 1
parameters: {g: 9.81}
bodies: {nut: {mass: 1.5, inertia: [0.02, 0.02, 0.03], center: [0, 0, 2]}}
forces: {weight: {to: all, force: [0, 0, -m*g]}}
joints: {thread: {screw: [ground, nut], at: [0, 0, 2], axis: [0, 0, 1], pitch: 0.5}}
simulation: {duration: 1, samples: 2}
"""


def test_a_nut_falls_as_its_screw_lets_it() -> None:
    """z'' = -g m / (m + J (2 pi / h)^2)."""
    model = lagcli.loads(SCREW)
    run, lead = lagcli.simulate(model), 0.5 / (2 * np.pi)
    a = -9.81 * 1.5 / (1.5 + 0.03 / lead**2)
    assert run["nut.vz"][-1] == pytest.approx(a, rel=1e-9)
    assert run["nut.wz"][-1] == pytest.approx(a / lead, rel=1e-9)
    assert lagcli.dof(model).velocity_dof == 1


GEARS = """
lagcli: 1
bodies:
  a: {mass: 1, inertia: [0.02, 0.02, 0.03], center: [0, 0, 0]}
  b: {mass: 1, inertia: [0.05, 0.05, 0.08], center: [0.3, 0, 0]}
forces: {motor: {to: a, torque: [0, 0, 0.6]}, brake: {between: [ground, b], torque: [0, 0, 0.2]}}
joints:
  pa: {revolute: [ground, a], at: [0, 0, 0], axis: [0, 0, 1]}
  pb: {revolute: [ground, b], at: [0.3, 0, 0], axis: [0, 0, 1]}
  mesh: {gear: [a, b], axis: [0, 0, 1], radii: [0.1, 0.2]}
simulation: {duration: 1, samples: 2}
"""


def test_gears_turn_each_other() -> None:
    """omega_b = -omega_a/2, so (J_a + J_b/4) omega_a' = M_a - M_b/2."""
    run = lagcli.simulate(lagcli.loads(GEARS))
    rate = (0.6 - 0.1) / (0.03 + 0.08 / 4)
    assert run["a.wz"][-1] == pytest.approx(rate, rel=1e-9)
    assert run["b.wz"][-1] == pytest.approx(-rate / 2, rel=1e-9)


RACK = """
lagcli: 1
bodies:
  pinion: {mass: 1, inertia: [0.02, 0.02, 0.03], center: [0, 0, 0]}
  bar: {mass: 2, inertia: [0.1, 0.1, 0.1], center: [0, -0.1, 0]}
forces: {motor: {to: pinion, torque: [0, 0, 0.6]}}
joints:
  axle: {revolute: [ground, pinion], at: [0, 0, 0], axis: [0, 0, 1]}
  guide: {prismatic: [ground, bar], at: [0, -0.1, 0], axis: [1, 0, 0]}
  teeth: {rack: [pinion, bar], axis: [0, 0, 1], along: [1, 0, 0], radius: 0.1}
simulation: {duration: 1, samples: 2}
"""


def test_a_pinion_drives_its_rack() -> None:
    """The rack goes with r omega: (J/r + m r) omega' r = M, so omega' = M / (J + m r^2)."""
    run = lagcli.simulate(lagcli.loads(RACK))
    rate = 0.6 / (0.03 + 2 * 0.01)
    assert run["pinion.wz"][-1] == pytest.approx(rate, rel=1e-9)
    assert abs(run["bar.vx"][-1]) == pytest.approx(0.1 * rate, rel=1e-9)


def test_reactions_that_are_not_unique_are_left_out(tmp_path: Path) -> None:
    """A door on two hinges: forces along the axis, and torques across it, may pass from one to the other."""
    text = """
lagcli: 1
bodies: {door: {shape: {box: {mass: 10, size: [0.8, 0.04, 2]}}, center: [0.4, 0, 1]}}
forces: {weight: {to: all, force: [0, 0, -m*9.81]}}
joints:
  low: {revolute: [ground, door], at: [0, 0, 0.3], axis: [0, 0, 1]}
  high: {revolute: [ground, door], at: [0, 0, 1.7], axis: [0, 0, 1]}
simulation: {duration: 0.1, samples: 2}
"""
    model = lagcli.loads(text)
    assert lagcli.dof(model).velocity_dof == 1
    assert lagcli.dof(model).redundant == 5
    run = lagcli.simulate(model)
    told = " ".join(run.notes)
    assert "force.*.z of low, high is not unique" in told
    assert "torque.*.z" not in told
    (tmp_path / "door.yaml").write_text(text)
    out, err, code = in_process.run("simulate", tmp_path / "door.yaml")
    header = out.partition("\n")[0].split(",")
    assert code == 0
    assert [name for name in header if name.startswith(("force.", "torque."))] == [
        "torque.low.z",
        "torque.high.z",
    ]
    assert "force.*.z of low, high is not unique" in err
    asked = in_process.run("simulate", tmp_path / "door.yaml", "--columns", "force.low.z,force.high.z")[0]
    assert np.loadtxt(asked.splitlines()[1:], delimiter=",").sum(axis=1) == pytest.approx([98.1, 98.1])


PLANAR = """
lagcli: 1
bodies: {"part[i]": {for: "i = 1..2", mass: 2, inertia: [0.1, 0.2, 0.2], center: [i, i, 0], planar: true}}
forces: {push: {to: "part[2]", force: [0, 3, 4]}}
simulation: {duration: 1, samples: 2}
"""


def test_a_planar_body_keeps_its_plane() -> None:
    for name, members in (("part[i]", "1..2"), ("part[i+1]", "0..1")):
        text = PLANAR.replace("part[i]", name).replace("1..2", members).replace("[i, i, 0]", "[1, 1, 0]")
        model = lagcli.loads(text)
        run = lagcli.simulate(model)
        assert lagcli.dof(model).velocity_dof == 6
        assert run["part[2].y"] == pytest.approx([1, 1])
        assert run["part[2].vz"] == pytest.approx([0, 2])
        held = sum(run[f"lambda.part.planar.{k}[2]"] for k in (1, 2, 3))
        assert held == pytest.approx([-3, -3])


ROD = """
lagcli: 1
bodies: {rod: {shape: {rod: {mass: 2, length: 1}}, center: [0.5, 0, 0], points: {end: [0.5, 0, 0]}}}
forces: {weight: {to: all, force: [0, 0, -m*9.81]}}
joints: {pin: {spherical: [ground, rod], at: [0, 0, 0]}}
simulation: {duration: 0.1, samples: 2}
"""


def test_a_thin_rod_swings_and_has_no_directions_across_it() -> None:
    run = lagcli.simulate(lagcli.loads(ROD))
    assert run["force.pin.z"][0] == pytest.approx(2 * 9.81 / 4)
    for old, new in (
        (
            "spherical: [ground, rod], at: [0, 0, 0]",
            "revolute: [ground, rod], at: [0, 0, 0], axis: [0, 1, 0]",
        ),
        (
            "spherical: [ground, rod], at: [0, 0, 0]",
            "screw: [ground, rod], at: [0, 0, 0], axis: [1, 0, 0], pitch: 1",
        ),
        ("at: [0, 0, 0]", "at: [0, 0, 0.1]"),
        ("end: [0.5, 0, 0]", "end: [0.5, 0.1, 0]"),
        ("to: all, force: [0, 0, -m*9.81]", "to: rod, torque: [0, 0, 1]"),
    ):
        assert old in ROD
        with pytest.raises(lagcli.ModelError) as caught:
            lagcli.loads(ROD.replace(old, new))
        assert {found.code for found in caught.value.diagnostics} == {"rod-spin-undefined"}


def test_m_is_nobodys_in_a_torque_between_bodies() -> None:
    named = GEARS.replace("lagcli: 1\n", "lagcli: 1\nparameters: {m: 0.2}\n").replace(
        "0, 0, 0.2]}", "0, 0, m]}"
    )
    assert named != GEARS
    with pytest.raises(lagcli.ModelError) as caught:
        lagcli.loads(named)
    assert [found.code for found in caught.value.diagnostics] == ["shadowed-name"]


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("inertia: [0.02, 0.02, 0.03]", "inertia: [0.02, 0.02, 0.05]", "inertia-triangle"),
        (
            "center: [0, 0, 2]",
            "center: [0, 0, 2], orientation: {quaternion: [1, 1, 0, 0]}",
            "bad-orientation",
        ),
        ("screw: [ground, nut]", "screw: [ground]", "bad-joint"),
        ("screw: [ground, nut]", "screw: [ground, nuts]", "unknown-name"),
        ("axis: [0, 0, 1]", "axis: [0, 0, 0]", "bad-orientation"),
        (", pitch: 0.5", "", "missing-key"),
        ("to: all, force: [0, 0, -m*g]", "to: nut.tip, force: [0, 0, 1]", "unknown-component"),
        ("to: all, force: [0, 0, -m*g]", "to: nut, force: [0, 0, 1], torque: [0, 0, 1]", "conflicting-keys"),
    ],
)
def test_mistakes_are_told_with_their_code(old: str, new: str, code: str) -> None:
    assert old in SCREW
    with pytest.raises(lagcli.ModelError) as caught:
        lagcli.loads(SCREW.replace(old, new))
    assert code in [found.code for found in caught.value.diagnostics]
