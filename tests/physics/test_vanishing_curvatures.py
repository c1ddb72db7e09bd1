"""Points where second derivatives vanish, or are what rounding leaves of their terms: higher derivatives decide."""

import pytest

import lagcli

HEAD = "lagcli: 1\n"
SCALES = [1e-9, 1e-3, 1.0, 1e4, 1e9]
KINDS = {3: "saddle", 4: "minimum", 5: "saddle", 6: "minimum", -4: "maximum"}


def stationary(text, of, starts=0):
    return lagcli.stationary(lagcli.loads(HEAD + text), of=of, starts=starts)


def at_zero(found, *names, size=1.0, centre=0.0):
    """The only point at which these coordinates have a value, to a part of the size of things."""
    hits = [p for p in found if all(abs(p.at[name] - centre) < 1e-5 * size for name in names)]
    assert len(hits) == 1
    assert all(abs(hits[0].at[name] - centre) <= 1e-9 * size for name in names)
    return hits[0]


@pytest.mark.parametrize(
    ("power", "length", "gain"),
    [
        (k, a, g)
        for k, (a, g) in zip([3, 4, 5, 6, -4], zip(SCALES, SCALES[2:] + SCALES[:2], strict=True), strict=True)
    ],
)
def test_a_power_of_one_coordinate_has_its_type_in_all_units(power, length, gain):
    sign, k = (-1 if power < 0 else 1), abs(power)
    text = f"coordinates: {{x: {{value: {0.7 * length!r}}}}}\n"
    point = at_zero(stationary(text, f"{sign * gain!r}*(x/{length!r})**{k}"), "x", size=length)
    assert (point.type, point.dimension) == (KINDS[power], 0)


# The same functions in other coordinates: V on a row, turned, of an angle, off zero, and as what is left of terms.
FORMS = {
    "on a parabola": ("x: {value: A}, y: {value: A}", "y = x**2/A", "G*x*y/A**2", 3),
    "the distance to a centre of curvature": (
        "x: {value: A}, y: {value: A}",
        "y = x**2/A",
        "G*((x/A)**2 + (y/A - 0.5)**2)",
        4,
    ),
    "turned": ("x: {value: A}, y: {value: A/2}", "", "G*(((3*x+4*y)/A)**3 + ((4*x-3*y)/A)**2)", 3),
    "turned with a power of four": (
        "x: {value: A}, y: {value: A/2}",
        "",
        "G*(((3*x+4*y)/A)**4 + ((4*x-3*y)/A)**2)",
        4,
    ),
    "of terms that cancel": ("x: {value: A/2}", "", "G*(cos(x/A) - 1 + (x/A)**2/2)", 4),
    "of odd terms that cancel": ("x: {value: A/2}", "", "G*(sin(x/A) - x/A)", 3),
    "on a cubic": ("x: {value: A/2}, y: {value: A/8}", "y = x**3/A**2", "G*y/A", 3),
    "twice": ("x: {value: A/2}, y: {value: A/3}", "", "G*((x/A)**4 + (y/A)**4)", 4),
    "a fall of two": ("x: {value: A/2}, y: {value: A/3}", "", "-G*((x/A)**4 + (x*y/A**2)**2 + (y/A)**4)", -4),
    "a monkey's saddle": ("x: {value: A/2}, y: {value: A/3}", "", "G*x*y*(x + y)/A**3", 3),
    "a form of both signs": ("x: {value: A/2}, y: {value: A/3}", "", "G*((x/A)**4 - (y/A)**4)", 3),
}


@pytest.mark.parametrize(
    ("form", "length", "gain"),
    [
        *((form, 1.0, 1.0) for form in FORMS),
        ("turned", 1e-6, 1e5),
        ("on a cubic", 1e5, 1e-6),
    ],
)
def test_a_type_is_the_same_in_all_coordinates_and_units(form, length, gain):
    coordinates, row, of, power = (
        str(part).replace("A", repr(length)).replace("G", repr(gain)) for part in FORMS[form]
    )
    names = [part.split(":")[0].strip() for part in coordinates.split("},")]
    values = {"A/2": 0.5, "A/3": 1 / 3, "A/8": 0.125, "A": 1.0}
    given = ", ".join(
        f"{name}: {{value: {values[part.split('value: ')[1].strip('} ')] * length!r}}}"
        for name, part in zip(names, FORMS[form][0].split("},"), strict=True)
    )
    text = f"coordinates: {{{given}}}\n" + (f'holonomic: {{row: "{row}"}}\n' if row else "")
    point = at_zero(stationary(text, of), names[0], size=length)
    assert point.type == KINDS[int(power)]


@pytest.mark.parametrize(("offset", "power"), [(0.1, 3), (7.1, 4)])
def test_a_power_about_a_number_that_is_rounded_has_its_type(offset, power):
    text = "coordinates: {x: {value: 1.3}}\n"
    found = stationary(text, f"(x - {offset})**{power} + 0.1 + 0.2 - 0.3")
    assert at_zero(found, "x", centre=offset).type == KINDS[power]


@pytest.mark.parametrize(
    ("of", "kinds"),
    [
        ("x**3 + 1e-5*x**2", ["maximum", "minimum"]),
        ("x**4 + 1e-7*x**2", ["minimum"]),
        ("x**4 - 1e-7*x**2", ["maximum", "minimum", "minimum"]),
        ("1e-9*x**2 + y**2 + x**4", ["minimum"]),
        ("1e-9*x**2 - y**2", ["saddle"]),
        ("1e9*y**2 + x**2", ["minimum"]),
        ("1e9*(y - x**2)**2 - x**2 + x**4", ["maximum"]),
    ],
)
def test_a_curvature_that_is_small_is_one(of, kinds):
    names = "x: {value: 0.3}, y: {value: 0.2}" if "y" in of else "x: {value: 0.3}"
    found = stationary(f"coordinates: {{{names}}}\n", of, starts=8)
    if "x**4" in of and "1e9" in of:
        assert sorted(p.type for p in found) == ["minimum", "minimum", "saddle"]
    else:
        assert sorted(p.type for p in found) == kinds
    assert not any(p.dimension for p in found)


@pytest.mark.parametrize(
    ("of", "kind"),
    [
        ("x**9", "saddle"),
        ("-x**12", "maximum"),
        ("x**4 + y**6", "minimum"),
        ("x**4 + y**5", "saddle"),
        ("(3*x + 4*y)**4 - (x - y)**6", "saddle"),
        ("-x**2*y**2 - x**6 - y**6", "maximum"),
        ("x**2*y**2 - x**6 + y**6", "saddle"),
        ("(y - x**2)**4 + x**10", "minimum"),
        ("(y - x**2)**2*(x**2 + y**2) + x**8", "minimum"),
        ("(y - x**2)**2 + x**7", "saddle"),
        ("x**4 + x**2*y**3 + y**6", "minimum"),
        ("x**4 - 3*x**2*y**3 + y**6", "saddle"),
        ("x**4 - 1.9999*(x*y)**2 + y**4", "minimum"),
        ("x**4 + y**4 + z**4 + x*y*z*(x + y + z)/2", "minimum"),
        ("x**4 + y**4 + z**4 + 3*x*y*z*(x + y + z)", "saddle"),
        ("x**2 + y**4 + z**6", "minimum"),
    ],
)
def test_what_the_first_form_leaves_open_the_next_ones_decide(of, kind):
    values = {"x": 0.3, "y": 0.2, "z": 0.1}
    names = [name for name in values if name in of]
    given = ", ".join(f"{name}: {{value: {values[name]}}}" for name in names)
    point = at_zero(stationary(f"coordinates: {{{given}}}\n", of), *names)
    assert (point.type, point.dimension) == (kind, 0)


def test_a_point_that_is_found_thrice_beside_itself_is_listed_once():
    """Newton's steps find it to a fifth of the digits, and each of the three is moved to zero."""
    given = "x: {value: 0.5}, y: {value: 0.3}, z: {value: 0.2}"
    found = stationary(f"coordinates: {{{given}}}\n", "(x + y)**4 + (y + 2*z)**4 - (x - z)**6")
    assert [(p.type, p.dimension) for p in found] == [("saddle", 0)]


SUMS_OF_POWERS = [
    ("(y+z)**4 + (2*x+z)**2 + (2*x+z+y*z)**6", (0, 0, 0), "minimum"),
    ("-(y+z)**4 - (2*x+z)**2 - (2*x+z+y*z)**6", (0, 0, 0), "maximum"),
    ("3*(x+y)**4 + (x-y+z)**4 + (3*y-z)**4", (0, 0, 0), "minimum"),
    ("-2*(3*x-y+z-0.8)**6 - 2*(3*x+3*z-1.8)**6 + 2*(x+3*y+3*z-2.4)**4", (0.3, 0.4, 0.3), "saddle"),
    ("(2*x-y+z)**6 + (2*y+z)**4 + (2*x+2*y+3*z)**6", (0, 0, 0), "minimum"),
    ("(x+2*y)**4 + (y-z-u)**4 + (z+2*u)**4 + (u-x)**4", (0, 0, 0, 0), "minimum"),
    ("-(x+2*y)**6 - (y-z-u)**4 - (z+2*u)**4 - (u-x)**2", (0, 0, 0, 0), "maximum"),
    ("(x+2*y)**6 + (y-z-u)**4 - (z+2*u)**3 + (u-x)**4", (0, 0, 0, 0), "saddle"),
]


@pytest.mark.parametrize(("of", "at", "kind"), SUMS_OF_POWERS)
def test_powers_of_independent_lines_have_one_point_to_rounding(of, at, kind):
    given = ", ".join(
        f"{name}: {{value: {a + b}}}" for name, a, b in zip("xyzu", at, (0.3, -0.4, 0.2, 0.1), strict=False)
    )
    (point,) = stationary(f"coordinates: {{{given}}}\n", of, starts=2)
    assert [point.at[name] for name in "xyzu"[: len(at)]] == pytest.approx(at, rel=1e-15, abs=1e-15)
    assert (point.type, point.dimension) == (kind, 0)


@pytest.mark.parametrize(
    ("of", "wall", "kind"),
    [("x**4 + y**5", "y >= 0", "degenerate"), ("x**4 - y**6", "y >= 0", "saddle")],
)
def test_a_wall_in_the_way_of_one_of_two_sides_leaves_it_open(of, wall, kind):
    text = f"coordinates: {{x: {{value: 0.3}}, y: {{value: 0.2}}}}\ninequality: {{wall: {wall}}}\n"
    assert {p.type for p in stationary(text, of) if abs(p.at["x"]) < 1e-3} == {kind}


WIRE = """
particles: {{b: {{mass: {mass!r}, position: [{start!r}, 0, 0]}}}}
holonomic: {{wire: "b.z = {wire}", plane: b.y = 0}}
forces: {{w: {{to: b, force: [0, 0, -9.81*m]}}}}
simulation: {{assemble: true}}
"""


@pytest.mark.parametrize(
    ("wire", "kind", "mass"),
    [
        ("b.x**3", "saddle", 1e9),
        ("b.x**4", "minimum", 1.0),
        ("-b.x**4", "maximum", 1e-9),
        ("b.x**5 - b.x**6", "saddle", 1.0),
    ],
)
def test_a_bead_on_a_flat_wire(wire, kind, mass):
    model = lagcli.loads(HEAD + WIRE.format(mass=mass, start=0.4, wire=wire))
    assert at_zero(lagcli.equilibrium(model, starts=0), "b.x").type == kind
    if "5" not in wire and mass >= 1:
        found = lagcli.modes(model)
        assert found.stable is (True if kind == "minimum" else None)
        assert not found.eigenvalues.any()


CART = """
particles: {b: {mass: 1, position: [0.3, 0.1, 0]}}
holonomic: {wire: "b.y = b.x**2", plane: b.z = 0}
forces: {s: {potential: "b.x*b.y"}}
simulation: {assemble: true}
"""
SPRING = """
particles: {b: {mass: 1, position: [0.3, 0.1, 0]}}
holonomic: {wire: "b.y = b.x**2 + b.x**3", plane: b.z = 0}
forces: {s: {potential: "b.y**2/2 + b.y - b.x**2"}}
simulation: {assemble: true}
"""


@pytest.mark.parametrize("text", [CART, SPRING])
def test_no_strict_minimum_is_claimed_at_an_inflection(text):
    model = lagcli.loads(HEAD + text)
    assert at_zero(lagcli.equilibrium(model, starts=0), "b.x").type == "saddle"
    found = lagcli.modes(model)
    assert found.stable is None
    assert abs(found.at["b.x"]) < 1e-12


def test_a_column_at_its_buckling_load_falls_by_the_fourth_power():
    found = lagcli.equilibrium(
        lagcli.loads(
            HEAD
            + """
parameters: {g: 9.81, k: g}
particles: {b: {mass: 1, position: [0.1, 0, 1]}}
holonomic: {rod: norm(b) = 1, plane: b.y = 0}
forces: {w: {to: b, force: [0, 0, -g*m]}, s: {potential: "k/2*b.x**2"}}
simulation: {assemble: true}
"""
        ),
        starts=0,
    )
    assert [p.type for p in found] == ["minimum", "maximum"]


def test_a_wall_in_the_way_of_an_odd_power_leaves_it_open():
    text = "coordinates: {x: {value: 0.3}}\ninequality: {wall: x >= 0}\n"
    assert {p.type for p in stationary(text, "x**3")} == {"degenerate"}


@pytest.mark.parametrize(
    ("text", "of", "kinds"),
    [
        ("holonomic: {ball: x**2 + y**2 + z**2 = 1}", "x**2 + y**2", ["minimum", "minimum", "maximum"]),
        ("holonomic: {ball: x**2 + y**2 + z**2 = 1}", "-(x**2 + y**2)**2", ["minimum", "maximum", "maximum"]),
        ("", "(x**2 + y**2 + z**2 - 1)**2", ["minimum", "maximum"]),
        ("", "(x**2 + y**2 - 1)**3 - z**2", ["saddle", "saddle"]),
    ],
)
def test_a_continuum_has_the_type_of_the_directions_across(text, of, kinds):
    coordinates = "coordinates: {x: {value: 0.6}, y: {value: 0.5}, z: {value: 0.4}}\n"
    found = stationary(coordinates + text, of, starts=6)
    assert sorted(p.type for p in found) == sorted(kinds)
    assert len([p for p in found if p.dimension]) == 1


def test_rounding_of_a_lagrangian_written_at_length_is_no_force_without_a_potential():
    text = "(2*x + y + z)**4 + (2*x + 2*y - z + 2*x*z)**2 + (-x + 2*y + z)**2"
    model = lagcli.loads(
        "lagcli: 1\ncoordinates: {x: 0, y: 0, z: 0}\n"
        f"lagrangian: rate(x)**2/2 + rate(y)**2/2 + rate(z)**2/2 - ({text})\n"
    )
    found = lagcli.equilibrium(model)
    assert [point.type for point in found.points] == ["minimum", "minimum", "saddle"]


@pytest.mark.parametrize("of", ["sin(x)/x", "sin(x)/x + y**2", "(1 - cos(x))/x**2 + y**2"])
def test_where_a_function_has_no_value_is_no_point(of):
    given = "x: {value: 0.3}, y: {value: 0.1}" if "y" in of else "x: {value: 0.3}"
    found = stationary(f"coordinates: {{{given}}}\n", of, starts=2)
    assert not any(abs(p.at["x"]) < 1e-3 for p in found)
    assert any("not defined" in note for note in found.notes)


@pytest.mark.parametrize(("of", "starts"), [("tan(x)/x + y**2", 4), ("x/sin(x) + y**2", 8)])
def test_where_the_balance_is_rounding_beside_such_a_place_is_no_point(of, starts):
    """From walls Newton's steps lead to 1e-8, where doubles are noise and the slope is steep enough."""
    text = "coordinates: {x: {value: 0.3}, y: {value: 0.1}}\ninequality: {a: x >= -20, b: x <= 20}\n"
    found = stationary(text, of, starts=starts)
    assert found.points
    assert not any(abs(p.at["x"]) < 1e-3 for p in found)
    assert any("not defined" in note for note in found.notes)


@pytest.mark.parametrize("pull", ["y", "exp(y)"])
def test_a_stiff_spring_balances_although_rounding_of_its_force_is_large(pull):
    """The first is counted by algebra, the second is searched: doubles see no force along a spring of 1e14, and a
    curvature of 1 beside one of 1e14 is none to them."""
    text = "coordinates: {x: {value: 0.3}, y: {value: -1.1}}\n"
    found = stationary(text, f"1e14*(sqrt(x**2 + y**2) - 1)**2/2 + {pull}", starts=16)
    assert [(round(p.at["x"], 9), round(p.at["y"], 9), p.type) for p in found] == [
        (0, -1, "minimum"),
        (0, 1, "saddle"),
    ]


@pytest.mark.parametrize("row", ["(y - 1)**2 = 0", "(y - 1)**3 = 0", "(y - 1)**2*(x + 2) = 0"])
def test_where_a_row_has_no_gradient_is_no_minimum_with_a_multiplier(row):
    text = f'coordinates: {{x: 0.3, y: 1.001}}\nholonomic: {{r: "{row}"}}\nsimulation: {{assemble: true}}\n'
    found = stationary(text, "x**2 + y", starts=2)
    assert not found.points
    assert any("without lambda" in note for note in found.notes)
