"""The commands and their options."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from lagcli import diagnostics
from lagcli import model as nouns
from lagcli.cli import exits

app = typer.Typer(
    name="lagcli",
    help="Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)

ModelArgument = Annotated[str, typer.Argument(metavar="MODEL", help="model file; - for standard input")]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=EXPR", help="another parameter or initial value (theta.value); repeatable"
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="JSON on standard output")]
QuietOption = Annotated[bool, typer.Option("-q", "--quiet", help="only errors on standard error")]
VerboseOption = Annotated[bool, typer.Option("-v", "--verbose", help="more on standard error")]
DebugOption = Annotated[bool, typer.Option("--debug", help="a traceback where lagcli itself fails")]


def _version(wanted: bool) -> None:
    if wanted:
        from lagcli import __version__

        print(f"lagcli {__version__}")
        raise typer.Exit()


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    """Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems."""


@app.command()
@exits.command
def dof(
    model: ModelArgument,
    changes: SetOption = None,
    as_json: JsonOption = False,
    explain: Annotated[bool, typer.Option("--explain", help="show the count line by line")] = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Print the number of degrees of freedom, 3N - s (n - s with generalized coordinates)."""
    from lagcli import pipeline

    counted = _reported(lambda: pipeline.count(_load(model, changes)), as_json)
    if as_json:
        print(json.dumps(counted.as_json()))
    elif explain:
        from lagcli.cli import tellings

        print("\n".join(tellings.count(counted)))
    elif counted.configuration_dof is not None:
        print(counted.configuration_dof)
    if not quiet:
        for note in counted.notes:
            exits.say(f"note: {note}")
    if counted.configuration_dof is None:
        low, high = counted.bounds
        exits.say(f"lagcli: undecided, between {low} and {high}: {counted.reason}")
        raise exits.Exit(exits.UNDECIDED)


@app.command()
@exits.command
def check(
    models: Annotated[
        list[str], typer.Argument(metavar="MODEL...", help="model files; - for standard input")
    ],
    changes: SetOption = None,
    as_json: JsonOption = False,
    strict: Annotated[bool, typer.Option("--strict", help="exit 1 on warnings")] = False,
    limit: Annotated[
        float, typer.Option("--limit", metavar="SECONDS", min=0.0, help="time for proofs")
    ] = 20.0,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Classify the constraints, count the degrees of freedom, check the initial values."""
    from lagcli import pipeline
    from lagcli.cli import tellings

    objects: list[dict[str, Any]] = []
    worst = exits.DONE
    for path in models:
        try:
            report = pipeline.check(_load(path, changes), limit)
        except diagnostics.ModelError as error:
            worst = exits.INVALID
            objects.append(json.loads(exits.errors_as_json(error)))
            if not as_json:
                exits.say(str(error))
            continue
        objects.append(report.as_json())
        if not as_json:
            tellings.report(report, heading=len(models) > 1)
            for warning in () if quiet else report.warnings:
                exits.say(warning.render())
        if strict and report.warnings:
            worst = exits.INVALID
    if as_json:
        print(json.dumps(objects[0] if len(objects) == 1 else objects, ensure_ascii=False))
    raise exits.Exit(worst)


@app.command()
@exits.command
def simulate(
    model: ModelArgument,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help=".csv, .json, .npz, .parquet; - for stdout"),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of lambda and R: png, svg, pdf")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the run")] = None,
    output_step: Annotated[float | None, typer.Option("--output-step", help="time between rows")] = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance of a step")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance of a step")] = None,
    method: Annotated[str | None, typer.Option(help="auto or dop853")] = None,
    assemble: Annotated[
        bool, typer.Option("--assemble", help="move the start to the nearest consistent state")
    ] = False,
    columns: Annotated[
        str | None, typer.Option(metavar="PATTERNS", help="columns to write, such as 't,lambda.*,R.a.*'")
    ] = None,
    stats: Annotated[str | None, typer.Option(metavar="FILE", help="the account of the run as JSON")] = None,
    changes: SetOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Integrate m a = F + sum lambda_i B_i and write t, r, v, lambda, R, energy as a table."""
    from lagcli import pipeline
    from lagcli.cli import running

    wishes = running.Wishes(output, plot, stats, columns, quiet, verbose)
    wishes.check()
    read = _load(model, changes)
    given = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "method": method, "assemble": True if assemble else None,
    }  # fmt: skip
    try:
        chosen = pipeline.run_settings(read, given)
    except ValueError as error:
        raise exits.UsageError(str(error)) from None
    running.run(read, chosen, wishes)


@app.command()
@exits.command
def explain(
    code: Annotated[
        str | None, typer.Argument(metavar="CODE", help="the word in brackets of a message")
    ] = None,
    debug: DebugOption = False,
) -> None:
    """Say what an error or warning means, why, with an example and the cure; without CODE list all."""
    from lagcli import catalogue

    if code is None:
        print("\n".join(catalogue.codes()))
        return
    page = catalogue.page(code)
    if page is None:
        hint = diagnostics.nearest(code, catalogue.codes())
        raise exits.UsageError(f"there is no message `{code}`" + (f"; {hint}" if hint else ""))
    print(catalogue.render(page))


def _load(path: str, changes: list[str] | None) -> nouns.Model:
    from lagcli import pipeline

    given: dict[str, object] = {}
    for change in changes or ():
        name, sign, value = change.partition("=")
        if not sign or not name.strip():
            raise exits.UsageError(f"--set {change}: write NAME=EXPR")
        given[name.strip()] = value
    try:
        return pipeline.load(path, given)
    except FileNotFoundError:
        raise exits.UsageError(f"there is no file {path}") from None
    except OSError as error:
        raise exits.UsageError(f"cannot read {path}: {error.strerror}") from None


def _reported(compute: Any, as_json: bool) -> Any:
    """The value of `compute`; an invalid model is reported on stdout too where JSON was asked for."""
    try:
        return compute()
    except diagnostics.ModelError as error:
        if as_json:
            print(exits.errors_as_json(error))
            raise exits.Exit(exits.INVALID) from None
        raise
