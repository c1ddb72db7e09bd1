"""`lagcli check`: its options."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from lagcli.cli import completing, exits, json_output, model_reading
from lagcli.cli.options import (
    AssembleOption,
    DebugOption,
    JsonOption,
    LimitOption,
    QuietOption,
    SetOption,
    VerboseOption,
)
from lagcli.errors import diagnostics
from lagcli.model import settings


@exits.command
def check(
    models: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL...",
            help="model files; - for standard input",
            autocompletion=completing.model_files,
        ),
    ],
    changes: SetOption = None,
    as_json: JsonOption = False,
    strict: Annotated[bool, typer.Option("--strict", help="exit 1 on warnings")] = False,
    assemble: AssembleOption = False,
    limit: LimitOption = settings.LIMIT,
    witness: Annotated[
        str | None,
        typer.Option(
            "--witness",
            metavar="NAME",
            help="a loop that shows a row to be nonholonomic",
            autocompletion=completing.differential,
        ),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of that loop: png, svg, pdf")
    ] = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Classify the constraints, count the degrees of freedom, check the initial values.

    With --json one object for one MODEL; for several a list in the order of the MODELs, each with path and title.
    """
    from lagcli.api import check as checking
    from lagcli.cli import check_text, preflight, witness_command

    options = preflight.CheckOptions(strict, assemble, limit, witness, plot, as_json, quiet, verbose)
    options.require(models)
    answers: list[dict[str, object]] = []
    codes: list[int] = []
    for path in models:
        began = time.perf_counter()
        try:
            read = model_reading.load(path, changes)
            report = checking.check(read, assemble=assemble, limit=limit)
            shown = witness_command.shown(read, report, options) if witness is not None else None
        except diagnostics.ModelError as error:
            codes.append(exits.of(error))
            answers.append({**({"path": path} if len(models) > 1 else {}), **json_output.errors(error)})
            if not as_json:
                exits.say(str(error))
            continue
        # Several objects in a list say which model each is of.
        heading = {"path": report.path, "title": report.title} if len(models) > 1 else {}
        witnessed = {} if shown is None else {"witness": shown.as_json()}
        answers.append({**heading, **report.as_json(), **witnessed})
        warned = any(found.severity == "warning" for found in report.warnings)
        codes.append(exits.INVALID if strict and warned else exits.DONE)
        if not as_json:
            check_text.report(report, heading=len(models) > 1)
            told = report.initial.assembled.lines(read.units) if report.initial.assembled else ()
            exits.say_all(() if quiet else (*told, *(warning.render() for warning in report.warnings)))
        if shown is not None:
            codes.append(shown.tell(as_json))
        if verbose:
            exits.say(f"{report.path}: checked in {time.perf_counter() - began:.3f} s")
    if as_json:
        print(json_output.text(answers[0] if len(answers) == 1 else answers))
    raise exits.Exit(max(codes))
