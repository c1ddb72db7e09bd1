"""The commands and their options."""

from __future__ import annotations

import textwrap
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from lagcli.cli import command_group, exits, json_output
from lagcli.cli.options import (
    AssembleOption,
    CheckpointOption,
    ColumnsOption,
    DebugOption,
    DigitsOption,
    EventRowsOption,
    EventsOption,
    FromOption,
    JsonOption,
    LimitOption,
    ModelArgument,
    OutputOption,
    OutputStepOption,
    PointsOption,
    QuietOption,
    ResumeOption,
    SeedOption,
    SetOption,
    StartsOption,
    VerboseOption,
)
from lagcli.errors import diagnostics
from lagcli.model import settings

if TYPE_CHECKING:
    from lagcli.api import find_modes
    from lagcli.model import model as nouns

app = typer.Typer(
    name="lagcli",
    cls=command_group.CommandGroup,
    help="Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems.",
    epilog="MODEL is a YAML file; - reads it from standard input.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from lagcli import __version__

        print(f"lagcli {__version__}", flush=True)
        raise typer.Exit()


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    """Degrees of freedom, Lagrange multipliers and constraint forces of constrained mechanical systems."""


@app.command(short_help="Print the number of degrees of freedom.")
@exits.command
def dof(
    model: ModelArgument,
    changes: SetOption = None,
    as_json: JsonOption = False,
    explain: Annotated[bool, typer.Option("--explain", help="show the count line by line")] = False,
    limit: LimitOption = settings.LIMIT,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Print the number of degrees of freedom, 3N - s (n - s with generalized coordinates).

    Exit 4 and nothing on standard output where it is not decided.
    """
    from lagcli.api import count_dof
    from lagcli.cli import check_text

    read = _reported(lambda: _load(model, changes), as_json)
    counted = _reported(lambda: count_dof.dof(read, limit=limit), as_json)
    if as_json:
        print(json_output.text(counted.as_json()))
    elif explain:
        print("\n".join(check_text.count(counted)))
    elif counted.configuration_dof is not None:
        print(counted.configuration_dof)
    if not quiet and not explain:
        exits.say_all(f"note: {note}" for note in counted.notes)
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
        exits.say_all(() if explain else check_text.count(counted))
    if counted.configuration_dof is None:
        low, high = counted.bounds
        exits.say(f"lagcli: undecided, between {low} and {high}: {counted.reason}")
        raise exits.Exit(exits.UNDECIDED)


@app.command(short_help="Classify the constraints, count, check the start.")
@exits.command
def check(
    models: Annotated[
        list[str], typer.Argument(metavar="MODEL...", help="model files; - for standard input")
    ],
    changes: SetOption = None,
    as_json: JsonOption = False,
    strict: Annotated[bool, typer.Option("--strict", help="exit 1 on warnings")] = False,
    assemble: AssembleOption = False,
    limit: LimitOption = settings.LIMIT,
    witness: Annotated[
        str | None,
        typer.Option("--witness", metavar="NAME", help="a loop that shows a row to be nonholonomic"),
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
            read = _load(path, changes)
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


@app.command(short_help="Integrate and write the table of the motion.")
@exits.command
def simulate(
    model: ModelArgument,
    output: OutputOption = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of lambda and R: png, svg, pdf")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the run")] = None,
    output_step: OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance")] = None,
    max_step: Annotated[
        float | None, typer.Option("--max-step", help="no step is longer: for forces that steps may miss")
    ] = None,
    method: Annotated[str | None, typer.Option(metavar="NAME", help=" or ".join(settings.METHODS))] = None,
    assemble: AssembleOption = False,
    columns: ColumnsOption = None,
    events: EventsOption = None,
    event_rows: EventRowsOption = False,
    stats: Annotated[str | None, typer.Option(metavar="FILE", help="the account of the run as JSON")] = None,
    checkpoint: CheckpointOption = None,
    resume: ResumeOption = None,
    begin: FromOption = None,
    digits: DigitsOption = False,
    limit: LimitOption = settings.LIMIT,
    changes: SetOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="errors, and the account if stdout is free, as JSON on stdout")
    ] = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Integrate m a = F + sum lambda_i B_i and write t, r, v, lambda, R, energy as a table.

    CSV on standard output without -o and --plot. Exit 3 where the integration stops before its end: the rows
    so far are in FILE.partial, and FILE is as it was.
    """
    from lagcli.api import run_settings
    from lagcli.cli import preflight, simulate_command

    options = preflight.SimulateOptions(
        output,
        plot,
        stats,
        columns,
        as_json,
        quiet,
        verbose,
        checkpoint,
        resume,
        limit,
        digits,
        events,
        event_rows,
    )
    options.require(model)
    read = _reported(lambda: _load(model, changes), as_json)
    if begin is not None:
        read = simulate_command.from_row(read, begin, resume)
    given = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "method": method, "assemble": True if assemble else None,
    }  # fmt: skip
    try:
        chosen = run_settings.chosen(read, given)
    except ValueError as error:
        raise exits.UsageError(str(error)) from None
    simulate_command.run(_reported(lambda: simulate_command.ready(read, chosen, options), as_json), options)


@app.command(short_help="Run a model in several formulations and compare them.")
@exits.command
def compare(
    model: ModelArgument,
    other: Annotated[
        str | None, typer.Argument(metavar="[OTHER]", help="a second model, compared on shared columns")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the runs")] = None,
    output_step: OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted (101)")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance of the runs")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance of the runs")] = None,
    max_step: Annotated[
        float | None, typer.Option("--max-step", help="no step of the runs is longer")
    ] = None,
    assemble: AssembleOption = False,
    columns: Annotated[
        str | None, typer.Option(metavar="PATTERNS", help="columns to compare, such as 'a.*,R.*'")
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(help="largest difference that passes, as a part of the largest value (1e-8)"),
    ] = None,
    vakonomic: Annotated[
        bool, typer.Option("--vakonomic", help="also the motion of the other principle, with multipliers μ")
    ] = False,
    mu: Annotated[
        list[str] | None,
        typer.Option("--mu", metavar="NAME=VALUE", help="initial μ of a differential row (0); repeatable"),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help="table of the vakonomic motion; - for stdout"),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the two motions: png, svg, pdf")
    ] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Run a model in every formulation that fits, or two models, and show to how many digits they agree.

    Newton with multipliers, Lagrange with multipliers, reduced by the null space; with --vakonomic also the motion that
    makes the action stationary among those that satisfy the rows, which in general is another one. Exit 1 where
    formulations disagree, 3 where a run stops before its end.
    """
    from lagcli.cli import compare_command, preflight

    paths = [model] if other is None else [model, other]
    preflight.require_models(paths)
    principles = preflight.PrinciplesOptions(vakonomic, tuple(mu or ()), output, plot)
    principles.require(paths, as_json)
    read = _reported(lambda: [_load(path, changes) for path in paths], as_json)
    given: preflight.RepeatedRuns = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    options = preflight.CompareOptions(columns, tolerance, as_json, quiet, principles)
    if verbose:
        exits.say_all(warning.render() for one in read for warning in one.warnings)
    second = read[1] if other is not None else None
    _reported(lambda: compare_command.run(read[0], second, given, options), as_json)


@app.command(short_help="A constraint as the limit of a stiff spring.")
@exits.command
def limit(
    model: ModelArgument,
    constraint: Annotated[
        str, typer.Option("--constraint", metavar="NAME", help="the holonomic row that becomes a spring")
    ],
    stiffness: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="stiffnesses, two a decade (1e3:1e5); LOW:HIGH:COUNT"),
    ] = None,
    unprestressed: Annotated[
        bool, typer.Option("--unprestressed", help="start without stretch, not on the slow motion")
    ] = False,
    ramp: Annotated[
        float | None,
        typer.Option("--ramp", metavar="SECONDS", help="one run in which k rises over all of them"),
    ] = None,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="FILE", help="table; - for standard output")
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of forces and errors: png, svg, pdf")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the runs")] = None,
    output_step: OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance of the runs")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance of the runs")] = None,
    max_step: Annotated[
        float | None, typer.Option("--max-step", help="no step of the runs is longer")
    ] = None,
    assemble: AssembleOption = False,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Replace a holonomic row f = 0 by the potential k f^2/2 for growing k, and set its force -k f against lambda.

    Runs start on the slow motion, where the spring pulls as the row does, and the error goes as 1/k. Exit 3 where a run
    stops before its end.
    """
    from lagcli.cli import limit_command, preflight

    preflight.require_models([model])
    options = preflight.LimitOptions(constraint, stiffness, unprestressed, ramp, output, plot, as_json, quiet)
    options.require(model)
    read = _reported(lambda: _load(model, changes), as_json)
    given: preflight.RepeatedRuns = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
    _reported(lambda: limit_command.run(read, given, options), as_json)


@app.command(short_help="A second opinion on a run, from its table alone.")
@exits.command
def audit(
    model: ModelArgument,
    run: Annotated[
        str | None,
        typer.Option(
            "--run", metavar="FILE", help="a table: .csv, .tsv, .json, .npz, .parquet; else a new run"
        ),
    ] = None,
    events: Annotated[
        str | None,
        typer.Option("--events", metavar="FILE", help="the events of that run, of `simulate --events`"),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the checks: png, svg, pdf")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="length of the new run")] = None,
    samples: Annotated[int | None, typer.Option(help="number of rows of the new run")] = None,
    rtol: Annotated[float | None, typer.Option(help="relative tolerance of the run")] = None,
    atol: Annotated[float | None, typer.Option(help="absolute tolerance of the run")] = None,
    max_step: Annotated[
        float | None, typer.Option("--max-step", help="no step of the new run is longer")
    ] = None,
    assemble: AssembleOption = False,
    digits: Annotated[
        bool, typer.Option("--digits", help="how many digits of the table are right, from the run repeated")
    ] = False,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Check a table of t, r, v, lambda, R against the laws of the model, without the functions of the solver.

    Exit 1 where a check fails, 3 where the new run stops before its end.
    """
    from lagcli.cli import audit_command, preflight

    has_rows = duration is not None or samples is not None
    options = preflight.AuditOptions(run, events, plot, digits, as_json, quiet, verbose, has_rows)
    options.require(model)
    read = _reported(lambda: _load(model, changes), as_json)
    given: audit_command.AuditedRun = {
        "duration": duration, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    _reported(lambda: audit_command.run(read, given, options), as_json)


@app.command(short_help="Allowed and virtual displacements at an instant.")
@exits.command
def displacements(
    model: ModelArgument,
    at: Annotated[
        float | None, typer.Option(metavar="T", help="the time to run to; by default the start")
    ] = None,
    assemble: AssembleOption = False,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Print bases of the allowed and virtual displacements, the dependent and independent components, and whether the
    forces between particles act along lines.

    Exit 3 where the motion stops before T.
    """
    from lagcli.cli import displacements_command as displacing

    read = _reported(lambda: _load(model, changes), as_json)
    _reported(lambda: displacing.run(read, at, assemble, as_json, quiet), as_json)


@app.command(short_help="Small oscillations: frequencies, shapes, stability.")
@exits.command
def modes(
    model: ModelArgument,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the shapes: png, svg, pdf")
    ] = None,
    about: Annotated[
        str, typer.Option(metavar="WHAT", help="start, equilibrium, or the one that fits: auto")
    ] = "auto",
    lowest: Annotated[
        int | None,
        typer.Option(metavar="N", help="how many modes of a model of more than 600 coordinates (20)"),
    ] = None,
    animate: Annotated[
        str | None, typer.Option("--animate", metavar="FILE", help="not built yet: refused", hidden=True)
    ] = None,
    assemble: AssembleOption = False,
    limit: LimitOption = settings.LIMIT,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Linearize about the start, if that is an equilibrium or a steady motion, else about the nearest equilibrium, and
    print frequencies, shapes and whether it is stable.

    Exit 4 where there is no equilibrium to be found.
    """
    from lagcli.cli import modes_command, preflight

    options = preflight.ModesOptions(plot, animate, as_json, quiet)
    options.require(model)
    read = _reported(lambda: _load(model, changes), as_json)
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
    given: find_modes.ModesSettings = {
        "about": about, "assemble": True if assemble else None, "limit": limit,
        "lowest": lowest,
    }  # fmt: skip
    _reported(lambda: modes_command.run(read, given, options), as_json)


@app.command(short_help="Stationary points of a function on the constraint surfaces.")
@exits.command
def stationary(
    model: ModelArgument,
    of: Annotated[str, typer.Option("--of", metavar="EXPR", help="the function, such as 'a.x*a.y'")],
    output: PointsOption = None,
    starts: StartsOption = 32,
    seed: SeedOption = 0,
    limit: LimitOption = settings.LIMIT,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Find the stationary points of a function of the coordinates on the holonomic surfaces, with their multipliers.

    Masses and forces play no part. Exit 4 where none is found.
    """
    from lagcli.cli import preflight, stationary_command

    options = preflight.PointOptions(output, starts, seed, limit, as_json, quiet)
    options.require(model)
    read = _reported(lambda: _load(model, changes), as_json)
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
    _reported(lambda: stationary_command.run(read, of, options), as_json)


@app.command(short_help="Points of rest, with multipliers and type.")
@exits.command
def equilibrium(
    model: ModelArgument,
    output: PointsOption = None,
    starts: StartsOption = 32,
    seed: SeedOption = 0,
    limit: LimitOption = settings.LIMIT,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Find the points of rest: with zero velocities and accelerations the equations of motion hold at every t.

    With lambda, R, the effective potential and the type by the bordered Hessian. Exit 4 where none is found.
    """
    from lagcli.cli import equilibrium_command, preflight

    options = preflight.PointOptions(output, starts, seed, limit, as_json, quiet)
    options.require(model)
    read = _reported(lambda: _load(model, changes), as_json)
    if verbose:
        exits.say_all(warning.render() for warning in read.warnings)
    _reported(lambda: equilibrium_command.run(read, options), as_json)


@app.command(short_help="Print the equations of motion.")
@exits.command
def derive(
    model: ModelArgument,
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="text, latex, markdown, html or json")
    ] = "text",
    solve: Annotated[
        bool, typer.Option("--solve", help="lambda and accelerations in closed form, up to four rows")
    ] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="every member of families and every term of sums")
    ] = False,
    values: Annotated[
        str, typer.Option(metavar="NAMES", help="parameters to put in as numbers, such as 'm,g'; all")
    ] = "",
    limit: LimitOption = settings.LIMIT,
    changes: SetOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="as --format json")] = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Print the equations of motion as they are written on paper, each line with its number in the text.

    Constraints, rows, reactions, energies, Newton's and Lagrange's equations, the identity between them verified, and
    the linear system for lambda.
    """
    from lagcli.cli import derive_command, preflight

    form = "json" if as_json else form
    options = preflight.DeriveOptions(form, solve, everything, values, limit)
    options.require()
    read = _reported(lambda: _load(model, changes), form == "json")
    began = time.perf_counter()
    page = _reported(lambda: derive_command.derived(read, options), form == "json")
    derive_command.write(page, form)
    if not quiet:
        exits.say_all(warning.render() for warning in (read.warnings if verbose else ()))
    if verbose:
        exits.say(f"{read.path}: derived in {time.perf_counter() - began:.3f} s")


@app.command(short_help="Explain an error or warning and how to fix it.")
@exits.command
def explain(
    code: Annotated[
        str | None, typer.Argument(metavar="CODE", help="the word in brackets of a message, or D.24")
    ] = None,
    debug: DebugOption = False,
) -> None:
    """Explain an error or warning and how to fix it, or an equation such as D.24; without CODE list all."""
    from lagcli.errors import catalogue, equation_list

    if code is None:
        print("\n".join(catalogue.lines()))
        return
    try:
        equation = equation_list.line(code)
    except ValueError:
        raise exits.UsageError(f"the equations are D.1 to D.{equation_list.LAST}") from None
    if equation is not None:
        print(textwrap.fill(equation, 80), textwrap.fill(equation_list.TEXT, 80), sep="\n\n")
        return
    page = catalogue.page(code)
    if page is None:
        hint = (
            diagnostics.nearest(code, catalogue.codes())
            or "`lagcli explain` lists all codes with their meaning"
        )
        raise exits.UsageError(f"unknown error code `{code}`; {hint}")
    print(catalogue.render(page))


def _load(path: str, changes: list[str] | None) -> nouns.Model:
    from lagcli.api import load

    given: dict[str, object] = {}
    for change in changes or ():
        name, sign, value = change.partition("=")
        if not sign or not name.strip():
            raise exits.UsageError(f"--set {change}: write NAME=EXPR")
        given[name.strip()] = value
    try:
        return load.load(path, given)
    except FileNotFoundError:
        raise exits.UsageError(f"there is no file {path}") from None
    except OSError as error:
        raise exits.UsageError(f"cannot read {path}: {error.strerror}") from None


T = TypeVar("T")


def _reported(compute: Callable[[], T], as_json: bool) -> T:
    """The value of `compute`; an invalid model is reported on stdout where JSON was asked for."""
    try:
        return compute()
    except diagnostics.ModelError as error:
        if as_json:
            print(json_output.text(json_output.errors(error)))
            raise exits.Exit(exits.of(error)) from None
        raise
