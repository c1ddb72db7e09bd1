"""`lagcli derive`: the equations of motion of a model on standard output."""

from __future__ import annotations

import shutil
import sys

from lagcli.api import derive
from lagcli.cli import exits, json_output
from lagcli.cli.preflight import DeriveOptions
from lagcli.derivation import Derivation
from lagcli.model.model import Model

# Text is at least and at most so wide on a terminal, and WIDTH where there is none.
NARROW, WIDE, WIDTH = 60, 140, 100


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
            print(json_output.text(page.as_json()))
        case _:
            print(page.text(_width()))


def _width() -> int:
    if not sys.stdout.isatty():
        return WIDTH
    return min(WIDE, max(NARROW, shutil.get_terminal_size().columns - 1))
