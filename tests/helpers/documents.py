"""Strategies for texts that a stranger may give: expressions from the grammar and from noise, documents mutated."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

from hypothesis import strategies as st

NAMES = ("a", "b", "q", "k", "n3", "t", "dt", "pi", "m", "r", "v", "half", "rod", "lambda", "is", "é", "_", "nope",
         "kinetic", "potential", "a.x", "a.vx", "a.v", "b.z", "q.x", "n3.y", "rod.x", "body.1", "body.9", "a.q",
         "p[1]", "p[i-1].x", "p[i]", "p[i][j].vy", "u[2]", "i", "N", "h.y")  # fmt: skip
NUMBERS = ("0", "1", "2", "0.5", "-1", "1e3", "1e308", "1e-320", "1e400", "9" * 30, ".5", "5.", "1e", "0x10", "1_0",
           "1e-999999", "3j", "1.0000001", "00", "1e+2", "9**9", "1e9", "١", "²")  # fmt: skip
FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "sqrt",
             "abs", "sign", "min", "max", "dot", "cross", "norm", "distance", "rate", "d", "multiplier", "reaction",
             "eval", "__import__", "Sin", "lambda")  # fmt: skip
SIGNS = ("+", "-", "*", "/", "**", "^", "=", "==", ">=", "<=", "<", ">", "(", ")", "[", "]", ",", ".", ":", "#", "&",
         "!", "|", "{", "}", "'", '"', "%", "@", "\\", " ",
         "\n", "\t", "−", "·", "\u00a0", "\u2028", "\u202e")  # fmt: skip

noise = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cn", "Co"]), max_size=12)
raw = st.text(st.characters(codec="utf-8"), max_size=6)  # control characters too
tokens = st.sampled_from((*NAMES, *NUMBERS, *FUNCTIONS, *SIGNS))
soup = st.lists(tokens | noise, max_size=12).map("".join)


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    def joined(sign: str) -> st.SearchStrategy[str]:
        return st.tuples(inner, inner).map(lambda pair: sign.join(pair))

    call = st.tuples(st.sampled_from(FUNCTIONS), st.lists(inner, max_size=3))
    return st.one_of(
        *(joined(sign) for sign in (" + ", "-", "*", "/", "**", " - ")),
        inner.map(lambda text: f"({text})"),
        inner.map(lambda text: f"-{text}"),
        inner.map(lambda text: f"+ {text}"),
        call.map(lambda pair: f"{pair[0]}({', '.join(pair[1])})"),
        st.lists(inner, max_size=4).map(lambda parts: f"[{', '.join(parts)}]"),
    )


grammar = st.recursive(st.sampled_from((*NAMES, *NUMBERS)), _grown, max_leaves=8)
expressions = grammar | grammar | soup
wholes = st.recursive(
    st.sampled_from(("i", "j", "N", "i", "j", "0", "1", "2", "3", "7")),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from((" + ", "-", "*", "/", " - ")), inner).map("".join),
        st.tuples(inner, st.sampled_from(("2", "3", "(-1)"))).map(lambda p: f"({p[0]})**{p[1]}"),
        inner.map(lambda text: f"-({text})"),
        inner.map(lambda text: f"abs({text})"),
        st.tuples(st.sampled_from(("min", "max")), inner, inner).map(lambda p: f"{p[0]}({p[1]}, {p[2]})"),
    ),
    max_leaves=5,
)
"""Integer expressions that Python reads in the same way."""

comparisons = st.tuples(
    wholes,
    st.sampled_from((" == ", "!=", "<", " <= ", ">", " >= ")),
    wholes,
    st.sampled_from(("", "", " < N")),
).map("".join)
conditions = st.recursive(
    comparisons,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from((" and ", " or ")), inner).map("".join),
        inner.map(lambda text: f"not ({text})"),
        inner.map(lambda text: f"({text})"),
    ),
    max_leaves=3,
)
"""Filters that Python reads in the same way."""

_hostile = (
    expressions | wholes | st.sampled_from(("9**9**9", "1/0", "2**53", "2**53 + 1", "-2**53", "1e400", "N/2"))
)
ranges = st.one_of(
    st.tuples(st.sampled_from(("i = ", "j = ", "i=", "k = ", "t = ", "N = ", "")), _hostile,
              st.sampled_from(("..", " .. ", "..", ".", "...", ",")), _hostile).map("".join),
    st.sampled_from(("i = 1..N", "i = 0..1", "i = 1..2000000", "i = N..1", "i = -1..1", "j = i..N", "j = i + 1..3")),
    soup,
)  # fmt: skip
filters = st.one_of(
    conditions,
    st.tuples(
        _hostile, st.sampled_from((" == ", " < ", " = ", " and ", " not ", " or ", "")), conditions
    ).map("".join),
    soup,
)
references = st.one_of(
    st.sampled_from(
        ("p[1]", "p[i][j]", "p", "p[i].x", "all", "p[N + 1]", "u[i]", "a[1]", "p [ i ]", "p[]", "p[1, 2]")
    ),
    _hostile.map(lambda text: f"p[{text}]"),
    soup,
)
equations = st.tuples(expressions, st.sampled_from(("", " = 0", " = ", "=")), expressions).map(
    lambda parts: parts[0] if not parts[1] else "".join(parts[:2]) + (parts[2] if parts[1][-1] != "0" else "")
)

one_sided = st.tuples(
    expressions,
    st.sampled_from((" >= ", " <= ", ">=", " > ", " = ", " == ", " != ", " and ", " => ", "")),
    expressions,
).map("".join)
"""Conditions under `inequality`, and what is none."""

ODD = ("", "~", "null", "no", "true", ".inf", ".nan", "-.inf", "1e400", "-1", "0", "2", "1e99", "0.001", "&x a", "*x",
       "!!python/object:os.system a", "!t", "[", "{", "}", "]", "- a", "? a", "|", ">", "|\n   x", "'", '"', "# c", "%",
       "@", "`", "a: b", "a, b", "[1, 2]", "[1, 2, 3]", "[[1], 2, 3]", "[, 0]", "{}", "[]", "{a: 1}", "<<", "---",
       "...", "\t", "\x85", "\ufeff", '"\\x00"', '"\\ud800"', '"\\U0001F600"', "é", "all", "[all]", "[a, a]", "9" * 400,
       "2000-01-01", "0o17", "1:30", "x" * 300)  # fmt: skip

BASE: dict[str, Any] = {
    "lagcli": 1,
    "title": "T",
    "description": "long",
    "source": "book",
    "units": {"length": "cm", "mass": "g", "time": "s"},
    "parameters": {"k": 2.5, "m1": "k/2", "n3": ["0", "1", "k"], "N": 3},
    "coordinates": {"q": {"value": 0.5, "rate": 1}, "h": None},
    "particles": {
        "a": {"mass": 1, "position": [1, 0, 0], "velocity": [0, 0, 0]},
        "b": {"mass": "m1", "position": "[0, 2, 0]"},
        "c": {"mass": "k", "position": ["sin(q)", 0, "-cos(q) + t"]},
    },
    "definitions": {"half": "a.x/2 + q", "more": "half*n3"},
    "lagrangian": "rate(q)**2/2 + rate(h)**2 - h*q",
    "forces": {
        "weight": {"to": "all", "force": [0, 0, "-m*9.81"]},
        "drag": {"to": ["a", "b"], "force": "-k*v"},
        "spring": {"potential": "k/2*(distance(a, b) - 1)**2"},
        "motor": {"to": "q", "force": "sin(t)"},
    },
    "holonomic": {"rod": "norm(a) = 1", "flat": {"equation": "b.z = 0"}},
    "differential": {"roll": "d(h) - q*d(q) = 0"},
    "rigid": {"body": ["a", "b"]},
    "outputs": {"lam": "multiplier(rod)", "R": "reaction(c)", "o": "multiplier(body.1) + kinetic"},
    "simulation": {"duration": 0.1, "samples": 3, "rtol": 1e-9, "keep": ["q"], "assemble": "true"},
}
FAMILIES: dict[str, Any] = {
    "lagcli": 1,
    "parameters": {"N": 3, "k": "2.5", "half": "N/2"},
    "coordinates": {"u[i]": {"for": "i = 1..2", "value": "i/2", "rate": "N - i"}},
    "particles": {
        "p[i]": {"for": "i = 1..N", "if": "i > 0", "mass": "k*i", "position": "[i, 0, 0]"},
        "d[1]": {"mass": 1, "position": "[sin(u[1]), 0, -cos(u[1])]"},
        "d[i]": {"for": "i = 2..2", "mass": 1, "position": "d[i-1] + [sin(u[i]), 0, -cos(u[i])]"},
        "c[i][j]": {"for": ["i = 1..2", "j = i..2"], "if": "i != j", "mass": 1, "position": "[i, j, 1]"},
    },
    "definitions": {"gap": "p[2].x - p[1].x"},
    "forces": {
        "weight": {"to": "p", "force": [0, 0, "-m*9.81"]},
        "pull[i]": {"for": "i = 1..N", "to": "p[i]", "force": "-i*v"},
        "gravity[i][j]": {"for": ["i = 1..N", "j = i+1..N"], "potential": "-k/distance(p[i], p[j])"},
        "motor[i]": {"for": "i = 1..2", "to": ["u[i]"], "force": "-rate(u[i])"},
    },
    "holonomic": {"hook": "norm(p[1]) = 1",
                  "link[i]": {"for": "i = 2..N", "if": "i < N", "equation": "distance(p[i-1], p[i]) = 1"}},
    "differential": {"roll[i]": {"for": "i = 1..2", "equation": "d(c[1][2].x) - i*d(c[1][2].y) = 0"}},
    "outputs": {"o[i]": {"for": "i = 2..2", "expression": "multiplier(link[i]) + p[i].vx"}, "g": "gap"},
    "simulation": {"duration": 0.1, "samples": 3, "keep": ["u", "p[1]"]},
}  # fmt: skip
SIDED: dict[str, Any] = {
    "lagcli": 1,
    "parameters": {"N": 2, "e": 0.5},
    "particles": {
        "a": {"mass": 1, "position": [0, 0, 1], "velocity": [0, 0, -4]},
        "p[i]": {"for": "i = 1..N", "mass": 1, "position": "[2*i, 0, 3]"},
    },
    "forces": {"weight": {"to": "all", "force": [0, 0, "-m*9.81"]}},
    "inequality": {
        "floor": "a.z >= 0",
        "rope": {"condition": "norm(a) <= 2 + t", "restitution": "e"},
        "gap[i]": {"for": "i = 1..N", "if": "i > 0", "condition": "p[i].z >= 2*a.x", "restitution": "i/N*e"},
    },
    "outputs": {"push": "multiplier(floor) + reaction(p[1], gap[1]).z"},
    "events": {
        "top": {"when": "a.vz", "direction": "down"},
        "late": {"when": "push + t - 0.09", "direction": "up", "action": "stop"},
    },
    "simulation": {"duration": 0.1, "samples": 3},
}  # fmt: skip
KEYS = (*BASE, "inequality", "events", "condition", "restitution", "when", "direction", "action", "floor", "gap[i]",
        "mass", "position", "velocity", "value", "rate", "to", "force", "potential",
        "equation", "for", "if", "start", "output_step", "method", "atol", "assemble", "keep", "a", "b", "c", "q",
        "k", "p[i]", "p[i][j]", "p[2]", "p[i-1]", "u[i]", "d[i]", "link[i]", "roll[j]", "o[i]", "t",
        "all", "", " ", "1", "energy", "rod", "body", "holonomc", "Title", "é", "a b", "x" * 80)  # fmt: skip


# Sections that may be left out together without making the others wrong.
DROPPED = ((), (), ("outputs",), ("simulation", "units", "title"), ("outputs", "rigid"),
           ("outputs", "holonomic", "rigid", "differential"), ("differential", "outputs"),
           ("coordinates",), ("lagrangian",), ("definitions", "forces", "source"), ("lagcli",), ("parameters",),
           ("particles",), ("events",), ("inequality", "outputs"))  # fmt: skip


class Raw(str):
    """A text put into the document as it is, however it breaks it."""


values = st.one_of(
    st.sampled_from(ODD).map(Raw),
    expressions,
    equations,
    ranges | filters | references,
    st.integers(-(10**30), 10**30),
    st.floats(),
    noise,
    st.lists(st.sampled_from(("a", "b", "q", "1", "0", "k")), max_size=5),
)
trees = st.recursive(
    values,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(KEYS) | noise, inner, max_size=4)
    ),
    max_leaves=6,
)


@st.composite
def documents(draw: st.DrawFn) -> str:
    """A model file: a good one, with parts dropped, replaced, added, moved or doubled, or noise in its text."""
    gone = draw(st.sampled_from(DROPPED))
    base = draw(st.sampled_from((BASE, FAMILIES, SIDED)))
    tree: Any = {key: value for key, value in base.items() if key not in gone}
    for _ in range(draw(st.sampled_from((0, 1, 1, 1, 2, 3)))):
        tree = _mutated(draw, tree)
    text = _written(draw, tree, 0)
    for _ in range(draw(st.sampled_from((0, 0, 0, 0, 0, 1, 2)))):
        at, width = draw(st.integers(0, len(text))), draw(st.sampled_from((0, 0, 1, 5, 40)))
        text = text[:at] + draw(raw | noise | tokens | tokens | st.sampled_from(ODD)) + text[at + width :]
    return text


def _mutated(draw: st.DrawFn, tree: Any) -> Any:
    """The tree with one change somewhere."""
    if isinstance(tree, dict) and tree and draw(st.integers(0, 4)):
        key = draw(st.sampled_from(list(tree)))
        return {**tree, key: _mutated(draw, tree[key])}
    if isinstance(tree, list) and tree and draw(st.booleans()):
        i = draw(st.integers(0, len(tree) - 1))
        return [*tree[:i], _mutated(draw, tree[i]), *tree[i + 1 :]]
    if isinstance(tree, dict) and draw(st.booleans()):
        key = draw(st.sampled_from(KEYS) | st.sampled_from(KEYS) | noise)
        return {**tree, key: draw(trees)}
    if isinstance(tree, dict) and tree and draw(st.booleans()):
        gone = draw(st.sampled_from(list(tree)))
        return {key: value for key, value in tree.items() if key != gone}
    return draw(trees)


def _written(draw: st.DrawFn, tree: Any, depth: int) -> str:
    """The tree as YAML, in the styles YAML has."""
    if isinstance(tree, dict) and (depth < 2 or (depth < 6 and draw(st.integers(0, 3)) == 0)) and tree:
        lines = []
        for key, value in tree.items():
            inner = _written(draw, value, depth + 1)
            gap = "\n" + "  " * (depth + 1) if isinstance(value, dict) and inner[:1] not in "{" else ""
            name = key if str(key).isidentifier() else json.dumps(str(key), ensure_ascii=False)
            lines.append(f"{name}:{' ' if not gap else ''}{gap}{inner}")
        return ("\n" + "  " * depth).join(lines) + ("\n" if depth == 0 else "")
    if isinstance(tree, dict):
        inner = ", ".join(f"{key}: {_written(draw, value, 9)}" for key, value in tree.items())
        return f"{{{inner}}}"
    if isinstance(tree, list):
        return f"[{', '.join(_written(draw, item, 9) for item in tree)}]"
    if tree is None or isinstance(tree, Raw):
        return str(tree or "")
    text = str(tree)
    if not isinstance(tree, str):
        return text
    plain = text.isalnum() or draw(st.integers(0, 99)) == 37
    return text if plain else json.dumps(text, ensure_ascii=draw(st.booleans()))


# Models that read well and mean nothing good: poles, jumps, overflow, degenerate starts, laws that fight each other.
WILD_NUMBERS = ("0", "1", "2", "-1", "0.5", "1e-8", "1e8", "1e150", "1e-300", "1e308", "k", "pi", "3", "7", "1e3",
                "1.0000001", "1e9")  # fmt: skip
WILD_FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs",
                  "sign")  # fmt: skip


def _wild(leaves: tuple[str, ...]) -> st.SearchStrategy[str]:
    def grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        pair = st.tuples(inner, inner)
        return st.one_of(
            pair.map(" + ".join),
            pair.map(lambda p: f"{p[0]} - ({p[1]})"),
            pair.map(lambda p: f"({p[0]})*({p[1]})"),
            pair.map(lambda p: f"({p[0]})/({p[1]})"),
            pair.map(lambda p: f"({p[0]})**({p[1]})"),
            pair.map(lambda p: f"atan2({p[0]}, {p[1]})"),
            pair.map(lambda p: f"min({p[0]}, {p[1]})"),
            pair.map(lambda p: f"max({p[0]}, {p[1]})"),
            st.tuples(st.sampled_from(WILD_FUNCTIONS), inner).map(lambda p: f"{p[0]}({p[1]})"),
            inner.map(lambda e: f"norm(a - [{e}, 0, 1])" if "a.x" in leaves else f"-({e})"),
        )

    return st.recursive(st.sampled_from(leaves * 2 + WILD_NUMBERS), grown, max_leaves=4)


_constant = _wild(("k", "N"))
_whole = _wild(("a.x", "a.y", "q", "h", "t", "half"))
_moving = _wild(("a.x", "a.vx", "q", "rate(q)", "t", "half"))
_carrying = _wild(("q", "h", "rate(q)", "rate(h)", "t"))
_linear = st.tuples(_whole, _whole, st.sampled_from(("d({x}) - ({c})*d({y})", "({c})*d({x}) + ({e})*dt + d({y})",
                    "rate({x}) + {c}", "({c})*rate({x}) - ({e})*rate({y})", "d({c}) + d({y})")),
                    st.permutations(("a.x", "a.y", "q", "h"))).map(
    lambda p: p[2].format(c=p[0], e=p[1], x=p[3][0], y=p[3][1]))  # fmt: skip
SLOTS: tuple[tuple[tuple[str, ...], st.SearchStrategy[str]], ...] = (
    (("parameters", "k"), _wild(("1", "2"))),
    (("coordinates", "q", "value"), _constant),
    (("coordinates", "q", "rate"), _constant),
    (("particles", "a", "mass"), _constant),
    (("particles", "a", "position"), st.tuples(_constant, _constant, _constant).map(list)),
    (("particles", "a", "velocity"), st.tuples(_constant, _constant, _constant).map(list)),
    (("particles", "c", "position"), st.tuples(*[_wild(("q", "h", "t", "sin(q)"))] * 3).map(list)),
    (("definitions", "half"), _wild(("a.x", "q", "t"))),
    (("lagrangian",), _carrying.map(lambda e: f"rate(q)**2 + rate(h)**2/2 + {e}") | _carrying),
    (("forces", "f"), _whole.map(lambda e: {"potential": e})),
    (("forces", "g"), st.tuples(_moving, _moving).map(lambda p: {"to": "a", "force": [*p, "m"]})),
    (("forces", "u"), _moving.map(lambda e: {"to": ["q", "h"], "force": e})),
    (("holonomic", "rod"), _whole),
    (("holonomic", "rod2"), st.tuples(_whole, _whole).map(" = ".join)),
    (("differential", "roll"), _linear),
    (("differential", "roll2"), _linear),
    (("outputs", "o"), _moving),
    (("rigid", "body"), st.just(["a", "b"])),
    (("simulation", "assemble"), st.just("true")),
    (("simulation", "start"), _constant),
)  # fmt: skip

ONE_SIDED_SLOTS: tuple[tuple[tuple[str, ...], st.SearchStrategy[Any]], ...] = (
    (("inequality", "floor"), _whole.map(lambda e: f"{e} >= 0")),
    (("inequality", "wall"), st.tuples(_whole, _whole, _constant | st.just("0.5")).map(
        lambda p: {"condition": f"{p[0]} <= {p[1]}", "restitution": p[2]})),
    (("events", "e"), st.tuples(_moving, st.sampled_from(("up", "both")), st.sampled_from(("stop", "record"))).map(
        lambda p: {"when": p[0], "direction": p[1], "action": p[2]})),
)  # fmt: skip


@st.composite
def wild_models(
    draw: st.DrawFn, slots: tuple[tuple[tuple[str, ...], st.SearchStrategy[Any]], ...] = SLOTS
) -> str:
    """A small model with hostile formulas in some of its places."""
    tree: dict[str, Any] = {
        "lagcli": 1,
        "parameters": {"k": "2.5", "N": 3},
        "coordinates": {"q": {"value": "0.5", "rate": "1"}, "h": {}},
        "particles": {"a": {"mass": "1", "position": ["1", "0", "0"], "velocity": ["0", "0", "0"]}},
        "definitions": {"half": "q/2"},
        "lagrangian": "rate(q)**2/2 + rate(h)**2",
    }
    for path, strategy in draw(
        st.lists(st.sampled_from(slots), min_size=1, max_size=5, unique_by=lambda s: s[0])
    ):
        if path[0] == "rigid":
            tree["particles"]["b"] = {"mass": "1", "position": ["0", "1", "0"]}
        if path[:2] == ("particles", "c"):
            tree["particles"]["c"] = {"mass": "N"}
        place = tree
        for key in path[:-1]:
            place = place.setdefault(key, {})
        place[path[-1]] = draw(strategy)
    return json.dumps(tree)


_index = st.sampled_from(("i", "i", "i", "i", "i - 1", "i + 1", "N", "1", "1", "2", "2", "3", "0", "N - i + 1", "i/2",
                          "2*i", "min(i, 2)", "i**i", "1e400", "j"))  # fmt: skip
_reach = st.sampled_from(("1..N", "1..N", "1..N", "2..N", "2..N", "1..2", "1..1", "2..1", "0..N", "1..N - 1", "i..N",
                          "-1..1", "1..N/2", "1..k", "1..1e9", "1..2**53", "N..1"))  # fmt: skip
_for = st.one_of(
    *[_reach.map(lambda text: f"i = {text}")] * 4,
    st.tuples(_reach, _reach).map(lambda p: [f"i = {p[0]}", f"j = {p[1]}"]),
)


def _members(*texts: str) -> st.SearchStrategy[str]:
    """Texts with hostile indices in the places of `#` and hostile constants in those of `$`."""

    def filled(parts: tuple[str, str, str, str]) -> str:
        text, one, other, number = parts
        return text.replace("#", one, 1).replace("#", other).replace("$", number)

    return st.tuples(st.sampled_from(texts), _index, _index, _wild(("i", "k", "N"))).map(filled)


FAMILY_SLOTS: tuple[tuple[tuple[str, ...], st.SearchStrategy[Any]], ...] = (
    (("parameters", "N"), st.sampled_from(("0", "1", "2", "2", "4", "5", "-1", "2.5", "1e9", "[1, 2, 3]"))),
    (("particles", "p[i]", "for"), _for),
    (("particles", "p[i]", "if"), conditions),
    (("particles", "p[i]", "mass"), _members("$", "i", "k*(#)", "1/(i - 2)")),
    (("particles", "p[i]", "position"), _members("[#, 0, 1]", "[$, i, #]", "[i, $, 0]*(#)")),
    (("particles", "p[i]", "velocity"), _members("[0, $, 0]", "[#, 0, 1]")),
    (("particles", "d[i]"), st.tuples(_for, _members("d[#] + [q, 0, 0]", "p[#] + [$, q, 0]", "[sin(q), $, #]",
                                                     "(d[#] + d[#])/2 + [q, 0, 0]")).map(
        lambda p: {"for": p[0], "mass": "1", "position": p[1]})),
    (("particles", "d[1]"), st.just({"mass": "1", "position": "[q, 0, 0]"})),
    (("particles", "p[2]"), st.just({"mass": "1", "position": "[2, 2, 2]"})),
    (("coordinates", "u[i]"), st.tuples(_for, _members("$", "#")).map(lambda p: {"for": p[0], "value": p[1]})),
    (("lagrangian",), _members("rate(q)**2 + rate(u[1])**2 + rate(u[#])**2", "rate(q)**2 - (p[#].x)**2")),
    (("definitions", "half"), _members("p[#].x - p[#].y", "d[#].x + $")),
    (("forces", "f[i]"), st.tuples(_for, _members("p[#]", "p", "u[#]", "d[#]", "all"),
                                   _members("-v*(#)", "[$, 0, half]", "(r - p[#])*k", "$")).map(
        lambda p: {"for": p[0], "to": p[1], "force": p[2]})),
    (("forces", "g[i]"), st.tuples(_for, _members("1/distance(p[#], p[#])", "$*p[#].x", "norm(p[i] - d[#])")).map(
        lambda p: {"for": p[0], "potential": p[1]})),
    (("holonomic", "h[i]"), st.tuples(_for, _members("distance(p[#], p[#]) = $", "p[#] = p[#]", "p[#].z = $",
                                                     "norm(p[#]) = norm(p[#])", "d[#].x*p[#].y")).map(
        lambda p: {"for": p[0], "equation": p[1]})),
    (("holonomic", "h[1]"), st.just("p[1].x = 1")),
    (("differential", "w[i]"), st.tuples(_for, _members("d(p[#].x) - $*d(p[#].y)", "rate(u[#]) = rate(q)*(#)",
                                                        "dot(p[#], p[#].v) = $", "p[#].v = [0, $, 0]")).map(
        lambda p: {"for": p[0], "equation": p[1]})),
    (("outputs", "o[i]"), st.tuples(_for, _members("multiplier(h[#])", "reaction(p[#])", "p[#].v*$", "rate(u[#])")).map(
        lambda p: {"for": p[0], "expression": p[1]})),
    (("rigid", "body"), st.lists(_members("p[#]", "p[1]", "p[2]"), min_size=2, max_size=3) | st.just("p")),
    (("simulation", "assemble"), st.just("true")),
    (("simulation", "keep"), _members("p[#]", "u", "p[#].x")),
)  # fmt: skip

ONE_SIDED_FAMILY_SLOTS: tuple[tuple[tuple[str, ...], st.SearchStrategy[Any]], ...] = (
    (("inequality", "g[i]"), st.tuples(_for, _members("distance(p[#], p[#]) >= $", "p[#].z <= $", "norm(p[#]) <= $ + t",
                                                      "d[#].x >= p[#].y"), _members("$", "i/N", "1/(#)", "1")).map(
        lambda p: {"for": p[0], "condition": p[1], "restitution": p[2]})),
    (("events", "e"), _members("multiplier(g[#])", "multiplier(h[#]) - $", "p[#].vz - $").map(lambda e: {"when": e})),
)  # fmt: skip


@st.composite
def wild_families(
    draw: st.DrawFn, slots: tuple[tuple[tuple[str, ...], st.SearchStrategy[Any]], ...] = FAMILY_SLOTS
) -> str:
    """A small model of families with hostile ranges, indices and formulas in some of its places."""
    tree: dict[str, Any] = {
        "lagcli": 1,
        "parameters": {"k": "2.5", "N": "3"},
        "coordinates": {"q": {"value": "0.5", "rate": "1"}, "u[i]": {"for": "i = 1..2", "value": "i/2"}},
        "particles": {
            "p[i]": {"for": "i = 1..N", "mass": "1", "position": "[i, 0, 1/i]"},
            "d[i]": {"for": "i = 1..2", "mass": "1", "position": "[sin(u[i]), 0, i]"},
        },
        "definitions": {"half": "q/2"},
        "lagrangian": "rate(q)**2/2",
    }
    for path, strategy in draw(
        st.lists(st.sampled_from(slots), min_size=1, max_size=4, unique_by=lambda s: s[0])
    ):
        place = tree
        for key in path[:-1]:
            place = place.setdefault(key, {})
        place[path[-1]] = draw(strategy)
    return json.dumps(tree)


NUMBERS_OF_JSON = st.one_of(
    st.sampled_from(
        (
            0,
            0.0,
            -0.0,
            1,
            -1,
            0.1,
            1e-9,
            5e-324,
            1e300,
            -1e300,
            1.7976931348623157e308,
            2**53,
            2**53 + 1,
            10**30,
        )
    ),
    st.floats(),
    st.floats(-2, 2),
    st.integers(-10, 10**6),
)
_scraps = st.recursive(
    NUMBERS_OF_JSON | st.none() | st.booleans() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@st.composite
def checkpoints(
    draw: st.DrawFn, originals: Callable[[str], bytes], names: tuple[str, ...], seal: Callable[[Any], str]
) -> tuple[str, bytes]:
    """Which run a checkpoint is of, and the checkpoint: written in another way, changed or torn.

    `seal` gives the control sum, which some who change a checkpoint know how to make.
    """
    name = draw(st.sampled_from(names))
    tree = json.loads(originals(name))
    for _ in range(draw(st.sampled_from((0, 1, 1, 1, 2)))):
        tree = _changed(draw, tree)
    if isinstance(tree, dict) and draw(st.booleans()):
        tree = {**tree, "sum": seal({key: tree.get(key) for key in ("identity", "run_state")})}
    indent, by_name = draw(st.sampled_from((None, None, 1, "\t"))), draw(st.booleans())
    text = json.dumps(tree, indent=indent, sort_keys=by_name)
    for _ in range(draw(st.sampled_from((0, 0, 0, 0, 1, 2)))):
        at, width = draw(st.integers(0, len(text))), draw(st.sampled_from((0, 0, 1, 1, 5, 10**6)))
        text = (
            text[:at] + draw(noise | st.sampled_from(tuple('0123456789.eE-+,:"[]{}nN '))) + text[at + width :]
        )
    return name, text.encode(errors="surrogatepass")


def _changed(draw: st.DrawFn, tree: Any) -> Any:
    """The tree with one value changed, left out or added."""
    places = (
        list(tree) if isinstance(tree, dict) else list(range(len(tree))) if isinstance(tree, list) else []
    )
    if places and draw(st.sampled_from((*[True] * 15, False))):
        place = draw(st.sampled_from([*places, *["run_state"] * 6] if "run_state" in places else places))
        same = copy.copy(tree)
        same[place] = _changed(draw, tree[place])
        return same
    if places and draw(st.booleans()):
        same = copy.copy(tree)
        del same[draw(st.sampled_from(places))]
        return same
    if isinstance(tree, list) and draw(st.booleans()):
        return [*tree, draw(NUMBERS_OF_JSON)]
    if isinstance(tree, float) and draw(st.integers(0, 3)):
        return draw(
            NUMBERS_OF_JSON
            | st.sampled_from((tree * (1 + 1e-15), tree * 1.001, -tree, tree + 1e-6, repr(tree)))
        )
    return draw(_scraps)


wild_one_sided = wild_models((*SLOTS, *ONE_SIDED_SLOTS)).filter(
    lambda text: "inequality" in text or "when" in text
)
wild_one_sided |= wild_families((*FAMILY_SLOTS, *ONE_SIDED_FAMILY_SLOTS)).filter(
    lambda text: "inequality" in text or "when" in text
)
"""Such models with one-sided constraints or events."""
