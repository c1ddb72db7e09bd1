"""What an assembly tells, and that `check`, `displacements` and `simulate` see the same start."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import pytest

import lagcli
from lagcli.api import cache
from lagcli.errors import diagnostics
from tests.helpers import in_process

command = in_process.command

FOUR_BAR = """\
lagcli: 1
coordinates: {x: {value: 1}, y: {value: 0.1}, u: {value: 2, rate: 1}}
lagrangian: rate(x)**2/2 + rate(y)**2/2 + rate(u)**2/2
holonomic:
  circle: x**2 + y**2 = 4
  slide: 2*u = 3*x
simulation: {duration: 0.1, samples: 2, assemble: true}
"""
PLAIN = FOUR_BAR.replace(", assemble: true", "")
ROLLING = """\
lagcli: 1
coordinates: {x: {}, s: {rate: 2}}
lagrangian: rate(x)**2/2 + rate(s)**2/2
differential:
  roll: 3*rate(x) = 4*rate(s)
"""


def test_residuals_are_those_of_the_equation_as_it_is_written():
    found = lagcli.check(lagcli.loads(PLAIN))
    assert found.initial.position_residual == pytest.approx(4 - 1.01)
    assert found.initial.velocity_residual == pytest.approx(2)
    messages = [d.message for d in found.warnings]
    assert "the initial positions violate `slide` by 1 (0.27735 per unit of its gradient)" in messages
    (rolling,) = lagcli.check(lagcli.loads(ROLLING)).warnings
    assert rolling.message == "the initial velocities violate `roll` by 8 (1.6 per unit of its gradient)"


def test_a_row_of_length_one_has_one_residual_with_its_unit():
    text = "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0]}}\nholonomic: {f: norm(a) = 1.25}\n"
    (warning,) = lagcli.check(lagcli.loads(text)).warnings
    assert warning.message == "the initial positions violate `f` by 0.25 m"


def test_what_is_left_of_rows_that_cannot_hold_is_reported_as_they_are_written():
    text = "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0]}}\nholonomic: {f: 3*norm(a)**2 + 6 = 0}\n"
    with pytest.raises(diagnostics.ModelError, match=r"per unit of the gradient, in `f`, off by \d+"):
        lagcli.simulate(lagcli.loads(text), assemble=True)


def test_check_of_a_file_that_assembles_has_no_warning_and_tells_what_moves(command, tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(FOUR_BAR, encoding="utf-8")
    out, err, code = command("check", path, "--strict")
    assert code == 0
    assert "initial values: inconsistent" in out
    assert "assemble" in out
    assert "assembled positions: y from 0.1 to " in err
    path.write_text(PLAIN, encoding="utf-8")
    assert command("check", path, "--strict")[2] == 1
    assert command("check", path, "--strict", "--assemble")[2] == 0
    found = json.loads(command("check", path, "--assemble", "--json")[0])["initial"]
    assert not found["consistent"]
    assert {move["name"]: move["from"] for move in found["assembled"]["positions"]} == {
        "x": 1,
        "y": 0.1,
        "u": 2,
    }
    assert {move["name"] for move in found["assembled"]["velocities"]} == {"rate(x)", "rate(y)", "rate(u)"}


def test_all_commands_assemble_to_the_same_start(command, tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(PLAIN, encoding="utf-8")
    model = lagcli.loads(PLAIN)
    moved = lagcli.check(model, assemble=True).initial.assembled
    run = lagcli.simulate(model, assemble=True)
    assert [m.new for m in moved.positions] == pytest.approx([run[n][0] for n in "xyu"], rel=1e-12)
    assert [m.new for m in moved.velocities] == pytest.approx([run[f"rate({n})"][0] for n in "xyu"], rel=1e-9)
    assert run.stats.assembled == moved
    assert run.stats.as_json()["assembled"] == moved.as_json()
    assert "assembled" not in lagcli.simulate(model, assemble=True, duration=0).stats.as_json() or moved
    shown = lagcli.displacements(model, assemble=True)
    np.testing.assert_allclose(shown.q, run.rows[0][[1, 3, 5]], rtol=1e-12)
    assert shown.assembled == moved
    account = tmp_path / "s.json"
    _, err, code = command("simulate", path, "--assemble", "--stats", account, "-o", tmp_path / "x.csv")
    assert code == 0
    assert "assembled positions: y from 0.1 to " in err
    assert json.loads(account.read_text())["assembled"] == moved.as_json()


def test_many_moves_are_reported_in_part():
    rows = "".join(f"  f{i}: a{i}.x = {i}\n" for i in range(1, 10))
    particles = "".join(f"  a{i}: {{mass: 1, position: [0, 0, 0]}}\n" for i in range(1, 10))
    model = lagcli.loads(f"lagcli: 1\nparticles:\n{particles}holonomic:\n{rows}")
    _, positions = list(lagcli.check(model, assemble=True).initial.assembled.lines(model.units))
    assert positions.startswith("assembled positions: a9.x from 0 to 9, a8.x from 0 to 8, ")
    assert positions.endswith("a4.x from 0 to 4, and 3 more by less")


def test_displacements_ask_nothing_of_velocities():
    found = lagcli.displacements(lagcli.loads(ROLLING))
    assert found.bases.dimension == 1
    np.testing.assert_allclose(found.bases.virtual[:, 0] / found.bases.virtual[1, 0], [4 / 3, 1])
    assert "violate `roll` by 8" in found.notes[0]
    with pytest.raises(diagnostics.ModelError, match="positions violate `circle`"):
        lagcli.displacements(lagcli.loads(PLAIN))


def test_a_body_that_is_assembled_keeps_its_shape():
    text = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
  b: {mass: 1, position: [1, 0, 0]}
  c: {mass: 2, position: [0, 1, 0]}
  d: {mass: 1, position: [1, 1, 0.5]}
  e: {mass: 1, position: [2, 1, 0.5]}
rigid: {body: [a, b, c, d, e]}
holonomic: {pin: "a.x = 0.5", turned: "b.y = 0.25"}
"""
    model = lagcli.loads(text)
    there, _ = cache.assembled(model)
    assert lagcli.check(there).initial.consistent
    points = {p.members.base: p.start[0] for p in there.particles}
    assert points["a"][0] == pytest.approx(0.5)
    assert np.linalg.norm(points["e"] - points["a"]) == pytest.approx(np.sqrt(5.25))
    assert lagcli.check(model, assemble=True).dof.configuration_dof == 4


@pytest.mark.parametrize(
    ("command", "done"),
    [
        (["dof"], "the count is that at"),
        (["check"], "the count is that at"),
        (["equilibrium"], "the search begins at"),
        (["stationary", "--of", "a.x"], "the search begins at"),
    ],
)
def test_answers_of_the_nearest_configuration_say_so(
    command: list[str], done: str, tmp_path: pathlib.Path
) -> None:
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [0.6, 0, -X]}}
forces: {weight: {to: a, force: [0, 0, -9.81*m]}}
holonomic: {rod: norm(a) = 1}
"""
    path = tmp_path / "off.yaml"
    note = f"the initial positions violate the rows by 0.166: {done} the nearest consistent configuration"
    for x, is_off in (("1", True), ("0.8", False)):
        path.write_text(text.replace("X", x))
        out, err, code = in_process.run(command[0], path, *command[1:])
        assert code == 0
        assert (note in out + err) == is_off
        told = json.loads(in_process.run(command[0], path, *command[1:], "--json")[0])
        assert (note in (told["dof"] if command == ["check"] else told)["notes"]) == is_off
