"""What vanishes at a start is judged from the text of the file, to fifty digits: what nearly vanishes does not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest

import lagcli

pytestmark = pytest.mark.numeric

START = {"x": "3", "y": "0.3", "z": "0", "w": "0.2", "u": "0.35"}


def counted(
    values: Mapping[str, str], differential: Sequence[str], holonomic: Sequence[str] = ()
) -> lagcli.DofCount:
    coordinates = {**START, **values}
    lines = ["lagcli: 1", "coordinates:"]
    lines += [f'  {name}: {{value: "{value}"}}' for name, value in coordinates.items()]
    lines.append('lagrangian: "' + " + ".join(f"rate({name})**2" for name in coordinates) + '"')
    lines += ["holonomic:", *(f'  h{i}: "{row}"' for i, row in enumerate(holonomic))] if holonomic else []
    lines += ["differential:", *(f'  n{i}: "{row} = 0"' for i, row in enumerate(differential))]
    return lagcli.dof(lagcli.loads("\n".join(lines)))


@pytest.mark.parametrize(
    ("g", "x"),
    [
        ("sqrt(x**2 + 1e-12) - x", "3"),
        ("sqrt(x**2 + 1e-30) - x", "0.4"),
        ("log(1 + exp(-x))", "25"),
        ("log(1 + exp(-x))", "35"),
        ("log(1 + exp(-50*x))", "1"),
        ("cos(x) - 1 + x**2/2 - x**4/24 + x**6/720 - x**8/40320 + x**10/3628800", "0.4"),
        ("1 - tanh(x)", "20"),
        ("exp(x) - exp(x + 1e-13)", "1"),
        ("sin(x) - x + x**3/6 - x**5/120", "1e-3"),
        ("x - sin(x)", "1e-6"),
        ("1 - cos(x)", "1e-8"),
        ("sqrt(1 + x**2) - x", "1e8"),
        ("atan(x) - pi/2", "1e15"),
        ("x - 1", "1 + 1e-12"),
        ("cos(x) - 1/2", "1.0471975511965976"),
        ("x**2 - 2", "sqrt(2) + 1e-14"),
        ("x**30", "1e-3"),
        ("1 - x/sqrt(x**2 + 1e-20)", "2"),
    ],
)
def test_a_coefficient_that_nearly_vanishes_leaves_a_row_nonholonomic(g: str, x: str) -> None:
    assert counted({"x": x}, [f"d(w) - ({g})*u*d(z)"]).configuration_dof == 5


@pytest.mark.parametrize(
    ("g", "y", "truth"),
    [
        ("y - 1", "1", 3),
        ("y - 1", "1.000000000001", 4),
        ("y - 1", "1 + 1e-30", 4),
        ("y - 1e6", "1e6 + 1e-6", 4),
        ("2*cos(y) - 1", "pi/3", 3),
        ("2*sin(y) - sqrt(3)", "60*deg", 3),
        ("2*cos(y) - 1", "1.0471975512", 4),
        ("3*y - 1", "1/3", 3),
        ("3*y - 1", "0.3333333333333333", 4),
        ("y**2 - 2", "sqrt(2)", 3),
        ("y**2 - 2", "1.4142135623730951", 4),
        ("y", "1e-30", 4),
    ],
)
def test_a_place_that_rows_keep_to_is_one_only_from_on_it(g: str, y: str, truth: int) -> None:
    assert counted({"y": y}, ["d(y)", f"d(w) - ({g})*u*d(z)"]).configuration_dof == truth


@pytest.mark.parametrize(
    ("nearly", "a"), [("log(1 + exp(-a))", "25"), ("sqrt(a**2 + 1e-26) - a", "0.4"), ("a - 1", "1 + 1e-12")]
)
@pytest.mark.parametrize(("g", "y"), [("y - 1", "1"), ("2*cos(y) - 1", "pi/3"), ("y**2 - 2", "sqrt(2)")])
def test_a_place_that_rows_keep_to_is_one_beside_what_nearly_vanishes(
    nearly: str, a: str, g: str, y: str
) -> None:
    """Numbers take both for zero; algebra knows that one of them is."""
    values = {"y": y, "a": a, "b": "0.4", "c": "0", "e": "0.1"}
    rows = ["d(y)", f"d(w) - ({g})*u*d(z)", f"d(b) - ({nearly})*c*d(e)"]
    assert counted(values, rows).configuration_dof == 7


@pytest.mark.parametrize("gain", ["1", "1e6"])
def test_a_hidden_condition_is_demanded_where_another_row_keeps_to_a_place(gain: str) -> None:
    values = {"x": "9/7", "y": "1/3", "z": "4/9", "w": "sqrt(2)", "v": "0.5", "p": "0.2"}
    rows = [
        "d(x)",
        f"2*d(x) + {gain}*(y**2 - y - z)*dt",
        "d(w)",
        f"(x**2 + 2)*d(u) + v*(2 - w**2)*d(p) + (x**2 + 1)*{gain}*(y**2 - y - z)*dt",
    ]
    found = counted(values, rows)
    assert found.configuration_dof == 3
    assert any("hidden condition y**2 - y - z = 0" in note for note in found.notes)


@pytest.mark.parametrize(("condition", "v"), [("u - 2*v", "0.25"), ("u/(u + 2) - v", "0.2")])
@pytest.mark.parametrize(("x", "y"), [("0", "0"), ("0", "0.5"), ("0.3", "0")])
def test_a_hidden_condition_is_demanded_where_algebra_divides_by_one_thing_after_another(
    condition: str, v: str, x: str, y: str
) -> None:
    """n1 and n2 turn x and y about the origin: algebra divides by x, and by y where x vanishes."""
    turn = "(d(z) + d(y)/1000)"
    rows = [
        f"d(x) - y*{turn}",
        f"d(y) + x*{turn} + (x**2 + 1)*(d(x) - y*{turn})",
        f"d(w) + 2*(d(y) + x*{turn})",
        f"d(w) + ({condition})*dt",
    ]
    found = counted({"x": x, "y": y, "z": "0.3", "w": "0.1", "u": "0.5", "v": v}, rows)
    assert found.configuration_dof == 6 - 4
    assert any("hidden condition" in note for note in found.notes)


@pytest.mark.parametrize(
    ("y", "is_beside"), [("1 + 1e-12", True), ("1 + 1e-30", True), ("1", False), ("1.01", False)]
)
def test_a_start_beside_a_special_place_says_that_it_is_judged_as_it_is_written(
    y: str, is_beside: bool
) -> None:
    found = counted({"y": y}, ["d(y)", "d(w) - (y - 1)*u*d(z)"])
    assert is_beside == any("the start lies beside y - 1 = 0 and not on it" in note for note in found.notes)


@pytest.mark.parametrize(
    ("row", "y", "what"),
    [
        ("(y - 1)**2 = 0", "1.000000000001", "turns within 9e-13"),
        ("x*(y - 1)**2 = 0", "1.000000000001", "turns within 9e-13"),
        ("sqrt(z**2 + (y - 0.3)**2) = 0", "0.3 + 1e-13", "jumps at the start"),
    ],
)
def test_a_gradient_that_nearly_vanishes_does_not_jump(row: str, y: str, what: str) -> None:
    found = counted({"y": y}, ["d(w)"], [row])
    assert found.configuration_dof is None
    assert what in found.reason


@pytest.mark.parametrize(("g", "truth"), [("y**2 - 2", 3), ("y**2 - 2 - 1e-13", 4)])
def test_a_start_that_is_moved_onto_its_rows_is_there_to_all_digits(g: str, truth: int) -> None:
    assert counted({"y": "0.5"}, [f"d(w) - ({g})*u*d(z)"], ["y**2 = 2"]).configuration_dof == truth


@pytest.mark.parametrize("gain", ["1e-6", "1", "10", "30", "1e3", "1e6"])
@pytest.mark.parametrize("p", ["pi/3", "60*deg", "1.0471975511965976", "1.0"])
def test_a_gain_on_a_hidden_condition_refuses_no_start(gain: str, p: str) -> None:
    found = counted({"x": "0.5", "y": p, "z": "1"}, [f"d(x) - {gain}*(cos(y) - z/2)*dt"], ["x = 0.5"])
    assert found.configuration_dof == 3


@pytest.mark.parametrize("x", ["1e-9", "1e-8", "-3e-9", "1e-20"])
def test_a_start_at_which_rows_turn_most_is_a_start_like_others(x: str) -> None:
    """n1 turns by x at the start and elsewhere, and doubles see it at the start alone."""
    row = "(1/5000 - x*u*(z + 2)*exp(x)/2500)*d(u) - x*(z + 2)*exp(x)/5000*d(w)"
    assert counted({"x": x, "z": "-2", "u": "0.24"}, ["d(x)/(x**2 + 1)", row]).configuration_dof == 5 - 1


@pytest.mark.parametrize("gain", ["1", "1e6", "exp(u)"])
def test_a_sum_of_two_conditions_is_taken_apart(gain: str) -> None:
    """n1 demands z = sqrt(y^2 + 1), and n2 with n3 a sum of that and of (2 + sin u) times u^3 - u - x, which is a
    condition alone: of its differential n4 is part, and demands the third one."""
    x, z = "0.3**3 - 0.3", "sqrt(0.2**2 + 1)"
    g, h = f"({gain})*(sqrt(y**2 + 1) - z)", "(sin(u) + 2)*(u**3 - u - x)"
    found = counted(
        {"x": x, "y": "0.2", "z": z, "u": "0.3", "p": "0.4", "q": "exp(0.4)", "a": "0.7"},
        [
            f"d(a) + {g}*dt",
            f"d(w) + {g}*dt",
            f"d(w) + {h}*dt",
            f"d(x) + (1 - 3*u**2)*d(u) + (exp(p) - q + u*{g})*dt + u*d(w)",
        ],
        ["a = 0.7"],
    )
    assert found.configuration_dof == 8 - 5
    assert len(found.notes) == 3
    for g in ("sqrt(y**2 + 1) - z", "u**3 - u - x", "exp(p) - q"):
        assert any(f"hidden condition {g} = 0" in note for note in found.notes)


@pytest.mark.parametrize(("y", "v"), [("1.5", "-2.25"), ("2/7", "-4/49"), ("0", "0")])
def test_a_condition_by_which_algebra_divides_is_demanded(y: str, v: str) -> None:
    """Of all motions, off v + y^2 = 0 and on it: n2 and n3 say so, and n1 then that x = 2 y + 1."""
    found = counted(
        {"y": y, "v": v, "x": f"2*({y}) + 1"},
        [
            "(v + y**2)*u*d(w) + (x - 2*y - 1)*dt + (v + y**2)*d(z)",
            "(v + y**2)*u*d(z) + (v + y**2)*dt",
            "(v + y**2)*u*d(z)",
        ],
    )
    assert found.configuration_dof == 6 - 2
    assert any("hidden condition v + y**2 = 0" in note for note in found.notes)


@pytest.mark.parametrize(
    ("row", "x", "y"),
    [
        ("x*d(x) + y*d(y)", "0", "0"),
        ("y*d(x)", "1", "0"),
        ("x*d(y) - y*d(x)", "0", "0"),
        ("sin(x)*d(y)", "0", "1"),
        ("x**2*d(y)", "0", "1"),
        ("(x - t)*d(y)", "0", "1"),
        ("(x - 1/3)*d(y)", "1/3", "1"),
        ("(1 - cos(x))*d(y)", "0", "1"),
        ("x*d(y) + x**2*d(z)", "0", "1"),
        ("tan(x)*d(y) + y*x*d(w)", "0", "1"),
    ],
)
def test_rows_that_vanish_at_the_start_alone_are_undecided(row: str, x: str, y: str) -> None:
    found = counted({"x": x, "y": y}, [row])
    assert found.configuration_dof is None
    assert "special configuration" in found.reason
    assert found.bounds == (0, 5)


def test_rows_that_depend_on_each_other_at_the_start_alone_are_undecided() -> None:
    found = counted({"y": "0.35"}, ["d(x) - y*d(z)", "d(x) - u*d(z)"])
    assert found.configuration_dof is None
    assert "rank 1 there and 2 nearby" in found.reason


def test_rows_that_time_alone_makes_vanish_count_as_they_do_later() -> None:
    assert counted({}, ["t*d(y)"]).configuration_dof == 4


def test_rows_that_vanish_where_others_keep_the_motion_count_nothing() -> None:
    assert counted({"x": "0"}, ["d(x)", "d(y) - u*d(z)", "d(y) - u*d(z) - x*d(w)"]).configuration_dof == 4


def test_bounds_allow_for_conditions_that_are_not_known_and_equal_ones_are_a_count() -> None:
    square = "lagcli: 1\ncoordinates: {x: {value: 0.3}, y: 0, z: 0}\nlagrangian: rate(x)**2 + rate(y)**2 + rate(z)**2\n"
    square += 'holonomic: {h: "x = 0.3"}\ndifferential: {n: "d(x) = (y**2 + z**2)*dt"}\n'
    assert lagcli.dof(lagcli.loads(square)).configuration_dof == 0
    assert lagcli.check(lagcli.loads(square)).dof.configuration_dof == 0


def test_singular_values_that_are_neither_counted_nor_rounding_are_told() -> None:
    # The start lies 1e-14 beside the second row, which is curved: more digits decide nothing.
    found = counted({}, ["d(w)"], ["x + y = 3.3", "x + (1 + 1e-6)*y + 1e-9*x*y = 3.3000003009 + 1e-14"])
    assert found.configuration_dof is None
    assert "1 of them lie between 1e-07 and 3e-06" in found.reason


@pytest.mark.parametrize("gain", ["1e5", "1e6", "1e7"])
@pytest.mark.parametrize(
    ("w", "factor", "truth"),
    [
        ("pi/3", "1", 3),
        ("1.0472", "1", 4),
        ("pi/3", "(1 + max(y, -5))", 3),
        ("1.0472", "(1 + max(y, -5))", 4),
    ],
)
def test_a_place_is_kept_to_by_a_row_near_to_another(gain: str, w: str, factor: str, truth: int) -> None:
    """A row with a multiple of another row added: without what sets them apart motions would leave the place."""
    rows = [f"{factor}*d(x)", f"{gain}*{factor}*d(x) + d(w) + (10 - 20*cos(w))*(u + 1)*d(z)"]
    assert counted({"w": w}, rows).configuration_dof == truth


def test_of_rows_near_to_one_another_those_that_follow_from_others_are_told() -> None:
    rows = ["d(x)", "1e6*d(x) + d(w) + (10 - 20*cos(w))*(u + 1)*d(z)", "2*d(x)"]
    found = counted({"w": "pi/3"}, rows)
    assert (found.configuration_dof, found.redundant_rows) == (3, ("n2",))


def test_rows_near_to_one_another_have_velocities() -> None:
    rows = [
        "d(x) - x*dt",
        "1000001*d(x) + d(y) - 3*z*d(w) - 1000000*x*dt",
        "d(x)/1000000 + d(z) + (3*x + 3*y)*d(w) - x/1000000*dt",
    ]
    values = {"x": "1.5", "y": "0.88 - 1.5", "z": "0.12", "w": "3 + 4/11", "u": "1"}
    assert counted(values, rows).configuration_dof == 2


def test_a_gain_on_hidden_conditions_makes_no_rows_part_later() -> None:
    """Later points stand beside the surface by rounding, which a gain makes larger than that of the velocities."""
    rows = [
        "d(u)",
        "2*d(u) + d(x)",
        "-2*d(u) - d(x) - 1000000*(y - z**2 - z)*dt",
        "-4*d(u) - 2*d(x) - (2*z + 1)*d(z) + d(y) + (2999*z/1000000 - w/1000)*dt",
        "-3000000*cos(u)*d(u) - 2000000*cos(u)*d(x) - (14000000*z/3 + 1000000*(2*z + 1)*cos(u) + 7000000/3)*d(z)"
        " + (1000000*cos(u) + 7000000/3)*d(y)"
        " + (20993*z/3 - 7000*w/3 + 1000000*(2999*z/1000000 - w/1000)*cos(u))*dt",
    ]
    values = {
        "u": "13/10",
        "x": "-1/7 - (2*(13/10))",
        "z": "1/3",
        "y": "(1/3)**2 + (1/3)",
        "w": "3*(1/3) - ((1/3)/1000)",
    }
    assert counted(values, rows).configuration_dof == 1


@pytest.mark.parametrize("gain", ["1e-6", "1", "7/3", "1e6"])
@pytest.mark.parametrize(
    ("row", "values"),
    [
        ("(2*cos(x) - 1)*d(y)", {"x": "pi/3"}),
        ("(2*sin(x) - sqrt(3))*d(y) + (3*x - pi)*d(z)", {"x": "60*deg"}),
        ("(x - 0.3)*d(y) + (x**2 - 0.09)*d(z)", {"x": "0.1 + 0.2"}),
        ("(x**2 - 2)*d(y)", {"x": "sqrt(2)"}),
        ("(exp(x) - 3)*(u + 1)*d(y) + (x - log(3))*d(w)", {"x": "log(3)"}),
        ("(tan(x) - 1)*d(y)", {"x": "pi/4"}),
        ("(7*x - 3)*d(y) + (7*u - 2)*d(z)", {"x": "3/7", "u": "2/7"}),
        ("x*d(y) - (u - 1.1*1.1)*d(x)", {"x": "0", "u": "1.21"}),
    ],
)
def test_a_row_that_vanishes_at_the_start_leaves_the_count_open(
    gain: str, row: str, values: dict[str, str]
) -> None:
    """Doubles leave rounding of it, which has a direction like any row."""
    found = counted(values, [f"({gain})*({row})"])
    assert found.configuration_dof is None
    assert "the rows have rank 0 there and 1 nearby" in found.reason


@pytest.mark.parametrize(
    ("row", "values", "truth"),
    [
        ("(2*cos(x) - 1)*d(y)", {"x": "1.0471975511965976"}, 4),
        ("(x**2 - 2)*d(y)", {"x": "1.4142135623730951"}, 4),
        ("(x - 0.3)*d(y)", {"x": "0.30000000000000004"}, 4),
        ("(cos(t) - 1)*d(y)", {}, 4),
        ("max(x, 0)*d(y)", {"x": "-1"}, 5),
        ("max(x, 0)*d(y)", {"x": "1"}, 4),
    ],
)
def test_a_row_beside_its_zero_counts(row: str, values: dict[str, str], truth: int) -> None:
    assert counted(values, [row]).configuration_dof == truth


def test_a_row_that_vanishes_at_the_start_beside_holonomic_ones_leaves_the_count_open() -> None:
    assert counted({"x": "sqrt(2)"}, ["1e-6*(x**2 - 2)*d(y)"], ["z = 0"]).configuration_dof is None
    assert counted({"x": "sqrt(2)"}, ["1e-6*(x**2 - 2)*d(y)"], ["x**2 = 2"]).configuration_dof == 4


@pytest.mark.parametrize(
    "row",
    [
        "max(x, 0)*d(y)",
        "min(x, 0)*d(y)",
        "(x + abs(x))*d(y)",
        "(x - abs(x))*d(y)",
        "max(x, 0)*(d(y) - z*d(w))",
    ],
)
def test_a_row_that_vanishes_on_one_side_of_a_kink_leaves_the_count_open_on_it(row: str) -> None:
    """On the kink all of it vanishes, and what holds beyond it on one side does not on the other."""
    assert counted({"x": "0"}, [row]).configuration_dof is None


@pytest.mark.parametrize("f", ["1", "(x**2 + 1)"])
@pytest.mark.parametrize(("z", "start"), [("z - 1", "1"), ("2*cos(z) - 1", "pi/3")])
def test_steep_rows_carry_no_count_off_a_place_that_they_keep_to(f: str, z: str, start: str) -> None:
    """From the rounding of `x` numbers leave it: a step in `u` multiplies that by a hundred digits."""
    rows = [
        f"1e6*{f}*d(x) + d(z) - 1000*({z})*(w + 1)*d(u) - 1e6*(y + 2)*{f}*dt",
        "1e6*d(x) - 1e6*(y + 2)*dt",
    ]
    found = counted({"x": "5 + 8/11", "z": start}, rows)
    assert found.configuration_dof == 4
    assert any(f"keep to {z} = 0" in note for note in found.notes)


def test_a_row_that_is_nonholonomic_alone_is_not_jointly_integrable_with_its_multiple() -> None:
    """Exact algebra does not come to its end on the surface of `min`, and numbers take 1e-17 for zero."""
    rows = [
        "sqrt(y**2 + 3)*d(u) - (x + 2)*1e-17*sqrt(y**2 + 3)*d(w)",
        "(sin(t) + 2)*1e-6*d(u) - (x + 2)*1e-23*(sin(t) + 2)*d(w)",
    ]
    assert counted({"x": "0.64", "w": "-1.6"}, rows, ["min(y, z) = 0"]).bounds == (3, 4)


@pytest.mark.parametrize(("y", "is_near"), [("0.4", False), ("1e-12", True)])
def test_a_kink_is_near_by_the_size_of_the_coordinates_of_its_row(y: str, is_near: bool) -> None:
    """Beside a coordinate of 1e9 four tenths seemed nine digits of nothing."""
    if is_near:
        with pytest.raises(lagcli.ModelError, match="jumps at the start"):
            counted({"x": "1e9", "y": y, "z": "1"}, [], ["abs(y) + z = 1"])
    else:
        assert counted({"x": "1e9", "y": y, "z": "0.6"}, [], ["abs(y) + z = 1"]).configuration_dof == 4


@pytest.mark.parametrize(("y", "truth"), [("-0.4 - 3000", 4), ("-40 - 3000", 4), ("0.4 - 3000", 5)])
def test_a_side_of_a_kink_is_that_of_the_start_though_numbers_go_on_beyond_it(y: str, truth: int) -> None:
    """A tenth of the coordinates is far beyond the kink of `1000*x + y`."""
    found = counted({"x": "3", "y": y}, ["d(x) - max(1000*x + y, 0)*d(z)"])
    assert found.configuration_dof == truth
    assert any("keep to 1000*x + y < 0" in note for note in found.notes) == (truth == 4)


@pytest.mark.parametrize(
    ("values", "rows", "truth"),
    [
        # sin(p) = 0 is kept, though the row multiplies a rounding of p by a factor that grows with exp(1000 b).
        ({"p": "0"}, ["d(p) - 1000*(x + 1)*sin(p)*d(u)"], 5),
        ({"p": "1e-30"}, ["d(p) - 1000*(x + 1)*sin(p)*d(u)"], 6),
        # y = 0 is kept where z = 0 is.
        ({"y": "0", "p": "0"}, ["d(y) - z*d(x)", "d(z) - y*d(x)", "d(w) - y*u*d(p)"], 3),
        ({"y": "0", "z": "0.5", "p": "0"}, ["d(y) - z*d(x)", "d(z) - y*d(x)", "d(w) - y*u*d(p)"], 4),
        # Of two places one is kept.
        ({"y": "0", "z": "0", "p": "0"}, ["d(y) - y*d(x)", "d(w) - y*z*d(p)"], 4),
        ({"y": "1", "z": "0", "p": "0"}, ["d(y) - y*d(x)", "d(w) - y*z*d(p)"], 5),
        ({"y": "0", "z": "0", "p": "0"}, ["d(y) - y*d(x)", "sqrt(u**2 + 3)*(d(w) - y*z*d(p))"], 4),
    ],
)
def test_algebra_alone_says_whether_motions_keep_to_a_place(
    values: dict[str, str], rows: list[str], truth: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numbers that a flow carries are not asked."""
    monkeypatch.delattr("lagcli.analysis.classification.case.Case.flag")
    assert counted(values, rows).configuration_dof == truth


@pytest.mark.parametrize(
    ("values", "rows", "truth"),
    [
        ({"x": "-5500"}, ["exp(x)*d(y)"], (4, 4, 0)),
        ({"x": "-5500"}, ["exp(x)*d(y) - exp(x)*u*d(w)"], (5, 4, 0)),
        ({"x": "-5500"}, ["exp(x)*d(y) - exp(2*x)*u*d(w)"], (5, 4, 0)),
        ({"x": "-8e9"}, ["exp(x)*d(y)", "d(w) - u*d(z)"], (4, 3, 0)),
        ({"x": "-5500"}, ["exp(x)*d(y)", "3*exp(x)*d(y)", "d(w) - u*d(z)"], (4, 3, 1)),
        ({}, ["1e-320*(d(y) - u*d(w))"], (5, 4, 0)),
        ({}, ["d(y) - y*d(w)", "1e18*(d(y) - y*d(w)) + d(u)"], (3, 3, 0)),
        ({}, ["d(y) - y*d(w)", "1e18*(d(y) - y*d(w)) + d(u)", "d(y) - y*d(w)"], (3, 3, 1)),
    ],
)
def test_rows_that_doubles_do_not_tell_count_by_their_digits(
    values: dict[str, str], rows: list[str], truth: tuple[int, int, int]
) -> None:
    """They underflow, or are nearly a multiple of another: algebra says how many count, and digits which."""
    found = counted(values, rows)
    assert (found.configuration_dof, found.velocity_dof, found.redundant) == truth
    assert len(found.redundant_rows) == found.redundant


@pytest.mark.parametrize(("y", "truth"), [("0", 2), ("0.4", 3)])
def test_a_hidden_condition_counts_on_a_place_that_its_rows_keep_to(y: str, truth: int) -> None:
    """On y = 0, which the first row keeps to, algebra has divided by y before it comes to w = u**2."""
    rows = ["d(y) - 10*sin(y)*(x + 1)*d(z)", "d(z)", "d(z) + 3*y*d(x) + (w - u**2)*dt"]
    found = counted({"y": y, "u": "1/3", "w": "1/9"}, rows)
    assert found.configuration_dof == truth


def test_a_gradient_beside_a_large_coordinate_of_no_row_does_not_jump() -> None:
    """The kink of |y - 1| is as far off as y is large, whatever x is."""
    found = counted({"x": "1e12", "y": "0.5"}, ["d(w) - u*d(z)"], ["abs(y - 1) = 0.5"])
    assert found.configuration_dof == 4


PARTING = """
lagcli: 1
coordinates:
  o: {value: 0.2}
  c: {value: pi/3}
  x: {value: (pi/3)/(2 + pi/3)}
  k: {value: cos(pi/3)}
  h: {value: -8/7}
  e: {value: 1 + 8/11 - 0.2*cos(pi/3)}
  m: {value: -4/7 - cos(pi/3)}
lagrangian: (rate(o)**2 + rate(c)**2 + rate(x)**2 + rate(k)**2 + rate(h)**2 + rate(e)**2 + rate(m)**2)/2
differential:
  n1: d(o) = 0
  n2: d(o) + (1000*c/(c + 2) - 1000*x)*dt = 0
  n3: >-
    (1000000000001*sin(t)/1000000 + 1500000000001/500000)*d(o) + (c/(c + 2)**2 - 1/(c + 2))*(sin(t) + 2)*d(c)
    + (sin(t) + 2)*d(x) + d(h)
    + (-t**2 + (sin(t) + 2)*(1000000000*c/(c + 2) - 1000*k - 1000000000*x + 1000*cos(c)))*dt = 0
"""


def test_rows_that_algebra_has_decided_do_not_part_later() -> None:
    """Beside the conditions that they demand doubles see 1e9 times what is left."""
    found = lagcli.dof(lagcli.loads(PARTING))
    assert (found.configuration_dof, found.velocity_dof) == (5, 4)
