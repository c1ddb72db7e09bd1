"""Strategies for texts that a stranger may give: expressions from the grammar and from noise, documents mutated."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import strategies as st

NAMES = ("a", "b", "q", "k", "n3", "t", "dt", "pi", "m", "r", "v", "half", "rod", "lambda", "is", "é", "_", "nope",
         "kinetic", "potential", "a.x", "a.vx", "a.v", "b.z", "q.x", "n3.y", "rod.x", "body.1", "body.9", "a.q",
         "p[1]", "p[i-1].x", "h.y")  # fmt: skip
NUMBERS = ("0", "1", "2", "0.5", "-1", "1e3", "1e308", "1e-320", "1e400", "9" * 30, ".5", "5.", "1e", "0x10", "1_0",
           "1e-999999", "3j", "1.0000001", "00", "1e+2", "9**9", "1e9", "١", "²")  # fmt: skip
FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "sqrt",
             "abs", "sign", "min", "max", "dot", "cross", "norm", "distance", "rate", "d", "multiplier", "reaction",
             "eval", "__import__", "Sin", "lambda")  # fmt: skip
SIGNS = ("+", "-", "*", "/", "**", "^", "=", "==", ">=", "<", "(", ")", "[", "]", ",", ".", ":", "#", "&", "!", "|",
         "{", "}", "'", '"', "%", "@", "\\", " ", "\n", "\t", "−", "·", "\u00a0", "\u2028", "\u202e")  # fmt: skip

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
equations = st.tuples(expressions, st.sampled_from(("", " = 0", " = ", "=")), expressions).map(
    lambda parts: parts[0] if not parts[1] else "".join(parts[:2]) + (parts[2] if parts[1][-1] != "0" else "")
)

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
KEYS = (*BASE, "inequality", "events", "mass", "position", "velocity", "value", "rate", "to", "force", "potential",
        "equation", "for", "if", "start", "output_step", "method", "atol", "assemble", "keep", "a", "b", "c", "q",
        "k", "p[i]", "t", "all", "", " ", "1", "energy", "rod", "body", "holonomc", "Title", "é", "a b",
        "x" * 80)  # fmt: skip


# Sections that may be left out together without making the others wrong.
DROPPED = ((), (), ("outputs",), ("simulation", "units", "title"), ("outputs", "rigid"),
           ("outputs", "holonomic", "rigid", "differential"), ("differential", "outputs"),
           ("lagrangian",), ("definitions", "forces", "source"), ("lagcli",), ("parameters",),
           ("particles",))  # fmt: skip


class Raw(str):
    """A text put into the document as it is, however it breaks it."""


values = st.one_of(
    st.sampled_from(ODD).map(Raw),
    expressions,
    equations,
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
    tree: Any = {key: value for key, value in BASE.items() if key not in gone}
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
    plain = text.isalnum() or draw(st.integers(0, 9)) == 0
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
)


@st.composite
def wild_models(draw: st.DrawFn) -> str:
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
        st.lists(st.sampled_from(SLOTS), min_size=1, max_size=5, unique_by=lambda s: s[0])
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
