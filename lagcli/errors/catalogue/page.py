"""The shape of a page."""

from __future__ import annotations

import dataclasses
from typing import Literal

from lagcli.errors import diagnostics

Stage = Literal["input", "read", "start", "run"]
Severity = diagnostics.Severity | Literal["stop"]


@dataclasses.dataclass(frozen=True, slots=True)
class Page:
    """One diagnostic code at length.

    `example` is a model that gives this code and no other error, `old` a part of it and `new` what cures it.
    `stage` says where the code arises: while the model is `read`, at the `start` of a count or run, or in a `run`.
    Where it arises from an `input` that is no text of a page (a directory, a huge file), the example is what was typed.
    """

    code: str
    meaning: str
    why: str
    example: str
    cure: str
    old: str = ""
    new: str = ""
    severity: Severity = "error"
    stage: Stage = "read"

    @property
    def mended(self) -> str:
        """The example with the cure."""
        return self.example.replace(self.old, self.new, 1) if self.old else self.new or self.example

    @property
    def mended_lines(self) -> tuple[str, ...]:
        """The lines of the cure that the example does not have."""
        written = self.example.splitlines()
        return tuple(line for line in self.mended.splitlines() if line not in written)
