"""The pages of `lagcli explain`: what each diagnostic code means, why it is given, an example and how to fix it.

One file a code, `pages/CODE.toml`; the sentence that names the spot in a user's file is worded where it is found.
A page has the keys

- `meaning`, `why`, `fix`: sentences; line breaks in them count as spaces.
- `example`: a model that gives this code and no other error; `old` a part of it, and `new` what fixes it.
- `severity`: "error" unless it is a "warning" or "note" of a model, or the "stop" of a run.
- `stage`: where the code arises: while the model is "read" (unless another is given), at the "start" of a count or
  run, in a "run", or from an "input" that is no text of a page (a directory, a huge file); then the example is what
  was typed.
"""

from __future__ import annotations

import dataclasses
import functools
import pathlib
import textwrap
import tomllib
from typing import Literal

from lagcli import memory
from lagcli.errors import diagnostics

Stage = Literal["input", "read", "start", "run"]
Severity = diagnostics.Severity | Literal["stop"]

FOLDER = pathlib.Path(__file__).parent / "pages"
WIDTH = 100  # columns of a page of `explain`
SENTENCES = ("meaning", "why", "fix")


@dataclasses.dataclass(frozen=True, slots=True)
class Page:
    """A diagnostic code at length; the keys are those of its file."""

    code: str
    meaning: str
    why: str
    example: str
    fix: str
    old: str = ""
    new: str = ""
    severity: Severity = "error"
    stage: Stage = "read"

    @property
    def fixed(self) -> str:
        """The example after the fix."""
        return self.example.replace(self.old, self.new, 1) if self.old else self.new or self.example

    @property
    def fixed_lines(self) -> tuple[str, ...]:
        """The lines of the fixed example that the example does not have."""
        written = self.example.splitlines()
        return tuple(line for line in self.fixed.splitlines() if line not in written)


def page(code: str) -> Page | None:
    """The page of a code, or None where there is no such code."""
    return _read(code) if code in codes() else None


@functools.cache
def codes() -> tuple[str, ...]:
    """All codes, in the order of the alphabet."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def lines(columns: int | None = None) -> list[str]:
    """All codes, each with its meaning on the same line, and with its severity where that is not an error.

    columns: where lines are folded.
    """
    width = max(map(len, codes())) + 2
    found = []
    for code in codes():
        one = _read(code)
        line = f"{code:{width}}" + ("" if one.severity == "error" else f"({one.severity}) ") + one.meaning
        whole = [line] if columns is None else textwrap.wrap(line, columns, subsequent_indent=" " * width)
        found.append("\n".join(whole))
    return found


def render(page: Page) -> str:
    """A page as plain text."""
    parts = [
        f"{page.severity}[{page.code}]",
        textwrap.fill(page.meaning, WIDTH),
        "Why:\n" + textwrap.fill(page.why, WIDTH, initial_indent="  ", subsequent_indent="  "),
        "Example:\n" + textwrap.indent(page.example.rstrip() or "(an empty file)", "    "),
        "Fix:\n" + textwrap.fill(page.fix, WIDTH, initial_indent="  ", subsequent_indent="  "),
    ]
    if page.fixed_lines:
        parts.append(textwrap.indent("\n".join(page.fixed_lines), "    "))
    return "\n\n".join(parts)


@memory.remembered()
def _read(code: str) -> Page:
    keys = tomllib.loads((FOLDER / f"{code}.toml").read_text(encoding="utf-8"))
    return Page(code, **keys | {key: " ".join(keys[key].split()) for key in SENTENCES})
