"""`lagcli report`: its options."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands.options import (
    AssembleOption,
    DebugOption,
    LimitOption,
    ModelArgument,
    QuietOption,
    SetOption,
    VerboseOption,
)
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.model import settings


@exits.command
def report(
    model: ModelArgument,
    output: Annotated[
        str,
        typer.Option(
            "-o", "--output", metavar="FILE", help="the page: .html, .md, .pdf; - for HTML on stdout"
        ),
    ] = "-",
    title: Annotated[str | None, typer.Option(help="title of the page; by default the model's")] = None,
    duration: Annotated[float | None, typer.Option(help="length of the run")] = None,
    samples: Annotated[int | None, typer.Option(help="number of rows of the run, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance of the run")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance of the run")] = None,
    max_step: Annotated[float | None, typer.Option("--max-step", help="no step of the run is longer")] = None,
    assemble: AssembleOption = False,
    digits: Annotated[
        bool, typer.Option("--digits", help="how many digits are right, from the run repeated")
    ] = False,
    pdf: Annotated[
        str | None,
        typer.Option(
            "--pdf",
            metavar="MAKER",
            help="what makes a .pdf: browser or latex; by default a browser, or else latex",
            autocompletion=lambda: ["browser", "latex"],
        ),
    ] = None,
    limit: LimitOption = settings.LIMIT,
    changes: SetOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Write one page about a model: verdicts with proofs, count, equations, motion, audit, provenance.

    The page is written where the run stops (exit 3) and where the audit fails (exit 1) too, and says so at its top.
    """
    from lagcli.cli.actions import report_command

    options = report_command.ReportOptions(output, title, digits, limit, quiet, pdf)
    options.require(model)
    read = model_reading.read(model, changes, False, verbose)
    given: report_command.ReportedRun = {
        "duration": duration, "samples": samples, "rtol": rtol, "atol": atol, "max_step": max_step,
        "assemble": True if assemble else None,
    }  # fmt: skip
    report_command.run(read, given, options)
