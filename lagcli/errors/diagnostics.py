"""The errors and warnings about a model file: located, coded, collected, and raised once.

How a diagnostic looks on a terminal is decided here too (`render`); what a code means at length stands in `catalogue`.
"""

from __future__ import annotations

import functools
import itertools
import pathlib
import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

from lagcli.frozen import frozen_value

Severity = Literal["error", "warning", "note"]


@frozen_value
class Location:
    """A stretch of one line of a file. `line` and `column` count from 1, in characters."""

    path: str
    line: int
    column: int
    length: int = 1
    source_line: str = ""


@frozen_value
class Diagnostic:
    """One message: a stable code, a sentence, where, and what may help."""

    code: str
    message: str
    location: Location
    hint: str = ""
    severity: Severity = "error"

    def as_json(self) -> dict[str, str | int | None]:
        """The object of the `errors` list of `--json`."""
        return {
            "code": self.code,
            "message": self.message,
            "line": self.location.line,
            "column": self.location.column,
            "path": self.location.path,
            "hint": self.hint or None,
        }

    def render(self) -> str:
        """`path:line:column: error[code]: message`, the source line, a caret under the spot, the hint."""
        at = self.location
        head = f"{at.path}:{at.line}:{at.column}: {self.severity}[{self.code}]: "
        lines = [head + _shown(self.message)]
        line = at.source_line
        if line and not line.isspace():
            # The line and a caret below it, cut to a window around the spot where the line is long. Looked at alone: a
            # line may have millions of characters, and some take no column.
            spot = min(at.column - 1, len(line))
            first, last = max(0, spot - EXCERPT_REACH), min(len(line), spot + EXCERPT_REACH)
            plain = "".join(c if c.isprintable() else " " for c in line[first:last])
            spot -= first
            start, end = _window(list(map(columns, plain)), spot, is_whole=len(plain) == len(line))
            before, after = ("..." if first + start else ""), ("..." if first + end < len(line) else "")
            indent = len(before) + columns(plain[start:spot])
            carets = max(1, columns(plain[spot : min(end, spot + at.length)]))
            lines += [f"    {before}{plain[start:end]}{after}", " " * (4 + indent) + "^" * carets]
        if self.hint:
            lines.append(f"  hint: {_shown(self.hint)}")
        return "\n".join(lines)


def printable(text: str) -> str:
    """The text without characters that a terminal would act on; line breaks stay."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


# Columns of an excerpt: with its indent it fits a terminal of 80, where a wrapped line would leave the caret behind.
EXCERPT_WIDTH = 75
# Characters of an excerpt on each side of its spot. Letters with their accents need two or three for a column.
EXCERPT_REACH = 300
SENTENCE_WIDTH = 600


def _shown(sentence: str) -> str:
    """A sentence that may quote a stranger's file: nothing in it steers the terminal or fills the screen."""
    plain = "".join(c if c.isprintable() else "\ufffd" for c in sentence[:SENTENCE_WIDTH])
    return plain + ("..." if len(sentence) > SENTENCE_WIDTH else "")


def _window(widths: list[int], spot: int, is_whole: bool) -> tuple[int, int]:
    """The characters to show, those around a spot, of a line, or of a part of it, with so many columns for each."""
    if is_whole and sum(widths) <= EXCERPT_WIDTH:
        return 0, len(widths)
    room = EXCERPT_WIDTH - 2 * len("...")
    start, used = spot, 0
    while start > 0 and used + widths[start - 1] <= room // 2:
        start -= 1
        used += widths[start]
    end = spot
    while end < len(widths) and used + widths[end] <= room:
        used += widths[end]
        end += 1
    while start > 0 and used + widths[start - 1] <= room:
        start -= 1
        used += widths[start]
    return start, end


def columns(text: str) -> int:
    """The number of columns of a terminal that a text takes."""
    import unicodedata

    return sum(
        0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text
    )


class ModelError(Exception):
    """The model is invalid; `diagnostics` holds every error found, in the order of the file."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(d.render() for d in self.diagnostics))

    def __reduce__(self) -> tuple[type[ModelError], tuple[object, ...]]:
        return type(self), (self.diagnostics,)


def error(code: str, message: str, location: Location, hint: str = "") -> ModelError:
    """The error of one message."""
    return ModelError([Diagnostic(code, message, location, hint)])


MAX_ERRORS = 1000  # of one file: nobody reads more, and each costs a look at its line


class Collector:
    """Gathers diagnostics so that all errors of a file are reported in one go.

    Beyond `MAX_ERRORS` errors no more are looked for.
    """

    def __init__(self) -> None:
        self._found: dict[Diagnostic, None] = {}
        self._errors = 0

    def add(self, diagnostic: Diagnostic) -> None:
        """Keep a diagnostic; the same one twice is kept once. Raises `ModelError` at the last allowed."""
        if diagnostic in self._found:
            return
        self._found[diagnostic] = None
        self._errors += diagnostic.severity == "error"
        if self._errors == MAX_ERRORS:
            last = _in_file_order(self._found)[-1].location
            message = f"these are the first {MAX_ERRORS} errors; no more were looked for"
            self._found[Diagnostic("too-many-errors", message, last)] = None
            self.raise_errors()

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._found)

    @property
    def has_errors(self) -> bool:
        """True if anything worse than a warning was found."""
        return self._errors > 0

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """The warnings, in the order of the file."""
        return tuple(d for d in _in_file_order(self._found) if d.severity == "warning")

    def raise_errors(self) -> None:
        """Raise `ModelError` with all errors found so far, if there are any."""
        errors = [d for d in _in_file_order(self._found) if d.severity == "error"]
        if errors:
            raise ModelError(errors)


def _in_file_order(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    return sorted(found, key=lambda d: (d.location.line, d.location.column))


MAX_CANDIDATES = 300  # of a family there may be thousands: only those that begin and end alike are compared


MAX_LISTED = 12  # names in one sentence


def listed(names: Iterable[str]) -> str:
    """Names in backquotes with commas between; of many the first ones and an ellipsis."""
    first = list(itertools.islice(names, MAX_LISTED + 1))
    shown = [f"`{name}`" for name in first[:MAX_LISTED]]
    return ", ".join(shown + ["..."] * (len(first) > MAX_LISTED))


def first_of(names: Sequence[str], rest: str = "others", most: int = 6) -> str:
    """The first names with commas between, and how many others there are."""
    more = f" and {len(names) - most} {rest}" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def nearest(word: str, known: Iterable[str]) -> str:
    """A hint naming the known word nearest to `word`, or an empty text where none is near."""
    candidates = list(known)
    if len(candidates) > MAX_CANDIDATES:
        # Distances cost; among thousands of names only those that begin and end alike are looked at.
        ends = (word[:1], word[-1:])
        alike = (c for c in candidates if (c[:1], c[-1:]) == ends and abs(len(c) - len(word)) <= 2)
        candidates = list(itertools.islice(alike, MAX_CANDIDATES))
    candidates = sorted(set(candidates))
    folded = {c.casefold(): c for c in candidates}
    if word.casefold() in folded:
        return f"did you mean `{folded[word.casefold()]}`?"
    import difflib  # of what is wrong alone

    close = difflib.get_close_matches(word[:100], candidates, n=1, cutoff=0.6)
    return f"did you mean `{close[0]}`?" if close else ""


def leave_arithmetic_unsaid() -> None:
    """For this process: no warnings of NumPy. A value that is no number is judged, and named, where it is used."""
    operations = "(overflow|underflow|invalid value|divide by zero) encountered"
    warnings.filterwarnings("ignore", operations, RuntimeWarning)


@functools.cache
def _tables() -> dict[str, dict[str, list[str]]]:
    import tomllib

    return tomllib.loads(pathlib.Path(__file__).with_name("meant.toml").read_text(encoding="utf-8"))


def meant(table: str) -> dict[str, str]:
    """Each word of a table with what is meant by it; no word of a table that there is not."""
    meanings = _tables().get(table, {})
    return {word: meaning for meaning, listed in meanings.items() for word in listed}
