"""Clusters of contacts whose impacts alternate: they part after finitely many, or end in common contact."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.output.tables.incident_table import IncidentTable
from lagcli.simulation.events import run_contacts
from tests.helpers import ballistic

LETTERS = "abcdef"


@dataclasses.dataclass(frozen=True)
class Cluster:
    """Masses of coordinates, where they begin, contacts (row of G, g0, e), and an acceleration of all of them."""

    masses: Sequence[float]
    r: Sequence[float]
    v: Sequence[float]
    contacts: Sequence[tuple[Sequence[float], float, float]]
    duration: float = 3.0
    pulled: float = 0.0
    is_plane: bool = False

    @property
    def names(self) -> list[tuple[str, str]]:
        """The columns of positions and velocities: of bodies on a line, or of one in a plane."""
        count = len(self.r)
        axes = ["a.x", "a.y"] if self.is_plane else [f"{letter}.x" for letter in LETTERS[:count]]
        return [(name, name.replace(".", ".v")) for name in axes]

    @property
    def text(self) -> str:
        """The model."""
        lines = ["lagcli: 1", "particles:"]
        if self.is_plane:
            (x, y), (u, w) = self.r, self.v
            lines.append(f"  a: {{mass: {self.masses[0]}, position: [{x}, {y}, 0], velocity: [{u}, {w}, 0]}}")
        else:
            for letter, m, x, v in zip(LETTERS, self.masses, self.r, self.v, strict=False):
                lines.append(f"  {letter}: {{mass: {m}, position: [{x}, 0, 0], velocity: [{v}, 0, 0]}}")
        if self.pulled:
            lines.append(f'forces: {{w: {{to: all, force: "[{self.pulled}*m, 0, 0]"}}}}')
        lines.append("inequality:")
        for j, (row, g0, e) in enumerate(self.contacts):
            terms = (f"({x})*{name}" for x, (name, _) in zip(row, self.names, strict=True) if x)
            lines.append(f'  k{j}: {{condition: "{" + ".join(terms)} + ({g0}) >= 0", restitution: {e}}}')
        return "\n".join([*lines, f"simulation: {{duration: {self.duration}, samples: 11}}", ""])

    @property
    def truth(self) -> ballistic.Flight:
        """The motion, impact by impact."""
        pulled = [self.pulled] * len(self.r)
        return ballistic.flight(self.masses, (self.r, self.v), self.contacts, pulled, self.duration)


def chain(
    masses: Sequence[float],
    r: Sequence[float],
    v: Sequence[float],
    e: Sequence[float],
    wall: tuple[float, float] | None = None,
    duration: float = 3.0,
) -> Cluster:
    """Bodies on a line in their order, maybe with a wall behind the last one: its place and e."""
    count, contacts = len(masses), []
    for i in range(count - 1):
        contacts.append(([-1.0 * (k == i) + (k == i + 1) for k in range(count)], 0.0, e[i]))
    if wall is not None:
        contacts.append(([-1.0 * (k == count - 1) for k in range(count)], *wall))
    return Cluster(masses, r, v, contacts, duration)


def heavy_on_light(M: float, e: float, f: float, duration: float) -> Cluster:
    """A light body on a floor, a heavy one above it that comes down."""
    contacts = [([1.0, 0.0], 0.0, e), ([-1.0, 1.0], -1.0, f)]
    return Cluster([1, M], [0.5, 2.0], [0, 0], contacts, duration, -9.81)


def plane(m: float, r: Sequence[float], v: Sequence[float], contacts: Sequence[object]) -> Cluster:
    """A body in a plane; contacts: (row of G, g0, e)."""
    return Cluster([m, m], r, v, contacts, 2.0, is_plane=True)


def onto_wall(M: float, e: float, f: float | None = None) -> Cluster:
    """A heavy body, a light one in front of it at rest, and a wall."""
    return chain([M, 1], [0.0, 1.0], [1.0, 0.0], [e], (2.0, e if f is None else f))


def three(e: float) -> Cluster:
    """Three equal bodies; they stay together below e = 7 - 4 sqrt(3) (B. Bernu and R. Mazighi, 1990)."""
    return chain([1, 1, 1], [0.0, 1.0, 2.0], [1.0, 0.1, -1.2], [e, e])


CASES = {
    "wall 1:1, e 0.1": onto_wall(1, 0.1),
    "wall 1:1, e 0.17, next to none": onto_wall(1, 0.17),
    "wall 1:1, e 0.18, just none": onto_wall(1, 0.18),
    "wall 10:1, e 0.3": onto_wall(10, 0.3),
    "wall 30:1, e 0.3": onto_wall(30, 0.3),
    "wall 100:1, e 0.3": onto_wall(100, 0.3),
    "wall 1e4:1, e 0.3": onto_wall(1e4, 0.3),
    "wall 1e6:1, e 0.3": onto_wall(1e6, 0.3),
    "wall 1e6:1, e 0.5": onto_wall(1e6, 0.5),
    "wall 1e4:1, e 0.9": onto_wall(1e4, 0.9),
    "wall 100:1, e 0.9, none": onto_wall(100, 0.9),
    "wall 100:1, elastic": onto_wall(100, 1),
    "wall 10:1, e 1 and 0.05": onto_wall(10, 0.05, 1),
    "three, e 0.01": three(0.01),
    "three, e 0.03": three(0.03),
    "three, e 0.05": three(0.05),
    "three, e 0.07": three(0.07),
    "three, e 0.08, none": three(0.08),
    "three, e 0.5": three(0.5),
    "three, elastic": three(1),
    "three, light in between": chain([5, 0.1, 2], [0, 1, 2], [1, 0, -1.5], [0.3, 0.4]),
    "four, e 0.02": chain([1, 1, 1, 1], [0, 1, 2, 3.5], [1, 0.3, -0.2, -0.5], [0.02] * 3, duration=2.2),
    "four onto a wall": chain([3, 1, 2, 1], [0, 1, 2.2, 3], [1, 0.5, 0.2, 0], [0.05] * 3, (4.0, 0.05)),
    "five, e 0.01": chain([1] * 5, [0, 1, 2, 3.1, 4.5], [1, 0.4, 0, -0.3, 0], [0.01] * 4, duration=2.3),
    "onto a wall, in no order that returns": chain(
        [2520, 5, 9.01], [0.9967, 1.536, 1.957], [0.7552, 0.1336, -0.4506], [0.6, 0.6], (2.276, 0.6)
    ),
    "struck while impacts of others slow down": chain(
        [0.934, 0.00156, 0.00193, 0.476],
        [0.9072, 1.683, 2.285, 3.346],
        [1.319, -0.1289, 0.4617, 0.1],
        [0.2] * 3,
    ),
    "pulled along": dataclasses.replace(
        chain([10, 1], [0.0, 1.0], [3.0, 0.0], [0.3], (2.0, 0.3)), pulled=1.5
    ),
    "heavy on light 1e6, e 0.5": heavy_on_light(1e6, 0.5, 0.5, 0.46),
    "heavy on light 1e3, e 0.7": heavy_on_light(1e3, 0.7, 0.7, 0.6),
    "heavy on light 100, e 0.3": heavy_on_light(100, 0.3, 0.3, 0.5),
    "heavy on light 10, e 0.9": heavy_on_light(10, 0.9, 0.9, 0.8),
    "heavy on light 1e5, e 0.2 and 0.6": heavy_on_light(1e5, 0.2, 0.6, 0.8),
    "rope 20:1": Cluster([1, 20], [0.0, 0.5], [0.0, 1.0], [([1, -1], 1.0, 0.25), ([-1, 0], 0.4, 0.25)]),
    "wedge": plane(2, [1.0, 0.05], [-1.0, 0.2], [([0, 1], 0, 0.4), ([0.2, -1], 0, 0.4)]),
    "oblique walls": plane(1, [0.6, 0.1], [-1.0, -0.3], [([0.1, 1], 0, 0.2), ([0.3, -1], 0, 0.3)]),
}


# Steps lose a series where its gaps are rounding; what follows takes so long where its speeds are small by then.
LATE = {"three, e 0.03": 1e-9, "three, e 0.05": 1e-7, "three, e 0.07": 1e-3}


@pytest.mark.parametrize("name", CASES)
def test_a_cluster_of_contacts_parts_or_stays_together(name: str) -> None:
    case = CASES[name]
    truth = case.truth
    for rtol in (1e-6, 1e-13):
        run = lagcli.simulate(lagcli.loads(case.text), rtol=rtol, atol=rtol / 100)
        last, table = run.rows[-1], run.events
        assert table is not None
        for (r, v), position, velocity in zip(case.names, truth.r, truth.v, strict=True):
            assert last[run.columns.index(r)] == pytest.approx(float(position), abs=1e-11, rel=1e-11)
            assert last[run.columns.index(v)] == pytest.approx(float(velocity), abs=1e-11, rel=1e-11)
        limits = [
            (t, name)
            for t, kind, name in zip(table.numbers[:, 0].tolist(), table.kinds, table.names, strict=True)
            if kind == "accumulation"
        ]
        if truth.collapsed is None:
            assert limits == []
            assert table.kinds.count("impact") == len(truth.struck)
        else:
            own = {j for _, j in truth.struck[-2 * len(case.contacts) :]}
            assert [name for _, name in limits] == [f"k{j}" for j in sorted(own)]
            late = LATE.get(name, 1e-10)
            assert [t for t, _ in limits] == pytest.approx([float(truth.collapsed)] * len(own), abs=late)


@pytest.mark.parametrize("name", ["wall 10:1, e 0.3", "three, e 0.07", "heavy on light 1e3, e 0.7", "wedge"])
def test_the_audit_knows_the_limit_of_impacts_that_alternate(name: str) -> None:
    model = lagcli.loads(CASES[name].text)
    run = lagcli.simulate(model)
    audit = lagcli.audit(model, run, events=run.events)
    assert [check.name for check in audit.checks if check.verdict == "fail"] == []


def failing(model: lagcli.Model, run: lagcli.Run, table: IncidentTable) -> list[str]:
    """The checks that fail with this table of incidents."""
    audit = lagcli.audit(model, run, events=table)
    return [check.name for check in audit.checks if check.verdict == "fail"]


def test_the_audit_sees_a_limit_that_is_none() -> None:
    """An impact with e = 0.3 that is called a limit; a limit that leaves a speed; one that nothing came before."""
    model = lagcli.loads(CASES["wall 10:1, e 0.3"].text)
    run = lagcli.simulate(model)
    table = run.events
    assert table is not None
    kinds = ["accumulation" if k == 20 else kind for k, kind in enumerate(table.kinds)]
    assert "impacts" in failing(model, run, IncidentTable(table.columns, kinds, table.names, table.numbers))
    numbers, after = table.numbers.copy(), table.columns.index("after.b.vx") - 2
    numbers[np.array(table.kinds) == "accumulation", after] = -0.01
    assert "impacts" in failing(model, run, IncidentTable(table.columns, table.kinds, table.names, numbers))
    alone = lagcli.loads(chain([1, 1], [0.0, 1.0], [1.0, 0.0], [0.0], duration=2.0).text)
    rigid = lagcli.simulate(alone)
    assert rigid.events is not None
    forged = IncidentTable(rigid.events.columns, ["accumulation"], ["k0"], rigid.events.numbers)
    elastic = lagcli.loads(chain([1, 1], [0.0, 1.0], [1.0, 0.0], [0.5], duration=2.0).text)
    assert "impacts" in failing(elastic, rigid, forged)


def test_a_small_push_that_a_heavy_body_hands_on_is_an_impact_too() -> None:
    """Its speed changes by less than what counts as none."""
    run = lagcli.simulate(
        lagcli.loads(
            "lagcli: 1\nparticles:\n  M: {mass: 5000, position: [0, 0, 9]}\n"
            "  m: {mass: 1, position: [0, 0, 9.001], velocity: [0, 0, -0.002]}\n"
            'forces: {w: {to: M, force: "[0, 0, -20000]"}}\n'
            "inequality:\n  floor: {condition: 'M.z >= 9', restitution: 0.5}\n"
            "  pair: {condition: 'm.z >= M.z', restitution: 0.5}\nsimulation: {duration: 1, samples: 3}\n"
        )
    )
    assert run.events is not None
    assert [*run.events.kinds, *run.events.names] == ["impact", "impact", "floor", "pair"]
    impulses = [run.events.columns.index(f"impulse.{name}") - 2 for name in ("floor", "pair")]
    assert run.events.numbers[-1, impulses] == pytest.approx([0.003, 0.003], rel=1e-9)


def test_common_velocity_and_instant_of_three_equal_bodies() -> None:
    run = lagcli.simulate(lagcli.loads(CASES["three, e 0.01"].text))
    speeds = [run.rows[-1][run.columns.index(name)] for name in ("a.vx", "b.vx", "c.vx")]
    assert speeds == pytest.approx([-1 / 30] * 3, abs=1e-14)
    assert run.events is not None
    assert run.events.numbers[-1, 0] == pytest.approx(0.97038153663, abs=1e-10)


def test_a_run_that_is_cut_in_the_middle_of_a_series_goes_on_to_the_same_limit(tmp_path: Path) -> None:
    case = CASES["wall 10:1, e 0.3"]
    model, point = lagcli.loads(case.text), tmp_path / "point.json"
    whole = lagcli.simulate(model, samples=31)
    # Nine of the impacts that are told apart lie behind t = 2.152.
    lagcli.simulate(model, duration=2.152, samples=31, checkpoint=point)
    rest = lagcli.simulate(model, samples=31, resume=point)
    assert rest.events is not None
    assert whole.events is not None
    count = len(rest.events)
    assert 4 < count < len(whole.events)
    assert rest.events.kinds == whole.events.kinds[-count:]
    assert np.array_equal(rest.events.numbers, whole.events.numbers[-count:])
    assert np.array_equal(rest.rows[-1], whole.rows[-1])


CLOSING = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0.5, 0, 0], velocity: [1, 0, 0]}
inequality:
  left: {condition: "a.x >= 0", restitution: 1}
  piston: {condition: "a.x <= 1 - t/2", restitution: 1}
simulation: {duration: 3, samples: 301}
"""
SLIDING = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [-0.955336, 0, -0.295521]}
forces: {w: {to: a, force: [0, 0, -9.81*m]}}
inequality:
  slope: {condition: "a.z*cos(0.3) - a.x*sin(0.3) >= 0", restitution: 1}
simulation: {duration: 1}
"""


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is asked after four hundred and twenty impacts in place of three thousand."""
    monkeypatch.setattr(run_contacts, "MANY", 140)


@pytest.mark.usefixtures("few")
def test_elastic_impacts_before_a_piston_that_closes_stop_the_run() -> None:
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        lagcli.simulate(lagcli.loads(CLOSING))
    reason = str(stopped.value)
    assert "without end" in reason
    assert "420 within" in reason
    assert "of `left`, `piston`" in reason
    run = stopped.value.trajectory
    assert run.events is not None
    # From one hit of the piston to the next (1 - t/2)(u - 1/2) stays, and the speed u grows by 1.
    hits = run.events.numbers[np.array(run.events.names) == "piston", 0]
    u = np.arange(len(hits)) + 2.0
    assert hits == pytest.approx(2 - 2.5 / (u - 0.5), abs=1e-11)
    assert len(run.rows) == 200


@pytest.mark.usefixtures("few")
def test_an_elastic_slide_with_a_speed_of_rounding_stops_the_run() -> None:
    with pytest.raises(lagcli.SimulationStopped, match=r"420 within .* of `slope`"):
        lagcli.simulate(lagcli.loads(SLIDING))


def test_elastic_impacts_that_become_fewer_again_have_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """pi*sqrt(M/m) of them between a heavy body and a wall (G. Galperin, 2003), and a long flight after them."""
    monkeypatch.setattr(run_contacts, "MANY", 20)
    case = chain([1e4, 1], [0.0, 1.0], [1.0, 0.0], [1.0], (2.0, 1.0), duration=1e4)
    run = lagcli.simulate(lagcli.loads(case.text))
    assert run.events is not None
    assert run.events.kinds.count("impact") == 314
    assert float(run.rows[-1][run.columns.index("a.vx")]) == pytest.approx(float(case.truth.v[0]), rel=1e-12)


@pytest.mark.usefixtures("few")
def test_a_ball_that_bounces_with_a_restitution_of_0_999_comes_to_rest() -> None:
    """It has more impacts than an elastic one may have in so short a time, and an end."""
    model = lagcli.loads(
        "lagcli: 1\nparticles:\n  a: {mass: 1, position: [0, 0, 1]}\n"
        "forces: {w: {to: a, force: [0, 0, -9.81*m]}}\n"
        'inequality: {floor: {condition: "a.z >= 0", restitution: 0.98}}\n'
        "simulation: {duration: 60, samples: 11}\n"
    )
    run = lagcli.simulate(model)
    assert run.events is not None
    t1 = np.sqrt(2 / 9.81)
    assert run.events.kinds.count("impact") > 600
    assert run.events.numbers[-1, 0] == pytest.approx(t1 * 1.98 / 0.02, rel=1e-9)


CRUSHED = """
lagcli: 1
particles:
  a: {mass: 6390, position: [0, 0, 0], velocity: [2.6, 0, 0]}
  b: {mass: 0.197, position: [0.01, 0, 0], velocity: [1, 0, 0]}
  c: {mass: 4.11, position: [0.03, 0, 0], velocity: [0.2, 0, 0]}
  d: {mass: 0.593, position: [0.1, 0, 0]}
inequality:
  ab: {condition: b.x >= a.x, restitution: 0.9}
  bc: {condition: c.x >= b.x, restitution: 0.9}
  cd: {condition: d.x >= c.x, restitution: 0.9}
  wall: {condition: d.x <= 0.15, restitution: 0.9}
simulation: {duration: 0.2, samples: 3}
"""


def test_light_bodies_before_a_wall_bring_a_heavy_one_to_rest() -> None:
    """Their impacts return in no order, and gaps that are lost open again for a while."""
    run = lagcli.simulate(lagcli.loads(CRUSHED), rtol=1e-10, atol=1e-12)
    assert run.events is not None
    for name in "abcd":
        assert run[f"{name}.x"][-1] == pytest.approx(0.15, abs=1e-8)
        assert run[f"{name}.vx"][-1] == pytest.approx(0.0, abs=1e-12)
    ended = [n for k, n in zip(run.events.kinds, run.events.names, strict=True) if k == "accumulation"]
    assert {*ended} == {"ab", "bc", "cd", "wall"}
