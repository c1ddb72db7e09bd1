"""`lagcli compare`: formulations side by side, with the digits to which they agree."""

from __future__ import annotations

from typing import Annotated

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats, write_guard

COLOURS = {"stopped": "red"}


@options.command("method")
def compare(
    model: options.ModelArgument,
    other: Annotated[
        str | None,
        options.argument("[OTHER]", "a second model, compared on shared columns", completing.model_files),
    ] = None,
    *,
    run_settings: RunSettings,
    columns: Annotated[
        str | None, options.named("PATTERNS", "columns to compare, such as 'a.*,R.*'", completing.columns)
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(help="largest difference that passes, as a part of the largest value (1e-8)"),
    ] = None,
    vakonomic: Annotated[bool, "also the motion of the other principle, with multipliers μ"] = False,
    mu: Annotated[
        list[str] | None,
        options.named(
            "NAME=VALUE", "initial μ of a differential row (0); repeatable", completing.multipliers
        ),
    ] = None,
    output: Annotated[str | None, options.output("table of the vakonomic motion; - for stdout")] = None,
    plot: Annotated[str | None, options.file("figure of the two motions: png, svg, pdf")] = None,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Run a model in every formulation that fits, or two models, and show to how many digits they agree.

    Newton with multipliers, Lagrange with multipliers, reduced by the null space; with --vakonomic also the motion that
    makes the action stationary among those that satisfy the rows, which in general is another one. Exit 1 where
    formulations disagree, 3 where a run stops before its end.
    """
    paths = [model] if other is None else [model, other]
    options.require_models(paths)
    if vakonomic:
        if other is not None:
            raise exits.UsageError("--vakonomic compares the two principles of one MODEL")
        write_guard.require_outputs(model, output, plot, as_json)
    for option, value in (("--mu", mu), ("--output", output), ("--plot", plot)):
        if value and not vakonomic:
            raise exits.UsageError(f"{option} is of the vakonomic motion; give --vakonomic too")
    with options.json_errors(as_json):
        read = [options.load(path, changes) for path in paths]
    if verbose:
        exits.print_warnings(warning for one in read for warning in one.warnings)
    given: options.Keywords = {"columns": columns or "*", "tolerance": tolerance, "vakonomic": vakonomic}
    multipliers: dict[str, str] = {}
    for text in mu or ():
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name:
            meant = "write NAME=VALUE, the initial multiplier of a differential row"
            raise exits.UsageError(f"--mu {text}: {meant}")
        if name in multipliers:
            raise exits.UsageError(f"--mu {name}: given twice")
        multipliers[name] = value
    given |= {**run_settings, "mu": multipliers}
    from lagcli.api import compare as comparing
    from lagcli.formulations import comparison

    with options.refusals(as_json):
        found, told = comparing.compare_to_files(read, given, output, plot)
    exits.print_err_all(told)
    headers, rows, reading, disagreement = comparison.lines(found)
    principles = "" if found.principles is None else found.principles.sentence
    if as_json:
        print(formats.json_line(found.as_json()))
    elif output == "-":
        exits.print_err_all([principles] if principles else [])
    else:
        console.table(headers, rows, COLOURS)
        for sentence in filter(None, (reading, principles)):
            print()
            console.paragraph(sentence)
    exits.print_notes(found.notes, quiet)
    if disagreement:
        exits.print_err(f"lagcli: {disagreement}")
        raise exits.Exit(exits.INVALID)
    if found.stopped:
        raise exits.Exit(exits.STOPPED)
