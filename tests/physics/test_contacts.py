"""Runs with contacts beside what else a run may have: checkpoints, redundant rows, gradients without a value."""

from types import SimpleNamespace

import numpy as np
import pytest

import lagcli
from lagcli.compiled import numeric
from lagcli.equations import system
from lagcli.simulation import row_writer

pytestmark = pytest.mark.numeric

BALL = """lagcli: 1
parameters: {e: 0.7}
particles:
  a: {mass: 1, position: [0, 0, 0.8], velocity: [0.4, 0, 0]}
forces:
  weight: {to: all, force: "[0, 0, -m*9.81]"}
inequality:
  floor: {condition: "a.z >= 0", restitution: e}
"""


@pytest.mark.parametrize("end", [1.5, 2.2885, 2.4])
def test_a_run_that_is_resumed_is_the_one_that_was_not(end, tmp_path):
    model, grid = lagcli.loads(BALL), {"output_step": 0.01}
    mark = tmp_path / "mark.json"
    first = lagcli.simulate(model, duration=end, checkpoint=mark, **grid)
    then = lagcli.simulate(model, duration=2.6, resume=mark, **grid)
    whole = lagcli.simulate(model, duration=2.6, **grid)
    for column in ("a.z", "a.vz", "lambda.floor"):
        assert np.array_equal(then[column], whole[column][-len(then.t) :])
    told = [*first.events["t"], *then.events["t"]]
    assert told == list(whole.events["t"])


def test_contacts_stand_beside_redundant_rows():
    both = BALL.replace("inequality:", "holonomic:\n  track: a.y = 0\n  spare: 3*a.y = 0\ninequality:")
    independent = lagcli.simulate(lagcli.loads(BALL), duration=1.0, samples=11)
    found = lagcli.simulate(lagcli.loads(both), duration=1.0, samples=11)
    assert np.abs(found["a.z"] - independent["a.z"]).max() < 1e-12
    assert found.stats.impacts == independent.stats.impacts == 2


def test_an_open_rope_may_start_at_its_centre():
    rope = "lagcli: 1\nparticles:\n  a: {mass: 1, position: [0, 0, 0]}\nforces:\n"
    rope += '  weight: {to: all, force: "[0, 0, -m*9.81]"}\ninequality:\n  rope: norm(a) <= 1\n'
    found = lagcli.simulate(lagcli.loads(rope), duration=1.0, samples=11)
    assert abs(found.events["t"][0] - (2 / 9.81) ** 0.5) < 1e-12
    assert abs(found["lambda.rope"][-1] - 9.81) < 1e-9


def test_four_contacts_that_close_together_press_together():
    model = """lagcli: 1
particles:
  a: {mass: 0.05, position: [-0.03, 0, 0.15]}
  b: {mass: 0.05, position: [0.03, 0, 0.25]}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
inequality:
  floor: a.z >= 0.05
  left: a.x >= -0.03
  right: b.x <= 0.03
  pair: distance(a, b) >= 0.1
"""
    found = lagcli.simulate(lagcli.loads(model), duration=0.5, samples=11)
    forces = [found[f"lambda.{name}"][-1] for name in ("floor", "left", "right", "pair")]
    weight = 0.05 * 9.81
    assert np.abs(np.array(forces) - weight * np.array([2, 0.75, 0.75, 1.25])).max() < 1e-10


def test_penetration_is_looked_for_in_all_rows():
    model = lagcli.loads(BALL)
    found = lagcli.simulate(model, duration=1, samples=11)
    built = system.build(model)
    plain = SimpleNamespace(
        functions=SimpleNamespace(numeric=numeric.NumericSystem(built)), p=system.values(built)
    )
    bound = SimpleNamespace(enforced=SimpleNamespace(plain=plain, system=built))
    stepper = SimpleNamespace(grid=SimpleNamespace(time=lambda row: 0.0), bound=bound)
    writer = row_writer.RowWriter(stepper, row_writer.TableRows(built.columns), 0)
    assert writer.deepest(found.rows) <= 1e-15
    rows = found.rows.copy()
    rows[3, found.columns.index("a.z")] = -0.25
    assert writer.deepest(rows) == 0.25


@pytest.mark.parametrize("table", ["a.z >= 0", "a.z >= t", "a.z >= sin(3*t)/4"])
@pytest.mark.parametrize("e", [0, 0.5])
def test_an_impact_at_the_start_is_in_the_balance_of_the_energy(table, e):
    run = lagcli.simulate(
        lagcli.loads(
            "lagcli: 1\n"
            "particles: {a: {mass: 3, position: [0, 0, 0], velocity: [0.2, 0, -1]}}\n"
            'forces: {weight: {to: all, force: "[0, 0, -9.81*m]"}}\n'
            f"inequality: {{table: {{condition: {table}, restitution: {e}}}}}\n"
        ),
        duration=1,
    )
    assert run.events["t"][0] == 0
    assert run.events["kind"][0] == "impact"
    assert run.stats.energy_imbalance < 1e-9


def test_a_wall_that_jumps_is_named_where_an_integral_is_enforced():
    """y/x is enforced, which takes more numbers than the parameters."""
    model = lagcli.loads("""
lagcli: 1
parameters: {mass: 2, late: 0.5, high: 0.1}
particles: {a: {mass: mass, position: [1, 0.5, 0], velocity: [1, 0.5, 0]}}
forces: {weight: {to: a, force: "[0, 0, -m]"}}
differential: {ray: "a.x*d(a.y) - a.y*d(a.x) = 0"}
inequality: {floor: "a.z >= high*max(sign(t - late), 0)"}
simulation: {duration: 1, samples: 5}
""")
    with pytest.raises(
        lagcli.SimulationStopped, match="the wall of the closed contact `floor` jumps there"
    ) as stop:
        lagcli.simulate(model)
    assert stop.value.t == pytest.approx(0.5, abs=1e-12)
