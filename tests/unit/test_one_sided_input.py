"""Reading `inequality` and `events`: what they become, and where what is wrong with them stands."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.expression import tree
from lagcli.model import model

HEAD = """lagcli: 1
parameters: {e: 0.5, N: 3}
particles:
  a: {mass: 1, position: [0, 0, 1]}
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, 1]"}
"""


def read(text: str, **changes: object) -> model.Model:
    return lagcli.loads(HEAD + text, changes)


def error(text: str) -> tuple[str, str, str]:
    """Code, spot and hint of the one error of a model."""
    with pytest.raises(diagnostics.ModelError) as caught:
        read(text)
    (one,) = caught.value.diagnostics
    at = one.location
    line = (HEAD + text).splitlines()[at.line - 1]
    return one.code, line[at.column - 1 : at.column - 1 + at.length], one.hint


def sides(law: model.Inequality) -> tuple[str, str]:
    """The texts of what is not less, and of what is not greater."""
    relation, text = law.equation.tree, law.equation.origin.value
    assert isinstance(relation, tree.Relation)
    assert relation.relation == ">="
    return text[relation.left.start : relation.left.end], text[relation.right.start : relation.right.end]


def test_a_condition_is_turned_round_so_that_left_less_right_is_not_negative() -> None:
    floor, lid = read("inequality:\n  floor: a.z >= 0\n  lid: {condition: norm(a) <= 2*N + t}\n").inequality
    assert sides(floor) == ("a.z", "0")
    assert sides(lid) == ("2*N + t", "norm(a)")
    assert (floor.rows, floor.restitution.tolist(), floor.equation.location.line) == (("floor",), [0.0], 7)


def test_restitution_is_an_expression_of_parameters() -> None:
    text = 'inequality:\n  floor: {condition: a.z >= 0, restitution: "2*e*min(e, 1)"}\n'
    assert read(text).inequality[0].restitution.tolist() == [0.5]
    assert read(text, e=0.25).inequality[0].restitution.tolist() == [0.125]


def test_a_family_has_a_coefficient_for_each_member() -> None:
    text = """inequality:
  gap[i][j]: {for: ["i = 1..N", "j = i+1..N"], if: "j != 3 or i == 1", condition: "distance(p[i], p[j]) >= 1",
    restitution: "(i + j)/4*e"}
  floor[i]: {for: "i = 1..N", condition: "p[i].z >= 0"}
"""
    gap, floor = read(text).inequality
    assert gap.rows == ("gap[1][2]", "gap[1][3]")
    assert np.array_equal(gap.restitution, [0.375, 0.5])
    assert np.array_equal(floor.restitution, np.zeros(3))


def test_inequalities_are_the_last_constraints() -> None:
    text = "inequality:\n  floor: a.z >= 0\nholonomic:\n  pin: p[1].x = 1\nrigid:\n  body: [p]\n"
    found = read(text)
    assert [type(law) for law in found.constraints()] == [model.Holonomic, model.RigidBody, model.Inequality]
    assert found.inequality[0].equation in list(found.expressions())


def test_events_have_defaults() -> None:
    text = "events:\n  one: {when: a.vz}\n  two: {when: t - 1, direction: up, action: stop}\n"
    one, two = read(text).events
    assert (one.name, one.when.text, one.direction, one.action) == ("one", "a.vz", "both", "record")
    assert (two.name, two.when.text, two.direction, two.action) == ("two", "t - 1", "up", "stop")
    assert one.when in list(read(text).expressions())


def test_an_event_may_use_what_an_output_may() -> None:
    when = "multiplier(floor) + multiplier(gap[2]) + reaction(a, floor).z + a.az + kinetic + height"
    text = f"""inequality:
  floor: a.z >= 0
  gap[i]: {{for: "i = 1..2", condition: "p[i].z <= 5"}}
outputs: {{height: a.z}}
events:
  push: {{when: "{when}"}}
"""
    assert len(read(text).events) == 1


@pytest.mark.parametrize(
    ("condition", "code", "spot", "hint"),
    [
        ("a.z > 0", "bad-condition", ">", "write `>=`"),
        ("a.z < 1", "bad-condition", "<", "write `<=`"),
        ("a.z = 0", "bad-condition", "=", "`holonomic`"),
        ("a.z == 0", "bad-condition", "==", "`holonomic`"),
        ("a.z != 0", "bad-condition", "!=", "`>=` or `<=`"),
        ("a.z => 0", "bad-condition", "=", "write `>=`"),
        ("a.z ≥ 0", "unexpected-character", "≥", "write `>=`"),
        ("0 <= a.z <= 1", "bad-condition", "<=", "entry of its own"),
        ("0 <= a.z < 1", "bad-condition", "<", "entry of its own"),
        ("a.z >= 0 and a.x >= 0", "bad-condition", "and", "entry of its own"),
        ("a.z >= 0 or a.x >= 0", "bad-condition", "or", "max(g, h)"),
        ("a.z", "bad-condition", "a.z", "`a.z >= 0`"),
        ("a >= 0", "bad-condition", "a >= 0", "norm(a)"),
        ("a >= 1", "bad-condition", "a >= 1", "norm(a)"),
        ("a >= [0, 0, 0]", "bad-condition", "a >= [0, 0, 0]", "norm(a)"),
        ("e >= 0", "nothing-to-push", "e >= 0", "coordinates"),
        ("t >= 0", "nothing-to-push", "t >= 0", "coordinates"),
        ("a.vz >= 0", "velocity-not-allowed", "a.vz", "under `events`"),
        ("d(a.z) >= 0", "differential-not-allowed", "d(a.z)", "written in positions"),
        ("a.az >= 0", "result-not-allowed", "a.az", "under `outputs` or `events`"),
        ("b.z >= 0", "unknown-name", "b", ""),
        ("p.z >= 0", "family-needs-index", "p", "`p[1]`"),
        ("multiplier(floor) >= 0", "result-not-allowed", "multiplier(floor)", ""),
        ("a.z >= 9**9**9", "not-finite", "9**9**9", ""),
        (f"{'(' * 1000}a.z{')' * 1000} >= 0", "too-deep", "(", "definitions"),
    ],
)
def test_a_condition_that_is_none(condition: str, code: str, spot: str, hint: str) -> None:
    found = error(f'inequality:\n  floor: "{condition}"\n')
    assert found[:2] == (code, spot)
    assert hint in found[2]


@pytest.mark.parametrize(
    ("restitution", "code", "spot", "hint"),
    [
        ("1.5", "restitution-out-of-range", "1.5", "at 1 an impact takes no energy"),
        ("-0.1", "restitution-out-of-range", "-0.1", "at 0 nothing bounces"),
        ("a.z", "position-not-allowed", "a.z", "expression of parameters"),
        ("e*t", "time-not-allowed", "t", "expression of parameters"),
        ("a.vz", "velocity-not-allowed", "a.vz", "expression of parameters"),
        ("9**9**9", "not-finite", "9**9**9", ""),
        (f"{'(' * 1000}1{')' * 1000}", "too-deep", "(", ""),
        ("'[1, 0, 0]'", "not-a-scalar", "[1, 0, 0]", ""),
    ],
)
def test_a_restitution_that_is_none(restitution: str, code: str, spot: str, hint: str) -> None:
    found = error(f"inequality:\n  floor: {{condition: a.z >= 0, restitution: {restitution}}}\n")
    assert found[:2] == (code, spot)
    assert hint in found[2]


@pytest.mark.parametrize(
    ("entry", "code", "spot", "hint"),
    [
        ("[a.z >= 0, a.x >= 0]", "bad-condition", "[a.z >= 0, a.x >= 0]", "entry of its own"),
        ("{condition: [a.z >= 0]}", "bad-condition", "[a.z >= 0]", "entry of its own"),
        ("{restitution: e}", "missing-key", "{restitution: e}", ""),
        ("{equation: a.z >= 0}", "unknown-key", "equation", "`condition`"),
        ("{condition: a.z >= 0, e: 0.5}", "unknown-key", "e", "`restitution`"),
        ("{condition: a.z >= 0, mu: 0.5}", "unknown-key", "mu", "without friction"),
        ("{condition: a.z >= 0, stiffness: 9}", "unknown-key", "stiffness", "a soft one"),
        ("{for: i = 1..N, condition: 'p[i].z >= 0'}", "bad-range", "floor", "`floor[i]`"),
    ],
)
def test_an_entry_that_is_no_inequality(entry: str, code: str, spot: str, hint: str) -> None:
    found = error(f"inequality:\n  floor: {entry}\n")
    assert found[:2] == (code, spot)
    assert hint in found[2]


@pytest.mark.parametrize(
    ("section", "hint"),
    [
        ("contacts", "`inequality`"),
        ("walls", "`inequality`"),
        ("constraints", "one-sided ones under `inequality`"),
        ("event", "`events`"),
        ("triggers", "`events`"),
    ],
)
def test_a_section_of_another_name(section: str, hint: str) -> None:
    found = error(f"{section}: {{floor: a.z >= 0}}\n")
    assert found[:2] == ("unknown-key", section)
    assert hint in found[2]


def test_keys_that_are_not_indented_are_reported_once() -> None:
    found = error("inequality:\n  floor:\n  condition: a.z >= 0\n  restitution: e\n")
    assert found[:2] == ("not-a-mapping", "condition")
    assert error("events:\n  top:\n  when: a.vz\n")[:2] == ("not-a-mapping", "when")


def test_a_one_sided_condition_under_another_section_is_sent_to_its_own() -> None:
    for condition in ("a.z >= 0", "a.z > 0"):
        found = error(f"holonomic:\n  floor: {condition}\n")
        assert found[0] == "syntax"
        assert "under `inequality`" in found[2]


def test_the_first_member_with_a_wrong_restitution_is_named() -> None:
    with pytest.raises(diagnostics.ModelError, match=r"this one is 1.5 \(first where i = 3\)"):
        read("inequality:\n  f[i]: {for: 'i = 1..N', condition: 'p[i].z >= 0', restitution: i/2}\n")


@pytest.mark.parametrize(
    ("entry", "code", "spot", "hint"),
    [
        ("a.vz", "not-a-mapping", "a.vz", "write `{when: a.vz}`"),
        ("{direction: up}", "missing-key", "{direction: up}", ""),
        ("{when: a.vz, direction: rising}", "bad-setting", "rising", "`up`"),
        ("{when: a.vz, direction: dwn}", "bad-setting", "dwn", "`down`"),
        ("{when: a.vz, action: terminate}", "bad-setting", "terminate", "`stop`"),
        ("{when: a.v}", "not-a-scalar", "a.v", ""),
        ("{when: e - 3}", "never-crosses", "e - 3", "`t - 1`"),
        ("{when: a.z = 3}", "syntax", "=", "left - right"),
        ("{when: a.z > 3}", "syntax", ">", "`direction: up`"),
        ("{condition: a.vz}", "unknown-key", "condition", "`when`"),
        ("{when: a.vz, terminal: true}", "unknown-key", "terminal", "`action: stop`"),
        ("{when: KE - 3}", "unknown-name", "KE", "under `outputs` or `events` only"),
        ("{when: multiplier(flor)}", "unknown-constraint", "flor", "`floor`"),
        ("{for: i = 1..3, when: a.z}", "unknown-key", "for", "no families"),
    ],
)
def test_an_event_that_is_none(entry: str, code: str, spot: str, hint: str) -> None:
    found = error(f"inequality:\n  floor: a.z >= 0\nevents:\n  top: {entry}\n")
    assert found[:2] == (code, spot)
    assert hint in found[2]


def test_constraints_have_one_namespace_and_events_their_own() -> None:
    found = error("holonomic:\n  floor: a.x = 0\ninequality:\n  floor: a.z >= 0\n")
    assert found == ("duplicate-name", "floor", "two columns would have one name")
    assert read("inequality:\n  a: a.z >= 0\nevents:\n  a: {when: a.z}\n").events[0].name == "a"
    assert error("events:\n  t: {when: a.z}\n")[:2] == ("bad-name", "t")


def test_a_huge_family_is_refused() -> None:
    found = error("inequality:\n  f[i]: {for: 'i = 1..1e9', condition: 'p[i].z >= 0'}\n")
    assert found[:2] == ("too-many-members", "'i = 1..1e9'")


def test_members_of_two_entries_have_names_of_their_own() -> None:
    text = "inequality:\n  f[i]: {for: 'i = 1..2', condition: 'p[i].z >= 0'}\n"
    assert error(text + "  f[2]: p[2].x >= 0\n")[:2] == ("duplicate-name", "f[2]")
    assert read(text + "  f[3]: p[3].x >= 0\n").inequality[1].rows == ("f[3]",)


@pytest.mark.parametrize(
    ("output", "code", "spot"),
    [
        ("multiplier(f)", "family-needs-index", "f"),
        ("multiplier(f[3])", "no-such-member", "f[3]"),
        ("multiplier(floor.x)", "unknown-constraint", "floor.x"),
        ("reaction(a, flor)", "unknown-constraint", "flor"),
        ("reaction(floor)", "wrong-arguments", "floor"),
    ],
)
def test_multipliers_and_forces_of_inequalities_are_checked(output: str, code: str, spot: str) -> None:
    text = "inequality:\n  floor: a.z >= 0\n  f[i]: {for: 'i = 1..2', condition: 'p[i].z >= 0'}\n"
    assert read(text + "outputs:\n  o: multiplier(f[2])\n  s: reaction(a, floor)\n").outputs[1].is_vector
    assert error(text + f"outputs:\n  o: '{output}'\n")[:2] == (code, spot)
    assert error(text + f"events:\n  o: {{when: 'norm({output})'}}\n")[:2] == (code, spot)


def test_a_number_of_degrees_in_a_condition_is_noted() -> None:
    found = read("inequality:\n  slope: a.z >= a.x*tan(30)\n")
    assert [note.code for note in found.warnings] == ["angle-in-degrees"]


def test_contacts_have_their_names_and_coefficients_in_the_order_of_the_multipliers() -> None:
    found = lagcli.loads("""\
lagcli: 1
parameters: {N: 3, none: 0}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, i]"}
inequality:
  floor[i]: {for: "i = 1..N", condition: "p[i].z >= 0", restitution: i/4}
  no[i]: {for: "i = 1..none", condition: "p[i].x >= 0", restitution: 0.9}
  wall: {condition: "p[1].x <= 5"}
holonomic: {plane: "p[1].y = 0"}
differential: {slide: "d(p[2].y) = 0"}
""")
    rows = [row.name for row in system.build(found).multiplier_rows]
    assert rows == ["plane", "slide", *found.contact_names]
    assert found.contact_names == ("floor[1]", "floor[2]", "floor[3]", "wall")
    assert found.restitution.tolist() == [0.25, 0.5, 0.75, 0.0]
    assert [law.members.base for law in found.laws] == ["plane", "slide", "floor", "no", "wall"]
