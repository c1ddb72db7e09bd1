"""Text -> tokens. A name is a letter or `_`, then letters, digits 0-9 and `_`; Unicode letters stay as typed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from lagcli.expression.tree import ExpressionError

MAX_LENGTH = 2**20

_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[^\W0-9]\w*)"
    r"|(?P<sign>\*\*|>=|<=|==|!=|[-+*/()\[\],=<>.])"
    r"|\s+"
)

HINTS = {
    "^": "write `**` for a power",
    "×": "write `*`",
    "·": "write `*`",
    "−": "this is a Unicode minus; write `-`",
    "–": "this is a dash; write `-`",
    "÷": "write `/`",
    "²": "write `**2`",
    "³": "write `**3`",
    "√": "write `sqrt(...)`",
    "&": "conditions are joined with `and`",
    "|": "write `abs(x)` for |x|, `norm(u)` for |u|",
    "{": "only round brackets group; `[x, y, z]` is a vector",
    "}": "only round brackets group; `[x, y, z]` is a vector",
    "≥": "write `>=`",
    "≤": "write `<=`",
    "'": "write `rate(x)` for a time derivative",
}


class Token(NamedTuple):
    """`kind` is `number`, `name`, `end` or the sign itself."""

    kind: str
    text: str
    start: int

    @property
    def end(self) -> int:
        """Offset after the last character."""
        return self.start + len(self.text)


def is_name(text: str) -> bool:
    """Whether `text` may be declared as a name."""
    if text.isascii():
        return text.isidentifier()
    return bool(text) and _is_letter(text[0]) and all(_is_letter(c) or c in "0123456789" for c in text)


def _is_letter(character: str) -> bool:
    return character == "_" or character.isalpha()


def tokenize(text: str) -> list[Token]:
    """All tokens with a final `end`. Raises `ExpressionError`."""
    if len(text) > MAX_LENGTH:
        message = f"the expression is longer than {MAX_LENGTH} characters"
        raise ExpressionError("expression-too-long", message, 0, 1)
    return [*_scan(text), Token("end", "", len(text))]


def _scan(text: str) -> Iterator[Token]:
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        word = match.group() if match else ""
        if match is None or (match.lastgroup == "name" and not is_name(word)):
            # `\w` takes digits of other scripts and marks; the first character that is no letter is shown.
            bad = at + next((i for i, c in enumerate(word) if not is_name("_" + c)), 0)
            character = text[bad]
            message = f"the character {character!r} has no meaning here"
            raise ExpressionError("unexpected-character", message, bad, bad + 1, HINTS.get(character, ""))
        if match.lastgroup is not None:
            yield Token(word if match.lastgroup == "sign" else match.lastgroup, word, at)
        at = match.end()
