"""Which points are listed and what is called complete: against zeros that are known exactly."""

import itertools
import math

import numpy as np
import pytest
import sympy

import lagcli

pytestmark = pytest.mark.numeric

CIRCLE = "coordinates: {x: {value: -1}, y: {value: 0}}\nholonomic: {circle: 'x**2 + y**2 = 1'}\n"
PLANE = "coordinates: {x: {value: 0.2}, y: {value: 0.2}}\n"
SPACE = "coordinates: {x: {value: -0.4}, y: {value: -0.8}, z: {value: -0.1}}\n"


def stationary(text, of, **options):
    return lagcli.stationary(lagcli.loads("lagcli: 1\n" + text), of, **options)


def of_one(of, x=1.0, **options):
    return stationary(f"coordinates: {{x: {{value: {x}}}}}\n", of, **options)


@pytest.mark.parametrize("a", ["1.00002", "1.0000002", "(1 + 1e-9)"])
@pytest.mark.parametrize("starts", [0, 32])
def test_a_distance_from_a_point_just_off_the_circle_has_both_points(a, starts):
    found = stationary(CIRCLE, f"sqrt((x - {a})**2 + y**2)", starts=starts)
    assert found.complete
    assert [(p.at["x"], p.at["y"], p.type) for p in found] == [(1, 0, "minimum"), (-1, 0, "maximum")]
    assert [p.multipliers["circle"] for p in found] == pytest.approx([-0.5, 0.5])
    assert any("exact algebra" in note for note in found.notes)


@pytest.mark.parametrize("of", ["4*x + 4*z - 4*y*z - 4*x - 3*z**2", "-3*x - 4*z - 2*x**2 + x"])
def test_a_double_zero_is_listed_once(of):
    found = stationary(SPACE, f"{of} + x**4 + y**4 + z**4")
    assert found.complete
    places = [tuple(p.at.values()) for p in found]
    for k, place in enumerate(places):
        assert all(math.dist(place, other) > 1e-3 for other in places[:k])
    assert all(p.residual < 1e-13 for p in found)


@pytest.mark.parametrize("power", range(1, 7))
@pytest.mark.parametrize("k", [3, 5, 7, 9, 11])
def test_coefficients_that_nearly_vanish_lose_no_point(power, k):
    """f' = (x - 1)^power (x - 2) + 10^-k, against its own roots in exact fractions."""
    x = sympy.Symbol("x")
    slope = sympy.expand((x - 1) ** power * (x - 2) + sympy.Rational(1, 10**k))
    terms = sympy.Poly(sympy.integrate(slope, x), x).all_terms()
    found = of_one(" + ".join(f"({factor})*x**{n}" for (n,), factor in terms if factor), 0.4, starts=0)
    roots = [float(root.evalf(30)) for root in sympy.Poly(slope, x).real_roots()]
    assert found.complete
    assert sorted(p.at["x"] for p in found) == pytest.approx(roots, rel=1e-14)


def test_the_example_of_kuhn_and_tucker_has_no_point_and_its_corner_is_named():
    walls = "inequality: {{c1: '{}*(1 - x)**3 - y >= 0', c2: 'y >= 0'}}\n"
    for factor, is_proved in (("1", True), ("sqrt(2)", False)):
        found = stationary(PLANE + walls.format(factor), "-x", starts=4)
        assert (len(found), found.complete) == (0, is_proved)
        (named,) = [note for note in found.notes if "depend on each other" in note]
        assert "at x = 1, y = 0 the gradients of closed inequalities" in named


def test_the_corner_of_kuhn_and_tucker_is_named_exactly():
    walls = "inequality: {c1: '(0.7 - x)**3 - y >= 0', c2: 'y >= 0'}\n"
    found = stationary(PLANE + walls, "-x")
    assert any("at x = 0.7, y = 0 the gradients of closed inequalities" in note for note in found.notes)


def test_dependent_gradients_of_three_contacts_are_sought():
    walls = "inequality: {c1: '(1 - x)**3 - y >= 0', c2: 'y >= 0', c3: 'x + 1 >= 0'}\n"
    assert any("closed inequalities" in note for note in stationary(PLANE + walls, "-x", starts=0).notes)
    more = walls.replace("}", ", c4: 'x + 2 >= 0'}")
    assert not any("closed inequalities" in note for note in stationary(PLANE + more, "-x", starts=0).notes)


def test_contacts_of_both_signs_in_a_corner_are_no_abnormal_point():
    walls = "inequality: {c1: 'y >= x**2', c2: 'y >= 0'}\n"
    found = stationary(PLANE.replace("y: {value: 0.2}", "y: {value: 0.5}") + walls, "y", starts=4)
    assert not any("closed inequalities" in note for note in found.notes)


@pytest.mark.parametrize(("a", "b"), [(2, 0.3), (-2, -1), (0.1, 3)])
def test_a_leaf_ends_where_its_row_vanishes(a, b):
    """On the ray t (1, 0.5), t > 0, the distance from (a, b) is least at t = (a + b/2)/1.25."""
    text = "coordinates: {x: {value: 1}, y: {value: 0.5}}\ndifferential: {ray: 'y*d(x) - x*d(y) = 0'}\n"
    found = stationary(text, f"(x - {a})**2 + (y - {b})**2")
    t = (a + b / 2) / 1.25
    assert [p.at["x"] for p in found] == pytest.approx([t] if t > 0 else [])


def test_a_wall_that_is_touched_without_a_force_gives_one_point():
    found = stationary(PLANE + "inequality: {x: x >= 0, y: y >= 0}\n", "x**2 + y**2 + x*y")
    assert [(tuple(p.at.values()), p.type) for p in found] == [((0, 0), "minimum")]
    assert found.complete


# Functions of one coordinate: the points in order, and whether they are proved to be all.
ONE = [
    ("1/(x**2 + 1e-4) - 1/((x - 5)**2 + 1e-4)", 1, [-3.2e-10, 5], True),
    ("(0.1/x)**12 - 2*(0.1/x)**6 - 0.5*(x - 1)**2", 1, [-0.19269, -0.100155, 0.099877, 1.000012], None),
    ("4.5*(1 - exp(-1.9*(x - 0.74)))**2", 0.9, [0.74], None),
    ("x*exp(-x)", 0.3, [1], None),
    ("x**2*exp(-x)", 0.9, [0, 2], None),
    ("exp(-x**2)", 1, [0], None),
    ("-exp(-(x - 1)**2) - exp(-(x + 2)**2)", 0.9, [-1.999629, -0.5, 0.999629], None),
    ("tanh(x)**2", 1, [0], None),
    ("abs(x - 1) + x**2/4", 3, [], None),
    ("abs(x - 1) + x**2", 3, [0.5], None),
    ("max(x, 1 - x) + x**2", 3, [], None),
    ("x*log(x)", 1, [math.exp(-1)], None),
    ("log(x)/x", 1, [math.e], None),
    ("log(x)**2 - x/10", 1, [1.05412, 89.995106], None),
    ("sqrt(x) - x", 1, [0.25], True),
    ("x*sqrt(4 - x**2)", 1, [-math.sqrt(2), math.sqrt(2)], True),
    ("sin(x) + cos(x)", 1, [-0.75 * math.pi, 0.25 * math.pi], True),
    ("sin(x)*exp(cos(x))", 1, [-0.9046, 0.9046], True),
    ("tan(x) - 2*x", 1, [-0.75 * math.pi, -math.pi / 4, math.pi / 4, 0.75 * math.pi], True),
    ("x + 1/x", 1, [-1, 1], True),
    ("x**4 - 4*x**3", 1, [0, 3], True),
    ("x/(1 + x**2)", 1, [-1, 1], True),
    ("cosh(x) - 2*x", 1, [math.asinh(2)], True),
    ("exp(x) - 3*x", 1, [math.log(3)], True),
    ("x - sin(2*x)*exp(x/10)", 1, None, None),
]


@pytest.mark.parametrize(("of", "start", "wanted", "is_proved"), ONE, ids=[each[0] for each in ONE])
def test_functions_of_one_coordinate(of, start, wanted, is_proved):
    found = of_one(of, start)
    places = sorted(p.at["x"] for p in found)
    assert is_proved is None or found.complete is is_proved
    if wanted is None:
        assert len(places) > 2
    else:
        near = [x for x in places if abs(x) < 100]
        if "tan(" in of:  # they repeat with every turn, and lie within half of one of the start
            near = sorted(math.remainder(x, 2 * math.pi) for x in near)
        np.testing.assert_allclose(near, wanted, rtol=1e-4, atol=1e-6)
    assert all(b - a > 1e-6 for a, b in itertools.pairwise(places))
    if not found.complete:
        assert any("intervals decide everywhere but" in note for note in found.notes)


def test_continua_leave_the_budget_to_the_other_points():
    """a b c d on a sphere: extremes +-1/16 at the 16 points (+-1/2, ...), and circles of saddles between them."""
    text = "coordinates: {a: {value: 0.5}, b: {value: 0.4}, c: {value: 0.6}, d: {value: 0.48}}\n"
    rows = "holonomic: {s: 'a**2 + b**2 + c**2 + d**2 = 1'}\nsimulation: {assemble: true}\n"
    found = stationary(text + rows, "a*b*c*d")
    extremes = [p for p in found if not p.dimension]
    assert [round(16 * p.value, 12) for p in extremes] == [-1] * 8 + [1] * 8
    assert not found.complete


def test_a_plane_of_points_is_searched_from_one_start():
    text = "particles: {b: {mass: 1, position: [0, 0, 1]}}\nforces: {w: {to: b, force: [0, 0, -9.81*m]}}\n"
    found = lagcli.equilibrium(lagcli.loads("lagcli: 1\n" + text + "inequality: {floor: b.z >= 0}\n"))
    assert [(p.at["b.z"], p.dimension) for p in found] == [(0, 2)]
    assert found.starts == 1
    assert any("one plane" in note for note in found.notes)


def test_seven_charges_on_a_sphere_come_to_rest():
    """Thomson's problem, whose least energy is 14.452977: turned, it is one of a continuum of dimension 3, and close to
    that gradients are dependent but for rounding."""
    at = ["0.9, 0.3, 0.3", "-0.6, 0.7, 0.3", "0.1, -0.9, 0.4", "0.3, 0.4, -0.8", "-0.5, -0.5, -0.7"]
    at += ["0.7, -0.5, -0.5", "-0.9, 0.1, 0.4"]
    text = "particles:\n" + "".join(f"  p{i}: {{mass: 1, position: [{x}]}}\n" for i, x in enumerate(at))
    text += "holonomic:\n" + "".join(f"  s{i}: dot(p{i}, p{i}) = 1\n" for i in range(7))
    pairs = itertools.combinations(range(7), 2)
    of = " + ".join(f"1/distance(p{i}, p{j})" for i, j in pairs)
    found = lagcli.stationary(
        lagcli.loads("lagcli: 1\n" + text + "simulation: {assemble: true}\n"), of, starts=0
    )
    assert found[0].value == pytest.approx(14.452977414, abs=1e-9)
    assert (found[0].type, found[0].index, found[0].dimension) == ("minimum", 0, 3)


@pytest.mark.parametrize(
    ("rows", "of", "starts", "continua"),
    [
        ("x**2 + y**2 + z**2 = 1", "x**2*y**2*z**2", 4, [(0.0, "minimum")]),
        ("(sqrt(x**2 + y**2) - 2)**2 + z**2 = 1/4", "z", 2, [(-0.5, "minimum"), (0.5, "maximum")]),
        ("x**2 + y**2 + z**2 + u**2 = 1", "x*y*z*u", 4, [(0.0, "saddle")]),
    ],
)
def test_circles_that_meet_are_one_continuum(rows, of, starts, continua):
    """Where they cross further directions are flat: the type is that of the directions across each."""
    names = "x: {value: 0.5}, y: {value: 0.4}, z: {value: 0.6}" + ", u: {value: 0.48}" * ("u" in of)
    text = f"coordinates: {{{names}}}\nholonomic: {{s: '{rows}'}}\nsimulation: {{assemble: true}}\n"
    found = [p for p in stationary(text, of, starts=starts) if p.dimension]
    assert [(round(p.value, 9), p.type, p.dimension) for p in found] == [(*each, 1) for each in continua]


@pytest.mark.parametrize(("start", "turns"), [(1.0, 0), (20.0, 3), (-50.0, -8)])
def test_points_that_repeat_with_turns_are_told_and_those_beside_the_start_are_listed(start, turns):
    text = f"lagcli: 1\ncoordinates: {{x: {{value: {start}}}}}\n"
    found = lagcli.stationary(lagcli.loads(text), of="x - 2*sin(x)")
    at = [p.at["x"] - 2 * math.pi * turns for p in found]
    assert sorted(abs(x) for x in at) == [pytest.approx(math.pi / 3, abs=1e-12)] * 2
    assert found.complete
    assert "points repeat with every turn of x, by 2 pi: those next to the start are listed" in found.notes


def test_a_bead_on_a_wave_rests_in_every_trough():
    text = """lagcli: 1
coordinates: {x: {value: 20}}
particles: {b: {mass: 1, position: [x, 0, sin(x)]}}
forces: {w: {to: b, force: [0, 0, -9.81*m]}}
"""
    found = lagcli.equilibrium(lagcli.loads(text))
    places = sorted((p.at["b.x"], p.type) for p in found)
    assert places == [
        (pytest.approx(5.5 * math.pi, abs=1e-12), "minimum"),
        (pytest.approx(6.5 * math.pi, abs=1e-12), "maximum"),
    ]
    assert any("every turn of x" in note for note in found.notes)
    pendulum = text.replace("[x, 0, sin(x)]", "[cos(x), 0, sin(x)]")
    assert not any("turn" in note for note in lagcli.equilibrium(lagcli.loads(pendulum)).notes)


def test_a_point_between_two_walls_that_touch_is_named():
    """x^2 <= y <= x^3: (0, 0) is alone, and the walls have one tangent there."""
    walls = "coordinates: {x: {value: 0.5}, y: {value: 0.4}}\ninequality: {a: y >= x**2, b: y <= x**3}\n"
    found = lagcli.stationary(lagcli.loads("lagcli: 1\n" + walls), of="x")
    assert [(p.at["x"], p.type) for p in found] == [(1.0, "minimum")]
    assert any("at x = 0, y = 0 the gradients of closed inequalities depend" in note for note in found.notes)
