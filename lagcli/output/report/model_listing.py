"""The text of a model in lines of pieces: keys, comments and the rest, for a page that shows it."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.output.report.report_contents import PageListing

# Lines and letters of a line that a page shows: more is a file to be looked into, and its hash names it.
MOST_LINES, MOST_LETTERS = 400, 2000
# Letters of a text whose pieces are looked for: a page of more shows it plain.
MOST_MARKED = 200_000
TAB = 8  # columns between the stops of a tabulator
COMMENT = re.compile(r"(?:(?<=\s)|(?<!.))#[^\n]*")


def listing(text: str, name: str) -> PageListing:
    """The lines of the text of a model that has been read."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n").split("\n")
    caption = f"{name}, {len(lines)} line{'s' * (len(lines) != 1)}"
    if len(lines) > MOST_LINES:
        caption += f", of which the first {MOST_LINES} are shown"
    shown = "\n".join(lines[:MOST_LINES])
    whole = text.replace("\r\n", "\n").replace("\r", "\n")
    marks = _marks(whole, name) if len(whole) <= MOST_MARKED else []
    return PageListing(tuple(_lines(shown, marks)), caption)


def _marks(text: str, name: str) -> list[tuple[int, int, str]]:
    """Stretches of the text with a look, in order and apart from each other."""
    keys: list[tuple[int, int]] = []
    scalars: list[tuple[int, int]] = []
    waiting: list[yaml_tree.AnyNode] = [yaml_tree.parse(text, name)]
    while waiting:
        match waiting.pop():
            case yaml_tree.Scalar() as one:
                scalars.append((one.start, one.end))
            case yaml_tree.Sequence() as several:
                waiting += several.items
            case yaml_tree.Mapping() as entries:
                for key, value in entries:
                    keys.append((key.start, key.end))
                    waiting.append(value)
    taken = sorted([*keys, *scalars])
    found = [(start, end, "key") for start, end in keys]
    # What stands between scalars is punctuation, and comments.
    for (_, begin), (end, _) in zip([(0, 0), *taken], [*taken, (len(text), 0)], strict=True):
        for comment in COMMENT.finditer(text, begin, max(begin, end)):
            found.append((*comment.span(), "comment"))
    return sorted(found)


def _lines(shown: str, marks: list[tuple[int, int, str]]) -> Iterator[tuple[tuple[str, str], ...]]:
    at, place = 0, 0
    for line in shown.split("\n"):
        end = at + len(line)
        pieces: list[tuple[str, str]] = []
        while place < len(marks) and marks[place][1] <= at:
            place += 1
        here, number = at, place
        while number < len(marks) and marks[number][0] < end:
            start, stop, look = max(here, marks[number][0]), min(end, marks[number][1]), marks[number][2]
            pieces += [("", shown[here:start]), (look, shown[start:stop])]
            here, number = stop, number + 1
        pieces.append(("", shown[here:end]))
        yield tuple(_cut([(look, _plain(piece)) for look, piece in pieces if piece]))
        at = end + 1


def _plain(piece: str) -> str:
    return diagnostics.printable(piece.replace("\t", " " * TAB).replace("\xa0", " "))


def _cut(pieces: list[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    room = MOST_LETTERS
    for look, piece in pieces:
        if len(piece) > room:
            yield look, f"{piece[:room]} …"
            return
        room -= len(piece)
        yield look, piece
