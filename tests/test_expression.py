"""Expressions: what they mean, what they refuse and where, and that their cost is bounded."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.expression import evaluate, facts, parser, tokens, tree
from lagcli.expression.tree import ExpressionError

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
    return evaluate.evaluate(parser.parse(text), algebra)


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


def test_an_equation_without_a_sign_is_equal_to_zero() -> None:
    assert parser.parse_equation("x - 1").right == tree.Number(5, 5, "0")
    assert parser.parse_equation("x = 1").relation == "="
    assert parser.parse_condition("x <= 1").relation == "<="


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
    begun = time.process_time()
    assert value(joint.join(["1*2"] * 100_000)) == expected
    assert time.process_time() - begun < 6.0  # about one second on an idle machine


def test_a_long_product_is_no_deeper() -> None:
    assert value("*".join(["1"] * 100_000)) == 1.0


def test_an_endless_text_is_refused_at_once() -> None:
    begun = time.process_time()
    assert error_of("1+" * 5_000_000 + "1").code == "expression-too-long"
    assert time.process_time() - begun < 0.5


@settings(max_examples=150)
@given(st.text(alphabet="ab1. +-*/()[],=<>^θ²\u0301'\"\\\n", max_size=40))
def test_no_text_does_worse_than_a_located_error(text: str) -> None:
    for read in (parser.parse, parser.parse_equation, parser.parse_condition):
        try:
            node = read(text)
        except ExpressionError as refused:
            spot = (refused.start, refused.end)
        else:
            spot = (node.start, node.end)
        assert 0 <= spot[0] < spot[1] <= max(1, len(text))
