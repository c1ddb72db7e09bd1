"""Text -> tokens. A name is a letter or `_`, then letters, digits 0-9 and `_`; letters stay as typed."""

from __future__ import annotations

import itertools
import re

from lagcli.expression import hints
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen_value

MAX_LENGTH = 2**20  # letters: no formula is a megabyte long

# Every character belongs to some match, so that the lengths of the matches add up to offsets.
# A number takes no dot that another dot follows: `1..N` is a range.
_WORD = re.compile(
    r"""[^\W0-9]\w*
    | (?:[0-9]+(?:\.(?!\.)[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?
    | \*\*|>=|<=|==|!=|\.\.
    | \s+
    | .""",
    re.VERBOSE | re.DOTALL,
)
_DIGITS = frozenset("0123456789")
_SIGNS = frozenset(("**", ">=", "<=", "==", "!=", "..", *"-+*/()[],=<>."))


@frozen_value
class Token:
    """One token. `kind` is `number`, `name`, `end` or the sign itself."""

    kind: str
    text: str
    start: int

    @property
    def end(self) -> int:
        return self.start + len(self.text)


def is_name(text: str) -> bool:
    """True if `text` may be declared as a name."""
    if text.isascii():
        return text.isidentifier()
    return text[:1] not in _DIGITS and all(c == "_" or c.isalpha() or c in _DIGITS for c in text)


def has_size(number: str) -> bool:
    """True if a number has a digit before its exponent that is not 0."""
    return re.match("[0.]*[1-9]", number) is not None


def tokenize(text: str) -> tuple[list[str], list[str], list[int]]:
    """Kinds, texts and starts of all tokens of a text, with a final one of kind `end`. Raises `ExpressionError`."""
    if len(text) > MAX_LENGTH:
        message = f"the expression is longer than {MAX_LENGTH} characters"
        raise ExpressionError("expression-too-long", message, 0, 1, "use `definitions` for the parts")
    words = _WORD.findall(text)
    starts = [0, *itertools.accumulate(map(len, words))]
    kind_of = {word: _kind(word) for word in set(words)}
    if "" in kind_of.values():
        word, start = next((word, at) for word, at in zip(words, starts, strict=False) if not kind_of[word])
        # `\w` takes digits of other scripts too; the first character that is no part of a name is shown.
        index = next((i for i, c in enumerate(word) if not is_name("_" + c)), 0)
        message, at = f"the character {word[index]!r} has no meaning here", start + index
        raise ExpressionError("unexpected-character", message, at, at + 1, hints.character(text, at))
    kinds = [kind_of[word] for word in words]
    if "space" in kind_of.values():
        is_token = [kind != "space" for kind in kinds]
        words = list(itertools.compress(words, is_token))
        starts = [*itertools.compress(starts, is_token), len(text)]
        kinds = list(itertools.compress(kinds, is_token))
    return [*kinds, "end"], [*words, ""], starts


def called(text: str) -> frozenset[str]:
    """The names that a text calls, whether it is an expression or none."""
    words = [word for word in _WORD.findall(text) if not word.isspace()]
    return frozenset(name for name, sign in itertools.pairwise(words) if sign == "(" and is_name(name))


def _kind(word: str) -> str:
    """The kind of a word; empty where it has no meaning."""
    if word in _SIGNS:
        return word
    if word[0] in ".0123456789":  # signs are split off before
        return "number"
    if word.isspace():
        return "space"
    return "name" if is_name(word) else ""
