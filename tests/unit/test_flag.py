"""Derived flags of Pfaffian systems, exactly: published systems, surfaces, and what must not change them."""

import json
import pathlib

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli import progress
from lagcli.pfaffian import derived_flag, function_field
from lagcli.pfaffian.forms.form import PfaffianBlock
from tests.helpers import spent

REFERENCE = pathlib.Path(__file__).parents[1] / "reference" / "pfaffian.json"
SYSTEMS = {s["name"]: s for s in json.loads(REFERENCE.read_text(encoding="utf-8"))["systems"]}
SECONDS = 20.0
PROMPT = 80_000  # operations
PARAMETERS = sympy.symbols("R L a b", real=True)


def block(coordinates, forms, surface=()):
    letters = {name: sympy.Symbol(name, real=True) for name in coordinates.split()}
    known = letters | {p.name: p for p in PARAMETERS if p.name not in letters}

    def read(text):
        return sympy.sympify(text, locals=known)

    rows = tuple(tuple(read(text) for text in form) for form in forms)
    names = tuple(f"n{i + 1}" for i in range(len(rows)))
    parameters = tuple(p for p in PARAMETERS if p.name not in letters)
    return PfaffianBlock(names, tuple(letters.values()), rows, parameters, tuple(read(f) for f in surface))


def reference(name):
    system = SYSTEMS[name]
    return block(" ".join(system["coords"]), system["forms"])


def found(system):
    return derived_flag.flag(system, progress.after(SECONDS), sympy.Symbol("t", real=True))


def shown(dims):
    """The flag as it is published: its end, unless it is 0, is repeated."""
    return [*dims, dims[-1]] if dims[-1] else list(dims)


@pytest.mark.parametrize("name", SYSTEMS)
def test_published_flags_and_growth_vectors(name):
    system = SYSTEMS[name]
    with spent.at_most(PROMPT):
        result = found(reference(name))
    assert shown(result.dims) == system["derived_flag"]
    freedoms = len(system["coords"]) - system["rank"]
    assert [freedoms + more for more in result.growth] == system["growth"]
    assert len(result.integrable) == system["holonomic_count"]
    assert result.is_exact


def trailers(count):
    """A unicycle that pulls trailers, each hitched to the axle before it (Jean 1996)."""
    angles = [f"t{i}" for i in range(count + 1)]
    rows = []
    for k in range(count + 1):
        hitches = [f"cos(t{j} - t{k})" if 1 <= j <= k else "0" for j in range(count + 1)]
        rows.append([f"sin(t{k})", f"-cos(t{k})", *hitches])
    return block("x y " + " ".join(angles), rows)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_trailers_lose_one_form_at_a_time(count):
    with spent.at_most(PROMPT):
        result = found(trailers(count))
    assert result.dims == tuple(range(count + 1, -1, -1))
    assert result.growth == tuple(range(count + 2))


CARTAN = [["-y", "0", "1", "0", "0"], ["-z", "0", "0", "1", "0"], ["0", "-z", "0", "0", "1"]]
PAIR = [["-y", "0", "1", "0", "0", "0"], ["0", "0", "0", "-v", "0", "1"]]
FREE = [  # of the free nilpotent algebra of two fields, to brackets of four
    ["-y", "0", "1", "0", "0", "0", "0", "0"],
    ["-z", "0", "0", "1", "0", "0", "0", "0"],
    ["0", "-z", "0", "0", "1", "0", "0", "0"],
    ["-u", "0", "0", "0", "0", "1", "0", "0"],
    ["-v", "0", "0", "0", "0", "0", "1", "0"],
    ["0", "-v", "0", "0", "0", "0", "0", "1"],
]
FLAT = {
    "(2, 3, 5), Cartan": ("x y z u v", CARTAN, (3, 2, 0), (0, 1, 3)),
    "(2, 3, 5, 8)": ("x y z u v p q r", FREE, (6, 5, 3, 0), (0, 1, 3, 6)),
    "two contact forms": ("x y z u v w", PAIR, (2, 0), (0, 2)),
    "one integral of two rows": ("x y z w", [["-y", "0", "1", "0"], ["-y", "0", "0", "1"]], (2, 1), (0, 1)),
    "two rows say the same": ("x y", [["1", "y"], ["exp(x)", "y*exp(x)"]], (1,), (0,)),
    "a row that says nothing": ("x y", [["sin(x)**2 + cos(x)**2 - 1", "0"], ["1", "0"]], (1,), (0,)),
    "only a row that says nothing": ("x y", [["sin(2*x) - 2*sin(x)*cos(x)", "0"]], (0,), (0,)),
}


@pytest.mark.parametrize("name", FLAT)
def test_known_flags(name):
    coordinates, forms, dims, growth = FLAT[name]
    result = found(block(coordinates, forms))
    assert (result.dims, result.growth) == (dims, growth)


SURFACES = {
    "z = x**2": ("w x z", [["1", "-z", "0"]], ["z - x**2"], (1,), True),
    "z = x**2 + y**2": ("w x y z", [["1", "-z", "0", "0"]], ["z - x**2 - y**2"], (1, 0), False),
    "a circle": ("w x z", [["1", "-z", "0"]], ["x**2 + z**2 - L**2"], (1,), True),
    "a sphere": ("w x y z", [["1", "-z", "0", "0"]], ["x**2 + y**2 + z**2 - L**2"], (1, 0), False),
    "the row is df there": (
        "x y z",
        [["x + z*(x**2 + y**2 - L**2)", "y", "0"]],
        ["x**2 + y**2 - L**2"],
        (0,),
        True,
    ),
    "a skate on a plane": ("x y z p", [["sin(p)", "-cos(p)", "0", "0"]], ["z - a*x - b*y"], (1, 0), False),
}


@pytest.mark.parametrize("name", SURFACES)
def test_flags_beyond_a_surface(name):
    coordinates, forms, surface, dims, inside = SURFACES[name]
    result = found(block(coordinates, forms, surface))
    assert result.dims == dims
    assert result.inside == (inside,)


def test_a_multiple_of_dt_is_a_contradiction():
    three = [["1", "0", "-1"], ["0", "1", "-x"], ["1", "y", "-x*y"]]
    assert found(block("x y t", three)).contradiction == (0, 1, 2)
    assert found(block("x y t", [["1", "0", "-1"], ["0", "1", "0"], ["2", "0", "-1"]])).contradiction == (
        0,
        2,
    )
    assert found(block("x y t", [["1", "0", "-1"], ["0", "1", "-x"]])).contradiction == ()


def test_where_the_flag_drops_is_named():
    x, y, th = (sympy.Symbol(name, real=True) for name in ("x", "y", "th"))
    assert found(block("x y z", [["-y**2", "0", "1"]])).special == (y,)
    assert found(block("x y z", [["-y*exp(x)", "0", "1"]])).special == ()
    assert found(block("x y z", [["-y**3 - y*x**2", "0", "1"]])).special == (x**2 + 3 * y**2,)
    assert found(reference("pfaff_ball_plane_spin")).special == (sympy.sin(th),)
    assert x not in found(block("x y z", [["0", "0", "x"]])).special


def test_what_cannot_be_proved_is_not_decided():
    with pytest.raises(function_field.NotDecidedError):
        found(block("x y z", [["-y*(asin(x) + acos(x) - asin(y) - acos(y))", "0", "1"]]))
    with pytest.raises(function_field.NotDecidedError):
        derived_flag.flag(trailers(3), progress.after(0.0))


# What must not change.

MULTIPLIERS = st.sampled_from(["1", "-2", "exp(x)", "2 + sin(y)", "1 + x**2", "exp(x*y)/3"])
NAMES = st.sampled_from([name for name, s in SYSTEMS.items() if {"x", "y"} <= set(s["coords"])])


@settings(max_examples=30, deadline=None, derandomize=True)
@given(NAMES, st.data())
def test_the_order_of_rows_and_coordinates_changes_nothing(name, data):
    system = reference(name)
    order = data.draw(st.permutations(range(len(system.variables))))
    rows = data.draw(st.permutations(range(len(system.rows))))
    moved = PfaffianBlock(
        tuple(system.names[i] for i in rows),
        tuple(system.variables[k] for k in order),
        tuple(tuple(system.rows[i][k] for k in order) for i in rows),
    )
    one, other = found(system), found(moved)
    assert (one.dims, one.growth) == (other.dims, other.growth)
    assert other.inside == tuple(one.inside[i] for i in rows)
    assert spanned(one.integrable, system.variables) == spanned(other.integrable, moved.variables)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(NAMES, st.data())
def test_invertible_combinations_of_rows_change_nothing(name, data):
    system = reference(name)
    letters = {x.name: x for x in system.variables}
    rows = [list(row) for row in system.rows]
    for i in range(len(rows)):
        factor = sympy.sympify(data.draw(MULTIPLIERS), locals=letters)
        rows[i] = [factor * a for a in rows[i]]
        for j in range(len(rows)):
            if j != i:
                more = sympy.sympify(data.draw(st.sampled_from(["0", "1", "x", "sin(y)"])), locals=letters)
                rows[i] = [a + more * b for a, b in zip(rows[i], rows[j], strict=True)]
    mixed = PfaffianBlock(system.names, system.variables, tuple(map(tuple, rows)))
    one, other = found(system), found(mixed)
    assert (one.dims, one.growth) == (other.dims, other.growth)
    assert spanned(one.integrable, system.variables) == spanned(other.integrable, system.variables)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(NAMES, st.sampled_from(["x + y**2", "x*2 - y", "x + sin(y)", "x + exp(y)"]))
def test_a_change_of_coordinates_changes_nothing(name, value):
    system = reference(name)
    letters = {s.name: s for s in system.variables}
    x, new = letters["x"], sympy.sympify(value, locals=letters)
    k = system.variables.index(x)
    rows = []
    for row in system.rows:
        moved = [a.xreplace({x: new}) for a in row]
        slope = moved[k]
        rows.append(tuple(
            (slope if j == k else moved[j] + 0) * sympy.diff(new, x) if j == k
            else moved[j] + slope * sympy.diff(new, v)
            for j, v in enumerate(system.variables)
        ))  # fmt: skip
    one, other = found(system), found(PfaffianBlock(system.names, system.variables, tuple(rows)))
    assert (one.dims, one.growth, one.inside) == (other.dims, other.growth, other.inside)


def spanned(rows, variables):
    """The reduced echelon form of forms at one point, by the names of the variables."""
    order = sorted(range(len(variables)), key=lambda k: variables[k].name)
    point = {x: sympy.Rational(3 + 2 * n, 7) for n, x in enumerate(sorted(variables, key=lambda x: x.name))}
    table = [[row[k].xreplace(point).evalf(30) for k in order] for row in rows]
    reduced = sympy.Matrix(table).rref(iszerofunc=lambda a: abs(a) < 1e-20)[0] if table else sympy.Matrix()
    return [round(float(a), 12) for a in reduced]


def test_closed_rows_on_a_surface_with_roots_are_seen_at_once():
    """d z_i = 0 with factors, on rods in space: nothing is solved to see that the rows are closed modulo the others."""
    names = "x1 y1 z1 x2 y2 z2 x3 y3 z3".split()
    rods = [f"sqrt((x{i} - x{j})**2 + (y{i} - y{j})**2 + (z{i} - z{j})**2) - 1" for i, j in ((2, 1), (3, 2))]
    forms = [[f"{i}*x{i}**{i}" if name == f"z{i}" else "0" for name in names] for i in (1, 2, 3)]
    system = block(" ".join(names), forms, rods)
    with spent.at_most_calls(4_500_000):
        result = found(system)
    assert (result.dims, result.growth, result.inside) == ((3,), (0,), (True,) * 3)
    assert result.holonomic_rank == 2
