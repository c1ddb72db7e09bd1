"""First integrals of completely integrable Pfaffian systems: found, verified, and honestly missing."""

import mpmath
import pytest
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from sympy import Abs, Matrix, atan2, cos, exp, log, sin, sqrt

from lagcli import progress
from lagcli.pfaffian import elimination, first_integrals, frobenius, joint, potential
from lagcli.pfaffian.exact import enclosure, time_limit
from lagcli.pfaffian.forms import form
from tests.helpers import spent

# An interrupt of late work may land in a callback of the garbage collector set by hypothesis; it is repeated.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

SECONDS = 10.0
PROMPT = 60_000  # operations for one system

x, y, z, w, u, v, th, t = sympy.symbols("x y z w u v th t", real=True)
p1, p2, x1, y1, x2, y2 = sympy.symbols("p1 p2 x1 y1 x2 y2", real=True)
a, b, L = sympy.symbols("a b L", real=True)


def system(variables, rows, parameters=(), surface=()):
    rows = rows.tolist() if isinstance(rows, sympy.MatrixBase) else rows
    entries = tuple(tuple(sympy.sympify(c) for c in row) for row in rows)
    names = tuple(f"row{n}" for n in range(len(entries)))
    return form.PfaffianBlock(names, tuple(variables), entries, tuple(parameters), tuple(surface))


def jacobian(functions, variables):
    return Matrix([[form.partial(sympy.sympify(f), s) for s in variables] for f in functions])


def rank_is(matrix, rank, surface=()):
    """Whether the matrix has the rank at points of the surface, with 50 digits."""
    symbols = sorted(matrix.free_symbols | set().union(*(f.free_symbols for f in surface)), key=str)
    if surface:
        there = enclosure.points_on(surface, symbols)
    else:
        there = [{s: sympy.Rational(3 * n + 5 + k, 17) for n, s in enumerate(symbols)} for k in (0, 2)]
    for point in there:
        exact = {s: sympy.Rational(value.numerator, value.denominator) for s, value in point.items()}
        numbers = matrix.subs(exact).evalf(50)
        with mpmath.workdps(50):
            singular = mpmath.svd_r(mpmath.matrix(numbers.tolist()), compute_uv=False)
            if sum(1 for e in singular if abs(e) > mpmath.mpf(10) ** -25 * max(singular)) != rank:
                return False
    return bool(there)


def searched(system_, budget=None):
    begun = time_limit.operations()
    found = first_integrals.search(system_, progress.after(SECONDS), budget=budget)
    return [f.integral for f in found], found, time_limit.operations() - begun


def same_surfaces(found, expected, system_):
    """Whether the found integrals are as many functions of the expected ones, and lie in the span of the rows."""
    size, whole = len(expected), system_.surface
    on = len(whole)
    gradients = jacobian([*whole, *expected, *found], system_.variables)
    rows = Matrix.vstack(jacobian([*whole, *found], system_.variables), Matrix(system_.rows))
    return len(found) == size and rank_is(gradients, size + on, whole) and rank_is(rows, size + on, whole)


ROTATION = Matrix([[cos(w), -sin(w)], [sin(w), cos(w)]])

KNOWN = {
    "one row given": (system((x, y, z), [(0, 1, 0)]), [y]),
    "contact row with dy": (system((x, y, z), [(-y, 0, 1), (0, 1, 0)]), [y, z - x * y]),
    "difference of contact rows": (system((x, y, z, w), [(0, 0, 1, -1)]), [z - w]),
    "two-wheel axle": (system((x, y, th, p1, p2), [(0, 0, b, a, -a)], (a, b)), [b * th - a * (p2 - p1)]),
    "axle of the reference": (
        system((x, y, th, p1, p2), [(0, 0, 2, -1, 1)]),
        [2 * th - p1 + p2],
    ),
    "two rates of a body are zero": (
        system((x, y, w), [(cos(y), 0, 1), (sin(y) * sin(w), cos(w), 0)]),
        [sin(y) * cos(w), cos(x) * sin(w) + sin(x) * cos(y) * cos(w)],
    ),
    "hidden by z = x**2": (system((x, z, w), [(-z, 0, 1)], (), (z - x**2,)), [w - x**3 / 3]),
    "linear equations": (system((x, y, t), [(1, 0, -y), (0, 1, -x)]), [(x + y) * exp(-t), (x - y) * exp(t)]),
    "linear equations and a third": (
        system((x, y, z, t), [(1, 0, 0, -y), (0, 1, 0, -x), (0, 0, 1, 0)]),
        [(x + y) * exp(-t), (x - y) * exp(t), z],
    ),
    "oscillator": (
        system((x, y, t), [(1, 0, -y), (0, 1, a**2 * x)], (a,)),
        [a**2 * x**2 + y**2, a * t + atan2(y, a * x)],
    ),
    "damped": (
        system((x, y, t), [(1, 0, -y), (0, 1, 2 * x + 3 * y)]),
        [(x + y) * exp(2 * t), (2 * x + y) * exp(t)],
    ),
    "rays": (system((x, y, z), [(y, -x, 0), (z, 0, -x)]), [y / x, z / x]),
    "sphere and plane": (system((x, y, z), [(x, y, z), (y, -x, 0)]), [x**2 + y**2 + z**2, y / x]),
    "one after the other": (
        system((x, y, z), [(1, 0, -x), (0, 1, -x * z)]),
        [x * exp(-z), y - x * (z - 1)],
    ),
    "everything fixed": (system((x, y), [(1, y), (x, 1 + x * y + y)]), [x, y]),
    "kink": (system((x, y, z), [(Abs(x), 1, 0), (0, 0, 1)]), [z, 2 * y + x * Abs(x)]),
    "circle": (system((x, y, w), [(-y, x, 1)], (L,), (x**2 + y**2 - L**2,)), [L**2 * atan2(y, x) + w]),
    "ellipse": (
        system((x, y, w), [(-y, x, 1)], (a, b), ((x / a) ** 2 + (y / b) ** 2 - 1,)),
        [a * b * atan2(a * y, b * x) + w],
    ),
    "other surface": (
        system((x, y, z, w), [(y * z, x * z, x * y, 1)], (), (x * y - z * w,)),
        [w + x * y * z],
    ),
    "time and parameter": (system((x, y, t), [(1, 0, -a), (0, t, y)], (a,)), [x - a * t, t * y]),
    "a coordinate eliminated": (
        system((x, y, w), [(1, 0, -cos(w)), (0, 1, -x * y**2)]),
        [x - sin(w), w * (x - sin(w)) - cos(w) + 1 / y],
    ),
    "two rods": (
        system(
            (x1, y1, x2, y2, w),
            [(y1 - y2, x2 - x1, y2 - y1, x1 - x2, 1)],
            (L,),
            (x1**2 + y1**2 - L**2, (x2 - x1) ** 2 + (y2 - y1) ** 2 - L**2),
        ),
        [L**2 * atan2(y2 - y1, x2 - x1) - w],
    ),
    "sphere as surface": (
        system(
            (x, y, z, w),
            [(x**2 + y**2 + z**2 - L**2 + y * z, x * z, x * y, 1)],
            (L,),
            (x**2 + y**2 + z**2 - L**2,),
        ),
        [w + x * y * z],
    ),
}

HIDDEN = {
    "rational": ((x, y, z), [[1, y], [0, exp(x)]], [(x - z) / (1 + x * y), y * z], ()),
    "exponentials": ((x, y, z, w), [[1, y], [z, exp(x)]], [x * exp(y) + w, z * sin(y) + x * w], ()),
    "denominators": ((x, y, z, w), [[1, y], [z, exp(x)]], [x / (y**2 + 1) + w, x**2 + y * z], ()),
    "rotated": ((x, y, w), ROTATION, [x * cos(w) + y * sin(w), w - a * y], (a,)),
    "four of eight": (
        (x, y, z, w, u, v, th, t),
        [[1, y, 0, x], [0, exp(x), 1, 0], [z, 0, 1, 1], [0, t, 0, 1]],
        [x * y + u * t, z * exp(th) + v, w * x - sin(u), v * th + t],
        (),
    ),
    "with parameters": (
        (x, y, z, w, t),
        [[1, y, 0], [0, exp(x), t], [0, 0, 1]],
        [(x - z) / (1 + x * y), w * z + x**2 * y, z - a * x * y],
        (a,),
    ),
}


def hidden(name):
    variables, mixing, functions, parameters = HIDDEN[name]
    return system(variables, Matrix(mixing) * jacobian(functions, variables), parameters), functions


@pytest.mark.parametrize("name", KNOWN)
def test_integrals_of_known_systems_are_found(name):
    system_, expected = KNOWN[name]
    found, whole, work = searched(system_)
    assert same_surfaces(found, expected, system_), found
    assert all(f.how for f in whole)
    assert work < PROMPT


@pytest.mark.parametrize("name", HIDDEN)
def test_integrals_hidden_by_a_matrix_of_functions_are_found(name):
    system_, expected = hidden(name)
    found, _, work = searched(system_)
    assert same_surfaces(found, expected, system_), found
    assert work < PROMPT


WRITTEN = {
    "contact row with dy": {"y", "x*y - z"},
    "two-wheel axle": {"a*p1 - a*p2 + b*th"},
    "hidden by z = x**2": {"3*w - x**3"},
    "linear equations": {"x**2 - y**2", "(x - y)*exp(t)"},
    "rays": {"z/x", "z/y"},
    "sphere and plane": {"x**2 + y**2 + z**2", "y/x"},
    "time and parameter": {"a*t - x", "t*y"},
    "oscillator": {"a**2*x**2 + y**2", "a*t + atan2(y, a*x)"},
}


@pytest.mark.parametrize("name", WRITTEN)
def test_integrals_are_written_as_a_person_would(name):
    assert {str(e) for e in searched(KNOWN[name][0])[0]} == WRITTEN[name]


NICE = (
    x * y, y + z**2, x * exp(z), z * sin(w), w - x**3 / 3, y / x, (x - z) / (1 + x * y), x**2 + y**2,
    w - y * cos(t), z + t**2 / 2, x * y * z, w + sin(x) * cos(y), w * exp(-t) + x, x * cos(w) + y * sin(w),
    z + log(x), sqrt(x**2 + y**2) + w, x**2 * y**3, w / (1 + t**2), y + x * z + t * w, a * x + b * y,
    z - a * x * y, atan2(y, x) - w,
)  # fmt: skip
MIXED = {
    1: [[[exp(x)]], [[1 + y**2]]],
    2: [[[1, y], [0, exp(x)]], [[1, x], [z, 2]], ROTATION.tolist()],
    3: [[[1, y, 0], [0, exp(x), t], [0, 0, 1]], [[1, 0, 0], [w, 1, 0], [1, 1, 1]]],
}
SOMEWHERE = {x: 0.3, y: 0.7, z: 1.1, w: 0.9, t: 0.4, a: 1.3, b: 0.2}


@settings(max_examples=12, derandomize=True, deadline=None)
@given(st.data())
def test_surfaces_hidden_by_a_matrix_of_functions_are_recovered(data):
    functions = data.draw(st.lists(st.sampled_from(NICE), min_size=1, max_size=3, unique=True))
    mixing = Matrix(data.draw(st.sampled_from(MIXED[len(functions)])))
    variables = data.draw(st.permutations((x, y, z, w)))
    gradients = jacobian(functions, (*variables, t))
    assume(gradients.subs(SOMEWHERE).rank() == len(functions))
    system_ = system((*variables, t), mixing * gradients, (a, b))
    found, _, _ = searched(system_)
    assert len(found) == len(functions)
    # Functions of the known ones: together they have no greater rank.
    assert rank_is(jacobian([*functions, *found], system_.variables), len(functions))


def test_no_closed_form_is_no_integral_in_time():
    rough = system((x, y, z), [(-(x**2) - y**3 - 1 - sin(x * y), 1, 0), (-exp(x * y) - z**2 * x, 0, 1)])
    assert searched(rough, 40_000)[0] == []


def test_what_is_found_before_the_end_is_kept():
    half = system((x, y, z), [(1, 0, -x * z), (0, 1, -x - y)])
    found, _, _ = searched(half, 40_000)
    assert [str(e) for e in found] == ["x*exp(-z**2/2)"]


def test_a_deadline_in_the_past_gives_nothing_at_once():
    with spent.at_most(0):
        assert first_integrals.search(KNOWN["rays"][0], progress.after(-1.0)) == ()


def test_a_constant_on_one_side_of_a_kink_is_no_integral():
    # y + |y| is constant where y < 0: only half an integral of dx.
    found, _, _ = searched(system((x, y), [(0, 1 + Abs(y) / y)]))
    assert found in ([], [y])
    found, _, _ = searched(system((x, y, z), [(0, Abs(y) + y, 0), (0, 0, 1)]))
    assert all(rank_is(jacobian([e], (x, y, z)).subs(y, -2), 1) for e in found)


def test_a_combination_of_the_rows_is_integrated_by_itself():
    flows = system(
        (x, y, z, u),
        [(1, 0, -a * y * cos(z), u * (x - 2 * a * y)), (0, 1, x * cos(z), u * (2 * x + y))],
        (a,),
    )
    found = searched(flows, joint.SEARCH)[0]
    gradients = jacobian([(x**2 + a * y**2) * exp(u**2), *found], flows.variables)
    assert len(found) == 1
    assert rank_is(gradients, 1)


def test_dependent_rows_count_once():
    system_ = system((x, y, z), [(y, -x, 0), (2 * y, -2 * x, 0), (0, 0, 1)])
    assert len(searched(system_)[0]) == 2


def test_rows_that_vanish_on_the_surface_prove_nothing():
    surface = x**3 + y**3 - 1
    assert searched(system((x, y, z), [(0, 0, surface)], (), (surface,)))[0] == []


def test_a_system_that_is_not_integrable_has_no_integral():
    assert searched(system((x, y, z), [(-y, 0, 1)]))[0] == []


def test_symbols_of_the_caller_come_back():
    plain = sympy.symbols("x y z")
    found, _, _ = searched(system(plain, [(0, plain[2], plain[1])]))
    assert found == [plain[1] * plain[2]]


def test_elimination_solves_for_linear_coordinates_but_never_for_time():
    given_ = system(
        (x1, x2, y, t), [(x2, y, x1, 0)], (L,), (x2 - x1 - L, y**2 + x1**2 - L**2, x1 - t, L * y - t * x2)
    )
    left, values = elimination.eliminated(given_)
    assert left.variables == (t,)
    assert values == {x1: t, x2: L + t, y: t + t**2 / L}
    assert len(left.surface) == 1
    assert sympy.expand(left.rows[0][0] - (x2 + y + x1 * sympy.diff(values[y], t)).subs(values)) == 0


def test_elimination_keeps_what_is_not_linear():
    given_ = system((x, y), [(y, -x)], (L,), (x**2 + y**2 - L**2,))
    assert elimination.eliminated(given_) == (given_, {})


def test_elimination_drops_what_follows_from_the_rest():
    left, _ = elimination.eliminated(system((x, y, z), [(y, -x, 0)], (), (z - x, 2 * z - 2 * x)))
    assert left.surface == ()
    assert left.variables == (x, y)


@pytest.mark.parametrize(
    ("function", "variable"),
    [
        (sqrt(1 - y**2) / y, y),
        (sqrt(1 + y**2), y),
        (sqrt(y**2 + 4) / y**2, y),
        (1 / (y * sqrt(y**2 - 1)), y),
        (sqrt(1 - y) / y, y),
        (sqrt((1 - y) / (1 + y)), y),
        (cos(L) / (cos(x) ** 2 + cos(L) ** 2 * sin(x) ** 2), x),
        (cos(L) / (sin(x) ** 2 * sin(L) ** 2 - 1), x),
        (1 / (1 + 2 * sin(x) ** 2), x),
    ],
)
def test_roots_and_squares_of_sines_are_made_rational(function, variable):
    found = time_limit.run(
        progress.after(SECONDS), lambda: potential.antiderivative(sympy.sympify(function), variable)
    )
    assert found is not None
    assert potential.writable(found)
    places = [{x: 0.4, y: v, L: 0.5} for v in (0.3, 0.6)] if "y**2 - 1" not in str(function) else [{y: 1.7}]
    for place in places:
        slope = sympy.diff(found, variable) - function
        assert abs(complex(slope.subs(place).evalf(20))) < 1e-12


def test_separable_forms_with_roots_and_sines_have_integrals():
    for rows, parameters, expected in (
        ([[y, sqrt(1 - y**2)]], (), x + sqrt(1 - y**2) + log((1 - sqrt(1 - y**2)) / y)),
        ([[cos(y) ** 2 + cos(L) ** 2 * sin(y) ** 2, -cos(L)]], (L,), x - sympy.atan(cos(L) * sympy.tan(y))),
    ):
        found = frobenius.classify(
            form.Form("row", (x, y), tuple(rows[0]), parameters), progress.after(SECONDS)
        )
        assert found.kind == "integrable"
        assert found.integral is not None
        matrix = Matrix([[sympy.diff(f, s) for s in (x, y)] for f in (found.integral, expected)])
        place = {x: 0.3, y: 0.6, L: 0.5}
        assert abs(complex(matrix.subs(place).evalf(25).det())) < 1e-15
