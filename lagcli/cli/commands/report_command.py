"""`lagcli report`: the page of a model in a file or on standard output."""

from __future__ import annotations

import os
import pathlib
from typing import Annotated

import typer

from lagcli.cli.commands import options
from lagcli.cli.terminal import exits
from lagcli.model import settings
from lagcli.model.settings import RunSettings
from lagcli.output.files import write_guard


@options.command()
def report(
    model: options.ModelArgument,
    output: Annotated[str, options.output("the page: .html, .md, .pdf; - for HTML on stdout")] = "-",
    title: Annotated[str | None, typer.Option(help="title of the page; by default the model's")] = None,
    *,
    run_settings: RunSettings,
    digits: Annotated[bool, "how many digits are right, from the run repeated"] = False,
    pdf: Annotated[
        str | None,
        options.named(
            "MAKER",
            "what makes a .pdf: browser or latex; by default a browser, or else latex",
            lambda: ["browser", "latex"],
        ),
    ] = None,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Write one page about a model: verdicts with proofs, count, equations, motion, audit, provenance.

    The page is written where the run stops (exit 3) and where the audit fails (exit 1) too, and says so at its top.
    """
    from lagcli.reporting import report_page

    options.require_models([model])
    target = pathlib.Path(output)
    if pdf is not None and target.suffix.lower() != ".pdf":
        raise exits.UsageError(f"--pdf {pdf}: the page is no PDF; write -o report.pdf")
    if output != "-":
        write_guard.require([("MODEL", model)], ("--output", output, report_page.FORMATS))
    if target.suffix.lower() == ".md":
        folder = report_page.figure_folder(target)
        if folder.exists() and not folder.is_dir():
            raise exits.UsageError(f"--output {output}: {folder} is needed for figures, and is no folder")
    if target.suffix.lower() == ".pdf":
        try:
            report_page.require(pdf)
        except report_page.NoPdf as error:
            raise exits.UsageError(f"--output {output}: {error}") from None
        except ValueError as error:
            raise exits.UsageError(f"--pdf: {error}") from None
    read = options.read(model, changes, False, verbose)
    from lagcli.api import report as reporting

    with options.refusals(), options.stops("report"):
        page = reporting.report(read, title=title, digits=digits, limit=limit, **run_settings)
    if output == "-":
        print(page.html(), end="")
    else:
        try:
            with write_guard.drawing(output):
                files = page.save(output, pdf)
        except report_page.NoPdf as error:
            raise write_guard.WriteError(f"cannot write {output}: {error}") from None
        if not quiet:
            exits.print_err(f"written: {', '.join(map(os.fspath, files))}")
    if page.stopped is not None:
        exits.print_err(f"lagcli: {page.stopped}")
    if not page.passed:
        exits.print_err("lagcli: the audit fails; the page says which checks")
        raise exits.Exit(exits.INVALID)
    if page.stopped is not None:
        raise exits.Exit(exits.STOPPED)
