"""Choice of table columns by name, as in ``--columns 't,lambda.*,R.a.*'``."""

from __future__ import annotations

import difflib
import fnmatch
import re
from collections.abc import Sequence

ACCELERATION = re.compile(r"\w+(\[\d+\])*\.a[xyz]")


class UnknownColumn(ValueError):
    """A pattern matches no column; ``nearest`` holds the known names most like it."""

    def __init__(self, pattern: str, nearest: Sequence[str]) -> None:
        self.pattern = pattern
        self.nearest = tuple(nearest)
        hint = f"; nearest: {', '.join(self.nearest)}" if self.nearest else ""
        if ACCELERATION.fullmatch(pattern):
            hint = f"; accelerations are columns where they are outputs of the model: `outputs: {{acc: {pattern}}}`"
        super().__init__(f'no column matches "{pattern}"{hint}')

    def __reduce__(self) -> tuple[type[UnknownColumn], tuple[object, ...]]:
        return type(self), (self.pattern, self.nearest)


def select(columns: Sequence[str], patterns: str, by_name: Sequence[str] = ()) -> list[int]:
    """Indices into ``columns`` of the names that the comma-separated ``patterns`` choose.

    ``*`` stands for any text and ``?`` for one character; everything else, square brackets too, stands for
    itself. The order is that of the patterns, then of the table; a column is listed once. ``by_name``: columns
    after all others that ``*`` alone leaves out, such as ``Q.theta``: a pattern must begin with their first word
    and its dot. Raises ``UnknownColumn`` for the first pattern without a match.
    """
    chosen: dict[int, None] = {}
    everything = (*columns, *by_name)
    for pattern in (part.strip() for part in patterns.split(",")):
        # fnmatch reads "[...]" as a character set; "[[]" is its way to write a literal bracket.
        is_open = re.search(r"[*?]", pattern)
        matches = (
            re.compile(fnmatch.translate(pattern.replace("[", "[[]"))).match if is_open else pattern.__eq__
        )
        found = [
            index
            for index, name in enumerate(everything)
            if matches(name) and (index < len(columns) or pattern.startswith(name.partition(".")[0] + "."))
        ]
        if not found:
            stem = re.sub(r"[*?]", "", pattern).casefold()
            names: dict[str, str] = {}
            for name in everything:
                names.setdefault(name.casefold(), name)
            raise UnknownColumn(
                pattern, [names[key] for key in difflib.get_close_matches(stem, list(names), n=3, cutoff=0.5)]
            )
        chosen.update(dict.fromkeys(found))
    return list(chosen)
