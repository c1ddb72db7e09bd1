"""`lagcli check`: the report of each model."""

from __future__ import annotations

import time

from lagcli.api import check as checking
from lagcli.cli.actions import check_text, witness_command
from lagcli.cli.requests import model_reading
from lagcli.cli.requests.asked_check import CheckOptions
from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics
from lagcli.output.files import json_text


def run(models: list[str], changes: list[str] | None, options: CheckOptions) -> None:
    """Report on all models. Raises `exits.Exit` with the worst of their codes, `exits.UsageError`."""
    answers: list[dict[str, object]] = []
    codes: list[int] = []
    for path in models:
        began = time.perf_counter()
        try:
            read = model_reading.load(path, changes)
            report = checking.check(read, assemble=options.assemble, limit=options.limit)
            shown = witness_command.shown(read, report, options) if options.witness is not None else None
        except diagnostics.ModelError as error:
            codes.append(exits.of(error))
            if options.as_json:
                answers.append({**({"path": path} if len(models) > 1 else {}), **model_reading.errors(error)})
            else:
                exits.print_err(str(error))
            continue
        # Several objects in a list say which model each is of.
        heading = {"path": report.path, "title": report.title} if len(models) > 1 else {}
        witnessed = {} if shown is None else {"witness": shown.as_json()}
        if options.as_json:
            answers.append({**heading, **report.as_json(), **witnessed})
        warned = any(found.severity == "warning" for found in report.warnings)
        codes.append(exits.INVALID if options.strict and warned else exits.DONE)
        if not options.as_json:
            check_text.report(report, heading=len(models) > 1)
            lines = report.initial.assembled.lines(read.units) if report.initial.assembled else ()
            exits.print_err_all(
                () if options.quiet else (*lines, *(warning.render() for warning in report.warnings))
            )
        if shown is not None:
            codes.append(shown.print_report(options.as_json))
        if options.verbose:
            exits.print_err(f"{report.path}: checked in {time.perf_counter() - began:.3f} s")
    if options.as_json:
        print(json_text.text(answers[0] if len(answers) == 1 else answers))
    raise exits.Exit(max(codes))
