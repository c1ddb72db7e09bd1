"""`lagcli derive`: the equations of motion of a model on standard output."""

from __future__ import annotations

import dataclasses
import shutil
import sys

from lagcli.api import derive
from lagcli.cli.terminal import exits
from lagcli.derivation import Derivation
from lagcli.model.model import Model
from lagcli.output.files import json_text

# Text is at least and at most so wide on a terminal, and WIDTH where there is none.
NARROW, WIDE, WIDTH = 60, 140, 100


DERIVE_FORMATS = ("text", "latex", "markdown", "html", "json")


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DeriveOptions:
    """Options of `derive`; `form`: one of `DERIVE_FORMATS`, `fragment`: its equations alone, `values`: names of
    parameters to put in as numbers."""

    form: str
    fragment: bool
    solve: bool
    everything: bool
    values: str
    limit: float

    def require(self) -> None:
        """Refuse a format there is not, and a fragment of one that has none."""
        if self.form not in DERIVE_FORMATS:
            raise exits.UsageError(f"--format {self.form}: the formats are {', '.join(DERIVE_FORMATS)}")
        if self.fragment and self.form != "latex":
            raise exits.UsageError("--fragment is of --format latex; the other formats are pages")


def derived(model: Model, options: DeriveOptions) -> Derivation:
    """The derivation. Raises `exits.UsageError` for values of parameters there are not, `ModelError`."""
    names = [name.strip() for name in options.values.split(",") if name.strip()]
    try:
        return derive.derive(
            model, solve=options.solve, everything=options.everything, values=names, limit=options.limit
        )
    except ValueError as error:
        raise exits.UsageError(f"--values: {error}") from None


def write(page: Derivation, chosen: str, fragment: bool) -> None:
    """Print it."""
    match chosen:
        case "latex":
            print(page.latex(fragment))
        case "markdown":
            print(page.markdown())
        case "html":
            print(page.html())
        case "json":
            print(json_text.text(page.as_json()))
        case _:
            print(page.text(_width()))


def _width() -> int:
    if not sys.stdout.isatty():
        return WIDTH
    return min(WIDE, max(NARROW, shutil.get_terminal_size().columns - 1))
