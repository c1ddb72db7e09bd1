"""Tokens -> tree, by precedence: `+ -`, then `* /`, then a sign, then `**`.

Powers group from right to left, and `-x**2` is -(x**2).
"""

from __future__ import annotations

from collections.abc import Callable

from lagcli.expression import tokens, tree
from lagcli.expression.tokens import Token
from lagcli.expression.tree import ExpressionError

MAX_DEPTH = 40

_LEAVES: dict[str, Callable[[int, int, str], tree.Node]] = {"number": tree.Number, "name": tree.Name}
_AFTER_LEAF = frozenset(("+", "-", "*", "/", ")", "]", ",", "end"))


def parse(text: str) -> tree.Node:
    """The tree of an expression without `=`. Raises `ExpressionError`."""
    return _Parser(text).whole(relations=())


def parse_equation(text: str) -> tree.Relation:
    """`left = right`; without `=` it means `expression = 0`. Raises `ExpressionError`."""
    node = _Parser(text).whole(relations=("=",))
    if isinstance(node, tree.Relation):
        return node
    return tree.Relation(node.start, node.end, node, "=", tree.Number(node.end, node.end, "0"))


def parse_condition(text: str) -> tree.Relation:
    """`left >= right` or `left <= right`. Raises `ExpressionError`."""
    node = _Parser(text).whole(relations=(">=", "<="))
    if isinstance(node, tree.Relation):
        return node
    raise ExpressionError("syntax", "a condition needs `>=` or `<=`", node.start, node.end)


class _Parser:
    """Recursive descent; every recursion passes `_nested`, which bounds its depth."""

    def __init__(self, text: str) -> None:
        self._tokens = tokens.tokenize(text)
        self._kinds = self._tokens.kinds
        self._texts = self._tokens.texts
        self._starts = self._tokens.starts
        self._at = 0
        self._depth = 0

    def whole(self, relations: tuple[str, ...]) -> tree.Node:
        """The whole text: one expression, or two with one of `relations` between."""
        if self._kinds[0] == "end":
            raise ExpressionError("syntax", "an expression is missing", 0, 1)
        left = self._sum()
        node = left
        if self._kinds[self._at] in relations:
            relation = self._next().text
            right = self._sum()
            node = tree.Relation(left.start, right.end, left, relation, right)
        if self._kinds[self._at] != "end":
            raise _surplus(self._peek(), relations)
        return node

    def _peek(self) -> Token:
        return self._tokens[self._at]

    def _next(self) -> Token:
        token = self._tokens[self._at]
        self._at += 1
        return token

    def _end(self) -> int:
        """Offset after the token before."""
        return self._starts[self._at - 1] + len(self._texts[self._at - 1])

    def _expect(self, kind: str, opened: Token) -> None:
        token = self._peek()
        if token.kind == "end":
            raise ExpressionError("syntax", f"this `{opened.text}` is never closed", opened.start, opened.end)
        if token.kind != kind:
            raise _surplus(token, ())
        self._at += 1

    def _nested(self, token: Token) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            message = f"the expression nests deeper than {MAX_DEPTH} levels"
            hint = "use `definitions` for the parts"
            raise ExpressionError("too-deep", message, token.start, token.end, hint)

    def _sum(self) -> tree.Node:
        start = self._starts[self._at]
        first = self._product()
        kinds = self._kinds
        kind = kinds[self._at]
        if kind not in ("+", "-"):
            return first
        terms = [(1, first)]
        while kind in ("+", "-"):
            self._at += 1
            terms.append((1 if kind == "+" else -1, self._product()))
            kind = kinds[self._at]
        return tree.Sum(start, self._end(), tuple(terms))

    def _product(self) -> tree.Node:
        start = self._starts[self._at]
        first = self._factor()
        kinds = self._kinds
        kind = kinds[self._at]
        if kind not in ("*", "/"):
            return first
        factors = [(1, first)]
        while kind in ("*", "/"):
            self._at += 1
            factors.append((1 if kind == "*" else -1, self._factor()))
            kind = kinds[self._at]
        return tree.Product(start, self._end(), tuple(factors))

    def _factor(self) -> tree.Node:
        """A power, or one with a sign before it."""
        at = self._at
        kind = self._kinds[at]
        if kind in ("+", "-"):
            return self._signed()
        if kind in _LEAVES and self._kinds[at + 1] in _AFTER_LEAF:
            # Most of a long formula is names and numbers that stand alone: no further call for them.
            self._at = at + 1
            text, start = self._texts[at], self._starts[at]
            return _LEAVES[kind](start, start + len(text), text)
        base = self._atom()
        if self._kinds[self._at] != "**":
            return base
        self._nested(self._next())
        exponent = self._factor()
        self._depth -= 1
        return tree.Power(self._starts[at], self._end(), base, exponent)

    def _signed(self) -> tree.Node:
        token = self._next()
        self._nested(token)
        inner = self._factor()
        self._depth -= 1
        if token.kind == "+":
            return inner
        return tree.Sum(token.start, self._end(), ((-1, inner),))

    def _atom(self) -> tree.Node:
        token = self._peek()
        if token.kind == "name":
            return self._named()
        if token.kind not in ("number", "(", "["):
            raise self._missing(token)
        self._at += 1
        if token.kind == "number":
            return tree.Number(token.start, token.end, token.text)
        self._nested(token)
        if token.kind == "(":
            inner = self._sum()
            self._expect(")", token)
        else:
            items = self._items("]", token)
            inner = tree.Vector(token.start, self._end(), items)
        self._depth -= 1
        return inner

    def _missing(self, token: Token) -> ExpressionError:
        if token.kind == "end":
            last = self._tokens[self._at - 1]
            return ExpressionError("syntax", f"the expression ends after `{last.text}`", last.start, last.end)
        hint = "write `**` for a power" if token.kind == "*" else ""
        message = f"a number, name or bracket is missing before `{token.text}`"
        return ExpressionError("syntax", message, token.start, token.end, hint)

    def _items(self, closing: str, opened: Token) -> tuple[tree.Node, ...]:
        """What stands between brackets, the opening one being read."""
        items: list[tree.Node] = []
        if self._kinds[self._at] == closing:
            self._at += 1
            return ()
        while True:
            items.append(self._sum())
            if self._kinds[self._at] != ",":
                break
            self._at += 1
        self._expect(closing, opened)
        return tuple(items)

    def _named(self) -> tree.Node:
        """A name and what hangs on it: arguments, indices, a member."""
        at = self._at
        self._at = at + 1
        name, start = self._texts[at], self._starts[at]
        following = self._kinds[at + 1]
        if following == "(":
            opened = self._next()
            self._nested(opened)
            arguments = self._items(")", opened)
            self._depth -= 1
            return tree.Call(start, self._end(), name, arguments)
        if following not in ("[", ".", "number"):
            return tree.Name(start, start + len(name), name)
        indices = self._indices()
        member = self._member()
        if indices:
            return tree.Index(start, self._end(), name, indices, member)
        if member:
            return tree.Member(start, self._end(), name, member)
        return tree.Name(start, start + len(name), name)

    def _indices(self) -> tuple[tree.Node, ...]:
        indices: list[tree.Node] = []
        while self._kinds[self._at] == "[":
            opened = self._next()
            self._nested(opened)
            indices.append(self._sum())
            self._expect("]", opened)
            self._depth -= 1
        return tuple(indices)

    def _member(self) -> str:
        """The part after a dot; `body.1` reads as a name and the number `.1`."""
        token = self._peek()
        touching = token.start == self._end()
        if token.kind == "number" and touching and token.text[0] == "." and token.text[1:].isdigit():
            self._at += 1
            return token.text[1:]
        if token.kind != ".":
            return ""
        self._at += 1
        part = self._next() if self._kinds[self._at] == "name" else None
        if part is None:
            message = f"a component is missing after `{self._tokens[self._at - 2].text}.`"
            raise ExpressionError("syntax", message, token.start, token.end, "for example `.x`")
        if self._kinds[self._at] == ".":
            extra = self._peek()
            raise ExpressionError("syntax", "only one dot may follow a name", extra.start, extra.end)
        return part.text


def _surplus(token: Token, relations: tuple[str, ...]) -> ExpressionError:
    """The error for a token that cannot go on from what stands before it."""
    hint = ""
    if token.kind == "=":
        message = "there is a second `=`" if "=" in relations else "an `=` has no place here"
    elif token.kind in (">=", "<=", "<", ">", "==", "!="):
        message = f"`{token.text}` has no place here"
        hint = "an equation has one `=`; a one-sided condition belongs under `inequality`"
    elif token.kind in (")", "]"):
        message = f"this `{token.text}` closes nothing"
    elif token.kind == ",":
        message, hint = "a comma has no place here", "a vector is written `[x, y, z]`"
    elif token.kind in ("number", "name", "(", "["):
        message = f"an operator is missing before `{token.text}`"
        hint = "write `*` for a product"
    else:
        message = f"`{token.text}` has no place here"
    return ExpressionError("syntax", message, token.start, token.end, hint)
