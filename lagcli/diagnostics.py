"""What is said to the user about a model file: located, coded, collected, and raised once.

A diagnostic is data. How it looks on a terminal is decided here too (`render`), so that every door of the
program prints the same thing; what a code means at length stands in `catalogue`.
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Iterator
from typing import Literal

Severity = Literal["error", "warning"]


@dataclasses.dataclass(frozen=True, slots=True)
class Location:
    """A stretch of one line of a file. `line` and `column` count from 1, in characters."""

    path: str
    line: int
    column: int
    length: int = 1
    source_line: str = ""


@dataclasses.dataclass(frozen=True, slots=True)
class Diagnostic:
    """One thing to say: a stable code, a sentence, where, and what may help."""

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
        lines = [f"{at.path}:{at.line}:{at.column}: {self.severity}[{self.code}]: {self.message}"]
        if at.source_line.strip():
            lines += ["    " + text for text in _excerpt(at)]
        if self.hint:
            lines.append(f"  hint: {self.hint}")
        return "\n".join(lines)


EXCERPT_WIDTH = 100


def _excerpt(at: Location) -> tuple[str, str]:
    """The source line and the caret line, cut to a window around the spot where the line is long."""
    line = "".join(c if c.isprintable() else " " for c in at.source_line)
    start = max(0, at.column - 1 - EXCERPT_WIDTH // 2) if len(line) > EXCERPT_WIDTH else 0
    window = line[start : start + EXCERPT_WIDTH]
    before, after = ("..." if start else ""), ("..." if start + EXCERPT_WIDTH < len(line) else "")
    indent = len(before) + at.column - 1 - start
    carets = max(1, min(at.length, len(window) - (at.column - 1 - start)))
    return before + window + after, " " * indent + "^" * carets


class ModelError(Exception):
    """The model is invalid; `diagnostics` holds every error found, in the order of the file."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(d.render() for d in self.diagnostics))


class Collector:
    """Gathers diagnostics so that all errors of a file are reported in one go."""

    def __init__(self) -> None:
        self._found: list[Diagnostic] = []

    def add(self, diagnostic: Diagnostic) -> None:
        """Keep a diagnostic; the same one twice is kept once."""
        if diagnostic not in self._found:
            self._found.append(diagnostic)

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._found)

    @property
    def has_errors(self) -> bool:
        """Whether anything worse than a warning was found."""
        return any(d.severity == "error" for d in self._found)

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


def nearest(word: str, known: Iterable[str]) -> str:
    """A hint naming the known word nearest to `word`, or an empty text where none is near."""
    candidates = sorted(set(known))
    folded = {c.casefold(): c for c in candidates}
    if word.casefold() in folded:
        return f"did you mean `{folded[word.casefold()]}`?"
    close = difflib.get_close_matches(word, candidates, n=1, cutoff=0.6)
    return f"did you mean `{close[0]}`?" if close else ""
