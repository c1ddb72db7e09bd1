"""`lagcli explain`: what a code or an equation means."""

from __future__ import annotations

import sys
import textwrap
from typing import Annotated

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics


@options.command()
def explain(
    code: Annotated[
        str | None, options.argument("CODE", "the word in brackets of a message, or D.24", completing.codes)
    ] = None,
    quiet: options.QuietOption = False,
) -> None:
    """Explain an error or warning and how to fix it, or an equation such as D.24; without CODE list all."""
    from lagcli.errors import catalogue

    if code is None:
        print("\n".join(catalogue.lines(console.width() if sys.stdout.isatty() else None)))
        if not quiet:
            exits.print_err("`lagcli explain CODE` explains one at length, `lagcli explain D.24` an equation")
        return
    try:
        equation = catalogue.line(code)
    except ValueError:
        raise exits.UsageError(f"the equations are D.1 to D.{catalogue.LAST}") from None
    if equation is not None:
        print(textwrap.fill(equation, 80), textwrap.fill(catalogue.TEXT, 80), sep="\n\n")
        return
    page = catalogue.page(code)
    if page is None:
        hint = diagnostics.nearest(code, catalogue.codes())
        hint = hint or "`lagcli explain` lists all codes with their meaning"
        raise exits.UsageError(f"unknown error code `{code}`; {hint}")
    print(catalogue.render(page))
