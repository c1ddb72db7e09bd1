"""Classification of whole models: rows alone and together, surfaces, contradictions, parameters, and the count."""

import pytest

import lagcli
from lagcli.analysis.classification import classifier
from tests.helpers import spent

pytestmark = pytest.mark.numeric

PROMPT = 80_000  # operations


def model(rows, coordinates="x: 1, y: 2, z: 3", parameters="", holonomic=""):
    values = dict(part.split(": ") for part in coordinates.split(", "))
    lines = ["lagcli: 1"]
    lines += [f"parameters: {{{parameters}}}"] if parameters else []
    lines += ["coordinates:", *(f"  {name}: {{value: {value}}}" for name, value in values.items())]
    lines += ['lagrangian: "' + " + ".join(f"rate({name})**2/2" for name in values) + '"']
    lines += ["holonomic:", *(f'  {row}: "{text}"' for row, text in holonomic.items())] if holonomic else []
    lines += ["differential:", *(f'  {row}: "{text}"' for row, text in rows.items())]
    return lagcli.loads("\n".join(lines) + "\n")


def report(rows, *others, **more):
    return lagcli.check(model(rows, *others, **more))


def verdicts(found):
    return {c.name: c.verdict.kind for c in found.constraints if c.verdict.declared == "differential"}


def test_a_combination_of_rows_that_are_not_integrable():
    rows = {
        "left": "cos(h)*d(x) + sin(h)*d(y) - b/2*d(h) - a*d(u) = 0",
        "right": "cos(h)*d(x) + sin(h)*d(y) + b/2*d(h) - a*d(v) = 0",
        "skid": "sin(h)*d(x) - cos(h)*d(y) = 0",
    }
    found = report(rows, "x: 0, y: 0, h: 0.3, u: 0, v: 0", "a: 0.3, b: 0.7")
    assert set(verdicts(found).values()) == {"nonholonomic"}
    assert found.joint.derived_flag == (3, 2, 1, 1)
    assert found.joint.growth_vector == (2, 3, 4)
    (one,) = found.joint.combinations
    assert set(one.rows) == {"left", "right"}
    assert one.text.replace(" ", "") in ("a*u-a*v+b*h", "a*(u-v)+b*h", "b*h+a*(u-v)", "b*h+a*u-a*v")
    assert (found.dof.configuration_dof, found.dof.velocity_dof, found.dof.proof) == (4, 2, "symbolic")


def test_a_row_that_others_make_integrable():
    found = report({"slide": "d(z) - y*d(x) = 0", "still": "d(y) = 0"})
    assert verdicts(found) == {"slide": "jointly-integrable", "still": "exact"}
    slide = found.constraints[0].verdict
    assert slide.integral is not None
    assert slide.integrating_factor is None
    assert found.joint.derived_flag == (2, 2)
    assert (found.dof.holonomic, found.dof.nonholonomic) == (2, 0)


def test_a_row_that_is_integrable_on_the_surface_of_another():
    rows = {"row": "d(w) - z*d(x) = 0"}
    found = report(rows, "w: 0, x: 1, z: 1", holonomic={"valley": "z = x**2"})
    assert verdicts(found) == {"row": "jointly-integrable"}
    assert found.joint.integrals in (("w - x**3/3",), ("-3*w + x**3",), ("3*w - x**3",))
    assert found.joint.derived_flag == (2, 2)
    assert found.joint.growth_vector == (1,)
    assert found.dof.configuration_dof == 1
    found = report(rows, "w: 0, x: 1, y: 2, z: 5", holonomic={"bowl": "z = x**2 + y**2"})
    assert verdicts(found) == {"row": "nonholonomic"}
    assert found.joint.derived_flag == (2, 1, 1)
    assert found.dof.configuration_dof == 3


@pytest.mark.parametrize("shape", ["x**2 + z**2 = 2", "sqrt(x**2 + z**2) = sqrt(2)"])
def test_a_row_on_a_circle_has_two_freedoms_and_no_more(shape):
    found = report({"row": "d(w) - z*d(x) = 0"}, "w: 0, x: 1, z: 1", holonomic={"circle": shape})
    assert verdicts(found) == {"row": "jointly-integrable"}
    assert (found.dof.holonomic, found.dof.nonholonomic) == (2, 0)
    assert found.dof.configuration_dof == 1


def test_a_knife_edge_on_a_sphere_stays_nonholonomic():
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [1, 2, 2]}}
coordinates: {h: {value: 0.3}}
lagrangian: rate(h)**2/2
holonomic: {ball: "dot(a, a) = 9"}
differential: {edge: "sin(h)*d(a.x) - cos(h)*d(a.y) = 0"}
"""
    found = lagcli.check(lagcli.loads(text))
    assert verdicts(found) == {"edge": "nonholonomic"}
    assert found.joint.derived_flag == (2, 1, 1)
    assert (found.dof.configuration_dof, found.dof.velocity_dof) == (3, 2)


@pytest.mark.parametrize(
    ("rows", "named"),
    [
        ({"one": "d(x) = dt", "two": "d(x) = 2*dt"}, ["one", "two"]),
        ({"one": "rate(x) = 1", "more": "d(y) = 0", "two": "2*rate(x) = 2 + t"}, ["one", "two"]),
        ({"one": "d(x) = dt", "two": "d(y) = x*dt", "sum": "d(x) + y*d(y) = x*y*dt"}, ["one", "two", "sum"]),
    ],
)
def test_a_multiple_of_dt_is_a_contradiction_by_name(rows, named):
    for question in (lagcli.dof, lagcli.check):
        with pytest.raises(lagcli.ModelError) as refused:
            question(model(rows))
        (found,) = refused.value.diagnostics
        assert found.code == "contradictory-constraints"
        assert all(f"`{name}`" in found.message for name in named)
        assert "more" not in found.message or "more" in named


def test_time_is_a_coordinate_where_it_occurs():
    found = report({"row": "d(x) - y*dt = 0"}, "x: 1, y: 2")
    assert verdicts(found) == {"row": "nonholonomic"}
    assert (found.joint.growth_vector, found.joint.dimension) == ((2, 3), 3)
    assert found.joint.is_bracket_generating
    found = report({"row": "(1 + t)*d(x) + x*dt = 0"}, "x: 1, y: 2")
    assert verdicts(found)["row"] == "exact"
    assert found.joint.integrals[0] in ("t*x + x", "x*(t + 1)")
    assert found.dof.configuration_dof == 1


def test_uncoupled_rows_are_judged_apart():
    rows = {
        "skate": "sin(h)*d(x) - cos(h)*d(y) = 0",
        "slide": "d(p) - q*d(r) = 0",
        "still": "d(q) = 0",
        "edge": "d(u) - y*dt = 0",
    }
    found = report(rows, "x: 0, y: 0, h: 1, p: 0, q: 1, r: 0, u: 0")
    # The skate and the edge share y; the other two have nothing to do with them.
    assert verdicts(found) == {
        "skate": "nonholonomic", "slide": "jointly-integrable", "still": "exact", "edge": "nonholonomic",
    }  # fmt: skip
    assert found.joint.derived_flag[0] == 4
    assert found.joint.derived_flag[-2:] == (2, 2)
    assert found.dof.holonomic == 2


def test_values_of_parameters_for_which_the_verdict_is_another():
    row = {"row": "d(z) - k*y*d(x) = 0"}
    found = report(row, parameters="k: 2")
    assert verdicts(found) == {"row": "nonholonomic"}
    assert any("k = 0" in remark for remark in found.joint.remarks)
    found = report(row, parameters="k: 0")
    assert verdicts(found) == {"row": "exact"}
    assert (found.joint.derived_flag, found.dof.configuration_dof) == ((1, 1), 2)
    # Two parameters that must vanish together.
    row = {"row": "d(z) - (a*x + b)*y*d(x) = 0"}
    assert report(row, parameters="a: 0, b: 0").dof.configuration_dof == 2
    assert report(row, parameters="a: 0, b: 1").dof.configuration_dof == 3
    row = {"row": "d(z) - (sin(a) - b)*y*d(x) = 0"}
    assert report(row, parameters="a: 0, b: 0").dof.configuration_dof == 2


def test_exceptional_values_are_met_at_a_second_look_too(monkeypatch):
    # Where exact algebra is late, numbers are asked; what they leave open is looked at exactly once more.
    monkeypatch.setattr(classifier, "PROMPT", 0)
    rows = {"one": "d(z) - y*d(x) + k*y*d(w) = 0", "two": "d(w) - y*d(x) = 0"}
    found = report(rows, "w: 0, x: 1, y: 2, z: 3", "k: 0")
    assert (found.joint.derived_flag, found.dof.configuration_dof) == ((2, 1, 1), 3)
    assert len(found.joint.integrals) == 1
    assert found.dof.notes == (classifier.EXCEPTIONAL,)


@pytest.mark.parametrize("limit", [float("nan"), -1.0])
@pytest.mark.parametrize("question", [lagcli.dof, lagcli.check, lagcli.simulate])
def test_a_limit_that_is_none_is_refused(question, limit):
    with pytest.raises(ValueError, match="limit: a number of seconds"):
        question(model({"row": "d(z) - y*d(x) = 0"}), limit=limit)


def test_a_coordinate_is_not_eliminated_with_a_factor_that_is_zero():
    # With a = 0 the row z = x**2/a is none: x = 0 is left, and the contact form with dx = 0.
    row = {"row": "d(w) - z*d(x) = 0"}
    found = report(row, "w: 1, x: 0.5, z: 0.5", "a: 0.5", {"valley": "a*z = x**2"})
    assert (verdicts(found), found.dof.configuration_dof) == ({"row": "jointly-integrable"}, 1)
    found = report(row, "w: 1, x: 0.5, z: 0.5, y: 2", "a: 0", {"wall": "a*z = x - 1/2"})
    assert (verdicts(found), found.dof.configuration_dof) == ({"row": "jointly-integrable"}, 2)


def test_values_of_parameters_are_those_that_were_written():
    row = {"row": "d(z) - y*(cos(a) - 1/2)*d(x) = 0"}
    found = report(row, parameters="a: pi/3")
    assert (verdicts(found), found.dof.configuration_dof) == ({"row": "exact"}, 2)
    found = report(row, parameters="a: 1.0472")
    assert (verdicts(found), found.dof.configuration_dof) == ({"row": "nonholonomic"}, 3)


def test_a_coefficient_that_is_zero_in_another_form_is_none():
    # asin(x) + acos(x) = pi/2: for exact algebra two letters, for doubles a number that is only rounding.
    found = report({"row": "d(z) - y*(asin(x) + acos(x) - pi/2)*d(x) = 0"}, "x: 0.5, y: 1, z: 1")
    assert found.dof.configuration_dof in (2, None)
    assert verdicts(found)["row"] != "nonholonomic"


def test_where_the_flag_drops_is_said():
    martinet = {"row": "d(z) - y**2*d(x) = 0"}
    found = report(martinet)
    assert any("y = 0" in remark for remark in found.joint.remarks)
    assert found.dof.notes == ()
    found = report(martinet, "x: 1, y: 0, z: 3")
    assert found.dof.configuration_dof == 3
    assert any("y = 0" in note for note in found.dof.notes)


def test_rows_that_say_the_same_count_once():
    found = report({"one": "d(x) + y*d(z) = 0", "two": "exp(x)*d(x) + y*exp(x)*d(z) = 0"})
    assert (found.dof.holonomic, found.dof.nonholonomic, found.dof.redundant) == (0, 1, 1)
    assert found.dof.redundant_rows == ("two",)
    assert found.joint.derived_flag == (1, 0)


def test_a_row_that_vanishes_identically_says_nothing():
    found = report({"idle": "(sin(2*x) - 2*sin(x)*cos(x))*d(y) = 0", "row": "d(z) = 0"})
    assert (found.dof.holonomic, found.dof.nonholonomic, found.dof.redundant) == (1, 0, 1)
    assert found.dof.redundant_rows == ("idle",)


def test_a_row_with_a_kink_gets_its_verdict():
    found = report({"row": "abs(x)*d(y) + y*d(x) = 0"})
    assert verdicts(found)["row"] in ("integrable", "undecided")
    found = report({"row": "d(z) - abs(y)*d(x) = 0"})
    assert verdicts(found) == {"row": "nonholonomic"}


def test_the_time_for_proofs_is_a_keyword():
    found = model({"slide": "d(z) - y*d(x) = 0", "still": "d(y) = 0"})
    assert lagcli.dof(found, limit=5.0).configuration_dof == 1
    assert lagcli.check(found, limit=5.0).dof.configuration_dof == 1
    # Numbers need no time worth speaking of; what is not proved by then is said, and never guessed.
    assert lagcli.dof(found, limit=0.0).configuration_dof in (1, None)


def test_coupled_rows_of_eight_coordinates_are_judged_in_time():
    rows = {
        "n1": "cos(p)*d(x) + sin(p)*d(y) - cos(q)*d(p) + sin(u)*d(r) = 0",
        "n2": "-sin(p)*d(x) + cos(p)*d(y) - sin(q)*d(p) + cos(v)*d(s) = 0",
        "n3": "cos(r)*d(p) + sin(r)*d(q) + cos(s)*d(r) + sin(v)*d(u) = 0",
        "n4": "cos(x)*d(p) + sin(y)*d(q) + d(r) + cos(u)*d(v) = 0",
    }
    coordinates = ", ".join(f"{name}: {0.3 + 0.1 * n:.1f}" for n, name in enumerate("xypqrsuv"))
    found = model(rows, coordinates)
    lagcli.check(model({"row": "d(x) = 0"}))  # loads the libraries
    with spent.at_most(PROMPT):
        assert lagcli.check(found).joint.derived_flag == (4, 0)


def test_families_of_groups_are_judged_once_each_kind():
    text = """
lagcli: 1
parameters: {N: 40, a: 0.5}
coordinates:
  x[i]: {for: "i = 1..N"}
  y[i]: {for: "i = 1..N"}
  h[i]: {for: "i = 1..N", value: 0.3}
  u[i]: {for: "i = 1..N"}
  v[i]: {for: "i = 1..N"}
differential:
  left[i]: {for: "i = 1..N", equation: "cos(h[i])*d(x[i]) + sin(h[i])*d(y[i]) - d(h[i])/2 - a*d(u[i]) = 0"}
  right[i]: {for: "i = 1..N", equation: "cos(h[i])*d(x[i]) + sin(h[i])*d(y[i]) + d(h[i])/2 - a*d(v[i]) = 0"}
"""
    found = lagcli.check(lagcli.loads(text))
    assert (found.dof.holonomic, found.dof.nonholonomic) == (40, 40)
    assert len(found.joint.integrals) == 40
    assert found.joint.integrals[6] == found.joint.integrals[0].replace("[1]", "[7]")
    assert found.joint.combinations[6].rows == ("left[7]", "right[7]")
    assert found.joint.derived_flag == (80, 40, 40)


def test_a_start_at_which_time_is_special_is_judged_by_what_follows():
    found = report({"row": "t*rate(y) = 0"})
    assert verdicts(found) == {"row": "integrable"}
    assert (found.dof.holonomic, found.dof.configuration_dof) == (1, 2)
    assert any("special configuration" in note for note in found.dof.notes)


@pytest.mark.parametrize(("value", "kind"), [("0", "exact"), ("0.5", "nonholonomic")])
def test_a_long_row_that_a_parameter_makes_integrable(value, kind):
    # Too long for a search for the factors that its components share: the witness is looked at for the value.
    factor = " + ".join(f"sin({n}*x + y**{n})*exp({n}*z)" for n in range(1, 25))
    found = report({"row": f"d(z) - k*({factor})*d(x) = 0"}, parameters=f"k: {value}")
    assert verdicts(found) == {"row": kind}


def test_rows_without_a_closed_integral_are_judged_in_time():
    rows = {"row": "exp(x*y)*d(x) + sin(x + y**2)*d(y) = 0"}
    report({"row": "d(x) = 0"})  # loads the libraries
    with spent.at_most(2 * PROMPT):
        found = report(rows)
    assert (verdicts(found), found.joint.integrals) == ({"row": "integrable"}, ())
    assert len(found.joint.unsolved) == 1


def test_dense_rows_give_their_count_and_their_integral():
    rows = {
        "n1": "d(p) + (x*y + sin(z))*(d(z) - y*d(x)) + exp(x)*(d(w) - z*d(x)) = 0",
        "n2": "(2 + sin(w))*(d(z) - y*d(x)) + x*d(p) + (x**2 + y*w)*(d(w) - z*d(x)) = 0",
        "n3": "(1 + y**2)*(d(w) - z*d(x)) + cos(x*w)*d(p) + z*y*(d(z) - y*d(x)) = 0",
    }
    found = report(rows, "x: 0.3, y: 0.4, z: 0.5, w: 0.6, p: 0.7")
    assert found.joint.derived_flag == (3, 2, 1, 1)
    assert found.joint.integrals == ("p",)
    assert (found.dof.holonomic, found.dof.nonholonomic) == (1, 2)


@pytest.mark.parametrize(
    "nothing",
    [
        "2**x - exp(x*log(2))",
        "2**(x + 1) - 2*exp(x*log(2))",
        "2**(x/2) - exp(x*log(2)/2)",
        "6**x - exp(x*(log(2) + log(3)))",
        "(1/2)**x - exp(-x*log(2))",
        "cosh(x*log(2)) - (2**x + 2**(-x))/2",
        "x*(log(12) - 2*log(2) - log(3))",
    ],
)
def test_powers_and_logarithms_of_numbers_are_exact(nothing):
    found = report({"lift": f"d(z) - ({nothing})*x*d(y) = 0"})
    assert verdicts(found) == {"lift": "exact"}
    assert found.constraints[0].verdict.integral == "z"
    assert (found.dof.configuration_dof, found.dof.proof) == (2, "symbolic")


@pytest.mark.parametrize("other", ["2**x - exp(x*log(2.0000001))", "2**x - exp(x*log(3))"])
def test_powers_of_other_numbers_are_told_apart(other):
    found = report({"lift": f"d(z) - ({other})*x*d(y) = 0"})
    assert verdicts(found) == {"lift": "nonholonomic"}
    assert found.dof.configuration_dof == 3


@pytest.mark.parametrize("k", ["-1", "-0.3", "2"])
def test_an_integral_is_real_for_the_values_of_the_parameters(k):
    found = report({"w": "d(x)*(y**2 + k) - d(y) = 0"}, "x: 1, y: 3, z: 1", f"k: {k}")
    text = found.constraints[0].verdict.integral
    assert text is not None
    assert ("sqrt(k)" in text) == (float(k) > 0)
    assert ("atan" in text) == (float(k) > 0)


def test_a_row_without_a_known_value_is_none_that_vanishes():
    held = {"h": "x**2 + y**2 = 1"}
    row = {"w": "atan2(y, x + 3)*(exp(x**2) - exp(1 - y**2) + 1)*d(z) = 0"}
    found = report(row, "x: 1, y: 0, z: 1", holonomic=held)
    assert found.dof.configuration_dof in (1, None)
