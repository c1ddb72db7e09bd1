"""Expressions: what they mean, what they refuse and where, and that their cost is bounded."""

from __future__ import annotations

import fractions
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.expression import evaluate, facts, integers, parser, tokens, tree
from lagcli.expression.tree import ExpressionError
from tests.helpers.spent import at_most_calls

X = facts.Facts(None, frozenset(("position",)))
TIME = facts.Facts(None, frozenset(("time",)))
RATE = facts.Facts(None, frozenset(("velocity",)), 1, 1)
DT = facts.Facts(None, frozenset(("differential",)), 1, 1)
KNOWN: dict[str, Any] = {
    "x": X,
    "t": TIME,
    "dt": DT,
    "p": facts.Facts(3.0),
    "u": (facts.Facts(1.0),) * 3,
    "a": (X,) * 3,
}


def lookup(node: tree.Node) -> Any:
    match node:
        case tree.Name():
            return KNOWN[node.name]
        case tree.Member():
            return evaluate.component(node, KNOWN[node.owner], node.member, node.owner)
        case _:
            return RATE


def facts_of(text: str, allowed: frozenset[facts.Flag] = facts.OUTPUT, linear: bool = False) -> Any:
    algebra = facts.FactsAlgebra(lookup, allowed, "this", linear)
    return evaluate.value(parser.parse(text), algebra)


def value(text: str) -> float:
    found = facts_of(text, facts.NOTHING)
    assert found.value is not None
    return float(found.value)


def error_of(text: str, **how: Any) -> ExpressionError:
    with pytest.raises(ExpressionError) as caught:
        facts_of(text, **how)
    return caught.value


# Texts with the value Python gives to the same text.


@st.composite
def arithmetic(draw: st.DrawFn, depth: int = 4) -> str:
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        return draw(st.sampled_from(["1", "2.5", "0.125", "3.", ".5", "1e2", "2E-1", "7"]))
    left = draw(arithmetic(depth=depth - 1))
    right = draw(arithmetic(depth=depth - 1))
    form = draw(
        st.sampled_from(
            [
                "{0} + {1}",
                "{0}-{1}",
                "{0} * {1}",
                "{0}/{1}",
                "({0})",
                "-{0}",
                "+{0}",
                "({0}) - ({1})",
                "-{0} ** 2",
                "2**{0}",
            ]
        )
    )
    return form.format(left, right)


@settings(max_examples=150)
@given(arithmetic())
def test_arithmetic_agrees_with_python(text: str) -> None:
    try:
        expected = eval(text, {"__builtins__": {}})  # the text is made above from numbers and operators
    except (ZeroDivisionError, OverflowError):
        assert error_of(text).code == "not-finite"
        return
    if isinstance(expected, complex) or not math.isfinite(expected):
        assert error_of(text).code == "not-finite"
        return
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-2**2", -4.0),
        ("2**3**2", 512.0),
        ("2**-1", 0.5),
        ("(-2)**2", 4.0),
        ("8/4/2", 1.0),
        ("8/4*2", 4.0),
        ("1 - 2 - 3", -4.0),
        ("2*-3", -6.0),
        ("--1", 1.0),
        ("- 1 + 2", 1.0),
        ("1e3", 1000.0),
        ("p*p", 9.0),
        ("min(3, 1, 2) + max(1, 2)", 3.0),
        ("abs(-2) + sign(-3) + sign(0)", 1.0),
        ("atan2(1, 1)", math.pi / 4),
        ("sqrt(2)**2", math.sqrt(2) ** 2),
        ("exp(log(2))", math.exp(math.log(2))),
        ("sinh(1) + cosh(1) - tanh(1)", math.sinh(1) + math.cosh(1) - math.tanh(1)),
        ("asin(1) + acos(1) + atan(1)", math.asin(1) + math.acos(1) + math.atan(1)),
        ("tan(0.5) - sin(0.5)/cos(0.5) + 1", math.tan(0.5) - math.sin(0.5) / math.cos(0.5) + 1),
        ("dot(u, [1, 2, 3])", 6.0),
        ("norm([3, 0, 4])", 5.0),
        ("distance([1, 1, 1], [1, 1, 3])", 2.0),
        ("dot(cross([1, 0, 0], [0, 1, 0]), [0, 0, 1])", 1.0),
        ("dot(2*[1, 2, 3]/2 - [1, 2, 2], [1, 1, 1])", 1.0),
        ("dot(-u, u)", -3.0),
        ("u.y", 1.0),
    ],
)
def test_a_constant_has_the_value_of_ordinary_notation(text: str, expected: float) -> None:
    assert value(text) == expected


def test_spots_are_those_of_the_text() -> None:
    text = "  alpha*(beta + 2) - f(x, [1, y, 2])**2 "
    for node in tree.walk(parser.parse(text)):
        part = text[node.start : node.end]
        match node:
            case tree.Number():
                assert part == node.text
            case tree.Name():
                assert part == node.name
            case tree.Call():
                assert part == "f(x, [1, y, 2])"
            case tree.Vector():
                assert part == "[1, y, 2]"
            case tree.Power():
                assert part == "f(x, [1, y, 2])**2"


def test_members_indices_and_calls_are_told_apart() -> None:
    assert parser.parse("a.x") == tree.Member(0, 3, "a", "x")
    assert parser.parse("body.12") == tree.Member(0, 7, "body", "12")
    index = parser.parse("p[i-1][2].x")
    assert isinstance(index, tree.Index)
    assert (index.owner, len(index.indices), index.member, index.end) == ("p", 2, "x", 11)
    call = parser.parse("d(d)")
    assert call == tree.Call(0, 4, "d", (tree.Name(2, 3, "d"),))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x**2 + 3*x**-2", "/ x"),
        ("x**2.0 + x**(2)", "** x"),
        ("x**-n", "** / n x"),
        ("x**(a - b)", "** a b x"),
        ("-x/2 + 1/1e6", "x"),
        ("1/-x", "/ x"),
        ("b[i].vx*rate(y)", ".vx b i rate( y"),
        ("norm(a - [x, 0, 0]) + reaction(a).x", ".x a norm( reaction( x"),
        ("abs_x*sign(max(y, 1e-3))", "abs_x max( sign( y"),
    ],
)
def test_a_tree_has_the_words_it_is_made_of(text: str, words: str) -> None:
    assert sorted(tree.words(parser.parse(text))) == words.split()


def test_an_equation_without_a_sign_is_equal_to_zero() -> None:
    assert parser.parse_equation("x - 1").right == tree.Number(5, 5, "0")
    assert parser.parse_equation("x = 1").relation == "="
    assert parser.parse_condition("x >= 1").relation == ">="
    assert parser.parse_condition("x <= 1").right == tree.Name(0, 1, "x")


@pytest.mark.parametrize(
    "name", ["lambda", "in", "is", "None", "import", "e", "d", "_", "θ", "größe", "x1", "Δx"]
)
def test_names_are_names_whatever_python_thinks(name: str) -> None:
    assert tokens.is_name(name)
    assert parser.parse(f"2*{name}") == tree.Product(
        0, 2 + len(name), ((1, tree.Number(0, 1, "2")), (1, tree.Name(2, 2 + len(name), name)))
    )


@pytest.mark.parametrize("name", ["", "1a", "a-b", "a b", "x²", "x٣", "a.b", "a\u0301", "p[1]"])
def test_what_is_no_name(name: str) -> None:
    assert not tokens.is_name(name)


@pytest.mark.parametrize(
    ("one", "other"),
    [("\u00b5", "\u03bc"), ("\ufb01", "fi"), ("\u00e9", "e\u0301"), ("\u212a", "K"), ("\u017f", "s")],
)
def test_unicode_names_are_not_merged(one: str, other: str) -> None:
    assert tree.names(parser.parse(one)) == {one}
    assert one != other
    if tokens.is_name(other):
        assert tree.names(parser.parse(f"{one} + {other}")) == {one, other}


@pytest.mark.parametrize(
    ("text", "code", "spot"),
    [
        ("", "syntax", ""),
        ("   ", "syntax", " "),
        ("1 +", "syntax", "+"),
        ("1 + * 2", "syntax", "*"),
        ("x)", "syntax", ")"),
        ("x]", "syntax", "]"),
        ("2*(x + 1", "syntax", "("),
        ("[1, 2, 3", "syntax", "["),
        ("sin(x", "syntax", "("),
        ("2x", "syntax", "x"),
        ("2 x", "syntax", "x"),
        ("x y", "syntax", "y"),
        ("x(1)(2)", "syntax", "("),
        ("1, 2", "syntax", ","),
        ("x = 1", "syntax", "="),
        ("x >= 1", "syntax", ">="),
        ("x == 1", "syntax", "=="),
        ("a.", "syntax", "."),
        ("a.x.y", "syntax", "."),
        ("1.2.3", "syntax", ".3"),
        ("lambda x", "syntax", "x"),
        ("x^2", "unexpected-character", "^"),
        ("größe^2", "unexpected-character", "^"),
        ("x²", "unexpected-character", "²"),
        ("θ·2", "unexpected-character", "·"),
        ("x − 1", "unexpected-character", "−"),
        ("'x'", "unexpected-character", "'"),
        ("x\u0301", "unexpected-character", "\u0301"),
        ("x; 1", "unexpected-character", ";"),
        ("9**9**9", "not-finite", "9**9**9"),
        ("2 + 1e999", "not-finite", "1e999"),
        ("1 + 2/0", "not-finite", "2/0"),
        ("2*sqrt(-1)", "not-finite", "sqrt(-1)"),
        ("log(0)", "not-finite", "log(0)"),
        ("acos(2)", "not-finite", "acos(2)"),
        ("exp(1000)", "not-finite", "exp(1000)"),
        ("1e308*10", "not-finite", "1e308*10"),
        ("2*1e-330", "not-finite", "1e-330"),
        ("2 + 00.010e-330", "not-finite", "00.010e-330"),
        ("1e-200*1e-200 + 1", "not-finite", "1e-200*1e-200"),
        ("1e-200/1e200", "not-finite", "1e-200/1e200"),
        ("3*1e-200**2", "not-finite", "1e-200**2"),
        ("(0 - 8)**(1/3)", "not-finite", "(0 - 8)**(1/3)"),
        ("x + foo(1)", "unknown-function", "foo"),
        ("sin(1, 2)", "wrong-arguments", "sin(1, 2)"),
        ("atan2(1)", "wrong-arguments", "atan2(1)"),
        ("min()", "wrong-arguments", "min()"),
        ("x + u", "vector-mismatch", "u"),
        ("u*u", "vector-mismatch", "u*u"),
        ("1/u", "vector-mismatch", "1/u"),
        ("u**2", "not-a-scalar", "u"),
        ("sin(u)", "not-a-scalar", "u"),
        ("norm(x)", "not-a-vector", "x"),
        ("[1, 2]", "vector-length", "[1, 2]"),
        ("[[1, 2, 3], 1, 1]", "not-a-scalar", "[1, 2, 3]"),
        ("a.q", "unknown-component", "a.q"),
    ],
)
def test_every_error_says_its_code_and_its_spot(text: str, code: str, spot: str) -> None:
    error = error_of(text)
    assert error.code == code
    assert text[error.start : error.end] == spot


@pytest.mark.parametrize(
    ("text", "word"), [("x^2", "**"), ("x²", "**2"), ("x − 1", "-"), ("sine(x)", "sin"), ("2x", "*")]
)
def test_hints_say_what_to_write(text: str, word: str) -> None:
    assert f"`{word}`" in error_of(text).hint


@pytest.mark.parametrize(
    ("text", "allowed", "code"),
    [
        ("1 + x", facts.NOTHING, "position-not-allowed"),
        ("1 + t", facts.NOTHING, "time-not-allowed"),
        ("2*rate(x)", facts.POSITION, "velocity-not-allowed"),
        ("d(x)", facts.MOTION, "differential-not-allowed"),
        ("x*dt", facts.MOTION, "differential-not-allowed"),
        ("d(rate(x))", facts.DIFFERENTIAL, "velocity-not-allowed"),
        ("d(d(x))", facts.DIFFERENTIAL, "differential-not-allowed"),
    ],
)
def test_an_expression_reads_only_what_it_may(text: str, allowed: frozenset[facts.Flag], code: str) -> None:
    assert error_of(text, allowed=allowed).code == code


@pytest.mark.parametrize(
    "text",
    [
        "sin(x)*d(x) - x*dt",
        "rate(x)*x**2/p",
        "-(d(x) + 2*dt)/3",
        "x + rate(x)",
        "d(x*x)",
        "d(x)**1",
        "[d(x), 0, dt]",
    ],
)
def test_linear_laws_are_taken(text: str) -> None:
    facts_of(text, facts.DIFFERENTIAL, linear=True)


@pytest.mark.parametrize(
    ("text", "spot"),
    [
        ("x*d(x) + d(x)*dt", "d(x)*dt"),
        ("rate(x)**2", "rate(x)**2"),
        ("1/d(x)", "1/d(x)"),
        ("sqrt(rate(x))", "sqrt(rate(x))"),
        ("2 + sin(d(x))*3", "sin(d(x))"),
        ("rate(x)*d(x)", "rate(x)*d(x)"),
        ("2**dt", "2**dt"),
        ("min(dt, 1)", "min(dt, 1)"),
        ("3*x*norm([dt, 0, 0])", "norm([dt, 0, 0])"),
    ],
)
def test_a_nonlinear_term_is_shown(text: str, spot: str) -> None:
    error = error_of(text, allowed=facts.DIFFERENTIAL, linear=True)
    assert error.code == "nonlinear-differential"
    assert text[error.start : error.end] == spot


@pytest.mark.parametrize("bracket", ["(", "[", "-", "+", "2**", "sin(", "a[", "(-"])
def test_depth_is_bounded_by_an_error_not_by_the_stack(bracket: str) -> None:
    error = error_of(bracket * 3000 + "1")
    assert error.code == "too-deep"
    assert error.start < 100 * len(bracket)


def test_sensible_depth_is_taken() -> None:
    assert value("(" * 30 + "1" + ")" * 30) == 1.0


@pytest.mark.parametrize(("joint", "expected"), [("+", 200_000.0), ("-", -199_996.0)])
def test_a_long_sum_is_one_node_and_read_in_a_moment(joint: str, expected: float) -> None:
    with at_most_calls(10_000_000):
        assert value(joint.join(["1*2"] * 100_000)) == expected


def test_a_long_product_is_no_deeper() -> None:
    assert value("*".join(["1"] * 100_000)) == 1.0


def test_an_endless_text_is_refused_at_once() -> None:
    with at_most_calls(1_000):
        assert error_of("1+" * 5_000_000 + "1").code == "expression-too-long"


READERS: tuple[Callable[[str], tree.Node], ...] = (
    *(parser.parse, parser.parse_equation, parser.parse_condition),
    *(parser.parse_range, parser.parse_filter, parser.parse_reference),
)


@settings(max_examples=250)
@given(
    st.lists(
        st.sampled_from([*"ab1. +-*/()[],=<>^!θ²\u0301'\"\\\n", "..", " and ", " or ", "not ", "==", "a[1]"]),
        max_size=30,
    ).map("".join)
)
def test_no_text_does_worse_than_a_located_error(text: str) -> None:
    for read in READERS:
        try:
            node = read(text)
        except ExpressionError as refused:
            spot = (refused.start, refused.end)
        else:
            spot = (node.start, node.end)
        assert 0 <= spot[0] < spot[1] <= max(1, len(text))


# Families: ranges, filters, references.


@pytest.mark.parametrize(
    ("text", "name", "low", "high"),
    [
        ("i = 1..N", "i", "1", "N"),
        ("j=i+1 .. 2*N-1", "j", "i+1", "2*N-1"),
        ("k = 0..-2", "k", "0", "-2"),
        (" i = 1. ..max(N, 2) ", "i", "1.", "max(N, 2)"),
        ("θ = p.1..2", "θ", "p.1", "2"),
    ],
)
def test_a_range_has_a_name_and_two_bounds(text: str, name: str, low: str, high: str) -> None:
    found = parser.parse_range(text)
    assert found.name == name
    assert [text[node.start : node.end] for node in (found, *tree.children(found))] == [
        text.strip(),
        low,
        high,
    ]


@pytest.mark.parametrize(
    ("read", "text", "spot", "words"),
    [
        (parser.parse_range, "", "", "a range is missing"),
        (parser.parse_range, "1 = 2..3", "1", "begins with the name"),
        (parser.parse_range, "p[i] = 1..N", "[", "an `=` is missing after `p`"),
        (parser.parse_range, "i in 1..N", "in", "an `=` is missing"),
        (parser.parse_range, "i", "i", "an `=` is missing"),
        (parser.parse_range, "i =", "=", "lower bound"),
        (parser.parse_range, "i = ..N", "=", "lower bound"),
        (parser.parse_range, "i = 1..", "..", "upper bound"),
        (parser.parse_range, "i = 1", "=", "two dots"),
        (parser.parse_range, "i = 1.N", "N", "two dots"),
        (parser.parse_range, "i = 1...N", ".", "two dots"),
        (parser.parse_range, "i = 1:N", ":", "`1..N`"),
        (parser.parse_range, "i = 1..N, j = 1..M", ",", "a list"),
        (parser.parse_range, "i = 1..2..3", "..", "no place"),
        (parser.parse, "1..2", "..", "`for`"),
        (parser.parse_filter, "", "", "a filter is missing"),
        (parser.parse_filter, "i = 1", "=", "`==`"),
        (parser.parse_filter, "(i = 1)", "=", "`==`"),
        (parser.parse_filter, "i == 1 j == 2", "j", "an `and` or `or` is missing"),
        (parser.parse_filter, "(i == 1 not j == 2)", "not", "an `and` or `or` is missing"),
        (parser.parse_filter, "i == 1 && j == 2", "&", "`and`"),
        (parser.parse_filter, "i == 1 and j + 2", "j + 2", "a comparison is needed"),
        (parser.parse_filter, "not i", "i", "a comparison is needed"),
        (parser.parse_filter, "i == (j == 2)", "j == 2", "a number is needed"),
        (parser.parse_filter, "min(i, (j < 2)) == 1", "j < 2", "a number is needed"),
        (parser.parse_filter, "i == and", "and", "is missing before `and`"),
        (parser.parse_filter, "i == 1)", ")", "closes nothing"),
        (parser.parse_filter, "(i == 1", "(", "never closed"),
        (parser.parse_reference, "", "", "missing"),
        (parser.parse_reference, "p[]", "[]", "an index is missing"),
        (parser.parse_reference, "p[1].x", ".x", "without `.x`"),
        (parser.parse_reference, "body.1", ".1", "without `.1`"),
        (parser.parse_reference, "p[1, 2]", ",", "`p[1][2]`"),
        (parser.parse_reference, "-a", "-a", "only a name"),
        (parser.parse_reference, "(a)", "(a)", "only a name"),
        (parser.parse_reference, "a + b", "a + b", "only a name"),
    ],
)
def test_what_families_refuse_and_where(read: Callable[[str], Any], text: str, spot: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        read(text)
    error = caught.value
    assert text[error.start : error.end] == spot
    assert words in f"{error.message}; {error.hint}"


@pytest.mark.parametrize("text", ["a", "p[i]", "p[i][j+1]", "p[N]", " p[2*i - 1] "])
def test_a_reference_is_a_name_with_or_without_indices(text: str) -> None:
    found = parser.parse_reference(text)
    assert text[found.start : found.end] == text.strip()


@pytest.mark.parametrize(
    ("text", "member"),
    [
        ("rate(theta[i])", ""),
        ("rate(p[i].x)", "x"),
        ("d(p[i].x)", "x"),
        ("reaction(p[3])", ""),
        ("multiplier(link[2])", ""),
        ("multiplier(link[2].x)", "x"),
        ("multiplier(link[2].1)", "1"),
    ],
)
def test_members_of_families_stand_in_calls(text: str, member: str) -> None:
    call = parser.parse(text)
    assert isinstance(call, tree.Call)
    (index,) = call.arguments
    assert isinstance(index, tree.Index)
    assert (index.member, index.end) == (member, len(text) - 1)


def test_words_of_filters_are_names_elsewhere() -> None:
    assert tree.names(parser.parse("and + or*not")) == {"and", "or", "not"}


@pytest.mark.parametrize("opened", ["(", "not ", "not (", "2*("])
def test_the_depth_of_a_filter_is_bounded(opened: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parser.parse_filter(opened * 3000 + "i == 1")
    assert caught.value.code == "too-deep"
    node = parser.parse_filter("(" * 40 + "i == 1" + ")" * 40)
    assert isinstance(node, tree.ComparisonNode)


def test_a_long_filter_is_no_deeper() -> None:
    members = integers.holds(parser.parse_filter(" or ".join(["i == 2"] * 5_000)), lambda _: np.arange(4))
    assert np.array_equal(members, [False, False, True, False])


INTEGERS: dict[str, Any] = {
    "N": 5.0,
    "i": np.arange(1, 6),
    "j": np.arange(-2.0, 3.0),
    "broken": 2.5,
    "halves": np.array([1.0, 1.5, 2.5]),
    "gap": np.array([1.0, math.nan]),
    "huge": 1e300,
    "u": (1.0, 2.0, 3.0),
}


def integer(text: str) -> Any:
    return integers.evaluate(parser.parse(text), lambda name: INTEGERS[name.name])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("N*(N + 1)/2", 15),
        ("N/2*2", 5),
        ("i*(i + 1)/2", [1, 3, 6, 10, 15]),
        ("(-1)**i", [-1, 1, -1, 1, -1]),
        ("(-1)**(10**15 + i)", [-1, 1, -1, 1, -1]),
        ("2**i", [2, 4, 8, 16, 32]),
        ("0**0 + 1e3", 1001),
        ("i/2*4/2", [1, 2, 3, 4, 5]),
        ("min(i, 3) + max(N/2, j/2)*2", [6, 7, 8, 8, 8]),
        ("abs(j) - -j", [0, 0, 0, 2, 4]),
        ("-2**53", -(2**53)),
        ("0009007199254740991", 2**53 - 1),
    ],
)
def test_integer_expressions_are_exact(text: str, expected: Any) -> None:
    found = integer(text)
    assert isinstance(found, int) == isinstance(expected, int)
    assert isinstance(found, int) or found.dtype == np.int64
    assert np.array_equal(found, expected)


@pytest.mark.parametrize(
    ("text", "code", "spot", "place"),
    [
        ("1 + N/2", "not-a-whole-number", "1 + N/2", None),
        ("(i + 1)/2", "not-a-whole-number", "(i + 1)/2", 1),
        ("2**-i", "not-a-whole-number", "2**-i", 0),
        ("2**(i/2)", "not-a-whole-number", "2**(i/2)", 0),
        ("9**9**9", "not-a-whole-number", "9**9**9", None),
        ("9**9**i", "not-a-whole-number", "9**9**i", 1),
        ("1 + i**99", "not-a-whole-number", "i**99", 1),
        ("i*2**52", "not-a-whole-number", "i*2**52", 2),
        ("2**62*2**62", "not-a-whole-number", "2**62", None),
        ("9007199254740993", "not-a-whole-number", "9007199254740993", None),
        ("1e999", "not-a-whole-number", "1e999", None),
        ("0.5*2", "not-a-whole-number", "0.5", None),
        ("2*broken", "not-a-whole-number", "broken", None),
        ("huge", "not-a-whole-number", "huge", None),
        ("halves", "not-a-whole-number", "halves", 1),
        ("gap", "not-a-whole-number", "gap", 1),
        ("u", "not-a-whole-number", "u", None),
        ("1 + norm([1, 2, 3])", "not-a-whole-number", "norm([1, 2, 3])", None),
        ("sin(N)", "not-a-whole-number", "sin(N)", None),
        ("p[1] + 2", "not-a-whole-number", "p[1]", None),
        ("p.x", "not-a-whole-number", "p.x", None),
        ("foo(1)", "unknown-function", "foo", None),
        ("min()", "wrong-arguments", "min()", None),
        ("1/j", "not-finite", "1/j", 2),
        ("j**-1", "not-finite", "j**-1", 2),
        ("1/(N - 5)", "not-finite", "1/(N - 5)", None),
    ],
)
def test_what_is_not_whole_is_refused_at_its_member(
    text: str, code: str, spot: str, place: int | None
) -> None:
    with pytest.raises(ExpressionError) as caught:
        integer(text)
    error = caught.value
    assert (error.code, text[error.start : error.end], error.member) == (code, spot, place)


def test_the_lookup_of_a_name_may_refuse() -> None:
    def unknown(node: tree.Name) -> int:
        raise ExpressionError("unknown-name", "", node.start, node.end)

    with pytest.raises(ExpressionError) as caught:
        integers.holds(parser.parse_filter("1 < 2 and 3 < M"), unknown)
    assert (caught.value.code, caught.value.start) == ("unknown-name", 14)


MEMBERS, SIZE = [(3, 1), (-1, 2), (0, 2), (2, 0), (7, -3)], 4  # pairs of i and j

Term = tuple[str, Callable[[int, int], fractions.Fraction]]  # a text and what it means
Claim = tuple[str, Callable[[int, int], bool]]


def term_of(form: str, compute: Callable[..., Any], *parts: Term) -> Term:
    return form.format(*(text for text, _ in parts)), lambda i, j: compute(*(mean(i, j) for _, mean in parts))


TERMS: st.SearchStrategy[Term] = st.recursive(
    st.sampled_from(
        [
            ("i", lambda i, j: fractions.Fraction(i)),
            ("j", lambda i, j: fractions.Fraction(j)),
            ("N", lambda i, j: fractions.Fraction(SIZE)),
            ("3", lambda i, j: fractions.Fraction(3)),
        ]
    ),
    lambda inner: st.one_of(
        st.builds(lambda a, b: term_of("({} + {})", operator.add, a, b), inner, inner),
        st.builds(lambda a, b: term_of("({} - {})", operator.sub, a, b), inner, inner),
        st.builds(lambda a, b: term_of("{}*{}", operator.mul, a, b), inner, inner),
        st.builds(lambda a, b: term_of("({})/({})", operator.truediv, a, b), inner, inner),
        st.builds(lambda a, b: term_of("min({}, {})", min, a, b), inner, inner),
        st.builds(lambda a, b: term_of("max({}, {})", max, a, b), inner, inner),
        st.builds(lambda a: term_of("abs(-{})", abs, a), inner),
        st.builds(lambda a: term_of("({})**2", lambda u: u**2, a), inner),
        st.builds(lambda a: term_of("({})**-1", lambda u: 1 / u, a), inner),
    ),
    max_leaves=6,
)
RELATIONS = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
CLAIMS: st.SearchStrategy[Claim] = st.recursive(
    st.builds(
        lambda a, r, b: (f"{a[0]} {r} {b[0]}", lambda i, j: RELATIONS[r](a[1](i, j), b[1](i, j))),
        TERMS,
        st.sampled_from(sorted(RELATIONS)),
        TERMS,
    ),
    lambda inner: st.one_of(
        st.builds(lambda a: (f"not ({a[0]})", lambda i, j: not a[1](i, j)), inner),
        st.builds(lambda a, b: (f"({a[0]} and {b[0]})", lambda i, j: a[1](i, j) & b[1](i, j)), inner, inner),
        st.builds(lambda a, b: (f"({a[0]} or {b[0]})", lambda i, j: a[1](i, j) | b[1](i, j)), inner, inner),
    ),
    max_leaves=4,
)


def of_member(name: tree.Name) -> Any:
    return {"i": np.array(MEMBERS)[:, 0], "j": np.array(MEMBERS, dtype=float)[:, 1], "N": float(SIZE)}[
        name.name
    ]


def in_python(mean: Callable[[int, int], Any]) -> list[Any]:
    """The value for each member; empty where one divides by zero."""
    try:
        return [mean(i, j) for i, j in MEMBERS]
    except ZeroDivisionError:
        return []


def attempt(compute: Callable[[], Any]) -> tuple[Any, ExpressionError | None]:
    try:
        return np.broadcast_to(compute(), len(MEMBERS)), None
    except ExpressionError as error:
        return None, error


@settings(max_examples=200)
@given(TERMS)
def test_integer_expressions_agree_with_python(term: Term) -> None:
    text, mean = term
    expected = in_python(mean)
    found, error = attempt(lambda: integers.evaluate(parser.parse(text), of_member))
    if error is None:
        assert np.array_equal(found, expected)
    elif expected and "beyond" not in error.message:
        assert error.code == "not-a-whole-number"
        first = next(k for k, value in enumerate(expected) if value.denominator > 1)
        assert error.member in (first, None)


@settings(max_examples=200)
@given(CLAIMS)
def test_filters_agree_with_python(claim: Claim) -> None:
    text, mean = claim
    expected = in_python(mean)
    found, error = attempt(lambda: integers.holds(parser.parse_filter(text), of_member))
    if error is None:
        assert np.array_equal(found, expected)
    else:
        assert not expected or "beyond" in error.message


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 <= i < N", [True, True, True, True, False]),
        ("(i + 1)*2 <= N", [True, False, False, False, False]),
        ("(i == 1 or j == 2) and not i == j", [True, False, False, False, True]),
        ("i <= N/2", [True, True, False, False, False]),
        ("N == 5 and not 2 < 1", True),
        ("not N == 5 or i == 1", [True, False, False, False, False]),
        ("not not 1 < 2 < 2", False),
    ],
)
def test_filters_hold_member_by_member(text: str, expected: Any) -> None:
    found = integers.holds(parser.parse_filter(text), lambda name: INTEGERS[name.name])
    assert isinstance(found, bool) == isinstance(expected, bool)
    assert np.array_equal(found, expected)


# Constants of families: one for each member.

EVERY: dict[str, Any] = {"k": np.array([2.0, -0.5, 1.0]), "h": np.array([0.5, 3.0, 2.0]), "p": 3.0}


def of_family(text: str, member: int | None = None) -> Any:
    """Facts of a text for all members, or for one alone."""
    values = {
        name: v if member is None or isinstance(v, float) else float(v[member]) for name, v in EVERY.items()
    }
    known = {name: facts.Facts(v) for name, v in values.items()} | {"x": X}
    algebra = facts.FactsAlgebra(
        lambda node: known.get(getattr(node, "name", ""), RATE), facts.OUTPUT, "this"
    )
    return evaluate.value(parser.parse(text), algebra)


@pytest.mark.parametrize(
    "text",
    [
        *("k + 1", "1 - k", "k - h", "p*k", "k*h", "k/h", "1/k", "-k", "h**k", "2**k", "k**2", "sqrt(h)"),
        *("sin(k) + cos(k)*tan(k)", "asin(k/4) + acos(k/4) + atan(k)", "atan2(k, 2)", "exp(k) + log(h)"),
        *("sinh(k) + cosh(k) + tanh(k)", "abs(k) + sign(k)", "min(k, h, 1)", "max(0, k)", "norm([k, 1, h])"),
    ],
)
def test_constants_of_a_family_are_those_of_its_members(text: str) -> None:
    found = of_family(text).value
    assert found.shape == (3,)
    assert found == pytest.approx([of_family(text, member).value for member in range(3)], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "spot", "place"),
    [
        ("1 + 2/(k - 1)", "2/(k - 1)", 2),
        ("x/(k - 1)", "x/(k - 1)", 2),
        ("sqrt(k)", "sqrt(k)", 1),
        ("k**0.5", "k**0.5", 1),
        ("(k - 1)**-1", "(k - 1)**-1", 2),
        ("log(k - 1)", "log(k - 1)", 1),
        ("acos(h)", "acos(h)", 1),
        ("exp(300*h)", "exp(300*h)", 1),
        ("1e308*h", "1e308*h", 1),
        ("1e-200**(h + 1)", "1e-200**(h + 1)", 1),
        ("1e-300*(h - 0.5)*1e-300", "1e-300*(h - 0.5)*1e-300", 1),
        ("1e308*k/2 + 1e308*h/2", "1e308*k", 0),
        ("-1.5e308 + -5e307*(h - 0.5)", "-5e307*(h - 0.5)", 1),
    ],
)
def test_a_constant_of_a_family_fails_at_its_first_member(text: str, spot: str, place: int) -> None:
    with pytest.raises(ExpressionError) as caught:
        of_family(text)
    error = caught.value
    assert (error.code, text[error.start : error.end], error.member) == ("not-finite", spot, place)
    with pytest.raises(ExpressionError) as alone:
        of_family(text, place)
    assert (alone.value.message, alone.value.member) == (error.message, None)


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("rate(x)**(2*h)", (1, 6)),
        ("rate(x)**(2*h + 20)", (9, 9)),
        ("rate(x)**k", (0, 9)),
        ("rate(x)**h", (0, 9)),
        ("k*rate(x)", (1, 1)),
        ("k*x", (0, 0)),
        ("x**k", (0, 0)),
    ],
)
def test_degrees_in_a_family_bound_those_of_all_members(text: str, degrees: tuple[int, int]) -> None:
    found = of_family(text)
    assert found.value is None
    assert (found.low, found.high) == degrees


def test_facts_are_equal_to_themselves_alone() -> None:
    one = facts.Facts(np.zeros(3))
    assert one != facts.Facts(one.value)
    assert len({one, one}) == 1
