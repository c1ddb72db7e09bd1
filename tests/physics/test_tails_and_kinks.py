"""Extremes near poles, kinks and tails against closed forms: infinity is no point, and no regular point is lost."""

import math

import pytest

import lagcli

HEAD = "lagcli: 1\n"


def stationary(coordinates, of, row="", starts=4):
    text = f"coordinates: {{{coordinates}}}\n" + (f'holonomic: {{row: "{row}"}}\n' if row else "")
    return lagcli.stationary(lagcli.loads(HEAD + text), of=of, starts=starts)


def one(start):
    return f"x: {{value: {start!r}}}"


@pytest.mark.parametrize(
    ("of", "start", "extremes"),
    [
        ("x*exp(-x)", 0.3, {1.0: "maximum"}),
        ("x*exp(-x)", 0.9, {1.0: "maximum"}),
        ("x**2*exp(-x)", 0.5, {0.0: "minimum", 2.0: "maximum"}),
        ("x**3*exp(-x)", 1.5, {0.0: "saddle", 3.0: "maximum"}),
        ("-exp(-x**2)", 0.5, {0.0: "minimum"}),
        ("x*exp(-x**2)", 0.5, {-math.sqrt(0.5): "minimum", math.sqrt(0.5): "maximum"}),
        ("tanh(x)**2", 0.5, {0.0: "minimum"}),
        ("tanh(3*x - 1)**2", 0.5, {1 / 3: "minimum"}),
        ("-1/cosh(x)", 0.4, {0.0: "minimum"}),
        ("-1/(1 + x**2)", 0.4, {0.0: "minimum"}),
        ("x/(1 + x**2)", 0.4, {-1.0: "minimum", 1.0: "maximum"}),
        ("4.5*(1 - exp(-1.9*(x - 0.74)))**2", 0.9, {0.74: "minimum"}),
        ("exp(-2*x) - 2*exp(-x)", 0.5, {0.0: "minimum"}),
        ("1/x**12 - 2/x**6", 1.3, {-1.0: "minimum", 1.0: "minimum"}),
        ("1/x + x", 0.5, {-1.0: "maximum", 1.0: "minimum"}),
        ("log(x) + 1/x", 0.5, {1.0: "minimum"}),
    ],
)
def test_wells_are_found_and_tails_are_no_points(of, start, extremes):
    found = stationary(one(start), of)
    assert not any(p.dimension for p in found)
    listed = {p.at["x"]: p.type for p in found}
    nearest = min(extremes, key=lambda x: abs(x - start))
    assert min(abs(x - nearest) for x in listed) < 1e-9  # the one beside the start is always among them
    for x, kind in listed.items():
        known = min(extremes, key=lambda each: abs(each - x))
        assert x == pytest.approx(known, abs=1e-9)
        assert kind == extremes[known]


@pytest.mark.parametrize(
    ("of", "row", "start", "extremes"),
    [
        ("-exp(-x**2 - y**2)", "", (0.3, 0.2), [(0, 0, "minimum")]),
        ("tanh(x)**2 + tanh(y)**2", "", (0.3, 0.2), [(0, 0, "minimum")]),
        ("tanh(x)**2 + y**2", "", (0.3, 0.2), [(0, 0, "minimum")]),
        ("x*y*exp(-x**2 - y**2)", "", (0.6, 0.5), [(math.sqrt(0.5), math.sqrt(0.5), "maximum")]),
        ("exp(x*y)", "x**3 + y**3 = 16", (2.0, 2.0), [(2, 2, "maximum")]),
    ],
)
def test_wells_of_two_coordinates_are_found_without_their_tails(of, row, start, extremes):
    found = stationary(f"x: {{value: {start[0]}}}, y: {{value: {start[1]}}}", of, row, starts=3)
    assert not any(p.dimension for p in found)
    for x, y, kind in extremes:
        assert any(math.hypot(p.at["x"] - x, p.at["y"] - y) < 1e-9 and p.type == kind for p in found)
    if len(extremes) == 1 and "x*y*exp" not in of:
        assert len(found) == 1


def test_modes_and_equilibrium_know_the_same_well_of_morse():
    model = lagcli.loads(
        HEAD
        + "coordinates: {x: {value: 0.9}}\nlagrangian: rate(x)**2/2\n"
        + 'forces: {v: {potential: "4.5*(1 - exp(-1.9*(x - 0.74)))**2"}}\n'
    )
    assert [p.at["x"] for p in lagcli.equilibrium(model, starts=2)] == pytest.approx([0.74], abs=1e-12)
    assert lagcli.modes(model).frequencies == pytest.approx([1.9 * 3.0], rel=1e-9)


@pytest.mark.parametrize("of", ["max(x - 1, 0)**2", "max(abs(x) - 1, 0)**2"])
def test_a_plateau_of_a_switch_is_a_continuum(of):
    found = stationary(one(0.4), of, starts=2)
    assert [p.dimension for p in found] == [1]


@pytest.mark.parametrize(
    ("of", "start", "x", "kind", "value"),
    [
        ("abs(x - 1) + x**2/4", 0.3, 1.0, "minimum", 0.25),
        ("max(x, 1 - x)", 0.3, 0.5, "minimum", 0.5),
        ("min(2*x, 1 - x)", 0.1, 1 / 3, "maximum", 2 / 3),
        ("-abs(x + 2) + x/3", 0.3, -2.0, "maximum", -2 / 3),
        ("abs(x)**0.5 + x/4", 0.3, 0.0, "minimum", 0.0),
        ("sqrt((x - 3)**2) - x/2", 0.3, 3.0, "minimum", -1.5),
    ],
)
def test_an_extreme_at_a_kink_is_named(of, start, x, kind, value):
    found = stationary(one(start), of)
    notes = [note for note in found.notes if "makes a kink" in note]
    assert any(f"x = {x:.9g} " in note and kind in note and f"= {value:.9g})" in note for note in notes)


@pytest.mark.parametrize("of", ["abs(x - 1) + 2*x", "abs(x - 1)*(x - 1)", "max(x, 2*x)", "abs(x - 1)**3"])
def test_a_kink_without_an_extreme_is_not_named(of):
    assert not [note for note in stationary(one(0.3), of).notes if "makes a kink" in note]


@pytest.mark.parametrize(
    ("of", "x"),
    [
        ("sqrt(x**2 + 1e-10) - x/2", 1e-5 / math.sqrt(3)),
        ("sqrt((x - 1)**2 + 1e-22) - x/2", 1.0),
        ("2*sqrt((x - 1)**2 + 1e-14) + x**2/2 - x", 1.0),
    ],
)
def test_a_rounded_corner_is_no_kink(of, x):
    found = stationary(one(0.5), of)
    assert [p.at["x"] for p in found] == [pytest.approx(x, abs=1e-9)]
    assert not any("kink" in note for note in found.notes)


def test_beyond_the_domain_of_a_function_there_are_no_points():
    found = stationary(one(0.4), "-log(x) - log(1 - x) + 30*x")  # its slope vanishes at 1.03 too
    assert [p.at["x"] for p in found] == [pytest.approx((16 - math.sqrt(226)) / 30, rel=1e-12)]
    assert math.isfinite(found.points[0].value)


@pytest.mark.parametrize("of", ["-abs(x) + x**2", "-sqrt(x**2) + x**2"])
def test_no_point_is_listed_where_a_kink_is_of_another_type(of):
    """By sign(0) = 0 both would have a minimum at their highest point."""
    assert [(round(p.at["x"], 6), p.type) for p in stationary(one(0.9), of)] == [
        (-0.5, "minimum"),
        (0.5, "minimum"),
    ]


@pytest.mark.parametrize(
    ("coordinates", "of", "row", "where", "value"),
    [
        ("x: {value: 0.6}, y: {value: 0.7}", "abs(x) + abs(y - 1) + x/2", "", "x = 0, y = 1 ", "0"),
        # Three functions are equal there (Charalambous and Bandler).
        (
            "x: {value: 2}, y: {value: 2.1}",
            "max(x**4 + y**2, max((2 - x)**2 + (2 - y)**2, 2*exp(y - x)))",
            "",
            "x = 1, y = 1 ",
            "2",
        ),
        (
            "x: {value: 0.6}, y: {value: 0.8}, z: {value: 0}",
            "max(x, max(y, z))",
            "x**2 + y**2 + z**2 = 1",
            "x = -0.577350269, y = -0.577350269, z = -0.577350269 ",
            "-0.577350269",
        ),
    ],
)
def test_an_extreme_where_kinks_meet_is_named(coordinates, of, row, where, value):
    notes = [note for note in stationary(coordinates, of, row).notes if "makes a kink" in note]
    assert any(
        f"at {where}" in note and f"minimum of the value there (value = {value})" in note for note in notes
    )


@pytest.mark.parametrize(
    "of",
    [
        "abs(x) + abs(y - 1) + 1.5*x",
        "100*abs(x) + abs(y) - 1.5*y",
        # It is convex and least at (1.2, 2.4): at (2/7, 20/7) its three parts are equal, and it falls along one.
        "max(x**2 + y**2, max(x**2 + y**2 + 10*(4 - 4*x - y), x**2 + y**2 + 10*(6 - x - 2*y)))",
    ],
)
def test_a_narrow_valley_between_kinks_is_seen(of):
    notes = [note for note in stationary("x: {value: -1}, y: {value: 5}", of).notes if "makes a kink" in note]
    assert all("x = 1.2, y = 2.4 " in note for note in notes)


@pytest.mark.parametrize("count", [4, 7])
def test_four_kinks_that_meet_are_looked_at_and_seven_are_not(count):
    coordinates = ", ".join(f"x{k}: {{value: 0.{k + 1}}}" for k in range(count))
    notes = stationary(coordinates, " + ".join(f"abs(x{k})" for k in range(count)), starts=0).notes
    assert any("makes a kink" in note for note in notes) == (count == 4)
    assert ("where several kinks meet extremes are not looked for" in notes) == (count == 7)


def test_a_wall_that_lies_on_a_kink_bounds_a_point_alone():
    text = "coordinates: {x: {value: 0.5}, y: {value: 0.5}}\ninequality: {a: x >= 0, b: y >= 0}\n"
    found = lagcli.stationary(lagcli.loads(HEAD + text), of="sqrt(x) + sqrt(y) + x*y", starts=0)
    assert [note for note in found.notes if "makes a kink" in note] == [
        "at x = 0, y = 0 `sqrt` makes a kink, and no lambda is needed for the minimum of the value there (value = 0)"
    ]


def test_two_bodies_far_apart_are_no_continuum():
    def pair(square):
        return f"(1/({square}))**6 - 2*(1/({square}))**3"

    of = " + ".join(map(pair, ("x**2", "u**2 + v**2", "(x - u)**2 + v**2")))
    found = stationary("x: {value: 1.1}, u: {value: 0.5}, v: {value: 0.9}", of, starts=32)
    assert min(p.value for p in found) == pytest.approx(-3, abs=1e-12)
    assert not any(p.dimension for p in found)
    assert max(abs(p.at["x"]) for p in found) < 3


def test_a_large_angle_is_no_extreme_by_its_rounding():
    found = lagcli.stationary(
        lagcli.loads(HEAD + f"coordinates: {{{one(500.3)}}}\n"), of="sin(x) - x", starts=0
    )
    assert {p.type for p in found} == {"saddle"}


def test_wells_close_to_each_other_and_far_from_zero_have_their_types():
    found = stationary(one(1e6 + 0.2), "(x - 1e6)**2*(x - 1e6 - 1)**2")
    assert sorted((p.at["x"] - 1e6, p.type) for p in found) == [
        (0, "minimum"),
        (0.5, "maximum"),
        (1, "minimum"),
    ]


TRIANGLE = "sqrt(x**2 + y**2) + sqrt((x - 1)**2 + y**2) + sqrt((x + {}*1)**2 + (y - 0.3)**2)"


def test_the_shortest_sum_of_distances_is_at_an_obtuse_corner():
    found = stationary("x: {value: 0.4}, y: {value: 0.3}", TRIANGLE.format(1))
    total = 1 + math.hypot(1, 0.3)
    (note,) = [note for note in found.notes if "makes a kink" in note]
    assert "at x = 0, y = 0 " in note
    assert "minimum" in note
    assert f"{total:.9g}" in note


def test_on_a_row_the_ends_of_a_distance_are_named():
    found = stationary("x: {value: 0.6}, y: {value: 0.8}", "abs(x) + 2*y", "x**2 + y**2 = 1")
    notes = [note for note in found.notes if "makes a kink" in note]
    assert any("x = 0, y = -1 " in note and "minimum" in note for note in notes)


@pytest.mark.parametrize(
    ("of", "wall", "where", "kind"),
    [
        ("abs(x) + y**2", "y >= -1", "x = 0, y = 0 ", "minimum"),
        ("abs(x) + y", "y >= 0", "x = 0, y = 0 ", "minimum"),
        ("-abs(x) - y", "y >= 0", "x = 0, y = 0 ", "maximum"),
        ("abs(x - y) + (x - 1)**2 + y**2", "x + y >= 3", "x = 1.5, y = 1.5 ", "minimum"),
        ("sqrt(x**2 + y**2) - y/2", "y >= 0", "x = 0, y = 0 ", "minimum"),
        ("sqrt(x) + (y - 1)**2", "x >= 0", "x = 0, y = 1 ", "minimum"),
        ("abs(x) - y", "y >= 0", "", ""),
    ],
)
def test_a_kink_is_looked_at_among_inequalities(of, wall, where, kind):
    text = f"coordinates: {{x: {{value: 0.3}}, y: {{value: 0.2}}}}\ninequality: {{wall: {wall}}}\n"
    notes = [
        note for note in lagcli.stationary(lagcli.loads(HEAD + text), of=of, starts=1).notes if "kink" in note
    ]
    assert bool(notes) is bool(where)
    assert not where or any(f"at {where}" in note and f"the {kind} of" in note for note in notes)


@pytest.mark.parametrize(
    ("of", "said"),
    [
        (
            "1/(x**2 + y**2)",
            "x = 0, y = 0 the value is not defined, by `/`: beside it the value grows without bound",
        ),
        (
            "-1/sqrt((x - 1)**2 + (y - 2)**2) + x**2",
            "x = 1, y = 2 the value is not defined",
        ),
        ("x/y**2 + y", "y = 0 the value is not defined, by `/`"),
        ("exp(-1/(x**2 + y**2))", "x = 0, y = 0 the value is not defined, by `/`: an extreme may sit there"),
        ("x*log(x) + y**2", "by `log`: an extreme may sit there"),
        (
            "log(x**2 + y**2)",
            "not defined, by `log`: beside it the value falls without bound",
        ),
        ("asin(x) + y**2", "x = 1, y = 0 `asin` makes a kink"),
        ("1/(1 + x**2 + y**2)", None),
    ],
)
def test_a_pole_where_an_extreme_may_sit_is_named(of, said):
    notes = stationary("x: {value: 0.3}, y: {value: 0.2}", of, starts=1).notes
    if said is None:
        assert not any("not defined" in note for note in notes)
    elif "asin" in of:
        assert not any(said in note and "minimum" in note for note in notes)
    else:
        assert any(said in note for note in notes)
    assert not any("makes a kink" in note and "e+1" in note for note in notes)


def test_kinks_are_named_where_they_are_not_looked_for():
    moving = """
coordinates: {x: {value: 0.3}}
lagrangian: rate(x)**2/2
forces: {s: {potential: "abs(x - sin(t)) + x**2"}}
"""
    sliding = """
coordinates: {x: {value: 0.3}, y: {value: 0.1}}
lagrangian: rate(x)**2/2 + rate(y)**2/2
forces: {s: {to: x, force: "-sign(x - 1) - x + y"}, r: {to: y, force: "-y - x"}}
"""
    for text, words in ((moving, "where equations hold t"), (sliding, "`sign` make forces jump")):
        try:
            notes = lagcli.equilibrium(lagcli.loads(HEAD + text), starts=1).notes
        except lagcli.ModelError as error:
            notes = [str(error)]
        assert any(words in note for note in notes), notes


def test_a_removable_singularity_is_no_pole():
    """Six digits off it 1 - cos(x) has four digits left, which differ from one to the next."""
    found = stationary("x: {value: 0.3}, y: {value: 0.2}", "(1 - cos(x))/x**2 + y**2", starts=0)
    assert any(
        note.endswith("an extreme may sit there, where the value beside it is 0.54") for note in found.notes
    )


def test_a_pole_of_a_distance_is_no_maximum_at_a_kink():
    found = stationary("x: {value: 0.3}, y: {value: 0.2}", "1/sqrt((x - 1/3)**2 + y**2) + x**2", starts=0)
    assert not any("maximum" in note for note in found.notes)
    assert any("grows without bound" in note for note in found.notes)


def test_a_kink_along_which_the_function_still_changes_is_no_extreme() -> None:
    """Where two ends of a spring meet its length has a kink, and the height of a bob still changes."""
    text = (
        HEAD
        + """
particles:
  cart: {mass: 2, position: [0, 0, 0]}
  bob: {mass: 0.5, position: [0, 0, -0.8]}
  block: {mass: 1, position: [1.5, 0, 0]}
forces:
  weight: {to: bob, force: [0, 0, -9.81*m]}
  spring: {potential: "40*(distance(cart, block) - 1.5)**2/2"}
holonomic:
  {a: cart.y = 0, b: cart.z = 0, c: block.y = 0, d: block.z = 0, e: bob.y = 0, rod: "distance(cart, bob) = 0.8"}
inequality: {wall: block.x <= 1.8}
"""
    )
    notes = " ".join(lagcli.equilibrium(lagcli.loads(text), starts=4).notes)
    assert "kink" not in notes


@pytest.mark.parametrize(
    ("of", "is_named"), [("sqrt((x - y)**2) + y", True), ("sqrt((x - y)**2) - y", False)]
)
def test_a_wall_holds_what_changes_along_a_kink(of, is_named):
    text = HEAD + "coordinates: {x: {value: 0.3}, y: {value: 0.2}}\ninequality: {wall: y >= 0}\n"
    notes = " ".join(lagcli.stationary(lagcli.loads(text), of=of, starts=4).notes)
    assert ("minimum" in notes) is is_named
