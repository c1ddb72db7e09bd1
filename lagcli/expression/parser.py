"""Tokens -> tree, by precedence: `+ -`, then `* /`, then a sign, then `**`.

Powers group from right to left, and `-x**2` is -(x**2).
"""

from __future__ import annotations

from collections.abc import Callable

from lagcli.expression import hints, tokens, tree
from lagcli.expression.tokens import Token
from lagcli.expression.tree import ExpressionError

MAX_DEPTH = 40  # levels of brackets: each takes some frames of the stack, which no text may overflow

_LEAVES: dict[str, Callable[[int, int, str], tree.Node]] = {"number": tree.Number, "name": tree.Name}
_SEVERAL = 'several ranges are a list: `["i = 1..N", "j = 1..M"]`'
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
    """`left >= right`, and `left <= right` turned round to `right >= left`. Raises `ExpressionError`."""
    return _ConditionParser(text).condition()


def parse_crossing(text: str) -> tree.Node:
    """An expression that is looked at where it crosses zero. Raises `ExpressionError`."""
    return _CrossingParser(text).whole(relations=())


def parse_range(text: str) -> tree.Range:
    """`i = 1..N`: the name of an index and the expressions of its bounds. Raises `ExpressionError`."""
    return _Parser(text).range()


def parse_filter(text: str) -> tree.Node:
    """Comparisons joined with `and`, `or`, `not` and parentheses. Raises `ExpressionError`."""
    return _FilterParser(text).filter()


def parse_reference(text: str) -> tree.Name | tree.Index:
    """A name with or without indices: `a`, `p[i]`, `p[i][j+1]`. Raises `ExpressionError`."""
    node = _Parser(text).whole(relations=())
    bare = text.strip() == text[node.start : node.end]
    if bare and (isinstance(node, tree.Name) or (isinstance(node, tree.Index) and not node.member)):
        return node
    if isinstance(node, (tree.Index, tree.Member)) and node.member:
        message = f"only a name is allowed here, without `.{node.member}`"
        raise ExpressionError("syntax", message, node.end - len(node.member) - 1, node.end)
    message, hint = "only a name is allowed here", "for example `a`, or `p[1]` of a family `p`"
    raise ExpressionError("syntax", message, 0, len(text), hint)


class _Parser:
    """Recursive descent; every recursion passes `_nested`, which bounds its depth."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._kinds, self._texts, self._starts = tokens.tokenize(text)
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
            raise self._unexpected(relations)
        return node

    def range(self) -> tree.Range:
        hint = "a range is written `i = 1..N`"
        name = self._peek()
        if name.kind == "end":
            raise ExpressionError("syntax", "a range is missing", 0, 1, hint)
        if name.kind != "name":
            message = f"a range begins with the name of its index, not with `{name.text}`"
            raise ExpressionError("syntax", message, name.start, name.end, hint)
        self._at += 1
        sign = self._peek()
        if sign.kind != "=":
            spot = name if sign.kind == "end" else sign
            message = f"an `=` is missing after `{name.text}`"
            raise ExpressionError("syntax", message, spot.start, spot.end, hint)
        low = self._bound("lower", hint)
        dots = self._peek()
        if dots.kind != "..":
            spot = sign if dots.kind == "end" else dots
            hint = _SEVERAL if dots.kind == "," else hint
            message = "two dots `..` are missing after the lower bound of the range"
            raise ExpressionError("syntax", message, spot.start, spot.end, hint)
        high = self._bound("upper", hint)
        last = self._peek()
        if last.kind == ",":
            raise ExpressionError("syntax", "one range ends here", last.start, last.end, _SEVERAL)
        if last.kind != "end":
            raise self._unexpected()
        return tree.Range(name.start, high.end, name.text, low, high)

    def _bound(self, which: str, hint: str) -> tree.Node:
        """A bound of a range, after the sign that announces it."""
        before = self._next()
        if self._kinds[self._at] in ("..", "end"):
            message = f"the {which} bound of the range is missing after `{before.text}`"
            raise ExpressionError("syntax", message, before.start, before.end, hint)
        return self._sum()

    def _peek(self, back: int = 0) -> Token:
        """The token here, or one before it."""
        at = self._at - back
        return Token(self._kinds[at], self._texts[at], self._starts[at])

    def _next(self) -> Token:
        self._at += 1
        return self._peek(1)

    def _end(self) -> int:
        return self._starts[self._at - 1] + len(self._texts[self._at - 1])

    def _expect(self, kind: str, opened: Token) -> None:
        token = self._peek()
        if token.kind == "end":
            raise ExpressionError("syntax", f"this `{opened.text}` is never closed", opened.start, opened.end)
        if token.kind != kind:
            raise self._unexpected()
        self._at += 1

    def _unexpected(self, relations: tuple[str, ...] = ()) -> ExpressionError:
        """The error for the token here, which cannot go on from what stands before it."""
        token, hint = self._peek(), ""
        if token.kind == "=":
            message, hint = "an `=` has no place here", "a formula has no `=`; an equation is a constraint"
            if "=" in relations:
                message, hint = "there is a second `=`", "each equation has an entry of its own"
        elif token.kind in (">=", "<=", "<", ">", "==", "!="):
            message = f"`{token.text}` has no place here"
            hint = hints.relation(token.kind, "=" in relations)
        elif token.kind in (")", "]"):
            message = f"this `{token.text}` closes nothing"
        elif token.kind == ",":
            message = "a comma has no place here"
            # One comma may be a decimal one, and two are those of a vector.
            is_decimal = self._kinds[self._at + 1] == "number" and self._kinds[self._at + 2] != ","
            following = self._texts[self._at + 1] if is_decimal else ""
            hint = hints.comma(self._before(1), following)
        elif token.kind == "..":
            message, hint = "`..` has no place here", "a range `i = 1..N` belongs under `for`"
        elif token.kind in ("number", "name", "(", "["):
            message = f"an operator is missing before `{token.text}`"
            hint = hints.between(self._before(1), (token.kind, token.text), self._before(2))
        else:
            message = f"`{token.text}` has no place here"
        return ExpressionError("syntax", message, token.start, token.end, hint)

    def _before(self, count: int) -> tuple[str, str]:
        """Kind and text of the token so many tokens before this one; empty where there is none."""
        index = self._at - count
        return (self._kinds[index], self._texts[index]) if index >= 0 else ("", "")

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
        at = self._at
        kind = self._kinds[at]
        if kind in ("+", "-"):
            token = self._next()
            self._nested(token)
            inner = self._factor()
            self._depth -= 1
            return inner if kind == "+" else tree.Sum(token.start, self._end(), ((-1, inner),))
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

    def _atom(self) -> tree.Node:
        token = self._peek()
        if token.kind == "name":
            return self._named()
        if token.kind == "end":
            last = self._peek(1)
            message = f"the expression ends after `{last.text}`"
            raise ExpressionError("syntax", message, last.start, last.end)
        if token.kind not in ("number", "(", "["):
            hint = {
                "*": "write `**` for a power",
                ".": "a range has two dots: `1..N`",
                "=": "the value alone is written after the colon" if self._at == 0 else "",
            }.get(token.kind, "")
            message = f"a number, name or bracket is missing before `{token.text}`"
            raise ExpressionError("syntax", message, token.start, token.end, hint)
        self._at += 1
        if token.kind == "number":
            return tree.Number(token.start, token.end, token.text)
        self._nested(token)
        if token.kind == "(":
            inner = self._grouped()
            self._expect(")", token)
            inner = self._component(token.start, inner)
        else:
            items = self._items("]", token)
            inner = tree.Vector(token.start, self._end(), items)
        self._depth -= 1
        return inner

    def _grouped(self) -> tree.Node:
        return self._sum()

    def _items(self, closing: str, opened: Token) -> tuple[tree.Node, ...]:
        """The items between brackets, the opening one being read."""
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
        at = self._at
        self._at = at + 1
        name, start = self._texts[at], self._starts[at]
        following = self._kinds[at + 1]
        if following == "(":
            opened = self._next()
            self._nested(opened)
            arguments = self._items(")", opened)
            self._depth -= 1
            return self._component(start, tree.Call(start, self._end(), name, arguments))
        if following not in ("[", ".", "number"):
            return tree.Name(start, start + len(name), name)
        indices: list[tree.Node] = []
        while self._kinds[self._at] == "[":
            opened = self._next()
            self._nested(opened)
            if self._kinds[self._at] == "]":
                message, end = "an index is missing between the brackets", self._peek().end
                raise ExpressionError("syntax", message, opened.start, end, "for example `p[1]`")
            indices.append(self._sum())
            if self._kinds[self._at] == ",":
                message, comma = "each index has brackets of its own", self._peek()
                raise ExpressionError("syntax", message, comma.start, comma.end, "write `p[1][2]`")
            self._expect("]", opened)
            self._depth -= 1
        member = self._member()
        if not (indices or member):
            return tree.Name(start, start + len(name), name)
        end = self._end()
        node = (
            tree.Index(start, end, name, tuple(indices), member)
            if indices
            else tree.Member(start, end, name, member)
        )
        # `crank.pin.x`; of what is no body it is refused where names are known.
        return self._component(start, node)

    def _component(self, start: int, vector: tree.Node) -> tree.Node:
        """The expression that a closing parenthesis ends, or a component of it: `reaction(a).x`."""
        if self._kinds[self._at] != ".":
            return vector
        member = self._member()
        return tree.Component(start, self._end(), vector, member)

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
            message = f"a component is missing after `{self._texts[self._at - 2]}.`"
            raise ExpressionError("syntax", message, token.start, token.end, "for example `.x`")
        return part.text


_COMPARISONS = ("==", "!=", "<", "<=", ">", ">=")
_RELATIONS = (*_COMPARISONS, "=")
_JOINTS = ("and", "or", "not")
_TRUTHS = (tree.ComparisonNode, tree.Logical)


class _ConditionParser(_Parser):
    def condition(self) -> tree.Relation:
        """The whole text as a condition, so that left - right is not negative."""
        if self._kinds[0] == "end":
            raise ExpressionError("syntax", "a condition is missing", 0, 1, "for example `a.z >= 0`")
        left = self._sum()
        sign = self._peek()
        if sign.kind == "end":
            message, shown = "a condition needs `>=` or `<=`", self._text[left.start : left.end]
            hint = f"for example `{shown} >= 0`" if len(shown) < 60 else ""
            raise ExpressionError("bad-condition", message, left.start, left.end, hint)
        if sign.kind not in (">=", "<="):
            raise self._unexpected()
        self._at += 1
        right = self._sum()
        if self._kinds[self._at] != "end":
            raise self._unexpected()
        one, other = (left, right) if sign.kind == ">=" else (right, left)
        return tree.Relation(left.start, right.end, one, ">=", other)

    def _unexpected(self, relations: tuple[str, ...] = ()) -> ExpressionError:
        token = self._peek()
        is_second = any(kind in _RELATIONS for kind in self._kinds[: self._at])
        if token.kind in _RELATIONS or (token.kind == "name" and token.text in _JOINTS):
            message, hint = hints.condition(token.text, is_second, self._texts[self._at + 1])
            return ExpressionError("bad-condition", message, token.start, token.end, hint)
        return super()._unexpected(relations)


class _CrossingParser(_Parser):
    def _unexpected(self, relations: tuple[str, ...] = ()) -> ExpressionError:
        token = self._peek()
        if token.kind in _RELATIONS:
            message = f"`{token.text}` has no place here: an event is where its expression crosses zero"
            return ExpressionError("syntax", message, token.start, token.end, hints.crossing(token.kind))
        return super()._unexpected(relations)


class _FilterParser(_Parser):
    """Above sums there are comparisons, `not`, `and`, `or`. What a parenthesis holds is known only after it is read, so
    truths and numbers are told apart at the end: no text is read twice."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        for i, kind in enumerate(self._kinds):
            if kind == "name" and self._texts[i] in _JOINTS:
                self._kinds[i] = self._texts[i]

    def filter(self) -> tree.Node:
        if self._kinds[0] == "end":
            raise ExpressionError("syntax", "a filter is missing", 0, 1, "for example `i != j`")
        node = self._grouped()
        if self._kinds[self._at] != "end":
            raise self._unjoined(self._peek())
        self._require_kind(node, is_truth=True)
        for part in tree.walk(node):
            for child in tree.children(part):
                self._require_kind(child, isinstance(part, tree.Logical))
        return node

    @staticmethod
    def _require_kind(node: tree.Node, is_truth: bool) -> None:
        if isinstance(node, _TRUTHS) != is_truth:
            message, hint = "a comparison is needed here", "for example `i != j`, `i < N`"
            if not is_truth:
                message = "a number is needed here, and this is a comparison"
                hint = "comparisons are joined with `and`, `or`, `not`"
            raise ExpressionError("syntax", message, node.start, node.end, hint)

    def _joined(self, word: str, part: Callable[[], tree.Node]) -> tree.Node:
        start = self._starts[self._at]
        parts = [part()]
        while self._kinds[self._at] == word:
            self._at += 1
            parts.append(part())
        return tree.Logical(start, self._end(), word, tuple(parts)) if len(parts) > 1 else parts[0]

    def _negated(self) -> tree.Node:
        start = self._starts[self._at]
        if self._kinds[self._at] == "not":
            word = self._next()
            self._nested(word)
            inner = self._negated()
            self._depth -= 1
            return tree.Logical(start, self._end(), "not", (inner,))
        operands, relations = [self._sum()], []
        while self._kinds[self._at] in _COMPARISONS:
            relations.append(self._next().text)
            operands.append(self._sum())
        if not relations:
            return operands[0]
        return tree.ComparisonNode(start, self._end(), tuple(operands), tuple(relations))

    def _grouped(self) -> tree.Node:
        return self._joined("or", lambda: self._joined("and", self._negated))

    def _expect(self, kind: str, opened: Token) -> None:
        token = self._peek()
        if token.kind not in (kind, "end"):
            raise self._unjoined(token)
        super()._expect(kind, opened)

    def _unjoined(self, token: Token) -> ExpressionError:
        if token.kind == "=":
            message, hint = "a single `=` does not compare", "write `==`"
        elif token.kind in ("name", "not"):
            message, hint = f"an `and` or `or` is missing before `{token.text}`", ""
        else:
            return self._unexpected()
        return ExpressionError("syntax", message, token.start, token.end, hint)
