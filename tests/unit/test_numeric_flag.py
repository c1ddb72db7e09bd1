"""The derived flag by numbers: published flags, the same on surfaces, special starts, contradictions, large blocks."""

import decimal
import json
import math
import re
from decimal import Decimal
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli import progress
from lagcli.analysis import numeric_flag
from lagcli.compiled import lie_brackets, multiprecision, program, row_block
from lagcli.equations import system
from lagcli.expression import functions, term_sizes
from lagcli.start import initial
from tests.helpers import spent

pytestmark = pytest.mark.numeric

CASES = json.loads((Path(__file__).parents[1] / "reference" / "pfaffian.json").read_text("utf-8"))["systems"]
EACH = pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])


def model(values, holonomic, differential, parameters=""):
    lines = ["lagcli: 1", f"parameters: {{{parameters}}}", "coordinates:"]
    lines += [f"  {name}: {{value: {value!r}}}" for name, value in values.items()]
    lines += ["lagrangian: " + " + ".join(f"rate({name})**2/2" for name in values)]
    for title, laws in (("holonomic", holonomic), ("differential", differential)):
        lines += [f"{title}:"] * bool(laws) + [f"  {title[0]}{i}: {law}" for i, law in enumerate(laws)]
    return "\n".join(lines) + "\n"


def flag(text, deadline=math.inf):
    """The flag of all rows for the motions from the declared start."""
    built = system.build(lagcli.loads(text))
    return numeric_flag.flag(built, initial.declared(built), range(len(built.rows.rows)), deadline)


def start_values(case):
    return {name: 0.3 + 0.17 * i for i, name in enumerate(case["coords"]) if name != "t"}


def laws(case, change=lambda coefficient: coefficient):
    """The forms of a case as laws."""
    found = []
    for form in case["forms"]:
        terms = [
            f"({change(a)})*{'dt' if name == 't' else f'd({name})'}"
            for a, name in zip(form, case["coords"], strict=True)
            if a != "0"
        ]
        found.append(" + ".join(terms) + " = 0")
    return found


def require_published(case, found, free):
    """`free`: coordinates that no row knows, which the rows do not count."""
    assert found.is_certain, found.reason
    assert found.extra == tuple(case["derived_flag"])
    assert [found.dimension + free + rank for rank in found.growth] == case["growth"]
    assert case["holonomic_count"] == found.extra[-1]
    assert found.contradiction is False
    assert not any(found.inside[i] for i, alone in enumerate(case["each_integrable"]) if found.extra[-1] == 0)


@EACH
def test_published_flags(case):
    values = start_values(case)
    found = flag(model(values, [], laws(case)))
    free = len(values) + found.has_time - len({*values} & set(re.findall(r"\w+", " ".join(laws(case)))))
    require_published(case, found, free - found.has_time)


@EACH
@pytest.mark.parametrize("is_rough", [False, True], ids=["digits", "doubles"])
def test_published_flags_on_a_surface(case, is_rough, monkeypatch):
    """The coefficients are functions of others that only the surface ties to the coordinates."""
    if is_rough:
        monkeypatch.setattr(lie_brackets, "pivots", refuse)
    values = start_values(case)
    names = "|".join(values)

    def other(coefficient):
        return re.sub(rf"\b({names})\b", r"k_\1", coefficient)

    tied = [f"exp(k_{n}) + 2*k_{n} = exp({n}) + 2*{n}" for n in values]
    found = flag(model(values | {f"k_{n}": v for n, v in values.items()}, tied, laws(case, other)))
    require_published(case, found, 0)


def refuse(*_):
    raise lie_brackets.TooMuchFill


@EACH
def test_factors_and_units_change_nothing(case):
    values = start_values(case)
    first = next(iter(values))
    scaled = [f"exp({first})*1e6*({law.removesuffix(' = 0')}) = 0" for law in laws(case)]
    found, plain = flag(model(values, [], scaled)), flag(model(values, [], laws(case)))
    assert (found.extra, found.growth, found.inside) == (plain.extra, plain.growth, plain.inside)


def test_a_form_that_the_surface_makes_integrable():
    found = flag(model({"x": 0.3, "z": 0.09, "w": 0.1}, ["z = x**2"], ["d(w) - z*d(x) = 0"]))
    assert (found.extra, found.growth, found.inside, found.special) == ((1, 1), (0,), (True,), False)


@pytest.mark.parametrize(("start", "special"), [((0.3, 0.4, 0.25), False), ((0.0, 0.0, 0.0), True)])
def test_a_form_that_it_does_not(start, special):
    x, y, z = start
    found = flag(model({"x": x, "y": y, "z": z, "w": 0.1}, ["z = x**2 + y**2"], ["d(w) - z*d(x) = 0"]))
    assert (found.extra, found.growth, found.inside) == ((1, 0), (0, 1), (False,))
    assert found.special is special


@pytest.mark.parametrize(("y", "special"), [(0.0, True), (0.5, False)])
def test_martinet_drops_where_y_is_zero(y, special):
    found = flag(model({"x": 0.3, "y": y, "z": 0.2}, [], ["d(z) - y**2*d(x) = 0"]))
    assert (found.extra, found.growth, found.special) == ((1, 0), (0, 1), special)


def test_growth_that_drops_at_the_start_is_seen_behind_the_first_level():
    """dz - y^3 dx, dw - y dx: at y = 0 brackets of two fields bring as much as elsewhere, those of three less."""
    forms = ["d(u) - y*d(x) = 0", "d(z) - y**3*d(x) = 0"]
    values = {"x": 0.3, "y": 0.0, "z": 0.2, "u": 0.1}
    assert flag(model(values, [], forms)).special is True
    found = flag(model(values | {"y": 0.7}, [], forms))
    assert (found.extra, found.growth, found.special) == ((2, 1, 0), (0, 1, 2), False)


AXLE = (
    "(x2 - x1)*d(x1) + (y2 - y1)*d(y1) = 0",
    "(x2 - x1)*d(y1) - (y2 - y1)*d(x1) - a*b*d(p1) = 0",
    "(x2 - x1)*d(y2) - (y2 - y1)*d(x2) - a*b*d(p2) = 0",
)


def test_an_axle_between_two_particles_and_its_hidden_combination():
    """The turning angle of the axle is no coordinate: the combination that stays is b d(angle) - a (dp2 - dp1)."""
    values = {"x1": 0, "y1": 0, "x2": 0.48, "y2": 0.64, "p1": 0, "p2": 0}
    found = flag(model(values, ["(x1 - x2)**2 + (y1 - y2)**2 = b**2"], AXLE, "a: 0.2, b: 0.8"))
    assert (found.extra, found.growth) == ((3, 2, 1, 1), (0, 1, 2))
    assert found.inside == (False, False, False)
    assert found.digits == 60
    assert found.error < 1e-50
    assert found.least > 1e-6


def test_a_knife_edge_on_a_sphere():
    values = {"x": 0.6, "y": 0.0, "z": 0.8, "th": 0.4}
    found = flag(model(values, ["x**2 + y**2 + z**2 = 1"], ["sin(th)*d(x) - cos(th)*d(y) = 0"]))
    assert (found.extra, found.growth, found.dimension) == ((1, 0), (0, 1), 2)


def test_rows_in_time():
    found = flag(model({"x": 0.3, "y": 0.1}, [], ["d(x) = t*dt", "d(y) = x*dt"]))
    assert (found.has_time, found.extra, found.contradiction) == (True, (2, 2), False)
    found = flag(model({"x": 0.3, "y": 0.1, "u": 0.5}, ["u = x + t/5"], ["d(y) = u*dt"]))
    assert (found.has_time, found.extra, found.contradiction) == (True, (1, 0), False)
    found = flag(model({"x": 0.3, "y": 0.1, "u": 0.3}, ["u = x + t"], ["d(y) = (x - u + t)*d(x)"]))
    assert (found.extra, found.inside) == ((1, 1), (True,))


@pytest.mark.parametrize(
    ("surface", "forms"),
    [([], ["d(x) = dt", "d(x) = 2*dt"]), (["x = 0.3 + t"], ["d(x) = 2*dt"])],
)
def test_a_multiple_of_dt_is_a_contradiction(surface, forms):
    assert flag(model({"x": 0.3, "y": 0.1}, surface, forms)).contradiction is True


def test_redundant_rows_count_once():
    values = {"x": 0.3, "y": 0.1, "z": 0.2, "w": 0.4}
    circle = ["x**2 + y**2 = 0.1"]
    forms = ["x*d(x) + y*d(y) = 0", "d(z) - w*d(x) = 0", "d(z) - w*d(x) + x*d(x) + y*d(y) = 0"]
    found = flag(model(values, circle, forms))
    assert (found.extra, found.inside) == ((1, 0), (True, False, False))
    found = flag(model(values, circle, [form.replace("w*", "y*") for form in forms]))
    assert (found.extra, found.inside) == ((1, 1), (True, True, True))


@pytest.mark.parametrize("again", ["3*rate(x) = 0", "x**2*rate(x) + rate(x) = 0"])
def test_two_rows_of_one_variable(again):
    """Declared twice: one first integral, and a run that stands still."""
    found = lagcli.loads(model({"x": 1, "y": 0}, [], ["rate(x) = 0", again]))
    assert lagcli.dof(found).configuration_dof == 1
    run = lagcli.simulate(found, duration=0.1, samples=2)
    assert run["x"].tolist() == [1.0, 1.0]


def test_decimals_are_taken_as_they_are_written():
    """0.1 + 0.2 = 0.3 for tenths and not for doubles."""
    forms = ["d(z) - (a + b - c)*y*d(x) = 0", "d(w) - y*d(x) = 0"]
    values = {"x": 0.3, "y": 0.1, "z": 0.2, "w": 0.4}
    found = flag(model(values, [], forms, "a: 0.1, b: 0.2, c: 0.3"))
    assert (found.extra, found.inside) == ((2, 1, 1), (True, False))


def test_one_point_on_a_surface_of_points_has_no_brackets():
    found = flag(model({"x": 0.0, "y": 0.5}, ["x = 0", "y = 0.5"], ["d(x) + d(y) = 0"]))
    assert (found.extra, found.dimension, found.inside) == ((0,), 0, (True,))


def test_poles():
    assert not flag(model({"x": 0.0, "y": 0.5}, [], ["d(x)/x + d(y) = 0"])).is_certain
    found = flag(model({"x": 0.4, "y": 0.5, "z": 0.1}, [], ["y*d(x)/abs(x) - d(z) = 0"]))
    assert (found.extra, found.special) == ((1, 0), False)


def test_a_search_ends_at_its_deadline():
    text = model({"x": 0.3, "y": 0.2, "z": 0.1}, [], ["y*z*d(x) + x*z*d(y) + x*y*d(z) = 0"])
    found = flag(text, deadline=progress.after(0))
    assert (found.is_certain, found.extra) == (False, ())
    assert "time limit" in found.reason


def trailers(n):
    """A car (x, y are the last trailer's) with n trailers, headings a0 (of the car) to a_n, and its wheel."""
    random = np.random.default_rng(1)
    values = {"x": 0.1, "y": 0.2, "wheel": 0.3}
    values |= {f"a{i}": round(float(random.normal()), 3) for i in range(n + 1)}

    def knife(heading, first):
        dx = "d(x)" + "".join(f" - sin(a{j})*d(a{j})" for j in range(n, first, -1))
        dy = "d(y)" + "".join(f" + cos(a{j})*d(a{j})" for j in range(n, first, -1))
        return f"sin({heading})*({dx}) - cos({heading})*({dy}) = 0"

    return model(values, [], [knife(f"a{i}", i) for i in range(n, -1, -1)] + [knife("a0 + wheel", -1)])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_car_with_trailers_reaches_everything_a_step_at_a_time(n):
    found = flag(trailers(n))
    assert found.growth == tuple(range(n + 3))
    assert found.extra == tuple(range(n + 2, -1, -1))
    assert found.is_certain


def test_five_trailers_end_at_the_limit_or_with_the_flag():
    found = flag(trailers(5), deadline=progress.after(1))
    assert not found.is_certain or found.extra == tuple(range(7, -1, -1))


def chain(links, differential, coordinates=""):
    return f"""
lagcli: 1
parameters: {{N: {links}, L: 1/N, a: 0.5}}
particles:
  p[i]: {{for: "i = 1..N", mass: 1, position: "[i*L*sin(a), 0, -i*L*cos(a)]"}}
{coordinates}
holonomic:
  hook: L = norm(p[1])
  link[i]: {{for: "i = 2..N", equation: "L = distance(p[i-1], p[i])"}}
differential:
{differential}
"""


EDGE = "  edge: sin(th)*d(p[1].x) - cos(th)*d(p[1].y) = 0"
HEADING = "coordinates:\n  th: {value: 0.3}\nlagrangian: rate(th)**2/2"


@pytest.mark.parametrize("links", [100, 1000])
def test_a_knife_edge_on_the_first_bead_of_a_chain(links):
    built = system.build(lagcli.loads(chain(links, EDGE, HEADING)))
    with spent.at_most_calls(1_000 * links):
        found = numeric_flag.flag(built, initial.declared(built), range(links + 1))
    assert (found.extra, found.growth, found.is_certain) == ((1, 0), (0, 1), True)
    assert found.dimension == 2 * links


@pytest.mark.parametrize("links", [4, 60, 160])
def test_two_forms_on_a_chain(links):
    """On the sphere of the first bead a form is integrable; that of the second bead is not. Digits and doubles."""
    forms = "\n".join(f"  a{i}: d(p[{i}].y) - p[{i}].z*d(p[{i}].x) = 0" for i in (1, 2))
    found = flag(chain(links, forms))
    assert found.digits == (60 if links < 150 else 16)
    assert (found.extra, found.inside, found.is_certain) == ((2, 1, 1), (True, False), True)
    assert found.special  # the chain starts straight


FUNCTIONS = [
    "sin cos tan asin acos atan sinh cosh tanh asinh atanh exp log sqrt fabs log1p expm1".split(),
    [
        "x**2.5",
        "x**y",
        "atan2(x, y)",
        "hypot(x, y)",
        "fmin(x, y)",
        "if_else(x < y, x*y, x)",
        "acosh(1 + x)",
        "1/x",
    ],
]


@pytest.mark.parametrize("text", [f"{name}(x*y)" for name in FUNCTIONS[0]] + FUNCTIONS[1])
def test_nested_derivatives_in_many_digits(text):
    """d/dy d/dx of each function along directions, against CasADi's."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    names = {name: getattr(ca, name) for name in dir(ca) if not name.startswith("_")}
    value = function_of(text)(x, y, names)
    z = ca.vertcat(x, y)
    plain = ca.Function("plain", [z], [value, ca.gradient(value, z), ca.hessian(value, z)[0]])
    expected, gradient, hessian = (np.array(part) for part in plain([0.4, 0.7]))
    with decimal.localcontext(prec=40):
        point = [Decimal("0.4"), Decimal("0.7")]
        point = multiprecision.moved(point, [Decimal(1), Decimal(2)], 1)
        point = multiprecision.moved(point, [Decimal(3), Decimal(-1)], 2)
        run = multiprecision.run(
            program.written_out(ca.Function("value", [z], [value])), [point], multiprecision.decimal_of
        )
        kept, changed = multiprecision.parts(run, 2)
        (number,), (first,) = multiprecision.parts(kept, 1)
        (other,), (second,) = multiprecision.parts(changed, 1)
    one, two = np.array([1, 2]), np.array([3, -1])
    assert float(number) == pytest.approx(expected.item(), rel=1e-13)
    assert float(first) == pytest.approx((one @ gradient).item(), rel=1e-12, abs=1e-13)
    assert float(other) == pytest.approx((two @ gradient).item(), rel=1e-12, abs=1e-13)
    assert float(second) == pytest.approx(one @ hessian @ two, rel=1e-11, abs=1e-12)


def function_of(text):
    table = {
        "x**2.5": lambda x, y, n: x**2.5,
        "x**y": lambda x, y, n: x**y,
        "atan2(x, y)": lambda x, y, n: ca.atan2(x, y),
        "hypot(x, y)": lambda x, y, n: ca.hypot(x, y),
        "fmin(x, y)": lambda x, y, n: ca.fmin(x * y, y),
        "if_else(x < y, x*y, x)": lambda x, y, n: ca.if_else(x < y, x * y, x),
        "acosh(1 + x)": lambda x, y, n: ca.acosh(1 + x * y),
        "1/x": lambda x, y, n: 1 / (x * y),
    }
    return table.get(text) or (lambda x, y, n: n[text.partition("(")[0]](x * y))


def test_functions_that_are_not_known_in_digits_are_refused():
    x = ca.SX.sym("x")
    with pytest.raises(multiprecision.Unknown):
        multiprecision.require_known(program.written_out(ca.Function("f", [x], [ca.erfinv(x)])))


FOUR = {"x": 0.3, "y": 0.1, "z": 0.2, "u": 0.4}


@pytest.mark.parametrize(
    ("values", "form"),
    [
        ({"x": 0.3, "y": 0.3 + 1e-8, "z": 0.2, "w": 0.1}, "d(z) - ((x**2 - y**2)/(x - y) - x - y)*d(w) = 0"),
        ({"x": 1.0, "y": 0.3, "z": 0.2}, "d(z) - (cosh(20*x)**2 - sinh(20*x)**2)*d(y) = 0"),
        ({"x": 1.1, "y": 0.3, "z": 0.2}, "d(z) - (exp(x + 20)*exp(y) - exp(x + y + 20))*d(x) = 0"),
    ],
)
def test_what_rounding_leaves_of_large_terms_is_no_bracket(values, form):
    found = flag(model(values, [], [form]))
    assert (found.extra, found.inside, found.is_certain) == ((1, 1), (True,), True)


@pytest.mark.parametrize(
    ("coefficient", "parameters"),
    [
        ("sin(pi)", ""),
        ("0.1 + 0.2 - 0.3", ""),
        ("sqrt(2)**2 - 2", ""),
        ("x/3 + 2/3*x - x", ""),
        ("a + b - c", "a: 0.1, b: 0.2, c: a + b"),
    ],
)
def test_what_rounding_leaves_of_numbers_is_not_certain(coefficient, parameters):
    found = flag(model(FOUR, [], [f"d(z) - ({coefficient})*y*d(x) = 0"], parameters))
    assert found.extra in ((), (1, 1))


CANCELLED = [
    ("sqrt((1 - cos(x))/2) - sin(x/2)", 1.0),
    ("sqrt((1 - cos(x))/2) - sin(x/2)", 4.0),
    ("asin(sin(x)) - x", 1.0),
    ("asin(sin(x)) + x", 2.5),
    ("asin(sin(x)) + x", -2.0),
    ("sqrt(1 - sin(x)**2) - cos(x)", 6.0),
    ("cosh(x) - sqrt(1 + sinh(x)**2)", -3.0),
]


@pytest.mark.parametrize("is_rough", [False, True], ids=["digits", "doubles"])
@pytest.mark.parametrize(("constant", "x"), CANCELLED)
def test_what_cancels_within_an_entry_is_rounding(constant, x, is_rough, monkeypatch):
    """Around the start these functions are constants, whose derivatives doubles may meet exactly or not."""
    if is_rough:
        monkeypatch.setattr(lie_brackets, "pivots", refuse)
    values = {"x": x, "y": 0.3, "z": 0.2, "w": 0.1}
    for entry in (constant, f"exp({constant})"):
        form = f"d(z) - ({entry})*d(w) = 0"
        found = flag(model(values, [], [form]))
        assert found.extra in (((1, 1),) if not is_rough else ((1, 1), ()))
        found = flag(model(values, [], [form, "d(w) - y*d(x) = 0"]))
        assert found.extra in (((2, 1, 1),) if not is_rough else ((2, 1, 1), ()))


@pytest.mark.parametrize("name", sorted({*functions.OPERATIONS, *multiprecision.BINARY}))
def test_the_size_of_terms_bounds_what_other_numbers_change(name):
    """For each function that values in many digits know; constpow and pow stand for each other."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    two, code = name in multiprecision.BINARY, getattr(ca, f"OP_{name.upper()}")
    value = ca.SX.binary(code, a, b) if two else ca.SX.unary(code, a)
    written = program.written_out(ca.Function("f", [a, b], [value]))
    one, other = (1.35, 0.4) if name == "acosh" else (0.35, 0.4)
    (size,) = term_sizes.of(written, [np.array([one]), np.array([other])])
    here, there = (
        multiprecision.run(written, [[Decimal(x) * h], [Decimal(y) / h]], Decimal)[0]
        for h, x, y in ((Decimal(1), one, other), (Decimal("1.000001"), one, other))
    )
    assert size < 20
    assert float(abs(there - here)) <= 1.1e-6 * size


@pytest.mark.parametrize(
    ("constant", "x"), [*CANCELLED[:3], ("acos(cos(x)) - x", 1.0), ("asin(sin(x)) - x", -1.2)]
)
def test_a_row_of_entries_that_cancel_says_nothing(constant, x):
    values = {"x": x, "y": 0.3, "z": 0.2, "w": 0.1}
    found = flag(model(values, [], [f"({constant})*d(w) + ({constant})*d(z) = 0"]))
    assert (found.extra, found.inside, found.is_certain) == ((0,), (True,), True)


@pytest.mark.parametrize("size", [0.3, 0.7e-9])
@pytest.mark.parametrize("power", [4, 60])
def test_small_values_of_one_row_beside_large_ones_of_another_count(size, power):
    forms = ["d(u) - y*d(x) = 0", f"d(z) - y**{power}*d(x) = 0"]
    found = flag(model(FOUR | {"y": size}, [], forms))
    assert (found.extra, found.growth, found.inside) == ((2, 1, 0), (0, 1, 2), (False, False))


@pytest.mark.parametrize(
    ("surface", "forms"),
    [
        ([], ["d(z) - y*d(x) = 0", "d(z) - (1 + 1e-11)*y*d(x) = 0"]),
        ([], ["d(x) = 5*dt", "d(x) = (5 + 1e-9)*dt"]),
        (["x = 3*y", "x = (3 + 1e-9)*y - 1e-10"], ["d(z) - u*d(x) = 0"]),
    ],
)
def test_rows_that_only_nearly_depend_on_each_other_leave_doubt(surface, forms):
    found = flag(model(FOUR, surface, forms))
    assert not found.is_certain
    assert "nearly" in found.reason


@pytest.mark.parametrize("part", ["1e-5", "1e-7", "1e-8", "1e-9"])
def test_rows_that_are_apart_by_more_than_rounding_are_independent(part):
    found = flag(model(FOUR, [], ["d(z) - y*d(x) = 0", f"d(z) - (1 + {part})*y*d(x) = 0"]))
    assert (found.extra, found.inside, found.is_certain) == ((2, 2), (True, True), True)


def test_a_dependent_row_beside_nearly_parallel_ones():
    forms = ["d(u) = 0", "d(u) + 1e-5*(d(z) - y*d(x)) = 0", "2*d(u) = 0"]
    found = flag(model(FOUR, [], forms))
    assert (found.extra, found.inside) == ((2, 1, 1), (True, False, True))


@pytest.mark.parametrize("coefficient", ["max(y, 0)", "y + abs(y)", "min(-y, 0)"])
def test_what_holds_on_one_side_of_a_kink_is_not_said_of_the_other(coefficient):
    found = flag(model(FOUR | {"y": -1.0}, [], [f"d(z) - ({coefficient})*d(x) = 0"]))
    assert (found.extra, found.on_piece) == ((1, 1), True)
    found = flag(model(FOUR | {"y": 1.0}, [], [f"d(z) - ({coefficient})*d(x) = 0"]))
    assert (found.extra, found.is_certain) == ((1, 0), True)


def test_branches_that_meet_at_the_start_leave_doubt():
    values = {"x": 0.0, "y": 0.0, "z": 0.2, "u": 0.4, "w": 0.3}
    found = flag(model(values, ["x*y = 0"], ["d(z) - x*u*d(w) = 0"]))
    assert not found.is_certain
    assert "singular" in found.reason


@pytest.mark.parametrize(
    ("constant", "x", "is_constant"),
    [
        ("acos(cos(x)) - x", 0.02, True),
        ("acos(cos(x)) + x", -0.02, True),
        ("asin(sin(x)) - x", 1.55, True),
        ("asin(sin(x)) - x", 45, True),
        ("asin(sin(x)) - x", 40, False),
        ("atan(x) + atan(1/x)", 0.05, True),
        ("atan2(sin(x), cos(x)) - x", 3.1, True),
        ("sqrt((x - 1)**6) - (x - 1)**3", 1.1, True),
        ("sqrt((x - 1)**6) - (x - 1)**3", 0.9, False),
        ("max(x, 0)", -0.05, True),
        ("max(x, 0)", 0.001, False),
    ],
)
def test_places_that_are_met_lie_on_the_branch_of_the_start(constant, x, is_constant):
    """Functions that are constant on this branch alone; a flow that touches its end comes back on another."""
    values = {"x": x, "y": 0.3, "z": 0.2, "w": 0.1}
    for entry in (constant, f"exp({constant})"):
        found = flag(model(values, [], [f"d(z) - ({entry})*d(w) = 0"]))
        assert found.extra == ((1, 1) if is_constant else (1, 0))


@pytest.mark.parametrize(
    ("path", "leaves"),
    [
        ("abs(x)", True),
        ("max(x, 0.55)", True),
        ("max(x, 2)", False),
        ("sqrt(1 - cos(x))", True),
        ("sqrt(1.1 - cos(x))", False),
        ("asin(cos(x))", True),
        ("asin(0.9*cos(x))", False),
        ("atan2(x, -1)", True),
        ("atan2(x, 1)", False),
        ("abs(x)**3", True),
        ("(x**2)**1.5", True),
        ("exp(-1/x**2)", True),
        ("tan(x + pi/2)", True),
        ("(1 + x)**3/(2 - x)", False),
    ],
)
def test_the_end_of_a_branch_is_seen_where_it_is_crossed_or_touched(path, leaves):
    """On the way from x = 0.61 to -0.57, which does not come to zero itself."""
    built = system.build(lagcli.loads(model({"x": 0.61, "y": 0.0}, [], [f"d(y) - ({path})*d(x) = 0"])))
    block = row_block.RowBlock(built, [0])
    way = np.linspace([0.61, 0.0][: block.size], [-0.57, 0.0][: block.size], 24)
    assert block.pieces.end_between(way, initial.declared(built).p) is leaves


@pytest.mark.parametrize(
    ("switch", "x", "y", "extra"),
    [
        ("max(abs(x), abs(y)) - x", 1.0, 0.0, (1, 1)),
        ("max(abs(x), abs(y)) + x", -1.0, 0.0, (1, 1)),
        ("min(abs(x), abs(y)) + y", 1.0, -0.3, (1, 1)),
        ("min(max(x, abs(y)), 2) - x", 1.0, 0.0, (1, 1)),
        ("sqrt(max(x**2, y**2)) - x", 1.0, 0.3, (1, 1)),
        ("sign(x - abs(y))*y - y", 1.0, 0.0, (1, 1)),
        ("max(abs(x), abs(y)) - x", -1.0, 0.0, (1, 0)),
        ("max(abs(x), abs(y)) - x", 0.3, 1.0, (1, 0)),
        ("max(abs(x), abs(y)) - x", 1.0, 1.0, ()),
        ("max(x, 1 + abs(y)) - x", 1.5, 0.0, (1, 1)),
        ("min(abs(x), 1 + abs(y)) - x", 1.0, 0.0, ()),
        ("abs(y)", 1.0, 0.0, (1, 0)),
    ],
)
def test_a_switch_in_a_branch_that_is_not_taken_is_none(switch, x, y, extra):
    values = {"x": x, "y": y, "z": 0.2, "w": 0.1}
    found = flag(model(values, [], [f"d(z) - ({switch})*d(w) = 0"]))
    assert found.extra == extra
    assert found.on_piece == (extra == (1, 1))
