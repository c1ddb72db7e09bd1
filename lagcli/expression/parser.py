"""Tokens -> tree, by precedence: `+ -`, then `* /`, then unary `-`, then `**` (right to left, `-x**2` is -(x**2))."""

from __future__ import annotations

from lagcli.expression import tokens, tree
from lagcli.expression.tokens import Token
from lagcli.expression.tree import ExpressionError

MAX_DEPTH = 40

_STARTERS = ("number", "name", "(", "[", "+", "-")


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
        self._at = 0
        self._depth = 0

    def whole(self, relations: tuple[str, ...]) -> tree.Node:
        """The whole text: one expression, or two with one of `relations` between."""
        if self._peek().kind == "end":
            raise ExpressionError("syntax", "an expression is missing", 0, 1)
        left = self._sum()
        node = left
        if self._peek().kind in relations:
            relation = self._next().text
            right = self._sum()
            node = tree.Relation(left.start, right.end, left, relation, right)
        rest = self._peek()
        if rest.kind != "end":
            raise self._surplus(rest, relations)
        return node

    def _surplus(self, token: Token, relations: tuple[str, ...]) -> ExpressionError:
        def trouble(message: str, hint: str = "") -> ExpressionError:
            return ExpressionError("syntax", message, token.start, token.end, hint)

        if token.kind == "=":
            message = "there is a second `=`" if "=" in relations else "an `=` has no place here"
            return trouble(message)
        if token.kind in (">=", "<=", "<", ">", "==", "!="):
            hint = "an equation has one `=`; a one-sided condition belongs under `inequality`"
            return trouble(f"`{token.text}` has no place here", hint)
        if token.kind == ")":
            return trouble("this `)` closes nothing")
        if token.kind == "]":
            return trouble("this `]` closes nothing")
        if token.kind == ",":
            return trouble("a comma has no place here", "a vector is written `[x, y, z]`")
        if token.kind in ("number", "name", "(", "["):
            return trouble(f"an operator is missing before `{token.text}`", "write `*` for a product")
        return trouble(f"`{token.text}` has no place here")

    def _peek(self) -> Token:
        return self._tokens[self._at]

    def _next(self) -> Token:
        token = self._tokens[self._at]
        self._at += 1
        return token

    def _expect(self, kind: str, opened: Token) -> Token:
        token = self._peek()
        if token.kind == kind:
            return self._next()
        if token.kind == "end":
            raise ExpressionError("syntax", f"this `{opened.text}` is never closed", opened.start, opened.end)
        raise self._surplus(token, ())

    def _nested(self, token: Token) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            message = f"the expression nests deeper than {MAX_DEPTH} levels"
            raise ExpressionError("too-deep", message, token.start, token.end, "use `definitions` for the parts")

    def _sum(self) -> tree.Node:
        terms = [(1, self._product())]
        while self._peek().kind in ("+", "-"):
            sign = 1 if self._next().kind == "+" else -1
            terms.append((sign, self._product()))
        if len(terms) == 1:
            return terms[0][1]
        return tree.Sum(terms[0][1].start, terms[-1][1].end, tuple(terms))

    def _product(self) -> tree.Node:
        factors = [(1, self._signed())]
        while self._peek().kind in ("*", "/"):
            exponent = 1 if self._next().kind == "*" else -1
            factors.append((exponent, self._signed()))
        if len(factors) == 1:
            return factors[0][1]
        return tree.Product(factors[0][1].start, factors[-1][1].end, tuple(factors))

    def _signed(self) -> tree.Node:
        if self._peek().kind not in ("+", "-"):
            return self._power()
        token = self._next()
        self._nested(token)
        inner = self._signed()
        self._depth -= 1
        if token.kind == "+":
            return inner
        return tree.Sum(token.start, inner.end, ((-1, inner),))

    def _power(self) -> tree.Node:
        base = self._atom()
        if self._peek().kind != "**":
            return base
        self._nested(self._next())
        exponent = self._signed()
        self._depth -= 1
        return tree.Power(base.start, exponent.end, base, exponent)

    def _atom(self) -> tree.Node:
        token = self._peek()
        if token.kind not in _STARTERS:
            raise self._missing(token)
        self._next()
        if token.kind == "number":
            return tree.Number(token.start, token.end, token.text)
        if token.kind == "name":
            return self._named(token)
        self._nested(token)
        if token.kind == "(":
            inner = self._sum()
            self._expect(")", token)
        else:
            items = self._items("]", token)
            inner = tree.Vector(token.start, self._tokens[self._at - 1].end, items)
        self._depth -= 1
        return inner

    def _missing(self, token: Token) -> ExpressionError:
        if token.kind == "end":
            last = self._tokens[max(0, self._at - 1)]
            return ExpressionError("syntax", f"the expression ends after `{last.text}`", last.start, last.end)
        hint = "write `**` for a power" if token.kind == "*" else ""
        return ExpressionError(
            "syntax", f"a number, name or bracket is missing before `{token.text}`", token.start, token.end, hint
        )

    def _items(self, closing: str, opened: Token) -> tuple[tree.Node, ...]:
        items: list[tree.Node] = []
        if self._peek().kind == closing:
            self._next()
            return ()
        while True:
            items.append(self._sum())
            if self._peek().kind != ",":
                break
            self._next()
        self._expect(closing, opened)
        return tuple(items)

    def _named(self, token: Token) -> tree.Node:
        following = self._peek()
        if following.kind == "(":
            self._nested(following)
            self._next()
            arguments = self._items(")", following)
            self._depth -= 1
            return tree.Call(token.start, self._tokens[self._at - 1].end, token.text, arguments)
        indices: list[tree.Node] = []
        while self._peek().kind == "[":
            opened = self._next()
            self._nested(opened)
            indices.append(self._sum())
            self._expect("]", opened)
            self._depth -= 1
        end = self._tokens[self._at - 1].end
        member = self._member(token)
        if indices:
            return tree.Index(token.start, max(end, self._tokens[self._at - 1].end), token.text, tuple(indices), member)
        if member:
            return tree.Member(token.start, self._tokens[self._at - 1].end, token.text, member)
        return tree.Name(token.start, token.end, token.text)

    def _member(self, owner: Token) -> str:
        """The part after a dot; `body.1` reads as a name and the number `.1`."""
        token = self._peek()
        touching = token.start == self._tokens[self._at - 1].end
        if token.kind == "number" and touching and token.text[0] == "." and token.text[1:].isdigit():
            return self._next().text[1:]
        if token.kind != ".":
            return ""
        self._next()
        part = self._next() if self._peek().kind == "name" else None
        if part is None:
            message = f"a component is missing after `{owner.text}.`"
            raise ExpressionError("syntax", message, token.start, token.end, "for example `.x`")
        if self._peek().kind == ".":
            extra = self._peek()
            raise ExpressionError("syntax", "only one dot may follow a name", extra.start, extra.end)
        return part.text
