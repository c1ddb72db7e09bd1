"""The exact motion of systems with switches and clusters: closed forms, and a judge that finds what is put in."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.helpers import exact_motion, recorded_runs, switched_judge, switched_scenes
from tests.helpers.exact_motion import Law, Relay, System, Wall
from tests.helpers.switched_judge import Table

FLOOR = Wall("floor", ((("1",), Law()),))


def one(force: Law, wall: Wall = FLOOR, u: str = "0", v: str = "0", **more: object) -> exact_motion.Motion:
    return exact_motion.solve(System(("1",), (u,), (v,), (force,), (wall,), **more))  # type: ignore[arg-type]


def test_a_ball_bounces_and_rests_where_theory_says() -> None:
    motion = one(Law(("-10",)), dataclasses.replace(FLOOR, e="0.5"), u="0.8")
    assert (motion.happenings[0].t, motion.happenings[0].after) == (0.4, (2.0,))
    assert motion.happenings[-1].kind == "end"
    assert motion.happenings[-1].t == pytest.approx(1.2, abs=1e-15)
    assert motion.at(2.0) == ([0.0], [0.0], {"floor": 10.0}, True)


def test_a_force_that_turns_lets_a_contact_go() -> None:
    motion = one(Law(("-1",), (("1", "2", 0),)))
    assert [(h.t, h.kind) for h in motion.happenings] == [(1.0, "release")]
    assert motion.at(3.0)[0] == [2.0]
    assert motion.at(0.5)[2] == {"floor": 1.0}


@pytest.mark.parametrize(("power", "lam"), [(1, 0.5), (2, 0.25), (3, 0.125)])
def test_a_load_that_grows_like_a_power_of_t_presses_from_the_start(power: int, lam: float) -> None:
    assert one(Law((*["0"] * power, "-1"))).at(0.5)[2] == {"floor": lam}
    assert one(Law((*["0"] * power, "1"))).at(0.5)[2] == {}


def test_a_floor_that_falls_away_leaves_the_ball() -> None:
    wall = Wall("floor", ((("1",), Law((), (("1", "-10", 2),))),))
    motion = one(Law(("-9.81",)), wall)
    assert motion.happenings[0].kind == "release"
    assert motion.at(3.0)[0] == [pytest.approx(-19.62, rel=1e-15)]


def test_three_balls_collapse_to_their_common_velocity() -> None:
    walls = (
        Wall("ab", ((("-1", "1", "0"), Law()),), "0.01"),
        Wall("bc", ((("0", "-1", "1"), Law()),), "0.01"),
    )
    motion = exact_motion.solve(
        System(("1",) * 3, ("0", "1", "2"), ("1", "0.1", "-1.2"), (Law(),) * 3, walls)
    )
    assert motion.happenings[-1].t == pytest.approx(0.97038153663, abs=1e-11)
    assert motion.at(3.0)[1] == pytest.approx([-1 / 30] * 3, abs=1e-15)


def test_a_light_ball_between_a_heavy_one_and_a_wall_comes_to_rest() -> None:
    walls = (Wall("ab", ((("-1", "1"), Law()),), "0.3"), Wall("wall", ((("0", "-1"), Law(("-2",))),), "0.3"))
    motion = exact_motion.solve(System(("10", "1"), ("0", "1"), ("1", "0"), (Law(),) * 2, walls))
    assert motion.happenings[-1].t == pytest.approx(2.15287291, abs=1e-8)
    assert motion.at(3.0)[0] == pytest.approx([2.0, 2.0], abs=1e-15)


def test_a_relay_switches_where_its_coordinate_passes() -> None:
    system = System(
        ("1", "1"), ("0", "0"), ("0.1", "0"), (Law(), Law()), (Wall("f", ((("0", "1"), Law()),)),),
        (Relay(1, 0, "0.1", "1"),),
    )  # fmt: skip
    motion = exact_motion.solve(system)
    assert [(h.t, h.kind) for h in motion.happenings] == [(1.0, "release")]
    assert motion.at(3.0)[0][1] == 2.0


def test_impacts_that_crowd_without_end_are_named() -> None:
    walls = (Wall("left", ((("1",), Law()),), "1"), Wall("piston", ((("-1",), Law(("-1", "0.5"))),), "1"))
    motion = exact_motion.solve(System(("1",), ("0.5",), ("1",), (Law(),), walls))
    assert (motion.until < 2.0, len(motion.happenings)) == (True, 2000)


SCENE = switched_scenes.scene(19)


def right() -> Table:
    columns, rows, incidents, stopped = recorded_runs.run_to_stop(SCENE.text(), rtol=1e-10, atol=1e-12)
    assert stopped is None
    return switched_judge.table(SCENE, columns, rows, incidents)


def test_the_judge_passes_a_right_table_and_finds_what_is_put_in() -> None:
    table = right()
    assert switched_judge.faults(SCENE, table) == ([], 61)
    shifted = dataclasses.replace(table, u=table.u + np.linspace(0, 1e-5, 61)[:, None])
    pulled = {name: lam - 1e-6 for name, lam in table.multipliers.items()}
    missed = [each for each in table.incidents if each.kind != "impact"]
    for spoilt, words in (
        (shifted, "is off by"),
        (dataclasses.replace(table, multipliers=pulled), "pulls"),
        (dataclasses.replace(table, incidents=missed), "no impact of"),
    ):
        assert any(words in fault for fault in switched_judge.faults(SCENE, spoilt)[0])
    early = dataclasses.replace(table, t=table.t[:20])
    assert "stopped" in switched_judge.faults(SCENE, early, "a reason")[0][-1]
